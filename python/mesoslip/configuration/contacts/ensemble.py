"""N independent contacts: the earthquake-like model."""

from __future__ import annotations

from typing import ClassVar

from mesoslip.configuration.contacts.base import ContactKind, Setting, common_parameters
from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.run_tables import Run
from mesoslip.configuration.table import Complaints


class EnsembleContacts(ContactKind):
    """Independent contacts; with [interaction] of strength 0 they have sites on a lattice."""

    kernel_kind: ClassVar[str] = "ensemble"

    @classmethod
    def is_meant(cls, run: Run, contacts: Contacts, interaction: Interaction | None) -> bool:
        if contacts.ageing is not None:
            return False
        return run.engine == "eq" and (interaction is None or interaction.strength == 0)

    @property
    def bytes_per_contact(self) -> int:
        return 260 if self.on_lattice else 150

    def kernel_parameters(self, config: Setting) -> Parameters:
        columns = rows = 0
        if self.interaction is not None:
            columns, rows = self.interaction.columns, self.interaction.rows
        return common_parameters(config) | {"columns": columns, "rows": rows}

    def problems(self, config: Setting) -> Complaints:
        if self.interaction is not None:
            yield from self.interaction.problems(config.contacts)
