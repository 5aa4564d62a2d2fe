"""The configuration of a run: TOML files, checked, in SI units.

Every table of the file is a model here. Adding a key is adding a field; adding a kind of slider is
adding a model to `Slider`. Everything that is wrong with a file is reported at once.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.units import to_si

# What a run needs for each contact, and for each sample of the trace [bytes].
BYTES_PER_CONTACT = 150
BYTES_PER_SAMPLE = 3 * 7 * 8

# The same for a contact on a lattice, and for an avalanche in the catalogue.
BYTES_PER_CONTACT_ON_LATTICE = 260
BYTES_PER_AVALANCHE = 3 * 10 * 8
BYTES_PER_CONTACT_IN_SNAPSHOT = 3 * 3 * 8

# Tables and keys that the format knows and this version does not.
NOT_YET_KEYS = {"contacts": ("ageing",)}

# Stiffness of all bonds of a contact over its own, beyond which the force that breaks it, the
# difference of what it and what its neighbours pull, has fewer than ten digits.
STRONGEST_BONDS = 1e6

# Step of the master equation over the mean breaking stretch that can be followed.
FINEST = 2e-5

# Work of a run by series, steps times layers, beyond which stiff formulas take over.
MOST_SERIES_WORK = 1e11

# Keys that exclude each other: laid over a base, one replaces the other.
EXCLUSIVE = {
    "run": ("duration", "drive_displacement"),
    "drive": ("velocity", "stage", "force_rate"),
    "slider": ("damping", "damping_ratio"),
}


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
        from mesoslip.threshold import ThresholdLaw

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

    strength: Number
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


class DriveStage(NamedTuple):
    """A stage of the drive as it is run: its duration [s], and its velocity [m/s] or, for a drive
    by force, the rate of the force [N/s]."""

    duration: float
    velocity: float


class Config(Table):
    """A whole configuration."""

    title: StrictStr | None = None
    run: Run
    drive: Drive
    slider: Slider
    contacts: Contacts
    interaction: Interaction | None = None
    output: Output = Output()
    curve: Curve = Curve()

    @property
    def curve_length(self) -> float:
        """Length of the force curve [m]; twenty mean breaking stretches unless given."""
        return self.curve.length or 20 * self.contacts.static_force / self.contacts.stiffness

    @property
    def duration(self) -> float:
        """Duration of the run [s]; infinite if only avalanches end it."""
        if self.run.duration is not None:
            return self.run.duration
        if self.run.drive_displacement is not None and self.drive.velocity:
            return self.run.drive_displacement / abs(self.drive.velocity)
        if self.drive.stage is not None:
            return math.fsum(stage.duration for stage in self.drive.stage)
        return math.inf

    @property
    def expected_duration(self) -> float:
        """Duration of the run [s], or an estimate of it if only avalanches end it."""
        if math.isfinite(self.duration):
            return self.duration
        contacts = self.contacts
        if self.drive.force_rate is not None:
            return contacts.static_force / abs(self.drive.force_rate)
        stiffness = self.spring_stiffness
        stretch = contacts.static_force / contacts.stiffness
        loading = stretch + contacts.static_force / stiffness
        # A break is followed by Nk/K others in the mean, or the slider would not keep up.
        sliding = (self.run.avalanches or 0) * stretch / contacts.count
        sliding *= 1 + contacts.stiffness / stiffness
        return (loading + sliding) / abs(self.drive.velocity or math.nan)

    @property
    def bond_stiffness(self) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without interaction."""
        contacts = self.contacts
        if self.interaction is None or contacts.area is None:
            return 0.0
        spacing = math.sqrt(contacts.area / contacts.count)
        return 3 * self.interaction.strength * contacts.contact_static_force / spacing

    @property
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one that is driven by force."""
        return getattr(self.slider, "stiffness", math.inf) or 0.0

    @property
    def has_avalanches(self) -> bool:
        """Whether avalanches are recorded: breaks may bring about others at once."""
        return self.interaction is not None or isinstance(self.slider, QuasistaticSlider)

    @property
    def drive_stages(self) -> tuple[DriveStage, ...]:
        """Stages of the drive; the last one ends with the run."""
        if self.drive.stage is None:
            rate = self.drive.velocity if self.drive.force_rate is None else self.drive.force_rate
            return (DriveStage(self.duration, rate or 0.0),)
        stages = []
        left = self.duration
        for stage, is_last in zip(
            self.drive.stage, [False] * (len(self.drive.stage) - 1) + [True], strict=True
        ):
            length = left if is_last else min(stage.duration, left)
            stages.append(DriveStage(length, stage.velocity))
            left -= length
            if left <= 0:
                break
        return tuple(stages)

    @property
    def output_interval(self) -> float:
        """Interval of the trace [s]; a ten-thousandth of the run unless given."""
        return self.output.interval or self.expected_duration / 10000

    @classmethod
    def load(cls, path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Config:
        """Read a TOML file and what it is based on, lay overrides over it, and check it.

        Parameters
        ----------
        path
            The file.
        overrides
            Changes such as "contacts.delay=1ms".

        Raises
        ------
        FileError
            If a file cannot be read.
        ConfigError
            If anything in it is wrong.
        """
        path = Path(path)
        return cls.from_dict(_override(_read_toml(path, ()), overrides), source=str(path))

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], source: str = "configuration") -> Config:
        """Check a configuration given as nested tables.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        try:
            config = cls.model_validate(tables)
        except ValidationError as error:
            raise ConfigError(_problems(error, source)) from None
        problems = [Problem(source, *problem) for problem in _cross_checks(config)]
        if problems:
            raise ConfigError(problems)
        return config

    @classmethod
    def from_toml(
        cls, text: str, source: str = "configuration", overrides: Iterable[str] = ()
    ) -> Config:
        """Check a configuration given as the text of a TOML file, with changes laid over it."""
        return cls.from_dict(_override(_parse_toml(text, source), overrides), source)

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables with plain SI numbers."""
        return self.model_dump(exclude_none=True)

    def to_toml(self) -> str:
        """The configuration as the text of a TOML file with plain SI numbers."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())


