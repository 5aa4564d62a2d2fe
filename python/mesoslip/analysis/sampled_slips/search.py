"""Slips among the falls of a trace: what distinguishes them from ringing, loading and noise."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.sampled_slips.denoised import DenoisedTrace

Array = NDArray[np.float64]

# Minimum depth of a slip over the increase by ringing before it.
MIN_FALL_RATIO = 2.0
# Maximum time from a minimum to a maximum in ringing, in half periods of the setup.
MAX_RISE = 1.5
# Part of a rise by loading that counts as ringing.
LOADING_PART = 0.25
# Maximum rate of loading over that of spring and drive, and over the median rate of rises where
# these are unknown.
MAX_LOADING, MAX_RISING = 1.1, 3.0
# Contribution of noise to the difference of a maximum and a minimum, in standard deviations.
EXTREME_NOISE = 4.0
# Minimum rate of fall over 2 pi/period times the deepest fall.
MIN_RATE = 0.015
# Minimum rate of a fall over its depth, over that of the deep falls.
MIN_STEEPNESS = 0.15
# Upper part of a fall, over its depth, in which its duration is compared with that of the rise.
UPPER = (0.5, 0.9)
# Minimum duration of the rise over that of the fall: of each slip, and in the median over the slips
# of a trace if rises are loading.
MIN_RISE, LOADING_RISE = 0.5, 8.0
# Minimum share of slips among deep falls, and minimum number of slips, where rises are not much
# slower than falls.
MIN_SHARE, MIN_OSCILLATIONS = 0.5, 10
# Falls of a decaying oscillation: minimum number, and maximum ratio of the last to the first.
MIN_DECAYING, MAX_DECAY = 3, 0.5


class SlipSearch:
    """Slips among the falls of a trace above a threshold."""

    def __init__(self, trace: DenoisedTrace, loading_rate: float | None) -> None:
        self.trace = trace
        self._rate = _rates(trace)
        deepest = float(trace.extremes.fall_sizes[-1])
        self._min_rate = MIN_RATE * 2 * math.pi / trace.period * deepest
        tops, bottoms = trace.extremes.falls(trace.floor)
        self._max_rising = _rising_rate(trace, tops, bottoms) * MAX_RISING
        if loading_rate is not None and loading_rate > 0:
            self._max_rising = MAX_LOADING * loading_rate

    def slips(self, threshold: float) -> tuple[Samples, Samples, Array]:
        """Samples of maximum and minimum, and the maximum rate of fall, of each slip."""
        trace, force, time = self.trace, self.trace.force, self.trace.time
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
        # Both are differences of extremes, which noise increases.
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
        force = self.trace.force
        all_tops, _ = self.trace.extremes.falls(float(np.median(force[tops] - force[bottoms])) / 2)
        return tops.size >= MIN_SHARE * all_tops.size

    def _joined(self, tops: Samples, bottoms: Samples) -> tuple[Samples, Samples]:
        """Falls, each with the following ones that belong to it."""
        force, time, half = self.trace.force, self.trace.time, self.trace.period / 2
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


def _rates(trace: DenoisedTrace) -> Array:
    """Rate of the force, by lines over an eighth of a period [N/s]."""
    from scipy.ndimage import correlate1d

    rates = np.zeros(len(trace.force))
    for part in trace.parts:
        if len(part) < 3:
            continue
        half = max(1, round(trace.period / 2 / part.interval))
        # Wide enough to average over noise, narrow enough for ringing faster than the setup's.
        width = min(2 * max(1, half // 8) + 1, len(part) - 1 + len(part) % 2)
        # Weights of the slope of a line through the samples.
        at = np.arange(width) - width // 2
        weights = at / (np.sum(at**2) * part.interval)
        rates[part.samples] = correlate1d(trace.force[part.samples], weights, mode="nearest")
    return rates


def _rising_rate(trace: DenoisedTrace, tops: Samples, bottoms: Samples) -> float:
    """Rate of the rises between deep falls, the median over time [N/s]."""
    force = trace.force
    if tops.size == 0:
        return math.inf
    depth = np.sort(force[tops] - force[bottoms])
    # Half of the sum of depths is in falls of at least this depth.
    typical = float(depth[np.searchsorted(np.cumsum(depth), 0.5 * depth.sum())])
    tops, bottoms = trace.extremes.falls(typical / 2)
    if tops.size < 2:
        return math.inf
    duration = trace.time[tops[1:]] - trace.time[bottoms[:-1]]
    rate = (force[tops[1:]] - force[bottoms[:-1]]) / duration
    order = np.argsort(rate)
    middle = np.searchsorted(np.cumsum(duration[order]), 0.5 * duration.sum())
    return float(rate[order][middle])


def _rise_ratios(trace: DenoisedTrace, tops: Samples, bottoms: Samples) -> Array:
    """Duration of the rise to the maximum of each fall over that of the fall, in the upper part.

    The ratio is at most twice `LOADING_RISE`.
    """
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


def is_loaded(trace: DenoisedTrace, tops: Samples, bottoms: Samples) -> bool:
    """Whether the rises before deep slips are slow in the median, as those of loading."""
    if tops.size == 0:
        return False
    drop = trace.force[tops] - trace.force[bottoms]
    deep = drop >= drop.max() / 2
    return float(np.median(_rise_ratios(trace, tops[deep], bottoms[deep]))) >= LOADING_RISE


def _decaying(start: Array, end: Array, drop: Array, period: float) -> NDArray[np.bool_]:
    """Whether each fall is of an oscillation that only decays, until the trace is quiet."""
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
