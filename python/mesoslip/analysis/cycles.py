"""Cycles of a force, and statistics of their periods, falls and peaks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Maximum number of cycles in a repeating pattern, and minimum number of its repetitions.
MAX_PATTERN = 3
MIN_PATTERNS = 4
# Minimum number of cycles for a regime or a correlation, and for a trend.
MIN_CYCLES = 3
MIN_TREND_CYCLES = 6


@dataclass(frozen=True)
class Cycles:
    """Cycles of a force.

    Attributes
    ----------
    periods
        Times between successive peaks [s].
    falls
        Decreases of the force after the peaks [N].
    peaks
        Forces at the peaks [N].
    """

    periods: Array
    falls: Array
    peaks: Array


def find_cycles(time: Array, force: Array, clipped: Array, turning: float) -> Cycles:
    """Cycles of a force, separated by reversals larger than a threshold.

    Parameters
    ----------
    time, force
        Times [s] and force [N], shape (samples,).
    clipped
        The force clipped to a range, for reversals and falls.
    turning
        Minimum reversal of the clipped force [N].
    """
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
    """Smallest coefficient of variation of the values and of sums of successive values.

    Over another scale than the mean, if there is one.

    Sums of m values are compared with m^(1/2) times a single value, the variation of independent
    ones: alternating values are regular, and random ones stay irregular in sums.
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
