"""Plateaus of a signal with correlated noise: stretches at one level, between steps and ramps.

The partition of least squares of means of samples into constant pieces, with a penalty for each
piece, is found exactly (Jackson et al., IEEE Signal Processing Letters 12, 105 (2005)). The noise
is the standard deviation of means of so many samples that they are independent, times the square
root of their number; so the steps of a correlated noise are none.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mesoslip.analysis.noise.levels import NORMAL_MEDIAN
from mesoslip.array_types import Array

# Maximum number of means, and minimum number in a piece.
MAX_POINTS, MIN_POINTS = 2000, 3
# Minimum length of a plateau over the longest one.
MIN_SHARE = 0.05
# Penalty of a piece over the variance of the noise: chance improves twice the logarithm of the
# likelihood by less in a thousand records.
PENALTY = 30.0
# Numbers of means over which the noise is compared, and minimum number of differences.
LENGTHS, MIN_DIFFERENCES = (1, 2, 4, 8, 16, 32), 20
# Minimum noise over the range of the signal.
MIN_NOISE = 1e-4
# Minimum ratio of values whose logarithms are cut: noise grows with a signal of the machine.
MIN_RATIO = 3.0
# Maximum drift in a plateau, over the smaller one of the steps beside it, and over its noise.
MAX_DRIFT, MAX_DRIFT_ERRORS = 0.5, 4.0
# Minimum number of standard errors of the difference of plateaus.
MIN_ERRORS = 4.0
# Minimum size of a step over that of differences of means over the same times elsewhere, in
# standard deviations: the maximum of thousands of normal ones is about 4.
MIN_SHARPNESS = 5.0


class Level(NamedTuple):
    """Samples ``first`` to ``after - 1`` of a plateau, and the mean of the signal."""

    first: int
    after: int
    mean: float


def levels_of(values: Array, min_change: float = 0.0, *, are_sharp: bool = False) -> list[Level]:
    """Plateaus of a signal, which differ by more than a share of the larger one of two levels.

    That share is of a speed or a load, which are positive: of those their logarithms are cut. Sharp
    steps exceed what the signal changes elsewhere in the same time, over at least some time: noise
    of any correlation has none.
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2 * MIN_POINTS:
        return []
    signal = values[known]
    if min_change and float(signal.max()) > MIN_RATIO * float(signal.min()) > 0:
        found = levels_of(np.log(values))
        return [
            one._replace(mean=float(np.nanmean(values[one.first : one.after]))) for one in found
        ]
    count = min(MAX_POINTS, signal.size)
    edges = np.linspace(0, signal.size, count + 1).astype(int)
    means = np.add.reduceat(signal, edges[:-1]) / np.diff(edges)
    noise = _noise(means)
    if noise == 0:
        return [Level(0, values.size, float(means.mean()))]
    cuts = _partition(means, PENALTY * noise**2)
    pieces = [(first, after) for first, after in pairwise(cuts) if _is_level(means, cuts, first)]
    levels = _joined(means, pieces, noise, min_change)
    longest = max((after - first for first, after in levels), default=0)
    levels = [one for one in levels if one[1] - one[0] >= MIN_SHARE * longest]
    if are_sharp:
        levels = _between_sharp_steps(means, levels)
    ends = np.append(known, values.size)
    # A mean at an end may have samples of both sides.
    edge = int(edges[1] > 1)
    return [
        Level(
            int(ends[edges[first + (edge if first else 0)]]),
            int(ends[edges[after - (edge if after < count else 0)]]),
            float(means[first:after].mean()),
        )
        for first, after in levels
    ]


def _noise(means: Array) -> float:
    """Standard deviation of independent means, as of one mean if all were independent."""
    found = MIN_NOISE * float(np.ptp(means))
    for length in LENGTHS:
        count = means.size // length
        if count <= MIN_DIFFERENCES and length > 1:
            break
        longer = means[: count * length].reshape(count, length).mean(axis=1)
        size = float(np.median(np.abs(np.diff(longer)))) / (NORMAL_MEDIAN * math.sqrt(2))
        found = max(found, size * math.sqrt(length))
    return found


