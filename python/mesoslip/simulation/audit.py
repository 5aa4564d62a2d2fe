"""Checks of a completed run, and its errors due to steps, from a run with steps twice as long."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.array_types import Array
from mesoslip.simulation.recorded_tables import ENERGY_COLUMNS, SLIP_COLUMNS, TRACE_COLUMNS

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.realization import Realization

# Minimum scale of energy residuals, over the energy of all contacts about to break.
MIN_ENERGY_RATIO = 1e-9


def share_of_work(config: Config, energies: Array, term: str) -> Array:
    """A term of energy balances, with the terms `ENERGY_COLUMNS` last [J], relative to the work of
    the drive, forth and back, or the largest term."""
    contacts = config.contacts
    gross = energies[..., ENERGY_COLUMNS.index("gross_work")]
    # Cycles may return all of the work.
    scale = np.where(gross == 0.0, np.max(np.abs(energies), axis=-1), gross)
    # The minimum scale is for runs in which hardly any work is done.
    unit = contacts.static_force**2 / contacts.stiffness
    values = energies[..., ENERGY_COLUMNS.index(term)]
    return np.asarray(values / np.maximum(scale, MIN_ENERGY_RATIO * unit))


def largest(values: Array) -> float:
    """The value with the largest size; NaN if none is known."""
    known = values[~np.isnan(values)]
    return float(known[np.argmax(np.abs(known))]) if known.size else math.nan


def failed_checks(config: Config, realizations: Sequence[Realization]) -> list[str]:
    """A message with the fix for each failed check of the energy balance, of the work of steps, and
    of the error of the force."""
    slider, contacts = config.slider, config.contact_kind
    remedies = "; ".join(text for text in (contacts.remedy, slider.remedy) if text)
    remedy = f"; {remedies}" if remedies else ""
    failed = []
    bound = max(contacts.residual_bound, slider.residual_bound(config))
    energies = np.array([one.energy for one in realizations])
    residual = largest(share_of_work(config, energies, "residual"))
    if not abs(residual) <= bound and not math.isnan(residual):
        failed.append(
            f"the residual of the energy balance is {abs(residual):.1g} of the work of the drive; "
            f"it should be at most {bound:.1g}{remedy}"
        )
    work = largest(share_of_work(config, energies, "step_work"))
    if abs(work) > contacts.step_work_bound:
        failed.append(
            f"the error of the work of the steps is {abs(work):.1g} of the work of the drive; "
            f"it should be at most {contacts.step_work_bound:.1g}{remedy}"
        )
    error = max(one.force_error for one in realizations) / config.contacts.static_force
    bound = config.run.force_tolerance or contacts.force_error_bound
    if bound > 0 and error > bound:
        failed.append(
            f"the error of the contact force is about {error:.1g} of the static force; "
            f"it should be at most {bound:.1g}{remedy}"
        )
    return failed


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
    """Errors of a run, from its trace and slips and those of the coarse run.

    The error is proportional to the square of the step, so the error of the run is a third of the
    difference of the two. In a slip the forces differ mainly because the slips start at different
    times: so the error of the force is that before the first slip, and slips have an error in time.
    """
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
