"""Noise of a record: white, and correlated over a time, estimated from the residuals of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Shares of the correlated noise in the variance of a sample that are tried first, over the white
# one, and decades of its correlation time.
RATIOS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e3)
TIMES = 7
# Maximum correlation time over the duration of the record.
MAX_TIME = 0.1
# Improvement of the likelihood by correlated noise that counts: its two parameters.
MIN_IMPROVEMENT = 2.0


@dataclass(frozen=True)
class CorrelatedNoise:
    """Noise of a record.

    Attributes
    ----------
    white
        Standard deviation of the white noise of a sample.
    correlated
        Standard deviation of the correlated noise; 0 for none.
    time
        Time over which its correlation decays by a factor e [s].
    factor
        Cholesky factor of the covariance of the points, lower triangle.
    """

    white: float
    correlated: float
    time: float
    factor: NDArray[Any]

    @property
    def deviation(self) -> float:
        """Standard deviation of a sample."""
        return math.hypot(self.white, self.correlated)

    def whitened(self, values: Array) -> Array:
        """Values, a column each, over the noise: independent and of variance 1."""
        from scipy.linalg import solve_triangular

        result: Array = solve_triangular(self.factor, values, lower=True, check_finite=False)
        return result

    @property
    def independent_points(self) -> float:
        """Number of independent points with the same error of their mean, over the smallest
        variance of a point of them."""
        deviation = np.sqrt(np.sum(self.factor**2, axis=1))
        weighted = self.whitened(deviation[:, None])
        return float(np.sum(weighted**2))


def white_noise(count: Array, deviation: float) -> CorrelatedNoise:
    """White noise of a standard deviation of each sample."""
    return CorrelatedNoise(deviation, 0.0, 0.0, np.diag(deviation / np.sqrt(count)))


def averaged_covariance(start: Array, end: Array, time: float) -> Array:
    """Covariance of means over intervals of a process of variance 1 with the correlation
    exp(-t/time), shape (intervals, intervals)."""
    size = np.maximum((end - start) / time, 1e-9)
    damped = -np.expm1(-size) / size
    gap = np.maximum(start[:, None], start[None, :]) - np.minimum(end[:, None], end[None, :])
    covariance: Array = np.outer(damped, damped) * np.exp(-np.maximum(gap, 0.0) / time)
    small = size < 1e-3
    whole = np.where(small, 1 - size / 3, 2 * (size + np.expm1(-size)) / size**2)
    np.fill_diagonal(covariance, whole)
    return covariance


def estimate(
    time: Array,
    spread: Array,
    count: Array,
    interval: float,
    residual: Array,
    jacobian: Array,
    floor: float,
) -> CorrelatedNoise:
    """Noise from residuals by restricted maximum likelihood, which accounts for the fitted
    parameters (Patterson and Thompson, Biometrika 58, 545 (1971)).

    Parameters
    ----------
    time, spread, count
        Mean times of the points [s], their standard deviations, and numbers of samples.
    interval
        Minimum interval of samples [s].
    residual
        Residuals of the points.
    jacobian
        Derivatives of the residuals by the fitted parameters, shape (points, parameters).
    floor
        Minimum standard deviation of a sample.
    """
    from scipy.optimize import minimize

    half = math.sqrt(3) * spread
    start, end = time - half, time + half
    scale = np.linalg.norm(jacobian, axis=0)
    columns = jacobian / np.where(scale > 0, scale, 1.0)
    longest = MAX_TIME * float(time[-1] - time[0])
    decades = np.geomspace(max(interval, 1e-6 * longest), longest, TIMES)
    kept: dict[float, Array] = {}

    def covariance(ratio: float, length: float) -> Array:
        matrix = np.diag(1 / count)
        if ratio > 0:
            if length not in kept:
                kept[length] = averaged_covariance(start, end, length)
            matrix = matrix + ratio * kept[length]
        return matrix

    def likelihood(ratio: float, length: float) -> tuple[float, float]:
        """Minus twice the logarithm, and the variance of the white noise."""
        try:
            factor = np.linalg.cholesky(covariance(ratio, length))
        except np.linalg.LinAlgError:
            return math.inf, math.nan
        noise = CorrelatedNoise(1.0, 0.0, 0.0, factor)
        both = noise.whitened(np.column_stack([columns, residual]))
        q, r = np.linalg.qr(both[:, :-1])
        rest = both[:, -1] - q @ (q.T @ both[:, -1])
        freedom = max(residual.size - columns.shape[1], 1)
        variance = max(float(rest @ rest) / freedom, floor**2)
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
        (likelihood(ratio, length)[0], ratio, length) for length in decades for ratio in RATIOS
    )
    if tried[0] < best[0] - MIN_IMPROVEMENT:
        bounds = np.log([max(interval, 1e-6 * longest) / 3, longest])

        def cost(at: Array) -> float:
            kept.clear()
            length = math.exp(min(max(at[1], bounds[0]), bounds[1]))
            return likelihood(math.exp(min(max(at[0], -20.0), 20.0)), length)[0]

        found = minimize(
            cost,
            np.log([tried[1], tried[2]]),
            method="Nelder-Mead",
            options={"maxfev": 60, "xatol": 0.02, "fatol": 0.02},
        )
        at = found.x
        best = (
            float(found.fun),
            math.exp(min(max(at[0], -20.0), 20.0)),
            math.exp(min(max(at[1], bounds[0]), bounds[1])),
        )
    _, ratio, length = best
    kept.clear()
    variance = likelihood(ratio, length)[1]
    factor = np.linalg.cholesky(variance * covariance(ratio, length))
    return CorrelatedNoise(
        math.sqrt(variance), math.sqrt(ratio * variance), length if ratio > 0 else 0.0, factor
    )
