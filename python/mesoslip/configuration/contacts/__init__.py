"""Kinds of contacts, each in a file of its own and listed here.

Adding a kind is adding a file with a `ContactKind` and naming it in `KINDS`.
"""

from __future__ import annotations

from mesoslip.configuration.contacts.ageing import AgeingContacts, AgeingPopulations
from mesoslip.configuration.contacts.base import COMMON_KEYS, ContactKind
from mesoslip.configuration.contacts.ensemble import EnsembleContacts
from mesoslip.configuration.contacts.lattice import LatticeContacts
from mesoslip.configuration.contacts.populations import PopulationContacts
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.contacts.thermal import (
    ThermalAgeingContacts,
    ThermalAgeingPopulations,
    ThermalContacts,
    ThermalPopulations,
)
from mesoslip.configuration.load import Load

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


def contact_kind(
    engine: str,
    given: frozenset[str],
    interaction: Interaction | None,
    load: Load,
) -> ContactKind:
    """The kind of contacts of an engine that answers most of the given keys; the others are among
    its problems."""
    kinds = [kind for kind in KINDS if kind.engine == engine and kind.features <= given]
    return max(kinds, key=lambda kind: len(kind.features))(interaction, load)


def is_in_both_engines(given: frozenset[str]) -> bool:
    """Whether each engine has a kind of contacts that answers all given keys."""
    features = given - COMMON_KEYS
    answers = (one for one in KINDS if one.features <= features <= one.features | one.options)
    return {kind.engine for kind in answers} == {"eq", "me"}
