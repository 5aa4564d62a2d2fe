"""Keys of all sliders with a mass on a spring."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mesoslip.configuration.sliders.base import Setting, SliderTable
from mesoslip.configuration.table import Mass, Stiffness

# Velocity relative to the drive above which the slider slips, over Ω_S F_s/K.
SLIP_VELOCITY_RATIO = 0.02


class InertialSlider(SliderTable):
    """A slider with a mass on a spring: it slips, and has a natural frequency."""

    mass: Annotated[Mass, Field(gt=0)]
    """Mass of the slider, M."""
    stiffness: Annotated[Stiffness, Field(gt=0)]
    """Stiffness of the drive's spring, K; of layers, the static stiffness of all springs."""

    @property
    def spring_stiffness(self) -> float:
        return self.stiffness

    @property
    def omega_s(self) -> float:
        """Setup frequency √(K/M) [1/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def quiet_time(self) -> float:
        # Half a period of the setup.
        return math.pi / self.omega_s

    def velocity_scale(self, config: Setting) -> float:
        """Velocity of a slip, Ω_S F_s/K [m/s]."""
        return self.omega_s * config.contacts.static_force / self.stiffness

    def ringing_period(self, config: Setting) -> float:
        return 2 * math.pi * math.sqrt(self.mass / (self.stiffness + config.contacts.stiffness))

    def time_in_slips(self, config: Setting) -> float:
        if config.drive_speed == 0:
            return 0.0
        # A slip of about two periods follows each loading of the spring to the static force.
        loading = config.contacts.static_force / self.stiffness / config.drive_speed
        return config.expected_duration * min(1.0, 4 * self.quiet_time / loading)

    def slip_velocity(self, config: Setting) -> float:
        return config.output.slip_velocity or SLIP_VELOCITY_RATIO * self.velocity_scale(config)
