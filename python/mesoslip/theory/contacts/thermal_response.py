"""How activated contacts in steady sliding answer a small motion of the slider.

Averages over thresholds of the functions of the age that the response Λ(λ) is made of, and their
transforms, for any number of rates λ at once. All thresholds share one grid of ages, so that each
exponential e^(-λ a) is needed once. The derivation is in ``docs/temperature.md``.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array, Complex
from mesoslip.theory.contacts.thermal_lives import AGEING_PANELS, POINTS, ThermalLives, cumulative

# Product of a rate and the length of a panel up to which its quadrature has rounding errors only.
MAX_TURN = 6.0
# Hazards below which contacts of a threshold have not begun to break, and above which none is left.
BEGUN, GONE = 1e-18, 50.0
# Hazard of a panel beyond which it makes no difference.
MAX_HAZARD = 1e4
# Rates in one batch, which share an array of rates and thresholds.
BATCH = 64


class Motion(NamedTuple):
    """Pinned contacts under a perturbation ε e^(λt) of the slider, ε in f_s/k, for each rate."""

    lost: Complex
    """Contacts that have broken early [s]."""
    held: Complex
    """Force of the contacts at unchanged births [s]."""
    number: Complex
    """Transform of the number of a contact's life, ⟨∫ S e^(-λa) da⟩ [s]."""
    load: Complex
    """The same of its force, ⟨∫ x S e^(-λa) da⟩ [s]."""


class _Panel(NamedTuple):
    """Ages between two edges; only some thresholds break there."""

    start: float
    end: float
    age: Array
    step: Array
    thresholds: slice
    alive: Array
    """Weights with S and the weight of the threshold, shape (thresholds, points)."""
    rate: Array
    """h, shape (thresholds, points)."""
    within: Array
    """⟨S(a) h(a')⟩ with the weights of a' < a in the panel, shape (points, points)."""


