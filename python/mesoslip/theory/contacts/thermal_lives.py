"""Lives of contacts that break by thermal activation, in steady sliding (model sections 9, 13).

A contact that attached with the stretch x_b has at the age t the stretch x = x_b + v t and the
threshold f_s(t), which is constant without ageing. It breaks at the rate

    h(t) = ω_0 e^((k x - f_s(t))/f_T),

so that it survives until the age t with the probability S(t) = exp(-∫ h dt), and breaks at its
threshold at the latest, at the age T.
"""

from __future__ import annotations

import itertools
import math
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.configuration.contacts.ageing import ageing_of
from mesoslip.configuration.contacts.thermal import thermal_of
from mesoslip.theory.contacts.ageing_lives import lives as breaking_ages
from mesoslip.theory.contacts.steady import check_steady
from mesoslip.theory.delays import drag_impulse, mean_delay
from mesoslip.theory.thresholds import threshold_quadrature

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Real or complex.
Complex = NDArray[np.inexact[Any]]

# Panels and points of the quadratures, over thresholds and over ages, and the probability beyond
# either end of the former.
MAX_PANELS, MIN_PANELS, POINTS = 60, 12, 10
LEFT_OUT = 1e-15
# Hazards between which ages have a fine quadrature: below, all contacts survive, above, none.
MIN_HAZARD, MAX_HAZARD = 1e-14, 40.0
# Panels of the search for these ages, minimum number of searches, each in a part of the range, and
# maximum length of the fine panels, over f_T/(k v).
SEARCH_PANELS, MIN_SEARCHES, MAX_PANEL = 60, 3, 1.0
# Panels over the ages in which young thresholds change.
AGEING_PANELS = 36
# Panels and points of the hazard in a hold of contacts that age.
HOLD_PANELS, HOLD_POINTS = 24, 4
# Change of ln v for derivatives of the force of contacts that age.
SLOPE_STEP = 1e-3
# Exponents whose exponential functions are numbers.
MAX_EXPONENT = 700.0


