"""Slips in sampled, noisy traces of a force, by a rule that knows no model.

The rule, explained in `docs/fit.md`:

- Impulses and hum are taken off. A running median, which keeps steps, takes off noise. It is as
  wide as the noise demands, and at most half as wide as the deep falls of the trace are long.
- A **fall** leads from a maximum to a minimum of alternating extremes that differ by more than a
  threshold. The threshold is the start of the first range of thresholds above the white noise in
  which the number of slips hardly changes; without one, it is above the range of all the noise.
- A fall that begins within half a period after the end of another, and reaches a lower force,
  belongs to it. The period is twice the duration of deep falls.
- A fall is a **slip** if it is deeper than twice what ringing regained before it. A rise within
  three quarters of a period is ringing if it is faster than loading. Of loading a quarter counts,
  so that a slip gives back half of it. Oscillations that only decay are ringing too.
- A slip is steep: for its depth not much slower than the others, and not slower than the rise to
  its maximum. After a velocity step the force rises fast and decays slowly.
- Where slips are not much faster than the rises before them, as falls of correlated noise are, the
  threshold is above the range of all the noise, and slips must be many and most of the deep falls.
- It starts where the force is last near its maximum and ends at its minimum. A fall from the first
  sample on has no start and does not count.

Runs make their catalogues by a similar rule, with two more criteria that only a simulation has:
breaks of contacts, and the velocity of the slider.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Extremes, Samples, extremes_of
from mesoslip.analysis.noise import Part, TraceNoise, estimate_noise, parts_of

Array = NDArray[np.float64]

# Minimum depth of a slip over the increase by ringing before it.
MIN_FALL_RATIO = 2.0
# Maximum time from a minimum to a maximum in ringing, in half periods of the setup.
MAX_RISE = 1.5
# Part of the loading before a slip that counts as ringing.
LOADING_PART = 0.25
# Maximum rate of loading over that of spring and drive, and over the median rate of rises where
# these are unknown.
MAX_LOADING, MAX_RISING = 1.1, 3.0
# Contribution of noise to the difference of a maximum and a minimum, in standard deviations.
EXTREME_NOISE = 4.0
# Minimum rate of fall, in 2 pi over the period times the deepest fall.
MIN_RATE = 0.015
# Minimum rate of a fall over its depth, over that of the deep falls.
MIN_STEEPNESS = 0.15
# Upper part of a fall, over its depth, in which its duration is compared with that of the rise.
UPPER = (0.5, 0.9)
# Minimum duration of the rise over that of the fall, and that of rises which are loading in the
# median over the slips of a trace.
MIN_RISE, LOADING_RISE = 0.5, 8.0
# Minimum share of slips among deep falls, and minimum number of slips, where rises are not much
# slower than falls.
MIN_SHARE, MIN_OSCILLATIONS = 0.5, 10
# Minimum fall over the range of the force.
MIN_HEIGHT = 0.002
# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1
# Widths of the running median, in samples.
WIDTHS = (1, 3, 5, 9, 17, 33, 65, 129, 257)
# Ratio of thresholds for which slips are counted.
THRESHOLD_RATIO = 1.25
# A plateau: maximum change of the count, and minimum ratio of its thresholds.
MAX_CHANGE, MIN_PLATEAU = 0.1, 1.5
# Minimum number of slips at the plateau, over that of all that stands out of the noise.
MIN_KEPT = 0.5
# Falls of a decaying oscillation: minimum number, and maximum ratio of the last to the first.
MIN_DECAYING, MAX_DECAY = 3, 0.5


@dataclass(frozen=True)
class SlipCounts:
    """How the number of slips depends on the minimum fall.

    Attributes
    ----------
    threshold
        Minimum falls, in the unit of the force, shape (thresholds,).
    count
        Number of slips, shape (thresholds,).
    plateau
        First and last minimum fall of the range in which the number hardly changes and from which
        the minimum fall is taken; None if there is no such range.
    """

    threshold: Array = field(default_factory=lambda: np.empty(0))
    count: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))
    plateau: tuple[float, float] | None = None


@dataclass(frozen=True)
class FoundSlips:
    """Slips in a trace, each array of shape (slips,).

    Attributes
    ----------
    start_time, end_time
        Times of the maximum before and of the minimum after [s].
    force_before, force_after
        Forces at these times, averaged over the noise as far as the trace allows [N].
    fall_rate
        Maximum rate of fall [N/s].
    first, last
        Samples of the maximum and of the minimum.
    min_fall
        Minimum fall of a slip [N].
    period
        Period of the setup that was given, or twice the duration of deep falls [s]; infinite
        without falls.
    counts
        Slips by minimum fall; empty if noise or minimum fall were given.
    """

    start_time: Array
    end_time: Array
    force_before: Array
    force_after: Array
    fall_rate: Array
    first: Samples
    last: Samples
    min_fall: float = 0.0
    period: float = math.inf
    counts: SlipCounts = field(default_factory=SlipCounts)

    def __len__(self) -> int:
        return len(self.start_time)


def find_slips(
    time: Array,
    force: Array,
    *,
    noise: float | TraceNoise | None = None,
    period: float | None = None,
    direction: float = 1.0,
    min_fall: float | None = None,
    loading_rate: float | None = None,
) -> FoundSlips:
    """Find the slips in a trace.

    Parameters
    ----------
    time
        Increasing times [s], shape (samples,).
    force
        Force of the spring [N], or a friction coefficient, shape (samples,), finite.
    noise
        What `estimate_noise` found; by default it is called. A number is the standard deviation of
        white noise [N]: then nothing is taken off, and the minimum fall follows from it.
    period
        Period of the setup, 2 pi (M/K)^1/2 [s]; by default twice the duration of deep falls.
    direction
        Sign of the drive's velocity.
    min_fall
        Minimum fall of a slip [N]; by default from the noise and the number of slips.
    loading_rate
        Rate at which the force of a slider at rest grows, stiffness times velocity of the drive
        [N/s]; by default that of rises of the trace.
    """
    force = direction * np.asarray(force, dtype=float)
    if len(force) < 4:
        return _none(math.inf)
    if noise is None:
        noise = estimate_noise(time, force)
        cleaned = noise.clean(time, force)
    elif isinstance(noise, TraceNoise):
        cleaned = direction * noise.clean(time, direction * force)
    else:
        cleaned = force
    sigma = noise.total_deviation if isinstance(noise, TraceNoise) else noise
    trace = _denoise(time, cleaned, noise, period)
    if trace is None:
        return _none(math.inf if period is None else period)
    search = _Search(trace, loading_rate)
    counts = SlipCounts()
    if min_fall is None:
        min_fall = trace.floor
        if isinstance(noise, TraceNoise):
            counts = _count(search)
            plateau = counts.plateau
            if plateau is not None:
                tops, bottoms, _ = search.slips(plateau[0])
                if _is_loaded(trace, tops, bottoms) or plateau[0] <= trace.floor <= plateau[1]:
                    min_fall = plateau[0]
                else:
                    counts = replace(counts, plateau=None)
    tops, bottoms, rates = search.slips(min_fall)
    if not (_is_loaded(trace, tops, bottoms) or search.is_oscillation(tops, bottoms)):
        tops = tops[:0]
    if tops.size == 0:
        return _none(math.inf if period is None else period, min_fall, counts)
    rows = [
        _ends(time, cleaned, top, bottom, sigma, trace.half_samples(top))
        for top, bottom in trace.on_samples(cleaned, tops, bottoms)
    ]
    start, end, before, after = np.array(rows).T
    first, last = start.astype(int), end.astype(int)
    return FoundSlips(
        time[first],
        time[last],
        direction * before,
        direction * after,
        rates,
        first,
        last,
        min_fall,
        trace.period,
        counts,
    )


def estimated_period(time: Array, force: Array, noise: float) -> float:
    """Period of the setup [s], estimated from the deepest falls of a trace; infinite without falls.

    The force of a slider without contacts falls for half a period of a sine; contacts that attach
    shorten the fall.
    """
    trace = _denoise(time, np.asarray(force, dtype=float), noise, None)
    return math.inf if trace is None else trace.period


def _none(period: float, min_fall: float = 0.0, counts: SlipCounts | None = None) -> FoundSlips:
    empty, no_samples = np.empty(0), np.empty(0, dtype=int)
    counts = SlipCounts() if counts is None else counts
    return FoundSlips(
        empty, empty, empty, empty, empty, no_samples, no_samples, min_fall, period, counts
    )


@dataclass(frozen=True)
class _Trace:
    """A trace after a running median, along the drive.

    ``width`` is that of the median [s], ``noise`` what it left, ``floor`` the minimum fall that
    stands out of it, and ``white_floor`` that which stands out of the white noise.
    """

    time: Array
    force: Array
    parts: tuple[Part, ...]
    extremes: Extremes
    width: float
    noise: float
    floor: float
    white_floor: float
    period: float

    def on_samples(
        self, force: Array, tops: Samples, bottoms: Samples
    ) -> Iterator[tuple[int, int]]:
        """Maximum and minimum of each fall among the samples that the median joined."""
        last = 0
        for top, bottom in zip(tops.tolist(), bottoms.tolist(), strict=True):
            part = next(one for one in self.parts if top < one.after)
            reach = round(self.width / part.interval) // 2
            start = max(last, top - reach)
            top = start + int(np.argmax(force[start : min(top + reach, bottom) + 1]))
            # The median cuts sharp minima most: the first of ringing may be the lowest.
            bottom = top + 1 + int(np.argmin(force[top + 1 : bottom + reach + 1]))
            yield top, bottom
            last = bottom

    def half_samples(self, at: int) -> int:
        """Samples in half a period, at a sample."""
        part = next(one for one in self.parts if at < one.after)
        return max(1, round(self.period / 2 / part.interval))


def _denoise(
    time: Array, force: Array, noise: float | TraceNoise, period: float | None
) -> _Trace | None:
    """The trace after a running median of the width that noise and falls demand.

    None if no fall stands out.
    """
    parts = parts_of(time)
    interval = max(parts, key=len).interval
    white = noise.deviation if isinstance(noise, TraceNoise) else noise
    found = None
    for width in WIDTHS:
        if found is not None and width * interval > found.period / 4:
            break
        filtered = _running_median(force, parts, width * interval)
        rest = _after_median(noise, width, interval)
        height = MIN_HEIGHT * float(np.ptp(filtered))
        size = _noise_range(len(force) / width)
        floor = max(size * rest, height)
        extremes = extremes_of(filtered)
        tops, bottoms = extremes.falls(floor)
        tops, bottoms = tops[tops > 0], bottoms[tops > 0]
        if tops.size:
            own = period if period is not None else _period(time, filtered, tops, bottoms)
            if found is None or width * interval <= own / 4:
                found = _Trace(
                    time=time,
                    force=filtered,
                    parts=parts,
                    extremes=extremes,
                    width=width * interval,
                    noise=rest,
                    floor=floor,
                    white_floor=max(size * _after_median(white, width, interval), height),
                    period=own,
                )
        if size * rest <= height or width >= len(force) // 8:
            break
    return found


def _after_median(noise: float | TraceNoise, width: int, interval: float) -> float:
    """Standard deviation of noise after a running median over so many samples.

    The variance of a median is pi/2 times that of a mean, in which there are as many independent
    values of correlated noise as there are twice its correlation time in the width.
    """
    if isinstance(noise, TraceNoise):
        white, correlated = noise.deviation, noise.correlated_deviation
        count = width * interval / (2 * noise.correlation_time + interval)
    else:
        white, correlated, count = noise, 0.0, 1.0
    if width == 1:
        return math.hypot(white, correlated)
    share = min(1.0, math.pi / 2 / count)
    return math.sqrt(white**2 * math.pi / 2 / width + correlated**2 * share)


def _noise_range(count: float) -> float:
    """Range that so many values of normal noise hardly exceed, in standard deviations."""
    return 2 * math.sqrt(2 * math.log(max(count, 2.0))) + 1


def _running_median(force: Array, parts: Sequence[Part], duration: float) -> Array:
    """Medians over a duration, within each part."""
    from scipy.ndimage import median_filter

    filtered = force.copy()
    for part in parts:
        width = 2 * round((duration / part.interval - 1) / 2) + 1
        if width > 1:
            filtered[part.samples] = median_filter(force[part.samples], width, mode="nearest")
    return filtered


def _period(time: Array, force: Array, tops: Samples, bottoms: Samples) -> float:
    """Twice the duration of deep falls [s].

    As noise blurs the ends of a fall, its duration is that between 90 and 10 % of the depth, and
    that of a sine. The estimate is the median over the falls at least half as deep as the deepest.
    """
    depth = force[tops] - force[bottoms]
    durations = []
    deep = depth >= depth.max() / 2
    for top, bottom in zip(tops[deep], bottoms[deep], strict=True):
        part = (force[top : bottom + 1] - force[bottom]) / (force[top] - force[bottom])
        high = int(np.flatnonzero(part >= 1 - MARGIN)[-1])
        low = high + int(np.flatnonzero(part[high:] <= MARGIN)[0])
        # Interpolated between the samples around each crossing.
        above = (part[high] - (1 - MARGIN)) / (part[high] - part[high + 1])
        below = (MARGIN - part[low]) / (part[low - 1] - part[low])
        at = time[top : bottom + 1]
        start = at[high] + above * (at[high + 1] - at[high])
        durations.append(at[low] - below * (at[low] - at[low - 1]) - start)
    share = 1 - 2 * math.acos(1 - 2 * MARGIN) / math.pi
    interval = float(np.median(np.diff(time)))
    return 2 * max(float(np.median(durations)) / share, interval)


class _Search:
    """Slips among the falls of a trace above a threshold."""

    def __init__(self, trace: _Trace, loading_rate: float | None) -> None:
        self._trace = trace
        self._rate = _rates(trace)
        deepest = float(trace.extremes.fall_sizes[-1])
        self._min_rate = MIN_RATE * 2 * math.pi / trace.period * deepest
        tops, bottoms = trace.extremes.falls(trace.floor)
        self._max_rising = _rising_rate(trace, tops, bottoms) * MAX_RISING
        if loading_rate is not None and loading_rate > 0:
            self._max_rising = MAX_LOADING * loading_rate

    def slips(self, threshold: float) -> tuple[Samples, Samples, Array]:
        """Samples of maximum and minimum, and the maximum rate of fall, of each slip."""
        trace, force, time = self._trace, self._trace.force, self._trace.time
        tops, bottoms = trace.extremes.falls(threshold)
        tops, bottoms = self._joined(tops[tops > 0], bottoms[tops > 0])
        if tops.size == 0:
            return tops, bottoms, np.empty(0)
        drop = force[tops] - force[bottoms]
        rates = np.array(
            [
                float(-self._rate[one : two + 1].min())
                for one, two in zip(tops, bottoms, strict=True)
            ]
        )
        since = np.searchsorted(time, time[tops] - MAX_RISE * trace.period / 2)
        lowest = np.array(
            [
                one + int(np.argmin(force[one : two + 1]))
                for one, two in zip(since, tops, strict=True)
            ]
        )
        regained = force[tops] - force[lowest]
        duration = time[tops] - time[lowest]
        is_loading = (regained <= self._max_rising * duration) & (duration >= trace.period / 4)
        is_loading &= ~_decaying(time[tops], time[bottoms], drop, trace.period)
        regained = np.where(is_loading, LOADING_PART * regained, regained)
        # Noise increases both, as they are differences of extremes.
        excess = np.minimum(drop, EXTREME_NOISE * trace.noise)
        found = drop - excess > MIN_FALL_RATIO * np.maximum(regained - excess, 0.0)
        found &= rates > self._min_rate
        found[found] = _rise_ratios(trace, tops[found], bottoms[found]) >= MIN_RISE
        if found.any():
            steepness = rates / drop
            deep = drop >= drop[found].max() / 2
            found &= steepness >= MIN_STEEPNESS * float(np.median(steepness[deep]))
        return tops[found], bottoms[found], rates[found]

    def is_oscillation(self, tops: Samples, bottoms: Samples) -> bool:
        """Whether slips are many, and most of the falls at least half as deep as their median."""
        if tops.size < MIN_OSCILLATIONS:
            return False
        force = self._trace.force
        all_tops, _ = self._trace.extremes.falls(float(np.median(force[tops] - force[bottoms])) / 2)
        return tops.size >= MIN_SHARE * all_tops.size

    def _joined(self, tops: Samples, bottoms: Samples) -> tuple[Samples, Samples]:
        """Falls with those that belong to them."""
        force, time, half = self._trace.force, self._trace.time, self._trace.period / 2
        joined: list[tuple[int, int]] = []
        for top, bottom in zip(tops.tolist(), bottoms.tolist(), strict=True):
            if joined:
                start, end = joined[-1]
                if (
                    time[top] - time[end] <= half
                    and force[bottom] < force[end]
                    and force[top] < 0.5 * (force[start] + force[end])
                ):
                    joined[-1] = (start, bottom)
                    continue
            joined.append((top, bottom))
        first, last = np.array(joined, dtype=int).reshape(-1, 2).T
        return first, last


def _rates(trace: _Trace) -> Array:
    """Rate of the force, by lines over an eighth of a period [N/s]."""
    from scipy.signal import savgol_filter

    rates = np.zeros(len(trace.force))
    for part in trace.parts:
        if len(part) < 3:
            continue
        half = max(1, round(trace.period / 2 / part.interval))
        # Wide enough to average over noise, narrow enough for ringing faster than the setup's.
        width = min(2 * max(1, half // 8) + 1, len(part) - 1 + len(part) % 2)
        rates[part.samples] = savgol_filter(
            trace.force[part.samples], width, 1, deriv=1, delta=part.interval, mode="nearest"
        )
    return rates


def _rising_rate(trace: _Trace, tops: Samples, bottoms: Samples) -> float:
    """Rate of the rises between deep falls, the median over time [N/s]."""
    force = trace.force
    if tops.size == 0:
        return math.inf
    depth = np.sort(force[tops] - force[bottoms])
    # Half of all falling is in falls of at least this depth.
    typical = float(depth[np.searchsorted(np.cumsum(depth), 0.5 * depth.sum())])
    tops, bottoms = trace.extremes.falls(typical / 2)
    if tops.size < 2:
        return math.inf
    duration = trace.time[tops[1:]] - trace.time[bottoms[:-1]]
    rate = (force[tops[1:]] - force[bottoms[:-1]]) / duration
    order = np.argsort(rate)
    middle = np.searchsorted(np.cumsum(duration[order]), 0.5 * duration.sum())
    return float(rate[order][middle])


def _rise_ratios(trace: _Trace, tops: Samples, bottoms: Samples) -> Array:
    """Duration of the rise to the maximum of each fall over that of the fall, at most twice
    `LOADING_RISE`, both in the upper part of the fall."""
    force, time, most = trace.force, trace.time, 2 * LOADING_RISE
    ratios = np.full(len(tops), most)
    for number, (top, bottom) in enumerate(zip(tops.tolist(), bottoms.tolist(), strict=True)):
        low, high = (force[bottom] + part * (force[top] - force[bottom]) for part in UPPER)
        after = top + int(np.argmax(force[top : bottom + 1] <= low))
        before = after - 1 - int(np.argmax(force[top:after][::-1] >= high))
        fall = time[after] - time[before]
        first = int(np.searchsorted(time, time[top] - 2 * most * fall))
        is_low = np.flatnonzero(force[first:top] <= low)
        if is_low.size:
            start = first + int(is_low[-1])
            end = start + int(np.argmax(force[start : top + 1] >= high))
            ratios[number] = min(most, (time[end] - time[start]) / fall)
    return ratios


def _is_loaded(trace: _Trace, tops: Samples, bottoms: Samples) -> bool:
    """Whether the rises before slips are slow, as those of loading: the median of deep ones."""
    if tops.size == 0:
        return False
    drop = trace.force[tops] - trace.force[bottoms]
    deep = drop >= drop.max() / 2
    return float(np.median(_rise_ratios(trace, tops[deep], bottoms[deep]))) >= LOADING_RISE


def _decaying(start: Array, end: Array, drop: Array, period: float) -> NDArray[np.bool_]:
    """Falls of oscillations that only decay, until the trace is quiet."""
    found = np.zeros(len(drop), dtype=bool)
    gaps = np.flatnonzero(start[1:] - end[:-1] > MAX_RISE * period / 2) + 1
    for first, after in itertools.pairwise([0, *gaps.tolist(), len(drop)]):
        one = drop[first:after]
        found[first:after] = (
            len(one) >= MIN_DECAYING
            and bool(np.all(np.diff(one) < 0))
            and one[-1] < MAX_DECAY * one[0]
        )
    return found


def _count(search: _Search) -> SlipCounts:
    """Slips by threshold, and the plateau of their number.

    From what stands out of the white noise on: what seems to be correlated noise may be the trace.
    """
    trace = search._trace
    deepest = float(trace.extremes.fall_sizes[-1])
    steps = max(1, math.ceil(math.log(deepest / trace.white_floor) / math.log(THRESHOLD_RATIO)))
    thresholds: Array = trace.white_floor * THRESHOLD_RATIO ** np.arange(steps, dtype=np.float64)
    counts = np.array([len(search.slips(float(one))[0]) for one in thresholds])
    for first, count in enumerate(counts):
        same = np.abs(counts[first:] - count) <= max(1.0, MAX_CHANGE * count)
        last = first + (int(np.argmin(same)) if not same.all() else len(same)) - 1
        # A few deep falls, as at the start of a run, are no plateau.
        if count < MIN_KEPT * counts[0]:
            break
        if thresholds[last] >= MIN_PLATEAU * thresholds[first]:
            return SlipCounts(
                thresholds, counts, (float(thresholds[first]), float(thresholds[last]))
            )
    return SlipCounts(thresholds, counts)


def _ends(
    time: Array, force: Array, top: int, bottom: int, noise: float, half: int
) -> tuple[float, float, float, float]:
    """Samples of start and end of a slip, and the forces there, averaged over the noise."""
    # The force grows slowly before a slip, so that noise decides which sample is the maximum. The
    # level is that of a line through the samples before, and the slip starts where means over
    # some samples fall below it.
    wide = max(1, min(half // 4, (bottom - top) // 3))
    low = max(0, top - max(4, half))
    level = force[top]
    if noise > 0 and top - low >= 3:
        # Without the maximum, which is biased by its noise.
        span = slice(low, top)
        slope, fitted = np.polyfit(time[span] - time[top], force[span], 1)
        residual = np.std(force[span] - fitted - slope * (time[span] - time[top]))
        # Ringing before the slip does not follow a straight line.
        if residual < 2 * noise:
            level = float(fitted)
    means = np.convolve(force[top : bottom + wide], np.full(wide, 1 / wide), "valid")
    high = np.flatnonzero(means >= level - 2 * noise / math.sqrt(wide))
    start = min(top + (int(high[-1]) if high.size else 0), bottom - 1)
    around = slice(max(start, bottom - max(1, half // 8)), bottom + max(1, half // 8) + 1)
    after = float(force[bottom])
    if noise > 0 and force[around].size >= 4:
        after = float(np.polynomial.Polynomial.fit(time[around], force[around], 2)(time[bottom]))
    return float(start), float(bottom), float(level), after
