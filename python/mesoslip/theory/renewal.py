"""The renewal equation of slow forward sliding, by collocation, and the stretches of contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special
from scipy.interpolate import BPoly

from mesoslip import _core
from mesoslip.array_types import Array
from mesoslip.configuration.kernel_parameters import Parameters, named
from mesoslip.configuration.threshold_law import ThresholdLaw
from mesoslip.execution.interruptible import interruptible
from mesoslip.simulation.kernel import checked
from mesoslip.theory.table_lives import TableLives, table_lives

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Points of collocation in a panel: the force converges with the order of this number.
POINTS = 12


@dataclass(frozen=True)
class RenewalSolution:
    """Polynomials of the dimensionless displacement, and numbers of the solver."""

    edges: Array
    point: Array
    force: BPoly
    slope: BPoly
    stiffness: BPoly
    breaks: BPoly
    conservation_error: float
    mismatch: float


def solve_renewal(
    parameters: Parameters, start: float, width: float, panels: int
) -> RenewalSolution:
    """Solve the renewal equation of a law by `law_parameters`, with start and width of panels over
    the mean breaking stretch."""
    point, breaks, slope, force, stiffness, pinned, mismatch = checked(
        interruptible(_core.force_curve, *named(parameters), start, width, panels, POINTS)
    )
    edges: Array = start + width * np.arange(panels + 1, dtype=np.float64)
    return RenewalSolution(
        edges,
        point,
        force=_polynomials(edges, point, force),
        slope=_polynomials(edges, point, slope),
        stiffness=_polynomials(edges, point, stiffness),
        breaks=_polynomials(edges, point, breaks),
        conservation_error=float(np.max(np.abs(pinned - 1))),
        mismatch=float(mismatch),
    )


def _polynomials(edges: Array, point: Array, values: Array) -> BPoly:
    """The polynomials through values at the points of each panel, shape (points, panels)."""
    degree = len(point) - 1
    k = np.arange(degree + 1)
    bernstein = special.comb(degree, k) * point[:, None] ** k * (1 - point[:, None]) ** (degree - k)
    return BPoly(np.linalg.solve(bernstein, values), edges, extrapolate=False)


def stretch_density(
    config: Config,
    breaks: Callable[[Array], Array],
    stretch: Array,
    displacement: float,
    *,
    newborn_width: float,
    mean_life: float,
) -> tuple[Array, float]:
    """Q(x; X) at stretches x, shape (points), and the fraction of contacts at x = X, which add up
    to 1; from Γ over displacement and the mean life."""
    return _Density(config, breaks, newborn_width, mean_life).at(stretch, displacement)


class _Density:
    """Q(x; X) of one configuration: contacts that attached within X, by Γ(X) and the probability to
    be unbroken, and those of the start. All lengths are over the mean breaking stretch, all forces
    over the mean threshold."""

    def __init__(
        self,
        config: Config,
        breaks: Callable[[Array], Array],
        newborn_width: float,
        mean_life: float,
    ) -> None:
        self.contacts = config.contacts
        self.law: ThresholdLaw = self.contacts.threshold.above(self.contacts.back_force_ratio)
        self.table: TableLives | None = table_lives(config)
        self.breaks = breaks
        self.newborn_width = newborn_width
        self.mean_life = mean_life

    def at(self, x: Array, moved: float) -> tuple[Array, float]:
        density = self._newborn(x, moved) + self._first(x, moved)
        if self.contacts.initial != "relaxed":
            return density, 0.0
        if self.table is not None:
            return density, float(np.sum(self.table.above(np.array([moved]))))
        return density, float(self.law.survival(self._threshold_of(np.array(moved))))

    def _threshold_of(self, stretch: Array) -> Array:
        """Threshold of contacts that break at a stretch."""
        if self.contacts.coupling == "equal":
            return stretch
        return np.maximum(stretch, 0.0) ** 2

    def _average_between(
        self, lower: Array, upper: Array, function: Callable[[Array], Array]
    ) -> Array:
        """E[f(u); lower < u < upper] for arrays of limits, by Gauss's rule."""
        law = self.law
        node, weight = np.polynomial.legendre.leggauss(100)
        # As a function of the normal deviate of the same probability no law has narrow features.
        low, high = (
            special.ndtri(np.clip(law.survival(limit), 1e-17, 1 - 1e-16))
            for limit in (upper, lower)
        )
        z = low[..., None] + (high - low)[..., None] * (node + 1) / 2
        values = function(law.quantile(special.ndtr(z))) * np.exp(-0.5 * z**2)
        average: Array = np.sum(values * weight, axis=-1) * (high - low) / 2
        return average / math.sqrt(2 * math.pi)

    def _newborn(self, x: Array, moved: float) -> Array:
        """Density of those that attached within X."""
        contacts, law = self.contacts, self.law
        if not contacts.reattach:
            return np.zeros_like(x)
        breaks = self.breaks
        back = contacts.back_force_ratio
        width = self.newborn_width
        node, weight = np.zeros(1), np.ones(1)
        if width > 0:
            node, weight = special.roots_hermitenorm(32)
            weight = weight / math.sqrt(2 * math.pi)
        lowest = np.maximum(self._threshold_of(np.maximum(x, 0.0)), law.minimum)
        total, acceptance = np.zeros_like(x), 0.0
        for shift, part in zip(width * node, weight, strict=True):
            gap = x - shift
            if self.table is not None:
                density = self.table.newborn_density(
                    x, moved, shift, lambda at: np.nan_to_num(breaks(at))
                )
                acceptance += part * self.table.accepted(shift)
            elif contacts.coupling == "equal":
                age = gap - back
                rate = np.where((age >= 0) & (age <= moved), breaks(moved - age), 0.0)
                density = rate * law.survival(lowest)
                acceptance += part * float(law.survival(back + shift))
            else:
                # Ages between 0 and X belong to x_b(u) between gap and gap - X.
                lower, upper = (
                    np.where(edge > 0, (back / np.maximum(edge, 1e-9)) ** 2, np.inf)
                    for edge in (gap, gap - moved)
                )
                lower = np.maximum(np.where(gap > 0, lower, np.inf), lowest)

                def attached(threshold: Array, gap: Array = gap) -> Array:
                    birth = moved - gap[:, None] + back / np.sqrt(threshold)
                    return np.nan_to_num(breaks(birth))

                density = self._average_between(lower, np.maximum(lower, upper), attached)
                root = 0.5 * (shift + math.sqrt(shift**2 + 4 * back))
                acceptance += part * float(law.survival(root**2 if root > 0 else 0.0))
            total += part * density
        return total / acceptance

    def _first(self, x: Array, moved: float) -> Array:
        """Density of those of the start, unless all are at one stretch."""
        contacts, law = self.contacts, self.law
        if self.table is not None and contacts.initial != "relaxed":
            return self.table.first_density(x, moved, contacts.initial, self.mean_life)
        equal = contacts.coupling == "equal"
        back = contacts.back_force_ratio
        lowest = np.maximum(self._threshold_of(np.maximum(x, 0.0)), law.minimum)
        if contacts.initial == "uniform":
            density = self._average_between(
                lowest, np.full_like(x, np.inf), lambda u: 1 / (u if equal else np.sqrt(u))
            )
            return np.where(x >= moved, density, 0.0)
        if contacts.initial == "steady":
            start = np.maximum(x - moved, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                least = np.where(start > 0, (back / start) ** 2, np.inf if back > 0 else 0.0)
            if equal:
                least = np.where(x - moved >= back, 0.0, np.inf)
            least = np.where(x < moved, np.inf, least)
            return law.survival(np.maximum(lowest, least)) / self.mean_life
        return np.zeros_like(x)
