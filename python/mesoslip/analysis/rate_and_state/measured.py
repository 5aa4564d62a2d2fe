"""Rate-and-state parameters of measured traces as rows of a table: of all steps and holds of a
record together, and of each by itself."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.rate_and_state.motion import Loading
from mesoslip.analysis.rate_and_state.points import Points, averaged
from mesoslip.analysis.rate_and_state.rows import empty_row
from mesoslip.analysis.rate_and_state.search import (
    MEASURED_LAWS,
    MIN_P_VALUE,
    MeasuredFit,
    fit_laws,
)
from mesoslip.errors import RunError
from mesoslip.quantities import percent

Array = NDArray[np.float64]

# Blocks of the first stage that are compared with the line through its last half, and the maximum
# deviation of a block over the scatter about the line.
BLOCKS = 40
MAX_DEVIATION = 5.0
# Minimum number of samples of a stage.
MIN_SAMPLES = 10
# Minimum difference of Akaike's criterion that prefers a law.
MIN_PREFERENCE = 2.0


def records_of(experiment: Experiment) -> list[Points] | str:
    """The record of all stages, and those of each step and each hold; or why there is none.

    Parameters
    ----------
    experiment
        A measured trace.
    """
    stages = experiment.stages
    changes = [
        index
        for index, one in enumerate(stages[:-1])
        if one.is_steady and _is_long(experiment, one) and _is_long(experiment, stages[index + 1])
    ]
    if not changes:
        return "no step and no hold after sliding at constant velocity: no data for a, b and D_c"
    runs = list(_runs(stages[changes[0] :]))
    if len(runs[0]) < 2:
        return "the drive reverses: ln V is not defined"
    whole = _record(experiment, runs[0])
    single = [
        one
        for index in changes
        if (one := _single(stages, index)) is not None and len(one) < len(runs[0])
    ]
    return [whole, *(_record(experiment, one) for one in single)]


def _is_long(experiment: Experiment, stage: Stage) -> bool:
    inside = experiment.samples(stage)
    return int(inside.stop - inside.start) >= MIN_SAMPLES


def _runs(stages: Sequence[Stage]) -> Iterator[list[Stage]]:
    """Stages up to the first one that goes the other way."""
    direction = stages[0].direction
    found = []
    for one in stages:
        if min(direction * one.start_velocity, direction * one.end_velocity) < 0:
            break
        found.append(one)
    yield found


def _single(stages: Sequence[Stage], index: int) -> list[Stage] | None:
    """A step, perhaps with a ramp; or a hold with the sliding after it."""
    before = stages[index]
    found = [before]
    for one in stages[index + 1 :]:
        if min(before.direction * one.start_velocity, before.direction * one.end_velocity) < 0:
            return None
        found.append(one)
        if one.is_steady:
            return found
    return None


def _record(experiment: Experiment, stages: Sequence[Stage]) -> Points:
    """The record of some stages, the first of which slides steadily."""
    first = stages[0]
    sign = first.direction
    inside = slice(experiment.samples(first).start, experiment.samples(stages[-1]).stop)
    time, force = experiment.time[inside], sign * experiment.force[:, inside].mean(axis=0)
    begin = _steady_start(time, force, first.end)
    time, force = time[begin:], force[begin:]
    start = float(time[0])
    loadings = [Loading(first.end - start, *(2 * [abs(first.velocity)]))]
    loadings += [
        Loading(one.duration, abs(one.start_velocity), abs(one.end_velocity)) for one in stages[1:]
    ]
    return averaged(loadings, time - start, force, start=start, first_stage=first.number)


def _steady_start(time: Array, force: Array, end: float) -> int:
    """The first sample of the first stage from which the force is a straight line."""
    count = int(np.searchsorted(time, end, "right"))
    if count < 2 * BLOCKS:
        return 0
    edges = np.linspace(0, count, BLOCKS + 1).astype(int)
    size = np.diff(edges)
    mean = np.add.reduceat(force[:count], edges[:-1]) / size
    at = np.add.reduceat(time[:count], edges[:-1]) / size
    half = BLOCKS // 2
    slope, level = np.polyfit(at[half:] - at[-1], mean[half:], 1)
    deviation = np.abs(mean - level - slope * (at - at[-1]))
    scatter = float(np.sqrt(np.sum(deviation[half:] ** 2) / (half - 2)))
    outside = np.flatnonzero(deviation[:half] > MAX_DEVIATION * max(scatter, 1e-300))
    return int(edges[outside[-1] + 1]) if outside.size else 0


def trend_of(experiment: Experiment) -> bool:
    """Whether a linear trend is fitted: unless the description of the trace says "none"."""
    described = tomllib.loads(experiment.tree.attrs.get("trace", ""))
    return bool(described.get("trend", "linear") != "none")


def fitted_trend(rows: Sequence[dict[str, Any]]) -> float:
    """Trend of the friction with displacement of the law of one state that fits a whole record
    best, unit of the force over metre; 0 without one.

    Parameters
    ----------
    rows
        Rows of `measured_rows`.
    """
    able = [
        one
        for one in rows
        if one["stage_number"] < 0 and math.isfinite(one["trend"]) and "two" not in one["law"]
    ]
    if not able:
        return 0.0
    best = min(able, key=lambda one: float(one["information_criterion"]))
    return float(best["trend"])


def measured_rows(
    experiment: Experiment,
    number: int,
    *,
    free_stiffness: bool = False,
    laws: Sequence[str] = tuple(MEASURED_LAWS),
) -> list[dict[str, Any]]:
    """Rate-and-state parameters of a measured trace by each law, or a row with the reason for
    none.

    Parameters
    ----------
    experiment
        The trace.
    number
        Its number.
    free_stiffness
        Whether the stiffness is fitted although it is known.
    laws
        The laws.
    """
    records = records_of(experiment)
    if isinstance(records, str):
        return [empty_row(number, "", records)]
    rows = []
    for index, points in enumerate(records):
        stage = points.first_stage + 1 if index else -1
        try:
            fits = measured_fits(experiment, points, free_stiffness=free_stiffness, laws=laws)
        except RunError as error:
            rows.append(empty_row(number, "", str(error)) | {"stage_number": stage})
            continue
        preferred = preferred_law(fits)
        rows += [_row(number, stage, law, one, preferred) for law, one in fits.items()]
    return rows


def measured_fits(
    experiment: Experiment,
    points: Points,
    *,
    free_stiffness: bool = False,
    laws: Sequence[str] = tuple(MEASURED_LAWS),
) -> dict[str, MeasuredFit]:
    """Fits of all laws to a record of a measured trace.

    Parameters
    ----------
    experiment
        The trace.
    points
        The record.
    free_stiffness
        Whether the stiffness is fitted although it is known.
    laws
        The laws.

    Raises
    ------
    RunError
        If no motion can be integrated, or the slider moves with the drive.
    """
    stiffness = experiment.stiffness
    if math.isinf(stiffness):
        raise RunError(
            "a prescribed slider has no spring; give the stiffness of the apparatus, or none to "
            "fit it"
        )
    return fit_laws(
        points,
        math.nan if free_stiffness else stiffness,
        with_trend=trend_of(experiment),
        laws=laws,
    )


def preferred_law(fits: dict[str, MeasuredFit]) -> str:
    """The law that the data prefer by Akaike's criterion, of those whose parameters they determine;
    empty if the evolution does not stand out, or the criteria agree within 2."""
    able = {law: one for law, one in fits.items() if one.stands_out and not one.undetermined}
    if not able:
        return ""
    order = sorted(able, key=lambda law: able[law].information_criterion)
    best = able[order[0]].information_criterion
    if len(order) > 1 and able[order[1]].information_criterion - best < MIN_PREFERENCE:
        return ""
    return order[0]


def _row(number: int, stage: int, law: str, found: MeasuredFit, preferred: str) -> dict[str, Any]:
    row = empty_row(number, law, _assessment(law, found, preferred)) | {"stage_number": stage}
    row["reference_velocity"] = found.model.points.reference_velocity
    row |= _values(found, ("reference_force", "stiffness"))
    if found.model.with_trend:
        row |= _values(found, ("trend",))
    if _gives_numbers(found):
        names = ["a", "b", "slip_distance", "a_minus_b"]
        if found.model.states == 2:
            names += ["b2", "slip_distance2"]
        row |= _values(found, names)
        if found.model.states == 1:
            row["critical_stiffness"] = -found.value("a_minus_b") / found.value("slip_distance")
    scale = found.model.scale
    return row | {
        "noise": found.noise.deviation * scale,
        "noise_time": found.noise.time,
        "residual": float(np.sqrt(np.mean(found.residual**2))),
        "relative_misfit": found.relative_misfit,
        "chi_square": found.chi_square / found.residual.size,
        "independent_points": found.noise.independent_points,
        "fit_p_value": found.p_value,
        "runs_p_value": found.runs_p_value,
        "information_criterion": found.information_criterion,
        "evolution_chi_square": found.improvement,
        "is_described": int(found.is_described and _gives_numbers(found)),
        "is_preferred": int(law == preferred),
    }


def _gives_numbers(found: MeasuredFit) -> bool:
    return found.stands_out and not found.undetermined


def _values(found: MeasuredFit, names: Sequence[str]) -> dict[str, float]:
    """Values and errors by name."""
    return {name: found.value(name) for name in names} | {
        f"{name}_error": found.error(name) for name in names
    }


def _assessment(law: str, found: MeasuredFit, preferred: str) -> str:
    """A sentence on a fit."""
    if not found.stands_out:
        return "not determined: the evolution does not stand out of the noise"
    if found.undetermined:
        names = found.undetermined
        verb = "is" if len(names) == 1 else "are"
        return f"not determined: {' and '.join(names)} {verb} uncertain by more than 25 %"
    notes = []
    if found.is_described:
        notes.append("describes the record within the noise")
    else:
        reasons = []
        if found.p_value < MIN_P_VALUE:
            reasons.append("residuals exceed the noise where the force evolves")
        if found.runs_p_value < MIN_P_VALUE:
            reasons.append("residuals are systematic")
        misfit = percent(found.relative_misfit)
        reasons.append(f"the misfit is {misfit} of the variation")
        notes.append(f"does not describe the record: {', '.join(reasons)}")
    if law == preferred:
        notes.append("preferred among the laws whose parameters are determined")
    return "; ".join(notes)
