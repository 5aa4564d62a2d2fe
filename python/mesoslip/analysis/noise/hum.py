"""Hum: narrow lines in the spectrum of a trace, as of the mains."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.analysis.even_traces import power_spectrum
from mesoslip.array_types import Array

# Relative tolerance of the frequency of a line.
TOLERANCE = 2e-3
# Maximum harmonic of a given frequency.
MAX_HARMONIC = 9
# Minimum samples of a trace.
MIN_SAMPLES = 1024
# Segments of the spectrum, and bins of the median that is its background.
SEGMENTS, BACKGROUND = 8, 101
# Minimum power of a line over the background.
MIN_POWER = 8.0
# Bins on each side into which a line spreads.
LINE_BINS = 4
# Differences are clipped at this multiple of their median size, so that slips do not count.
CLIP = 6.0
# Periods in a block, and blocks of the running median of amplitudes.
BLOCK_PERIODS, MEDIAN_BLOCKS = 4, 31
# Minimum amplitude over its error, and over the standard deviation of the white noise.
MIN_SIGNIFICANCE, MIN_AMPLITUDE = 5.0, 0.3
# Maximum power over the variance of the trace: above it the oscillation is the trace's own.
MAX_SHARE = 0.2
# Maximum standard deviation of the residuals of a block over the white noise.
MAX_RESIDUAL = 2.5
# Minimum ratio of the 20 % and the 80 % quantile of the amplitude.
MIN_CONSTANCY = 0.5
# Maximum number of lines.
MAX_LINES = 12


@dataclass(frozen=True)
class HumLine:
    """A line of the hum, A cos(2 pi f t) + B sin(2 pi f t) with slowly varying A and B."""

    frequency: float  # f [Hz]
    amplitude: float  # median of (A^2 + B^2)^1/2
    time: Array  # at which A and B are known [s]
    cosine: Array  # A
    sine: Array  # B

    def __call__(self, time: Array) -> Array:
        """The hum at times [s], shape (samples,)."""
        phase = 2 * math.pi * self.frequency * time
        wave: Array = np.interp(time, self.time, self.cosine) * np.cos(phase)
        wave += np.interp(time, self.time, self.sine) * np.sin(phase)
        return wave


def find_hum(
    time: Array, force: Array, noise: float, *, frequency: float | None = None
) -> tuple[HumLine, ...]:
    """Lines of hum in a trace at equal intervals, with a standard deviation of the white noise.

    Lines stand out of the spectrum of the differences, clipped so that slips hardly count. Their
    amplitudes are medians over blocks of some periods: slips, in a minority of blocks, and ringing
    after slips, which has another phase each time, do not contribute. A line with a fifth of the
    variance of the trace is its own oscillation, and so are its harmonics. If a frequency [Hz] is
    given, it and its harmonics are the only candidates.
    """
    if len(force) < MIN_SAMPLES:
        return ()
    interval = float(np.median(np.diff(time)))
    candidates = _candidates(force, interval, frequency)
    variance = float(np.var(force))
    own: list[float] = []
    lines: list[HumLine] = []
    rest = force
    for candidate in candidates[:MAX_LINES]:
        line = _line(time, rest, candidate, interval, noise, frequency is not None)
        if line is None:
            continue
        if frequency is None and (
            line.amplitude**2 / 2 > MAX_SHARE * variance
            or any(_is_harmonic(candidate, other) for other in own)
        ):
            own.append(candidate)
            continue
        lines.append(line)
        rest = rest - line(time)
    return tuple(sorted(lines, key=lambda one: one.frequency))


def _is_harmonic(frequency: float, base: float) -> bool:
    ratio = frequency / base
    return round(ratio) >= 1 and abs(ratio / round(ratio) - 1) < 0.01


def _candidates(force: Array, interval: float, given: float | None) -> list[float]:
    """Frequencies of lines, the strongest first [Hz]."""
    from scipy.ndimage import median_filter

    steps = np.diff(force)
    bound = CLIP * max(float(np.median(np.abs(steps))), 1e-300)
    steps = np.clip(steps, -bound, bound)
    length = len(steps) // SEGMENTS
    bins, power = power_spectrum(steps, interval, length)
    if given is not None:
        multiples = given * np.arange(1, MAX_HARMONIC + 1)
        return [_peak(bins, power, float(one)) for one in multiples if one < 0.45 / interval]
    background = median_filter(power, BACKGROUND, mode="nearest")
    strong = (power > MIN_POWER * background) & (bins > LINE_BINS * bins[1])
    peaks: list[int] = [
        at
        for at in np.flatnonzero(strong).tolist()
        if power[at] == power[max(0, at - 2 * LINE_BINS) : at + 2 * LINE_BINS + 1].max()
        # A line is narrow: it ends within some bins.
        and power[max(0, at - 2 * LINE_BINS)] < 0.05 * power[at]
        and power[min(len(power) - 1, at + 2 * LINE_BINS)] < 0.05 * power[at]
    ]
    peaks.sort(key=lambda at: -power[at])
    return [_peak(bins, power, float(bins[at])) for at in peaks]


def _peak(bins: Array, power: Array, near: float) -> float:
    """Frequency of the maximum of the spectrum near a frequency [Hz]."""
    reach = max(1, round(TOLERANCE * near / bins[1]))
    middle = round(near / bins[1])
    span = slice(max(1, middle - reach), min(len(bins) - 1, middle + reach + 1))
    weights = power[span]
    return float((bins[span] * weights).sum() / weights.sum()) if weights.sum() > 0 else near


def _line(
    time: Array,
    force: Array,
    frequency: float,
    interval: float,
    noise: float,
    is_given: bool,
) -> HumLine | None:
    """The line of a frequency; None if it does not stand out."""
    from scipy.ndimage import median_filter

    length = max(16, round(BLOCK_PERIODS / frequency / interval))
    number = len(force) // length
    if number < 8:
        return None
    # A mean and a slope are fitted too, so that they do not leak into the line.
    shape = (number, length)
    blocks, times = (one[: number * length].reshape(shape) for one in (force, time))
    at = np.arange(length) - (length - 1) / 2
    phase = 2 * math.pi * frequency * (times - times.mean(axis=1, keepdims=True))
    first = 2 * math.pi * frequency * times.mean(axis=1)
    basis = np.stack([np.ones(length), at, np.cos(phase[0]), np.sin(phase[0])], axis=1)
    solution = np.linalg.pinv(basis) @ blocks.T
    residual = float(np.median(np.sqrt(np.mean((blocks.T - basis @ solution) ** 2, axis=0))))
    # From the middle of each block to time 0.
    turned = (solution[2] - 1j * solution[3]) * np.exp(-1j * first)
    # Slow changes of the frequency turn the phase from block to block.
    unit = turned / np.maximum(np.abs(turned), 1e-300)
    turn = float(np.angle(np.sum(unit[1:] * np.conj(unit[:-1]))))
    width = min(MEDIAN_BLOCKS, 2 * (number // 2) - 1)
    straight = turned * np.exp(-1j * turn * np.arange(number))
    smooth = median_filter(straight.real, width, mode="nearest") + 1j * median_filter(
        straight.imag, width, mode="nearest"
    )
    scatter = float(np.median(np.abs(straight - smooth)))
    error = 1.25 * scatter / math.sqrt(width)
    amplitude = float(np.median(np.abs(smooth)))
    if amplitude < max(MIN_SIGNIFICANCE * error, MIN_AMPLITUDE * noise):
        return None
    # Residuals larger than noise are those of slips: the line is one of their own.
    if not is_given and residual > max(MAX_RESIDUAL * noise, amplitude):
        return None
    # Ringing decays between slips.
    low, high = np.quantile(np.abs(smooth), (0.2, 0.8))
    if not is_given and low < MIN_CONSTANCY * high:
        return None
    middle = times.mean(axis=1)
    block_time = float(np.median(np.diff(middle)))
    corrected = frequency + turn / (2 * math.pi * block_time)
    # The frequency takes up the mean turn; the amplitude then varies slowly.
    amplitude_now = smooth * np.exp(1j * turn * np.arange(number))
    slow = amplitude_now * np.exp(-2j * math.pi * (corrected - frequency) * middle)
    return HumLine(corrected, amplitude, middle, slow.real, -slow.imag)
