"""Events of a second channel, such as acoustic emission: a trigger, or peaks above the noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.analysis.noise.levels import NORMAL_MEDIAN
from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree

CHANNEL = "acoustic_emission"
# Threshold over the standard deviation of the noise: chance exceeds it once in 10^9 samples.
THRESHOLD = 6.0
# Maximum number of values of a trigger, and samples below a share of the threshold that end an
# event.
TRIGGER_VALUES, DEAD_SAMPLES, END = 3, 10, 0.5


@dataclass(frozen=True)
class Emissions:
    """Events of a channel, each array of shape (events,)."""

    start_time: Array
    end_time: Array
    amplitude: Array
    """Maximum above the median, in the unit of the channel."""
    energy: Array
    """Integral of the square above the median."""
    threshold: float
    is_trigger: bool


def emissions_of(tree: Tree, threshold: float | None = None) -> Emissions:
    """Events of the channel of an output.

    A channel of two or three values is a trigger, whose events are between its edges. Of others the
    distance from the median is an event where it exceeds a threshold, by default 6 standard
    deviations of the noise; it ends when it is below half of that for 10 intervals, so that a burst
    that decays is one event.
    """
    if CHANNEL not in tree.data_vars:
        raise FileError(
            "the output has no second channel: trace --columns 'time [s], force [N], "
            "acoustic_emission [V]' reads one"
        )
    root = tree.to_dataset()
    time, values = root["time"].values, root[CHANNEL].values[0].astype(float)
    known = np.isfinite(values)
    time, values = time[known], values[known]
    size = np.abs(values - np.median(values))
    is_trigger = np.unique(values).size <= TRIGGER_VALUES
    if threshold is None:
        noise = float(np.median(size)) / NORMAL_MEDIAN
        threshold = 0.5 * float(size.max()) if is_trigger else THRESHOLD * noise
    above = np.flatnonzero(size > threshold)
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    rest = 1.5 * step if is_trigger else DEAD_SAMPLES * step
    if not above.size:
        none = np.empty(0)
        return Emissions(none, none, none, none, threshold, is_trigger)
    beyond = np.flatnonzero(size > END * threshold)
    starts = beyond[np.append(0, np.flatnonzero(np.diff(time[beyond]) > rest) + 1)]
    cuts = np.flatnonzero(np.diff(np.searchsorted(starts, above, side="right"))) + 1
    first, last = above[np.append(0, cuts)], above[np.append(cuts - 1, above.size - 1)]
    weights = size**2 * np.gradient(time)
    total = np.concatenate([[0.0], np.cumsum(weights)])
    return Emissions(
        time[first],
        time[last],
        np.maximum.reduceat(np.append(size, -math.inf), np.stack([first, last + 1], 1).ravel())[
            ::2
        ],
        total[last + 1] - total[first],
        threshold,
        is_trigger,
    )
