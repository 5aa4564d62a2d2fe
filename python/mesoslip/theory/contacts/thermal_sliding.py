"""Linear stability of steady sliding with thermally activated breaking, with and without ageing.

As for plain contacts, with a response of the contacts that depends on the hazards. A contact of the
age a, under a slider moving with v t + ε e^(λt), has the perturbed hazard

    δH(a) = ε e^(λ t') D(a),    D(a) = ∫_0^a (k h/f_T) (e^(λ a') - 1) da',

from its birth at t'. The derivation is in ``docs/temperature.md``.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from mesoslip.array_types import Array, Complex
from mesoslip.theory.contacts.thermal_lives import ThermalAgeingLives, ThermalLives
from mesoslip.theory.contacts.thermal_response import MAX_TURN, Motion, ThermalResponse
from mesoslip.theory.delays import drag_impulse
from mesoslip.theory.frequency_paths import AVERAGED_OUT, Parts, Turns
from mesoslip.theory.linear_stability import LinearStability
from mesoslip.theory.sliders import mode_frequencies

# Length of the panels over thresholds and ages, over f_T and f_T/(k v), for about six digits.
COARSENESS = 4.0
# Rate over k v/f_T from which contacts do not break while the slider oscillates.
FAST = 20.0
# The same over v and the width of thresholds that are reached, by more than this share.
OUT_OF_PHASE, HARDLY = 6.0, 1e-6
# Thresholds times panels for a point of the path that count as a unit of work: ten thousand units
# take about a second here, a tenth of that without temperature.
PANELS_A_UNIT = 50.0
# Maximum number of panels over thresholds that are reached.
MAX_THRESHOLD_PANELS = 400
# Rate over that of breaking at which the response is nearly linear.
SLOW = 1e-3
# Points of the path for a decade of frequencies. From a frequency over k v/f_T on, lives do not
# turn the response, and without delay the critical stiffness is sought with fewer points.
POINTS_A_DECADE = 15
SMOOTH_FROM, THINNING = 1.5, 3
# Points of the path from a frequency of a chain with free contacts to the next one with clamped
# contacts, and back.
POINTS_A_MODE = 2


class RateAndStateTheory(NamedTuple):
    """Parameters of rate and state that describe contacts near a velocity.

    The direct effect a [N] is N f_T times the shares of contacts that are pinned, and of those that
    break before they reach their thresholds, and the drag of the detached ones: after a step of the
    velocity by a factor r contacts break at a force that is higher by f_T ln r. The evolution
    effect b [N] is a - dF/d ln v. The slip distance D_c [m] is the area between the evolving force
    and its new steady value over the evolution of the force, for a small step; NaN if the force
    does not evolve.
    """

    a: float
    b: float
    slip_distance: float

    def critical_stiffness(self, velocity: float, mass: float) -> float:
        """Rice and Ruina's stiffness above which steady sliding is stable [N/m].

        K_c = ((b - a)/D_c) (1 + M v²/(a D_c))
        """
        inertia = mass * velocity**2 / (self.a * self.slip_distance)
        return (self.b - self.a) / self.slip_distance * (1 + inertia)


class ThermalSliding(LinearStability):
    """Steady sliding of contacts that break by thermal activation; see `LinearStability`."""

    lives_type: ClassVar[type[ThermalLives]] = ThermalLives

    @cached_property
    def lives(self) -> ThermalLives:
        """Lives of the contacts, to six digits."""
        return self.lives_type(self.config, self.velocity, coarseness=COARSENESS)

    @cached_property
    def _responses(self) -> dict[int, ThermalResponse]:
        return {}

    def _motion(self, rate: Complex) -> Motion:
        """Response of the pinned contacts; panels are halved as a rate doubles."""
        size = np.abs(rate)
        length = COARSENESS / self._breaking_rate
        level = np.ceil(np.log2(np.maximum(size * length / MAX_TURN, 1.0)))
        level[size > self._fast] = -1
        result = np.empty((len(Motion._fields), len(rate)), dtype=np.complex128)
        for one in np.unique(level).astype(int):
            some = level == one
            response = self._response(int(one))
            here = response.fast_motion if one < 0 else response.motion
            result[:, some] = here(rate[some])
        return Motion(*result)

    def _response(self, level: int) -> ThermalResponse:
        if level not in self._responses:
            fineness = 2 ** max(0, level)
            lives = self._finer_lives(fineness) if self._are_reached else self.lives
            length = COARSENESS / self._breaking_rate / fineness
            self._responses[level] = ThermalResponse(lives, length)
        return self._responses[level]

    def _finer_lives(self, fineness: int) -> ThermalLives:
        """Lives with as many thresholds as their ends need, at which the response has no spread."""
        return self.lives_type(
            self.config,
            self.velocity,
            coarseness=COARSENESS,
            threshold_panel=COARSENESS / fineness,
            max_threshold_panels=MAX_THRESHOLD_PANELS,
        )

    @cached_property
    def _are_reached(self) -> bool:
        """Whether contacts reach their thresholds."""
        return float(np.sum(self.lives.weight * self.lives.reached)) > HARDLY

    @cached_property
    def _fast(self) -> float:
        """Rate from which contacts are dephased from the slider [1/s]."""
        if not self._are_reached:
            return FAST * self._breaking_rate
        width = self.config.contacts.threshold.relative_width
        return max(FAST * self._breaking_rate, OUT_OF_PHASE * self._rate / width)

    @property
    def force(self) -> float:
        return self.lives_type(self.config, self.velocity).force

    @property
    def slope(self) -> float:
        return self.lives_type(self.config, self.velocity).force_slope / self.velocity

    def _parts(self, rate: Complex) -> Parts:
        stiffness = self.config.contacts.stiffness
        density = 1 / (self.lives.life + self.delay)
        lost, held, number, load = self._motion(rate)
        late, detached = self._delays.late(rate)
        births = rate * number * late + detached
        # Drag of a velocity [N s/m], and 1/s to N/m.
        drag = self._drag * density
        fed = rate * lost * density * stiffness * load * late
        fed += drag * self._rate * lost * detached
        free = stiffness * density * held + drag * rate * self.delay
        return Parts(fed, births, free, np.abs((1 - rate * number) * late))

    @cached_property
    def _path(self) -> Array:
        lives = self.lives
        turn = lives.life + self.delay
        stiffness = self.config.contacts.stiffness
        own = math.sqrt((stiffness + self._spring) / self._mass)
        low = 1e-3 * min(self._scale, 1 / turn)
        last = 3 * max(own, self._scale)
        count = math.ceil(POINTS_A_DECADE * math.log10(last / low))
        path = np.concatenate([[0.0], np.geomspace(low, last, count)])
        # Each mode of a chain turns the argument by half a turn.
        modes = np.array(mode_frequencies(self.config.slider))
        places = np.arange(0, len(modes), 1 / POINTS_A_MODE)
        between = np.interp(places, np.arange(len(modes)), modes) if modes.size else modes
        return np.union1d(path, between[between < last])

    @property
    def is_passive(self) -> bool:
        return False

    @property
    def _spring(self) -> float:
        spring = self.config.spring_stiffness
        return spring if math.isfinite(spring) else 0.0

    @property
    def _breaking_rate(self) -> float:
        """k v/f_T [1/s]."""
        lives = self.lives
        return lives.speed / lives.scale

    @cached_property
    def rate_and_state(self) -> RateAndStateTheory:
        """a, b and D_c near this velocity; a one-state law need not describe the contacts."""
        lives = self.lives
        life = lives.life + self.delay
        hazards, _ = lives.accumulated(lives.hazard)
        # Contacts that break later bear force for longer, and attach later with the back force.
        later = lives.mean((lives.stretch - lives.back) * lives.survival * hazards)
        activated = self.config.contacts.static_force * self._breaking_rate * later / life
        a = activated + drag_impulse(self.config, self.velocity) / life
        net = self.velocity * self.slope
        # Λ = λ Λ'(0) + λ² Λ''(0)/2 + ...: the area is v² Λ''(0)/2 for each unit of ln r. Drag
        # changes at once; the direct effect of activation rises as 1 - e^(-k X/f_T), which the area
        # has too.
        rate = SLOW / life
        here, twice = (self.response_at(one + 0j).real / one for one in (rate, 2 * rate))
        area = self.velocity**2 * float((twice - here) / rate)
        evolving = area + activated * self.velocity / self._breaking_rate
        # A force that does not evolve has no slip distance.
        return RateAndStateTheory(a, a - net, evolving / (a - net) if a != net else math.nan)

    @cached_property
    def _search_path(self) -> Array | None:
        path = super()._search_path
        if self.delay > 0 or path is None:
            return path
        is_slow = path < SMOOTH_FROM * self._breaking_rate
        return np.concatenate([path[is_slow], path[~is_slow][::THINNING]])

    @property
    def _turns(self) -> Turns:
        lives = self.lives
        # ⟨∫ a S da⟩, half of the mean square of lives, by the force.
        half_square = (lives.work - lives.back * lives.life) / lives.speed
        spread = math.sqrt(max(2 * half_square - lives.life**2, 1e-12 * lives.life**2))
        # Faster than contacts break, the response has no cycles of births any more.
        until = min(AVERAGED_OUT / spread, SMOOTH_FROM * self._breaking_rate)
        return Turns(lives.life + self.delay, until, self._delays.turning)

    @property
    def work(self) -> int:
        if not self._has_motion:
            return 0
        # Panels in which contacts of each threshold break.
        edges = self.lives.edges[:, 1:]
        panels = float(np.sum(edges[:, -1] - edges[:, 0])) * self._breaking_rate / COARSENESS
        return round(len(self._path) * panels / PANELS_A_UNIT)

    @property
    def _ingredients(self) -> str:
        return "temperature"


class ThermalAgeingSliding(ThermalSliding):
    """The same of contacts whose thresholds change with age."""

    lives_type: ClassVar[type[ThermalLives]] = ThermalAgeingLives

    @property
    def _ingredients(self) -> str:
        return "temperature and ageing"
