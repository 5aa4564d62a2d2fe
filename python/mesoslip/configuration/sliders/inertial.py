"""What sliders with a mass have in common."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from mesoslip.configuration.sliders.base import Quantity, Setting, SliderTable
from mesoslip.configuration.table import Mass, Stiffness

# In a slip the slider exceeds the drive's velocity by this part of the scale Omega_S F_s/K.
SLIP_VELOCITY_RATIO = 0.02


class InertialSlider(SliderTable):
    """A slider with a mass on a spring: it has slips, and a frequency of its own."""

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
        """Half a period of the setup [s]."""
        return math.pi / self.omega_s

    def velocity_scale(self, config: Setting) -> float:
        """Velocity of a slip, Omega_S F_s/K [m/s]."""
        return self.omega_s * config.contacts.static_force / self.stiffness

    def slip_velocity(self, config: Setting) -> float:
        return config.output.slip_velocity or SLIP_VELOCITY_RATIO * self.velocity_scale(config)

    def loading_rate(self, config: Setting) -> float | None:
        if config.drive_speed == 0:
            return None
        root = math.sqrt(self.stiffness * self.mass)
        return config.drive_speed * root / config.contacts.static_force

    @property
    def damping_quantities(self) -> Iterator[Quantity]:
        """The damping, where the whole slider has one."""
        yield from ()

    def quantities(self, config: Setting) -> Iterator[Quantity]:
        contacts, omega_s = config.contacts, self.omega_s
        omega_l = math.sqrt(contacts.stiffness / self.mass)
        yield Quantity("omega_s", omega_s, "1/s", "setup frequency, Omega_S = (K/M)^(1/2)")
        yield Quantity(
            "setup_period",
            2 * math.pi / omega_s,
            "s",
            "period of the setup, tau_S = 2 pi/Omega_S",
        )
        yield from self.damping_quantities
        yield Quantity(
            "omega_l",
            omega_l,
            "1/s",
            "ringing frequency of the pinned slider, Omega_L = (Nk/M)^(1/2)",
        )
        yield Quantity(
            "ringing_period", 2 * math.pi / omega_l, "s", "period of the ringing, 2 pi/Omega_L"
        )
        film = contacts.count * contacts.contact_drag / self.mass
        yield Quantity(
            "film_drag_rate",
            film,
            "1/s",
            "drag of the whole molten film per slider mass, N m eta/M",
        )
        yield Quantity(
            "slip_velocity_scale",
            self.velocity_scale(config),
            "m/s",
            "velocity of a slip, Omega_S F_s/K",
        )
        yield from self._onset_quantities(config, film)

    def _onset_quantities(self, config: Setting, film: float) -> Iterator[Quantity]:
        """What is known of the first slip without the force curve; ``film`` in 1/s."""
        contacts, omega_s = config.contacts, self.omega_s
        d_1 = self.loading_rate(config)
        if not d_1:
            return
        loading = contacts.static_force / self.stiffness / config.drive_speed
        yield Quantity(
            "loading_time",
            loading,
            "s",
            "time in which the spring alone loads to F_s, F_s/(K v_d)",
        )
        yield Quantity("D1", d_1, "1", "v_d (K M)^(1/2)/F_s (S46)")
        alpha = (6 / d_1) ** (1 / 3)
        yield Quantity(
            "alpha",
            alpha,
            "1",
            "slip time of sequential breaking times Omega_S, (6/D1)^(1/3); the source says 2.21 of "
            "Klein's case, for which this is 14.2",
        )
        yield Quantity(
            "slip_time_sequential", alpha / omega_s, "s", "slip time of sequential breaking"
        )
        # The peak of F(X) lies near F_s - Delta F_s, so D0 = F_d(X_c)/F_s is about 1 - delta.
        start = 1 - contacts.threshold.relative_width - film * d_1 / omega_s
        yield Quantity(
            "B",
            start / 2,
            "1",
            "(D0 - eta D1/Omega_S)/2, the film melting at once, D0 ~ 1 - delta",
        )
        if start > 0:
            beta = math.sqrt(2 / start)
            yield Quantity(
                "beta",
                beta,
                "1",
                "slip time of instant melting times Omega_S, [2/(D0 - eta D1/Omega_S)]^(1/2), "
                "with D0 ~ 1 - delta",
            )
            yield Quantity("slip_time_melting", beta / omega_s, "s", "slip time of instant melting")
