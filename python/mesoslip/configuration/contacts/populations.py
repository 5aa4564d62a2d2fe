"""Infinitely many contacts, the master equation."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.table import Complaint, Complaints
from mesoslip.configuration.tables import Run

# Step of the master equation over the mean breaking stretch that can be followed.
FINEST = 2e-5


class PopulationContacts(ContactKind):
    """Populations of contacts that attached at the same place, for N to infinity."""

    kernel_kind: ClassVar[str] = "populations"
    is_discrete: ClassVar[bool] = False
    on_lattice: ClassVar[bool] = False
    bytes_per_contact: ClassVar[int] = 0
    most_realizations: ClassVar[int] = 1
    residual_bound: ClassVar[float] = 1e-3
    force_error_bound: ClassVar[float] = 0.02
    remedy: ClassVar[str] = "a smaller run.resolution helps: the error falls with its square"

    @classmethod
    def is_meant(cls, run: Run, contacts: Contacts, interaction: Interaction | None) -> bool:  # noqa: ARG003
        return run.engine == "me" and contacts.ageing is None

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:
        return common_parameters(config) | {"resolution": config.run.resolution}

    def problems(self, config: Setting) -> Complaints:
        run = config.run
        if self.interaction is not None:
            yield Complaint(
                "interaction",
                'needs engine "eq": the master equation has no neighbours; in the mean, '
                "interaction acts like a narrower law of thresholds "
                "(contacts.threshold.relative_width)",
            )
        if run.realizations > self.most_realizations:
            yield Complaint(
                "run.realizations",
                'must be 1 with engine "me", which leaves nothing to chance',
                run.realizations,
            )
        if run.resolution * config.contacts.threshold.relative_width < FINEST:
            yield Complaint(
                "run.resolution",
                f"times the relative width of the thresholds must be at least {FINEST:g}, or there "
                "are more populations than can be followed",
                run.resolution,
            )
