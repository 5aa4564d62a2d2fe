"""Find the slips in a trace, and measure them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.noise import TraceNoise, estimate_noise
from mesoslip.analysis.sampled_slips.choice import SlipCounts, chosen
from mesoslip.analysis.sampled_slips.levels import WHOLE, Level, Parts, levels
from mesoslip.analysis.sampled_slips.windows import Windows, lines_through, parabolas_through
from mesoslip.array_types import Array

# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1
# A fall within so many samples, from and to so many standard deviations of the noise at its level
# and its minimum, ends there, not at the minimum.
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
    """Samples at which slips start and end, and the forces there averaged over the noise; ``half``
    is half a period in samples."""
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
        fall = force[starts[number] : bottoms[number] + 1]
        at = int(np.argmax(fall[:-SUDDEN] - fall[SUDDEN:]))
        high, low = level[number], fall[-1]
        near = min(NEAR * noise, (high - low) / 4)
        reached = fall[at + 1 :][:SUDDEN] <= low + near
        if reached.any() and fall[at] >= high - near:
            bottoms[number] = starts[number] + at + 1 + int(np.argmax(reached))
    near = np.maximum(1, half // 8)
    first = np.maximum(starts, bottoms - near)
    size = np.minimum(bottoms + near + 1, force.size) - first
    after = force[bottoms]
    curved = np.flatnonzero((noise > 0) & (size >= 4))
    if curved.size:
        around = Windows(first[curved], size[curved])
        after[curved] = parabolas_through(time, force, around, bottoms[curved])
    return starts, bottoms, level, after


@dataclass(frozen=True)
class FoundSlips:
    """Slips in a trace, each array of shape (slips,)."""

    start_time: Array
    """Times of the maximum before [s]."""
    end_time: Array
    """Times of the minimum after [s]."""
    force_before: Array
    """Forces at the start, averaged over the noise as far as the trace allows [N]."""
    force_after: Array
    fall_rate: Array
    """Maximum rate of fall [N/s]."""
    first: Samples
    """Samples of the maximum before."""
    last: Samples
    """Samples of the minimum after."""
    min_fall: float = 0.0
    """Minimum fall of a slip [N]."""
    period: float = math.inf
    """Given period of the setup, or twice the duration of deep falls [s]; infinite without falls.
    """
    counts: SlipCounts = field(default_factory=SlipCounts)
    """Slips by minimum fall; empty if noise or minimum fall were given."""

    def __len__(self) -> int:
        return len(self.start_time)

    def without_slips(self) -> FoundSlips:
        """The same search, with no slip found."""
        none, no_samples = np.empty(0), np.empty(0, dtype=int)
        return replace(
            self,
            start_time=none,
            end_time=none,
            force_before=none,
            force_after=none,
            fall_rate=none,
            first=no_samples,
            last=no_samples,
            period=math.inf,
        )


def find_slips(
    time: Array,
    force: Array,
    *,
    noise: float | TraceNoise | None = None,
    period: float | None = None,
    direction: float = 1.0,
    min_fall: float | None = None,
    loading_rate: float | None = None,
    put_together: Parts = WHOLE,
) -> FoundSlips:
    """Find the slips in a trace of increasing times [s] and finite forces [N], or coefficients.

    The noise is estimated by default. If it is a number, the standard deviation of white noise,
    nothing is removed and the minimum fall follows from it. The period of the setup, 2 pi
    (M/K)^1/2, is by default twice the duration of deep falls [s]. The minimum fall follows from the
    trace by default; if it is given, every fall above it counts but for rebounds. The rate at which
    the force of a slider at rest grows is that of the rises of the trace [N/s]. The direction is
    the sign of the drive's velocity. Of parts that were put together each is searched.
    """
    force = direction * np.asarray(force, dtype=float)
    if len(force) < 4:
        return _none(period)
    if noise is None:
        noise = estimate_noise(time, force)
        cleaned = noise.clean(time, force)
    elif isinstance(noise, TraceNoise):
        cleaned = direction * noise.clean(time, direction * force)
    else:
        cleaned = force
    del force
    sigma = noise.total_deviation if isinstance(noise, TraceNoise) else noise
    every = partial(
        levels,
        time,
        cleaned,
        noise,
        period=period,
        loading_rate=loading_rate,
        put_together=put_together,
    )
    choice = chosen(every())
    level, tops, bottoms, counts = choice.level, choice.tops, choice.bottoms, choice.counts
    if min_fall is None:
        min_fall = choice.min_fall
    else:
        level = _level_of(every(min_fall=min_fall), min_fall)
        tops, bottoms = level.trace.exceeding(min_fall)
        counts = counts.with_row(min_fall, tops.size, level.mirror().numbers(min_fall)[1])
    if tops.size == 0:
        return _none(period, min_fall, counts)
    if period is None:
        period = fall_period(time, level.trace.force, tops, bottoms)
    rates = fall_rates(level, period, tops, bottoms)
    tops, last = level.on_samples(cleaned, tops, bottoms)
    half = level.half_samples(tops, period)
    first, last, before, after = ends_of(time, cleaned, tops, last, sigma, half)
    # A line over samples is flatter than a fall of one or two.
    rates = np.maximum(rates, (before - after) / (time[last] - time[first]))
    return FoundSlips(
        time[first],
        time[last],
        direction * before,
        direction * after,
        rates,
        first,
        last,
        min_fall,
        period,
        counts,
    )


def _level_of(every: Iterator[Level], min_fall: float) -> Level:
    """The widest median that hardly changes a fall."""
    level = next(every)
    whole = level.trace
    widest = fall_period(whole.time, whole.force, *whole.exceeding(min_fall)) / 4
    for one in every:
        if one.width > widest:
            break
        level = one
    return level


def estimated_period(time: Array, force: Array, noise: float) -> float:
    """Period of the setup [s], from the deepest falls of a trace, which contacts that attach
    shorten; infinite without falls."""
    period = math.inf
    for level in levels(time, np.asarray(force, dtype=float), noise):
        if level.width > period / 4:
            break
        tops, bottoms = level.trace.falls(level.floor)
        if tops.size:
            period = fall_period(time, level.trace.force, tops, bottoms)
    return period


def _none(
    period: float | None, min_fall: float = 0.0, counts: SlipCounts | None = None
) -> FoundSlips:
    empty, no_samples = np.empty(0), np.empty(0, dtype=int)
    return FoundSlips(
        empty,
        empty,
        empty,
        empty,
        empty,
        no_samples,
        no_samples,
        min_fall,
        math.inf if period is None else period,
        SlipCounts() if counts is None else counts,
    )
