"""N contacts on a lattice with forces between neighbours."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.run_tables import Run
from mesoslip.configuration.table import Complaints


class LatticeContacts(ContactKind):
    """Contacts with bonds between neighbours (S25 to S27)."""

    kernel_kind: ClassVar[str] = "lattice"
    bytes_per_contact: ClassVar[int] = 236

    interaction: Interaction

    @classmethod
    def is_meant(cls, run: Run, contacts: Contacts, interaction: Interaction | None) -> bool:
        if contacts.ageing is not None:
            return False
        return run.engine == "eq" and interaction is not None and interaction.strength > 0

    def kernel_parameters(self, config: Setting) -> Parameters:
        return common_parameters(config) | {
            "bond": self.interaction.bond_stiffness(config.contacts),
            "lattice": self.interaction.lattice,
            "columns": self.interaction.columns,
            "rows": self.interaction.rows,
        }

    def problems(self, config: Setting) -> Complaints:
        yield from self.interaction.problems(config.contacts)
