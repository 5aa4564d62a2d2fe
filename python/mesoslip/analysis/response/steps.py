"""Steps of the velocity and of the normal load: direct change, evolution, relaxation."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Peak, Stage
from mesoslip.analysis.response.columns import LOAD_STEPS, STEPS, empty_row
from mesoslip.analysis.response.line import decay
from mesoslip.analysis.steady_force import SteadyMean, error_of_mean, steady_mean
from mesoslip.quantities import with_unit

# Minimum height of a peak above the steady force, in standard deviations of the force.
MIN_PEAK_HEIGHT = 4.0
# Minimum overshoot over the evolution change.
MIN_OVERSHOOT = 1e-3
# Length of the integral over the evolution, in relaxation displacements.
INTEGRAL_LENGTHS = 8.0
# Minimum evolution change that is fitted, in standard errors.
MIN_AMPLITUDE = 3.0


def step_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each step from one velocity to another."""
    rows = []
    for before, after in zip(experiment.stages, experiment.stages[1:], strict=False):
        if not (before.is_steady and after.is_steady) or before.velocity == after.velocity:
            continue
        row = empty_row(STEPS, number, after) | {
            "step_time": after.start,
            "velocity_before": before.velocity,
            "velocity_after": after.velocity,
        }
        row["note"] = _fill_step(experiment, before, after, row)
        rows.append(row)
    return rows


def _fill_step(experiment: Experiment, before: Stage, after: Stage, row: dict[str, Any]) -> str:
    """Fill the row of a step; the note on it."""
    if before.direction != after.direction:
        return "the drive reverses"
    first, second = experiment.mean_of(before), experiment.mean_of(after)
    if first is None or second is None:
        return "too few samples before or after the step"
    log_ratio = math.log(after.velocity / before.velocity)
    net_error = math.hypot(first.error, second.error)
    row |= {
        "force_before": first.mean,
        "force_after": second.mean,
        "net_change": second.mean - first.mean,
        "net_change_error": net_error,
        "rate_dependence": (second.mean - first.mean) / log_ratio,
        "rate_dependence_error": net_error / abs(log_ratio),
    }
    for stage in (before, after):
        if experiment.is_stick_slip(stage):
            return f"stick-slip at {with_unit(abs(stage.velocity), 'm/s', 3)}"
    notes = [] if first.is_steady and second.is_steady else ["not steady before or after the step"]
    start = _evolution_start(experiment, after, first, second, log_ratio > 0)
    if start is None:
        notes.append("no peak above the noise")
        return "; ".join(notes)
    peak, peak_error = float(start.force.mean()), error_of_mean(start.force, second)
    direct, evolution = peak - first.mean, second.mean - peak
    row |= {
        "peak_force": peak,
        "peak_is_exact": int(start.is_exact),
        "direct_change": direct,
        "direct_change_error": math.hypot(peak_error, first.error),
        "evolution_change": evolution,
        "evolution_change_error": math.hypot(peak_error, second.error),
        "apparent_a": direct / log_ratio,
        "apparent_b": -evolution / log_ratio,
    }
    notes += _fill_relaxation(experiment, after, second, start, row)
    return "; ".join(notes)


def _evolution_start(
    experiment: Experiment,
    after: Stage,
    first: SteadyMean,
    second: SteadyMean,
    upward: bool,
) -> Peak | None:
    """The force at the start of the evolution after a step; None if it is within the noise.

    It is the peak beyond both steady forces. A prescribed slider has the direct change at once, so
    that its force there may lie between them.
    """
    peak = experiment.peak(after, upward)
    if peak is None:
        return None
    side = 1.0 if upward else -1.0
    noise = max(first.standard_deviation, second.standard_deviation)
    height = side * peak.force.mean() - max(side * first.mean, side * second.mean)
    if height > MIN_PEAK_HEIGHT * noise:
        return peak
    if not math.isinf(experiment.stiffness):
        return None
    sample = experiment.samples(after).start
    force = after.direction * experiment.force[:, sample]
    if abs(force.mean() - second.mean) <= MIN_PEAK_HEIGHT * noise / math.sqrt(force.size):
        return None
    rows = force.shape[0]
    return Peak(
        force, np.full(rows, experiment.time[sample]), experiment.displacement[:, sample], False
    )


