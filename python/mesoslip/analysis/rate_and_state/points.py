"""Records of the force, averaged to points along the drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

Samples = NDArray[np.int64]

# Points of a stage, evenly spaced in time and in its logarithm; fewer if a record would have more
# than the maximum.
EVEN_POINTS, EARLY_POINTS = 60, 90
MAX_POINTS = 600
# Part of a force that rounding of its averages changes.
ROUNDING = 1e-13
# Logarithm of the velocity of a load point at rest.
REST = -30.0


@dataclass(frozen=True)
class Loading:
    """A stage of the load point: from a velocity to a velocity [m/s], both >= 0, in a time [s]."""

    duration: float
    start_velocity: float
    end_velocity: float

    @property
    def max_velocity(self) -> float:
        """Maximum velocity [m/s]."""
        return max(self.start_velocity, self.end_velocity)


@dataclass(frozen=True)
class Points:
    """A record along the drive, averaged to points."""

    stages: tuple[Loading, ...]
    """Stages of the load point, from steady sliding on."""
    time: Array
    """Mean times of the samples of each point since the start [s]."""
    spread: Array
    """Their standard deviations [s]."""
    force: Array
    """Mean force along the drive."""
    first: Samples
    """First sample of each point."""
    count: Array
    """Samples of each point."""
    interval: float
    """Minimum interval of samples [s]."""
    start: float = 0.0
    """Time of the first sample in the output [s]."""

    @property
    def reference_velocity(self) -> float:
        """V_0 [m/s], that of the first stage."""
        return self.stages[0].start_velocity

    @property
    def force_range(self) -> float:
        return max(float(np.ptp(self.force)), 1e-300)

    @property
    def is_constant(self) -> bool:
        """Whether the force does not change beyond rounding."""
        return float(np.ptp(self.force)) <= ROUNDING * float(np.max(np.abs(self.force)))

    @property
    def max_velocity(self) -> float:
        """Maximum velocity of the load point [m/s]."""
        return max(one.max_velocity for one in self.stages)

    @cached_property
    def load_displacement(self) -> Array:
        """Displacement of the load point at the points [m]."""
        return self._load()[0]

    @cached_property
    def load_velocity(self) -> Array:
        """Velocity of the load point at the points [m/s]."""
        return self._load()[1]

    @property
    def log_velocity(self) -> Array:
        """ln(V/V_0) of the load point at the points; `REST` at rest."""
        return np.log(np.maximum(self.load_velocity / self.reference_velocity, np.exp(REST)))

    def _load(self) -> tuple[Array, Array]:
        displacement, velocity = np.zeros((2, self.time.size))
        begin = moved = 0.0
        for stage in self.stages:
            since = self.time - begin
            inside = (since > 0) | (begin == 0)
            rate = (stage.end_velocity - stage.start_velocity) / stage.duration
            path = moved + (stage.start_velocity + 0.5 * rate * since) * since
            velocity[inside] = (stage.start_velocity + rate * since)[inside]
            displacement[inside] = path[inside]
            begin += stage.duration
            moved += 0.5 * (stage.start_velocity + stage.end_velocity) * stage.duration
        return displacement, velocity

    def chosen(self, used: NDArray[np.bool_]) -> Points:
        """The points without those that are not used."""
        names = ("time", "spread", "force", "first", "count")
        return replace(self, **{name: getattr(self, name)[used] for name in names})


def points_of_trace(stages: Sequence[Loading], time: Array, force: Array) -> Points:
    """Points of a measured trace, evenly spaced in the time of a stage, and after a change of the
    drive in its logarithm: rates of sampling may differ.

    Times are those since the start of the first stage, which slides steadily [s]; the force is that
    along the drive.
    """
    share = min(1.0, MAX_POINTS / (len(stages) * (EVEN_POINTS + EARLY_POINTS)))
    even, early = (max(4, round(share * one)) for one in (EVEN_POINTS, EARLY_POINTS))
    edges = [0]
    for begin, end, first, after in _samples(stages, time):
        at = np.linspace(time[first], time[after - 1], even + 1)[:-1]
        if begin > 0:
            least = max(float(np.median(np.diff(time[first:after][:20]))), 1e-12 * end)
            length = max(time[after - 1] - begin, 2 * least)
            at = np.append(at, begin + np.geomspace(least, length, early)[:-1])
        edges += [first, *np.searchsorted(time, at[(at > begin) & (at < end)])]
    return _averaged(stages, time, force, edges)


def points_of_run(stages: Sequence[Loading], time: Array, force: Array) -> Points:
    """Points of a run, evenly spaced in the number of samples of a stage, and after a change of the
    drive in its logarithm. The motion at their mean times stands for that at their samples."""
    edges = [0]
    for begin, _, first, after in _samples(stages, time):
        starts = np.linspace(0, after - first, EVEN_POINTS + 1)[:-1]
        if begin > 0:
            starts = np.append(starts, np.geomspace(1, after - first, EVEN_POINTS) - 1)
        edges += list(first + starts.astype(int))
    return replace(_averaged(stages, time, force, edges), spread=np.zeros(len(set(edges))))


def _averaged(stages: Sequence[Loading], time: Array, force: Array, edges: Sequence[int]) -> Points:
    """Points that start at some of the samples."""
    first = np.unique(np.array(edges, dtype=np.int64))
    size = np.diff(np.append(first, time.size))
    count = size.astype(float)
    mean = np.add.reduceat(time, first) / count
    spread = np.sqrt(np.add.reduceat((time - np.repeat(mean, size)) ** 2, first) / count)
    # Where the rate of sampling changes, the deviation may be larger than the distance to an end,
    # beyond which the drive may change.
    ends = time[first + size - 1] - mean, mean - time[first]
    spread = np.minimum(spread, np.maximum(np.minimum(*ends), 0.0))
    force = np.add.reduceat(force, first) / count
    return Points(tuple(stages), mean, spread, force, first, count, float(np.diff(time).min()))


def _samples(stages: Sequence[Loading], time: Array) -> Iterator[tuple[float, float, int, int]]:
    """Start and end of each stage [s], its first sample and the one after its last, where it has
    any."""
    begin = 0.0
    for number, stage in enumerate(stages):
        end = begin + stage.duration
        first = int(np.searchsorted(time, begin, "right")) if number else 0
        after = time.size if number == len(stages) - 1 else int(np.searchsorted(time, end, "right"))
        if after > first:
            yield begin, end, first, after
        begin = end
