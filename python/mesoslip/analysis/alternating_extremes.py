"""Extremes of a trace that alternate and differ by a threshold, for all thresholds at once.

A pair of neighbouring extremes whose difference is not larger than those on both sides is a cycle
within a larger one, as in the counting of rainflow cycles (Matsuishi & Endo 1968; the persistence
of topology is the same). When all cycles below a threshold are removed, the other extremes differ
by more than the threshold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

Samples = NDArray[np.int_]

# Number of turning points below which cycles are found one by one.
MIN_POINTS = 100


@dataclass(frozen=True)
class Extremes:
    """The extremes of a trace of shape (samples,)."""

    values: Array
    first: Samples
    second: Samples
    """Samples of the extremes of each closed cycle, as ``first``, shape (cycles,)."""
    rest: Samples
    """Samples of the extremes that close no cycle, in their order, with the first and the last."""

    @cached_property
    def _cycle_sizes(self) -> Array:
        return np.abs(self.values[self.first] - self.values[self.second])

    @cached_property
    def fall_sizes(self) -> Array:
        """Sizes of all falls, in ascending order."""
        steps = np.diff(self.values[self.rest])
        return np.sort(np.concatenate([self._cycle_sizes, -steps[steps < 0]]))

    @cached_property
    def _sizes(self) -> Array:
        steps: Array = np.abs(np.diff(self.values[self.rest]))
        return np.sort(np.concatenate([self._cycle_sizes, steps]))

    def rank(self, threshold: float) -> int:
        """Number of differences up to a threshold: the falls above thresholds of one rank agree."""
        return int(np.searchsorted(self._sizes, threshold, side="right"))

    def has_falls(self, threshold: float) -> bool:
        """Whether there are falls above a threshold."""
        return self.fall_sizes.size > 0 and bool(self.fall_sizes[-1] > threshold)

    def falls(self, threshold: float) -> tuple[Samples, Samples]:
        """Samples of the maximum and of the minimum of each fall above a threshold; the trace rises
        by more than the threshold between neighbours."""
        kept = self._cycle_sizes > threshold
        # Differences of the rest increase, then decrease.
        large = np.flatnonzero(np.abs(np.diff(self.values[self.rest])) > threshold)
        rest = self.rest[large[0] : large[-1] + 2] if large.size else self.rest[:0]
        extremes = np.sort(np.concatenate([self.first[kept], self.second[kept], rest]))
        is_fall = np.diff(self.values[extremes]) < 0
        return extremes[:-1][is_fall], extremes[1:][is_fall]


def extremes_of(values: Array, min_size: float = 0.0) -> Extremes:
    """The extremes of a trace of shape (samples,), in a time proportional to its length.

    With a minimum size, they are those for thresholds from it on: smaller cycles are not kept.
    """
    at, inner = _without_inner_cycles(values, _turning_points(values), min_size)
    levels = values[at].tolist()
    stack: list[int] = []
    cycles: list[tuple[int, int]] = []
    for number, level in enumerate(levels):
        while len(stack) > 2:
            last, before = levels[stack[-1]], levels[stack[-2]]
            size = abs(last - before)
            if size > abs(level - last) or size > abs(before - levels[stack[-3]]):
                break
            if size >= min_size:
                cycles.append((stack[-2], stack[-1]))
            del stack[-2:]
        stack.append(number)
    pairs = np.concatenate([inner, at[np.array(cycles, dtype=int).reshape(-1, 2)]])
    return Extremes(values, pairs[:, 0], pairs[:, 1], at[stack])


def _without_inner_cycles(values: Array, at: Samples, min_size: float) -> tuple[Samples, Samples]:
    """Turning points without cycles of neighbours, and the large ones of these, shape (cycles, 2);
    each pass removes most points of a noisy trace."""
    found = [np.empty((0, 2), dtype=int)]
    while at.size > MIN_POINTS:
        sizes = np.abs(np.diff(values[at]))
        inner = 1 + np.flatnonzero((sizes[1:-1] < sizes[:-2]) & (sizes[1:-1] <= sizes[2:]))
        if inner.size == 0:
            break
        large = inner[sizes[inner] >= min_size]
        found.append(np.stack([at[large], at[large + 1]], axis=1))
        kept = np.ones(at.size, dtype=bool)
        kept[inner] = kept[inner + 1] = False
        at = at[kept]
    return at, np.concatenate(found)


def _turning_points(values: Array) -> Samples:
    """The first and the last sample, and the first of each maximum and minimum between."""
    moves, rising = values[1:] != values[:-1], values[1:] > values[:-1]
    if not moves.any():
        return np.array([0] if len(values) else [], dtype=int)
    if moves.all():
        turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    else:
        moving = np.flatnonzero(moves)
        rising = rising[moving]
        turns = moving[np.flatnonzero(rising[1:] != rising[:-1])] + 1
    return np.concatenate([[0], turns, [len(values) - 1]])
