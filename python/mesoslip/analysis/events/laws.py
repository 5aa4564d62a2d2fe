"""The b-value of sizes by their likelihood, and the decay of rates by Omori's law.

A magnitude is the decimal logarithm of a size. With the probability 10^(-b M) of a larger one,
sizes follow a power law of exponent 1 + b.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesoslip.array_types import Array

# Step of the completeness while the law is rejected.
BIN = 0.1
# Standard deviations of the detection from the magnitude of half to the completeness, at 99.4 %.
MARGIN = 2.5
# Minimum number of events above the completeness with which the others are left out.
MIN_COMPLETE = 200
# Maximum number of events from which the detection is estimated.
MAX_DETECTED = 10_000
# Starts of the estimate, widths of the detection over the standard deviation of the magnitudes;
# and the minimum.
WIDTHS, MIN_WIDTH = (0.05, 0.5), 1e-3
# Half of the likelihood ratio, number of standard errors, and probabilities below the ends of a
# 95 % interval.
LIKELIHOOD_95, NORMAL_95, TAILS = 1.92, 1.96, np.array([0.025, 0.975])
# Maximum logarithm of the upper end of that interval over the estimate.
MAX_REACH = 2.0
# Maximum probability at which the law is rejected.
REJECTED = 0.05
# Minimum number of events of a fit.
MIN_EVENTS = 20
# Minimum gain of Akaike's criterion for a decay.
MIN_GAIN = 2.0


@dataclass(frozen=True)
class BValue:
    """The b-value of a catalogue, with its standard error and a 95 % interval."""

    value: float
    error: float
    """Infinite if the events only give a lower limit: a steep law with a wide detection is like a
    normal distribution of any b."""
    low: float
    high: float
    """Ends of the interval; the upper one is infinite for a lower limit."""
    completeness: float
    """Magnitude from which on the law is fitted, or tested if all events are."""
    count: int
    """Events of the fit."""
    p_value: float
    """Probability of as large a distance from the law, if it holds, above the completeness."""
    half_detected: float = math.nan
    """Magnitude of which half of the events are detected, if all events are fitted."""


def b_value(sizes: Array, completeness: float | None = None) -> BValue | None:
    """The b-value of positive sizes; None for too few.

    The probability of detection is a cumulative normal distribution of the magnitude, and law and
    detection are fitted to all events (Ogata and Katsura, Geophys. J. Int. 113, 727 (1993)). The
    completeness is 2.5 standard deviations above the magnitude of which half is detected, as that
    of Woessner and Wiemer (Bull. Seismol. Soc. Am. 95, 684 (2005)); if the law is rejected there,
    it is the first magnitude above at which it is not. With 200 events above it, or a rejection
    below, or a completeness that is given, b is Aki's of these events; and that of the fit of all
    events otherwise, with an interval from the profile of the likelihood.
    """
    sizes = np.asarray(sizes, dtype=float)
    magnitude = np.log10(sizes[np.isfinite(sizes) & (sizes > 0)])
    if magnitude.size < MIN_EVENTS or np.ptp(magnitude) == 0:
        return None
    if completeness is not None:
        return _fit(magnitude, completeness)
    every = _with_detection(magnitude)
    found = _fit(magnitude, every.completeness)
    if found is None or (found.count < MIN_COMPLETE and found.p_value >= REJECTED):
        return every
    while found.p_value < REJECTED:
        # The detection of events is no such distribution, or they follow no such law.
        higher = _fit(magnitude, found.completeness + BIN)
        if higher is None:
            break
        found = higher
    return found


def _with_detection(magnitude: Array) -> BValue:
    """The b-value by all events, which are detected by a cumulative normal distribution.

    With the rate beta = b ln 10, its mean mu and its standard deviation s, their density is
    beta exp(-beta (M - mu) - beta^2 s^2 / 2) Phi((M - mu) / s).
    """
    from scipy.optimize import brentq, minimize
    from scipy.special import log_ndtr

    every = magnitude[:: -(-magnitude.size // MAX_DETECTED)]
    middle, spread, count = float(every.mean()), float(every.std()), every.size
    values = (every - middle) / spread

    def cost(beta: float, mu: float, width: float) -> float:
        """Negative logarithm of the likelihood, of magnitudes in standard deviations."""
        width = max(width, MIN_WIDTH)
        law = math.log(beta) + beta * mu - 0.5 * (beta * width) ** 2
        return -count * law - float(log_ndtr((values - mu) / width).sum())

    def fitted(function: Callable[[Array], float], start: Sequence[float], tol: float) -> Any:
        return minimize(function, start, method="Nelder-Mead", tol=tol)

    fits = []
    for width in WIDTHS:
        rate = 1 / math.sqrt(1 - width**2)
        start = (math.log(rate), rate * width**2 - 1 / rate, math.log(width))
        fits.append(fitted(lambda x: cost(math.exp(x[0]), x[1], math.exp(x[2])), start, 1e-4))
    best = min(fits, key=lambda one: float(one.fun))
    rate, mu = math.exp(best.x[0]), float(best.x[1])
    width = max(math.exp(best.x[2]), MIN_WIDTH)

    def excess(shift: float) -> float:
        """Cost of a rate that is larger by a factor exp(shift), above that at the end."""
        beta, start = rate * math.exp(shift), (mu, math.log(width))
        lowest = fitted(lambda x: cost(beta, x[0], math.exp(x[1])), start, 1e-3).fun
        return float(lowest - best.fun) - LIKELIHOOD_95

    to_b, ends = math.log10(math.e) / spread, []
    for sign in (-1, 1):
        reach = sign / math.sqrt(count)
        while reach < MAX_REACH and excess(reach) < 0:
            reach *= 2
        shift = brentq(excess, 0, reach, xtol=0.01) if reach < MAX_REACH else math.inf
        ends.append(to_b * rate * math.exp(shift))
    completeness = max(middle + spread * (mu + MARGIN * width), float(magnitude.min()))
    kept = magnitude[magnitude >= completeness]
    return BValue(
        to_b * rate,
        (ends[1] - ends[0]) / (2 * NORMAL_95),
        ends[0],
        ends[1],
        completeness,
        magnitude.size,
        _p_value(kept - completeness) if kept.size else 1.0,
        middle + spread * mu,
    )


def _fit(magnitude: Array, completeness: float) -> BValue | None:
    """Aki's estimate from magnitudes above a completeness, whose sum has a gamma distribution; None
    for too few."""
    from scipy.special import gammaincinv

    kept = magnitude[magnitude >= completeness]
    if kept.size < MIN_EVENTS:
        return None
    excess = float(kept.mean()) - completeness
    if excess <= 0:
        return None
    # Without the bias by few events.
    value = math.log10(math.e) / excess * (kept.size - 1) / kept.size
    error = value / math.sqrt(kept.size - 2)
    low, high = math.log10(math.e) / excess * gammaincinv(kept.size, TAILS) / kept.size
    p_value = _p_value(kept - completeness)
    return BValue(value, error, float(low), float(high), completeness, kept.size, p_value)


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
