"""Lives of contacts that age and break where they reach their thresholds (model section 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mesoslip.array_types import Array
from mesoslip.theory.contacts.steady import check_steady
from mesoslip.theory.delays import drag_impulse, mean_delay
from mesoslip.theory.thresholds import threshold_quadrature

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Panels and points of the quadrature over the configured thresholds.
PANELS, POINTS = 80, 12


def quadrature(config: Config) -> tuple[Array, Array]:
    """Weights and points over the configured thresholds, relative to the mean."""
    return threshold_quadrature(config, PANELS, POINTS)


def steady_force(config: Config, velocity: float) -> float:
    """Force of contacts that slide steadily at a velocity [m/s], with delay and drag [N].

    A contact attaches with the back force, which grows by k v in a second, and breaks at the first
    time T at which it is its threshold; then it is dragged for the delay:

        F = N (<∫_0^T f dt> + m eta v tau_d) / (<T> + tau_d)

    For contacts that do not age this is the formula of model section 4, with equal coupling.
    """
    contacts = config.contacts
    check_steady(config)
    weight, threshold = quadrature(config)
    back = contacts.back_force_ratio
    if velocity == 0 or np.isinf(velocity):
        # All contacts are old when they break, or all young.
        broken = contacts.threshold_at(threshold, np.inf if velocity == 0 else 0.0)
        work = float(weight @ (broken**2 - back**2)) / 2
        return contacts.static_force * work / float(weight @ (broken - back))
    speed = velocity / contacts.break_stretch
    life = lives(config, threshold, speed)
    work = float(weight @ (back * life + speed * life**2 / 2))
    return (contacts.static_force * work + drag_impulse(config, velocity)) / (
        float(weight @ life) + mean_delay(config)
    )


def lives(config: Config, configured: Array, speed: float, older: float = 0.0) -> Array:
    """Times T at which contacts break whose forces grow by f_s times a speed in a second [s].

    They are older than that by a time in which they were held.
    """
    from scipy.optimize.elementwise import find_root

    contacts = config.contacts
    back = contacts.back_force_ratio

    # Thresholds are concave in time where they grow, and fall otherwise: there is one solution.
    def gap(time: Array, threshold: Array) -> Array:
        return contacts.threshold_at(threshold, older + time) - back - speed * time

    upper = np.ones_like(configured) / speed
    while np.any(gap(upper, configured) > 0):
        upper = np.where(gap(upper, configured) > 0, 2 * upper, upper)
    # Interpolation that leaves the bracket is not a number, and is not used.
    with np.errstate(invalid="ignore"):
        lives: Array = find_root(
            gap, (np.zeros_like(upper), upper), args=(configured,), tolerances={"xrtol": 1e-14}
        ).x
    return lives