class ThermalLives:
    """Quadratures over thresholds and ages; forces over f_s, stretches over f_s/k, times in s.

    ``coarseness`` is the length of the panels over ages, 1 for about ten digits, and
    ``max_panel`` their maximum length [s]; ``threshold_panel`` the length of those over thresholds,
    over f_T, by default as `coarseness`. Contacts that do not attach again, or attach with
    different forces, are refused.

    Weights and configured thresholds have the shape (thresholds, 1); ages with their weights,
    ``age`` and ``step``, and x, h [1/s] and ∫ h dt there, ``stretch``, ``rate`` and ``hazard``,
    (thresholds, points).
    """

    def __init__(
        self,
        config: Config,
        velocity: float,
        *,
        max_panel: float = math.inf,
        coarseness: float = 1.0,
        threshold_panel: float | None = None,
        max_threshold_panels: int = MAX_PANELS,
    ) -> None:
        contacts, thermal = config.contacts, thermal_of(config)
        check_steady(config)
        self.config = config
        self.velocity = velocity
        self.speed = velocity / contacts.break_stretch
        """Stretch in a second."""
        self.back = contacts.back_force_ratio
        self.scale = thermal.ratio(contacts.contact_static_force)
        """f_T/f_s."""
        self._log_rate = math.log(thermal.rate)
        weight, threshold = _thresholds(
            config, (threshold_panel or coarseness) * self.scale, max_threshold_panels
        )
        self.weight, self.threshold = weight[:, None], threshold[:, None]
        self.end = self._end()
        """Ages at which contacts reach their thresholds, shape (thresholds, 1)."""
        edges = self._edges(max_panel, coarseness)
        self.edges = edges
        self.point, panel_weight = np.polynomial.legendre.leggauss(POINTS)
        half = np.diff(edges, axis=1)[:, :, None] / 2
        self.half = half
        self.age = (edges[:, :-1, None] + half * (1 + self.point)).reshape(len(weight), -1)
        self.step = (half * panel_weight).reshape(len(weight), -1)
        self.stretch = self.back + self.speed * self.age
        self.rate = self.rate_at(self.age, self.stretch)
        self.hazard, self.last_hazard = self._hazards()
        self.survival = np.exp(-self.hazard)

    def rate_at(self, age: Array, stretch: Array) -> Array:
        """h at ages, shape (thresholds, points)."""
        exponent = (stretch - self.threshold_at(age)) / self.scale + self._log_rate
        return np.exp(np.minimum(exponent, MAX_EXPONENT))

    def threshold_at(self, age: Array) -> Array:
        """f_s(t), shape (thresholds, points)."""
        return self.config.contacts.threshold_at(self.threshold, age)

    def mean(self, values: Array) -> float:
        """⟨∫ values dt⟩ [s times the unit of the values]."""
        return float(np.sum(self.weight * self.step * values))

    @cached_property
    def life(self) -> float:
        """⟨∫ S dt⟩, the mean life [s]."""
        return self.mean(self.survival)

    @cached_property
    def work(self) -> float:
        """⟨∫ x S dt⟩ [s]."""
        return self.mean(self.stretch * self.survival)

    @cached_property
    def reached(self) -> Array:
        """Probability of reaching the threshold, shape (thresholds, 1)."""
        return np.where(
            self.edges[:, -1:] >= self.end * (1 - 1e-12), np.exp(-self.last_hazard[:, None]), 0.0
        )

    @cached_property
    def approach(self) -> Array:
        """v minus the velocity at which a threshold grows where it is reached [1/s]."""
        change = 1e-6 * self.end
        growth = self.threshold_at(self.end + change) - self.threshold_at(self.end - change)
        return self.speed - growth / (2 * change)

    @staticmethod
    def within(values: Complex, half: Array) -> Complex:
        """∫ values dt from the start of each point's panel, by values (thresholds, panels, points)
        and half lengths (thresholds, panels, 1)."""
        return values @ cumulative().T * half

    def accumulated(self, values: Array) -> tuple[Array, Array]:
        """∫ values dt from birth to each point, (thresholds, points), and to the end."""
        shape = (*self.half.shape[:2], POINTS)
        whole = (values * self.step).reshape(shape).sum(axis=2)
        before = np.cumsum(whole, axis=1) - whole
        inner = self.within(values.reshape(shape), self.half)
        return (before[:, :, None] + inner).reshape(values.shape), whole.sum(axis=1)

    def _hazards(self) -> tuple[Array, Array]:
        hazard, last = self.accumulated(self.rate)
        return np.minimum(hazard, MAX_EXPONENT), np.minimum(last, MAX_EXPONENT)

    def _end(self) -> Array:
        return (self.threshold - self.back) / self.speed

    def young_ages(self, max_age: float, count: int) -> Array:
        """Ages up to a maximum within which young thresholds change [s], shape (at most count,)."""
        del max_age, count
        return np.zeros(0)

    def hazard_held(self, hold: float) -> Array:
        """Hazard in a hold [s] of contacts that were pinned before, shape (thresholds, points)."""
        return np.asarray(self.rate * hold)

    @cached_property
    def force(self) -> float:
        """F(v) = N (k ⟨∫ x S dt⟩ + m η v τ_d)/(⟨∫ S dt⟩ + τ_d) [N]."""
        static = self.config.contacts.static_force
        return (static * self.work + self._drag) / (self.life + self.delay)

    @cached_property
    def force_slope(self) -> float:
        """dF/d ln v [N]; (f_T/f_s) F_s/2 for one high threshold."""
        static = self.config.contacts.static_force
        # The hazard at a stretch is proportional to 1/v, and so is the age.
        life = self.life + self.delay
        work = static * self.work + self._drag
        broken = self.hazard * self.survival
        work_slope = static * (self.mean(self.stretch * broken) - self.work) + self._drag
        life_slope = self.mean(broken) - self.life
        return work_slope / life - work / life * (life_slope / life)

    @property
    def delay(self) -> float:
        """Mean delay [s]."""
        return mean_delay(self.config)

    @property
    def _drag(self) -> float:
        return drag_impulse(self.config, self.velocity)

    def _edges(self, max_panel: float, coarseness: float) -> Array:
        """Ends of the panels over ages, (thresholds, panels + 1); none breaks in the first."""
        end, start = self.end, np.zeros_like(self.end)
        length = self.scale / self.speed
        # The middle of a panel has less than its mean rate: contacts are broken by the age found.
        first = np.linspace(0, 1, SEARCH_PANELS + 1) * np.ones_like(end)
        for number in itertools.count(1):
            ages = start + (end - start) * first
            steps = np.diff(ages, axis=1)
            middle = (ages[:, 1:] + ages[:, :-1]) / 2
            rates = self.rate_at(middle, self.back + self.speed * middle)
            hazard = np.cumsum(rates * steps, axis=1)
            last = np.argmax(hazard > 2 * MAX_HAZARD, axis=1)
            is_over = hazard[:, -1] > 2 * MAX_HAZARD
            rows = np.arange(len(end))
            end = np.where(
                is_over[:, None], ages[rows, np.minimum(last + 2, SEARCH_PANELS)][:, None], end
            )
            # Until it is known where in this range contacts break.
            if number >= MIN_SEARCHES and not np.any(is_over & (last < SEARCH_PANELS // 4)):
                break
        ages = np.linspace(0, 1, SEARCH_PANELS + 1) * end
        rates = self.rate_at(ages, self.back + self.speed * ages)
        rates = np.maximum.accumulate(rates, axis=1) * end
        begin = np.maximum(np.sum(rates < MIN_HAZARD, axis=1) - 1, 0)
        start = ages[np.arange(len(end)), begin][:, None]
        longest = min(MAX_PANEL * coarseness * length, max_panel)
        count = max(MIN_PANELS, math.ceil(float(np.max(end - start)) / longest))
        edges = start + (end - start) * np.linspace(0, 1, count + 1)
        young = self.young_ages(float(np.max(end)), math.ceil(AGEING_PANELS / coarseness))
        young = young[young > np.min(start)]
        edges = np.sort(np.concatenate([edges, np.clip(young, start, end)], axis=1), axis=1)
        return np.concatenate([np.zeros_like(end), edges], axis=1)


class ThermalAgeingLives(ThermalLives):
    """The same of contacts whose thresholds change with age."""

    def _end(self) -> Array:
        return breaking_ages(self.config, self.threshold[:, 0], self.speed)[:, None]

    def young_ages(self, max_age: float, count: int) -> Array:
        # Panels of equal ratios.
        return np.geomspace(0.1 * min(ageing_of(self.config).time, max_age), max_age, count)

    def hazard_held(self, hold: float) -> Array:
        if hold == 0:
            return np.zeros_like(self.rate)
        point, weight = np.polynomial.legendre.leggauss(HOLD_POINTS)
        # Thresholds change with the logarithm of the age.
        first = 1e-2 * min(ageing_of(self.config).time, hold)
        edges = np.concatenate([[0.0], np.geomspace(first, hold, HOLD_PANELS)])
        hazard = np.zeros_like(self.rate)
        for low, high in itertools.pairwise(edges):
            half = (high - low) / 2
            for at, share in zip(low + half * (1 + point), half * weight, strict=True):
                hazard += share * self.rate_at(self.age + at, self.stretch)
        return hazard

    @cached_property
    def force_slope(self) -> float:
        up, down = (
            type(self)(self.config, self.velocity * math.exp(sign * SLOPE_STEP)).force
            for sign in (1, -1)
        )
        return (up - down) / (2 * SLOPE_STEP)


@cache
def cumulative() -> Array:
    """Integrals from -1 to each Gauss point, of values at these points; shape (points, points)."""
    point, _ = np.polynomial.legendre.leggauss(POINTS)
    vander = np.polynomial.legendre.legvander(point, POINTS - 1)
    integrals = np.stack(
        [
            np.polynomial.legendre.legval(
                point, np.polynomial.legendre.legint(np.eye(POINTS)[n], lbnd=-1)
            )
            for n in range(POINTS)
        ],
        axis=1,
    )
    return np.asarray(integrals @ np.linalg.inv(vander))


def _thresholds(config: Config, panel: float, max_panels: int) -> tuple[Array, Array]:
    """Weights and points of a quadrature over the thresholds, in panels of about a length."""
    law = config.contacts.threshold.above(config.contacts.min_threshold)
    weakest, strongest = law.quantile([1 - LEFT_OUT, LEFT_OUT])
    wanted = math.ceil(float(strongest - weakest) / panel)
    panels = min(max_panels, max(MIN_PANELS, wanted))
    return threshold_quadrature(config, panels, POINTS)
