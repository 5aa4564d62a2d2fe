"""Stick phases between slips: duration, growth of the force, and creep before a slip.

While the slider sticks, the force grows by the stiffness times the displacement of the drive. If it
grows less, the slider creeps: its displacement is

    X = X_d - F/K.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Part of a stick phase in which the loading is measured, after ringing and before creep, and
# minimum number of samples in it.
LOADING = (0.1, 0.5)
MIN_SAMPLES = 4
# Minimum displacement over path length of a drive that moves in one direction.
MIN_DIRECTNESS = 0.9


@dataclass(frozen=True)
class StickPhases:
    """The stick phase before each slip, arrays of shape (slips,); NaN if unknown."""

    stick_duration: Array
    """Time from the end of the slip before to the start of this one [s]."""
    loading_rate: Array
    """Rate of the force in the first half of the stick phase [N/s]."""
    loading_stiffness: Array
    """The same over the displacement of the drive [N/m]."""
    creep_displacement: Array
    """Displacement of the slider in the stick phase, along the drive [m]."""
    creep_share: Array
    """Its share of the displacement of the drive in the stick phase."""


def stick_phases(
    time: Array,
    force: Array,
    start_time: Array,
    end_time: Array,
    force_before: Array,
    force_after: Array,
    *,
    drive: Array | None = None,
    stiffness: float = math.nan,
) -> StickPhases:
    """The stick phases before the slips of a trace without impulses.

    A stiffness that is NaN stands for the median of the loading stiffness.
    """
    number = len(start_time)
    duration, rate, measured, driven = (np.full(number, np.nan) for _ in range(4))
    duration[1:] = start_time[1:] - end_time[:-1]
    first = np.searchsorted(time, end_time[:-1] + LOADING[0] * duration[1:])
    after = np.searchsorted(time, end_time[:-1] + LOADING[1] * duration[1:], "right")
    for slip, (one, two) in enumerate(zip(first, after, strict=True), 1):
        span = slice(one, two)
        known = np.isfinite(force[span])
        if np.count_nonzero(known) < MIN_SAMPLES:
            continue
        since = time[span][known] - time[one]
        rate[slip] = np.polyfit(since, force[span][known], 1)[0]
        if drive is None:
            continue
        between = drive[np.searchsorted(time, end_time[slip - 1]) : two]
        velocity = np.polyfit(since, drive[span][known], 1)[0]
        if velocity != 0 and _is_one_way(between):
            measured[slip] = rate[slip] / velocity
    if drive is not None and number > 1:
        before, behind = (np.interp(one, time, drive) for one in (start_time, end_time))
        is_known = np.isfinite(measured[1:])
        driven[1:] = np.where(is_known, before[1:] - behind[:-1], np.nan)
    if not math.isfinite(stiffness) and np.isfinite(measured).any():
        stiffness = float(np.nanmedian(measured))
    risen = np.full(number, np.nan)
    risen[1:] = force_before[1:] - force_after[:-1]
    creep = driven - risen / stiffness
    return StickPhases(duration, rate, measured, creep * np.sign(driven), creep / driven)


def _is_one_way(drive: Array) -> bool:
    """Whether the drive does not turn, but for noise."""
    path = float(np.abs(np.diff(drive[:: max(1, len(drive) // 50)])).sum())
    return abs(float(drive[-1] - drive[0])) >= MIN_DIRECTNESS * path
