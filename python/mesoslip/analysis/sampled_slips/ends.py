"""Measured properties of each slip: its ends, its duration, its rate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.sampled_slips.levels import Level
from mesoslip.analysis.sampled_slips.windows import Windows, lines_through, parabolas_through

Array = NDArray[np.float64]

# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1
# A fall within so many samples to so many standard deviations of the noise above its minimum ends
# there, not at the minimum.
SUDDEN, NEAR = 2, 3.0


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
    time: Array, force: Array, tops: Samples, bottoms: Samples, noise: float, half: Samples
) -> tuple[Samples, Samples, Array, Array]:
    """Samples at which slips start and end, and the forces there, averaged over the noise.

    ``half`` is half a period in samples, for each slip.
    """
    # The force grows slowly before a slip, so that noise determines which sample is the maximum.
    # The level is that of a line through the samples before, and the slip starts where means over
    # some samples fall below it.
    wide = np.maximum(1, np.minimum(half // 4, (bottoms - tops) // 3))
    lows = np.maximum(0, tops - np.maximum(4, half))
    level, deviation = force[tops], np.full(tops.size, noise)
    has_line = np.flatnonzero((noise > 0) & (tops - lows >= 3))
    if has_line.size:
        # Without the maximum, which is biased by its noise.
        top = tops[has_line]
        before = Windows(lows[has_line], top - lows[has_line])
        lines = lines_through(time, force, before, time[top])
        # Ringing before the slip does not follow a straight line.
        is_straight = lines.deviation < 2 * noise
        some = has_line[is_straight]
        level[some] = np.minimum(lines.level[is_straight], level[some])
        deviation[some] = lines.deviation[is_straight]
    # Not below the middle of the fall, however strong the noise.
    least = np.maximum(level - 2 * deviation / np.sqrt(wide), (level + force[bottoms]) / 2)
    starts = np.empty_like(tops)
    columns = (one.tolist() for one in (tops, bottoms, wide, least))
    for number, (top, bottom, width, lowest) in enumerate(zip(*columns, strict=True)):
        means = np.convolve(force[top : bottom + width], np.full(width, 1 / width), "valid")
        high = np.flatnonzero(means >= lowest)
        starts[number] = min(top + (int(high[-1]) if high.size else 0), bottom - 1)
    # After a fall that is faster than the sampling, noise determines which sample is the minimum.
    bottoms = bottoms.copy()
    for number in np.flatnonzero(bottoms - starts > SUDDEN).tolist():
        low = force[bottoms[number]]
        part = force[starts[number] + 1 :][:SUDDEN]
        reached = part <= min(low + NEAR * noise, (level[number] + low) / 2)
        if reached.any():
            bottoms[number] = starts[number] + 1 + int(np.argmax(reached))
    near = np.maximum(1, half // 8)
    first = np.maximum(starts, bottoms - near)
    size = np.minimum(bottoms + near + 1, force.size) - first
    after = force[bottoms]
    curved = np.flatnonzero((noise > 0) & (size >= 4))
    if curved.size:
        around = Windows(first[curved], size[curved])
        after[curved] = parabolas_through(time, force, around, bottoms[curved])
    return starts, bottoms, level, after
