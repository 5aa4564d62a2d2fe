"""N contacts on a lattice with forces between neighbours."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Complaints


def lattice_of(config: Setting) -> Interaction:
    """The table of the lattice of contacts with neighbours."""
    assert config.interaction is not None
    return config.interaction


class LatticeContacts(ContactKind):
    """Contacts with bonds between neighbours (S25 to S27)."""

    kernel_kind: ClassVar[str] = "lattice"
    engine: ClassVar[str] = "eq"
    has_neighbours: ClassVar[bool] = True
    features: ClassVar[frozenset[str]] = frozenset({"interaction"})
    options: ClassVar[frozenset[str]] = frozenset({"contacts.renewal", "contacts.track"})
    bytes_per_contact: ClassVar[int] = 236

    interaction: Interaction

    def kernel_parameters(self, config: Setting) -> Parameters:
        return common_parameters(config) | {
            "bond": self.interaction.bond_stiffness(config.contacts),
            "lattice": self.interaction.lattice,
            "columns": self.interaction.columns,
            "rows": self.interaction.rows,
        }

    def _problems(self, config: Setting) -> Complaints:
        yield from self.interaction.problems(config.contacts)