def _fill_relaxation(
    experiment: Experiment, after: Stage, steady: SteadyMean, start: Peak, row: dict[str, Any]
) -> list[str]:
    """Fill the displacements over which the force evolves; notes on them."""
    inside = experiment.samples(after)
    begin = int(np.searchsorted(experiment.time[inside], start.time.mean(), "left"))
    force = after.direction * experiment.force[:, inside].mean(axis=0)[begin:]
    displacement = experiment.displacement[:, inside].mean(axis=0)[begin:]
    displacement = after.direction * (displacement - start.displacement.mean())
    realizations = experiment.force.shape[0]
    noise = steady.standard_deviation / math.sqrt(realizations)
    amplitude = float(start.force.mean()) - steady.mean
    if force.size < 5 or abs(amplitude) < MIN_AMPLITUDE * noise:
        return ["no evolution above the noise"]
    beyond = -math.copysign(1.0, amplitude) * (force - steady.mean)
    if beyond.max() > max(MIN_PEAK_HEIGHT * noise, MIN_OVERSHOOT * abs(amplitude)):
        row["overshoot"] = -math.copysign(1.0, amplitude) * float(beyond.max())
    fit = decay(displacement, force, steady.correlation, noise)
    if fit is None:
        return ["no exponential decay fits the evolution"]
    length, error = fit
    row |= {"relaxation_displacement": length, "relaxation_displacement_error": error}
    last = int(np.searchsorted(displacement, INTEGRAL_LENGTHS * length))
    if last > 2 and displacement[last - 1] > 0.5 * INTEGRAL_LENGTHS * length:
        distance = float(displacement[last - 1] - displacement[0])
        step = distance / (last - 1)
        area = float(np.trapezoid(force[:last] - steady.mean, displacement[:last]))
        # White noise with that many samples per independent one, and the error of the steady force.
        spread = noise * math.sqrt(steady.correlation * step * distance)
        row["integral_displacement"] = area / amplitude
        row["integral_displacement_error"] = math.hypot(
            math.hypot(spread, distance * steady.error) / abs(amplitude),
            area / amplitude**2 * error_of_mean(start.force, steady),
        )
    if math.isfinite(row["overshoot"]):
        return ["overshoots the steady force: not a single exponential"]
    return []


# Minimum change of the load from sample to sample in a step: over the load, and over the median of
# such changes, which are those of the noise.
MIN_CHANGE, MIN_OVER_NOISE = 0.02, 8.0
# Samples without such a change that end a step.
QUIET_SAMPLES = 3
# Maximum deviation of the load from its medians before and after a step, over the step.
MAX_DEVIATION = 0.1
# Minimum samples before and after a step.
MIN_SAMPLES = 16
# Minimum transient change that is evaluated, in standard errors.
MIN_TRANSIENT = 3.0
# The same over the whole change of the force: less may be due to the steps of a master equation.
MIN_TRANSIENT_PART = 1e-3


class LoadStep(NamedTuple):
    """Samples of a step of the load: from the start of the constant load before it to the end of
    that after it, the last one before the step and the first one after it; and both loads [N]."""

    start: int
    before: int
    after: int
    end: int
    load_before: float
    load_after: float


