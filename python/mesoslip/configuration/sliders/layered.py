"""An elastic block of layers (S24), and the base on which it may slide."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from mesoslip import _core
from mesoslip.configuration.sliders.base import Setting
from mesoslip.configuration.sliders.inertial import SpringSlider
from mesoslip.configuration.table import (
    Complaint,
    Complaints,
    Density,
    Length,
    Mass,
    Number,
    Pressure,
    Rate,
    Stiffness,
    Table,
    Whole,
    choice,
)
from mesoslip.errors import ConfigError

# Methods of integration.
SOLVERS = ("series", "adams", "bdf")
AUTOMATIC = "auto"

# Work of a run by series, steps times layers, above which BDF is chosen.
MAX_SERIES_WORK = 1e11

# Absolute tolerance of CVODE, relative to the extension of the spring under F_s.
TINY_STRETCH = 1e-6


def has_cvode() -> bool:
    """Whether the kernels were built with SUNDIALS."""
    return bool(_core.sundials().strip())


class Base(Table):
    """The lower body: a damped mass on a spring to the ground."""

    mass: Annotated[Mass, Field(gt=0)]
    """Mass of the lower body, M_B."""
    stiffness: Annotated[Stiffness, Field(gt=0)]
    """Stiffness of its spring to the ground, K_B."""
    damping: Annotated[Rate, Field(ge=0)] = 0.0
    """Damping rate of its motion."""


class Solver(Table):
    """Method of integration of the layers: series, exact to rounding, or CVODE."""

    method: Annotated[str, choice((AUTOMATIC, *SOLVERS))] = AUTOMATIC
    """`series` is exact to rounding; `adams` and `bdf` are methods of CVODE; `auto` chooses
    `series` unless it would take hours."""
    relative_tolerance: Annotated[Number, Field(ge=1e-13, le=1e-2)] = 1e-8
    """Relative tolerance of CVODE."""


class Cantilever(Table):
    """A round rod, clamped at one end and pulled at the other."""

    length: Annotated[Length, Field(gt=0)]
    """Length, L."""
    radius: Annotated[Length, Field(gt=0)]
    """Radius, r."""
    density: Annotated[Density, Field(gt=0)]
    """Density, ρ."""
    young_modulus: Annotated[Pressure, Field(gt=0)]
    """Young's modulus, E."""

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


# Maximum residual of the energy balance with CVODE over its tolerance: errors of many steps add up.
RESIDUAL_OVER_TOLERANCE = 1e4


class LayeredSlider(SpringSlider):
    """An elastic block of layers joined by springs; the first layer carries the contacts.

    The damping force is γ M/N_l times the relative velocity of neighbouring layers, with the
    ``layer_damping`` γ [1/s]. The spring to the drive has no damping: with one layer the block is a
    rigid slider without damping (model section 8).
    """

    kind: Literal["layered"] = "layered"
    """An elastic block of layers joined by springs."""
    layers: Annotated[Whole, Field(ge=1, le=100_000)]
    """Number of layers, N_l."""
    layer_damping: Annotated[Rate, Field(ge=0)] = 0.0
    """Rate γ of the damping γ M/N_l between neighbouring layers."""
    base: Base | None = None
    """The lower body, if it moves."""
    solver: Solver = Solver()
    """Method of integration of the layers."""
    cantilever: Cantilever | None = None
    """A rod that gives mass and stiffness of the slider."""

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
        given = {key: value for key, value in tables.items() if value is not None}
        return {"mass": cantilever.mass, "stiffness": cantilever.stiffness, **given}

    @model_serializer(mode="wrap")
    def _without_derived(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out mass and stiffness of the cantilever."""
        table: dict[str, Any] = handler(self)
        for name in ("mass", "stiffness"):
            if self.cantilever is not None and getattr(self.cantilever, name) == table.get(name):
                del table[name]
        return table

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies of the chain on a fixed base, without pinned contacts [1/s]."""
        n = self.layers
        return tuple(
            2 * n * self.omega_s * math.sin((2 * j - 1) * math.pi / (2 * (2 * n + 1)))
            for j in range(1, n + 1)
        )

    @property
    def series_stiffness(self) -> float:
        if self.base is None:
            return self.stiffness
        return 1 / (1 / self.stiffness + 1 / self.base.stiffness)

    @property
    def quiet_time(self) -> float:
        setup = super().quiet_time
        if self.base is None:
            return setup
        # Slider and base together may have a longer period than the setup.
        return max(setup, math.pi * math.sqrt((self.base.mass + self.mass) / self.base.stiffness))

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:
        solver = self.solver_name(config)
        # Only a run needs SUNDIALS; its output can be read without.
        if solver != "series" and not has_cvode():
            message = (
                "needs CVODE, but this copy of mesoslip was built without SUNDIALS; "
                'use method = "series"'
            )
            raise ConfigError.of("slider.solver.method", message, solver)
        relative = self.solver.relative_tolerance
        base = self.base
        return {
            "layers": self.layers,
            "mass": self.mass,
            "stiffness": self.stiffness,
            "damping": self.layer_damping,
            "base_mass": 0.0 if base is None else base.mass,
            "base_stiffness": 0.0 if base is None else base.stiffness,
            "base_damping": 0.0 if base is None else base.damping,
            "solver": solver,
            "relative_tolerance": relative,
            "absolute_tolerance": relative
            * TINY_STRETCH
            * config.contacts.static_force
            / self.stiffness,
        }

    @property
    def layer_count(self) -> int:
        return self.layers

    @property
    def extra_traces(self) -> tuple[str, ...]:
        return ("elastic_force",) if self.base is None else ("elastic_force", "base_displacement")

    def layers_recorded(self, config: Setting) -> int:
        return self.layers if config.output.layers else 0

    def solver_name(self, config: Setting) -> str:
        if self.solver.method != AUTOMATIC:
            return self.solver.method
        if not config.contact_kind.is_discrete or not has_cvode():
            return "series"
        # Series need a few steps per period of the fastest rate, even if it does not affect the
        # motion; BDF does not.
        mass = self.mass / self.layers
        drag = config.contacts.count * config.contacts.contact_drag
        rate = 2 * self.layers * self.omega_s
        rate += math.sqrt(config.contacts.stiffness / mass) + drag / mass + 4 * self.layer_damping
        if self.base is not None:
            stiffness = self.base.stiffness + config.contacts.stiffness
            rate += math.sqrt(stiffness / self.base.mass) + drag / self.base.mass
            rate += self.base.damping
        work = config.expected_duration * rate * (self.layers + 10)
        return "series" if work < MAX_SERIES_WORK else "bdf"

    def residual_bound(self, config: Setting) -> float:
        if self.solver_name(config) == "series":
            return 0.0
        return RESIDUAL_OVER_TOLERANCE * self.solver.relative_tolerance

    @property
    def remedy(self) -> str:
        return (
            "a smaller slider.solver.relative_tolerance helps, or slider.solver.method = "
            '"series", which is exact to rounding'
        )

    def problems(self, config: Setting) -> Complaints:
        if not config.contact_kind.is_discrete and self.solver.method not in {AUTOMATIC, "series"}:
            yield Complaint(
                "slider.solver.method",
                'must be "series" with engine "me", where the force law changes at every step',
                self.solver.method,
            )
