"""Straight lines by weighted least squares."""

from __future__ import annotations

import math
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
