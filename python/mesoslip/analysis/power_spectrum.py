"""Power spectral density of samples at equal intervals.

Importing `scipy.signal` takes longer than the analysis of a trace of 100 000 samples.
"""

from __future__ import annotations

import numpy as np

from mesoslip.array_types import Array


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