def _cross_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong between tables: key, message, value."""
    problems = [*_drive_checks(config)]
    if problems:
        yield from problems
        return
    if not (config.expected_duration > 0 and math.isfinite(config.expected_duration)):
        yield "drive", "so slow or so fast that the run has no finite duration", None
        return
    yield from _interaction_checks(config)
    interval = config.output_interval
    if interval > config.duration:
        yield "output.interval", f"must not exceed the duration, {config.duration:g} s", interval
    finer = config.output.slip_interval
    if finer is not None and finer > interval:
        yield "output.slip_interval", f"must not exceed the interval, {interval:g} s", finer

    if config.run.engine == "me" and config.run.realizations > 1:
        yield (
            "run.realizations",
            'must be 1 with engine "me", which leaves nothing to chance',
            config.run.realizations,
        )
    stretch = config.contacts.static_force / config.contacts.stiffness
    if config.curve.newborn_width > 0.25 * stretch:
        yield (
            "curve.newborn_width",
            "must be a narrow spread, at most a quarter of the mean breaking stretch, "
            f"{0.25 * stretch:.3g} m",
            config.curve.newborn_width,
        )

    if config.curve.newborn_width > 0 and config.contacts.initial == "steady":
        yield (
            "curve.newborn_width",
            'must be 0 with contacts.initial = "steady", the state of contacts without a spread',
            config.curve.newborn_width,
        )
    if isinstance(config.slider, LayeredSlider):
        method = config.slider.solver.method
        if config.run.engine == "me" and method not in {"auto", "series"}:
            yield (
                "slider.solver.method",
                'must be "series" with engine "me", whose contacts change their law at every step',
                method,
            )
    if config.run.engine == "me":
        fineness = config.run.resolution * config.contacts.threshold.relative_width
        if fineness < FINEST:
            yield (
                "run.resolution",
                f"times the relative width of the thresholds must be at least {FINEST:g}, or there "
                "are more populations than can be followed",
                config.run.resolution,
            )
    if config.output.layers and not isinstance(config.slider, LayeredSlider):
        yield "output.layers", 'is for slider.kind = "layered" only', True

    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    together = min(config.run.realizations, os.cpu_count() or 1)
    for key, needed, value in (
        (
            "contacts.count",
            (BYTES_PER_CONTACT if config.interaction is None else BYTES_PER_CONTACT_ON_LATTICE)
            * config.contacts.count
            * together
            * (config.run.engine == "eq"),
            config.contacts.count,
        ),
        (
            "run.avalanches",
            BYTES_PER_AVALANCHE
            * (config.run.avalanches or 0)
            * config.run.realizations
            * (config.output.avalanche_size is None),
            config.run.avalanches,
        ),
        (
            "output.snapshots",
            BYTES_PER_CONTACT_IN_SNAPSHOT
            * config.contacts.count
            * len(config.output.snapshots)
            * config.run.realizations,
            f"{len(config.output.snapshots)} times",
        ),
        (
            "output.interval",
            (BYTES_PER_SAMPLE + 16 * getattr(config.slider, "layers", 0) * config.output.layers)
            * config.expected_duration
            / interval
            * config.run.realizations,
            interval,
        ),
    ):
        if needed > memory:
            yield (
                key,
                f"the run needs {needed / 2**30:.3g} GiB for this, and the machine has "
                f"{memory / 2**30:.3g} GiB",
                value,
            )


def _drive_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong with the drive and the length of the run: key, message, value."""
    run, drive = config.run, config.drive
    if isinstance(config.slider, QuasistaticSlider):
        spring = config.slider.stiffness
        if drive.force_rate is None and spring is None:
            yield "slider.stiffness", "missing; only a drive by force needs no spring", None
        elif drive.force_rate is not None and spring is not None:
            yield (
                "slider.stiffness",
                "has no meaning with drive.force_rate, which acts on the slider without a spring",
                spring,
            )
    elif drive.force_rate is not None:
        yield "drive.force_rate", 'is for slider.kind = "quasistatic" only', drive.force_rate
    if run.drive_displacement is not None:
        if not drive.velocity:
            yield (
                "run.drive_displacement",
                "needs a drive.velocity that is not 0",
                run.drive_displacement,
            )
        elif run.duration is not None:
            yield (
                "run.drive_displacement",
                "give either this or run.duration",
                run.drive_displacement,
            )
        elif math.isinf(config.duration):
            yield (
                "run.drive_displacement",
                f"takes for ever at {drive.velocity:g} m/s",
                run.drive_displacement,
            )
    if run.avalanches is not None:
        if not config.has_avalanches:
            yield (
                "run.avalanches",
                'needs [interaction] or slider.kind = "quasistatic": otherwise contacts break one '
                "by one",
                run.avalanches,
            )
        elif drive.velocity == 0:
            yield "drive.velocity", "must not be 0 for a run that avalanches end", drive.velocity
    if run.avalanches is None and config.duration == math.inf and run.drive_displacement is None:
        if drive.force_rate is not None and not config.contacts.reattach:
            return
        yield "run.duration", "needed, as the drive has no stages", None
    elif config.duration <= 0:
        yield "run.duration", "needed, as the drive has no stages", None


