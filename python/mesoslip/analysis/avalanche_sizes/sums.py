"""Sums of smooth functions over all integers between two limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy  # its parts are loaded when they are used

from mesoslip.array_types import Array

# Maximum length of blocks that are summed integer by integer, and nodes of longer blocks.
DIRECT = 16
NODES = 12
# Doublings of blocks, up to 2^53. Above MIN_RATE for 1/s_c, sizes beyond are negligible.
DOUBLINGS = 49
MIN_RATE = 2.0**-47


@lru_cache
def _block(length: int) -> tuple[Array, Array]:
    """Gauss's rule for a sum over the integers from 0 below a length, exact for polynomials of
    degree 2 NODES - 1."""
    if length <= DIRECT:
        return np.arange(length, dtype=np.float64), np.ones(length)
    k = np.arange(1.0, NODES)
    beside = np.sqrt(k**2 * (float(length) ** 2 - k**2) / (4 * (4 * k**2 - 1)))
    node, vectors = scipy.linalg.eigh_tridiagonal(np.zeros(NODES), beside)
    return node + (length - 1) / 2, length * vectors[0] ** 2


@dataclass(frozen=True)
class Rule:
    """Nodes and weights of sums of smooth functions of the sizes between two limits."""

    min_size: int
    log_ratio: Array
    """ln(s/min_size) at the nodes."""
    offset: Array
    """s - min_size."""
    log_weight: Array
    last: float
    """The last offset of the sum."""
    is_open: bool
    """Whether the law continues beyond it."""


@lru_cache
def sum_rule(min_size: int, max_size: int | None) -> Rule:
    """The rule of all sizes between the limits; no upper limit if that is None.

    Blocks start at offsets that double: so s^-τ varies by the same factor in each, and a cutoff
    varies much only where it is small.
    """
    total = DIRECT << DOUBLINGS
    if max_size is not None:
        total = min(total, max_size - min_size + 1)
    offsets, weights = [], []
    start, length = 0, DIRECT
    while start < total:
        node, weight = _block(min(length, total - start))
        offsets.append(start + node)
        weights.append(weight)
        start += length
        length = start
    offset = np.concatenate(offsets)
    return Rule(
        min_size,
        np.log1p(offset / min_size),
        offset,
        np.log(np.concatenate(weights)),
        total - 1.0,
        max_size is None,
    )
