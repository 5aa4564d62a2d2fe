"""Parts of a record with one sampling interval each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array

# Minimum ratio of intervals at a change of the sampling rate.
MIN_CHANGE = 1.5
# Intervals over which the rate is a median, so that single gaps and jitter do not change it.
MEDIAN_WIDTH = 9
# Minimum samples of a part; shorter ones belong to the part before.
MIN_SAMPLES = 32


@dataclass(frozen=True)
class Part:
    """Samples ``first`` to ``after - 1`` of a record, and the interval between them [s]."""

    first: int
    after: int
    interval: float

    @property
    def samples(self) -> slice:
        return slice(self.first, self.after)

    def __len__(self) -> int:
        return self.after - self.first


def parts_of(time: Array) -> tuple[Part, ...]:
    """Parts of a record of increasing times [s] with one sampling interval each; gaps do not end a
    part."""
    from scipy.ndimage import median_filter

    if len(time) < 2:
        return (Part(0, len(time), 1.0),)
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.count_nonzero(np.abs(steps - interval) > 0.2 * interval) <= len(steps) // 1000:
        return (Part(0, len(time), interval),)
    rate = np.log(median_filter(steps, MEDIAN_WIDTH, mode="nearest"))
    bounds = [0]
    for at in np.flatnonzero(np.abs(np.diff(rate)) > np.log(MIN_CHANGE)) + 1:
        level = float(np.median(rate[bounds[-1] : at]))
        later = float(np.median(rate[at : at + MIN_SAMPLES]))
        if at - bounds[-1] >= MIN_SAMPLES and abs(later - level) > np.log(MIN_CHANGE):
            bounds.append(int(at))
    if len(time) - bounds[-1] < MIN_SAMPLES and len(bounds) > 1:
        bounds.pop()
    return tuple(
        Part(first, after, float(np.median(steps[first : max(after - 1, first + 1)])))
        for first, after in zip(bounds, [*bounds[1:], len(time)], strict=True)
    )