def _interaction_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong with interaction, avalanches and snapshots: key, message, value."""
    contacts, interaction, output = config.contacts, config.interaction, config.output
    if isinstance(config.slider, QuasistaticSlider) and config.run.engine == "me":
        yield (
            "slider.kind",
            'needs engine "eq"; the force of infinitely many contacts over the displacement of a '
            "slider without inertia is that of mesoslip curve",
            config.slider.kind,
        )
    if interaction is None:
        for key in ("snapshots", "snapshot_size"):
            if getattr(output, key):
                yield f"output.{key}", "needs [interaction], for the places of contacts", None
        if output.avalanche_size is not None and not config.has_avalanches:
            yield (
                "output.avalanche_size",
                'needs [interaction] or slider.kind = "quasistatic"',
                output.avalanche_size,
            )
        return

    if config.run.engine == "me":
        yield (
            "interaction",
            'needs engine "eq": the master equation has no neighbours; in the mean, interaction '
            "acts like a narrower law of thresholds (contacts.threshold.relative_width)",
            None,
        )
    places = interaction.columns * interaction.rows
    if places != contacts.count:
        yield (
            "interaction.columns",
            f"times rows must be contacts.count: {interaction.columns} x {interaction.rows} = "
            f"{places}, not {contacts.count}",
            interaction.columns,
        )
    if contacts.area is None:
        yield "contacts.area", "needed for the distance between neighbours, a = (A/N)^(1/2)", None
    relative = interaction.neighbours * config.bond_stiffness / contacts.contact_stiffness
    if relative > STRONGEST_BONDS:
        strongest = interaction.strength * STRONGEST_BONDS / relative
        yield (
            "interaction.strength",
            "so strong that a contact cannot attach: the force at which it does, (k + G z) x less "
            f"the pull of its neighbours, is a difference of terms {relative:.1g} times as large, "
            f"without digits enough; at most {strongest:.3g}",
            interaction.strength,
        )
    times = output.snapshots
    if list(times) != sorted(set(times)) or (times and times[-1] > config.duration):
        yield (
            "output.snapshots",
            "must grow, up to the duration of the run",
            list(times),
        )


def _problems(error: ValidationError, source: str) -> list[Problem]:
    """Everything that pydantic found, in our words."""
    return [_problem_of(details, source) for details in error.errors()]


def _problem_of(details: ErrorDetails, source: str) -> Problem:
    place = [part for part in details["loc"] if part not in SLIDERS]
    context = details.get("ctx", {})
    kind, value, message = details["type"], details["input"], details["msg"]
    table, name = _dotted(place[:-1]), str(place[-1]) if place else ""
    if kind == "table":
        return Problem(source, _dotted([*place, context["key"]]), context["message"])
    if kind == "missing":
        return Problem(source, _dotted(place), "missing; it has no default")
    if kind == "extra_forbidden":
        if name in NOT_YET_KEYS.get(table, ()):
            return Problem(source, _dotted(place), "not available in this version")
        kinds = [kind for kind, model in SLIDERS.items() if name in model.model_fields]
        if table == "slider" and kinds:
            named = " or ".join(f'"{kind}"' for kind in kinds)
            return Problem(source, _dotted(place), f"is for slider.kind = {named} only")
        near = difflib.get_close_matches(name, _known_keys(place[:-1], details), 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        return Problem(source, _dotted(place), f"unknown key{hint}")
    if kind in {"union_tag_invalid", "literal_error"}:
        if kind == "union_tag_invalid":
            place, value = [*place, "kind"], context["tag"]
            expected = context["expected_tags"]
        else:
            expected = context["expected"]
        message = f"must be {expected}"
    elif kind == "value_error":
        message = str(context["error"])
    elif kind in {"model_type", "dict_type", "model_attributes_type", "union_tag_not_found"}:
        message = "must be a table"
    else:
        message = message.replace("Input should", "must").replace("Tuple should", "must")
    return Problem(source, _dotted(place), message, value)


def _dotted(place: Iterable[Any]) -> str:
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.lstrip(".")


def _known_keys(place: list[Any], details: ErrorDetails) -> list[str]:
    """Keys of the table at a place of the file."""
    model: Any = Config
    tables: dict[str, Any] = {
        "run": Run,
        "drive": Drive,
        "slider": next(
            (kind for name, kind in SLIDERS.items() if name in details["loc"]), RigidSlider
        ),
        "base": Base,
        "solver": Solver,
        "cantilever": Cantilever,
        "contacts": Contacts,
        "interaction": Interaction,
        "output": Output,
        "curve": Curve,
        "threshold": Threshold,
        "stage": Stage,
    }
    for part in place:
        model = tables.get(part, model)
    return [*model.model_fields, *(["base"] if model is Config else [])]


def _read_toml(path: Path, outer: tuple[Path, ...]) -> dict[str, Any]:
    """Tables of a file, laid over those of its base."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise FileError(f"{path}: is a directory, not a configuration file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    tables = _parse_toml(text, str(path))
    base = tables.pop("base", None)
    if base is None:
        return tables
    if not isinstance(base, str):
        raise ConfigError([Problem(str(path), "base", "must be the name of a file", base)])
    outer = (*outer, path.resolve())
    base_path = path.parent / base
    if base_path.resolve() in outer:
        raise ConfigError([Problem(str(path), "base", "files are based on each other", base)])
    return _merge(_read_toml(base_path, outer), tables)