def load_step_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each step of the normal load in a stage of constant velocity.

    A step of the load from L to L' changes the force at once by a direct part, and over a sliding
    distance by a transient one. With the coefficient mu of steady sliding after the step, the force
    just after it is L' (mu - alpha ln(L'/L)) (M. Linker and J. Dieterich, Journal of Geophysical
    Research 97 (1992) 4923).
    """
    return [
        _row(experiment, number, stage, step)
        for stage in experiment.stages
        if stage.is_steady
        for step in load_steps(experiment, stage)
    ]


def load_steps(experiment: Experiment, stage: Stage) -> list[LoadStep]:
    """Steps of the normal load in a stage between times of constant load."""
    if experiment.normal_force is None:
        return []
    samples = experiment.samples(stage)
    inside = experiment.normal_force[:, samples].mean(axis=0)
    if inside.size < 2 * MIN_SAMPLES or not np.isfinite(inside).all():
        return []
    change = np.abs(np.diff(inside))
    limit = max(MIN_CHANGE * float(np.median(inside)), MIN_OVER_NOISE * float(np.median(change)))
    jumps = np.flatnonzero(change > limit)
    if not jumps.size:
        return []
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > QUIET_SAMPLES) + 1)
    firsts = [int(group[0]) for group in groups]
    lasts = [int(group[-1]) + 1 for group in groups]
    found = []
    for start, before, after, end in zip(
        [0, *lasts[:-1]], firsts, lasts, [*firsts[1:], inside.size - 1], strict=True
    ):
        levels = [inside[start : before + 1], inside[after : end + 1]]
        size = abs(np.median(levels[1]) - np.median(levels[0]))
        is_constant = all(np.ptp(one) < 2 * MAX_DEVIATION * size for one in levels)
        if min(one.size for one in levels) >= MIN_SAMPLES and is_constant:
            places = (samples.start + one for one in (start, before, after, end))
            found.append(LoadStep(*places, *map(float, map(np.median, levels))))
    return found


def _row(experiment: Experiment, number: int, stage: Stage, step: LoadStep) -> dict[str, Any]:
    forces = stage.direction * experiment.force
    loads = step.load_before, step.load_after
    row = empty_row(LOAD_STEPS, number, stage) | {
        "load_step_time": float(experiment.time[step.before]),
        "normal_force_before": loads[0],
        "normal_force_after": loads[1],
    }
    before = steady_mean(forces[:, step.start : step.before + 1])
    after = steady_mean(forces[:, step.after : step.end + 1])
    if before is None or after is None:
        return row | {"note": "too few samples before or after the step"}
    at_once = forces[:, step.after]
    start, start_error = float(at_once.mean()), error_of_mean(at_once, after)
    transient_error = math.hypot(start_error, after.error)
    row |= {
        "force_before": before.mean,
        "force_after": after.mean,
        "direct_change": start - before.mean,
        "direct_change_error": math.hypot(start_error, before.error),
        "transient_change": after.mean - start,
        "transient_change_error": transient_error,
    }
    notes = [] if before.is_steady and after.is_steady else ["not steady before or after the step"]
    if min(loads) > 0:
        scale = loads[1] * math.log(loads[1] / loads[0])
        row |= {
            "alpha": (after.mean - start) / scale,
            "alpha_error": transient_error / abs(scale),
        }
    if experiment.is_stick_slip(stage):
        notes.append("stick-slip: the force is not that of sliding")
    elif abs(after.mean - start) < max(
        MIN_TRANSIENT * transient_error, MIN_TRANSIENT_PART * abs(after.mean - before.mean)
    ):
        notes.append("no transient above the noise")
    else:
        notes += _fill_distances(experiment, stage, step, start, after.mean, row)
    return row | {"note": "; ".join(notes)}


def _fill_distances(
    experiment: Experiment,
    stage: Stage,
    step: LoadStep,
    start: float,
    steady: float,
    row: dict[str, Any],
) -> list[str]:
    """Fill the sliding distances of the transient; notes on them."""
    samples = slice(step.after, step.end + 1)
    force = stage.direction * experiment.force[:, samples].mean(axis=0)
    displacement = stage.direction * experiment.displacement[:, samples].mean(axis=0)
    displacement = displacement - displacement[0]
    side = math.copysign(1.0, steady - start)
    reached = np.flatnonzero(side * (force - steady) >= 0)
    if not reached.size or reached[0] == 0:
        return ["the steady force is not reached"]
    last = int(reached[0])
    part = (steady - force[last - 1]) / (force[last] - force[last - 1])
    row["rise_displacement"] = float(
        displacement[last - 1] + part * (displacement[last] - displacement[last - 1])
    )
    mean = steady_mean(force[None, :])
    noise = 0.0 if mean is None else mean.standard_deviation
    fit = decay(displacement, force, 1.0 if mean is None else mean.correlation, noise)
    if fit is None:
        return ["no exponential decay fits the transient"]
    row["relaxation_displacement"], row["relaxation_displacement_error"] = fit
    return []
