"""Scales of the lives of contacts, from attaching to breaking, under a slider moving forward."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from mesoslip import _core
from mesoslip.configuration.contacts.tables import COUPLINGS
from mesoslip.errors import RunError

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


class Scales(NamedTuple):
    """Dimensionless: displacements over f_s/k, forces over f_s, stiffness over k, mass over m."""

    shortest: float
    longest: float
    mean_life: float
    newborn_stiffness: float
    newborn_force: float
    first_shortest: float
    first_longest: float
    steady_force: float
    mean_mass: float


def law_arguments(config: Config, newborn_width: float = 0.0) -> tuple[Any, ...]:
    """What the kernels of the master equation are told of contacts; ``newborn_width`` in m."""
    contacts = config.contacts
    return (
        contacts.threshold.code,
        contacts.threshold.relative_width,
        COUPLINGS[contacts.coupling],
        contacts.back_force_ratio,
        newborn_width * contacts.stiffness / contacts.static_force,
        int(contacts.reattach),
        config.initial_code,
    )


def checked(results: tuple[Any, ...]) -> tuple[Any, ...]:
    """Results of a kernel without its status and message.

    Raises
    ------
    RunError
        If the kernel failed.
    """
    *values, status, message = results
    if status != 0:
        raise RunError(message.decode().strip())
    return tuple(values)


def scales(config: Config, newborn_width: float = 0.0) -> Scales:
    """Scales of a configuration's contacts; ``newborn_width`` in m."""
    (values,) = checked(_core.contact_scales(*law_arguments(config, newborn_width)))
    return Scales(*(float(value) for value in values))
