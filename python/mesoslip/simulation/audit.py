"""The promises of a run, and whether they were kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


class Audited(Protocol):
    """Quantities of a realization that an audit checks."""

    @property
    def energy_residual(self) -> float: ...
    @property
    def step_work(self) -> float: ...
    @property
    def force_error(self) -> float: ...


def failed_promises(config: Config, realizations: Sequence[Audited]) -> list[str]:
    """Promises that a run did not keep, with the fix; empty if it kept all.

    Every run promises to balance its energy: to rounding, or as well as its solver does. The
    master equation promises besides that its steps do little work of their own, and estimates the
    error of its force.
    """
    slider, contacts = config.slider, config.contact_kind
    remedies = "; ".join(text for text in (contacts.remedy, slider.remedy) if text)
    remedy = f"; {remedies}" if remedies else ""
    failed = []
    bound = max(contacts.residual_bound, slider.residual_bound(config))
    residual = max((one.energy_residual for one in realizations), key=abs)
    if not abs(residual) <= bound and not math.isnan(residual):
        failed.append(
            f"the energy balance closes to {abs(residual):.1g} of the work of the drive only, and "
            f"should to {bound:.1g}{remedy}"
        )
    work = max((one.step_work for one in realizations), key=abs)
    if abs(work) > contacts.step_work_bound:
        failed.append(
            f"the work of steps is off by {abs(work):.1g} of the work of the drive, and should be "
            f"by {contacts.step_work_bound:.1g} at most{remedy}"
        )
    error = max(one.force_error for one in realizations) / config.contacts.static_force
    if contacts.force_error_bound > 0 and error > contacts.force_error_bound:
        failed.append(
            f"the contact force is uncertain by about {error:.1g} of the static force, and should "
            f"be by {contacts.force_error_bound:.1g} at most{remedy}"
        )
    return failed
