"""Rate-and-state parameters of outputs as rows of a table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.fitting import MIN_P_VALUE, Fit, fit
from mesoslip.analysis.rate_and_state.motion import LAWS
from mesoslip.analysis.rate_and_state.record import Record, record_of
from mesoslip.errors import RunError
from mesoslip.output.variables import Estimate, Group, Meaning
from mesoslip.quantities import percent

# Maximum relative misfit of an adequate law, for a record without noise.
MAX_MISFIT = 0.01

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
    note=Meaning("1", "assessment of the fit", np.str_),
)


def fit_rows(
    experiment: Experiment, number: int, *, free_stiffness: bool = False
) -> list[dict[str, Any]]:
    """Rate-and-state parameters of an output by each law, or a row with the reason for none.

    Parameters
    ----------
    experiment
        The output.
    number
        Its number.
    free_stiffness
        Whether the stiffness is fitted too. Under a prescribed slider it is that of the contacts.
    """
    config = experiment.config
    if free_stiffness and math.isinf(experiment.stiffness) and config is not None:
        experiment = experiment.with_stiffness(config.contacts.stiffness)
    record = record_of(experiment)
    if isinstance(record, str):
        return [empty_row(number, "", record)]
    rows = []
    for law in LAWS:
        try:
            rows.append(_fit_row(number, record, fit(record, law, free_stiffness=free_stiffness)))
        except RunError as error:
            rows.append(empty_row(number, law, str(error)))
    return rows


def empty_row(number: int, law: str, note: str) -> dict[str, Any]:
    """A row without parameters.

    Parameters
    ----------
    number
        Number of the output.
    law
        The law; empty if there is none.
    note
        The note.
    """
    row = {name: math.nan if one.dtype is np.float64 else 0 for name, one in FIT.items()}
    return row | {"output_index": number, "stage_number": -1, "law": law, "note": note}


def _fit_row(number: int, record: Record, found: Fit) -> dict[str, Any]:
    errors = found.errors
    relative = found.relative_misfit(record)
    described = (
        found.p_value >= MIN_P_VALUE and not found.runs_p_value < MIN_P_VALUE
        if record.has_noise
        else relative < MAX_MISFIT
    ) and not found.at_bounds
    return empty_row(number, found.law.law, _assessment(record, found, relative, described)) | {
        "reference_velocity": found.law.reference_velocity,
        "reference_force": found.law.reference_force,
        "reference_force_error": errors[0],
        "a": found.law.a,
        "a_error": errors[1],
        "b": found.law.b,
        "b_error": errors[2],
        "slip_distance": found.law.slip_distance,
        "slip_distance_error": errors[3],
        "a_minus_b": found.law.a - found.law.b,
        "a_minus_b_error": math.sqrt(
            max(float(np.array([0, 1, -1, 0]) @ found.covariance[:4, :4] @ [0, 1, -1, 0]), 0.0)
        ),
        "stiffness": found.stiffness,
        "stiffness_error": errors[4] if errors.size > 4 else 0.0,
        "critical_stiffness": found.law.critical_stiffness,
        "noise": float(np.sqrt(np.mean(record.deviation**2))) if record.has_noise else 0.0,
        "residual": found.misfit,
        "relative_misfit": relative,
        "chi_square": found.chi_square if record.has_noise else math.nan,
        "independent_points": found.independent_points,
        "fit_p_value": found.p_value,
        "runs_p_value": found.runs_p_value,
        "information_criterion": found.information_criterion if record.has_noise else math.nan,
        "is_described": int(described),
    }


def _assessment(record: Record, found: Fit, relative: float, described: bool) -> str:
    """A sentence: whether the law describes the record, and the reasons if not."""
    if described:
        accuracy = "within the noise" if record.has_noise else f"to {percent(relative)}"
        return f"describes the record {accuracy}"
    reasons = []
    if found.at_bounds:
        verb = "is" if len(found.at_bounds) == 1 else "are"
        reasons.append(f"{' and '.join(found.at_bounds)} {verb} not determined by the record")
    if record.has_noise and found.p_value < MIN_P_VALUE:
        reasons.append(f"the residuals are {math.sqrt(found.chi_square):.2g} times the noise")
    if found.runs_p_value < MIN_P_VALUE:
        reasons.append("the residuals are systematic")
    reasons.append(f"the misfit is {percent(relative)} of the variation")
    return "does not describe the record: " + ", ".join(reasons)
