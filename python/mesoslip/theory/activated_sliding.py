"""Linear stability of steady sliding with thermally activated breaking, with and without ageing.

As `steady_sliding`, with a response of the contacts that depends on the hazards. A contact of the
age a, under a slider moving with v t + ε e^(λt), has the perturbed hazard

    δH(a) = ε e^(λ t') D(a),    D(a) = ∫_0^a (k h/f_T) (e^(λ a') - 1) da',

from its birth at t'. The derivation is in ``docs/temperature.md``.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mesoslip.quantities import with_unit
from mesoslip.theory.activated_lives import POINTS, ActivatedLives
from mesoslip.theory.linear_stability import LinearStability, Parts
from mesoslip.theory.sliders import dynamic_stiffness
from mesoslip.theory.thermal import steady_force, steady_slope

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

# Product of a rate and the length of a panel up to which its quadrature has rounding errors only,
# and maximum number of panels over the ages.
MAX_TURN, MAX_PANELS = 6.0, 400
# Length of the panels, for about six digits, and doublings of those over thresholds at low rates.
COARSENESS, MAX_DOUBLINGS = 4.0, 3
# Rate over k v/f_T from which contacts do not break while the slider oscillates.
FAST = 20.0
# Rate over that of breaking at which the response is nearly linear.
SLOW = 1e-3
# Points of the path for a decade of frequencies. From a frequency over k v/f_T on, the critical
# stiffness is sought with fewer points.
POINTS_A_DECADE = 15
SMOOTH_FROM, THINNING = 1.5, 3


class RateAndState(NamedTuple):
    """Parameters of rate and state that describe activated contacts near a velocity.

    Attributes
    ----------
    a
        Direct effect [N]: N f_T times the shares of contacts that are pinned, and of those that
        break before they come to their thresholds. After a step of the velocity by a factor r they
        break at a force that is higher by f_T ln r.
    b
        Evolution effect [N]: a - dF/d ln v.
    slip_distance
        D_c [m]: displacement over which the force evolves, the area between the evolving force and
        its new steady value over the evolution of the force, for a small step.
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


