"""Records of the force for fits of rate-and-state laws, and their noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.rate_and_state.motion import Loading
from mesoslip.quantities import with_unit

Array = NDArray[np.float64]

# Maximum number of stages in a record; a measured history of the drive has thousands.
MAX_STAGES = 200
# Points of a stage, evenly spaced in time and in its logarithm.
EVEN_POINTS = 60
EARLY_POINTS = 60
# Minimum noise, over the range of the record.
MIN_NOISE = 1e-5


@dataclass(frozen=True)
class Noise:
    """Noise of a record.

    Attributes
    ----------
    deviation
        Standard deviation of a sample, in the unit of the force.
    length
        Displacement over which the correlation decays by a factor e [m]; 0 for independent samples.
    """

    deviation: float
    length: float


@dataclass(frozen=True)
class Record:
    """A record of the force, averaged to the points of a fit.

    Attributes
    ----------
    stages
        Stages of the load point, from steady sliding on.
    time, force
        Means over the samples of each point: time since the start of the first stage [s], and
        force.
    deviation
        Standard deviation of the force of each point.
    correlation
        Correlation of the points, shape (points, points).
    stiffness
        Stiffness of the spring, unit of force per metre.
    length_scale
        Order of magnitude of D_c [m].
    has_noise
        Whether the record has noise with which residuals can be compared.
    start
        Time in the output at which the first stage starts [s].
    """

    stages: tuple[Loading, ...]
    time: Array
    force: Array
    deviation: Array
    correlation: Array
    stiffness: float
    length_scale: float
    has_noise: bool
    start: float = 0.0

    @property
    def reference_velocity(self) -> float:
        """V0 [m/s], that of the first stage."""
        return self.stages[0].start_velocity

    @property
    def force_scale(self) -> float:
        """Range of the force."""
        return max(float(np.ptp(self.force)), 1e-300)


def make_record(
    stages: Sequence[Loading],
    time: Array,
    force: Array,
    displacement: Array,
    noise: Noise,
    stiffness: float,
    length_scale: float,
) -> Record:
    """Average the samples of a record to points, closely spaced after each change of the drive.

    Parameters
    ----------
    stages
        Stages of the load point; the first slides steadily.
    time, force, displacement
        Samples: time since the start of the first stage [s], force, displacement of the slider [m].
    noise
        Noise of the samples.
    stiffness
        Stiffness of the spring.
    length_scale
        Order of magnitude of D_c [m].

    Notes
    -----
    The noise of a slider on contacts is correlated over its displacement: as an Ornstein-Uhlenbeck
    process of the displacement, averaged over the samples of each point.
    """
    edges = _edges(stages, time)
    first, after = edges[:-1], edges[1:]
    counts = (after - first).astype(float)
    means = [np.add.reduceat(one, first) / counts for one in (time, force)]
    is_used = np.isfinite(means[1])
    if math.isinf(stiffness):
        # Laws with ln V give a prescribed slider at rest no force.
        is_used &= ~_holds(stages, means[0])
    first, after, counts = first[is_used], after[is_used], counts[is_used]
    scale = max(float(np.ptp(means[1][is_used])), 1e-300)
    if noise.length == 0:
        deviation = noise.deviation / np.sqrt(counts)
        correlation = np.eye(counts.size)
    else:
        # Noise is not reproduced where the slider moves back.
        displacement = np.maximum.accumulate(displacement)
        covariance = _averaged(displacement[first], displacement[after - 1], noise.length)
        deviation = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(deviation, deviation)
        deviation = deviation * noise.deviation
    has_noise = noise.deviation > MIN_NOISE * scale
    if not has_noise:
        deviation, correlation = np.full(counts.size, MIN_NOISE * scale), np.eye(counts.size)
    return Record(
        tuple(stages),
        means[0][is_used],
        means[1][is_used],
        np.maximum(deviation, MIN_NOISE * scale),
        correlation,
        stiffness,
        length_scale,
        has_noise,
    )


def _edges(stages: Sequence[Loading], time: Array) -> NDArray[np.int64]:
    """Samples at which points start, and the end of the last one."""
    edges = [0]
    begin = 0.0
    for number, stage in enumerate(stages):
        end = begin + stage.duration
        first = int(np.searchsorted(time, begin, "right")) if number else 0
        after = int(np.searchsorted(time, end, "right"))
        if number == len(stages) - 1:
            after = time.size
        count = after - first
        if count > 0:
            starts = np.linspace(0, count, EVEN_POINTS + 1)
            if number:
                starts = np.append(starts, np.geomspace(1, count, EARLY_POINTS) - 1)
            edges += list(first + np.unique(starts.astype(int)))
        begin = end
    return np.unique(np.array([*edges, time.size], dtype=np.int64))


def _holds(stages: Sequence[Loading], time: Array) -> NDArray[np.bool_]:
    """Whether each time lies in a hold."""
    ends = np.cumsum([one.duration for one in stages])
    number = np.minimum(np.searchsorted(ends, time, "left"), len(stages) - 1)
    is_hold = np.array([max(one.start_velocity, one.end_velocity) == 0 for one in stages])
    held: NDArray[np.bool_] = is_hold[number]
    return held


def _averaged(start: Array, end: Array, length: float) -> Array:
    """Covariance of means of an Ornstein-Uhlenbeck process of variance 1 over intervals."""
    size = np.maximum(np.abs(end - start) / length, 1e-9)
    damped = -np.expm1(-size) / size
    low, high = np.minimum(start, end) / length, np.maximum(start, end) / length
    gap = np.maximum(low[:, None], low[None, :]) - np.minimum(high[:, None], high[None, :])
    covariance: Array = np.outer(damped, damped) * np.exp(-np.maximum(gap, 0.0))
    small = size < 1e-3
    whole = np.where(small, 1 - size / 3, 2 * (size + np.expm1(-size)) / size**2)
    np.fill_diagonal(covariance, whole)
    return covariance


def record_of(experiment: Experiment) -> Record | str:
    """The record of an output from its first steady sliding on, or why no law can be fitted."""
    if experiment.config is None:
        return "no configuration: a scale of D_c and the noise of the contacts are unknown"
    stages = experiment.stages
    sliding = [index for index, one in enumerate(stages[:-1]) if one.is_steady]
    if not sliding:
        return "no step and no hold after sliding at constant velocity: no data for a, b and D_c"
    # Laws without inertia describe no stick-slip.
    for one in stages[sliding[0] :]:
        if experiment.is_stick_slip(one):
            return (
                f"stick-slip at {with_unit(abs(one.velocity), 'm/s', 3)}: a law without inertia "
                "describes no slips"
            )
    means = {index: experiment.mean_of(stages[index]) for index in sliding}
    steady = [index for index, one in means.items() if one is not None and one.is_steady]
    if not steady:
        return "no steady sliding before a change of the drive, or too few samples"
    reference, mean = stages[steady[0]], means[steady[0]]
    assert mean is not None
    used = stages[steady[0] :]
    if not all(one.is_uniform for one in used):
        return "the velocity of the drive is not piecewise linear"
    if len(used) > MAX_STAGES:
        return f"the drive has more than {MAX_STAGES} stages"
    if any(sign != reference.direction for one in used for sign in _signs(one)):
        return "the drive reverses: ln V is not defined"
    if math.isinf(experiment.stiffness) and not any(
        one.is_steady and one.velocity != reference.velocity for one in used
    ):
        return "a prescribed slider without a velocity step: a is not determined"
    begin = experiment.samples(reference).start + mean.start
    end = experiment.samples(used[-1]).stop
    start = float(experiment.time[begin])
    sign = reference.direction
    loadings = [Loading(reference.end - start, *(2 * [abs(reference.velocity)]))]
    loadings += [
        Loading(one.duration, abs(one.start_velocity), abs(one.end_velocity)) for one in used[1:]
    ]
    record = make_record(
        loadings,
        experiment.time[begin:end] - start,
        sign * experiment.force[:, begin:end].mean(axis=0),
        sign * experiment.displacement[:, begin:end].mean(axis=0),
        noise_of(experiment, used),
        experiment.stiffness,
        experiment.config.contacts.break_stretch,
    )
    return replace(record, start=start)


def _signs(stage: Stage) -> Iterator[float]:
    """Signs of the velocities of a stage that are not 0."""
    for velocity in (stage.start_velocity, stage.end_velocity):
        if velocity != 0:
            yield math.copysign(1.0, velocity)


def noise_of(experiment: Experiment, stages: Sequence[Stage]) -> Noise:
    """Noise of the mean record of all realizations, from the steady parts of its stages.

    The master equation has no noise.
    """
    if experiment.config is not None and not experiment.config.contact_kind.is_discrete:
        return Noise(0.0, 0.0)
    interval = float(np.median(np.diff(experiment.time)))
    squares, lengths = [], []
    for stage in stages:
        mean = experiment.mean_of(stage)
        if mean is None:
            continue
        squares.append(mean.standard_deviation**2)
        # A first-order autoregression with as many samples per independent sample.
        if mean.correlation > 2:
            coefficient = (mean.correlation - 1) / (mean.correlation + 1)
            lengths.append(abs(stage.velocity) * interval / -math.log(coefficient))
        else:
            lengths.append(0.0)
    deviation = math.sqrt(float(np.mean(squares)) / experiment.force.shape[0])
    return Noise(deviation, float(np.median(lengths)))
