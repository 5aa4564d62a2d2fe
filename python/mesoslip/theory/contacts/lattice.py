"""Theory of contacts with forces between neighbours: that of contacts without them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

from mesoslip.configuration.contacts.lattice import lattice_of
from mesoslip.theory.contacts.base import ContactTheory
from mesoslip.theory.contacts.plain import PlainTheory
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.theory.linear_stability import LinearStability

# Units and meanings of derived quantities.
quantity = named_quantities("""
bond_stiffness | N/m | stiffness between neighbours, G = 3 xi f_s/a
bond_ratio | 1 | stiffness of all bonds of a contact over its own, G z/k
""")

# Quantities of contacts without neighbours.
WITHOUT_NEIGHBOURS = ("K_star_estimate", "mean_life", "F_steady", "F_steady_drive")


class LatticeTheory(PlainTheory):
    """Contacts on a lattice (S25 to S27), whose force curve is known without interaction only."""

    features: ClassVar[frozenset[str]] = frozenset({"interaction"})
    kind_caveat: ClassVar[str] = (
        "computed without [interaction]: the master equation has no neighbours"
    )

    def sliding(self, velocity: float | None = None) -> LinearStability:
        return ContactTheory.sliding(self, velocity)

    def quantities(self) -> Iterator[Quantity]:
        for one in super().quantities():
            is_without = one.name in WITHOUT_NEIGHBOURS
            yield one._replace(meaning=f"{one.meaning}; without interaction") if is_without else one
        contacts, lattice = self.config.contacts, lattice_of(self.config)
        bond = lattice.bond_stiffness(contacts)
        yield quantity("bond_stiffness", bond)
        yield quantity("bond_ratio", lattice.neighbours * bond / contacts.contact_stiffness)
