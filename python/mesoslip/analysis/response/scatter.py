"""Standard errors of single forces, over realizations or by the noise."""

from __future__ import annotations

import math

from mesoslip.analysis.steady_force import SteadyMean
from mesoslip.array_types import Array


def error_of_mean(values: Array, steady: SteadyMean) -> float:
    """Standard error of the mean over realizations; the noise of the force for one realization."""
    return scatter(values) if values.size > 1 else steady.standard_deviation


def scatter(values: Array) -> float:
    """Standard error of the mean over realizations; NaN for one realization."""
    return float(values.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else math.nan
