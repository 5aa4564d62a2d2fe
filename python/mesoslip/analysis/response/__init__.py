"""Steady forces, velocity steps, holds and rate-and-state parameters of outputs.

Forces are those of the spring along the drive: positive against its motion, in either direction.
Of a slider under a force: creep velocities and static friction.
"""

from mesoslip.analysis.response.dataset import (
    response,
    response_arrays,
    response_of,
    rows_of,
    scalars_of,
    write_csv,
)
from mesoslip.analysis.response.forces import creep_line, friction_line
from mesoslip.analysis.response.holds import healing_line, steady_line
from mesoslip.analysis.response.line import Line, line
from mesoslip.analysis.response.tables import ResponseTable, force_scale, tables

__all__ = [
    "Line",
    "ResponseTable",
    "creep_line",
    "force_scale",
    "friction_line",
    "healing_line",
    "line",
    "response",
    "response_arrays",
    "response_of",
    "rows_of",
    "scalars_of",
    "steady_line",
    "tables",
    "write_csv",
]
