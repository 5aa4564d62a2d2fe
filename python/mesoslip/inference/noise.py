"""Noise of a measured force, and random noise of the same kind for simulations."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mesoslip.analysis.noise import estimate_noise, noise_level
from mesoslip.array_types import Array

# Relative uncertainty of an estimated noise.
UNCERTAINTY = 0.1
# Orders of differences for the noise, and quantile at which these are clipped.
ORDERS = range(1, 8)
CLIPPED = 0.999


@dataclass(frozen=True)
class Noise:
    """Noise that is added to simulated traces."""

    white: float
    """Standard deviation of the white part [N]."""
    coloured: float = 0.0
    """Standard deviation of the correlated part, an autoregressive process of order 1 [N]."""
    correlation_time: float = 0.0
    """Correlation time of that part [s]."""
    step: float = 0.0
    """Digital step of the recorder [N]."""
    uncertainty: float = 0.0
    """Relative standard deviation of the amplitude, which differs between simulations."""

    @property
    def deviation(self) -> float:
        """Standard deviation of all parts [N]."""
        return math.sqrt(self.white**2 + self.coloured**2 + self.step**2 / 12)

    def added(self, force: Array, interval: float, rng: np.random.Generator) -> Array:
        """A trace [N] with noise, for a mean distance of the samples [s]."""
        amplitude = 1.0
        if self.uncertainty > 0:
            amplitude = math.exp(self.uncertainty * rng.standard_normal())
        noisy = force + amplitude * self.white * rng.standard_normal(len(force))
        if self.coloured > 0:
            noisy += amplitude * self.coloured * self._process(len(force), interval, rng)
        if self.step > 0:
            noisy = self.step * np.round(noisy / self.step)
        return noisy

    def _process(self, count: int, interval: float, rng: np.random.Generator) -> Array:
        """An autoregressive process of order 1 and variance 1."""
        from scipy.signal import lfilter

        if self.correlation_time <= 0:
            return rng.standard_normal(count)
        kept = math.exp(-interval / self.correlation_time)
        drawn = rng.standard_normal(count)
        drawn[1:] *= math.sqrt(1 - kept**2)
        process: Array = lfilter([1.0], [1.0, -kept], drawn)
        return process

    def with_at_least(self, deviation: float) -> tuple[Noise, float]:
        """Noise of a minimum standard deviation [N], and that of the additional white noise."""
        missing = deviation**2 - self.deviation**2
        if missing <= 0:
            return self, 0.0
        more = math.sqrt(missing)
        return replace(self, white=math.hypot(self.white, more)), more

    def averaged(self, block: int, interval: float) -> float:
        """Standard deviation of the mean of a number of samples at a distance [s]."""
        quick = (self.white**2 + self.step**2 / 12) / block
        slow = 0.0
        if self.coloured > 0:
            lags = np.arange(1, block) * interval
            kept = np.exp(-lags / max(self.correlation_time, 1e-300))
            weights = 1 - np.arange(1, block) / block
            slow = self.coloured**2 * (1 + 2 * float(np.sum(weights * kept))) / block
        return math.sqrt(quick + slow)


def cleaned(
    times: Array, force: Array, *, deviation: float | None, is_measured: bool
) -> tuple[Array, Noise, tuple[str, ...]]:
    """A measured trace without impulses and hum, its other noise, whose white part may be given
    [N], and a sentence for each correction."""
    uncertainty = 0.0 if deviation is not None else UNCERTAINTY
    if not is_measured:
        white = noise_level(force) if deviation is None else deviation
        return force, Noise(white, uncertainty=uncertainty), ()
    found = estimate_noise(times, force)
    clean = found.clean(times, force)
    if deviation is not None:
        noise = Noise(deviation)
    else:
        # The mean square contributes to the summaries, also for noise that is not normal.
        white = max(found.deviation, _differences(clean))
        noise = Noise(
            math.sqrt(max(white**2 - found.digital_step**2 / 12, 0.0)),
            found.correlated_deviation,
            found.correlation_time,
            found.digital_step,
            uncertainty,
        )
    taken = tuple(one for one in found.sentences() if "removed" in one)
    return clean, noise, taken


def _differences(force: Array) -> float:
    """Standard deviation of noise that is not normal [N], as `noise_level` from mean squares of
    differences."""
    found = []
    for order in ORDERS:
        norm = math.sqrt(math.comb(2 * order, order))
        sizes = np.abs(np.diff(force, order)) / norm
        limit = np.quantile(sizes, CLIPPED)
        found.append(float(np.sqrt(np.mean(np.minimum(sizes, limit) ** 2))))
    return min(found)
