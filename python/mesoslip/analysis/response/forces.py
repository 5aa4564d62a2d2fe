"""Drives by force: creep and restarts under constant forces, static friction in ramps."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.response.columns import CREEP, RAMPS, RESTARTS, empty_row
from mesoslip.analysis.response.line import Line, line
from mesoslip.analysis.steady_force import scatter, steady_mean
from mesoslip.quantities import with_unit

if TYPE_CHECKING:
    from mesoslip.output.arrays import Arrays

# Minimum share of the static force by which contacts bear less than the force on a sliding slider.
MIN_DEFICIT = 0.02
# Relative difference of forces that are equal up to the rounding of means.
SAME_FORCE = 1e-9


def creep_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """The velocity of the slider in each stage of constant force."""
    rows = []
    for stage in experiment.stages:
        if not stage.is_constant_force:
            continue
        row = empty_row(CREEP, number, stage)
        inside = experiment.samples(stage)
        time, displacement = experiment.time[inside], experiment.displacement[:, inside]
        row |= {
            "stage_start_time": stage.start,
            "duration": stage.duration,
            "force": float(experiment.force_at(stage, "start").mean()),
        }
        mean = steady_mean(np.diff(displacement, axis=1) / np.diff(time)) if time.size > 1 else None
        if mean is None:
            row["note"] = "too few samples in the stage"
        else:
            row |= {
                # With the stretch at the jump of the force: the samples begin after it.
                "displacement": float(
                    (displacement[:, -1] - experiment.displacement_at_start(stage)).mean()
                ),
                "velocity": mean.mean,
                "velocity_error": mean.error,
                "transient_time": float(time[mean.start]) - stage.start if mean.start else 0.0,
                "is_steady": int(mean.is_steady),
            }
            notes = [] if mean.is_steady else ["not steady: the velocity still changes"]
            if not mean.is_resolved:
                notes.append("too short: the error is underestimated")
            if abs(mean.mean) < 2 * mean.error:
                notes.append("no creep above the noise")
            row["note"] = "; ".join(notes)
        rows.append(row)
    return rows


def creep_line(data: Arrays) -> Line | None:
    """The line of the force over ln V, of steady creep above the noise, without errors; None for
    fewer than two forces: velocities under one force differ by their noise."""
    velocity = np.abs(data["velocity"].values)
    with np.errstate(invalid="ignore"):
        good = (data["is_steady"].values == 1) & (velocity > 2 * data["velocity_error"].values)
    force = np.abs(data["force"].values[good])
    if force.size == 0 or np.ptp(force) <= SAME_FORCE * np.max(force):
        return None
    return line(np.log(velocity[good]), force, np.full(force.shape, math.nan))


def ramp_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Static friction in each stage in which the force grows: the maximum force of the contacts,
    which the slider leaves behind when it slides."""
    rows = []
    stages = experiment.stages
    for index, stage in enumerate(stages):
        rate = stage.start_velocity
        inside = experiment.samples(stage)
        if not stage.is_force or stage.is_constant_force or inside.stop - inside.start < 2:
            continue
        sign = math.copysign(1.0, rate)
        load = sign * experiment.force[:, inside]
        if np.any(load[:, -1] <= 0):
            # The force goes back to 0.
            continue
        row = empty_row(RAMPS, number, stage) | {
            "stage_start_time": stage.start,
            "force_rate": abs(rate),
        }
        before = stages[index - 1] if index else None
        if before is not None and before.is_constant_force:
            row["hold_time"] = before.duration
            row["hold_force"] = float(experiment.force_at(before, "start").mean())
        row["note"] = _fill_ramp(experiment, stage, load, sign, row)
        rows.append(row)
    return rows


def _fill_ramp(
    experiment: Experiment, stage: Stage, load: np.ndarray, sign: float, row: dict[str, Any]
) -> str:
    """Fill the static friction of a ramp; the note on it."""
    inside = experiment.samples(stage)
    borne = sign * experiment.contact_force[:, inside]
    peak = np.argmax(borne, axis=1)
    deficit = [float(np.max((a - b)[at:])) for a, b, at in zip(load, borne, peak, strict=True)]
    row["end_force"] = float(sign * load[:, -1].mean())
    if min(deficit) < MIN_DEFICIT * experiment.static_force:
        return "does not slide: the contacts bear the force to the end"
    rows = np.arange(peak.size)
    friction = borne[rows, peak]
    moved = sign * (experiment.displacement[:, inside][rows, peak])
    start = sign * experiment.displacement_at_start(stage)
    row |= {
        "static_friction": float(friction.mean()),
        "static_friction_error": scatter(friction),
        "slide_time": float(experiment.time[inside][peak].mean()) - stage.start,
        "displacement": float((moved - start).mean()),
    }
    return ""


