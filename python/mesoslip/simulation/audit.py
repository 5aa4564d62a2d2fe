"""Checks of a completed run: energy balance, work of the steps, error of the force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.realization import Realization


def failed_checks(config: Config, realizations: Sequence[Realization]) -> list[str]:
    """A message with the fix for each check that failed.

    The energy of every run is balanced to rounding, or to the tolerance of its solver. In the
    master equation the steps do little work of their own, and the error of the force is bounded.
    """
    slider, contacts = config.slider, config.contact_kind
    remedies = "; ".join(text for text in (contacts.remedy, slider.remedy) if text)
    remedy = f"; {remedies}" if remedies else ""
    failed = []
    bound = max(contacts.residual_bound, slider.residual_bound(config))
    residual = max((one.energy_residual for one in realizations), key=abs)
    if not abs(residual) <= bound and not math.isnan(residual):
        failed.append(
            f"the residual of the energy balance is {abs(residual):.1g} of the work of the drive; "
            f"it should be at most {bound:.1g}{remedy}"
        )
    work = max((one.step_work for one in realizations), key=abs)
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
