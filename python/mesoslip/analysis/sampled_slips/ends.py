"""Measured properties of each slip: its ends, its duration, its rate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.sampled_slips.levels import Level

Array = NDArray[np.float64]

# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1


def fall_period(time: Array, force: Array, tops: Samples, bottoms: Samples) -> float:
    """Twice the duration of deep falls [s]; infinite without falls.

    As noise blurs the ends of a fall, its duration is that between 90 and 10 % of the depth, and
    that of a sine. The estimate is the median over the falls at least half as deep as the deepest.
    """
    if tops.size == 0:
        return math.inf
    depth = force[tops] - force[bottoms]
    durations = []
    deep = depth >= depth.max() / 2
    for top, bottom in zip(tops[deep], bottoms[deep], strict=True):
        part = (force[top : bottom + 1] - force[bottom]) / (force[top] - force[bottom])
        high = int(np.flatnonzero(part >= 1 - MARGIN)[-1])
        low = high + int(np.flatnonzero(part[high:] <= MARGIN)[0])
        # Crossings are interpolated between samples.
        above = (part[high] - (1 - MARGIN)) / (part[high] - part[high + 1])
        below = (MARGIN - part[low]) / (part[low - 1] - part[low])
        at = time[top : bottom + 1]
        start = at[high] + above * (at[high + 1] - at[high])
        durations.append(at[low] - below * (at[low] - at[low - 1]) - start)
    share = 1 - 2 * math.acos(1 - 2 * MARGIN) / math.pi
    interval = float(np.median(np.diff(time)))
    return 2 * max(float(np.median(durations)) / share, interval)


def fall_rates(level: Level, period: float, tops: Samples, bottoms: Samples) -> Array:
    """Maximum rate of each fall, by lines over an eighth of a period [N/s]."""
    from scipy.ndimage import correlate1d

    force = level.trace.force
    rates = np.zeros(len(force))
    for part in level.parts:
        if len(part) < 3:
            continue
        half = max(1, round(period / 2 / part.interval))
        # Wide enough to average over noise, narrow enough for ringing faster than the setup's.
        width = min(2 * max(1, half // 8) + 1, len(part) - 1 + len(part) % 2)
        # Weights of the slope of a line through the samples.
        at = np.arange(width) - width // 2
        weights = at / (np.sum(at**2) * part.interval)
        rates[part.samples] = correlate1d(force[part.samples], weights, mode="nearest")
    spans = zip(tops.tolist(), bottoms.tolist(), strict=True)
    return np.array([-rates[top : bottom + 1].min() for top, bottom in spans])


def ends_of(
    time: Array, force: Array, top: int, bottom: int, noise: float, half: int
) -> tuple[float, float, float, float]:
    """Samples of start and end of a slip, and the forces there, averaged over the noise."""
    # The force grows slowly before a slip, so that noise determines which sample is the maximum.
    # The level is that of a line through the samples before, and the slip starts where means over
    # some samples fall below it.
    wide = max(1, min(half // 4, (bottom - top) // 3))
    low = max(0, top - max(4, half))
    level, noise_there = float(force[top]), noise
    if noise > 0 and top - low >= 3:
        # Without the maximum, which is biased by its noise.
        span = slice(low, top)
        slope, fitted = np.polyfit(time[span] - time[top], force[span], 1)
        residual = float(np.std(force[span] - fitted - slope * (time[span] - time[top])))
        # Ringing before the slip does not follow a straight line.
        if residual < 2 * noise:
            level, noise_there = min(float(fitted), level), residual
    means = np.convolve(force[top : bottom + wide], np.full(wide, 1 / wide), "valid")
    # Not below the middle of the fall, however strong the noise.
    least = max(level - 2 * noise_there / math.sqrt(wide), (level + float(force[bottom])) / 2)
    high = np.flatnonzero(means >= least)
    start = min(top + (int(high[-1]) if high.size else 0), bottom - 1)
    around = slice(max(start, bottom - max(1, half // 8)), bottom + max(1, half // 8) + 1)
    after = float(force[bottom])
    if noise > 0 and force[around].size >= 4:
        after = float(np.polynomial.Polynomial.fit(time[around], force[around], 2)(time[bottom]))
    return float(start), float(bottom), float(level), after
