"""Noise of the points of a record: known from steady sliding, or estimated from residuals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip import _core
from mesoslip.analysis.rate_and_state.points import Points
from mesoslip.array_types import Array

# Minimum noise of a sample over the range of the force: errors of the motion.
MIN_NOISE = 1e-6
# The same for noise that is known: less is that of a run without noise.
MIN_KNOWN_NOISE = 1e-5
# Shares of the correlated noise in the variance of a sample that are tried first, over the white
# one, and number of its correlation times.
RATIOS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e3)
TIMES = 7
# Maximum correlation time over the duration of the record.
MAX_TIME = 0.1
# Improvement of the likelihood by correlated noise that counts: its two parameters.
MIN_IMPROVEMENT = 2.0


@dataclass(frozen=True)
class Noise:
    """Noise of the points of a record, over the range of its force."""

    deviation: float
    """Standard deviation of a sample; of known noise that of the points, 0 for none."""
    time: float
    """Time over which the correlation decays by a factor e [s], 0 for white noise."""
    factor: NDArray[Any]
    """Cholesky factor of the covariance of the points, or their standard deviations: residuals are
    divided by it."""
    correlation: Array | None = None
    """Correlation of the points of known noise, which their weights neglect."""
    share: float = 0.0
    """Share of the correlated noise in the variance of a sample; not of known noise."""

    @property
    def is_known(self) -> bool:
        """Whether the noise is known without the residuals of a fit."""
        return self.correlation is not None

    @property
    def point_deviation(self) -> Array:
        is_white = self.factor.ndim == 1
        return self.factor if is_white else np.linalg.norm(self.factor, axis=1)

    def whitened(self, values: Array) -> Array:
        """Values, a column each, over the noise."""
        from scipy.linalg import solve_triangular

        if self.factor.ndim == 1:
            found: Array = np.divide(values, self.factor[:, None])
        else:
            found = solve_triangular(self.factor, values, lower=True, check_finite=False)
        return found

    def covariance(self, jacobian: Array) -> Array:
        """Covariance of parameters from the derivatives of the whitened residuals: that of
        correlated residuals, (JᵀJ)⁻¹ JᵀCJ (JᵀJ)⁻¹."""
        inverse: NDArray[Any] = np.linalg.pinv(jacobian.T @ jacobian)
        if self.correlation is None:
            return inverse
        found: Array = inverse @ (jacobian.T @ self.correlation @ jacobian) @ inverse
        return found

    @property
    def independent_points(self) -> float:
        """Number of independent points: of known noise that with the same variance of the mean
        square, else that with the same error of a level."""
        if self.correlation is not None:
            return self.factor.size**2 / float(np.sum(self.correlation**2))
        return float(np.sum(self.whitened(self.point_deviation[:, None]) ** 2))


def white_noise(count: Array, deviation: float) -> Noise:
    """White noise of a standard deviation of each sample."""
    return Noise(deviation, 0.0, deviation / np.sqrt(count))


def known_noise(points: Points, displacement: Array, deviation: float, length: float) -> Noise:
    """Noise of samples of a standard deviation, correlated over a displacement of the slider [m].

    Contacts renew their forces as the slider moves: the noise is an Ornstein-Uhlenbeck process of
    the displacement of the samples, averaged over those of each point; it is white for a length of
    0.
    """
    least = MIN_KNOWN_NOISE * points.force_range
    if deviation <= least:
        known = np.full(points.count.size, MIN_KNOWN_NOISE)
        return Noise(0.0, math.nan, known, np.eye(known.size))
    if length == 0:
        covariance = np.diag(1 / points.count)
    else:
        # Where the slider moves back the noise does not return to its old values.
        displacement = np.maximum.accumulate(displacement)
        last = points.first + points.count.astype(int) - 1
        covariance = averaged_covariance(displacement[points.first], displacement[last], length)
    relative = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(relative, relative)
    known = np.maximum(deviation * relative, least) / points.force_range
    return Noise(float(np.sqrt(np.mean(known**2))), math.nan, known, correlation)


def averaged_covariance(start: Array, end: Array, length: float) -> Array:
    """Covariance of means over intervals of a process of variance 1 with the correlation
    exp(-x/length), shape (intervals, intervals)."""
    size = np.maximum((end - start) / length, 1e-9)
    change = np.expm1(-size)
    damped = -change / size
    gap = np.maximum(start[:, None], start[None, :]) - np.minimum(end[:, None], end[None, :])
    covariance: Array = np.outer(damped, damped) * np.exp(-np.maximum(gap, 0.0) / length)
    np.fill_diagonal(covariance, _mean_square(size, change))
    return covariance


def _mean_square(size: Array, change: Array) -> Array:
    """Mean square of means of the same process over intervals of lengths over its own, with
    exp(-size) - 1."""
    small = size < 1e-3
    return np.where(small, 1 - size / 3, 2 * (size + change) / size**2)


@dataclass(frozen=True)
class NoiseModel:
    """White noise of samples and noise with a correlation time; points are means of samples between
    two times."""

    start: Array
    """Start of each point [s]."""
    end: Array
    """End of each point [s]."""
    count: Array
    """Samples of each point."""
    times: tuple[float, float]
    """Correlation times that the record can show [s]: from the interval of samples to a tenth of
    the duration."""

    @classmethod
    def of(cls, points: Points) -> NoiseModel:
        """The noise of the points of a record."""
        half = math.sqrt(3) * points.spread
        start, end = points.time - half, points.time + half
        # Where the rate of samples changes within a point, it would overlap the next.
        needed = np.maximum(half[:-1] + half[1:], np.diff(points.time))
        share = np.diff(points.time) / needed
        end[:-1] = points.time[:-1] + share * half[:-1]
        start[1:] = points.time[1:] - share * half[1:]
        longest = MAX_TIME * float(points.time[-1] - points.time[0])
        shortest = max(points.interval, 1e-6 * longest)
        return cls(start, end, points.count, (shortest, longest))

    def covariance(self, deviation: float, share: float, time: float) -> Array:
        """Covariance of the points, by the standard deviation of a sample, the share of correlated
        noise in its variance, and its correlation time [s]."""
        correlated = averaged_covariance(self.start, self.end, time)
        return deviation**2 * (share * correlated + np.diag((1 - share) / self.count))

    def log_likelihood(self, residual: Array, deviation: Array, share: Array, time: Array) -> Array:
        """Logarithm of the normal density, shape (sets,), of residuals of shape (sets, points), by
        `covariance` without its matrix."""
        value = _core.noise_log_densities(
            self.start, self.end, self.count, residual.T, deviation, share, time
        )
        return np.where(value > -np.finfo(float).max, value, -np.inf)


def estimated_noise(points: Points, residual: Array, jacobian: Array) -> Noise:
    """White noise of the samples and noise with a correlation time, from residuals of shape
    (points,) and their derivatives by the fitted parameters, shape (points, parameters).

    By restricted maximum likelihood, which accounts for the fitted parameters (Patterson and
    Thompson, Biometrika 58, 545 (1971)).
    """
    from scipy.optimize import minimize

    model = NoiseModel.of(points)
    scale = np.linalg.norm(jacobian, axis=0)
    columns = jacobian / np.where(scale > 0, scale, 1.0)
    shortest, longest = model.times

    @lru_cache(maxsize=1)
    def averages(length: float) -> Array:
        return averaged_covariance(model.start, model.end, length)

    def covariance(ratio: float, length: float) -> Array:
        white = np.diag(1 / points.count)
        return white + ratio * averages(length) if ratio > 0 else white

    def likelihood(ratio: float, length: float) -> tuple[float, float]:
        """Minus twice the logarithm, and the variance of the white noise."""
        try:
            factor = np.linalg.cholesky(covariance(ratio, length))
        except np.linalg.LinAlgError:
            return math.inf, math.nan
        both = Noise(1.0, 0.0, factor).whitened(np.column_stack([columns, residual]))
        q, r = np.linalg.qr(both[:, :-1])
        rest = both[:, -1] - q @ (q.T @ both[:, -1])
        freedom = max(residual.size - columns.shape[1], 1)
        variance = max(float(rest @ rest) / freedom, MIN_NOISE**2)
        diagonal = np.abs(np.diag(r))
        value = (
            2 * float(np.sum(np.log(np.diag(factor))))
            + 2 * float(np.sum(np.log(diagonal[diagonal > 0])))
            + freedom * math.log(variance)
            + float(rest @ rest) / variance
        )
        return value, variance

    best = (likelihood(0.0, 1.0)[0], 0.0, 1.0)
    tried = min(
        (likelihood(ratio, length)[0], ratio, length)
        for length in np.geomspace(shortest, longest, TIMES)
        for ratio in RATIOS
    )
    if tried[0] < best[0] - MIN_IMPROVEMENT:
        low = np.array([-20.0, math.log(shortest / 3)])
        high = np.array([20.0, math.log(longest)])

        def noise_of(at: Array) -> tuple[float, float]:
            ratio, length = np.exp(np.clip(at, low, high)).tolist()
            return ratio, length

        # The simplex of scipy is flat where a logarithm is 0.
        start = np.log(tried[1:])
        simplex = np.add(start, [[0.0, 0.0], [1.0, 0.0], [0.0, 0.7]])
        found = minimize(
            lambda at: likelihood(*noise_of(at))[0],
            start,
            method="Nelder-Mead",
            options={"maxfev": 60, "xatol": 0.02, "fatol": 0.02, "initial_simplex": simplex},
        )
        best = (float(found.fun), *noise_of(found.x))
    _, ratio, length = best
    variance = likelihood(ratio, length)[1]
    factor = np.linalg.cholesky(variance * covariance(ratio, length))
    deviation, time = math.sqrt((1 + ratio) * variance), length if ratio > 0 else 0.0
    return Noise(deviation, time, factor, share=ratio / (1 + ratio))
