"""A rigid block on a spring (S40, S41)."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from mesoslip.configuration.sliders.base import Oscillator, Setting
from mesoslip.configuration.sliders.inertial import InertialSlider
from mesoslip.configuration.table import Number, Rate, problem


class RigidSlider(InertialSlider):
    """A rigid block on a spring; damping acts on its velocity relative to the running mean."""

    kind: Literal["rigid"] = "rigid"
    """A rigid block on a spring."""
    damping_ratio: Annotated[Number, Field(ge=0)] | None = None
    """Damping rate of the setup, relative to its frequency, η_S/Ω_S."""
    damping: Annotated[Rate, Field(ge=0)] | None = None
    """Damping rate of the setup, η_S, instead of damping_ratio."""

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
