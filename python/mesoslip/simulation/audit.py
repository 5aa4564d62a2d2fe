"""Checks of a completed run: energy balance, work of the steps, error of the force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.array_types import Array
from mesoslip.simulation.recorded_tables import ENERGY_COLUMNS

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
    if contacts.force_error_bound > 0 and error > contacts.force_error_bound:
        failed.append(
            f"the error of the contact force is about {error:.1g} of the static force; "
            f"it should be at most {contacts.force_error_bound:.1g}{remedy}"
        )
    return failed
