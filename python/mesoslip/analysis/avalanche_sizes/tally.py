"""Sizes of avalanches, each different one with its number of occurrences."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.errors import MesoslipError

Array = NDArray[np.float64]

# Minimum number of sizes, and of different ones, that a law is fitted to.
MIN_COUNT = 10
MIN_DIFFERENT = 3


class Tally(NamedTuple):
    """The different sizes, ascending, and how often each occurs."""

    sizes: Array
    counts: NDArray[np.int64]

    def between(self, min_size: float, max_size: float | None) -> Tally:
        """The sizes between two limits, both included."""
        first = np.searchsorted(self.sizes, min_size)
        last = np.searchsorted(self.sizes, math.inf if max_size is None else max_size, side="right")
        return Tally(self.sizes[first:last], self.counts[first:last])

    @property
    def total(self) -> int:
        """Number of sizes."""
        return int(np.sum(self.counts))

    @property
    def is_degenerate(self) -> bool:
        """Whether there are too few sizes to fit a law."""
        return self.total < MIN_COUNT or len(self.sizes) < MIN_DIFFERENT


def tally_of(sizes: ArrayLike) -> Tally:
    """Count the sizes.

    Raises
    ------
    MesoslipError
        If a size is not a positive integer, or too large for a float to hold it exactly.
    """
    array = np.asarray(sizes).ravel()
    if not array.size:
        return Tally(np.empty(0), np.empty(0, dtype=np.int64))
    whole = np.issubdtype(array.dtype, np.integer) or bool(np.all(array == np.rint(array)))
    if not whole or not 1 <= np.min(array) <= np.max(array) < 2**53:
        raise MesoslipError("sizes of avalanches are not positive integers below 2^53")
    array = array.astype(np.int64, copy=False)
    if np.max(array) <= 4 * array.size:
        # No need to sort them.
        counts = np.bincount(array)
        different = np.flatnonzero(counts)
        return Tally(different.astype(float), counts[different])
    different, counts = np.unique(array, return_counts=True)
    return Tally(different.astype(float), counts)
