"""Records for fits of rate-and-state laws: the parts of an output that a law can describe."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.rate_and_state.law import LAWS
from mesoslip.analysis.rate_and_state.noise import Noise, known_noise
from mesoslip.analysis.rate_and_state.points import Loading, Points, points_of_run, points_of_trace
from mesoslip.array_types import Array
from mesoslip.quantities import with_unit

# Blocks of the first stage that are compared with the line through its last half, and the maximum
# deviation of a block over the scatter about the line.
BLOCKS = 40
MAX_DEVIATION = 5.0
# Minimum number of samples of a stage.
MIN_SAMPLES = 10
# Maximum number of stages of a run that is fitted; a measured history of the drive has thousands.
MAX_STAGES = 200
# Slip distances of a run in the search, over the mean breaking stretch.
MIN_STRETCHES, MAX_STRETCHES = 0.03, 3.0

CONSTANT = "the force is constant, so that nothing evolves"
NO_CHANGE = "no step and no hold after sliding at constant velocity: no data for a, b and D_c"
STROKES = "goes back and forth: mesoslip strokes has friction, loops and stiffness"
REVERSES = "the drive reverses: ln V is not defined"


@dataclass(frozen=True)
class Record:
    """A record of the force, and what is known for a fit of laws to it."""

    points: Points
    stiffness: float
    """Stiffness of the spring, unit of the force over metre; infinite for a slider that moves with
    the load point, NaN if it is fitted."""
    distances: tuple[float, float]
    """Range of the slip distance in the search [m]."""
    noise: Noise | None = None
    """The noise if it is known, as of runs; else it is estimated from residuals."""
    with_trend: bool = False
    """Whether friction has a linear trend with displacement."""
    laws: tuple[str, ...] = ("ageing", "slip")
    """Laws that are fitted."""
    first_stage: int = 0
    """Number of the first stage in the output."""
    limitation: str = ""
    """What of the output it leaves out, in words."""


def records_of(experiment: Experiment, *, free_stiffness: bool = False) -> list[Record] | str:
    """The record of a run, or of a measured trace those of all stages together, of each step and of
    each hold; or why there is none."""
    found = _of_trace(experiment) if experiment.is_measured else _of_run(experiment, free_stiffness)
    if isinstance(found, str):
        return found
    found = [one for one in found if not one.points.is_constant]
    if not found:
        return CONSTANT
    if not free_stiffness:
        return found
    return [replace(one, stiffness=math.nan) for one in found]


def _of_trace(experiment: Experiment) -> list[Record] | str:
    stages = experiment.stages
    if experiment.has_strokes:
        return STROKES
    changes = [
        index
        for index, one in enumerate(stages[:-1])
        if one.is_steady and _is_long(experiment, one) and _is_long(experiment, stages[index + 1])
    ]
    if not changes:
        return NO_CHANGE
    first = stages[changes[0]]
    whole = list(takewhile(lambda one: _has_direction(one, first), stages[changes[0] :]))
    if len(whole) < 2:
        return REVERSES
    short = next((one for one in whole if one.is_steady and not _is_long(experiment, one)), None)
    limitation = ""
    if short is not None:
        whole = list(takewhile(lambda one: one is not short, whole))
        limitation = f"without stage {short.number} and later ones: it is too short for a step"
    if math.isinf(experiment.stiffness):
        return (
            "a prescribed slider has no spring; give the stiffness of the apparatus, or none to "
            "fit it"
        )
    single = [_single(stages[index:]) for index in changes]
    ends = (whole[0].number, whole[-1].number)
    parts = [
        one
        for one in single
        if one and (one[0].number, one[-1].number) != ends and _is_long(experiment, one[-1])
    ]
    return [
        replace(_traced(experiment, whole), limitation=limitation),
        *(_traced(experiment, one) for one in parts),
    ]


def _is_long(experiment: Experiment, stage: Stage) -> bool:
    inside = experiment.samples(stage)
    return int(inside.stop - inside.start) >= MIN_SAMPLES


def _has_direction(stage: Stage, first: Stage) -> bool:
    """Whether the drive of a stage does not go against that of the first."""
    return min(first.direction * one for one in (stage.start_velocity, stage.end_velocity)) >= 0


def _single(stages: Sequence[Stage]) -> list[Stage]:
    """A step, perhaps with a ramp, or a hold with the sliding after it; empty if there is none."""
    found = [stages[0]]
    for one in stages[1:]:
        if not _has_direction(one, stages[0]):
            break
        found.append(one)
        if one.is_steady:
            return found
    return []


def _traced(experiment: Experiment, stages: Sequence[Stage]) -> Record:
    """The record of some stages of a trace, the first of which slides steadily."""
    begin = experiment.samples(stages[0]).start
    first = slice(begin, int(np.searchsorted(experiment.time, stages[0].end, "right")))
    force = stages[0].direction * experiment.force[:, first].mean(axis=0)
    begin += _steady_start(experiment.time[first], force)
    points, _ = _points(experiment, stages, begin, points_of_trace)
    longest = max(one.max_velocity * one.duration for one in points.stages[1:])
    described = tomllib.loads(experiment.tree.attrs.get("trace", ""))
    return Record(
        points,
        experiment.stiffness,
        # From the resolution of the record to its length.
        (points.max_velocity * points.interval, 2 * max(longest, 1e-300)),
        with_trend=described.get("trend", "linear") != "none",
        laws=tuple(LAWS),
        first_stage=stages[0].number,
    )


def _steady_start(time: Array, force: Array) -> int:
    """The first sample of a stage from which the force is a straight line."""
    if time.size < 2 * BLOCKS:
        return 0
    edges = np.linspace(0, time.size, BLOCKS + 1).astype(int)
    size = np.diff(edges)
    mean = np.add.reduceat(force, edges[:-1]) / size
    at = np.add.reduceat(time, edges[:-1]) / size
    half = BLOCKS // 2
    slope, level = np.polyfit(at[half:] - at[-1], mean[half:], 1)
    deviation = np.abs(mean - level - slope * (at - at[-1]))
    scatter = float(np.sqrt(np.sum(deviation[half:] ** 2) / (half - 2)))
    outside = np.flatnonzero(deviation[:half] > MAX_DEVIATION * max(scatter, 1e-300))
    return int(edges[outside[-1] + 1]) if outside.size else 0


def _of_run(experiment: Experiment, free_stiffness: bool) -> list[Record] | str:
    config, stages = experiment.config, experiment.stages
    if config is None:
        return "no configuration: a scale of D_c and the noise of the contacts are unknown"
    sliding = [index for index, one in enumerate(stages[:-1]) if one.is_steady]
    if not sliding:
        return NO_CHANGE
    # Laws without inertia describe no stick-slip.
    for one in stages[sliding[0] :]:
        if experiment.is_stick_slip(one):
            return (
                f"stick-slip at {with_unit(abs(one.velocity), 'm/s', 3)}: a law without inertia "
                "describes no slips"
            )
    means = {index: experiment.mean_of(stages[index]) for index in sliding}
    begins = [(index, one.start) for index, one in means.items() if one and one.is_steady]
    if not begins:
        return "no steady sliding before a change of the drive, or too few samples"
    used = stages[begins[0][0] :]
    if not all(one.is_uniform for one in used):
        return "the velocity of the drive is not piecewise linear"
    if len(used) > MAX_STAGES:
        return f"the drive has more than {MAX_STAGES} stages"
    if not all(_has_direction(one, used[0]) for one in used):
        return REVERSES
    is_rigid = math.isinf(experiment.stiffness) and not free_stiffness
    if is_rigid and not any(one.is_steady and one.velocity != used[0].velocity for one in used):
        return "a prescribed slider without a velocity step: a is not determined"
    begin = experiment.samples(used[0]).start + begins[0][1]
    points, displacement = _points(experiment, used, begin, points_of_run)
    if is_rigid:
        # Laws with ln V give a prescribed slider at rest no force.
        points = points.chosen(points.load_velocity > 0)
    stretch = config.contacts.break_stretch
    return [
        Record(
            points,
            experiment.stiffness,
            (MIN_STRETCHES * stretch, MAX_STRETCHES * stretch),
            known_noise(points, displacement, *_noise_of_run(experiment, used)),
            first_stage=used[0].number,
        )
    ]


def _points(
    experiment: Experiment,
    stages: Sequence[Stage],
    begin: int,
    averaged: Callable[[Sequence[Loading], Array, Array], Points],
) -> tuple[Points, Array]:
    """The points of some stages from a sample of the first one on, and the displacement of the
    slider at the samples [m]."""
    sign = stages[0].direction
    inside = slice(begin, experiment.samples(stages[-1]).stop)
    force, displacement = (
        sign * one[:, inside].mean(axis=0) for one in (experiment.force, experiment.displacement)
    )
    start = float(experiment.time[begin])
    loadings = [
        Loading(one.end - max(one.start, start), abs(one.start_velocity), abs(one.end_velocity))
        for one in stages
    ]
    points = averaged(loadings, experiment.time[inside] - start, force)
    return replace(points, start=start), displacement


def _noise_of_run(experiment: Experiment, stages: Sequence[Stage]) -> tuple[float, float]:
    """Standard deviation of the mean over realizations, and the displacement over which its
    correlation decays by a factor e [m], 0 for white noise: from the steady parts of stages."""
    if experiment.config is not None and not experiment.config.contact_kind.is_discrete:
        # The master equation has no noise.
        return 0.0, 0.0
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
    return deviation, float(np.median(lengths))
