"""Peaks of the force before slips as a sequence: the return map and its slope."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip.output.access import group_of

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Part of a run before the peaks that count.
TRANSIENT = 0.5
# Neighbours of a point of the map from which its slope is estimated, at most this part of all.
NEIGHBOURS, MAX_PART = 8, 0.1


def settled_peaks(tree: xr.DataTree, realization: int = 0) -> Array:
    """Spring force at the start of each slip of the second half of a run [N].

    Parameters
    ----------
    tree
        Output of a run.
    realization
        Index of the realization.

    Returns
    -------
    numpy.ndarray
        Shape (slips); empty if there are none.
    """
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
    """Mean of ln |f'| over the return map f of peaks, were it a curve.

    The slope at each point is that of a line through its nearest neighbours. It is the Lyapunov
    exponent of a one-dimensional map, per peak; several branches, or noise, make it
    larger.

    Parameters
    ----------
    peaks
        Successive peaks, shape (slips).

    Returns
    -------
    float
        The exponent per peak; NaN for fewer than a hundred peaks or for equal ones.
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
