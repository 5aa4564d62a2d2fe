"""The tables of a configuration file: what each may hold, in SI units.

Adding a key is adding a field; adding a kind of slider is adding a model to `Slider`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictInt,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from mesoslip.configuration.units import to_si

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Work of a run by series, steps times layers, beyond which stiff formulas take over.
MOST_SERIES_WORK = 1e11


def _quantity(unit: str, example: str) -> Any:
    return BeforeValidator(partial(to_si, unit=unit, example=example))


Time = Annotated[float, _quantity("s", "0.5 ms")]
Velocity = Annotated[float, _quantity("m/s", "0.1 um/s")]
Mass = Annotated[float, _quantity("kg", "1.47 g")]
Stiffness = Annotated[float, _quantity("N/m", "97 N/m")]
Rate = Annotated[float, _quantity("1/s", "51.4 1/s")]
Force = Annotated[float, _quantity("N", "18 uN")]
ForceRate = Annotated[float, _quantity("N/s", "1 uN/s")]
Area = Annotated[float, _quantity("m^2", "1e-10 m^2")]
Length = Annotated[float, _quantity("m", "3.5 nm")]
Density = Annotated[float, _quantity("kg/m^3", "956 kg/m^3")]
Pressure = Annotated[float, _quantity("Pa", "70 GPa")]
Number = Annotated[float, _quantity("1", "0.2")]


class Table(BaseModel):
    """A table of the file: unknown keys are errors, and nothing changes after checking."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _problem(key: str, message: str) -> PydanticCustomError:
    return PydanticCustomError("table", "{message}", {"key": key, "message": message})


class Run(Table):
    """What is computed, for how long, and with which random numbers.

    A run is over after its duration, or as soon as it has had as many avalanches as are wanted.
    """

    engine: Literal["eq", "me"] = "eq"
    duration: Annotated[Time, Field(gt=0)] | None = None
    drive_displacement: Annotated[Length, Field(gt=0)] | None = None
    avalanches: Annotated[StrictInt, Field(ge=1, lt=2**62)] | None = None
    realizations: Annotated[StrictInt, Field(ge=1, lt=2**31)] = 1
    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] = 1
    resolution: Annotated[Number, Field(gt=0, le=1)] = 0.25


class Stage(Table):
    """A stage of the drive: a constant velocity, of either sign or zero, for a time."""

    duration: Annotated[Time, Field(gt=0)]
    velocity: Velocity


class Drive(Table):
    """How the drive moves: one velocity, or stages one after another; or a force that grows."""

    velocity: Velocity | None = None
    stage: tuple[Stage, ...] | None = None
    force_rate: ForceRate | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if [self.velocity, self.stage, self.force_rate].count(None) != 2:
            raise _problem(
                "velocity",
                "give either a velocity or [[drive.stage]] tables, or a force_rate to a "
                "quasistatic slider",
            )
        if self.force_rate == 0:
            raise _problem("force_rate", "must not be 0")
        if self.stage is not None and not self.stage:
            raise _problem("stage", "must have at least one stage")
        return self


