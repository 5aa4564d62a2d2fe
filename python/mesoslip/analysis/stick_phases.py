"""Stick phases between slips: duration, growth of the force, and creep before a slip.

At the end of a slip the slider may overshoot, and rebounds before it rests. While it sticks, the
force grows by the stiffness times the displacement of the drive. If it grows less, the slider
creeps: its displacement is

    X = X_d - F/K.

Loading and creep are measured from the rest after the rebound, which takes as long as the slip. The
force there is that of the line of the loading, on which ringing has little influence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array

# Part of a stick phase in which the loading is measured, after the rebound and before creep, its
# minimum length over that of the phase, and minimum number of samples in it.
LOADING = (0.1, 0.5)
MIN_LOADING = 0.2
MIN_SAMPLES = 4
# Maximum scatter of the force about the line of the loading, over the change along the line: a
# slider that swings by more does not rest.
MAX_SCATTER = 0.25
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
    """Displacement of the slider from the rest after the rebound on, along the drive [m]."""
    creep_share: Array
    """Its share of the displacement of the drive in that time."""
    rest_force: Array
    """Force at the end of the slip before without its rebound, by the line of the loading [N]."""


def stick_phases(
    time: Array,
    force: Array,
    start_time: Array,
    end_time: Array,
    force_before: Array,
    *,
    drive: Array | None = None,
    stiffness: float = math.nan,
) -> StickPhases:
    """The stick phases before the slips of a trace without impulses; for an unknown stiffness, by
    the median of the loading."""
    number = len(start_time)
    duration, rate, measured, driven, risen, rest = (np.full(number, np.nan) for _ in range(6))
    duration[1:] = start_time[1:] - end_time[:-1]
    rebound = np.maximum(LOADING[0] * duration[1:], end_time[:-1] - start_time[:-1])
    first = np.searchsorted(time, end_time[:-1] + rebound)
    after = np.searchsorted(time, end_time[:-1] + LOADING[1] * duration[1:], "right")
    has_rest = LOADING[1] * duration[1:] - rebound >= MIN_LOADING * duration[1:]
    for slip, (one, two) in enumerate(zip(first, after, strict=True), 1):
        span = slice(one, two)
        if not has_rest[slip - 1] or np.count_nonzero(np.isfinite(force[span])) < MIN_SAMPLES:
            continue
        known = np.isfinite(force[span])
        since = time[span][known] - time[one]
        slope, at_rest = np.polyfit(since, force[span][known], 1)
        scatter = float(np.std(force[span][known] - at_rest - slope * since))
        if scatter > MAX_SCATTER * abs(slope) * since[-1]:
            continue
        rate[slip] = slope
        rest[slip] = at_rest + slope * (end_time[slip - 1] - time[one])
        if drive is None:
            continue
        between = drive[np.searchsorted(time, end_time[slip - 1]) : two]
        velocity = np.polyfit(since, drive[span][known], 1)[0]
        if velocity != 0 and _is_one_way(between):
            measured[slip] = rate[slip] / velocity
            driven[slip] = np.interp(start_time[slip], time, drive) - drive[one]
            risen[slip] = force_before[slip] - at_rest
    if not math.isfinite(stiffness) and np.isfinite(measured).any():
        stiffness = float(np.nanmedian(measured))
    creep = driven - risen / stiffness
    return StickPhases(duration, rate, measured, creep * np.sign(driven), creep / driven, rest)


def relieved_loading(
    time: Array, force: Array, start_time: Array, end_time: Array, force_before: Array
) -> tuple[float, float]:
    """Sum of the falls of slips without their rebounds [N], and time of the loading from each slip
    to the next [s], without slips after which the slider does not rest."""
    phases = stick_phases(time, force, start_time, end_time, force_before)
    falls = force_before[:-1] - phases.rest_force[1:]
    rests = np.isfinite(falls)
    return float(falls[rests].sum()), float(np.diff(start_time)[rests].sum())


def _is_one_way(drive: Array) -> bool:
    """Whether the drive does not turn, but for noise."""
    path = float(np.abs(np.diff(drive[:: max(1, len(drive) // 50)])).sum())
    return abs(float(drive[-1] - drive[0])) >= MIN_DIRECTNESS * path
