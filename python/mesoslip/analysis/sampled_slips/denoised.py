"""Traces after a running median, which removes noise, and the period of their falls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Extremes, Samples, extremes_of
from mesoslip.analysis.noise import Part, TraceNoise, parts_of

Array = NDArray[np.float64]

# Minimum fall over the range of the force.
MIN_HEIGHT = 0.002
# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1
# Widths of the running median, in samples.
WIDTHS = (1, 3, 5, 9, 17, 33, 65, 129, 257)


@dataclass(frozen=True)
class DenoisedTrace:
    """A trace after a running median, along the drive."""

    time: Array
    force: Array
    parts: tuple[Part, ...]
    extremes: Extremes
    width: float  # of the median [s]
    noise: float  # standard deviation after the median
    floor: float  # minimum fall above the noise
    white_floor: float  # minimum fall above the white noise
    period: float

    def on_samples(
        self, force: Array, tops: Samples, bottoms: Samples
    ) -> Iterator[tuple[int, int]]:
        """Samples of the maximum and minimum of each fall in the trace before the median."""
        last = 0
        for top, bottom in zip(tops.tolist(), bottoms.tolist(), strict=True):
            part = next(one for one in self.parts if top < one.after)
            reach = round(self.width / part.interval) // 2
            start = max(last, top - reach)
            top = start + int(np.argmax(force[start : min(top + reach, bottom) + 1]))
            # The median removes sharp minima: in the force, the first of ringing may be lowest.
            bottom = top + 1 + int(np.argmin(force[top + 1 : bottom + reach + 1]))
            yield top, bottom
            last = bottom

    def half_samples(self, at: int) -> int:
        """Samples in half a period, at a sample."""
        part = next(one for one in self.parts if at < one.after)
        return max(1, round(self.period / 2 / part.interval))


def denoise(
    time: Array, force: Array, noise: float | TraceNoise, period: float | None
) -> DenoisedTrace | None:
    """The trace after a running median as wide as noise and falls demand; None without falls."""
    parts = parts_of(time)
    interval = max(parts, key=len).interval
    white = noise.deviation if isinstance(noise, TraceNoise) else noise
    found = None
    for width in WIDTHS:
        if found is not None and width * interval > found.period / 4:
            break
        filtered = _running_median(force, parts, width * interval)
        remaining = _after_median(noise, width, interval)
        height = MIN_HEIGHT * float(np.ptp(filtered))
        size = _noise_range(len(force) / width)
        floor = max(size * remaining, height)
        extremes = extremes_of(filtered)
        tops, bottoms = extremes.falls(floor)
        tops, bottoms = tops[tops > 0], bottoms[tops > 0]
        if tops.size:
            own = period if period is not None else _period(time, filtered, tops, bottoms)
            if found is None or width * interval <= own / 4:
                found = DenoisedTrace(
                    time=time,
                    force=filtered,
                    parts=parts,
                    extremes=extremes,
                    width=width * interval,
                    noise=remaining,
                    floor=floor,
                    white_floor=max(size * _after_median(white, width, interval), height),
                    period=own,
                )
        if size * remaining <= height or width >= len(force) // 8:
            break
    return found


def _after_median(noise: float | TraceNoise, width: int, interval: float) -> float:
    """Standard deviation of noise after a running median over a width [samples].

    The variance of a median is pi/2 times that of a mean. The number of independent values of
    correlated noise is the width over twice the correlation time.
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
        # Crossings are interpolated between samples.
        above = (part[high] - (1 - MARGIN)) / (part[high] - part[high + 1])
        below = (MARGIN - part[low]) / (part[low - 1] - part[low])
        at = time[top : bottom + 1]
        start = at[high] + above * (at[high + 1] - at[high])
        durations.append(at[low] - below * (at[low] - at[low - 1]) - start)
    share = 1 - 2 * math.acos(1 - 2 * MARGIN) / math.pi
    interval = float(np.median(np.diff(time)))
    return 2 * max(float(np.median(durations)) / share, interval)
