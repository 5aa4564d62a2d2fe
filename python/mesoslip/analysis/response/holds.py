"""Holds: relaxation, restart peak and healing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.response.columns import HOLDS, empty_row
from mesoslip.analysis.response.line import Line, line
from mesoslip.analysis.steady_force import error_of_mean, scatter

if TYPE_CHECKING:
    from mesoslip.output.arrays import Arrays


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
