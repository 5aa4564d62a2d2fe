"""Steady forces and their dependence on velocity; holds: relaxation, restart peak, healing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.response.columns import HOLDS, STEADY, empty_row
from mesoslip.analysis.response.line import Line, line
from mesoslip.analysis.response.steps import load_steps
from mesoslip.analysis.steady_force import SteadyMean, error_of_mean, scatter
from mesoslip.analysis.strokes.catalogue import strokes_of
from mesoslip.errors import FileError

if TYPE_CHECKING:
    from mesoslip.output.arrays import Arrays


def steady_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """The steady force of each stage at constant velocity."""
    if experiment.has_strokes:
        return _stroke_rows(experiment, number)
    rows = []
    for stage in experiment.stages:
        if not stage.is_steady:
            continue
        row = empty_row(STEADY, number, stage)
        row |= {"stage_start_time": stage.start, "velocity": stage.velocity}
        row["slip_share"] = experiment.slip_share(stage)
        mean = experiment.mean_of(stage)
        if mean is None:
            row["note"] = "too few samples in the stage"
        else:
            first = experiment.samples(stage).start
            begin = experiment.time[min(first + mean.start, experiment.time.size - 1)]
            row |= {
                "steady_force": mean.mean,
                "steady_force_error": mean.error,
                "steady_force_half_width": mean.half_width,
                "standard_deviation": mean.standard_deviation,
                "transient_time": max(0.0, float(begin) - stage.start) if mean.start else 0.0,
                "sample_count": mean.count,
                "effective_sample_count": mean.effective_count,
                "is_steady": int(mean.is_steady),
                "is_resolved": int(mean.is_resolved),
            }
            row["note"] = _note(experiment, stage, mean)
        rows.append(row)
    return rows


def _stroke_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """The mean friction over the strokes of a trace, as one row."""
    try:
        found = strokes_of(experiment.tree, name=experiment.name, realization=0)
    except FileError:
        return []
    mean = found.overall.get("mean_friction")
    if mean is None:
        return []
    row = empty_row(STEADY, number, experiment.stages[0])
    columns = found.columns["strokes"]
    row |= {
        "stage_start_time": float(columns["start_time"][0]),
        "velocity": float(np.nanmean(columns["velocity"])),
        "steady_force": mean.mean,
        "steady_force_error": mean.error,
        "steady_force_half_width": 1.96 * mean.error,
        "sample_count": sum(one.piece.size for one in found.strokes[0]),
        "effective_sample_count": float(mean.cycles),
        "is_steady": 1,
        "is_resolved": 1,
        "note": f"sliding in {columns['start_time'].size} strokes, each in mesoslip strokes",
    }
    return [row]


def _note(experiment: Experiment, stage: Stage, mean: SteadyMean) -> str:
    """Limitations of a steady force."""
    notes = []
    if experiment.is_stick_slip(stage):
        notes.append("stick-slip: the mean over its cycles")
    if load_steps(experiment, stage):
        notes.append("the mean over several normal forces")
    if not mean.is_steady:
        notes.append("not steady: the force still drifts")
    if not mean.is_resolved:
        notes.append("too short: the error is underestimated")
    return "; ".join(notes)


def steady_line(data: Arrays) -> Line | None:
    """The line of the steady force over ln V, of steady stages; None for fewer than two
    velocities."""
    good = data["is_steady"].values == 1
    velocity = np.abs(data["velocity"].values[good])
    return line(
        np.log(velocity),
        data["steady_force"].values[good],
        data["steady_force_error"].values[good],
    )


def hold_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each hold, with the restart after it."""
    rows = []
    stages = experiment.stages
    for index, hold in enumerate(stages):
        if not hold.is_hold:
            continue
        row = empty_row(HOLDS, number, hold) | {
            "hold_start_time": hold.start,
            "hold_time": hold.duration,
        }
        before = stages[index - 1] if index else None
        after = stages[index + 1] if index + 1 < len(stages) else None
        row["note"] = _fill_hold(experiment, before, hold, after, row)
        rows.append(row)
    return rows


def _fill_hold(
    experiment: Experiment,
    before: Stage | None,
    hold: Stage,
    after: Stage | None,
    row: dict[str, Any],
) -> str:
    """Fill the row of a hold; the note on it."""
    notes = []
    sign = next((one.direction for one in (before, after) if one and one.direction), 1.0)
    start, end = (sign * experiment.force_at(hold, which) for which in ("start", "end"))
    mean = None
    if before is None or not before.is_steady:
        notes.append("no stage at constant velocity before the hold")
    else:
        row["velocity_before"] = before.velocity
        mean = experiment.mean_of(before)
        if mean is None:
            notes.append("too few samples before the hold")
        elif experiment.is_stick_slip(before):
            notes.append("stick-slip before the hold: no steady force")
            mean = None
    relaxed = start - end
    row |= {
        "start_force": float(start.mean()),
        "end_force": float(end.mean()),
        "relaxation": float(relaxed.mean()),
        "relaxation_error": scatter(relaxed),
    }
    if mean is not None:
        row |= {
            "force_before": mean.mean,
            "force_before_error": mean.error,
            "drop": mean.mean - float(end.mean()),
            "drop_error": math.hypot(mean.error, error_of_mean(end, mean)),
        }
        if not mean.is_steady:
            notes.append("not steady before the hold")
    if after is None:
        return "; ".join([*notes, "no stage after the hold"])
    row["velocity_after"] = after.velocity
    if after.direction == 0 or after.direction != sign:
        return "; ".join([*notes, "the drive does not continue in the same direction"])
    peak = experiment.peak(after)
    if peak is None:
        return "; ".join([*notes, "no sample after the hold"])
    displacement = sign * (peak.displacement - experiment.displacement_at_start(after))
    if after.is_steady:
        row["load_to_peak"] = float(abs(after.velocity) * (peak.time - after.start).mean())
    row |= {
        "peak_force": float(peak.force.mean()),
        "peak_is_exact": int(peak.is_exact),
        "slip_to_peak": float(displacement.mean()),
    }
    if mean is not None:
        row["healing"] = float(peak.force.mean()) - mean.mean
        row["healing_error"] = math.hypot(mean.error, error_of_mean(peak.force, mean))
    return "; ".join(notes)


def healing_line(data: Arrays) -> Line | None:
    """The line of the healing over the decimal logarithm of the hold time."""
    return line(
        np.log10(data["hold_time"].values), data["healing"].values, data["healing_error"].values
    )
