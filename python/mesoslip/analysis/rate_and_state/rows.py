"""Rate-and-state parameters of outputs as rows of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.search import MIN_P_VALUE, Fit, fit_laws, preferred_law
from mesoslip.errors import RunError
from mesoslip.output.variables import Estimate, Group, Meaning
from mesoslip.quantities import percent

FIT = Group(
    output_index=Meaning("1", "number of the output, from 0", np.int64),
    stage_number=Meaning(
        "1", "stage that starts with the step or hold, -1 for all stages together", np.int64
    ),
    law=Meaning("1", "evolution law of the state variables", np.str_),
    reference_velocity=Meaning("m s-1", "V0"),
    reference_force=Estimate("N", "steady force at V0"),
    a=Meaning("N", "parameter a of the direct effect"),
    a_error=Meaning("N", "standard error of a"),
    b=Meaning("N", "parameter b of the evolution effect"),
    b_error=Meaning("N", "standard error of b"),
    slip_distance=Meaning("m", "characteristic slip distance D_c"),
    slip_distance_error=Meaning("m", "standard error of D_c"),
    b2=Meaning("N", "parameter b of a second state variable"),
    b2_error=Meaning("N", "standard error of b2"),
    slip_distance2=Meaning("m", "characteristic slip distance of the second state variable"),
    slip_distance2_error=Meaning("m", "standard error of the second slip distance"),
    a_minus_b=Meaning("N", "rate dependence of steady sliding, with the second state variable"),
    a_minus_b_error=Meaning("N", "standard error of the rate dependence"),
    trend=Estimate("N m-1", "trend of the friction with displacement that was fitted"),
    stiffness=Meaning("N m-1", "stiffness of the spring, infinite for a prescribed slider"),
    stiffness_error=Meaning("N m-1", "standard error of the stiffness, 0 if it is that of the run"),
    critical_stiffness=Meaning("N m-1", "stiffness of the spring below which sliding is unstable"),
    noise=Meaning("N", "standard deviation of the noise of the averaged record"),
    noise_time=Meaning("s", "correlation time of the noise, 0 if it is white"),
    residual=Meaning("N", "root mean square of the residuals"),
    relative_misfit=Meaning("1", "residual over the standard deviation of the record"),
    chi_square=Meaning("1", "mean square of the residuals over their noise"),
    independent_points=Meaning("1", "equivalent number of independent points"),
    fit_p_value=Meaning("1", "probability of such a misfit by noise"),
    runs_p_value=Meaning("1", "probability of so few changes of the residuals' sign by chance"),
    information_criterion=Meaning(
        "1", "Akaike's criterion; the law with the lower one is likelier"
    ),
    evolution_chi_square=Meaning("1", "chi square that the evolution of the state explains"),
    is_described=Meaning("1", "whether the law describes the record", np.int8),
    is_preferred=Meaning("1", "whether the record prefers the law to the others", np.int8),
    verdict=Meaning("1", "described, not described, or not determined", np.str_),
    note=Meaning("1", "assessment of the fit", np.str_),
)


def fit_rows(
    experiment: Experiment,
    number: int,
    *,
    free_stiffness: bool = False,
    laws: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Rate-and-state parameters of an output, which has a number, by each of its laws or of those
    given; or a row with the reason for none.

    The stiffness is that of the experiment unless it is free; free under a prescribed slider, it is
    that of the contacts.
    """
    records = records_of(experiment, free_stiffness=free_stiffness)
    if isinstance(records, str):
        return [_empty_row(number, "", records)]
    rows = []
    for index, record in enumerate(records):
        stage = {"stage_number": record.first_stage + 1 if index else -1}
        try:
            fits = fit_laws(record, laws)
        except RunError as error:
            rows.append(_empty_row(number, "", str(error)) | stage)
            continue
        preferred = preferred_law(fits) if record.noise is None else ""
        for name, one in fits.items():
            row = _row(number, one, name == preferred) | stage
            row["note"] = "; ".join(filter(None, (row["note"], record.limitation)))
            rows.append(row)
    return rows


def fitted_trend(rows: Sequence[dict[str, Any]]) -> float:
    """Trend of the friction with displacement of the law of one state that fits a whole record
    best, unit of the force over metre; 0 without one."""
    able = [
        one
        for one in rows
        if one["stage_number"] < 0 and math.isfinite(one["trend"]) and "two" not in one["law"]
    ]
    return min(able, key=lambda one: float(one["information_criterion"]))["trend"] if able else 0.0


def _empty_row(number: int, law: str, note: str) -> dict[str, Any]:
    own = {"output_index": number, "stage_number": -1, "law": law, "note": note}
    return FIT.empty_row | own


def _row(number: int, found: Fit, is_preferred: bool) -> dict[str, Any]:
    law, noise = found.law, found.noise
    names = ["reference_force", "stiffness", *(["trend"] if law.with_trend else [])]
    row = _empty_row(number, law.name, assessment(found, is_preferred=is_preferred))
    # Numbers that noise may have made are none, nor are those beyond the friction.
    if found.is_determined or (noise.is_known and not found.excessive):
        names += ["a", "b", "slip_distance", "a_minus_b"]
        if law.states == 2:
            names += ["b2", "slip_distance2"]
        else:
            row["critical_stiffness"] = -found.value("a_minus_b") / found.value("slip_distance")
    row |= {name: found.value(name) for name in names}
    row |= {f"{name}_error": found.error(name) for name in names}
    row |= {
        "reference_velocity": law.points.reference_velocity,
        "noise": noise.deviation * law.scale,
        "noise_time": noise.time,
        "residual": float(np.sqrt(np.mean(found.residual**2))),
        "relative_misfit": found.relative_misfit,
        "independent_points": noise.independent_points,
        "fit_p_value": found.p_value,
        "runs_p_value": found.runs_p_value,
        "evolution_chi_square": found.improvement,
        "is_described": int(found.is_described),
        "is_preferred": int(is_preferred),
        "verdict": found.verdict,
    }
    if noise.deviation > 0:
        row |= {
            "chi_square": found.mean_square,
            "information_criterion": found.information_criterion,
        }
    return row


def assessment(found: Fit, *, is_preferred: bool = False) -> str:
    """A sentence: whether the law describes the record, and the reasons if not."""
    noise, undetermined, misfit = found.noise, found.undetermined, percent(found.relative_misfit)
    names = " and ".join(undetermined) + (" is" if len(undetermined) == 1 else " are")
    if not found.stands_out:
        return "not determined: the evolution does not stand out of the noise"
    if found.excessive:
        verb = "exceeds" if len(found.excessive) == 1 else "exceed"
        return f"not determined: {' and '.join(found.excessive)} {verb} the friction itself"
    if undetermined and not noise.is_known:
        return f"not determined: {names} uncertain by more than 25 %"
    if found.is_described:
        accuracy = f"to {misfit}" if noise.deviation == 0 else "within the noise"
        text = f"describes the record {accuracy}"
    else:
        reasons = [f"{names} not determined by the record"] if undetermined else []
        if found.p_value < MIN_P_VALUE:
            reasons.append(
                f"the residuals are {math.sqrt(found.mean_square):.2g} times the noise"
                if noise.is_known
                else "residuals exceed the noise where the force evolves"
            )
        if found.runs_p_value < MIN_P_VALUE:
            reasons.append("the residuals are systematic")
        reasons.append(f"the misfit is {misfit} of the variation")
        text = f"does not describe the record: {', '.join(reasons)}"
    return (
        f"{text}; preferred among the laws whose parameters are determined"
        if is_preferred
        else text
    )
