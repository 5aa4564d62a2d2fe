"""The return map of the peaks of the force before slips, and its slope."""

from __future__ import annotations

import math

import numpy as np

from mesoslip.array_types import Array, DataTree
from mesoslip.output.access import group_of

# Part of a run before the first peak of the map.
TRANSIENT = 0.5
# Number of neighbours of a point from which the slope is estimated, and their maximum share.
NEIGHBOURS, MAX_PART = 8, 0.1


def settled_peaks(tree: DataTree, realization: int = 0) -> Array:
    """Spring force at the start of each slip of the second half of a run [N]."""
    if "slips" not in tree.children:
        return np.empty(0)
    data = group_of(tree, "slips")
    time = tree.to_dataset()["time"].values
    mine = (data["realization_index"].values == realization) & (
        data["start_time"].values >= time[0] + TRANSIENT * (time[-1] - time[0])
    )
    peaks: Array = data["force_before"].values[mine]
    return peaks


def map_exponent(peaks: Array) -> float:
    """Mean of ln |f'| over the return map f of successive peaks, as if it were a curve.

    This is the Lyapunov exponent of a one-dimensional map, per peak; several branches, or noise,
    make it larger. The slope at each point is that of a line through its nearest neighbours. NaN
    for fewer than about a hundred peaks, or for equal ones.
    """
    x, y = peaks[:-1], peaks[1:]
    count = min(NEIGHBOURS, int(MAX_PART * x.size))
    if x.size < NEIGHBOURS / MAX_PART or not np.ptp(x) > 0:
        return math.nan
    logarithms = []
    for middle in x:
        near = np.argsort(np.abs(x - middle))[: count + 1]
        if np.ptp(x[near]) > 0:
            slope = np.polyfit(x[near] - middle, y[near], 1)[0]
            if abs(slope) > 0:
                logarithms.append(math.log(abs(slope)))
    return float(np.mean(logarithms)) if logarithms else math.nan
