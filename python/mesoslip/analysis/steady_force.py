"""Means of correlated series after a transient, with standard errors.

The coverage of the errors was measured: see ``docs/response.md``, and
``tests/studies/response_coverage.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array

# Samples of a batch in the marginal standard error rule, and maximum length of a transient over
# that of the series.
BATCH = 5
MAX_TRANSIENT = 0.5
# Discarded samples over the length of the transient by the rule, and their maximum share.
MARGIN = 2
MAX_DISCARDED = 0.6
# Minimum number of samples of a mean, and of blocks of its error.
MIN_SAMPLES = 20
MIN_BLOCKS = 6
# Maximum difference of the halves of a steady series, in standard errors of the mean.
MAX_DRIFT = 3.0
# Minimum drift over the mean: a record without noise relaxes forever.
MIN_DRIFT = 1e-4
# Half the width of a 95 % interval over the standard error.
NORMAL_95 = 1.96
# Deviations over the mean that are rounding errors.
ROUNDING = 1e-9


@dataclass(frozen=True)
class SteadyMean:
    """Mean of the steady part of a series."""

    mean: float
    error: float
    """Standard error of the mean; NaN for too few samples."""
    half_width: float
    """Half the width of the 95 % interval, by Student's distribution for the number of blocks."""
    standard_deviation: float
    """That of the values about the mean."""
    start: int
    """Number of samples discarded at the start: twice the transient."""
    count: int
    """Number of samples in the steady part, over all realizations."""
    block: int
    """Block length for the standard error [samples]."""
    effective_count: float
    """Number of independent samples with the same error."""
    is_steady: bool
    """Whether the transient is over, and the halves of the steady part agree."""
    is_resolved: bool
    """Whether the series is long enough for a reliable error: some 20 independent samples."""

    @property
    def correlation(self) -> float:
        """Samples per independent sample, at least 1."""
        return max(1.0, self.count / self.effective_count) if self.effective_count > 0 else 1.0


def transient(series: Array) -> int:
    """Length of the initial transient of a series [samples], by the marginal standard error rule.

    MSER-5 (White, Simulation 69, 323 (1997)): of the means of five samples each, the first are
    discarded up to the minimum of the variance of the others over their number; at most half of
    the series.
    """
    batch = BATCH if series.size >= 4 * BATCH * BATCH else 1
    count = series.size // batch
    if count < 4:
        return 0
    # An incomplete batch is discarded at the start.
    remainder = series.size - count * batch
    means = series[remainder:].reshape(count, batch).mean(axis=1)
    # Relative to the last value: the variance is not lost in the rounding of a large mean.
    means = means - means[-1]
    rest = np.arange(count, 0, -1)
    total = np.cumsum(means[::-1])[::-1]
    squares = np.cumsum(means[::-1] ** 2)[::-1]
    spread = np.maximum(squares - total**2 / rest, 0.0) / rest**2.0
    max_start = int(count * MAX_TRANSIENT)
    start = int(np.argmin(spread[: max_start + 1]))
    return remainder + start * batch if start else 0


def steady_mean(values: Array) -> SteadyMean | None:
    """Mean of the steady part of series of shape (realizations, samples); None for too few samples.

    Realizations are independent, and have the same times; the transient is that of their mean.

    The error is that of block means. The block length is the smallest of 1, 2, 4, ... samples on
    the plateau of the error, B³ > 2 n (e_B/e_1)⁴, where the remaining correlation between blocks is
    smaller than the statistical error of e_B (Lee et al., Phys. Rev. E 83, 066706 (2011)). That
    correlation makes e_B too small; blocks of a third of the length correct it to first order in
    1/B: e² = 2 e_B² - e²_(B/3) (Vats and Flegal, Biometrika 109, 735 (2022)), if that is larger.
    """
    from scipy.special import stdtrit

    realizations, samples = values.shape
    if samples < MIN_SAMPLES:
        return None
    length = transient(values.mean(axis=0))
    # After the length by the rule, the transient is still as large as the error; after twice that
    # length it is negligible.
    start = min(MARGIN * length, int(MAX_DISCARDED * samples))
    steady = values[:, start:]
    count = steady.size
    mean = float(steady.mean())
    deviation = float(steady.std(ddof=1))
    is_quiet = deviation <= MIN_DRIFT * abs(mean)
    is_over = is_quiet or length < 0.95 * MAX_TRANSIENT * samples
    if deviation <= ROUNDING * abs(mean):
        exact = (mean, 0.0, 0.0, deviation, start, count, 1, float(count))
        return SteadyMean(*exact, is_steady=is_over, is_resolved=True)
    block, error, on_plateau = _block_error(steady)
    blocks = realizations * (steady.shape[1] // block)
    half_width = float(stdtrit(blocks - 1, 0.975)) * error
    middle = steady.shape[1] // 2
    drift = float(steady[:, :middle].mean() - steady[:, middle:].mean())
    # Each half has twice the variance of the whole, and the two are almost independent.
    is_drifting = not is_quiet and abs(drift) > MAX_DRIFT * 2 * error
    return SteadyMean(
        mean,
        error,
        half_width,
        deviation,
        start,
        count,
        block,
        float(deviation**2 / error**2) if error > 0 else math.nan,
        is_steady=is_over and not is_drifting,
        is_resolved=on_plateau,
    )


def _block_error(steady: Array) -> tuple[int, float, bool]:
    """Block length, standard error, and whether that is on the plateau; NaN for too few blocks."""
    realizations, samples = steady.shape
    first = _error_of_blocks(steady, 1)
    block = 1
    while True:
        error = _error_of_blocks(steady, block)
        on_plateau = block**3 > 2 * samples * realizations * (error / first) ** 4
        if on_plateau or realizations * (samples // (2 * block)) < MIN_BLOCKS:
            break
        block *= 2
    if realizations * (samples // block) < MIN_BLOCKS:
        return block, math.nan, False
    if block >= 3:
        shorter = _error_of_blocks(steady, block // 3)
        error = math.sqrt(max(2 * error**2 - shorter**2, error**2))
    return block, error, on_plateau


def _error_of_blocks(steady: Array, block: int) -> float:
    """Standard error of the mean for independent block means."""
    count = steady.shape[1] // block
    # An incomplete block is discarded at the start, next to the transient.
    means = steady[:, steady.shape[1] - count * block :].reshape(-1, block).mean(axis=1)
    return float(means.std(ddof=1) / math.sqrt(means.size))


def error_of_mean(values: Array, steady: SteadyMean) -> float:
    """Standard error of the mean over realizations; the noise of the force for one realization."""
    return scatter(values) if values.size > 1 else steady.standard_deviation


def scatter(values: Array) -> float:
    """Standard error of the mean over realizations; NaN for one realization."""
    return float(values.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else math.nan