def _parse_toml(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError([Problem(source, "", f"not valid TOML: {error}")]) from None


def _merge(base: Mapping[str, Any], over: Mapping[str, Any], table: str = "") -> dict[str, Any]:
    """Lay tables over others.

    Of keys that exclude each other the one laid over stays; another kind of slider starts anew.
    """
    merged = dict(base)
    kind = base.get("kind", "rigid")
    if table == "slider" and over.get("kind", kind) != kind:
        merged = {}
    exclusive = EXCLUSIVE.get(table, ())
    if any(key in over for key in exclusive):
        merged = {key: value for key, value in merged.items() if key not in exclusive}
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            merged[key] = _merge(below, value, key)
        else:
            merged[key] = value
    return merged


def _override(tables: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Lay changes such as "contacts.delay=1ms" over tables."""
    for override in overrides:
        tables = _merge(tables, _parse_override(override))
    return tables


def _parse_override(text: str) -> dict[str, Any]:
    """The tables of a change such as "contacts.delay=1ms"."""
    key, equals, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", key):
        raise ConfigError([Problem("--set", text, "must look like contacts.delay=1ms")])
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value
    outer, _, last = key.rpartition(".")
    tables = {last: parsed}
    for part in reversed(outer.split(".") if outer else ()):
        tables = {part: tables}
    return tables
