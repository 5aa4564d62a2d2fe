"""Friction of contacts that break by thermal activation: steady sliding, creep, holds, restarts.

Contacts may age, attach late and with a back force (model sections 9 and 13); their thresholds have
any law. The derivations are in ``docs/temperature.md``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesoslip.array_types import Array
from mesoslip.configuration.contacts.thermal import thermal_of
from mesoslip.errors import ConfigError
from mesoslip.theory.contacts.base import ContactTheory
from mesoslip.theory.contacts.thermal_lives import ThermalAgeingLives, ThermalLives
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.theory.contacts.thermal_holds import Restart
    from mesoslip.theory.contacts.thermal_sliding import ThermalSliding

# Units and meanings of derived quantities.
quantity = named_quantities("""
activation_force_ratio | 1 | force scale of activation over f_s, f_T/f_s
newborn_break_rate | 1/s | rate at which a contact of mean threshold breaks that bears the back
    force
activation_velocity | m/s | omega_0 f_T/k: in much faster sliding contacts reach their thresholds
F_steady_drive | N | force of stationary sliding at the drive's velocity, with activation, delay and
    drag
F_steady_slope | N | dF/d ln v of stationary sliding at the drive's velocity, a - b: below zero
    sliding weakens with velocity
direct_effect | N | a of rate and state: N f_T of the pinned contacts, and the drag of the detached
evolution_effect | N | b of rate and state: a - dF/d ln v
slip_distance | m | D_c: displacement over which the force evolves after a small velocity step
creep_velocity | m/s | velocity of steady creep under the force of the drive, that of the first
    stage
critical_stiffness_estimate | N/m | Rice and Ruina's K_c = ((b - a)/D_c)(1 + M v^2/(a D_c)) at the
    drive's velocity: with softer springs steady sliding is unstable
