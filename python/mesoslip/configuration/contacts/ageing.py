"""Contacts whose thresholds change with age, in both engines."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.contacts.populations import PopulationContacts
from mesoslip.configuration.contacts.tables.ageing import Ageing
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Complaint, Complaints


def ageing_of(config: Setting) -> Ageing:
    """The table of ageing of contacts that age."""
    assert config.contacts.ageing is not None
    return config.contacts.ageing


def ageing_problems(config: Setting) -> Complaints:
    """Combinations that ageing contacts refuse, in both engines."""
    contacts = config.contacts
    if contacts.coupling != "equal":
        yield Complaint(
            "contacts.coupling",
            'must be "equal" for contacts that age: their thresholds change while their stiffness '
            'and mass stay, which with "scaled" go with the threshold',
            contacts.coupling,
        )
    if config.interaction is not None:
        yield Complaint(
            "interaction",
            "is not for ageing contacts: the engine predicts the next breaks of neighbours from "
            "thresholds that do not change",
        )
    yield from age_problems(config)


def age_problems(config: Setting) -> Complaints:
    """Those of them that concern ages alone."""
    contacts, ageing = config.contacts, ageing_of(config)
    if contacts.newborn_width > 0:
        yield Complaint(
            "contacts.newborn_width",
            "must be 0 with contacts.ageing: whether a contact attaches is decided by its "
            "configured threshold, not by that of a young one",
            contacts.newborn_width,
        )
    if ageing.initial_age is not None and contacts.initial != "relaxed":
        yield Complaint(
            "contacts.ageing.initial_age",
            'needs contacts.initial = "relaxed": in other states contacts bear forces up to the '
            "configured thresholds, which may exceed those of young contacts",
            ageing.initial_age,
        )


class AgeingContacts(ContactKind):
    """Independent ageing contacts, simulated one by one."""

    kernel_kind: ClassVar[str] = "ageing"
    engine: ClassVar[str] = "eq"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.ageing"})
    bytes_per_contact: ClassVar[int] = 190
    # Breaks are predicted; the kernel reports the error of the force if one comes late.
    force_error_bound: ClassVar[float] = 1e-9

    def kernel_parameters(self, config: Setting) -> Parameters:
        return (
            common_parameters(config)
            | ageing_of(config).kernel_parameters()
            | {"slider_jumps": int(config.slider.jumps)}
        )

    def _problems(self, config: Setting) -> Complaints:
        yield from ageing_problems(config)


class AgeingPopulations(PopulationContacts):
    """Infinitely many ageing contacts."""

    kernel_kind: ClassVar[str] = "ageing populations"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.ageing"})

    def kernel_parameters(self, config: Setting) -> Parameters:
        return super().kernel_parameters(config) | ageing_of(config).kernel_parameters()

    def _problems(self, config: Setting) -> Complaints:
        yield from super()._problems(config)
        # PopulationContacts refuses interaction already.
        yield from (one for one in ageing_problems(config) if one.key != "interaction")
