"""Measured records of rate-and-state friction, averaged to points, and motions at these points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip import _core
from mesoslip.analysis.rate_and_state.motion import Loading

Array = NDArray[np.float64]

# Points of a stage, evenly spaced in time and in its logarithm; fewer where a record has more than
# so many points.
EVEN_POINTS, EARLY_POINTS = 60, 90
MAX_POINTS = 600
# Logarithm that stands for the velocity of a load point at rest.
REST = -30.0


@dataclass(frozen=True)
class Points:
    """A measured record along the drive, averaged to points.

    Attributes
    ----------
    stages
        Stages of the load point, from steady sliding on.
    time, spread
        Mean and standard deviation of the times of the samples of a point since the start [s].
    force
        Mean force.
    count
        Samples of each point.
    start
        Time of the first sample in the output [s].
    first_stage
        Number of the first stage in the output.
    interval
        Minimum interval of samples [s].
    """

    stages: tuple[Loading, ...]
    time: Array
    spread: Array
    force: Array
    count: Array
    start: float
    first_stage: int
    interval: float

    @property
    def reference_velocity(self) -> float:
        """V_0 [m/s], that of the first stage."""
        return self.stages[0].start_velocity

    @property
    def force_range(self) -> float:
        """Range of the force."""
        return max(float(np.ptp(self.force)), 1e-300)

    @property
    def duration(self) -> float:
        """Duration of the record [s]."""
        return float(self.time[-1] + self.spread[-1])

    @property
    def max_velocity(self) -> float:
        """Maximum velocity of the load point [m/s]."""
        return max(max(one.start_velocity, one.end_velocity) for one in self.stages)

    @cached_property
    def load_displacement(self) -> Array:
        """Displacement of the load point at the points [m]."""
        return self._driven(0)

    @cached_property
    def log_velocity(self) -> Array:
        """ln(V/V_0) of the load point at the points; `REST` at rest."""
        velocity = self._driven(1) / self.reference_velocity
        return np.log(np.maximum(velocity, np.exp(REST)))

    def _driven(self, derivative: int) -> Array:
        """Displacement of the load point, or its velocity."""
        found = np.zeros_like(self.time)
        begin = moved = 0.0
        for stage in self.stages:
            since = self.time - begin
            inside = (since > 0) | (begin == 0)
            rate = (stage.end_velocity - stage.start_velocity) / stage.duration
            velocity = stage.start_velocity + rate * since
            displacement = moved + (stage.start_velocity + 0.5 * rate * since) * since
            found[inside] = (velocity if derivative else displacement)[inside]
            begin += stage.duration
            moved += 0.5 * (stage.start_velocity + stage.end_velocity) * stage.duration
        return found

    def stage_edges(self) -> Array:
        """Times at which stages start, but for the first [s]."""
        edges: Array = np.cumsum([one.duration for one in self.stages[:-1]])
        return edges


def averaged(
    stages: Sequence[Loading],
    time: Array,
    force: Array,
    *,
    start: float,
    first_stage: int,
) -> Points:
    """Average samples to points, closely spaced after each change of the drive.

    Parameters
    ----------
    stages
        Stages of the load point; the first slides steadily.
    time, force
        Samples: time since the start of the first stage [s], and force along the drive.
    start, first_stage
        Time and number of the stage in the output at which the record starts.
    """
    share = min(1.0, MAX_POINTS / (len(stages) * (EVEN_POINTS + EARLY_POINTS)))
    even, early = (max(4, round(share * one)) for one in (EVEN_POINTS, EARLY_POINTS))
    edges = [0, time.size]
    begin = 0.0
    for number, stage in enumerate(stages):
        end = begin + stage.duration
        first = int(np.searchsorted(time, begin, "right")) if number else 0
        after = time.size if number == len(stages) - 1 else int(np.searchsorted(time, end, "right"))
        if after > first:
            # In time, as rates of sampling differ.
            at = np.linspace(time[first], time[after - 1], even + 1)[:-1]
            if number:
                least = max(float(np.median(np.diff(time[first:after][:20]))), 1e-12 * end)
                length = max(time[after - 1] - begin, 2 * least)
                at = np.append(at, begin + np.geomspace(least, length, early)[:-1])
            edges += [first, *np.searchsorted(time, at[(at > begin) & (at < end)])]
        begin = end
    bounds = np.unique(np.array(edges, dtype=np.int64))
    count = np.diff(bounds).astype(float)
    mean = np.add.reduceat(time, bounds[:-1]) / count
    centred = time - np.repeat(mean, np.diff(bounds))
    spread = np.sqrt(np.add.reduceat(centred**2, bounds[:-1]) / count)
    # Where the rate of sampling changes, the deviation may be larger than the distance to an end,
    # beyond which the drive may change.
    ends = time[bounds[1:] - 1] - mean, mean - time[bounds[:-1]]
    spread = np.minimum(spread, np.maximum(np.minimum(*ends), 0.0))
    return Points(
        tuple(stages),
        mean,
        spread,
        np.add.reduceat(force, bounds[:-1]) / count,
        count,
        start,
        first_stage,
        float(np.diff(time).min()),
    )


def motions(
    points: Points, law: str, states: int, parameters: Array, tolerance: float, *, coarse: bool
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Forces without the reference force, and displacements, of sets of parameters.

    Parameters
    ----------
    points
        The record.
    law
        "ageing" or "slip".
    states
        Number of state variables, 1 or 2.
    parameters
        Shape (sets, 7): a, b, D, b and D of the second state, stiffness, trend.
    tolerance
        Tolerance of the logarithms of velocity and state.
    coarse
        Whether a point is the motion at its mean time, not the mean over its samples.

    Returns
    -------
    force, displacement, failed
        Shapes (sets, points), (sets, points) and (sets,).
    """
    if coarse:
        times = points.time
    else:
        # Two points in time have the mean of a cubic over the samples.
        times = np.stack([points.time - points.spread, points.time + points.spread], axis=1).ravel()
        times = np.maximum.accumulate(np.maximum(times, 0.0))
    force, displacement, failed, status, message = _core.rate_and_state_motions(
        law,
        states,
        np.asfortranarray(parameters.T),
        points.reference_velocity,
        np.array([one.duration for one in points.stages]),
        np.array([one.start_velocity for one in points.stages]),
        np.array([one.end_velocity for one in points.stages]),
        times,
        tolerance,
    )
    assert status == 0, message
    if not coarse:
        force, displacement = (0.5 * (one[::2] + one[1::2]) for one in (force, displacement))
    return force.T, displacement.T, failed != 0
