"""Theory of each kind of contacts, in a file of its own and listed here.

A kind without a theory is one that `ContactTheory` refuses to answer for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mesoslip.theory.contacts.ageing import AgeingTheory
from mesoslip.theory.contacts.base import KNOWN_KEYS, ContactTheory
from mesoslip.theory.contacts.lattice import LatticeTheory
from mesoslip.theory.contacts.plain import PlainTheory
from mesoslip.theory.contacts.thermal import ThermalAgeingTheory, ThermalTheory
from mesoslip.theory.contacts.track import TrackTheory

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

THEORIES: tuple[type[ContactTheory], ...] = (
    AgeingTheory,
    LatticeTheory,
    PlainTheory,
    ThermalAgeingTheory,
    ThermalTheory,
    TrackTheory,
)


def contact_theory(config: Config) -> ContactTheory:
    """The theory of the contacts of a configuration; one that refuses every question if none knows
    all keys that are given."""
    features = config.given_contact_keys - KNOWN_KEYS
    found = (theory for theory in THEORIES if theory.features == features)
    return next(found, ContactTheory)(config)
