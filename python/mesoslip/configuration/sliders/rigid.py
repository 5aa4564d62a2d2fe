"""A rigid block on a spring (S40, S41)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from mesoslip.configuration.sliders.base import DynamicStiffness, Oscillator, Quantity, Setting
from mesoslip.configuration.sliders.inertial import InertialSlider
from mesoslip.configuration.table import Number, Rate, problem

if TYPE_CHECKING:
    from mesoslip.configuration.sliders.base import Complex


class RigidSlider(InertialSlider):
    """A rigid block on a spring; damping acts on its velocity relative to the running mean."""

    kind: Literal["rigid"] = "rigid"
    """A rigid block on a spring."""
    damping_ratio: Annotated[Number, Field(ge=0)] | None = None
    """Damping of the setup over its frequency, η_S/Ω_S."""
    damping: Annotated[Rate, Field(ge=0)] | None = None
    """Damping of the setup, η_S, instead of its ratio."""

    @model_validator(mode="after")
    def _one_damping(self) -> Self:
        if self.damping is not None and self.damping_ratio is not None:
            raise problem("damping", "give either damping or damping_ratio, not both")
        return self

    @property
    def damping_rate(self) -> float:
        """η_S [1/s]."""
        if self.damping is not None:
            return self.damping
        return (self.damping_ratio or 0.0) * self.omega_s

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {"mass": self.mass, "stiffness": self.stiffness, "damping": self.damping_rate}

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.mass, self.stiffness, self.damping_rate)

    def dynamic_stiffness(self, rate: Complex) -> DynamicStiffness:
        """M λ² + K + M η_S λ²/(λ + η_S) (S40, S41)."""
        free = self.mass * rate**2 + self.stiffness
        damping = self.damping_rate
        if damping == 0:
            return DynamicStiffness(free, rate**0, 2)
        mean = rate + damping
        return DynamicStiffness(free * mean + self.mass * damping * rate**2, mean, 3)

    @property
    def damping_quantities(self) -> Iterator[Quantity]:
        yield Quantity("damping_rate", self.damping_rate, "1/s", "setup damping, eta_S")
