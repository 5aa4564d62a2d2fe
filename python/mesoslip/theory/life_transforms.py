"""Averages over the lives of contacts that break at fixed displacements, and their transforms.

A contact attaches with the stretch x_b and breaks at x_s, after a life x_s - x_b of displacement
(model sections 2 and 4). Stretches over f_s/k, stiffness over k, mass over m.
"""

from __future__ import annotations

import math
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.array_types import Array, Complex
from mesoslip.configuration.threshold_law import ThresholdLaw
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.threshold_laws.table import law_cells
from mesoslip.theory.table_lives import TableLives, sums_of_panels, table_lives

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Panels over the lives, and points of each: a law is a polynomial in each panel.
PANELS, POINTS = 100, 10
# Probability beyond either end of the quadrature over a threshold law.
LEFT_OUT = 1e-16
# Where newborn contacts bear different forces thresholds are summed between normal deviates of this
# size, in panels of a width of forces over that of thresholds, between two numbers of them.
DEVIATES, PANEL_WIDTH, SUMMED_PANELS = 8.2, 1.0, (20, 400)
# Arguments beyond which integrals of a panel come from a recurrence, and points of the rule that
# they come from otherwise, which is exact to rounding there.
LARGE, QUADRATURE_POINTS = 12.0, 26


class Lives(NamedTuple):
    """Averages over the threshold law; stretches over f_s/k, stiffness over k, mass over m."""

    mean_life: float
    spread: float
    """Standard deviation of the lives."""
    stiffness: float
    """⟨k⟩."""
    newborn_force: float
    """⟨k x_b⟩."""
    broken_force: float
    """⟨k x_s⟩."""
    work: float
    """⟨k (x_s² - x_b²)/2⟩."""
    mass: float
    """⟨m⟩."""


class Transforms(NamedTuple):
    """Averages with e^(-s (x_s - x_b)), for each s."""

    life: Complex
    """ψ(s)."""
    stiffness: Complex
    """⟨k e^(-s (x_s - x_b))⟩."""
    broken_force: Complex
    """⟨k x_s e^(-s (x_s - x_b))⟩."""
    mass: Complex
    """⟨m e^(-s (x_s - x_b))⟩."""


