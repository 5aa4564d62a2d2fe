"""Columns of the tables of a response: units and meanings."""

from __future__ import annotations

from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Stage
from mesoslip.output.variables import Estimate, Group, Meaning

_IS_EXACT = Meaning("1", "whether the peak is that of the motion, not of the samples", np.int8)


def _rows(**columns: Meaning) -> Group:
    """Columns of the rows of stages."""
    return Group(
        output_index=Meaning("1", "number of the output, from 0", np.int64),
        stage_number=Meaning("1", "number of the stage of the drive, from 0", np.int64),
        **columns,
        note=Meaning("1", "limitations, missing values and their reasons", np.str_),
    )


def _line(name: str, meaning: str) -> Group:
    """Scalars of a line through rows."""
    return Group(
        {
            name: Estimate("N", meaning),
            f"{name}_chi_square": Meaning("1", "chi square of the line"),
            f"{name}_freedom": Meaning("1", "degrees of freedom of the line", np.int64),
        }
    )


STEADY = _rows(
    stage_start_time=Meaning("s", "start of the stage"),
    velocity=Meaning("m s-1", "velocity of the drive"),
    steady_force=Estimate("N", "mean force after the transient, against the drive"),
    steady_force_half_width=Meaning("N", "half the width of the 95 % interval"),
    standard_deviation=Meaning("N", "standard deviation of the force about the mean"),
    transient_time=Meaning("s", "duration of the discarded transient"),
    sample_count=Meaning("1", "samples after the transient, of all realizations", np.int64),
    effective_sample_count=Meaning("1", "number of independent samples with the same error"),
    slip_share=Meaning(
        "1", "share of the loading by the drive that slips relieve, without their rebound"
    ),
    is_steady=Meaning("1", "whether the transient is over, and halves of the rest agree", np.int8),
    is_resolved=Meaning("1", "whether the stage is long enough for a reliable error", np.int8),
)

STEPS = _rows(
    step_time=Meaning("s", "time of the step"),
    velocity_before=Meaning("m s-1", "velocity of the drive before the step"),
    velocity_after=Meaning("m s-1", "velocity of the drive after the step"),
    force_before=Meaning("N", "steady force before the step"),
    force_after=Meaning("N", "steady force after the step"),
    net_change=Estimate("N", "steady force after minus before, (a - b) ln(V/V0)"),
    peak_force=Meaning("N", "extreme force, from which the evolution starts"),
    peak_is_exact=_IS_EXACT,
    direct_change=Estimate("N", "extreme force minus steady force before, a ln(V/V0)"),
    evolution_change=Estimate("N", "steady force after minus extreme force, -b ln(V/V0)"),
    apparent_a=Meaning("N", "direct change over ln(V/V0)"),
    apparent_b=Meaning("N", "minus evolution change over ln(V/V0)"),
    rate_dependence=Estimate("N", "net change over ln(V/V0), a - b"),
    relaxation_displacement=Estimate(
        "m", "length of the exponential decay over the slider's displacement"
    ),
    integral_displacement=Estimate(
        "m", "area between force and steady force, over the evolution change"
    ),
    overshoot=Meaning("N", "maximum deviation beyond the steady force after the peak"),
)

LOAD_STEPS = _rows(
    load_step_time=Meaning("s", "time of the step of the normal load"),
    normal_force_before=Meaning("N", "normal force before the step"),
    normal_force_after=Meaning("N", "normal force after the step"),
    force_before=Meaning("N", "steady force before the step"),
    force_after=Meaning("N", "steady force after the step"),
    direct_change=Estimate("N", "force just after the step minus steady force before"),
    transient_change=Estimate("N", "steady force after minus force just after the step"),
    alpha=Estimate("1", "transient change over the normal force after and ln(L'/L)"),
    rise_displacement=Meaning(
        "m", "displacement of the slider until the force first reaches the steady force"
    ),
    relaxation_displacement=Estimate(
        "m", "length of the exponential decay over the slider's displacement"
    ),
)

HOLDS = _rows(
    hold_start_time=Meaning("s", "start of the hold"),
    hold_time=Meaning("s", "duration of the hold"),
    velocity_before=Meaning("m s-1", "velocity of the drive before the hold"),
    velocity_after=Meaning("m s-1", "velocity of the drive after the hold"),
    force_before=Meaning("N", "steady force before the hold"),
    force_before_error=Meaning("N", "standard error of the steady force before the hold"),
    start_force=Meaning("N", "force at the start of the hold"),
    end_force=Meaning("N", "force at the end of the hold"),
    relaxation=Estimate("N", "decrease of the force during the hold"),
    drop=Estimate("N", "steady force before minus force at the end of the hold"),
    peak_force=Meaning("N", "maximum force of the restart"),
    peak_is_exact=_IS_EXACT,
    healing=Estimate("N", "peak minus steady force before the hold"),
    slip_to_peak=Meaning("m", "displacement of the slider from the end of the hold to the peak"),
    load_to_peak=Meaning(
        "m", "displacement of the load point from the end of the hold to the peak"
    ),
)

CREEP = _rows(
    stage_start_time=Meaning("s", "start of the stage"),
    duration=Meaning("s", "duration of the stage"),
    force=Meaning("N", "constant force on the slider"),
    displacement=Meaning("m", "displacement of the slider in the stage"),
    velocity=Estimate("m s-1", "mean velocity after the transient"),
    transient_time=Meaning("s", "duration of the discarded transient"),
    is_steady=Meaning("1", "whether the transient is over, and halves of the rest agree", np.int8),
)

RAMPS = _rows(
    stage_start_time=Meaning("s", "start of the stage"),
    force_rate=Meaning("N s-1", "rate at which the force grows"),
    hold_time=Meaning("s", "duration of the constant force before the ramp"),
    hold_force=Meaning("N", "constant force before the ramp"),
    end_force=Meaning("N", "force at the end of the ramp"),
    static_friction=Estimate("N", "maximum force of the contacts, from which the slider slides"),
    slide_time=Meaning("s", "time from the start of the ramp to the maximum"),
    displacement=Meaning("m", "displacement of the slider from the start to the maximum"),
)

RESTARTS = _rows(
    stage_start_time=Meaning("s", "start of the stage"),
    hold_time=Meaning("s", "duration of the smaller force before the stage"),
    hold_force=Meaning("N", "smaller constant force before the stage"),
    force=Meaning("N", "constant force on the slider"),
    restart_time=Estimate(
        "s", "time from the start of the stage until the slider has moved by the breaking stretch"
    ),
)

# Scalars of a group: those of the line through its rows.
STEADY_LINE = _line("rate_dependence", "slope of the steady force over ln V, a - b")
HEALING_LINE = _line("healing_per_decade", "increase of the peak per decade of hold time, beta")
CREEP_LINE = _line("creep_rate_dependence", "slope of the force over ln V, a - b")
FRICTION_LINE = _line(
    "friction_rate_dependence", "slope of the static friction over ln of the force rate"
)


def empty_row(group: Group, number: int, stage: Stage) -> dict[str, Any]:
    """A row of a group without values, for a stage of the output of a number."""
    return group.empty_row | {"output_index": number, "stage_number": stage.number}
