"""Linear stability of steady sliding of contacts that age, without temperature.

A contact breaks at the age T at which its force reaches its threshold. Under a slider that moves
with v t + ε e^(λt) this is earlier by ε e^(λt') (e^(λT) - 1)/c, with the velocity c at which
its stretch approaches that at which it breaks. The rest is as in ``docs/temperature.md``, where no
contact breaks below its threshold.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array, Complex
from mesoslip.theory.contacts.ageing_lives import lives, steady_force
from mesoslip.theory.frequency_paths import AVERAGED_OUT, Parts, Turns
from mesoslip.theory.linear_stability import LinearStability
from mesoslip.theory.thresholds import threshold_quadrature

# Relative change of an age, and change of ln v, for derivatives.
AGE_STEP, SLOPE_STEP = 1e-6, 1e-3
# Panels over thresholds, and points of each.
PANELS, POINTS = 24, 10
# Product of a rate and an age below which integrals over the age are sums over points.
SLOW = 1.0
# Product of a rate and the ages of a panel over thresholds up to which they are resolved, of panels
# with more than a small part of the contacts.
MAX_TURN, UNLIKELY = 16.0, 1e-4


class _Ends(NamedTuple):
    """Thresholds and the ages at which they are reached; shape (thresholds,)."""

    weight: Array
    age: Array
    stretch: Array
    """Where they are reached, over f_s/k."""
    approach: Array
    """v minus the velocity of the threshold [1/s]."""


class AgeingSliding(LinearStability):
    """Steady sliding of contacts that age; see `LinearStability`."""

    @cached_property
    def _ends(self) -> _Ends:
        contacts = self.config.contacts
        weight, threshold = threshold_quadrature(self.config, PANELS, POINTS)
        age = lives(self.config, threshold, self._rate)
        change = AGE_STEP * age
        later, earlier = (contacts.threshold_at(threshold, age + d) for d in (change, -change))
        approach = self._rate - (later - earlier) / (2 * change)
        return _Ends(weight, age, contacts.back_force_ratio + self._rate * age, approach)

    @cached_property
    def _life(self) -> float:
        """Mean time from attaching to breaking [s]."""
        return float(self._ends.weight @ self._ends.age)

    @property
    def force(self) -> float:
        return steady_force(self.config, self.velocity)

    @property
    def slope(self) -> float:
        up, down = (
            steady_force(self.config, self.velocity * math.exp(sign * SLOPE_STEP))
            for sign in (1, -1)
        )
        return (up - down) / (2 * SLOPE_STEP * self.velocity)

    def _parts(self, rate: Complex) -> Parts:
        ends, stiffness = self._ends, self.config.contacts.stiffness
        density = 1 / (self._life + self.delay)
        share = ends.weight / ends.approach
        missing = -np.expm1(-rate[:, None] * ends.age)
        missing[self._are_dephased(rate)] = 1.0
        lost, lost_load = missing @ share, missing @ (share * ends.stretch)
        number, load = self._transforms(rate)
        late, detached = self._delays.late(rate)
        births = rate * number * late + detached
        drag = self._drag * density
        fed = rate * lost * density * stiffness * load * late + drag * self._rate * lost * detached
        free = stiffness * density * (self._life - number - lost_load)
        free += drag * rate * self.delay
        return Parts(fed, births, free, np.abs((1 - rate * number) * late))

    def _transforms(self, rate: Complex) -> tuple[Complex, Complex]:
        """Transforms of the number and the force of a contact over its life [s]."""
        ends, back = self._ends, self.config.contacts.back_force_ratio
        number = np.empty(len(rate), dtype=np.complex128)
        load = np.empty_like(number)
        slow = np.abs(rate) * float(np.max(ends.age)) < SLOW
        point, share = np.polynomial.legendre.leggauss(POINTS)
        ages = ends.age[:, None] * (1 + point) / 2
        steps = ends.weight[:, None] * ends.age[:, None] * share / 2
        decay = np.exp(-rate[slow, None, None] * ages)
        number[slow] = np.sum(decay * steps, axis=(1, 2))
        load[slow] = np.sum(decay * steps * (back + self._rate * ages), axis=(1, 2))
        at = rate[~slow]
        last = np.exp(-at[:, None] * ends.age)
        last[self._are_dephased(at)] = 0.0
        number[~slow] = (1 - last @ ends.weight) / at
        moved = (number[~slow] - last @ (ends.weight * ends.age)) / at
        load[~slow] = back * number[~slow] + self._rate * moved
        return number, load

    def _are_dephased(self, rate: Complex) -> NDArray[np.bool_]:
        """Whether contacts are dephased from a motion: faster than the quadrature resolves,
        over the lives of contacts, where e^(-λT) averages out."""
        weight, age = (one.reshape(-1, POINTS) for one in self._ends[:2])
        likely = weight.sum(axis=1) > UNLIKELY
        longest = float(np.max(np.ptp(age[likely], axis=1)))
        return np.abs(rate) * longest > MAX_TURN

    @property
    def _turns(self) -> Turns:
        ends = self._ends
        spread = math.sqrt(max(0.0, float(ends.weight @ (ends.age - self._life) ** 2)))
        return Turns(self._life + self.delay, AVERAGED_OUT / spread, self._delays.turning)

    @property
    def is_passive(self) -> bool:
        return False

    @property
    def _ingredients(self) -> str:
        return "ageing and delay" if self.delay > 0 else "ageing"