class LifeTransforms:
    """Averages over lives without ageing and temperature, of the configuration or with another
    relative width of thresholds."""

    def __init__(self, config: Config, relative_width: float) -> None:
        self.config = config
        self.relative_width = relative_width

    @cached_property
    def _law(self) -> ThresholdLaw:
        """The threshold law; of another width than samples have, a lognormal one."""
        threshold, minimum = self.config.contacts.threshold, self.config.contacts.min_threshold
        if self.relative_width == threshold.relative_width:
            return threshold.above(minimum)
        name = "lognormal" if threshold.kind.is_sampled else threshold.law
        return ThresholdLaw(name, self.relative_width, minimum)

    @cached_property
    def _panels(self) -> tuple[Array, float, Array]:
        """Middles of the panels, half their width, and coefficients (panels, points, averages) of
        Legendre polynomials for density, stiffness, force at breaking and mass."""
        table = self._table
        if table is None:
            first, last = self._life(self._law.quantile([1 - LEFT_OUT, LEFT_OUT]))
            spread = DEVIATES * self.config.contacts.newborn_width
            first, last = (first, last) if not spread else (max(0.0, first - spread), last + spread)
        else:
            first, last = np.min(table.lives[0]), np.max(table.lives[1])
        edges = np.linspace(first, last, PANELS + 1)
        half = (edges[1] - edges[0]) / 2
        middle = (edges[1:] + edges[:-1]) / 2
        if table is not None:
            return middle, half, table.projected(edges, POINTS)
        if LAWS[self._law.law].is_sampled and not self.config.contacts.newborn_width:
            return middle, half, self._projected(edges)
        point, weight = np.polynomial.legendre.leggauss(POINTS)
        lives = middle[:, None] + half * point
        density, averaged = self._at_lives(lives)
        density /= half * np.sum(density * weight)
        values = density[:, :, None] * averaged
        legendre = np.polynomial.legendre.legvander(point, POINTS - 1).T
        order = (np.arange(POINTS) + 0.5)[:, None]
        coefficients = np.einsum("nj,pja->pna", order * legendre * weight, values)
        return middle, half, half * coefficients

    @cached_property
    def _table(self) -> TableLives | None:
        """Contacts with the stiffnesses of a table; None for others, and with another width."""
        if self.relative_width != self.config.contacts.threshold.relative_width:
            return None
        return table_lives(self.config)

    def _life(self, threshold: Array) -> Array:
        """Life x_s - x_b of contacts of a threshold, where x_b is the mean one."""
        contacts = self.config.contacts
        back = contacts.back_force_ratio
        if contacts.coupling == "equal":
            return threshold - back
        return np.sqrt(threshold) - back / np.sqrt(threshold)

    def _at_lives(self, lives: Array) -> tuple[Array, Array]:
        """Density of lives, and 1, stiffness, force at breaking and mass of contacts of a life."""
        contacts = self.config.contacts
        back = contacts.back_force_ratio
        if contacts.newborn_width:
            return self._at_lives_of_any_newborn(lives)
        if contacts.coupling == "scaled":
            root = (lives + np.sqrt(lives**2 + 4 * back)) / 2
            threshold, stretch, stiffness, mass = root**2, root, root, root**2
            # du/dl, as l = u^(1/2) - b u^(-1/2).
            density = self._law.density(threshold) * 2 * root / (1 + back / root**2)
        else:
            threshold = stretch = lives + back
            stiffness = mass = np.ones_like(lives)
            density = self._law.density(threshold)
        return density, np.stack(
            [np.ones_like(lives), stiffness, stiffness * stretch, mass], axis=-1
        )

    def _at_lives_of_any_newborn(self, lives: Array) -> tuple[Array, Array]:
        """The same where newborn contacts bear forces of a normal law, cut off at the threshold:
        sums over thresholds u, those of a life l having attached with the force u - l."""
        # It takes long to import, and few need it.
        from scipy import special

        contacts = self.config.contacts
        width = contacts.newborn_width
        panels = 2 * DEVIATES * self.relative_width / (PANEL_WIDTH * width)
        panels = int(np.clip(math.ceil(panels), *SUMMED_PANELS))
        node, weight = np.polynomial.legendre.leggauss(POINTS)
        edges = np.linspace(-DEVIATES, DEVIATES, panels + 1)
        deviate = (edges[:-1, None] + (1 + node) * DEVIATES / panels).ravel()
        threshold = self._law.quantile(special.ndtr(deviate))
        share = np.tile(weight, panels) * np.exp(-0.5 * deviate**2)
        flat = lives.ravel()
        density, mean = np.empty_like(flat), np.empty_like(flat)
        for start in range(0, flat.size, 200):
            force = threshold - flat[start : start + 200, None]
            found = share * np.exp(-0.5 * ((force - contacts.back_force_ratio) / width) ** 2)
            found = np.where(np.abs(force) < threshold, found, 0.0)
            density[start : start + 200] = found.sum(axis=1)
            mean[start : start + 200] = found @ threshold
        with np.errstate(invalid="ignore", divide="ignore"):
            broken = np.where(density > 0, mean / density, flat)
        one = np.ones_like(flat)
        values = np.stack([one, one, broken, one], axis=-1)
        return density.reshape(lives.shape), values.reshape(*lives.shape, -1)

    def _projected(self, edges: Array) -> Array:
        """Coefficients of panels for a law whose density is constant in cells: integrals over the
        parts of cells in each panel."""
        law = self._law
        assert law.samples is not None
        cells = self._life(law_cells(law.samples, law.weights).edges[1:])
        ends = np.unique(np.clip(np.concatenate([edges, cells]), edges[0], edges[-1]))
        point, weight = np.polynomial.legendre.leggauss(POINTS)
        half = np.diff(ends)[:, None] / 2
        lives = ends[:-1, None] + half * (1 + point)
        density, averaged = self._at_lives(lives)
        share = density * half * weight
        share /= np.sum(share)
        panel = np.clip(np.searchsorted(edges, lives[:, 0], "right") - 1, 0, PANELS - 1)
        return sums_of_panels(edges, panel, lives, share, averaged)

    @cached_property
    def averages(self) -> Lives:
        """Averages over the lives of contacts."""
        middle, half, coefficients = self._panels
        # Of the polynomials only the first has a mean, and the first two a first moment.
        mean = 2 * coefficients[:, 0].sum(axis=0)
        linear = 2 * middle @ coefficients[:, 0] + 2 / 3 * half * coefficients[:, 1].sum(axis=0)
        square = (
            2 * (middle**2 + half**2 / 3) @ coefficients[:, 0, 0]
            + 4 / 3 * half * middle @ coefficients[:, 1, 0]
            + 4 / 15 * half**2 * coefficients[:, 2, 0].sum()
        )
        life = float(linear[0])
        # k (x_s² - x_b²)/2 = k x_s l - k l²/2. The force k x_b is the back force; where newborn
        # contacts bear different ones, all have one stiffness, and x_b = x_s - l.
        back = self.config.contacts.back_force_ratio
        if self.config.contacts.newborn_width:
            back = float(mean[2]) - life
        quadratic = (
            2 * (middle**2 + half**2 / 3) @ coefficients[:, 0, 1]
            + 4 / 3 * half * middle @ coefficients[:, 1, 1]
            + 4 / 15 * half**2 * coefficients[:, 2, 1].sum()
        )
        return Lives(
            mean_life=life,
            spread=math.sqrt(max(0.0, float(square) - life**2)),
            stiffness=float(mean[1]),
            newborn_force=back,
            broken_force=float(mean[2]),
            work=float(linear[2] - quadratic / 2),
            mass=float(mean[3]),
        )

    def transforms(self, s: Complex) -> Transforms:
        """Averages with e^(-s l): each polynomial of a panel is integrated exactly."""
        middle, half, coefficients = self._panels
        result = np.empty((len(s), 4), dtype=np.complex128)
        flat = coefficients.reshape(PANELS, -1)
        for start in range(0, len(s), 4096):
            part = s[start : start + 4096]
            side = np.where(part.real < 0, -1.0, 1.0)
            nearest = middle - half * side[:, None]
            sums = (np.exp(-part[:, None] * nearest) @ flat).reshape(len(part), POINTS, 4)
            integrals = _legendre_transforms(half * part, side)
            result[start : start + 4096] = np.einsum("sn,sna->sa", integrals, sums)
        return Transforms(*result.T)


