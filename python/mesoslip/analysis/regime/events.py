"""The events of a motion: slips where they carry it, cycles of the force elsewhere.

The catalogue marks which falls of the force are ringing, at the frequencies of the setup, of pinned
contacts, of layers and base. Its slips carry the motion if their force drops add up to at least a
part of the loading by the drive, K v t; or if they are most of the cycles of the force, and more
regular, as they leave out the rebounds. Otherwise, as where each fall of an oscillation is regained
by the next rise, the cycles of the force are the events.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

# Minimum force drop of the slips of a motion over the loading by the drive.
MIN_SHARE = 0.5
# Minimum drop of a large slip over the typical one: half of the sum of drops is in larger slips.
MIN_DROP = 0.5
# Maximum number of cycles in a repeating pattern, and minimum number of its repetitions.
MAX_PATTERN = 3
MIN_PATTERNS = 4
# Minimum number of cycles for a regime or a correlation, and for a trend.
MIN_CYCLES = 3
MIN_TREND_CYCLES = 6


@dataclass(frozen=True)
class Cycles:
    """Cycles: times between successive peaks [s], decreases after the peaks, and forces there."""

    periods: Array
    falls: Array
    peaks: Array


@dataclass(frozen=True)
class Slips:
    """Starts and ends of the slips of a realization [s], forces at the starts, and drops with
    their rebounds; shape (slips,)."""

    start: Array
    end: Array
    before: Array
    drop: Array
    stroke: Array | None = None
    """Number of the stroke of each, between which there are no cycles; None without strokes."""

    def __len__(self) -> int:
        return len(self.start)

    def between(self, first: float, last: float, direction: float) -> Slips:
        """Those that start in an interval of time [s], with forces along the drive."""
        inside = (self.start >= first) & (self.start <= last)
        return self.of(inside, direction)

    def of(self, kept: NDArray[np.bool_], direction: float = 1.0) -> Slips:
        """Some of them, with forces along a direction."""
        before, drop = direction * self.before[kept], np.abs(self.drop[kept])
        stroke = None if self.stroke is None else self.stroke[kept]
        return Slips(self.start[kept], self.end[kept], before, drop, stroke)

    @property
    def large(self) -> Slips:
        """Slips that are not much smaller than those in which the force falls most."""
        if not len(self):
            return self
        drops = np.sort(self.drop)
        typical = drops[np.searchsorted(np.cumsum(drops), 0.5 * drops.sum())]
        return self.of(self.drop >= MIN_DROP * typical)

    @property
    def as_cycles(self) -> Cycles:
        """The cycles from slip to slip."""
        periods = np.diff(self.start)
        if self.stroke is not None:
            periods = periods[np.diff(self.stroke) == 0]
        return Cycles(periods, self.drop, self.before)


NO_SLIPS = Slips(*np.empty((4, 0)))


def events_of(slips: Slips, cycles: Cycles, loading: float) -> tuple[Cycles, bool]:
    """The events of a motion, and whether they are its slips; ``loading`` by the drive is K v t, 0
    if any share of slips is enough."""
    found = slips.large.as_cycles
    if len(found.periods) < MIN_CYCLES:
        return cycles, False
    if slips.drop.sum() >= MIN_SHARE * loading:
        return found, True
    has_most = len(found.periods) >= len(cycles.periods) / MAX_PATTERN
    is_regular = not irregularity(found.periods) >= irregularity(cycles.periods)
    return (found, True) if has_most and is_regular else (cycles, False)


def find_cycles(time: Array, force: Array, clipped: Array, turning: float) -> Cycles:
    """Cycles of a force between reversals of the clipped force above a threshold, with falls of
    that and peaks of the force."""
    # Only the local extremes can be peaks and lows.
    rises = np.diff(force) > 0
    extremes = np.flatnonzero(rises[1:] != rises[:-1]) + 1
    peaks: list[int] = []
    lows: list[int] = []
    best, is_rising = 0, None
    values = clipped.tolist()
    highest = lowest = 0
    for sample in [*extremes.tolist(), len(values) - 1]:
        value = values[sample]
        if is_rising is None:
            highest = sample if value > values[highest] else highest
            lowest = sample if value < values[lowest] else lowest
            if values[highest] - values[lowest] > turning:
                is_rising, best = highest > lowest, sample
        elif is_rising:
            if value >= values[best]:
                best = sample
            elif value < values[best] - turning:
                peaks.append(best)
                is_rising, best = False, sample
        elif value <= values[best]:
            best = sample
        elif value > values[best] + turning:
            # A low before the first peak ends an incomplete cycle.
            if peaks:
                lows.append(best)
            is_rising, best = True, sample
    count = min(len(peaks), len(lows))
    falls: Array = clipped[peaks[:count]] - clipped[lows[:count]]
    return Cycles(np.diff(time[peaks]), falls, force[peaks])


def defined(function: Callable[[Array], np.floating], values: Array, min_count: int = 1) -> float:
    """A statistic of values; NaN if there are fewer than a minimum number."""
    return float(function(values)) if len(values) >= min_count else math.nan


def variation(values: Array) -> float:
    """Coefficient of variation; NaN for fewer than two values."""
    return defined(np.std, values, 2) / defined(np.mean, values, 2)


def irregularity(values: Array, scale: float | None = None) -> float:
    """Smallest variation of the values and of sums of 2 or 3 successive values, over the scale.

    The scale is the mean of the values by default. Sums of m values are compared with m^(1/2) times
    a single value, the variation of independent ones: alternating values are regular, and random
    ones stay irregular in sums.
    """
    mean = defined(np.mean, values, 2) if scale is None else scale
    found = [defined(np.std, values, 2) / mean]
    for length in range(2, MAX_PATTERN + 1):
        sums = np.convolve(values, np.ones(length), "valid") if len(values) else values
        if len(values) >= MIN_PATTERNS * length:
            found.append(float(np.std(sums)) / (math.sqrt(length) * mean))
    return min(found)


def correlation(values: Array) -> float:
    """Correlation of each value with the next one; NaN if they are too few or constant."""
    before, after = values[:-1], values[1:]
    if len(before) < MIN_CYCLES or np.std(before) == 0 or np.std(after) == 0:
        return math.nan
    return float(np.corrcoef(before, after)[0, 1])


def trend(values: Array) -> tuple[float, float]:
    """Linear change from the first value to the last over the mean, and its standard error."""
    count = len(values)
    if count < MIN_TREND_CYCLES:
        return math.nan, math.nan
    position = np.linspace(-0.5, 0.5, count)
    mean = float(np.mean(values))
    change = float(position @ values / (position @ position))
    residuals = values - mean - change * position
    error = math.sqrt(float(residuals @ residuals) / ((count - 2) * float(position @ position)))
    return change / mean, error / mean
