"""The tables of the contacts: [contacts], [contacts.threshold], and [interaction]."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, StrictBool, model_validator

from mesoslip.configuration.table import (
    Area,
    Complaint,
    Complaints,
    Density,
    Force,
    Length,
    Number,
    Rate,
    Stiffness,
    Table,
    Time,
    Whole,
    choice,
    problem,
)
from mesoslip.configuration.threshold_law import ThresholdLaw
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

Array = NDArray[np.float64]

# Choices, by the names that the kernels know.
COUPLINGS = ("scaled", "equal")
AGEING_LAWS = ("relax", "log")
INITIAL_STATES = ("relaxed", "steady", "uniform")
LATTICES = ("triangular", "square")

# Neighbours of a contact on each lattice.
NEIGHBOURS = {"triangular": 6, "square": 4}

# Part of the thresholds that must be above the back force, or drawing them takes too long.
LEAST_ACCEPTED = 0.5

# Keys of [contacts.ageing] that belong to one law each.
AGEING_KEYS = {"relax": ("young_force_ratio", "young_relative_width"), "log": ("growth",)}
# Age of contacts that have always been there [s].
ALWAYS = 1e300

# Stiffness of all bonds of a contact over its own, beyond which the force that breaks it, the
# difference of what it and what its neighbours pull, has fewer than ten digits.
STRONGEST_BONDS = 1e6


class Threshold(Table):
    """Law of the relative thresholds: mean 1, and a standard deviation."""

    law: Annotated[str, choice(LAWS)] = "gaussian"
    """Law of the relative thresholds, whose mean is 1."""
    relative_width: Annotated[Number, Field(gt=0)]
    """Their standard deviation, Δf_s/f_s."""

    @model_validator(mode="after")
    def _width_that_is_possible(self) -> Self:
        wrong = self.kind.width_problem(self.relative_width)
        if wrong:
            raise problem("relative_width", wrong)
        return self

    @property
    def kind(self) -> ThresholdLawKind:
        """What there is to know of the law."""
        return LAWS[self.law]

    @property
    def kernel_parameters(self) -> dict[str, float | str]:
        """What the kernel is told of the law."""
        return {"threshold_law": self.law, **self.kind.kernel_parameters(self)}

    def probability_above(self, threshold: float) -> float:
        """Probability that a draw of the law is above a relative threshold."""
        # A law cut off there would not exist if there were none.
        law = ThresholdLaw(self.law, self.relative_width)
        return law.acceptance * float(law.survival(threshold))


class Ageing(Table):
    """How the threshold of a contact changes with its age (model section 9).

    With the law `relax` the static force and the relative width of [contacts] are those of the old,
    with `log` they are those at birth. Contacts of the start of a run have just these thresholds,
    unless ``initial_age`` says how old they are.
    """

    law: Annotated[str, choice(AGEING_LAWS)] = "relax"
    """`relax`: from young to old exponentially; `log`: growth with the logarithm of the age."""
    time: Annotated[Time, Field(gt=0)]
    """Time scale of ageing, τ_a."""
    young_force_ratio: Annotated[Number, Field(gt=0)] | None = None
    """With `relax`: mean threshold of the young over that of the old."""
    young_relative_width: Annotated[Number, Field(gt=0)] | None = None
    """With `relax`: standard deviation of the thresholds of the young over their mean."""
    growth: Annotated[Number, Field(ge=0)] | None = None
    """With `log`: β of the mean threshold f_s [1 + β ln(1 + age/time)]."""
    initial_age: Annotated[Time, Field(ge=0)] | None = None
    """Age of the contacts at the start; by default old with `relax`, just born with `log`."""

    @model_validator(mode="after")
    def _keys_of_the_law(self) -> Self:
        for law, keys in AGEING_KEYS.items():
            for key in keys:
                is_given = getattr(self, key) is not None
                if is_given and law != self.law:
                    raise problem(key, f'is for law = "{law}", not "{self.law}"')
                if not is_given and law == self.law:
                    raise problem(key, f'needed for law = "{law}"')
        return self

    @property
    def start_age(self) -> float:
        """Age of the contacts at the start of a run [s]."""
        if self.initial_age is not None:
            return self.initial_age
        return ALWAYS if self.law == "relax" else 0.0

    def kernel_parameters(self) -> dict[str, float | str]:
        """What the kernel is told of the law."""
        return {
            "ageing": self.law,
            "ageing_time": self.time,
            "initial_age": self.start_age,
            **{key: getattr(self, key) for key in AGEING_KEYS[self.law]},
        }

    def threshold(self, configured: ArrayLike, width: float, age: ArrayLike) -> Array:
        """Thresholds at an age [s] of contacts with configured ones, both over the static force;
        ``width`` is the relative width of the configured ones."""
        old, relative_age = np.asarray(configured), np.asarray(age) / self.time
        if self.law == "log":
            return np.asarray(old * (1 + (self.growth or 0.0) * np.log1p(relative_age)))
        ratio, young_width = self.young_force_ratio or 1.0, self.young_relative_width or width
        young = ratio * (1 + young_width * (old - 1) / width)
        return np.asarray(old + (young - old) * np.exp(-relative_age))

    def configured(self, threshold: float, width: float, age: float) -> float:
        """Configured threshold of the contact that has a threshold at an age."""
        at_zero, at_one = self.threshold([0.0, 1.0], width, age)
        return float((threshold - at_zero) / (at_one - at_zero))


class Contacts(Table):
    """The contacts of the interface; forces, stiffness and area are those of all together."""

    count: Annotated[Whole, Field(ge=1, lt=2**31)]
    """Number of contacts, N."""
    static_force: Annotated[Force, Field(gt=0)]
    """Mean static threshold of all contacts together, F_s = N f_s. They do not break at once, so
    that a run comes to less: `F_peak` of `mesoslip curve`."""
    stiffness: Annotated[Stiffness, Field(gt=0)]
    """Stiffness of all contacts together, Nk."""
    area: Annotated[Area, Field(gt=0)] | None = None
    """Real area of contact, A, which the contacts fill: each has A/N. It enters the mass of a
    contact, ρ (A/N) h, with that its drag, and the distance between neighbours, (A/N)^(1/2)."""
    film_thickness: Annotated[Length, Field(gt=0)] | None = None
    """Thickness of the film between the surfaces, h; with area and density the mass of the
    contacts."""
    film_density: Annotated[Density, Field(gt=0)] | None = None
    """Density of the film, ρ."""
    drag_rate: Annotated[Rate, Field(ge=0)] = 0.0
    """Rate η of the drag m η V of a detached contact; needs area, thickness and density of the
    film."""
    delay: Annotated[Time, Field(ge=0)] = 0.0
    """Time between letting go and attaching again, τ_d."""
    back_force_ratio: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Force at which a contact attaches over the mean threshold, f_b/f_s."""
    coupling: Annotated[str, choice(COUPLINGS)] = "scaled"
    """`scaled`: stiffness goes with the root of the threshold, mass with the threshold; `equal`:
    all contacts have the same."""
    initial: Annotated[str, choice(INITIAL_STATES)] = "relaxed"
    """`relaxed`: no contact bears force; `steady`: as in slow sliding; `uniform`: stretches uniform
    up to breaking."""
    reattach: StrictBool = True
    """Whether a broken contact attaches again; false makes a bundle of fibres."""
    threshold: Threshold
    """Law of the thresholds."""
    ageing: Ageing | None = None
    """How thresholds change with age; by default they do not."""

    @model_validator(mode="after")
    def _mass_for_drag(self) -> Self:
        if self.drag_rate > 0:
            for key in ("area", "film_thickness", "film_density"):
                if getattr(self, key) is None:
                    raise problem(key, "needed for the mass of the contacts, as drag_rate is given")
        return self

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        above = self.threshold.probability_above(self.least_threshold)
        if above < LEAST_ACCEPTED:
            raise problem(
                "back_force_ratio",
                f"only {above:.3g} of the thresholds{self._of_the_young} are above the back force, "
                f"at least {LEAST_ACCEPTED} must be: choose a lower back_force_ratio or a narrower "
                f"threshold law{', or stronger young contacts' if self._of_the_young else ''}",
            )
        return self

    @property
    def _of_the_young(self) -> str:
        """Whose thresholds those are that contacts attach with, if they are not all the same."""
        return " of young contacts" if self.least_threshold > self.back_force_ratio else ""

    @property
    def least_threshold(self) -> float:
        """Configured threshold over the mean at or below which a contact cannot attach, or would
        let go of itself."""
        if self.ageing is None:
            return self.back_force_ratio
        young = self.ageing.configured(self.back_force_ratio, self.threshold.relative_width, 0.0)
        return max(self.back_force_ratio, young)

    @property
    def contact_static_force(self) -> float:
        """f_s [N]."""
        return self.static_force / self.count

    @property
    def contact_stiffness(self) -> float:
        """k [N/m]."""
        return self.stiffness / self.count

    @property
    def contact_mass(self) -> float:
        """m = ρ (A/N) h [kg]; 0 where the film is not described."""
        if self.area is None or self.film_thickness is None or self.film_density is None:
            return 0.0
        return self.film_density * self.area / self.count * self.film_thickness

    @property
    def contact_drag(self) -> float:
        """m η [N s/m]."""
        return self.contact_mass * self.drag_rate

    @property
    def break_stretch(self) -> float:
        """Mean stretch at which a contact breaks, f_s/k [m]."""
        return self.static_force / self.stiffness


