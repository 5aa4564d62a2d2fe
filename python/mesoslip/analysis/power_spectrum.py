"""Power spectral density of even samples.

SciPy's is in a package that takes longer to import than a trace of 100 000 samples to analyse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def power_spectrum(values: Array, interval: float, length: int) -> tuple[Array, Array]:
    """Power spectral density by Welch's method, as that of `scipy.signal.welch`.

    The mean of periodograms with Hann windows that overlap by half, without their means (Welch
    1967, IEEE Trans. Audio Electroacoust. 15, 70).

    Parameters
    ----------
    values
        Samples, at least one window.
    interval
        Their distance [s].
    length
        Samples in a window.

    Returns
    -------
    frequency, density
        Frequencies [Hz] from 0 to that of Nyquist, and the density in the squared unit of the
        samples over Hz, shape (length // 2 + 1).
    """
    length = min(length, len(values))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    parts = np.lib.stride_tricks.sliding_window_view(values, length)[:: length - length // 2]
    spectra = np.fft.rfft(window * (parts - parts.mean(axis=1, keepdims=True)), axis=1)
    density: Array = np.mean(np.abs(spectra) ** 2, axis=0) * interval / np.sum(window**2)
    # Negative frequencies too, which zero and that of Nyquist do not have.
    density[1 : (length + 1) // 2] *= 2
    return np.arange(length // 2 + 1) / (length * interval), density
