"""Velocity steps: direct change, evolution, and relaxation displacement."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Peak, Stage
from mesoslip.analysis.response.columns import STEPS, empty_row
from mesoslip.analysis.response.line import decay
from mesoslip.analysis.steady_force import SteadyMean, error_of_mean
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