@cache
def _quadrature() -> tuple[Array, Array]:
    """Points between -1 and 1, and weighted Legendre polynomials there, shape (points, orders)."""
    point, weight = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    return point, weight[:, None] * np.polynomial.legendre.legvander(point, POINTS - 1)


def _legendre_transforms(z: Complex, side: Array) -> Complex:
    """∫ P_n(x) e^(-z (x + side)) dx over [-1, 1], shape (arguments, orders), with the sign of the
    real part of z as the side."""
    result = np.empty((len(z), POINTS), dtype=np.complex128)
    is_large = np.abs(z) > LARGE
    point, legendre = _quadrature()
    near = z[~is_large, None] * (point + side[~is_large, None])
    result[~is_large] = np.exp(-near) @ legendre
    # From e^(-z x) by parts: I_(n+1) = I_(n-1) - (2n + 1)/z I_n but for the sign (-1)^n.
    far, side = z[is_large], side[is_large]
    ends = np.exp(far * (1 - side)), np.exp(-far * (1 + side))
    orders = [(ends[0] - ends[1]) / far, (ends[0] + ends[1] - (ends[0] - ends[1]) / far) / far]
    for n in range(1, POINTS - 1):
        orders.append(orders[n - 1] - (2 * n + 1) / far * orders[n])
    result[is_large] = np.stack(orders, axis=-1) * (-1.0) ** np.arange(POINTS)
    return result
