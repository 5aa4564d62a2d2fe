"""Kinds of contacts, each in a file of its own and listed here.

Adding a kind is adding a file with a `ContactKind` and naming it in `KINDS`.
"""

from __future__ import annotations

from mesoslip.configuration.contacts.ageing import AgeingContacts, AgeingPopulations
from mesoslip.configuration.contacts.base import ContactKind
from mesoslip.configuration.contacts.ensemble import EnsembleContacts
from mesoslip.configuration.contacts.lattice import LatticeContacts
from mesoslip.configuration.contacts.populations import PopulationContacts
from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.contacts.thermal import (
    ThermalAgeingContacts,
    ThermalAgeingPopulations,
    ThermalContacts,
    ThermalPopulations,
)
from mesoslip.configuration.tables import Run

KINDS: tuple[type[ContactKind], ...] = (
    ThermalAgeingContacts,
    ThermalAgeingPopulations,
    ThermalContacts,
    ThermalPopulations,
    AgeingContacts,
    AgeingPopulations,
    EnsembleContacts,
    LatticeContacts,
    PopulationContacts,
)


def contact_kind(run: Run, contacts: Contacts, interaction: Interaction | None) -> ContactKind:
    """The kind of contacts that the tables of a configuration describe."""
    kind = next(kind for kind in KINDS if kind.is_meant(run, contacts, interaction))
    return kind(interaction)
