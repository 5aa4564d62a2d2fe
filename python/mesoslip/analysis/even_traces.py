"""Traces at equal intervals, and their power spectral density without the slow `scipy.signal`."""

from __future__ import annotations

import math

import numpy as np

from mesoslip.array_types import Array, DataTree

# Maximum relative difference of intervals that count as equal.
INTERVAL_TOLERANCE = 1e-3


def even_trace(tree: DataTree) -> tuple[Array, Array]:
    """Times [s] and spring force [N] of the first realization at equal intervals,
    interpolated where they differ."""
    root = tree.to_dataset()
    force = root["spring_force"].values[0].astype(float)
    is_known = np.isfinite(force)
    time, force = root["time"].values[is_known], force[is_known]
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.all(np.abs(steps - interval) <= INTERVAL_TOLERANCE * interval):
        return time, force
    even = time[0] + interval * np.arange(math.floor((time[-1] - time[0]) / interval) + 1)
    return even, np.interp(even, time, force)


def power_spectrum(values: Array, interval: float, length: int) -> tuple[Array, Array]:
    """Frequencies [Hz] and power spectral density, as that of `scipy.signal.welch`.

    The density is the mean of periodograms of windows of ``length`` samples, less their means and
    with Hann's weights, which overlap by half (Welch 1967, IEEE Trans. Audio Electroacoust. 15,
    70).
    """
    length = min(length, len(values))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    parts = np.lib.stride_tricks.sliding_window_view(values, length)[:: length - length // 2]
    spectra = np.fft.rfft(window * (parts - parts.mean(axis=1, keepdims=True)), axis=1)
    density: Array = np.mean(np.abs(spectra) ** 2, axis=0) * interval / np.sum(window**2)
    # Negative frequencies are included; zero and the Nyquist frequency have none.
    density[1 : (length + 1) // 2] *= 2
    return np.arange(length // 2 + 1) / (length * interval), density