class Interaction(Table):
    """Forces between contacts that are neighbours on a lattice without edges (S25 to S27)."""

    strength: Number
    """Dimensionless strength ξ = g/(f_s a⁴) of the repulsion g/r³ between neighbours at the
    distance a."""
    lattice: Annotated[str, choice(LATTICES)] = "triangular"
    """Lattice of the contacts, without edges."""
    columns: Annotated[Whole, Field(ge=2)]
    """Contacts in a row."""
    rows: Annotated[Whole, Field(ge=2)]
    """Rows; columns times rows is the number of contacts. Even on a triangular lattice."""

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        if self.strength < 0:
            raise problem(
                "strength",
                "must not be negative, as neighbours repel each other: where they attract, "
                "k + G z may be negative, and no stretch has the force at which a contact attaches "
                f"(is {self.strength:g})",
            )
        return self

    @model_validator(mode="after")
    def _rows_match(self) -> Self:
        if self.lattice == "triangular" and self.rows % 2:
            raise problem(
                "rows",
                "must be even on a triangular lattice without edges, whose odd rows are half a "
                f"place aside (is {self.rows})",
            )
        return self

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
        """What is wrong between the lattice and the contacts that it is to hold."""
        places = self.columns * self.rows
        if places != contacts.count:
            yield Complaint(
                "interaction.columns",
                f"times rows must be contacts.count: {self.columns} x {self.rows} = "
                f"{places}, not {contacts.count}",
                self.columns,
            )
        if contacts.area is None:
            yield Complaint(
                "contacts.area", "needed for the distance between neighbours, a = (A/N)^(1/2)"
            )
        relative = self.neighbours * self.bond_stiffness(contacts) / contacts.contact_stiffness
        if relative > STRONGEST_BONDS:
            strongest = self.strength * (STRONGEST_BONDS / relative)
            yield Complaint(
                "interaction.strength",
                "so strong that a contact cannot attach: the force at which it does, (k + G z) x "
                "less the pull of its neighbours, is a difference of terms "
                f"{relative:.1g} times as large, without digits enough; at most {strongest:.3g}",
                self.strength,
            )