class ActivatedSliding(LinearStability):
    """Steady sliding of contacts that break by thermal activation.

    Parameters and errors are those of `LinearStability`; contacts may age.
    """

    @cached_property
    def _lives(self) -> dict[int, ActivatedLives]:
        return {}

    def _lives_for(self, rate: float) -> ActivatedLives:
        """Quadratures that resolve a rate [1/s]; panels are halved as it doubles."""
        if not self._lives:
            self._lives[0] = ActivatedLives(self.config, self.velocity, coarseness=COARSENESS)
        # Contacts break between the ends of the first panel and of the last one.
        edges = self._lives[0].edges[:, 1:]
        longest = float(np.max(np.diff(edges, axis=1)))
        whole = float(np.max(edges[:, -1] - edges[:, 0]))
        halvings = math.ceil(math.log2(max(rate * longest / MAX_TURN, 1e-300)))
        most = max(0, math.ceil(math.log2(MAX_PANELS * longest / whole)))
        level = max(-MAX_DOUBLINGS, min(halvings, most))
        if level not in self._lives:
            self._lives[level] = ActivatedLives(
                self.config,
                self.velocity,
                max_panel=longest / 2 ** max(0, level),
                threshold_panel=COARSENESS * 2 ** max(0, -level),
                coarseness=COARSENESS,
            )
        return self._lives[level]

    @property
    def force(self) -> float:
        return steady_force(self.config, self.velocity)

    @property
    def slope(self) -> float:
        return steady_slope(self.config, self.velocity) / self.velocity

    def _parts(self, rate: Complex) -> Parts:
        columns = [self._parts_at(complex(one)) for one in rate]
        fed, births, free, life = (np.array(one) for one in zip(*columns, strict=True))
        return Parts(fed, births, free, np.abs(life))

    def _parts_at(self, rate: complex) -> tuple[complex, complex, complex, complex]:
        contacts = self.config.contacts
        is_fast = abs(rate) > FAST * self._breaking_rate
        lives = self._lives_for(0.0) if is_fast else self._lives_for(abs(rate))
        density = 1 / (lives.life + self.delay)
        lost, held, laplace, load = (
            self._fast_motion(lives, rate) if is_fast else self._motion(lives, rate)
        )
        late, detached = (one[()] for one in self._late(np.asarray(rate)))
        births = rate * laplace * late + detached
        # Drag of a velocity [N s/m], and 1/s to N/m.
        drag = self._drag
        fed = rate * lost * density * (contacts.stiffness * load * late)
        fed += drag * self._rate * density * lost * detached
        free = contacts.stiffness * density * held + drag * rate * density * self.delay
        return complex(fed), complex(births), complex(free), complex((1 - rate * laplace) * late)

    def _motion(
        self, lives: ActivatedLives, rate: complex
    ) -> tuple[complex, complex, complex, complex]:
        """Breaks and force of the pinned contacts, for ε of f_s/k, and the transforms of the number
        and the force of a contact over its life [s]."""
        ages, stretch = lives.age[:, POINTS:], lives.stretch[:, POINTS:]
        decay = np.exp(-rate * ages)
        missing = -np.expm1(-rate * ages)
        alive = (lives.weight * lives.step * lives.survival)[:, POINTS:]
        broken = self._late_breaks(lives, rate, decay)
        end_missing = -np.expm1(-rate * lives.edges[:, -1:])
        ended = lives.weight * lives.reached * end_missing / lives.approach
        end_stretch = lives.back + lives.speed * lives.edges[:, -1:]
        lost = np.sum(alive * broken) + np.sum(ended)
        held = np.sum(alive * (missing - stretch * broken)) - np.sum(ended * end_stretch)
        young_held, young, young_load = self._unbroken(lives, rate)
        return (
            complex(lost),
            complex(held) + young_held,
            complex(np.sum(alive * decay)) + young,
            complex(np.sum(alive * stretch * decay)) + young_load,
        )

    @staticmethod
    def _unbroken(lives: ActivatedLives, rate: complex) -> tuple[complex, complex, complex]:
        """Integrals of 1 - e^(-λa), e^(-λa) and x e^(-λa) while none breaks [s]."""
        weight, start = lives.weight, lives.edges[:, 1:2]
        if abs(rate) * float(np.max(start)) < MAX_TURN:
            share = weight * lives.step[:, :POINTS]
            decay = np.exp(-rate * lives.age[:, :POINTS])
            missing = -np.expm1(-rate * lives.age[:, :POINTS])
            loaded = share * lives.stretch[:, :POINTS]
            return (
                complex(np.sum(share * missing)),
                complex(np.sum(share * decay)),
                complex(np.sum(loaded * decay)),
            )
        decay = np.exp(-rate * start)
        young = complex(np.sum(weight * -np.expm1(-rate * start))) / rate
        moved = (young - complex(np.sum(weight * start * decay))) / rate
        return (
            float(np.sum(weight * start)) - young,
            young,
            lives.back * young + lives.speed * moved,
        )

    @staticmethod
    def _fast_motion(
        lives: ActivatedLives, rate: complex
    ) -> tuple[complex, complex, complex, complex]:
        """The same where the motion is much faster than the rates at which contacts break, to first
        order in 1/λ."""
        breaking = lives.survival * lives.rate / lives.scale
        ended = lives.weight * lives.reached / lives.approach
        end_stretch = lives.back + lives.speed * lives.edges[:, -1:]
        lost = lives.mean(breaking) / rate + np.sum(ended)
        held = lives.life - (1 + lives.mean(lives.stretch * breaking)) / rate
        held -= np.sum(ended * end_stretch)
        return lost, held, 1 / rate, lives.back / rate

    @staticmethod
    def _late_breaks(lives: ActivatedLives, rate: complex, decay: Complex) -> Complex:
        """e^(-λa) D(a) = ∫_0^a (k h/f_T) (e^(-λ(a - a')) - e^(-λa)) da', while contacts break;
        shape (thresholds, points)."""
        shape = (len(lives.weight), -1, POINTS)
        half = lives.half[:, 1:]
        # Ages since the start of the panel.
        since = half * (1 + lives.point)
        growing = lives.rate[:, POINTS:].reshape(shape) * np.exp(rate * since)
        inner = lives.within(growing, half)
        whole = (growing * lives.step[:, POINTS:].reshape(shape)).sum(axis=2)
        panel_decay = np.exp(-rate * 2 * half[:, :, 0])
        carried = np.zeros(whole.shape, dtype=np.complex128)
        for panel in range(1, whole.shape[1]):
            carried[:, panel] = panel_decay[:, panel - 1] * (
                carried[:, panel - 1] + whole[:, panel - 1]
            )
        lagged = np.exp(-rate * since) * (carried[:, :, None] + inner)
        broken: Complex = lagged.reshape(decay.shape) - decay * lives.hazard[:, POINTS:]
        return broken / lives.scale

    @cached_property
    def _path(self) -> Array:
        lives = self._lives_for(0.0)
        turn = lives.life + self.delay
        stiffness = self.config.contacts.stiffness
        own = math.sqrt((stiffness + max(self._spring, 0.0)) / self._mass)
        low = 1e-3 * min(self._scale, 1 / turn)
        last = 3 * max(own, self._scale)
        count = math.ceil(POINTS_A_DECADE * math.log10(last / low))
        return np.concatenate([[0.0], np.geomspace(low, last, count)])

    @property
    def _is_passive(self) -> bool:
        return False

    @property
    def _spring(self) -> float:
        spring = self.config.spring_stiffness
        return spring if math.isfinite(spring) else 0.0

    @property
    def _breaking_rate(self) -> float:
        """k v/f_T [1/s]."""
        lives = self._lives_for(0.0)
        return lives.speed / lives.scale

    @cached_property
    def rate_and_state(self) -> RateAndState:
        """a, b and D_c near this velocity; a one-state law need not describe the contacts."""
        lives = self._lives_for(0.0)
        life = lives.life + self.delay
        hazards, _ = lives.accumulated(lives.hazard)
        # Contacts that break later bear on, and attach later with the back force.
        later = lives.mean((lives.stretch - lives.back) * lives.survival * hazards)
        a = self.config.contacts.static_force * self._breaking_rate * later / life
        net = self.velocity * self.slope
        # Λ = λ Λ'(0) + λ² Λ''(0)/2 + ...: the area is v² Λ''(0)/2 for each unit of ln r. The direct
        # effect comes as 1 - e^(-k X/f_T), which the area has too.
        rate = SLOW / life
        here, twice = (self.response_at(one + 0j).real / one for one in (rate, 2 * rate))
        area = self.velocity**2 * float((twice - here) / rate)
        return RateAndState(
            a, a - net, (area + a * self.velocity / self._breaking_rate) / (a - net)
        )

    @cached_property
    def critical_stiffness(self) -> tuple[float, float] | None:
        """Stiffness of the spring above which steady sliding is linearly stable [N/m], and the
        angular frequency of the oscillation there [1/s]; None if it is stable with any spring.

        It is the largest K for which K + Z(iω) + Λ(iω) = 0 at a frequency, with the dynamic
        stiffness Z of the rest of the slider.
        """
        if not self._has_motion or not 0 < self._spring < math.inf:
            return None
        path = self._path[1:]
        # Faster than contacts break, the response has no cycles of births any more.
        is_slow = path < SMOOTH_FROM * self._breaking_rate
        path = np.concatenate([path[is_slow], path[~is_slow][::THINNING]])
        values = self._without_spring(path)
        crossings = np.flatnonzero(np.diff(np.sign(values.imag)) != 0)
        found = None
        for at in crossings:
            if max(-values.real[at], -values.real[at + 1]) <= 0:
                continue
            frequency = optimize.brentq(
                lambda one: float(self._without_spring(np.array([one])).imag[0]),
                path[at],
                path[at + 1],
                rtol=1e-5,
            )
            stiffness = -float(self._without_spring(np.array([frequency])).real[0])
            if stiffness > 0 and (found is None or stiffness > found[0]):
                found = (stiffness, frequency)
        return found

    def _without_spring(self, frequency: Array) -> Complex:
        """Z(iω) + Λ(iω) - K [N/m]."""
        rate = 1j * frequency
        slider = dynamic_stiffness(self.config.slider, rate)
        assert slider is not None
        whole: Complex = slider.numerator / slider.denominator + self.response_at(rate)
        whole -= self._spring
        return whole

    @property
    def is_stable_out_of_step(self) -> bool:
        """As `is_stable`: activation spreads the lives of contacts."""
        return self.is_stable

    @property
    def summary(self) -> str | None:
        if not self._has_motion:
            return None
        where = f"steady sliding at {with_unit(self.velocity, 'm/s', 3)}"
        change = "strengthens" if self.slope > 0 else "weakens"
        limit = self.critical_stiffness
        if limit is None:
            return (
                f"{where} {change} with velocity and is linearly stable with any spring. Large "
                "oscillations, as after the first slip, may persist: only a run shows"
            )
        stiffness, frequency = limit
        is_stiffer = self._spring > stiffness
        return (
            f"{where} {change} with velocity and is linearly stable with springs stiffer than "
            f"{with_unit(stiffness, 'N/m', 3)} (there it oscillates at "
            f"{with_unit(frequency / (2 * math.pi), '1/s', 3)}): "
            + ("small perturbations decay" if is_stiffer else "with this one it is unstable")
        )
