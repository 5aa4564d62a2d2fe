"""Contacts with the stiffnesses of a table: their lives, and how stretches are distributed.

The table has cells of break stretches, in each of which the density and the stiffness are constant.
A contact of stiffness k attaches with the stretch f_b/k, so that the cells overlap as cells of
lives. Stretches over f_s/k, stiffness over the mean one, mass over the mean one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Numbers of stretches times cells that are averaged at once.
MAX_TOGETHER = 2_000_000


class TableLives(NamedTuple):
    """Cells of break stretches, without contacts that the back force breaks; shape (cells) each."""

    low: Array
    high: Array
    share: Array
    """Probability; the sum is 1."""
    stiffness: Array
    attached: Array
    """Stretch at which contacts attach, f_b/k."""
    back_force: float
    """f_b/f_s."""
    mean_square: float
    """Of the stiffness of all contacts, to which the mean mass belongs."""

    @property
    def lives(self) -> tuple[Array, Array]:
        """Shortest and longest life of each cell."""
        return self.low - self.attached, self.high - self.attached

    def projected(self, edges: Array, points: int) -> Array:
        """Coefficients of Legendre polynomials in panels of lives between ``edges``.

        Of the density, and of the density times stiffness, force at breaking and mass; shape
        (panels, points, 4).
        """
        panels, (shortest, longest) = len(edges) - 1, self.lives
        first, last = (
            np.clip(np.searchsorted(edges, one, "right") - 1, 0, panels - 1)
            for one in (shortest, longest)
        )
        # Each cell once for each panel that it has a part in.
        times = last - first + 1
        cell = np.repeat(np.arange(len(times)), times)
        panel = np.arange(len(cell)) - np.repeat(np.cumsum(times) - times - first, times)
        low = np.maximum(shortest[cell], edges[panel])
        half = (np.minimum(longest[cell], edges[panel + 1]) - low)[:, None] / 2
        point, weight = np.polynomial.legendre.leggauss(points)
        lives = low[:, None] + half * (1 + point)
        share = (self.share / (self.high - self.low))[cell, None] * half * weight
        k = np.broadcast_to(self.stiffness[cell, None], lives.shape)
        averaged = np.stack(
            [np.ones_like(lives), k, k * lives + self.back_force, k**2 / self.mean_square], axis=-1
        )
        return sums_of_panels(edges, panel, lives, share, averaged)

    def above(self, stretch: Array) -> Array:
        """Probability that contacts of each cell break above stretches (stretches, cells)."""
        part = (self.high - stretch[:, None]) / (self.high - self.low)
        return self.share * np.clip(part, 0, 1)

    def newborn_density(
        self, stretch: Array, moved: float, shift: float, breaks: Callable[[Array], Array]
    ) -> Array:
        """Density of stretches of contacts attached within ``moved`` of the start, with ``shift``
        beyond f_b/k, by Γ over displacement."""

        def density(x: Array) -> Array:
            age = x[:, None] - shift - self.attached
            rate = np.where((age >= 0) & (age <= moved), breaks(moved - age), 0.0)
            values: Array = np.sum(rate * self.above(x), axis=1)
            return values

        return self._by_parts(density, stretch)

    def first_density(self, stretch: Array, moved: float, initial: str, mean_life: float) -> Array:
        """Density of stretches of the first generation, that was not relaxed."""

        def uniform(x: Array) -> Array:
            low = np.maximum(self.low, np.maximum(x[:, None], np.finfo(float).tiny))
            parts = np.log(np.maximum(self.high / low, 1)) * self.share / (self.high - self.low)
            values: Array = np.sum(parts, axis=1)
            return np.where(x >= moved, values, 0.0)

        def steady(x: Array) -> Array:
            slid = x[:, None] - moved >= self.attached
            values: Array = np.sum(np.where(slid, self.above(x), 0.0), axis=1) / mean_life
            return values

        return self._by_parts(uniform if initial == "uniform" else steady, stretch)

    def accepted(self, shift: float) -> float:
        """Probability that contacts are not broken that attach at f_b/k and a shift."""
        at = self.attached + shift
        part = (self.high - at) / (self.high - self.low)
        return float(np.sum(self.share * np.clip(part, 0, 1)))

    def _by_parts(self, density: Callable[[Array], Array], stretch: Array) -> Array:
        parts = np.array_split(stretch, 1 + len(stretch) * len(self.low) // MAX_TOGETHER)
        return np.concatenate([density(one) for one in parts])


def table_lives(config: Config) -> TableLives | None:
    """Contacts with the stiffnesses of a table; None for others."""
    contacts = config.contacts
    cells = contacts.threshold.stretch_cells
    if cells is None:
        return None
    attached = contacts.back_force_ratio / cells.stiffnesses
    high = cells.edges[1:]
    low = np.maximum(cells.edges[:-1], attached)
    left = low < high
    share = cells.weights * (high - low) / np.diff(cells.edges)
    return TableLives(
        low[left],
        high[left],
        (share / np.sum(share[left]))[left],
        cells.stiffnesses[left],
        attached[left],
        contacts.back_force_ratio,
        float(np.sum(cells.weights * cells.stiffnesses**2)),
    )


def sums_of_panels(
    edges: Array, panel: NDArray[np.integer[Any]], lives: Array, share: Array, averaged: Array
) -> Array:
    """Coefficients of Legendre polynomials (panels, points, averages) from parts of cells.

    ``panel`` is the number of the panel of each part, shape (parts), between even ``edges``;
    ``lives`` and ``share`` are points and probabilities, shape (parts, points), with the values
    ``averaged``, shape (parts, points, averages).
    """
    points = lives.shape[1]
    place = 2 * (lives - edges[panel][:, None]) / (edges[1] - edges[0]) - 1
    legendre = np.polynomial.legendre.legvander(place, points - 1)
    order = np.arange(points) + 0.5
    parts = np.einsum("pj,pjn,pja->pna", share, order * legendre, averaged)
    coefficients = np.zeros((len(edges) - 1, *parts.shape[1:]))
    np.add.at(coefficients, panel, parts)
    return coefficients
