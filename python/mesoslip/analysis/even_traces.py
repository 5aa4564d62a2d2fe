"""Traces at equal intervals."""

from __future__ import annotations

import math

import numpy as np

from mesoslip.array_types import Array, DataTree

# Maximum relative difference of intervals that count as equal.
INTERVAL_TOLERANCE = 1e-3


def even_trace(tree: DataTree) -> tuple[Array, Array]:
    """Times [s] and spring force [N] of the first realization at equal intervals,
    interpolated where they differ."""
    root = tree.to_dataset()
    force = root["spring_force"].values[0].astype(float)
    is_known = np.isfinite(force)
    time, force = root["time"].values[is_known], force[is_known]
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.all(np.abs(steps - interval) <= INTERVAL_TOLERANCE * interval):
        return time, force
    even = time[0] + interval * np.arange(math.floor((time[-1] - time[0]) / interval) + 1)
    return even, np.interp(even, time, force)
