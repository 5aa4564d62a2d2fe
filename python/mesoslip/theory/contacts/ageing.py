"""Steady sliding of contacts that age, at a constant velocity (model section 9)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mesoslip.configuration.contacts.ageing import ageing_of
from mesoslip.errors import ConfigError
from mesoslip.theory.contacts.ageing_lives import lives, quadrature, steady_force
from mesoslip.theory.contacts.base import ContactTheory
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.theory.linear_stability import LinearStability

# Units and meanings of derived quantities.
quantity = named_quantities("""
young_static_force | N | force of all contacts at their mean thresholds when they attach
young_relative_width | 1 | relative standard deviation of the thresholds at attachment, before draws
    are rejected
ageing_velocity | m/s | mean breaking stretch over the ageing time: in much slower sliding contacts
    age fully before they break, in much faster sliding they stay young
F_steady_young | N | force of stationary fast sliding, of young contacts, without delay and drag
growth_per_decade | 1 | growth of thresholds per decade of age, relative to the threshold at birth
mean_life | m | mean displacement from attaching to breaking, of old contacts
F_steady | N | force of stationary slow sliding, of old contacts
mean_life_drive | m | mean displacement from attaching to breaking, sliding at the drive's velocity
F_steady_drive | N | force of stationary sliding at the drive's velocity, with ageing, delay and
    drag
""")

NO_FORCE_CURVE = (
    "has no force curve: F(X) depends on how fast the slider moves; that of contacts with the "
    "configured thresholds is the one without this table, and `mesoslip info` gives the steady "
    "force of young and old contacts and at the velocity of the drive"
)


class AgeingTheory(ContactTheory):
    """Contacts whose thresholds change with age, without temperature."""

    features: ClassVar[frozenset[str]] = frozenset({"contacts.ageing"})
    _ages: ClassVar[str] = ", young and old"

    @property
    def depends_on_velocity(self) -> bool:
        return True

    def check_force_curve(self) -> None:
        raise ConfigError.of("contacts.ageing", NO_FORCE_CURVE)

    def sliding(self, velocity: float | None = None) -> LinearStability:
        from mesoslip.theory.contacts.ageing_sliding import AgeingSliding

        return AgeingSliding(self.config, velocity)

    def steady_force(self, velocity: float) -> float:
        """Force of steady sliding [N]; velocity 0 is the limit of slow sliding, of the law `relax`
        only, and infinity that of fast sliding, both without delay and drag."""
        return steady_force(self.config, velocity)

    def mean_life(self, velocity: float) -> float:
        """Mean displacement from attaching to breaking, v <T> [m]; at velocity 0 of the old."""
        contacts = self.config.contacts
        weight, threshold = quadrature(self.config)
        if velocity == 0:
            broken = contacts.threshold_at(threshold, np.inf)
            return contacts.break_stretch * float(weight @ broken - contacts.back_force_ratio)
        speed = velocity / contacts.break_stretch
        return velocity * float(weight @ lives(self.config, threshold, speed))

    def restart_peak(self, velocity: float, hold: float) -> float:
        """Maximum force of a restart at the velocity before a hold [s], of a prescribed slider [N].

        Sliding at v leaves contacts whose displacements w since they attached are spread evenly up
        to the life l of each. Held for so long, a contact would break after a life of L instead, at
        the age of the hold and L/v; so at a displacement y from the restart those with w > L - y
        have broken, and each has lost L of its stretch by now. In stretches f_s/k, per contact,

            F(y) = F(0) + y - <L max(0, y - (L - l))>/<l>,

        whose maximum is where <L; L - l < y> = <l>. It is exact for infinitely many contacts
        without delay that do not weaken, as long as those that attach after the restart do not
        break before the peak, which then lies within the shortest lives.
        """
        contacts = self.config.contacts
        weight, threshold = quadrature(self.config)
        back = contacts.back_force_ratio
        speed = velocity / contacts.break_stretch
        life = speed * lives(self.config, threshold, speed)
        held = speed * lives(self.config, threshold, speed, hold)
        mean = float(weight @ life)
        # The force is concave in y, and straight between the displacements at which contacts start
        # to break: its maximum is at one of them.
        order = np.argsort(held - life)
        start = (held - life)[order]
        broken, moment = (np.cumsum((weight * one)[order]) for one in (held, held * (held - life)))
        force = start - (start * broken - moment) / mean
        steady = float(weight @ (back * life + life**2 / 2)) / mean
        return contacts.static_force * (steady + float(np.max(force)))

    def quantities(self) -> Iterator[Quantity]:
        yield from self.common_quantities()
        yield from self._ages_of_thresholds()
        if self.config.contacts.reattach and self.config.contacts.newborn_width == 0:
            yield from self._steady_quantities()

    def _ages_of_thresholds(self) -> Iterator[Quantity]:
        """Thresholds of young contacts, and the velocities at which contacts age."""
        contacts, ageing = self.config.contacts, ageing_of(self.config)
        width = contacts.threshold.relative_width
        weakest, mean, strongest = ageing.threshold([1 - width, 1.0, 1 + width], width, 0.0)
        yield quantity("young_static_force", contacts.static_force * float(mean))
        yield quantity("young_relative_width", float((strongest - weakest) / (2 * mean)))
        yield quantity("ageing_velocity", contacts.break_stretch / ageing.time)
        if ageing.growth is not None:
            yield quantity("growth_per_decade", ageing.growth * math.log(10))
        else:
            yield quantity("mean_life", self.mean_life(0.0))

    def _steady_quantities(self) -> Iterator[Quantity]:
        """Forces of slow and fast sliding, and at the drive's velocity."""
        if ageing_of(self.config).growth is None:
            yield quantity("F_steady", self.steady_force(0.0))
        yield quantity("F_steady_young", self.steady_force(math.inf))
        speed = self.config.drive_speed
        if speed > 0:
            yield quantity("mean_life_drive", self.mean_life(speed))
            yield quantity("F_steady_drive", self.steady_force(speed))
