"""The b-value of sizes by Aki's likelihood, and the decay of rates by Omori's law.

A magnitude is the decimal logarithm of a size. With the probability 10^(-b M) of a larger one,
sizes follow a power law of exponent 1 + b.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Width of a bin of magnitudes, and the distance of the completeness from the fullest one.
BIN, MARGIN = 0.1, 0.2
# Maximum probability at which the law is rejected.
REJECTED = 0.05
# Minimum number of events of a fit.
MIN_EVENTS = 20
# Minimum gain of Akaike's criterion for a decay.
MIN_GAIN = 2.0


@dataclass(frozen=True)
class BValue:
    """The b-value of a catalogue, with its standard error."""

    value: float
    error: float
    completeness: float
    """Minimum magnitude of the fit."""
    count: int
    """Events of that magnitude or larger."""
    p_value: float
    """Probability of as large a distance from the law, if it holds."""


def b_value(sizes: Array, completeness: float | None = None) -> BValue | None:
    """Aki's b-value of positive sizes; None for too few.

    The completeness is by default the maximum curvature of the distribution, with a margin of 0.2
    (Woessner and Wiemer, Bull. Seismol. Soc. Am. 95, 684 (2005)), or above it the first from which
    on the law is not rejected. The error is that of Shi and Bolt
    (ibid. 72, 1677 (1982)).
    """
    sizes = np.asarray(sizes, dtype=float)
    magnitude = np.log10(sizes[np.isfinite(sizes) & (sizes > 0)])
    if magnitude.size < MIN_EVENTS:
        return None
    if completeness is not None:
        return _fit(magnitude, completeness)
    found = _fit(magnitude, _fullest(magnitude))
    while found is not None and found.p_value < REJECTED:
        # The detection of events grows over a wide range, or they follow no such law.
        higher = _fit(magnitude, found.completeness + BIN)
        if higher is None:
            break
        found = higher
    return found


def _fullest(magnitude: Array) -> float:
    """Completeness by the maximum curvature."""
    edges = np.arange(magnitude.min(), magnitude.max() + BIN, BIN)
    if edges.size < 3:
        return float(magnitude.min())
    fullest = int(np.argmax(np.histogram(magnitude, edges)[0]))
    # Below the first bin no event is missing.
    return float(edges[fullest] + (MARGIN if fullest else 0.0))


def _fit(magnitude: Array, completeness: float) -> BValue | None:
    """Aki's estimate from magnitudes above a completeness; None for too few."""
    kept = magnitude[magnitude >= completeness]
    if kept.size < MIN_EVENTS:
        return None
    excess = float(kept.mean()) - completeness
    if excess <= 0:
        return None
    value = math.log10(math.e) / excess
    scatter = math.sqrt(float(np.sum((kept - kept.mean()) ** 2)) / kept.size / (kept.size - 1))
    error = math.log(10) * value**2 * scatter
    return BValue(value, error, completeness, kept.size, _p_value(kept - completeness))


def _p_value(excess: Array) -> float:
    """Probability of the distance of an exponential distribution whose rate was fitted (Stephens,
    J. Am. Stat. Assoc. 69, 730 (1974))."""
    count = excess.size
    probability = -np.expm1(-np.sort(excess) / excess.mean())
    steps = np.arange(count + 1) / count
    distance = float(max((steps[1:] - probability).max(), (probability - steps[:-1]).max()))
    root = math.sqrt(count)
    modified = (distance - 0.2 / count) * (root + 0.26 + 0.5 / root)
    # His table of upper points.
    points, levels = (0.926, 0.99, 1.094, 1.19, 1.308), (0.15, 0.10, 0.05, 0.025, 0.01)
    logarithm = np.interp(modified, points, np.log(levels), left=0.0, right=math.log(0.01))
    return float(np.exp(logarithm)) if modified >= points[0] else 1.0


