"""Theory of contacts with constant thresholds, which break where these are reached."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mesoslip.errors import ConfigError
from mesoslip.theory.contacts.base import ContactTheory
from mesoslip.theory.delays import drag_impulse
from mesoslip.theory.lives import newborn_stretch, scales
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.theory.linear_stability import LinearStability

# Units and meanings of derived quantities.
quantity = named_quantities("""
mean_life | m | mean displacement from attaching to breaking, <x_s - x_b>
F_steady | N | force of stationary slow sliding
F_steady_drive | N | force of stationary sliding at the drive's velocity, with delay and drag
""")


class PlainTheory(ContactTheory):
    """Contacts that break at a stretch of their own (model sections 2 and 4)."""

    @property
    def depends_on_velocity(self) -> bool:
        return False

    def check_force_curve(self) -> None:
        """There is one."""

    def check_steady_front(self) -> None:
        if self.config.contacts.reattach:
            message = "contacts that attach again have no steady fronts: set it to false"
            raise ConfigError.of("contacts.reattach", message, True)

    def sliding(self, velocity: float | None = None) -> LinearStability:
        from mesoslip.theory.contacts.plain_sliding import SteadySliding

        return SteadySliding(self.config, velocity)

    def steady_force(self, velocity: float) -> float:
        return self.sliding(velocity).force

    def quantities(self) -> Iterator[Quantity]:
        yield from self.common_quantities()
        contacts, config = self.config.contacts, self.config
        newborn_width = newborn_stretch(config)
        if newborn_width is None:
            return
        lives = scales(config, newborn_width)
        mean_life = lives.mean_life * contacts.break_stretch
        yield quantity("mean_life", mean_life)
        if not contacts.reattach:
            return
        steady = lives.steady_force * contacts.static_force
        yield quantity("F_steady", steady)
        speed = config.drive_speed
        if speed > 0 and not config.slider.ignores_delay:
            drag = lives.mean_mass * drag_impulse(config, speed) * speed
            yield quantity(
                "F_steady_drive", (steady * mean_life + drag) / (mean_life + speed * contacts.delay)
            )
