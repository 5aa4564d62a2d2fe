"""Sizes of the noise of a trace: white, digital steps, and correlated."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mesoslip.array_types import Array

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
# Degree of the polynomials that are removed in windows.
DEGREE = 3
# Maximum growth of the variance when windows become twice as long. That of noise grows by 2 at
# most, up to a limit at the correlation time; that of a smooth signal grows by 256.
MAX_GROWTH = 2.6
# Maximum variance of windows without slips, over the median variance.
MAX_VARIANCE = 2.5
# Minimum correlated noise over the white noise.
MIN_CORRELATED = 0.35
# Maximum length of windows from which the correlation is fitted; minimum and number of the fitted
# correlation times [samples].
MAX_FITTED, MIN_TIME, TIMES = 256, 0.5, 25


def noise_level(force: Array) -> float:
    """Standard deviation of the white noise of a trace at equal intervals.

    The estimate is the median absolute difference of the trace, on which the few slips have no
    influence, at the order 1 to 7 for which it is smallest: a smooth, well sampled signal
    contributes less at higher orders. A digitized trace has at least the noise of its resolution.
    Noise that is correlated from sample to sample, as behind a filter, is underestimated:
    `correlated_noise` finds it.
    """
    found = []
    differences = force
    for order in ORDERS:
        if len(force) <= 2 * order:
            break
        # Sum of squares of the binomial coefficients.
        norm = math.sqrt(math.comb(2 * order, order))
        differences = np.diff(differences)
        middle = float(np.median(np.abs(differences), overwrite_input=True))
        found.append(middle / (NORMAL_MEDIAN * norm))
    return max(min(found, default=0.0), digital_step_of(force) / math.sqrt(12))


def digital_step_of(force: Array) -> float:
    """Step of a digitized trace, the smallest difference of distinct values; 0 if there are too
    many of them."""
    values = np.unique(force)
    if not 1 < values.size < MAX_DISTINCT * len(force):
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 0.25 * float(np.median(steps))]
    # Rounded decimals scatter about the step.
    smallest = float(steps.min())
    return float(np.median(steps[steps < 1.5 * smallest]))


class CorrelatedNoise(NamedTuple):
    """Standard deviations of all noise and its correlated part; correlation time [samples]."""

    total: float
    correlated: float
    time: float


def correlated_noise(force: Array, white: float) -> CorrelatedNoise:
    """Noise that is correlated from sample to sample; ``white`` is that of the white noise.

    The trace is cut into windows, and a polynomial is removed in each. The median variance over
    windows, on which slips have no influence while most windows have none, grows with their length
    up to the variance of the noise, and then with the signal; the longest windows before that are
    used. The autocorrelation is that in windows without slips.
    """
    best: tuple[float, Array] | None = None
    length = MIN_WINDOW
    while length <= min(MAX_WINDOW, len(force) // MIN_WINDOWS):
        residual = _windows(force, length)
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
    residual = best[1]
    length = min(residual.shape[1], MAX_FITTED)
    if length < residual.shape[1]:
        residual = _without_polynomials(residual.reshape(-1, length))
    variance, time = _fitted(residual)
    correlated = math.sqrt(max(variance - white**2, 0.0))
    if correlated <= MIN_CORRELATED * white or correlated == 0:
        return CorrelatedNoise(max(math.sqrt(variance), white), 0.0, 0.0)
    return CorrelatedNoise(math.sqrt(variance), correlated, time)


def _fitted(residual: Array) -> tuple[float, float]:
    """Variance of white and correlated noise, and the correlation time [samples], by residuals.

    Polynomials remove part of the noise, the more the longer it is correlated. So the mean products
    of residuals are compared with those of white and of correlated noise without polynomials.
    """
    from scipy.optimize import nnls

    length = residual.shape[1]
    spectrum = np.fft.rfft(residual, 2 * length, axis=1)
    wanted = np.fft.irfft((np.abs(spectrum) ** 2).mean(axis=0))[: length // 2]
    unit = np.eye(length)
    distance = np.abs(np.subtract.outer(np.arange(length), np.arange(length)))
    white = _products(unit)
    best = (math.inf, 0.0, 0.0)
    for time in np.geomspace(MIN_TIME, max(length / 8, 1.0), TIMES):
        basis = np.stack([white, _products(np.exp(-distance / time))], axis=1)
        weights, misfit = nnls(basis, wanted)
        if misfit < best[0]:
            best = (misfit, float(weights.sum()), float(time))
    return best[1:]


def _products(covariance: Array) -> Array:
    """Sums of products of residuals around polynomials, by lag, for noise with a covariance."""
    length = len(covariance)
    residual = _without_polynomials(_without_polynomials(covariance).T)
    return np.array([np.trace(residual, lag) for lag in range(length // 2)])


def _windows(force: Array, length: int) -> Array:
    """Residuals around polynomials in windows, shape (windows, length)."""
    number = len(force) // length
    windows = force[: number * length].reshape(number, length)
    if number > MAX_WINDOWS:
        windows = windows[np.linspace(0, number - 1, MAX_WINDOWS).astype(int)]
    return _without_polynomials(windows)


def _without_polynomials(windows: Array) -> Array:
    """Rows less the polynomials fitted to them."""
    grid = np.linspace(-1, 1, windows.shape[1])
    basis = np.linalg.qr(np.vander(grid, DEGREE + 1))[0]
    residual: Array = windows - (windows @ basis) @ basis.T
    return residual
