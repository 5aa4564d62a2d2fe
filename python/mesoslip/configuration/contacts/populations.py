"""Infinitely many contacts: the master equation."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Complaint, Complaints

# Minimum step of the master equation, relative to the mean breaking stretch.
MIN_STEP = 2e-5
# Maximum width of the force at attaching over that of the thresholds.
MAX_NEWBORN_RATIO = 3.0


class PopulationContacts(ContactKind):
    """Populations of contacts that attached at the same displacement, for N → ∞."""

    kernel_kind: ClassVar[str] = "populations"
    engine: ClassVar[str] = "me"
    is_discrete: ClassVar[bool] = False
    on_lattice: ClassVar[bool] = False
    bytes_per_contact: ClassVar[int] = 0
    options: ClassVar[frozenset[str]] = frozenset({"contacts.track", "load"})
    residual_bound: ClassVar[float] = 1e-6
    step_work_bound: ClassVar[float] = 1e-3
    force_error_bound: ClassVar[float] = 0.02
    remedy: ClassVar[str] = "a smaller run.resolution helps: the error falls with its square"

    def kernel_parameters(self, config: Setting) -> Parameters:
        return common_parameters(config) | {"resolution": config.run.resolution}

    def parameters_with(self, config: Setting, resolution: float) -> Parameters:
        return self.kernel_parameters(config) | {"resolution": resolution}

    def _problems(self, config: Setting) -> Complaints:
        run = config.run
        if self.interaction is not None:
            yield Complaint(
                "interaction",
                'needs engine "eq": the master equation has no neighbours; on average, '
                "interaction acts like a smaller contacts.threshold.relative_width: "
                "mesoslip mean-field measures it",
            )
        if run.realizations > 1 and config.contacts.track is None:
            yield Complaint(
                "run.realizations",
                'must be 1 with engine "me", which has no random numbers without contacts.track',
                run.realizations,
            )
        if config.contacts.renewal != "redraw":
            yield Complaint(
                "contacts.renewal",
                'must be "redraw" with engine "me": its populations are contacts that attach at '
                "one place, which would have to be told apart by all thresholds that they keep",
                config.contacts.renewal,
            )
        if config.contacts.track is not None and config.contacts.coupling == "table":
            yield Complaint(
                "contacts.track",
                'is not for contacts.coupling = "table" with engine "me", which tabulates their '
                "lives for one strength",
            )
        width = config.contacts.newborn_width
        max_width = MAX_NEWBORN_RATIO * config.contacts.threshold.relative_width
        if width > max_width:
            yield Complaint(
                "contacts.newborn_width",
                f'must be at most {max_width:.3g} with engine "me", {MAX_NEWBORN_RATIO:g} times '
                "contacts.threshold.relative_width: it has populations of some forces at "
                "attaching, which the thresholds must blur",
                width,
            )
        has_table = config.contacts.coupling == "table"
        threshold = config.contacts.threshold
        spread = config.contacts.stretch_width if has_table else threshold.relative_width
        if run.resolution * spread < MIN_STEP:
            name = (
                "the spread of break stretches"
                if has_table
                else "contacts.threshold.relative_width"
            )
            yield Complaint(
                "run.resolution",
                f"times {name} must be at least {MIN_STEP:g}: with less there are too many "
                "populations",
                run.resolution,
            )
