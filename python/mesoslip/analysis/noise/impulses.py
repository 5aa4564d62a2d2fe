"""Impulses: one to three outlying samples between neighbours that agree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.noise.levels import NORMAL_MEDIAN
from mesoslip.array_types import Array

# Widths of the running medians of the force, and of the deviations from it [samples].
WIDTH, SCATTER_WIDTH = 7, 15
# Minimum size in standard deviations of the noise, and of the scatter around it.
MIN_SIZE, MIN_LOCAL_SIZE = 6.0, 5.0
# Minimum size over the range of the trace between its 1 % and 99 % quantiles.
MIN_RANGE = 2e-3
# Maximum samples of an impulse, and samples on each side that must agree.
MAX_LENGTH, NEIGHBOURS = 3, 4
# Maximum difference of both sides, over the size.
MAX_STEP = 0.4
# Minimum distance from the lines through the samples beside it, over the size: maxima of
# oscillations are smaller.
MIN_JUMP = 0.5


def find_impulses(force: Array, noise: float) -> NDArray[np.bool_]:
    """Whether each sample is in an impulse, not in a slip or in ringing; the noise is a standard
    deviation."""
    from scipy.ndimage import median_filter

    if len(force) < 2 * SCATTER_WIDTH:
        return np.zeros(len(force), dtype=bool)
    deviation = force - median_filter(force, WIDTH, mode="nearest")
    size = np.abs(deviation)
    scatter = median_filter(size, SCATTER_WIDTH, mode="nearest") / NORMAL_MEDIAN
    noise = max(noise, float(np.median(size)) / NORMAL_MEDIAN)
    low, high = np.quantile(force, (0.01, 0.99))
    found: NDArray[np.bool_] = size > np.maximum(
        max(MIN_SIZE * noise, MIN_RANGE * float(high - low)), MIN_LOCAL_SIZE * scatter
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    if starts.size == 0:
        return found
    near = np.arange(NEIGHBOURS)
    before = force[np.maximum(starts[:, None] - 1 - near, 0)]
    behind = force[np.minimum(ends[:, None] + near, len(force) - 1)]
    step = np.abs(np.median(before, axis=1) - np.median(behind, axis=1))
    height = _height_above(force, starts, ends)
    is_one = (
        (height >= MIN_JUMP * np.maximum.reduceat(size, starts))
        & (ends - starts <= MAX_LENGTH)
        & (step <= MAX_STEP * np.maximum.reduceat(size, starts))
    )
    for first, after in zip(starts[~is_one], ends[~is_one], strict=True):
        found[first:after] = False
    return found


def _height_above(force: Array, starts: NDArray[np.int_], ends: NDArray[np.int_]) -> Array:
    """Distance of the middle of each group of samples from the lines through its neighbours,
    negative between them."""
    middle = (starts + ends - 1) // 2
    last = len(force) - 1
    sides = []
    direction = np.zeros(len(starts))
    for beside, further in ((starts - 1, starts - 2), (ends, ends + 1)):
        near, far = (np.clip(one, 0, last) for one in (beside, further))
        slope = (force[near] - force[far]) / np.where(near == far, 1, near - far)
        sides.append(force[middle] - force[near] - slope * (middle - near))
        direction += force[middle] - force[near]
    height: Array = np.minimum(*(np.sign(direction) * one for one in sides))
    return height
