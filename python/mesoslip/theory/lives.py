"""Scales of the lives of contacts, from attaching to breaking, under a slider moving forward."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from mesoslip import _core
from mesoslip.configuration.kernel_parameters import Parameters, named
from mesoslip.simulation.kernel import checked

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


def law_parameters(config: Config, newborn_width: float = 0.0) -> Parameters:
    """Contact parameters for the kernels of the master equation; ``newborn_width`` in m."""
    contacts = config.contacts
    return {
        **contacts.threshold.kernel_parameters,
        "coupling": contacts.coupling,
        "back_force_ratio": contacts.back_force_ratio,
        "newborn_width": newborn_width * contacts.stiffness / contacts.static_force,
        "reattach": int(contacts.reattach),
        "initial": contacts.initial,
    }


def scales(config: Config, newborn_width: float = 0.0) -> Scales:
    """Scales of a configuration's contacts; ``newborn_width`` in m."""
    (values,) = checked(_core.contact_scales(*named(law_parameters(config, newborn_width))))
    return Scales(*(float(value) for value in values))
