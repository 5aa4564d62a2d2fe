"""Sizes of the noise of a trace: white, digital steps, and correlated."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Orders of differences for the estimate of the white noise.
ORDERS = range(1, 8)
# Median of the absolute value of a standard normal deviate.
NORMAL_MEDIAN = 0.6744897501960817
# Maximum number of distinct values, over the samples, of a trace with digital steps.
MAX_DISTINCT = 0.25
# Samples of the shortest and longest windows for correlated noise, and maximum number of windows.
MIN_WINDOW, MAX_WINDOW, MAX_WINDOWS = 8, 4096, 2000
# Minimum number of windows of one length.
MIN_WINDOWS = 12
# Degree of the polynomials that are taken off in windows.
DEGREE = 3
# Maximum growth of the variance when windows become twice as long. That of noise grows by 2 at
# most, up to a limit at the correlation time; that of a smooth signal grows by 256.
MAX_GROWTH = 2.6
# Windows with more than this multiple of the median variance have slips.
MAX_VARIANCE = 2.5
# Minimum correlated noise over the white noise.
MIN_CORRELATED = 0.35
# Autocorrelation that counts as none.
MIN_CORRELATION = 0.05


def noise_level(force: Array) -> float:
    """Standard deviation of white noise on a trace, in the unit of the force.

    The estimate is the median absolute difference of the trace, on which the few slips have no
    influence, at the order 1 to 7 for which it is smallest: a smooth, well sampled signal
    contributes less at higher orders. A digitized trace has at least the noise of its resolution.
    Noise that is correlated from sample to sample, as behind a filter, is underestimated:
    `correlated_noise` finds it.

    Parameters
    ----------
    force
        Samples at equal intervals, shape (samples,).
    """
    found = []
    for order in ORDERS:
        if len(force) <= 2 * order:
            break
        # Sum of squares of the binomial coefficients.
        norm = math.sqrt(math.comb(2 * order, order))
        sizes = np.abs(np.diff(force, order))
        found.append(float(np.median(sizes)) / (NORMAL_MEDIAN * norm))
    return max(min(found, default=0.0), digital_step_of(force) / math.sqrt(12))


def digital_step_of(force: Array) -> float:
    """Step of a digitized trace, in the unit of the force; 0 if it has too many distinct values.

    It is the smallest difference of distinct values that is more than a rounding error.
    """
    values = np.unique(force)
    if not 1 < values.size < MAX_DISTINCT * len(force):
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 0.25 * float(np.median(steps))]
    # Rounded decimals scatter about the step.
    smallest = float(steps.min())
    return float(np.median(steps[steps < 1.5 * smallest]))


class CorrelatedNoise(NamedTuple):
    """Noise around the smooth parts of a trace.

    ``total`` and ``correlated`` are standard deviations, of all of it and of what is correlated;
    the autocorrelation of the latter decays with the correlation ``time`` [samples].
    """

    total: float
    correlated: float
    time: float


def correlated_noise(force: Array, white: float) -> CorrelatedNoise:
    """Noise that is correlated from sample to sample.

    The trace is cut into windows, and a polynomial is taken off in each. The median variance over
    windows, on which slips have no influence while most windows have none, grows with their length,
    up to the variance of the noise, and then with the signal: the longest windows before count. The
    autocorrelation is that in windows without slips.

    Parameters
    ----------
    force
        Samples at equal intervals, shape (samples,).
    white
        Standard deviation of the white noise.
    """
    best: tuple[float, Array] | None = None
    length = MIN_WINDOW
    while length <= min(MAX_WINDOW, len(force) // MIN_WINDOWS):
        residual = _around_polynomials(force, length)
        freedom = length - DEGREE - 1
        variances = (residual**2).sum(axis=1) / freedom
        # The median of a chi-square variate is below its mean.
        variance = float(np.median(variances)) / (1 - 2 / (9 * freedom)) ** 3
        if best is not None and variance > MAX_GROWTH * best[0] and best[0] > 0:
            break
        best = (variance, residual[variances <= MAX_VARIANCE * np.median(variances)])
        length *= 2
    if best is None:
        return CorrelatedNoise(white, 0.0, 0.0)
    variance, residual = best
    total = max(math.sqrt(variance), white)
    correlated = math.sqrt(max(variance - white**2, 0.0))
    if correlated <= MIN_CORRELATED * white or correlated == 0:
        return CorrelatedNoise(total, 0.0, 0.0)
    length = residual.shape[1]
    spectrum = np.fft.rfft(residual, 2 * length, axis=1)
    products = np.fft.irfft((np.abs(spectrum) ** 2).mean(axis=0))[: length // 2]
    covariance = products / (length - np.arange(length // 2))
    relative = covariance[1:] / covariance[1]
    small = np.flatnonzero(relative < MIN_CORRELATION)
    end = int(small[0]) if small.size else len(relative)
    # The sum of a geometric series of ratio exp(-1/time), from its first term on.
    area = float(relative[:end].sum())
    time = 1 / -math.log1p(-1 / area) if area > 1 else 0.0
    return CorrelatedNoise(total, correlated, time)


def _around_polynomials(force: Array, length: int) -> Array:
    """Residuals around polynomials, shape (windows, length)."""
    number = len(force) // length
    windows = force[: number * length].reshape(number, length)
    if number > MAX_WINDOWS:
        windows = windows[np.linspace(0, number - 1, MAX_WINDOWS).astype(int)]
    basis = np.linalg.qr(np.vander(np.linspace(-1, 1, length), DEGREE + 1))[0]
    residual: Array = windows - (windows @ basis) @ basis.T
    return residual
