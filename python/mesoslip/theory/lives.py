"""Scales of the lives of contacts, from attaching to breaking, under a slider moving forward."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip import _core
from mesoslip.configuration.kernel_parameters import Parameters, named
from mesoslip.simulation.kernel import checked

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Probability of a force beyond the threshold against the motion that counts as none.
MAX_BEYOND = 1e-6


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


def newborn_stretch(config: Config) -> float | None:
    """Standard deviation of the stretch at which contacts attach [m]; None if they differ in
    stiffness, or some would attach beyond their threshold."""
    contacts = config.contacts
    width, back = contacts.newborn_width, contacts.back_force_ratio
    if width == 0:
        return 0.0
    law = contacts.threshold.above(contacts.min_threshold)
    probability = (np.arange(1000) + 0.5) / 1000
    beyond = np.mean(
        [math.erfc((u + back) / (width * math.sqrt(2))) / 2 for u in law.quantile(probability)]
    )
    if contacts.coupling != "equal" or beyond > MAX_BEYOND:
        return None
    return width * contacts.break_stretch


def scales(config: Config, newborn_width: float = 0.0) -> Scales:
    """Scales of a configuration's contacts; ``newborn_width`` in m."""
    (values,) = checked(_core.contact_scales(*named(law_parameters(config, newborn_width))))
    return Scales(*(float(value) for value in values))