""")


# Velocities between which creep is sought, over that of activation, ω_0 f_T/k, and their number.
MIN_CREEP, MAX_CREEP, CREEP_POINTS = 1e-30, 1e6, 80
# Length of the panels of the quadratures on the grid of these velocities, and for a restart, whose
# steps have fewer digits.
GRID_COARSENESS, RESTART_COARSENESS = 4.0, 3.0

NO_FORCE_CURVE = (
    "has no force curve: F(X) depends on how fast the slider moves; that without thermal "
    "activation is the one without this table, and `mesoslip info` gives the steady force at the "
    "velocity of the drive"
)


class ThermalTheory(ContactTheory):
    """Contacts of constant thresholds that break by thermal activation."""

    features: ClassVar[frozenset[str]] = frozenset({"contacts.thermal"})
    lives_type: ClassVar[type[ThermalLives]] = ThermalLives

    @property
    def depends_on_velocity(self) -> bool:
        return True

    def check_force_curve(self) -> None:
        raise ConfigError.of("contacts.thermal", NO_FORCE_CURVE)

    def sliding(self, velocity: float | None = None) -> ThermalSliding:
        from mesoslip.theory.contacts.thermal_sliding import ThermalSliding

        return ThermalSliding(self.config, velocity)

    def steady_force(self, velocity: float) -> float:
        """Force of contacts that slide steadily at a velocity [m/s], with delay and drag [N].

        F(v) = N (k ⟨∫ x S dt⟩ + m η v τ_d)/(⟨∫ S dt⟩ + τ_d)
        """
        return self.lives_type(self.config, velocity).force

    def steady_slope(self, velocity: float) -> float:
        """dF/d ln v of the steady force [N]; (f_T/f_s) F_s/2 for one high threshold."""
        return self.lives_type(self.config, velocity).force_slope

    def creep_force(self, velocity: float) -> float:
        """Force under which a slider creeps steadily: F(v) and its damping relative to the ground,
        at a velocity [m/s], in N."""
        return self.steady_force(velocity) + self._ground_damping * velocity

    def creep_velocity(self, force: float) -> float:
        """Velocity of steady creep under a constant positive force [N], the inverse of F(v) [m/s].

        The damping of a slider under a force relative to the ground is part of F(v). Where F(v)
        falls, sliding under a force is unstable: the velocity is the lowest one at which F(v)
        rises; NaN if no steady creep bears the force.
        """
        from scipy import optimize

        scale, damping = self._activation_velocity, self._ground_damping

        def excess(logarithm: float, coarseness: float = 1.0) -> float:
            velocity = scale * math.exp(logarithm)
            lives = self.lives_type(self.config, velocity, coarseness=coarseness)
            return lives.force + damping * velocity - force

        grid = np.linspace(math.log(MIN_CREEP), math.log(MAX_CREEP), CREEP_POINTS)
        before = excess(grid[0], GRID_COARSENESS)
        for low, high in itertools.pairwise(grid):
            after = excess(high, GRID_COARSENESS)
            if before < 0 <= after:
                if excess(low) > 0 or excess(high) < 0:
                    # A force of the grid, to its digits.
                    return scale * math.exp(low if abs(before) < after else high)
                found: float = optimize.brentq(excess, low, high, xtol=1e-10)
                return scale * math.exp(found)
            before = after
        return math.nan

    def hold_force(self, velocity: float, time: ArrayLike) -> Array:
        """Force in a hold of a prescribed slider after steady sliding at a velocity [m/s], at times
        since its start [s], of any shape [N]; see `thermal_holds.hold_force`."""
        from mesoslip.theory.contacts.thermal_holds import hold_force

        return hold_force(self.lives_type(self.config, velocity), time)

    def restart(self, velocity: float, hold: float) -> Restart:
        """Force of a prescribed slider that continues at the velocity [m/s] before a hold [s]."""
        from mesoslip.theory.contacts.thermal_holds import restart

        lives = self.lives_type(self.config, velocity, coarseness=RESTART_COARSENESS)
        return restart(lives, hold)

    @property
    def _activation_velocity(self) -> float:
        """ω_0 f_T/k [m/s]."""
        contacts, thermal = self.config.contacts, thermal_of(self.config)
        return thermal.rate * thermal.ratio(contacts.contact_static_force) * contacts.break_stretch

    @property
    def _ground_damping(self) -> float:
        """Force of the slider's damping relative to the ground over its velocity [N s/m]."""
        if not self.config.drive.is_force:
            return 0.0
        slider = self.config.slider.kernel_parameters(self.config)
        return float(slider.get("mass", 0.0)) * float(slider.get("damping", 0.0))

    def quantities(self) -> Iterator[Quantity]:
        yield from self.common_quantities()
        contacts, thermal = self.config.contacts, thermal_of(self.config)
        static = contacts.contact_static_force
        yield quantity("activation_force_ratio", thermal.ratio(static))
        yield quantity("newborn_break_rate", thermal.rate_under(contacts.back_force_ratio, static))
        yield quantity("activation_velocity", self._activation_velocity)
        if contacts.newborn_width > 0 or not contacts.reattach:
            return
        if self.config.drive_speed > 0:
            yield from self._steady_quantities(self.config.drive_speed)
        force = self.config.drive.first_force
        if force > 0:
            yield quantity("creep_velocity", self.creep_velocity(force))

    def _steady_quantities(self, speed: float) -> Iterator[Quantity]:
        """Friction and its rate and state at the velocity of the drive [m/s]."""
        yield quantity("F_steady_drive", self.steady_force(speed))
        yield quantity("F_steady_slope", self.steady_slope(speed))
        try:
            found = self.sliding(speed).rate_and_state
        except ConfigError:
            return
        yield quantity("direct_effect", found.a)
        yield quantity("evolution_effect", found.b)
        if math.isfinite(found.slip_distance):
            yield quantity("slip_distance", found.slip_distance)
        mass = getattr(self.config.slider, "mass", None)
        if found.b > found.a and mass is not None and 0 < self.config.spring_stiffness < math.inf:
            yield quantity("critical_stiffness_estimate", found.critical_stiffness(speed, mass))


class ThermalAgeingTheory(ThermalTheory):
    """Contacts that break by thermal activation, with thresholds that change with age."""

    features: ClassVar[frozenset[str]] = frozenset({"contacts.ageing", "contacts.thermal"})
    lives_type: ClassVar[type[ThermalLives]] = ThermalAgeingLives
    _ages: ClassVar[str] = ", young and old"

    def sliding(self, velocity: float | None = None) -> ThermalSliding:
        from mesoslip.theory.contacts.thermal_sliding import ThermalAgeingSliding

        return ThermalAgeingSliding(self.config, velocity)
