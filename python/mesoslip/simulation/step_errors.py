"""Errors of a run by its steps, from the same run with steps twice as long.

The error falls with the square of the step, so that of the run is a third of the difference of the
two. In a slip the force of both differs by as much as they slip at different times: the error is
given in force before the first slip, and in time for the starts of slips.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mesoslip.simulation.kernel import Array
from mesoslip.simulation.recorded_tables import SLIP_COLUMNS, TRACE_COLUMNS

# Steps of the coarse run over those of the run itself, and their errors less 1.
COARSENING = 2.0
ERROR_RATIO = COARSENING**2 - 1.0

START = SLIP_COLUMNS.index("start_time")
FORCE = TRACE_COLUMNS.index("contact_force")


class StepErrors(NamedTuple):
    """Estimated errors of a run."""

    force: float
    """Of the contact force, before the first slip [N]."""
    slip_time: float
    """Of the time at which a slip starts, that of the slip where it is greatest [s]."""


def step_errors(trace: Array, slips: Array, coarse_trace: Array, coarse_slips: Array) -> StepErrors:
    """Errors of a run from its trace and slips and those of the coarse run."""
    starts, coarse_starts = slips[:, START], coarse_slips[:, START]
    first = min(np.min(one, initial=np.inf) for one in (starts, coarse_starts))
    count = min(len(trace), len(coarse_trace))
    time = trace[:count, 0]
    # Runs that their slips or a displacement end have last samples at times of their own.
    compared = (time == coarse_trace[:count, 0]) & (time < first)
    difference = np.abs(trace[:count, FORCE] - coarse_trace[:count, FORCE])[compared]
    late = _lateness(starts, coarse_starts, trace[-1, 0]) if len(trace) else 0.0
    return StepErrors(float(np.max(difference, initial=0.0)) / ERROR_RATIO, late / ERROR_RATIO)


def _lateness(starts: Array, coarse_starts: Array, end: float) -> float:
    """How much later or earlier a slip starts in the coarse run, at most."""
    if len(starts) == len(coarse_starts):
        return float(np.max(np.abs(starts - coarse_starts), initial=0.0))
    # A slip that one of them lacks comes after the end there, or is in truth none.
    more, fewer = sorted((starts, coarse_starts), key=len, reverse=True)
    fewer = np.append(fewer, max(end, more[-1]))
    return float(np.max(np.min(np.abs(more[:, None] - fewer), axis=1)))
