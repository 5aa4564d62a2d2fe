"""The table [interaction]: contacts on a lattice, with forces between neighbours."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from mesoslip.array_types import Array
from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.table import (
    Complaint,
    Complaints,
    Number,
    Table,
    Whole,
    choice,
    problem,
)

# Lattices, and the neighbours of a contact on each.
NEIGHBOURS = {"triangular": 6, "square": 4}
LATTICES = tuple(NEIGHBOURS)

# Maximum stiffness of all bonds of a contact, relative to its own: beyond it the breaking force, a
# difference of its own force and its neighbours', has fewer than ten digits.
MAX_BOND_RATIO = 1e6


class Interaction(Table):
    """Forces between neighbouring contacts on a lattice with periodic boundaries (S25 to S27)."""

    strength: Number
    """Dimensionless strength ξ = g/(f_s a⁴) of the repulsion g/r³ between neighbours at distance
    a."""
    lattice: Annotated[str, choice(LATTICES)] = "triangular"
    """Lattice of the contacts, with periodic boundaries."""
    columns: Annotated[Whole, Field(ge=2)]
    """Number of contacts in a row."""
    rows: Annotated[Whole, Field(ge=2)]
    """Number of rows, even on a triangular lattice; columns × rows = contacts.count."""

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        if self.strength < 0:
            raise problem(
                "strength",
                "must not be negative: with attracting neighbours k + G z may be negative, and no "
                f"stretch has the force at which a contact attaches (is {self.strength:g})",
            )
        return self

    @model_validator(mode="after")
    def _rows_match(self) -> Self:
        if self.lattice == "triangular" and self.rows % 2:
            raise problem(
                "rows",
                "must be even on a periodic triangular lattice, whose odd rows are shifted by half "
                f"a site (is {self.rows})",
            )
        return self

    @property
    def acts(self) -> bool:
        """Whether neighbours exert forces; without, contacts only have sites."""
        return self.strength > 0

    @property
    def sites(self) -> tuple[Array, Array]:
        """Sites of the contacts in units of their distance, each of shape (rows, columns)."""
        row, column = np.indices((self.rows, self.columns), dtype=float)
        if self.lattice == "square":
            return column, row
        return column + 0.5 * (row % 2), row * np.sqrt(0.75)

    @property
    def neighbours(self) -> int:
        """Number of neighbours of a contact."""
        return NEIGHBOURS[self.lattice]

    def bond_stiffness(self, contacts: Contacts) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without an area."""
        if contacts.area is None:
            return 0.0
        spacing = math.sqrt(contacts.area / contacts.count)
        return 3 * self.strength * contacts.contact_static_force / spacing

    def problems(self, contacts: Contacts) -> Complaints:
        """Conflicts between the lattice and its contacts."""
        sites = self.columns * self.rows
        if sites != contacts.count:
            yield Complaint(
                "interaction.columns",
                f"times rows must be contacts.count: {self.columns} x {self.rows} = "
                f"{sites}, not {contacts.count}",
                self.columns,
            )
        if contacts.area is None:
            yield Complaint(
                "contacts.area", "needed for the distance between neighbours, a = (A/N)^(1/2)"
            )
        relative = self.neighbours * self.bond_stiffness(contacts) / contacts.contact_stiffness
        if relative > MAX_BOND_RATIO:
            max_strength = self.strength * (MAX_BOND_RATIO / relative)
            yield Complaint(
                "interaction.strength",
                f"must be at most {max_strength:.3g}: the force at which a contact attaches is a "
                f"difference of forces {relative:.1g} times as large, which double precision does "
                "not resolve",
                self.strength,
            )