class ThermalResponse:
    """Averages over thresholds and ages, with panels of a length [s] where contacts break."""

    def __init__(self, lives: ThermalLives, length: float) -> None:
        self.lives = lives
        self._point, self._share = np.polynomial.legendre.leggauss(POINTS)
        self._begin = float(np.min(lives.edges[:, 1]))
        self._panels: list[_Panel] = []
        # ⟨S⟩ and ⟨S H⟩ at the points of all panels, with their weights.
        alive, hazards = [], []
        hazard = np.zeros_like(lives.weight)
        edges = self._edges(length)
        for start, end in itertools.pairwise(edges):
            panel, one_alive, one_hazard = self._panel(start, end, hazard)
            self._panels.append(panel)
            alive.append(one_alive)
            hazards.append(one_hazard)
            hazard[panel.thresholds] += panel.rate @ panel.step[:, None]
        self._age = np.concatenate([one.age for one in self._panels])
        self._stretch = lives.back + lives.speed * self._age
        self._alive, self._hazard = np.concatenate(alive), np.concatenate(hazards)

    def _edges(self, length: float) -> Array:
        lives = self.lives
        end = float(np.max(lives.edges[:, -1]))
        count = max(1, math.ceil((end - self._begin) / length))
        edges: Array = np.linspace(self._begin, end, count + 1)
        young = lives.young_ages(end, AGEING_PANELS // 2)
        return np.union1d(edges, young[young > self._begin])

    def _panel(self, start: float, end: float, hazard: Array) -> tuple[_Panel, Array, Array]:
        """A panel, and ⟨S⟩ and ⟨S H⟩ at its points with their weights, by H at its start, shape
        (thresholds, 1)."""
        lives = self.lives
        half = (end - start) / 2
        age, step = start + half * (1 + self._point), half * self._share
        is_alive = (hazard < GONE) & (lives.end > start)
        last = hazard + (end - start) * self._rates(np.array([end]))
        active = np.flatnonzero(is_alive & ((last > BEGUN) | (lives.end < end)))
        part = slice(active[0], active[-1] + 1) if active.size else slice(0, 0)
        rate = np.minimum(self._rates(age)[part], MAX_HAZARD / (end - start))
        inner = hazard[part] + half * (rate @ cumulative().T)
        survival = step * np.exp(-inner) * (lives.end[part] > start)
        cut = np.flatnonzero((lives.end[part] > start) & (lives.end[part] < end))
        if cut.size:
            survival[cut] = self._cut(start, end, np.arange(len(hazard))[part][cut], hazard)
        alive = lives.weight[part] * survival
        outside = is_alive.copy()
        outside[part] = False
        return (
            _Panel(start, end, age, step, part, alive, rate, alive.T @ rate * cumulative() * half),
            alive.sum(axis=0) + float(lives.weight[outside].sum()) * step,
            np.sum(alive * inner, axis=0),
        )

    def _rates(self, age: Array) -> Array:
        """h of all thresholds at ages, shape (thresholds, ages)."""
        return self.lives.rate_at(age[None, :], self.lives.back + self.lives.speed * age[None, :])

    def _cut(self, start: float, end: float, rows: NDArray[np.intp], hazard: Array) -> Array:
        """S of contacts that reach their thresholds within a panel, shape (thresholds, points), by
        weights of an integral to these ages."""
        lives = self.lives
        half = (np.clip(lives.end, start, end) - start) / 2
        age = start + half * (1 + self._point)
        rate = lives.rate_at(age, lives.back + lives.speed * age)
        within = (hazard + half * (rate @ cumulative().T))[rows]
        half, age = half[rows], age[rows]
        share = half * self._share * np.exp(-within)
        place = 2 * (age - start) / (end - start) - 1
        legendre = np.polynomial.legendre.legvander(place, POINTS - 1)
        moments = np.einsum("uk,ukn->un", share, legendre)
        # From moments to weights at the points: P_n there, times the weights of the rule.
        orders = np.arange(POINTS) + 0.5
        at_points = np.polynomial.legendre.legvander(self._point, POINTS - 1)
        weights: Array = moments * orders @ at_points.T * self._share
        return weights

    def motion(self, rate: Complex) -> Motion:
        """The response to rates λ [1/s], shape (rates,)."""
        batches = [
            self._motion(rate[first : first + BATCH]) for first in range(0, len(rate), BATCH)
        ]
        return Motion(*(np.concatenate(one) for one in zip(*batches, strict=True)))

    def _motion(self, rate: Complex) -> Motion:
        lives = self.lives
        decay = np.exp(-rate[:, None] * self._age)
        missing = -np.expm1(-rate[:, None] * self._age)
        early, loaded = self._early_breaks(rate)
        early -= decay @ self._hazard
        loaded -= decay @ (self._stretch * self._hazard)
        ended, end_load = self._ends(rate)
        young_held, young, young_load = self._unbroken(rate)
        alive = self._alive
        return Motion(
            early / lives.scale + ended,
            missing @ alive - loaded / lives.scale - end_load + young_held,
            decay @ alive + young,
            decay @ (self._stretch * alive) + young_load,
        )

    def _early_breaks(self, rate: Complex) -> tuple[Complex, Complex]:
        """⟨∫ S J da⟩ with J(a) = ∫_0^a h(a') e^(-λ(a - a')) da', and with x S for S."""
        lives = self.lives
        state = np.zeros((len(rate), len(lives.weight)), dtype=np.complex128)
        early, loaded = np.zeros((2, len(rate)), dtype=np.complex128)
        for panel in self._panels:
            part = panel.thresholds
            since = np.exp(-rate[:, None] * (panel.age - panel.start))
            each = state[:, part] @ panel.alive + (1 / since) @ panel.within.T
            each *= since
            early += each.sum(axis=1)
            loaded += each @ (lives.back + lives.speed * panel.age)
            left = panel.step * np.exp(-rate[:, None] * (panel.end - panel.age))
            state[:, part] *= np.exp(-rate * (panel.end - panel.start))[:, None]
            state[:, part] += left @ panel.rate.T
        return early, loaded

    def _ends(self, rate: Complex) -> tuple[Complex, Complex]:
        """Contacts that reach their thresholds early, and the force that they bore."""
        lives = self.lives
        some = lives.reached[:, 0] > 0
        end = lives.end[some, 0]
        share = (lives.weight * lives.reached / lives.approach)[some, 0]
        missing = -np.expm1(-rate[:, None] * end)
        return missing @ share, missing @ (share * (lives.back + lives.speed * end))

    def _unbroken(self, rate: Complex) -> tuple[Complex, Complex, Complex]:
        """Integrals of 1 - e^(-λa), e^(-λa) and x e^(-λa) while none breaks [s]."""
        lives, start = self.lives, self._begin
        half = start / 2
        age, step = half * (1 + self._point), half * self._share
        decay = np.exp(-rate[:, None] * age)
        held = -np.expm1(-rate[:, None] * age) @ step
        number, load = decay @ step, decay @ (step * (lives.back + lives.speed * age))
        fast = np.abs(rate) * start > MAX_TURN
        at = rate[fast]
        last = np.exp(-at * start)
        number[fast] = -np.expm1(-at * start) / at
        held[fast] = start - number[fast]
        moved = (number[fast] - start * last) / at
        load[fast] = lives.back * number[fast] + lives.speed * moved
        return held, number, load

    def fast_motion(self, rate: Complex) -> Motion:
        """The response to rates much larger than those of breaking, to first order in 1/λ."""
        lives = self.lives
        breaking = lives.survival * lives.rate / lives.scale
        ended = lives.weight * lives.reached / lives.approach
        end_stretch = lives.back + lives.speed * lives.end
        lost = lives.mean(breaking) / rate + np.sum(ended)
        held = lives.life - (1 + lives.mean(lives.stretch * breaking)) / rate
        held -= np.sum(ended * end_stretch)
        return Motion(lost, held, 1 / rate, lives.back / rate)
