"""The interface of the theories of all kinds of contacts, whose base refuses every question."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, NoReturn

from mesoslip.array_types import DataTree
from mesoslip.errors import ConfigError
from mesoslip.quantities import with_unit
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.theory.linear_stability import LinearStability

# Units and meanings of derived quantities.
quantity = named_quantities("""
contact_static_force | N | mean static threshold of a contact, f_s = F_s/N
contact_stiffness | N/m | mean stiffness of a contact, k
break_stretch | m | mean stretch at which a contact breaks, f_s/k
K_star_estimate | N/m | estimate of K*, above which slow sliding without delay is stable, Nk (f_s -
    f_b)/Delta f_s (S48); mesoslip curve computes K*, which depends on the threshold law
contact_mass | kg | mass of a contact, m = rho (A/N) h
contact_spacing | m | distance between neighbours, a = (A/N)^(1/2)
contact_radius | m | radius of a contact
""")

# Keys whose effect every theory has, or states as a limit of its own. A key that is not here and
# not among the features of a theory is one that it does not know.
KNOWN_KEYS = frozenset(
    f"contacts.{key}"
    for key in (
        *("count", "static_force", "stiffness", "area", "film_thickness", "film_density"),
        *("drag", "drag_rate", "delay", "delay_law", "back_force_ratio", "newborn_width"),
        *("coupling", "initial", "reattach", "threshold"),
    )
) | {"load"}


class ContactTheory:
    """Theory of contacts under a slider that slides steadily or slowly.

    A kind overrides the questions that it answers; all others end with a ConfigError that names
    the key which has no theory.

    Attributes
    ----------
    features
        Keys and tables beyond the known ones that the theory accounts for.
    kind_caveat
        What results leave out; empty if nothing.
    """

    features: ClassVar[frozenset[str]] = frozenset()
    kind_caveat: ClassVar[str] = ""

    def __init__(self, config: Config) -> None:
        self.config = config

    @property
    def caveat(self) -> str:
        """What results leave out; empty if nothing."""
        load = self.config.pressing
        given = [self.kind_caveat] if self.kind_caveat else []
        if load.acts:
            given.append(
                f"computed at the constant normal force {with_unit(load.normal_force, 'N')}"
            )
        if not load.is_uniform:
            given.append("computed for blocks that bear the same, not for load.profile")
        return ". ".join(given)

    @property
    def depends_on_velocity(self) -> bool:
        """Whether slow sliding has no force of its own, so that there is no force curve F(X)."""
        self._refuse("no theory of slow sliding")

    def check_force_curve(self) -> None:
        """Refuse contacts without a force curve F(X)."""
        self._refuse("no force curve")

    def check_steady_front(self) -> None:
        """Refuse contacts whose detachment along a row of blocks has no steady fronts."""
        self._refuse("no theory of steady fronts")

    def curve_groups(self) -> dict[str, DataTree]:
        """Groups of the output of ``mesoslip curve`` beyond those of all kinds, by name."""
        return {}

    def sliding(self, velocity: float | None = None) -> LinearStability:
        """Steady sliding at a velocity [m/s], that of the drive by default, and its stability."""
        del velocity
        self._refuse("no linear stability theory")

    def steady_force(self, velocity: float) -> float:
        """Force of steady sliding at a positive velocity [m/s], with delay and drag [N]."""
        del velocity
        self._refuse("no theory of steady sliding")

    def creep_force(self, velocity: float) -> float:
        """Force under which a slider creeps at a velocity [m/s], its damping included [N]."""
        del velocity
        self._refuse("no theory of creep")

    def creep_velocity(self, force: float) -> float:
        """Velocity of steady creep under a positive force [N]; NaN if none bears it [m/s]."""
        del force
        self._refuse("no theory of creep")

    def quantities(self) -> Iterator[Quantity]:
        """Quantities that follow from the keys of the contacts, for ``mesoslip info``."""
        self._refuse("no derived quantities")

    def _refuse(self, missing: str) -> NoReturn:
        """Raise an error that names the key without a theory."""
        key, *others = sorted(self.config.given_contact_keys - KNOWN_KEYS) or [""]
        if not key:
            message = f"have {missing}"
        elif others:
            message = f"has {missing} together with {' and '.join(others)}: leave one of them out"
        else:
            message = f"has {missing}: leave it out"
        raise ConfigError.of(key or "contacts", message)

    @property
    def K_star_estimate(self) -> float:  # noqa: N802
        """Estimate S48 of K* [N/m]."""
        contacts = self.config.contacts
        rise = 1 - contacts.back_force_ratio
        return contacts.stiffness * rise / contacts.threshold.relative_width

    def common_quantities(self) -> Iterator[Quantity]:
        """Quantities that contacts of all known kinds have."""
        contacts = self.config.contacts
        static, stiffness = contacts.contact_static_force, contacts.contact_stiffness
        yield quantity("contact_static_force", static)
        yield quantity("contact_stiffness", stiffness)
        yield quantity("break_stretch", contacts.break_stretch)
        if contacts.contact_mass > 0:
            yield quantity("contact_mass", contacts.contact_mass)
        if contacts.area is not None:
            area = contacts.area / contacts.count
            yield quantity("contact_spacing", math.sqrt(area))
            yield quantity("contact_radius", math.sqrt(area / math.pi))
        yield Quantity(
            "threshold_acceptance",
            contacts.threshold.probability_above(contacts.min_threshold),
            "1",
            "probability that a drawn threshold exceeds the back force" + self._ages,
        )
        yield quantity("K_star_estimate", self.K_star_estimate)

    # Ages of contacts whose thresholds have to exceed the back force, in words.
    _ages: ClassVar[str] = ""
