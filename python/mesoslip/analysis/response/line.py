"""Lines and exponential decays by weighted least squares."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array


@dataclass(frozen=True)
class Line:
    """A straight line by weighted least squares: slope, its standard error, and value at 0.

    The error is multiplied by √(χ²/degrees of freedom) if that is more than 1; that of two points
    follows from their errors. χ² is NaN for points without errors.
    """

    slope: float
    slope_error: float
    level: float
    chi_square: float
    degrees_of_freedom: int


def line(x: Array, y: Array, error: Array) -> Line | None:
    """A line through points with errors, or else with an error from their scatter; None for fewer
    than two different x."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y, error = x[good], y[good], error[good]
    if np.unique(x).size < 2:
        return None
    has_errors = bool(np.all(np.isfinite(error)) and np.all(error > 0))
    weight = 1 / error**2 if has_errors else np.ones_like(x)
    middle = np.average(x, weights=weight)
    spread = float(np.sum(weight * (x - middle) ** 2))
    slope = float(np.sum(weight * (x - middle) * y) / spread)
    level = float(np.average(y, weights=weight) - slope * middle)
    square = float(np.sum(weight * (y - level - slope * x) ** 2))
    freedom = x.size - 2
    scatter = square / freedom if freedom > 0 else math.nan
    if has_errors:
        factor = max(scatter, 1.0) if freedom > 0 else 1.0
        return Line(slope, math.sqrt(factor / spread), level, square, freedom)
    return Line(slope, math.sqrt(scatter / spread), level, math.nan, freedom)


# Maximum number of points in a fit, of each of the two spacings.
MAX_POINTS = 2000


def decay(
    displacement: Array, force: Array, correlation: float, noise: float
) -> tuple[float, float] | None:
    """Length of an exponential decay of a force over ascending displacements [m], and its standard
    error, from the standard deviation of the noise and samples per independent sample; None if it
    is not determined."""
    from scipy.optimize import OptimizeWarning, curve_fit

    distance = float(displacement[-1] - displacement[0])
    if distance <= 0:
        return None
    chosen = np.unique(np.linspace(0, displacement.size - 1, MAX_POINTS).astype(int))
    # Evenly spaced points are few at the start, where the decay is fastest.
    early = np.unique(np.geomspace(1, displacement.size, MAX_POINTS).astype(int) - 1)
    chosen = np.union1d(chosen, early)
    x, y = (displacement[chosen] - displacement[0]) / distance, force[chosen]
    size = max(float(np.ptp(y)), 1e-300)
    y = (y - y[-1]) / size

    def exponential(x: Array, level: float, amplitude: float, log_length: float) -> Array:
        decayed: Array = level + amplitude * np.exp(-x / np.exp(log_length))
        return decayed

    best = None
    for length in (0.01, 0.05, 0.3):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", OptimizeWarning)
            try:
                found, covariance = curve_fit(
                    exponential, x, y, (0.0, y[0], math.log(length)), maxfev=500
                )
            except RuntimeError:
                continue
        squares = float(np.sum((y - exponential(x, *found)) ** 2))
        if np.all(np.isfinite(covariance)) and (best is None or squares < best[0]):
            best = (squares, found, covariance)
    if best is None:
        return None
    squares, found, covariance = best
    # Chosen samples are as correlated as their spacing allows.
    spacing = displacement.size / chosen.size
    factor = max(1.0, correlation / spacing)
    floor = (noise / size) ** 2 * chosen.size / max(squares, 1e-300)
    error = math.sqrt(covariance[2, 2] * factor * max(1.0, floor))
    length = math.exp(found[2]) * distance
    if not math.isfinite(length) or error > 1 or length > distance:
        return None
    return length, length * error
