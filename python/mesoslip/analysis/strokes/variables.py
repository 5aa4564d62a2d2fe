"""The variables of strokes and cycles: units for a force in newtons, and meanings."""

from __future__ import annotations

import numpy as np

from mesoslip.output.variables import REALIZATION_INDEX, Estimate, Group, Meaning

STROKES = Group(
    realization_index=REALIZATION_INDEX,
    stroke_number=Meaning("1", "number of the stroke, from 1", np.int64),
    start_time=Meaning("s", "time of the reversal before the stroke"),
    end_time=Meaning("s", "time of the reversal after it"),
    direction=Meaning(
        "1", "direction of the motion, or of the force where that is unknown", np.int64
    ),
    length=Meaning("m", "distance between the reversals"),
    velocity=Meaning("m s-1", "mean speed in the middle of the stroke"),
    mean_friction=Estimate("N", "mean force along the motion in the middle of the stroke"),
    mean_friction_coefficient=Estimate("1", "the same over the mean normal force there"),
    max_friction=Meaning("N", "maximum force along the motion"),
    max_friction_position=Meaning("m", "distance from the reversal to this maximum"),
    start_force=Meaning("N", "force at the reversal before the stroke"),
    end_force=Meaning("N", "force at the reversal after it"),
    stiffness=Estimate("N m-1", "stiffness at the reversal before the stroke"),
    slides=Meaning(
        "1", "whether there is sliding friction (1), or the force only grows (0)", np.int64
    ),
)

CYCLES = Group(
    realization_index=REALIZATION_INDEX,
    cycle_number=Meaning("1", "number of the cycle, from 1", np.int64),
    start_time=Meaning("s", "time of the reversal before the cycle"),
    end_time=Meaning("s", "time of the reversal after it"),
    mean_friction=Estimate("N", "half the difference of the mean forces in both directions"),
    mean_friction_coefficient=Estimate("1", "the same over the mean normal force"),
    loop_energy=Estimate("J", "energy dissipated in the cycle, the area of its loop"),
    offset=Estimate("N", "offset of the force, half the sum of the means in both directions"),
    stiffness=Estimate("N m-1", "mean stiffness at both reversals"),
)


def unit_of(unit: str, force_unit: str) -> str:
    """CF units of a variable, of which those of a force are "N", or "1" for coefficients."""
    if force_unit != "1":
        return unit
    return {"N": "1", "N m-1": "m-1", "J": "m"}.get(unit, unit)
