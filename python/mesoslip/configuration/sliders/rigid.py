"""A rigid block on a spring (S40, S41)."""

from __future__ import annotations

from typing import Literal

from mesoslip.configuration.sliders.base import Oscillator, Setting
from mesoslip.configuration.sliders.inertial import SetupDamping, SpringSlider


class RigidSlider(SetupDamping, SpringSlider):
    """A rigid block on a spring; damping acts on its velocity relative to the running mean."""

    kind: Literal["rigid"] = "rigid"
    """A rigid block on a spring."""

    @property
    def damping_rate(self) -> float:
        """η_S [1/s]."""
        return self.damping_rate_at(self.omega_s)

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {"mass": self.mass, "stiffness": self.stiffness, "damping": self.damping_rate}

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.mass, self.stiffness, self.damping_rate)