@dataclass(frozen=True)
class Omori:
    """The rate K (t + c)^-p + background after a main event, with standard errors."""

    p: float
    p_error: float
    c: float
    c_error: float
    productivity: float
    """K, for each main event [s^(p-1)]."""
    background: float
    """Rate of other events [1/s]."""
    main_count: int
    count: int
    gain: float
    """Akaike's criterion of a constant rate less that of the law."""

    @property
    def decays(self) -> bool:
        """Whether the rate decays, as far as the events show."""
        return self.gain > MIN_GAIN


def omori(times: Array, sizes: Array, main_size: float, end: float) -> Omori | None:
    """Omori's law of the events [s] after main events, those of a size or larger; None for too few.

    Each sequence ends with the next main event, or the record, at ``end``. All sequences together
    are fitted by the likelihood of a Poisson process (Ogata, J. Phys. Earth 31, 115 (1983)).
    """
    order = np.argsort(times)
    times, sizes = np.asarray(times, dtype=float)[order], np.asarray(sizes, dtype=float)[order]
    main = times[sizes >= main_size]
    later = times[sizes < main_size]
    if not main.size:
        return None
    owner = np.searchsorted(main, later, "right") - 1
    since = (later - main[np.maximum(owner, 0)])[owner >= 0]
    since = since[since > 0]
    lengths = np.diff(np.append(main, max(end, float(main[-1]))))
    lengths = lengths[lengths > 0]
    if since.size < MIN_EVENTS or not lengths.size:
        return None
    return _fitted(since, lengths, int(main.size))


def _fitted(since: Array, lengths: Array, main_count: int) -> Omori | None:
    from scipy.optimize import minimize

    total, count = float(lengths.sum()), since.size
    constant = count - count * math.log(count / total)

    def integral(p: float, c: float) -> float:
        """Integral of (t + c)^-p over all sequences."""
        if abs(p - 1) < 1e-6:
            return float(np.sum(np.log1p(lengths / c)))
        return float(np.sum((lengths + c) ** (1 - p) - c ** (1 - p))) / (1 - p)

    def cost(x: Sequence[float] | Array) -> float:
        p, c, share = x[0], math.exp(x[1]), 1 / (1 + math.exp(-x[2]))
        # The expected number of events is that of the record.
        productivity, background = share * count / integral(p, c), (1 - share) * count / total
        rate = productivity * (since + c) ** -p + background
        return count - float(np.sum(np.log(rate)))

    middle = math.log(float(np.median(since)))
    starts = [(p, middle + shift, 1.0) for p in (0.8, 1.3) for shift in (-4.0, -1.0)]
    bounds = [(0.1, 5.0), (middle - 15, middle + 10), (-12.0, 12.0)]
    fits = [minimize(cost, one, method="L-BFGS-B", bounds=bounds) for one in starts]
    best = min(fits, key=lambda one: float(one.fun))
    covariance = _covariance(cost, best.x)
    p, c, share = float(best.x[0]), math.exp(best.x[1]), 1 / (1 + math.exp(-best.x[2]))
    errors = np.sqrt(np.diag(covariance)) if covariance is not None else np.full(3, math.nan)
    return Omori(
        p,
        float(errors[0]),
        c,
        float(errors[1]) * c,
        share * count / integral(p, c),
        (1 - share) * count / total,
        main_count,
        count,
        2 * (constant - float(best.fun)) - 6,
    )


def _covariance(cost: object, x: Array) -> Array | None:
    """Inverse of the second derivatives of a cost by differences; None if it has no minimum there.

    The share of the background may be at its bound: then p and c are those without it.
    """
    step = 1e-3
    for free in (range(3), range(2)):
        unit = step * np.eye(3)[list(free)]

        def value(shift: Array) -> float:
            return float(cost(x + shift))  # type: ignore[operator]

        size = len(unit)
        hessian = np.empty((size, size))
        for i, one in enumerate(unit):
            for j, two in enumerate(unit):
                hessian[i, j] = (
                    value(one + two) - value(one - two) - value(two - one) + value(-one - two)
                ) / (4 * step**2)
        if np.linalg.eigvalsh(hessian).min() > 1e-6:
            found = np.full((3, 3), math.nan)
            found[:size, :size] = np.linalg.inv(hessian)
            return found
    return None
