"""Errors of a run due to its steps, from a coarse run with steps twice as long.

The error is proportional to the square of the step, so the error of the run is a third of the
difference of the two. In a slip the forces differ mainly because the slips start at different
times: so the error of the force is that before the first slip, and slips have an error in time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mesoslip.array_types import Array
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
    """Of the time at which a slip starts, maximum over the slips [s]."""


def step_errors(trace: Array, slips: Array, coarse_trace: Array, coarse_slips: Array) -> StepErrors:
    """Errors of a run, from its trace and slips and those of the coarse run."""
    starts, coarse_starts = slips[:, START], coarse_slips[:, START]
    first = min(np.min(one, initial=np.inf) for one in (starts, coarse_starts))
    count = min(len(trace), len(coarse_trace))
    time = trace[:count, 0]
    # Where slips or a displacement end the runs, their last samples are at different times.
    compared = (time == coarse_trace[:count, 0]) & (time < first)
    difference = np.abs(trace[:count, FORCE] - coarse_trace[:count, FORCE])[compared]
    shift = _max_shift(starts, coarse_starts, trace[-1, 0]) if len(trace) else 0.0
    return StepErrors(float(np.max(difference, initial=0.0)) / ERROR_RATIO, shift / ERROR_RATIO)


def _max_shift(starts: Array, coarse_starts: Array, end: float) -> float:
    """Maximum difference of the times at which a slip starts in both runs [s]."""
    if len(starts) == len(coarse_starts):
        return float(np.max(np.abs(starts - coarse_starts), initial=0.0))
    # A slip that one of the runs lacks may start there after the end.
    more, fewer = sorted((starts, coarse_starts), key=len, reverse=True)
    fewer = np.append(fewer, max(end, more[-1]))
    return float(np.max(np.min(np.abs(more[:, None] - fewer), axis=1)))
