"""A trace after a running median of some width, its falls, and what noise would make of it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mesoslip.analysis.alternating_extremes import Extremes, Samples, extremes_of
from mesoslip.analysis.noise import Part, TraceNoise, parts_of
from mesoslip.analysis.sampled_slips.windows import Windows
from mesoslip.array_types import Array

# Part below the maximum, over the smaller one of rise and fall, in which durations are compared,
# and maximum of their ratio.
UPPER, MAX_RATIO = (0.1, 0.5), 100.0


def _none() -> Samples:
    return np.empty(0, dtype=int)


@dataclass
class Ratios:
    """The ratios of the falls of a trace, each computed once, when it is first asked for."""

    time: Array
    force: Array
    _keys: Samples = field(init=False, default_factory=_none)  # of known falls, in order
    _lows: Samples = field(init=False, default_factory=_none)
    _values: Array = field(init=False, default_factory=lambda: np.empty(0))

    def add(self, tops: Samples, bottoms: Samples, lows: Samples) -> None:
        """Add falls, in their order, or replace the minima from which their rises start."""
        keys = self._key(tops, bottoms)
        at = np.searchsorted(self._keys, keys)
        is_new = np.append(self._keys, -1)[at] != keys
        self._lows[at[~is_new]] = lows[~is_new]
        if is_new.any():
            more = np.full(np.count_nonzero(is_new), np.nan)
            every = np.concatenate([self._keys, keys[is_new]])
            order = np.argsort(every, kind="stable")
            self._keys = every[order]
            self._lows = np.concatenate([self._lows, lows[is_new]])[order]
            self._values = np.concatenate([self._values, more])[order]

    def of(self, tops: Samples, bottoms: Samples) -> Array:
        """The ratios of falls that were added."""
        at = np.searchsorted(self._keys, self._key(tops, bottoms))
        missing = np.isnan(self._values[at])
        if missing.any():
            some = at[missing]
            self._values[some] = self._computed(tops[missing], bottoms[missing], self._lows[some])
        return self._values[at]

    def _key(self, tops: Samples, bottoms: Samples) -> Samples:
        return tops * self.force.size + bottoms

    def _computed(self, tops: Samples, bottoms: Samples, lows: Samples) -> Array:
        force = self.force
        height = force[tops] - np.maximum(force[lows], force[bottoms])
        rises = self._durations(Windows(tops, tops - lows + 1, -1), height)
        falls = self._durations(Windows(tops, bottoms - tops + 1), height)
        return np.minimum(MAX_RATIO, rises / falls)

    def _durations(self, windows: Windows, height: Array) -> Array:
        """Time from the last sample near the maximum to the first one far below it."""
        found = np.empty(height.size)
        for some, block in windows.blocks():
            force, top = self.force[block.samples], self.force[block.first]
            upper, lower = (block.spread(top - part * height[some]) for part in UPPER)
            below, above = np.flatnonzero(force <= lower), np.flatnonzero(force >= upper)
            low = below[np.searchsorted(below, block.starts)]
            high = above[np.searchsorted(above, low) - 1]
            found[some] = np.abs(self.time[block.samples[low]] - self.time[block.samples[high]])
        return found


# Minimum fall over the range of the force, as forces have rounding errors.
MIN_HEIGHT = 1e-3
# Minimum fall in digital steps: a median keeps single ones.
MIN_STEPS = 2.0
# Widths of the running median, in samples.
WIDTHS = (1, 3, 5, 9, 17, 33, 65, 129, 257)
# Maximum rate of loading over the median rate of rises: what rises beyond it is a rebound.
MAX_LOADING = 1.5
# Narrower medians by which the rate of loading is known as well.
NARROWER = 2
# Minimum depth of a slip over the rebound before it.
MIN_FALL_RATIO = 2.0
# Minimum rate of a slip over that of the deepest fall.
MIN_RATE = 0.02
# Maximum duration of a rebound over that of the fall after it, half a period of the setup.
REBOUND = 1.5
# Minimum duration of the rise over that of the fall: slower ones are responses of smooth sliding.
MIN_RATIO = 0.5
# Samples, and widths of the median, over which the slope of the trace is measured.
SLOPE_SAMPLES, SLOPE_WIDTHS = 8, 2


class Parts(NamedTuple):
    """Parts of a trace that were put one after the other: no fall extends over two of them."""

    first: Samples
    """First sample of each part."""
    are_late: bool = False
    """Whether they may end after a reversal, where the force does not rise again after a fall."""


WHOLE = Parts(np.zeros(1, dtype=int))


@dataclass
class Side:
    """The falls of a trace, or of its mirror image in the line of loading."""

    time: Array
    force: Array
    loading_rate: float | None
    """Rate of the force while the slider is at rest, if known [N/s]."""
    period: float | None
    """Period of the setup, if given [s]."""
    parts: Parts
    floor: float
    min_size: float
    """Minimum fall for which extremes are asked for."""
    narrower: tuple[float, ...] = ()
    """Rates of rises after narrower medians [N/s]: wide ones flatten those between small slips."""
    original: Side | None = None
    """The trace, of a mirror image."""
    _excess: dict[int, tuple[Samples, Samples, Array]] = field(init=False, default_factory=dict)

    @cached_property
    def extremes(self) -> Extremes:
        """Alternating extremes for all thresholds."""
        return extremes_of(self.force, self.min_size)

    @cached_property
    def _ratios(self) -> Ratios:
        return Ratios(self.time, self.force)

    def falls(self, threshold: float) -> tuple[Samples, Samples]:
        """Samples of maximum and minimum of falls above a threshold, but for very slow ones."""
        tops, bottoms = self.exceeding(threshold)
        duration = self.time[bottoms] - self.time[tops]
        rates = (self.force[tops] - self.force[bottoms]) / duration
        kept = rates >= MIN_RATE * self._deepest_rate
        return tops[kept], bottoms[kept]

    def exceeding(
        self, threshold: float, *, with_rebounds: bool = False
    ) -> tuple[Samples, Samples]:
        """Samples of maximum and minimum of falls after the first sample that exceed rebounds by a
        threshold; with rebounds, of all of them."""
        rank = self.extremes.rank(threshold)
        if rank not in self._excess:
            self._excess[rank] = self._excess_of(*self.extremes.falls(threshold))
        tops, bottoms, excess = self._excess[rank]
        if with_rebounds:
            return tops, bottoms
        kept = excess > threshold
        return tops[kept], bottoms[kept]

    def _excess_of(self, tops: Samples, bottoms: Samples) -> tuple[Samples, Samples, Array]:
        """Falls with a start, and their depths without those of the rebounds before."""
        if tops.size == 0:
            return tops, bottoms, np.empty(0)
        force = self.force
        lows = np.concatenate([[np.argmin(force[: tops[0] + 1])], bottoms[:-1]])
        # A fall, and the rise before it, begin and end within a part.
        part = np.searchsorted(self.parts.first, tops, side="right")
        after = np.append(self.parts.first, force.size)[part]
        lows = np.maximum(lows, self.parts.first[part - 1])
        kept = (force[lows] < force[tops]) & (bottoms < after)
        if self.parts.are_late:
            last = np.flatnonzero(kept & (np.append(tops[1:], force.size) >= after))
            kept[last] = [
                force[bottoms[one] : after[one]].max() > force[bottoms[one]] + self.floor / 2
                for one in last.tolist()
            ]
        tops, bottoms, lows = tops[kept], bottoms[kept], lows[kept]
        self._ratios.add(tops, bottoms, lows)
        depth = force[tops] - force[bottoms]
        return tops, bottoms, depth - MIN_FALL_RATIO * self._rebounds(lows, tops, bottoms)

    @cached_property
    def _deepest_rate(self) -> float:
        """Rate of the deepest fall [N/s]."""
        if self.original is not None:
            return self.original._deepest_rate
        tops, bottoms = self.exceeding(self.floor, with_rebounds=True)
        if tops.size == 0:
            return 0.0
        drop = self.force[tops] - self.force[bottoms]
        at = int(np.argmax(drop))
        return float(drop[at] / (self.time[bottoms[at]] - self.time[tops[at]]))

    def _rebounds(self, lows: Samples, tops: Samples, bottoms: Samples) -> Array:
        """Rises just before falls beyond that by loading, as of ringing and impulses.

        A slider at rest is loaded at a constant rate at most, and one that rings rises by the
        amplitude in half a period. Noise, which increases the difference of a maximum and a
        minimum, is subtracted.
        """
        rises = np.zeros(tops.size)
        if math.isinf(self._loading) or tops.size == 0:
            return rises
        time, force = self.time, self.force
        duration: Array | float = REBOUND * (time[bottoms] - time[tops])
        if self.period is not None:
            duration = 0.5 * REBOUND * self.period
        first = np.maximum(lows, np.searchsorted(time, time[tops] - duration))
        for some, block in Windows(first, tops - first + 1).blocks():
            end, since = block.spread(tops[some]), block.samples
            loading = MAX_LOADING * self._loading * (time[end] - time[since])
            rises[some] = block.max_of(force[end] - force[since] - loading)
        return np.maximum(rises - self.floor / 2, 0.0)

    def ratios(self, tops: Samples, bottoms: Samples) -> Array:
        """Duration of the rise before each fall over that of the fall, in the upper part."""
        return self._ratios.of(tops, bottoms)

    def numbers(self, threshold: float) -> tuple[int, int]:
        """Numbers of slips above a threshold, and of falls much faster than the rises before, of
        which noise makes as many in the mirror image."""
        if not self.extremes.has_falls(threshold):
            return 0, 0
        ratios = self.ratios(*self.falls(threshold))
        is_slip, is_steep = ratios >= MIN_RATIO, ratios >= 1 / MIN_RATIO
        return int(np.count_nonzero(is_slip)), int(np.count_nonzero(is_steep))

    @property
    def _loading(self) -> float:
        """Rate of loading [N/s]; infinite if it is not known."""
        if self.original is not None:
            return self.original._loading
        return max(self.rising, *self.narrower, 0.0)

    @cached_property
    def rising(self) -> float:
        """Rate of the rises between deep falls, the median over time [N/s]."""
        if self.loading_rate is not None and self.loading_rate > 0:
            return self.loading_rate
        tops, bottoms = self.extremes.falls(self.floor)
        if tops.size < 2:
            return math.inf
        depth = np.sort(self.force[tops] - self.force[bottoms])
        # Half of the sum of depths is in falls of at least this depth.
        typical = float(depth[np.searchsorted(np.cumsum(depth), 0.5 * depth.sum())])
        tops, bottoms = self.extremes.falls(typical / 2)
        if tops.size < 2:
            return math.inf
        duration = self.time[tops[1:]] - self.time[bottoms[:-1]]
        rate = (self.force[tops[1:]] - self.force[bottoms[:-1]]) / duration
        order = np.argsort(rate)
        middle = np.searchsorted(np.cumsum(duration[order]), 0.5 * duration.sum())
        return float(rate[order][middle])


@dataclass(frozen=True)
class Level:
    """A trace after a running median, along the drive."""

    parts: tuple[Part, ...]
    width: float  # of the median [s]
    floor: float  # minimum fall above the white noise
    trace: Side
    slope: float  # of the line of loading

    def mirror(self) -> Side:
        """The trace mirrored in its line of loading."""
        one = self.trace
        mirrored = 2 * self.slope * (one.time - one.time[0]) - one.force
        return replace(one, force=mirrored, original=one)

    def slips(self, threshold: float) -> tuple[Samples, Samples]:
        """Samples of maximum and minimum of the slips above a threshold."""
        tops, bottoms = self.trace.falls(threshold)
        kept = self.trace.ratios(tops, bottoms) >= MIN_RATIO
        return tops[kept], bottoms[kept]

    def on_samples(self, force: Array, tops: Samples, bottoms: Samples) -> tuple[Samples, Samples]:
        """Samples of maximum and minimum of falls in the trace before the median."""
        last, found = 0, []
        reaches = np.round(self.width / self._intervals(tops)).astype(int) // 2
        columns = (one.tolist() for one in (tops, bottoms, reaches))
        for top, bottom, reach in zip(*columns, strict=True):
            start = min(max(last, top - reach), bottom - 1)
            top = start + int(np.argmax(force[start : min(top + reach, bottom - 1) + 1]))
            # The median removes sharp minima: in the force, the first of ringing may be lowest.
            last = top + 1 + int(np.argmin(force[top + 1 : bottom + reach + 1]))
            found.append((top, last))
        first, after = np.array(found, dtype=int).reshape(-1, 2).T
        return first, after

    def half_samples(self, at: Samples, period: float) -> Samples:
        """Samples in half a period, at some samples."""
        half: Samples = np.maximum(1, np.round(period / 2 / self._intervals(at)).astype(int))
        return half

    def _intervals(self, at: Samples) -> Array:
        """Sampling intervals at some samples [s]."""
        part = np.searchsorted([one.after for one in self.parts], at, side="right")
        return np.array([one.interval for one in self.parts])[part]


def levels(
    time: Array,
    force: Array,
    noise: float | TraceNoise,
    *,
    period: float | None = None,
    loading_rate: float | None = None,
    min_fall: float = math.inf,
    put_together: Parts = WHOLE,
) -> Iterator[Level]:
    """The trace after running medians, from narrow to wide, until noise is negligible; long ones
    are held one at a time."""
    parts = parts_of(time)
    interval = max(parts, key=len).interval
    if isinstance(noise, TraceNoise):
        white, step = noise.deviation, noise.digital_step
    else:
        white, step = noise, 0.0
    rising: deque[float] = deque(maxlen=NARROWER)
    for width in WIDTHS:
        if width > 1 and (
            width > len(force) // 8 or (period is not None and width * interval > period / 4)
        ):
            return
        filtered = _running_median(force, parts, width * interval)
        height = max(MIN_HEIGHT * float(np.ptp(filtered)), MIN_STEPS * step)
        # The variance of a median is pi/2 times that of a mean.
        deviation = white * (1.0 if width == 1 else math.sqrt(math.pi / 2 / width))
        noise_range = _noise_range(len(force) / width) * deviation
        floor = max(noise_range, height)
        reach = min(max(SLOPE_SAMPLES, SLOPE_WIDTHS * width), len(force) - 1)
        slope = float(
            np.median((filtered[reach:] - filtered[:-reach]) / (time[reach:] - time[:-reach]))
        )
        # The rate of loading is that between falls of half the typical size.
        min_size = min(floor / 2, min_fall)
        narrower = tuple(rising)
        trace = Side(time, filtered, loading_rate, period, put_together, floor, min_size, narrower)
        yield Level(parts, width * interval, floor, trace, slope)
        if math.isfinite(trace.rising):
            rising.append(trace.rising)
        if noise_range <= height and not isinstance(noise, TraceNoise):
            return


def _noise_range(count: float) -> float:
    """Range that a number of values of normal noise hardly exceeds, in standard deviations."""
    return 2 * math.sqrt(2 * math.log(max(count, 2.0))) + 1


def _running_median(force: Array, parts: Sequence[Part], duration: float) -> Array:
    """Medians over a duration [s], within each part."""
    from scipy.ndimage import median_filter

    filtered = force.copy()
    for part in parts:
        width = 2 * round((duration / part.interval - 1) / 2) + 1
        if width > 1:
            filtered[part.samples] = median_filter(force[part.samples], width, mode="nearest")
    return filtered