class RigidSlider(Table):
    """A rigid block on a spring; damping acts on its velocity relative to the running mean."""

    kind: Literal["rigid"] = "rigid"
    mass: Annotated[Mass, Field(gt=0)]
    stiffness: Annotated[Stiffness, Field(gt=0)]
    damping_ratio: Annotated[Number, Field(ge=0)] | None = None
    damping: Annotated[Rate, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _one_damping(self) -> Self:
        if self.damping is not None and self.damping_ratio is not None:
            raise _problem("damping", "give either damping or damping_ratio, not both")
        return self

    @property
    def omega_s(self) -> float:
        """Setup frequency √(K/M) [1/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_rate(self) -> float:
        """η_S [1/s]."""
        if self.damping is not None:
            return self.damping
        return (self.damping_ratio or 0.0) * self.omega_s


class Base(Table):
    """The lower body: a mass on a spring to the ground, which damping holds back."""

    mass: Annotated[Mass, Field(gt=0)]
    stiffness: Annotated[Stiffness, Field(gt=0)]
    damping: Annotated[Rate, Field(ge=0)] = 0.0


class Solver(Table):
    """How layers are integrated: by series, exact to rounding, or by CVODE's formulas."""

    method: Literal["auto", "series", "adams", "bdf"] = "auto"
    relative_tolerance: Annotated[Number, Field(ge=1e-13, le=1e-2)] = 1e-8


class Cantilever(Table):
    """A round rod that is held at one end, pulled at the other."""

    length: Annotated[Length, Field(gt=0)]
    radius: Annotated[Length, Field(gt=0)]
    density: Annotated[Density, Field(gt=0)]
    young_modulus: Annotated[Pressure, Field(gt=0)]

    @property
    def mass(self) -> float:
        """M = ρ π r² L [kg]."""
        return self.density * math.pi * self.radius**2 * self.length

    @property
    def stiffness(self) -> float:
        """K = 3 E I/L³ with I = π r⁴/4 [N/m]."""
        return 3 * self.young_modulus * math.pi * self.radius**4 / 4 / self.length**3

    @property
    def bending_frequency(self) -> float:
        """Lowest frequency of bending, (β₁/L)² √(E I/(ρ S)), β₁ = 1.875 [1/s]."""
        lowest = 1.8751040687119611
        stiffness_over_mass = self.young_modulus * self.radius**2 / (4 * self.density)
        return (lowest / self.length) ** 2 * math.sqrt(stiffness_over_mass)


class LayeredSlider(Table):
    """An elastic block: layers joined by springs, of which the first bears the contacts."""

    kind: Literal["layered"]
    mass: Annotated[Mass, Field(gt=0)]
    stiffness: Annotated[Stiffness, Field(gt=0)]
    layers: Annotated[StrictInt, Field(ge=1, le=100_000)]
    layer_damping: Annotated[Rate, Field(ge=0)] = 0.0
    base: Base | None = None
    solver: Solver = Solver()
    cantilever: Cantilever | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_cantilever(cls, tables: Any) -> Any:
        """Mass and stiffness of the cantilever, unless they are given."""
        if not isinstance(tables, Mapping) or not isinstance(tables.get("cantilever"), Mapping):
            return tables
        try:
            cantilever = Cantilever.model_validate(tables["cantilever"])
        except ValidationError:
            return tables
        return {"mass": cantilever.mass, "stiffness": cantilever.stiffness, **tables}

    @property
    def omega_s(self) -> float:
        """Setup frequency √(K/M) [1/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies of the chain while no contact is pinned, on a fixed base [1/s]."""
        n = self.layers
        return tuple(
            2 * n * self.omega_s * math.sin((2 * j - 1) * math.pi / (2 * (2 * n + 1)))
            for j in range(1, n + 1)
        )

    def solver_method(self, config: Config) -> Literal["series", "adams", "bdf"]:
        """The method, chosen for a run if it is "auto".

        Series need a few steps for each period of the fastest rate, however little it matters to
        the motion: where that would take too long, BDF steps over it.
        """
        if self.solver.method != "auto":
            return self.solver.method
        if config.run.engine == "me":
            return "series"
        mass = self.mass / self.layers
        drag = config.contacts.count * config.contacts.contact_drag
        rate = 2 * self.layers * self.omega_s
        rate += math.sqrt(config.contacts.stiffness / mass) + drag / mass + 4 * self.layer_damping
        if self.base is not None:
            stiffness = self.base.stiffness + config.contacts.stiffness
            rate += math.sqrt(stiffness / self.base.mass) + drag / self.base.mass
            rate += self.base.damping
        work = config.expected_duration * rate * (self.layers + 10)
        return "series" if work < MOST_SERIES_WORK else "bdf"


class PrescribedSlider(Table):
    """A block that goes where the drive goes, K = ∞."""

    kind: Literal["prescribed"] = "prescribed"


class QuasistaticSlider(Table):
    """A block without inertia that follows the stable equilibrium of spring and contacts.

    Its contacts attach at once and bear no drag, whatever their delay and film. A drive by force
    needs no spring.
    """

    kind: Literal["quasistatic"] = "quasistatic"
    stiffness: Annotated[Stiffness, Field(gt=0)] | None = None


SLIDERS: dict[str, type[Table]] = {
    "rigid": RigidSlider,
    "layered": LayeredSlider,
    "prescribed": PrescribedSlider,
    "quasistatic": QuasistaticSlider,
}


def _slider_kind(value: Any) -> Any:
    if isinstance(value, Mapping):
        return value.get("kind", "rigid")
    return getattr(value, "kind", "rigid")


Slider = Annotated[
    Annotated[RigidSlider, Tag("rigid")]
    | Annotated[LayeredSlider, Tag("layered")]
    | Annotated[PrescribedSlider, Tag("prescribed")]
    | Annotated[QuasistaticSlider, Tag("quasistatic")],
    Discriminator(_slider_kind),
]


class Threshold(Table):
    """Law of the relative thresholds: mean 1, and a standard deviation."""

    law: Literal["gaussian", "uniform", "lognormal", "weibull", "exponential"] = "gaussian"
    relative_width: Annotated[Number, Field(gt=0)]

    @model_validator(mode="after")
    def _thresholds_positive(self) -> Self:
        widest = {"uniform": 1 / math.sqrt(3), "exponential": 1.0}.get(self.law, 20.0)
        if self.relative_width > widest * (1 + 1e-4):
            raise _problem(
                "relative_width",
                f"must be at most {widest:.4g} for the {self.law} law"
                + (", whose least threshold would be negative" if widest < 20 else ""),
            )
        return self

    def probability_above(self, threshold: float) -> float:
        """Probability that a draw of the law is above a relative threshold."""
        width = self.relative_width
        if self.law == "gaussian":
            return 0.5 * math.erfc((threshold - 1) / (math.sqrt(2) * width))
        if self.law == "uniform":
            return min(1.0, max(0.0, 0.5 * (1 - (threshold - 1) / (math.sqrt(3) * width))))
        if self.law == "exponential":
            return min(1.0, math.exp(-(threshold - 1 + width) / width))
        from mesoslip.configuration.threshold_law import ThresholdLaw

        return float(ThresholdLaw(self.law, width).survival(threshold))


class Contacts(Table):
    """The contacts of the interface; forces, stiffness and area are those of all together."""

    count: Annotated[StrictInt, Field(ge=1, lt=2**31)]
    static_force: Annotated[Force, Field(gt=0)]
    stiffness: Annotated[Stiffness, Field(gt=0)]
    area: Annotated[Area, Field(gt=0)] | None = None
    film_thickness: Annotated[Length, Field(gt=0)] | None = None
    film_density: Annotated[Density, Field(gt=0)] | None = None
    drag_rate: Annotated[Rate, Field(ge=0)] = 0.0
    delay: Annotated[Time, Field(ge=0)] = 0.0
    back_force_ratio: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    coupling: Literal["scaled", "equal"] = "scaled"
    initial: Literal["relaxed", "steady", "uniform"] = "relaxed"
    reattach: StrictBool = True
    threshold: Threshold

    @model_validator(mode="after")
    def _mass_for_drag(self) -> Self:
        if self.drag_rate > 0:
            for key in ("area", "film_thickness", "film_density"):
                if getattr(self, key) is None:
                    raise _problem(
                        key, "needed for the mass of the contacts, as drag_rate is given"
                    )
        return self

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        least = 0.5
        above = self.threshold.probability_above(self.back_force_ratio)
        if above < least:
            raise _problem(
                "back_force_ratio",
                f"only {above:.3g} of the thresholds are above the back force, at least {least} "
                "must be: choose a lower back_force_ratio or a narrower threshold law",
            )
        return self

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


class Interaction(Table):
    """Forces between contacts that are neighbours on a lattice without edges (S25 to S27)."""

    strength: Annotated[Number, Field(le=1e100)]
    lattice: Literal["triangular", "square"] = "triangular"
    columns: Annotated[StrictInt, Field(ge=2)]
    rows: Annotated[StrictInt, Field(ge=2)]

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        if self.strength < 0:
            raise _problem(
                "strength",
                "must not be negative, as neighbours repel each other: where they attract, "
                "k + G z may be negative, and no stretch has the force at which a contact attaches "
                f"(is {self.strength:g})",
            )
        return self

    @model_validator(mode="after")
    def _rows_match(self) -> Self:
        if self.lattice == "triangular" and self.rows % 2:
            raise _problem(
                "rows",
                "must be even on a triangular lattice without edges, whose odd rows are half a "
                f"place aside (is {self.rows})",
            )
        return self

    @property
    def neighbours(self) -> int:
        """Number of neighbours of a contact."""
        return {"triangular": 6, "square": 4}[self.lattice]


class Output(Table):
    """What is recorded; sliders without inertia have no slips, whatever ``slip_interval``."""

    interval: Annotated[Time, Field(gt=0)] | None = None
    slip_interval: Annotated[Time, Field(gt=0)] | None = None
    slip_velocity: Annotated[Velocity, Field(gt=0)] | None = None
    layers: StrictBool = False
    avalanche_size: Annotated[StrictInt, Field(ge=1, lt=2**53)] | None = None
    snapshots: tuple[Annotated[Time, Field(ge=0)], ...] = ()
    snapshot_size: Annotated[StrictInt, Field(ge=1, lt=2**53)] | None = None


class Curve(Table):
    """The force curve of the master equation, for ``mesoslip curve``."""

    length: Annotated[Length, Field(gt=0)] | None = None
    tolerance: Annotated[Number, Field(ge=1e-14, lt=1)] = 1e-10
    newborn_width: Annotated[Length, Field(ge=0)] = 0.0
    drive_displacement: Length | None = None
    density_at: tuple[Annotated[Length, Field(ge=0)], ...] = ()