def _partition(means: Array, penalty: float) -> list[int]:
    """Ends of constant pieces, with the least squares of the deviations and the penalty of each."""
    count = means.size
    centred = means - means.mean()
    total = np.concatenate([[0.0], np.cumsum(centred)])
    squares = np.concatenate([[0.0], np.cumsum(centred**2)])
    best = np.full(count + 1, np.inf)
    best[0] = -penalty
    before = np.zeros(count + 1, dtype=int)
    for after in range(MIN_POINTS, count + 1):
        firsts = np.arange(0, after - MIN_POINTS + 1)
        rest = (total[after] - total[firsts]) ** 2 / (after - firsts)
        costs = best[firsts] + squares[after] - squares[firsts] - rest + penalty
        before[after] = int(np.argmin(costs))
        best[after] = costs[before[after]]
    cuts = [count]
    while cuts[-1] > 0:
        cuts.append(int(before[cuts[-1]]))
    return cuts[::-1]


def _is_level(means: Array, cuts: list[int], first: int) -> bool:
    """Whether a piece is no part of a ramp, whose pieces drift as much as they differ."""
    at = cuts.index(first)
    piece = means[first : cuts[at + 1]]
    index = np.arange(piece.size) - (piece.size - 1) / 2
    norm = float(index @ index)
    slope = float(index @ piece) / norm
    residual = piece - piece.mean() - slope * index
    error = math.sqrt(float(residual @ residual) / max(piece.size - 2, 1) / norm)
    others = [
        float(means[one:two].mean())
        for number, (one, two) in enumerate(pairwise(cuts))
        if number in {at - 1, at + 1}
    ]
    steps = [abs(one - float(piece.mean())) for one in others]
    drift = abs(slope) * piece.size
    is_small = not steps or drift < MAX_DRIFT * min(steps)
    return is_small or abs(slope) < MAX_DRIFT_ERRORS * error


def _joined(
    means: Array, pieces: list[tuple[int, int]], noise: float, min_change: float
) -> list[tuple[int, int]]:
    """Pieces without steps that are too small."""
    found: list[tuple[int, int]] = []
    for piece in pieces:
        found.append(piece)
        while len(found) > 1 and found[-2][1] == found[-1][0]:
            (first, middle), (_, after) = found[-2:]
            one, two = float(means[first:middle].mean()), float(means[middle:after].mean())
            error = noise * math.hypot((middle - first) ** -0.5, (after - middle) ** -0.5)
            if abs(two - one) > max(MIN_ERRORS * error, min_change * max(abs(one), abs(two))):
                break
            found[-2:] = [(first, after)]
    return found


def _between_sharp_steps(means: Array, levels: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pieces, of which those without a sharp step between them are joined."""
    found = levels[:1]
    for piece in levels[1:]:
        if _is_sharp(means, found[-1], piece):
            found.append(piece)
        else:
            found[-1] = (found[-1][0], piece[1])
    return found


def _is_sharp(means: Array, one: tuple[int, int], two: tuple[int, int]) -> bool:
    """Whether a step exceeds the differences of means of some length, at the same distance."""
    total = np.concatenate([[0.0], np.cumsum(means - means.mean())])
    gap = two[0] - one[1]
    for length in LENGTHS:
        if length > min(one[1] - one[0], two[1] - two[0]):
            break
        sums = total[length:] - total[:-length]
        steps = sums[length + gap :] - sums[: sums.size - length - gap]
        scatter = float(np.median(np.abs(steps - np.median(steps)))) / NORMAL_MEDIAN
        if abs(float(steps[one[1] - length])) > MIN_SHARPNESS * scatter:
            return True
    return False
