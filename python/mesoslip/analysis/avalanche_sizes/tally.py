"""Sizes of avalanches counted: distinct sizes, histograms, cumulative distributions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.array_types import Array
from mesoslip.errors import MesoslipError

# Minimum number of sizes, and of distinct ones, for the fit of a law.
MIN_COUNT = 10
MIN_DIFFERENT = 3


class Tally(NamedTuple):
    """The distinct sizes, ascending, and the count of each."""

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
    """Count sizes, which must be positive integers below 2^53: floats hold these exactly."""
    array = np.asarray(sizes).ravel()
    if not array.size:
        return Tally(np.empty(0), np.empty(0, dtype=np.int64))
    whole = np.issubdtype(array.dtype, np.integer) or bool(np.all(array == np.rint(array)))
    if not whole or not 1 <= np.min(array) <= np.max(array) < 2**53:
        raise MesoslipError("sizes of avalanches are not positive integers below 2^53")
    array = array.astype(np.int64, copy=False)
    if np.max(array) <= 4 * array.size:
        # Faster than sorting.
        counts = np.bincount(array)
        different = np.flatnonzero(counts)
        return Tally(different.astype(float), counts[different])
    different, counts = np.unique(array, return_counts=True)
    return Tally(different.astype(float), counts)


@dataclass(frozen=True)
class LogarithmicBins:
    """A histogram of sizes; all arrays have dimension ``bin``, and no bin is empty."""

    centre: Array
    """Geometric mean of the first and the last integer."""
    edges: Array
    """Lower and upper edge, half-integers; shape (bin, 2)."""
    count: NDArray[np.int64]
    density: Array
    """Probability of one size: share of the sizes in the bin over the integers in it."""
    density_error: Array
    """Standard error of the density for independent sizes: density over the root of the count."""


def logarithmic_bins(sizes: ArrayLike, per_decade: int = 10) -> LogarithmicBins:
    """The histogram of sizes in bins of equal logarithmic width, with edges that do not depend on
    the sizes and without empty bins."""
    different, counts = tally_of(sizes)
    if not len(different):
        empty = np.empty(0)
        return LogarithmicBins(empty, np.empty((0, 2)), np.empty(0, dtype=np.int64), empty, empty)
    decades = math.log10(different[-1])
    number = np.arange(math.floor(decades * per_decade) + 2)
    last = np.unique(np.rint(10 ** (number / per_decade)))
    first = np.concatenate([[1.0], last[:-1] + 1])
    count = np.zeros(len(last), dtype=np.int64)
    np.add.at(count, np.searchsorted(last, different), counts)
    full = count > 0
    first, last, count = first[full], last[full], count[full]
    density = count / (np.sum(count) * (last - first + 1))
    edges = np.stack([first - 0.5, last + 0.5], axis=1)
    return LogarithmicBins(np.sqrt(first * last), edges, count, density, density / np.sqrt(count))


def ccdf(sizes: ArrayLike) -> tuple[NDArray[np.int64], Array]:
    """The distinct sizes s, ascending, and the share of sizes that are at least s, P(S ≥ s)."""
    different, counts = tally_of(sizes)
    not_smaller = np.cumsum(counts[::-1])[::-1]
    return different.astype(np.int64), not_smaller / np.sum(counts)
