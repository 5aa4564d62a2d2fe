"""Steady sliding of contacts that age, at a constant velocity (model section 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip.theory.thresholds import threshold_quadrature

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

# Panels and points of the quadrature over the configured thresholds, and the normal deviate that
# has the probability of its limits.
PANELS, POINTS = 80, 12


def steady_force(config: Config, velocity: float) -> float:
    """Force of contacts that slide steadily at a velocity, with delay and drag [N].

    A contact attaches with the back force, which grows by k v in a second, and breaks at the first
    time T at which it is its threshold; then it is dragged for the delay:

        F = N (<∫_0^T f dt> + m eta v tau_d) / (<T> + tau_d)

    For contacts that do not age this is the formula of model section 4, with equal coupling.

    Parameters
    ----------
    config
        A configuration with contacts that age.
    velocity
        Positive [m/s]; 0 for the limit of slow sliding, of the law `relax` only, and infinity for
        that of fast sliding, both without delay and drag.

    Returns
    -------
    float
        The force [N].
    """
    contacts = config.contacts
    weight, threshold = threshold_quadrature(config, PANELS, POINTS)
    back = contacts.back_force_ratio
    if velocity == 0 or np.isinf(velocity):
        # All contacts are old when they break, or all young.
        broken = _threshold(config, threshold, np.inf if velocity == 0 else 0.0)
        work = float(weight @ (broken**2 - back**2)) / 2
        return contacts.static_force * work / float(weight @ (broken - back))
    speed = velocity / contacts.break_stretch
    life = lives(config, threshold, speed)
    delay = 0.0 if config.slider.ignores_delay else contacts.delay
    work = float(weight @ (back * life + speed * life**2 / 2))
    drag = contacts.contact_drag * contacts.count * velocity * delay
    return (contacts.static_force * work + drag) / (float(weight @ life) + delay)


def mean_life(config: Config, velocity: float) -> float:
    """Mean displacement from attaching to breaking, v <T> [m]; at velocity 0 that of the old."""
    weight, threshold = threshold_quadrature(config, PANELS, POINTS)
    stretch = config.contacts.break_stretch
    if velocity == 0:
        broken = _threshold(config, threshold, np.inf)
        return stretch * float(weight @ broken - config.contacts.back_force_ratio)
    return velocity * float(weight @ lives(config, threshold, velocity / stretch))


def restart_peak(config: Config, velocity: float, hold: float) -> float:
    """Maximum force of a restart at the velocity before a hold, under a prescribed slider [N].

    Sliding at v leaves contacts whose displacements w since they attached are spread evenly up to
    the life l of each. Held for so long, a contact would break after a life of L instead, at the
    age of the hold and L/v; so at a displacement y from the restart those with w > L - y have
    broken, and each has lost L of its stretch by now. In stretches x^ = f_s/k, per contact,

        F(y) = F(0) + y - <L max(0, y - (L - l))>/<l>,

    whose maximum is where <L; L - l < y> = <l>. It is exact for infinitely many contacts
    without delay that do not weaken, as long as those that attach after the restart bear on to
    the peak: while it comes within the shortest lives.

    Parameters
    ----------
    config
        A configuration with contacts that age.
    velocity
        Positive [m/s], before the hold and after it.
    hold
        Time for which the slider stands [s].

    Returns
    -------
    float
        The force [N].
    """
    contacts = config.contacts
    weight, threshold = threshold_quadrature(config, PANELS, POINTS)
    back = contacts.back_force_ratio
    speed = velocity / contacts.break_stretch
    life = speed * lives(config, threshold, speed)
    held = speed * lives(config, threshold, speed, hold)
    mean = float(weight @ life)
    # The force is concave in y, and straight between the displacements at which contacts start to
    # break: its maximum is at one of them.
    order = np.argsort(held - life)
    start = (held - life)[order]
    broken, moment = (np.cumsum((weight * one)[order]) for one in (held, held * (held - life)))
    force = start - (start * broken - moment) / mean
    steady = float(weight @ (back * life + life**2 / 2)) / mean
    return contacts.static_force * (steady + float(np.max(force)))


def _threshold(config: Config, configured: Array, age: float | Array) -> Array:
    """Thresholds at an age of contacts with configured ones, over the static force."""
    assert config.contacts.ageing is not None
    width = config.contacts.threshold.relative_width
    return config.contacts.ageing.threshold(configured, width, age)


def lives(config: Config, configured: Array, speed: float, older: float = 0.0) -> Array:
    """Times T at which contacts break whose forces grow by f_s times a speed in a second [s].

    They are older than that by a time in which they were held.
    """
    from scipy.optimize.elementwise import find_root

    back = config.contacts.back_force_ratio

    # Thresholds are concave in time where they grow, and fall otherwise: there is one solution.
    def gap(time: Array, threshold: Array) -> Array:
        return _threshold(config, threshold, older + time) - back - speed * time

    upper = np.ones_like(configured) / speed
    while np.any(gap(upper, configured) > 0):
        upper = np.where(gap(upper, configured) > 0, 2 * upper, upper)
    # Interpolation that leaves the bracket is not a number, and is not used.
    with np.errstate(invalid="ignore"):
        lives: Array = find_root(
            gap, (np.zeros_like(upper), upper), args=(configured,), tolerances={"xrtol": 1e-14}
        ).x
    return lives
