"""Slow variation of the strength of an interface along its track.

It is a nuisance: a random force, added to simulated traces, that depends on the displacement of
the drive. It is normal, with a correlation exp(-x^2/(2 l^2)) over a distance x, and the same size
everywhere. Its amplitude is fitted; its correlation length l is that of the measured trace.
"""

from __future__ import annotations

import math

import numpy as np

from mesoslip.array_types import Array
from mesoslip.inference.summaries import Summarizer

# Points of the random force in a correlation length.
POINTS = 5
# Slips over which the measured force is averaged for the correlation length.
AVERAGED_SLIPS = 3
# Maximum number of correlation lengths in a track.
MAX_LENGTHS = 1000


def wandering(
    drive: Array, length: float, rng: np.random.Generator, *, starts_at_zero: bool
) -> Array:
    """A random force of variance 1 at displacements of the drive [m], by correlation length [m]."""
    from scipy.ndimage import gaussian_filter1d

    low, high = float(drive.min()), float(drive.max())
    length = max(length, (high - low) / MAX_LENGTHS, 1e-300)
    step = length / POINTS
    margin = 5 * POINTS
    count = math.ceil((high - low) / step) + 2 * margin + 2
    # White noise, smoothed to the correlation exp(-x^2/(2 l^2)).
    width = POINTS / math.sqrt(2)
    smooth = gaussian_filter1d(rng.standard_normal(count), width, mode="wrap")
    smooth *= math.sqrt(2 * width * math.sqrt(math.pi))
    found = np.interp(drive, low + step * (np.arange(count) - margin), smooth)
    if starts_at_zero:
        found = found - found[0] * np.exp(-((drive - drive[0]) ** 2) / (2 * length**2))
    return np.asarray(found)


def measured_length(summarizer: Summarizer, force: Array, velocity: float) -> float:
    """Correlation length of the slow variation of a force [m]: that of the normal curve with the
    same distance of half correlation."""
    from scipy.ndimage import uniform_filter1d

    time = summarizer.time
    interval = float(time[1] - time[0])
    starts = summarizer.slips(force).start_time
    cycle = float(np.median(np.diff(starts))) if len(starts) > 1 else summarizer.period
    window = max(1, min(round(AVERAGED_SLIPS * cycle / interval), len(force) // 8))
    slow = uniform_filter1d(force, window, mode="nearest")[:: max(1, window // 8)]
    slow = slow - slow.mean()
    spectrum = np.abs(np.fft.rfft(slow, 2 * len(slow))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(slow)]
    below = np.flatnonzero(correlation < 0.5 * correlation[0])
    lag = below[0] if below.size else len(slow) // 4
    time_lag = max(1, lag) * max(1, window // 8) * interval
    return velocity * time_lag / math.sqrt(2 * math.log(2))