def motion_under_force(experiment: Experiment) -> tuple[str, bool]:
    """The motion in the last stage of a drive by force, as a sentence, and whether it is steady
    creep. A run under way may be in its first stage still."""
    if not experiment.stages:
        return "has not reached the end of a stage yet", False
    stage = experiment.stages[-1]
    constant = [row for row in creep_rows(experiment, 0) if row["stage_number"] == stage.number]
    growing = [row for row in ramp_rows(experiment, 0) if row["stage_number"] == stage.number]
    if constant:
        row = constant[0]
        force, velocity, error = row["force"], row["velocity"], row["velocity_error"]
        under = f"under a constant force of {with_unit(force, 'N', 3)}"
        if not math.isfinite(velocity):
            return f"has too few samples {under}", False
        if not row["is_steady"]:
            return f"does not creep steadily yet {under}", False
        if abs(velocity) < 2 * error:
            return f"rests {under}, within {with_unit(2 * error, 'm/s', 2)}", True
        return f"creeps at {with_unit(velocity, 'm/s', 3)} {under}", True
    if growing and math.isfinite(growing[0]["static_friction"]):
        return f"slides from {with_unit(growing[0]['static_friction'], 'N', 3)} on", False
    if growing:
        return f"does not slide up to {with_unit(growing[0]['end_force'], 'N', 3)}", False
    return "is unloaded", False


def friction_line(data: Arrays) -> Line | None:
    """The line of the static friction over ln of the rate of the force, of ramps after a constant
    force; None for fewer than two rates."""
    has_hold = np.isfinite(data["hold_time"].values)
    data = data.isel(ramp=has_hold | ~has_hold.any())
    return line(
        np.log(data["force_rate"].values),
        data["static_friction"].values,
        data["static_friction_error"].values,
    )


def restart_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each stage of constant force after a smaller one: the slider restarts when it has moved by
    f_s/k since the hold."""
    rows = []
    for hold, stage in itertools.pairwise(experiment.stages):
        if not (hold.is_constant_force and stage.is_constant_force):
            continue
        held, force = (float(experiment.force_at(one, "start")[0]) for one in (hold, stage))
        if held * force < 0 or abs(held) > (1 - SAME_FORCE) * abs(force):
            continue
        row = empty_row(RESTARTS, number, stage) | {
            "stage_start_time": stage.start,
            "hold_time": hold.duration,
            "hold_force": held,
            "force": force,
        }
        row["note"] = _fill_restart(experiment, stage, float(np.sign(force)), row)
        rows.append(row)
    return rows


def _fill_restart(experiment: Experiment, stage: Stage, sign: float, row: dict[str, Any]) -> str:
    """Fill the time to the restart; the note on it."""
    assert experiment.config is not None
    length = experiment.config.contacts.break_stretch
    inside = experiment.samples(stage)
    time = experiment.time[inside] - stage.start
    start = experiment.displacement_at_start(stage)[:, np.newaxis]
    moved = sign * (experiment.displacement[:, inside] - start)
    if np.any(moved[:, -1] < length):
        return "does not restart: the slider moves by less than the breaking stretch"
    times = np.array([_first_time(time, one, length) for one in moved])
    row |= {"restart_time": float(times.mean()), "restart_time_error": scatter(times)}
    return ""


def _first_time(time: np.ndarray, moved: np.ndarray, length: float) -> float:
    """The first time at which a displacement, 0 at the time 0, has a length; between samples it is
    linear."""
    after = int(np.argmax(moved >= length))
    before = (0.0, 0.0) if after == 0 else (time[after - 1], moved[after - 1])
    share = (length - before[1]) / (moved[after] - before[1])
    return float(before[0] + share * (time[after] - before[0]))
