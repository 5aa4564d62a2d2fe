"""Means of correlated series, with honest errors, after a transient.

How well the errors cover was measured: see ``docs/response.md``, and
``tests/studies/response_coverage.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Samples of a batch of the marginal standard error rule.
BATCH = 5
# Part of a series up to which the end of a transient is looked for.
MOST_TRANSIENT = 0.5
# What is left out, over the length of the transient by that rule, and part of a series at most.
MARGIN = 2
MOST_LEFT_OUT = 0.6
# Samples that a mean needs, and blocks that its error needs.
LEAST_SAMPLES = 20
LEAST_BLOCKS = 6
# Standard errors by which the halves of what is left may differ before it is said to drift.
MOST_DRIFT = 3.0
# Part of the mean that a drift is of at least, as that of a record without noise never ends.
LEAST_DRIFT = 1e-4
# Part of the mean that rounding may be of.
ROUNDING = 1e-9


@dataclass(frozen=True)
class SteadyMean:
    """Mean of what is steady in a series.

    Attributes
    ----------
    mean, error
        Mean, and its standard error; NaN if there are too few samples for it.
    half_width
        Half the width of its 95 % interval, by Student's distribution for the blocks that there
        are.
    standard_deviation
        That of the values about their mean.
    start
        Samples that were left out before: twice the transient.
    count
        Samples of the steady part, all realizations together.
    block
        Samples of the blocks whose means the error is of.
    effective_count
        Independent samples that would have this error.
    is_steady
        Whether the transient is over, and the halves of what is left agree.
    is_resolved
        Whether the series is long enough for the error to be right: some 20 independent samples.
    """

    mean: float
    error: float
    half_width: float
    standard_deviation: float
    start: int
    count: int
    block: int
    effective_count: float
    is_steady: bool
    is_resolved: bool

    @property
    def correlation(self) -> float:
        """Samples to an independent one, at least 1."""
        return max(1.0, self.count / self.effective_count) if self.effective_count > 0 else 1.0


def transient(series: Array) -> int:
    """Samples of a transient at the start of a series, by the marginal standard error rule MSER-5.

    That many are left out that (variance of the rest)/(number of the rest) of the means of five
    samples each is least (White, Simulation 69, 323 (1997)); at most half of the series.
    """
    batch = BATCH if series.size >= 4 * BATCH * BATCH else 1
    count = series.size // batch
    if count < 4:
        return 0
    # What does not fill a batch is left out at the start.
    left = series.size - count * batch
    means = series[left:].reshape(count, batch).mean(axis=1)
    # About the last value, or the squares of a large mean would drown the variance.
    means = means - means[-1]
    rest = np.arange(count, 0, -1)
    total = np.cumsum(means[::-1])[::-1]
    squares = np.cumsum(means[::-1] ** 2)[::-1]
    spread = np.maximum(squares - total**2 / rest, 0.0) / rest**2.0
    most = int(count * MOST_TRANSIENT)
    start = int(np.argmin(spread[: most + 1]))
    return left + start * batch if start else 0


def steady_mean(values: Array) -> SteadyMean | None:
    """Mean of the steady part of a series, with its error.

    The error is that of the means of blocks. Of the blocks of 1, 2, 4, ... samples those are taken
    whose error lies on the flat part of the curve: the shortest ones with B³ > 2 n (e_B/e_1)⁴, at
    which what is left of the correlation between blocks is less than the noise of the error itself
    (Lee et al., Phys. Rev. E 83, 066706 (2011)). As what is left makes it too small, the estimate
    for blocks three times shorter is used to take away its first order in 1/B: e² = 2 e_B² -
    e²_(B/3) (Vats and Flegal, Biometrika 109, 735 (2022)), if that is more.

    Parameters
    ----------
    values
        Shape (realizations, samples) with the same times; realizations are independent. The
        transient is looked for in their mean.

    Returns
    -------
    SteadyMean or None
        None if there are fewer than 20 samples.
    """
    from scipy.special import stdtrit

    realizations, samples = values.shape
    if samples < LEAST_SAMPLES:
        return None
    length = transient(values.mean(axis=0))
    # What the rule leaves of a transient is as large as the error; twice as far on, its square.
    start = min(MARGIN * length, int(MOST_LEFT_OUT * samples))
    steady = values[:, start:]
    count = steady.size
    mean = float(steady.mean())
    deviation = float(steady.std(ddof=1))
    is_quiet = deviation <= LEAST_DRIFT * abs(mean)
    is_over = is_quiet or length < 0.95 * MOST_TRANSIENT * samples
    if deviation <= ROUNDING * abs(mean):
        exact = (mean, 0.0, 0.0, deviation, start, count, 1, float(count))
        return SteadyMean(*exact, is_steady=is_over, is_resolved=True)
    block, error, is_flat = _block_error(steady)
    blocks = realizations * (steady.shape[1] // block)
    half_width = float(stdtrit(blocks - 1, 0.975)) * error
    middle = steady.shape[1] // 2
    drift = float(steady[:, :middle].mean() - steady[:, middle:].mean())
    # Each half has twice the variance of the whole, and they are as good as independent.
    drifts = not is_quiet and abs(drift) > MOST_DRIFT * 2 * error
    return SteadyMean(
        mean,
        error,
        half_width,
        deviation,
        start,
        count,
        block,
        float(deviation**2 / error**2) if error > 0 else math.nan,
        is_steady=is_over and not drifts,
        is_resolved=is_flat,
    )


def _block_error(steady: Array) -> tuple[int, float, bool]:
    """Samples of a block, the standard error by such blocks, and whether the curve is flat there.

    NaN if there are too few blocks.
    """
    realizations, samples = steady.shape
    first = _error_of_blocks(steady, 1)
    block = 1
    while True:
        error = _error_of_blocks(steady, block)
        is_flat = block**3 > 2 * samples * realizations * (error / first) ** 4
        if is_flat or realizations * (samples // (2 * block)) < LEAST_BLOCKS:
            break
        block *= 2
    if realizations * (samples // block) < LEAST_BLOCKS:
        return block, math.nan, False
    if block >= 3:
        shorter = _error_of_blocks(steady, block // 3)
        error = math.sqrt(max(2 * error**2 - shorter**2, error**2))
    return block, error, is_flat


def _error_of_blocks(steady: Array, block: int) -> float:
    """Standard error of the mean if the means of blocks are independent."""
    count = steady.shape[1] // block
    # What does not fill a block is left out at the start, where a transient may be left.
    means = steady[:, steady.shape[1] - count * block :].reshape(-1, block).mean(axis=1)
    return float(means.std(ddof=1) / math.sqrt(means.size))
