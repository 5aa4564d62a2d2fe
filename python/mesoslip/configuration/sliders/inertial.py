"""Keys of all sliders with a mass on springs."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from mesoslip.configuration.sliders.base import Setting, SliderTable
from mesoslip.configuration.table import Mass, Number, Rate, Stiffness, Table, problem

# Velocity relative to the drive above which the slider slips, over Ω_S F_s/K.
SLIP_VELOCITY_RATIO = 0.02


class InertialSlider(SliderTable):
    """A slider with a mass on springs: it slips, and has a natural frequency."""

    mass: Annotated[Mass, Field(gt=0)]
    """Mass of the slider, M."""

    @property
    def omega_s(self) -> float:
        """Setup frequency √(K/M) [1/s]."""
        return math.sqrt(self.spring_stiffness / self.mass)

    @property
    def quiet_time(self) -> float:
        # Half a period of the setup.
        return math.pi / self.omega_s

    def velocity_scale(self, config: Setting) -> float:
        """Velocity of a slip, Ω_S F_s/K [m/s]."""
        return self.omega_s * config.contacts.static_force / self.spring_stiffness

    def ringing_period(self, config: Setting) -> float:
        stiffness = self.spring_stiffness + config.contacts.stiffness
        return 2 * math.pi * math.sqrt(self.mass / stiffness)

    def time_in_slips(self, config: Setting) -> float:
        if config.drive_speed == 0:
            return 0.0
        # A slip of about two periods follows each loading of the spring to the static force.
        loading = config.contacts.static_force / self.spring_stiffness / config.drive_speed
        return config.expected_duration * min(1.0, 4 * self.quiet_time / loading)

    def slip_velocity(self, config: Setting) -> float:
        return config.output.slip_velocity or SLIP_VELOCITY_RATIO * self.velocity_scale(config)


class SpringSlider(InertialSlider):
    """A slider with a mass on one spring."""

    stiffness: Annotated[Stiffness, Field(gt=0)]
    """Stiffness of the drive's spring, K; of layers, the static stiffness of all springs."""

    @property
    def spring_stiffness(self) -> float:
        return self.stiffness


class SetupDamping(Table):
    """Keys of a damping of the velocity relative to its running mean (S40, S41)."""

    damping_ratio: Annotated[Number, Field(ge=0)] | None = None
    """Damping rate of the setup, relative to its frequency, η_S/Ω_S."""
    damping: Annotated[Rate, Field(ge=0)] | None = None
    """Damping rate of the setup, η_S, instead of damping_ratio."""

    @model_validator(mode="after")
    def _one_damping(self) -> Self:
        if self.damping is not None and self.damping_ratio is not None:
            raise problem("damping", "give either damping or damping_ratio, not both")
        return self

    def damping_rate_at(self, frequency: float) -> float:
        """η_S [1/s] of a setup of a frequency [1/s]."""
        if self.damping is not None:
            return self.damping
        return (self.damping_ratio or 0.0) * frequency
