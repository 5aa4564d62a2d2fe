"""Histograms and cumulative distributions of avalanche sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.analysis.avalanche_sizes.tally import Array, tally_of


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
    """The histogram of sizes in bins of equal logarithmic width, as far as integers allow.

    The edges do not depend on the sizes; empty bins are left out.

    Parameters
    ----------
    sizes
        Positive integers, of any shape.
    per_decade
        Bins in a factor of ten, where they are wider than an integer.

    Raises
    ------
    MesoslipError
        If a size is not a positive integer, or too large for a float to hold it exactly.
    """
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
    """The different sizes s, ascending, and the share of sizes that are at least s, P(S ≥ s).

    Raises
    ------
    MesoslipError
        If a size is not a positive integer, or too large for a float to hold it exactly.
    """
    different, counts = tally_of(sizes)
    not_smaller = np.cumsum(counts[::-1])[::-1]
    return different.astype(np.int64), not_smaller / np.sum(counts)
