"""The noise of a measured trace."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.noise.hum import HumLine, find_hum
from mesoslip.analysis.noise.impulses import find_impulses
from mesoslip.analysis.noise.levels import (
    NORMAL_MEDIAN,
    correlated_noise,
    digital_step_of,
    noise_level,
)
from mesoslip.analysis.noise.parts import parts_of
from mesoslip.array_types import Array
from mesoslip.quantities import number, with_unit

# Blocks of the trace for the drift, and its minimum size in standard errors.
DRIFT_BLOCKS = 20
MIN_DRIFT = 4.0
# Maximum force at the start of a trace that begins with a first loading, over that of its second
# half.
RELAXED = 0.5
# Points from which the error of a sum over correlated noise is computed.
MAX_POINTS = 400


@dataclass(frozen=True)
class TraceNoise:
    """The noise of a trace: white and correlated noise, impulses, hum and drift.

    Sizes are in the unit of the force, and 0 where there is nothing; deviations are standard
    deviations without impulses and hum.
    """

    deviation: float
    """Deviation of the white noise, with that of digital steps, in the part with most samples."""
    correlated_deviation: float
    """Deviation of the noise that is correlated from sample to sample."""
    correlation_time: float
    """Time in which the autocorrelation of that noise decays [s]."""
    digital_step: float
    impulse_time: Array
    """Times of the samples in impulses [s], shape (impulses,)."""
    impulse_share: float
    """Share of these samples."""
    impulse_size: float
    """Median size of impulses."""
    hum: tuple[HumLine, ...]
    drift: float
    """Significant slow drift, in the unit of the force over s."""
    duration: float
    """Duration of the trace [s]."""
    intervals: tuple[float, ...]
    """Sampling interval of each part of the trace [s]."""
    deviations: tuple[float, ...]
    """Deviation of the white noise in each part."""

    @property
    def total_deviation(self) -> float:
        """Standard deviation of white and correlated noise."""
        return math.hypot(self.deviation, self.correlated_deviation)

    def is_impulse(self, time: Array) -> NDArray[np.bool_]:
        """Which samples are in impulses; of the trace or a part of it."""
        return np.isin(time, self.impulse_time)

    def clean(self, time: Array, force: Array) -> Array:
        """The force of the trace, or of a part of it, without hum and impulses."""
        cleaned = force.astype(float)
        for line in self.hum:
            cleaned -= line(time)
        return without_impulses(time, cleaned, self.impulse_time)

    def linear_error(self, time: Array, weights: Array) -> float:
        """Standard error of a sum of samples with weights that are smooth over the correlation
        time."""
        variance = self.deviation**2 * float(weights @ weights)
        if self.correlated_deviation > 0 and self.correlation_time > 0:
            # Neighbours are summed, so that there are some hundred points.
            edges = np.unique(np.linspace(0, len(time), MAX_POINTS + 1).astype(int))[:-1]
            sums = np.add.reduceat(weights, edges)
            at = np.add.reduceat(time, edges) / np.diff([*edges, len(time)])
            decay = np.exp(-np.abs(at[:, None] - at) / self.correlation_time)
            variance += self.correlated_deviation**2 * float(sums @ decay @ sums)
        return math.sqrt(variance)

    def mean_error(self, time: Array) -> float:
        """Standard error of the mean over samples at times [s]."""
        return self.linear_error(time, np.full(len(time), 1 / max(len(time), 1)))

    def slope_error(self, time: Array) -> float:
        """Standard error of the slope of a line through samples, unit of the force over s."""
        since = time - time.mean()
        return self.linear_error(time, since / (since @ since))

    def scalars(self) -> dict[str, float]:
        """The numbers that an output keeps."""
        return {
            "deviation": self.deviation,
            "correlated_deviation": self.correlated_deviation,
            "correlation_time": self.correlation_time,
            "digital_step": self.digital_step,
            "impulse_share": self.impulse_share,
            "impulse_size": self.impulse_size,
            "drift": self.drift,
        }

    def sentences(self, unit: str = "N", max_rates: float = math.inf) -> list[str]:
        """Description of the noise; the unit of the force is "N" or "1". White noise at more rates
        than the maximum is described by its range."""

        def size(value: float) -> str:
            return with_unit(value, unit)

        found = [f"white noise of {size(self.deviation)} (standard deviation)"]
        if len(self.deviations) > max_rates:
            low, high = min(self.deviations), max(self.deviations)
            found[0] += f", {size(low)} to {size(high)} at different rates"
        elif len(self.deviations) > 1:
            found[0] += ", by part: " + ", ".join(
                f"{size(one)} at {with_unit(1 / interval, 'Hz')}"
                for one, interval in zip(self.deviations, self.intervals, strict=True)
            )
        if self.digital_step > 0:
            found.append(f"digital steps of {size(self.digital_step)}")
        if self.correlated_deviation > 0:
            found.append(
                f"correlated noise of {size(self.correlated_deviation)}, correlation time "
                f"{with_unit(self.correlation_time, 's')}"
            )
        if self.impulse_time.size:
            found.append(
                f"impulses in {number(100 * self.impulse_share, 2)} % of the samples, "
                f"{size(self.impulse_size)} in the median: removed for slips and fits"
            )
        if self.hum:
            lines = ", ".join(
                f"{size(one.amplitude)} at {number(one.frequency, 4)} Hz" for one in self.hum
            )
            found.append(f"hum of {lines}: removed for slips and fits")
        if self.drift:
            found.append(
                f"drift of {size(self.drift * self.duration)} over {with_unit(self.duration, 's')}"
            )
        return found


def without_impulses(time: Array, values: Array, impulse_time: Array) -> Array:
    """A trace with lines through the neighbours instead of the samples of impulses."""
    return _repaired(time, values, np.isin(time, impulse_time))


def _repaired(time: Array, values: Array, wrong: NDArray[np.bool_]) -> Array:
    if not wrong.any() or wrong.all():
        return values
    repaired = values.copy()
    repaired[wrong] = np.interp(time[wrong], time[~wrong], values[~wrong])
    return repaired


def estimate_noise(time: Array, force: Array, *, hum: float | None = None) -> TraceNoise:
    """Estimate the noise of a measured trace by medians, on which slips have no influence.

    Times [s] increase, at a rate that may change, and the force is finite. The hum is that of the
    mains at a given frequency [Hz], with its harmonics; by default any narrow line of the spectrum
    that is not the trace's own.
    """
    force = np.asarray(force, dtype=float)
    parts = parts_of(time)
    main = max(parts, key=len)
    wrong = np.zeros(len(force), dtype=bool)
    sizes = []
    for part in parts:
        values = force[part.samples]
        found = find_impulses(values, noise_level(values))
        wrong[part.samples] = found
        if found.any():
            good = np.interp(np.flatnonzero(found), np.flatnonzero(~found), values[~found])
            sizes.append(np.abs(values[found] - good))
    repaired = _repaired(time, force, wrong).copy()
    lines = find_hum(
        time[main.samples],
        repaired[main.samples],
        noise_level(repaired[main.samples]),
        frequency=hum,
    )
    for line in lines:
        repaired -= line(time)
    deviations = tuple(
        max(noise_level(repaired[one.samples]), digital_step_of(force[one.samples]) / math.sqrt(12))
        for one in parts
    )
    deviation = deviations[parts.index(main)]
    correlated = correlated_noise(repaired[main.samples], deviation)
    return TraceNoise(
        deviation=deviation,
        correlated_deviation=correlated.correlated,
        correlation_time=correlated.time * main.interval,
        digital_step=digital_step_of(force),
        impulse_time=time[wrong],
        impulse_share=float(np.mean(wrong)) if wrong.size else 0.0,
        impulse_size=float(np.median(np.concatenate(sizes))) if sizes else 0.0,
        hum=lines,
        drift=_drift(time, repaired),
        duration=float(time[-1] - time[0]) if len(time) else 0.0,
        intervals=tuple(one.interval for one in parts),
        deviations=deviations,
    )


def _drift(time: Array, force: Array) -> float:
    """Slope through medians of blocks after the first loading, by the median of slopes, if it is
    significant."""
    start = _end_of_loading(force)
    time, force = time[start:], force[start:]
    if len(time) < 4 * DRIFT_BLOCKS:
        return 0.0
    edges = np.searchsorted(time, np.linspace(time[0], time[-1], DRIFT_BLOCKS + 1)[1:-1])
    blocks = [
        (float(np.mean(at)), float(np.median(values)))
        for at, values in zip(np.split(time, edges), np.split(force, edges), strict=True)
        if values.size
    ]
    at, level = np.array(blocks).T
    first, second = np.triu_indices(len(at), 1)
    slope = float(np.median((level[second] - level[first]) / (at[second] - at[first])))
    rest = level - slope * at
    scatter = float(np.median(np.abs(rest - np.median(rest)))) / NORMAL_MEDIAN
    error = scatter / (math.sqrt(len(at)) * float(np.std(at)))
    return slope if abs(slope) > MIN_DRIFT * error else 0.0


def _end_of_loading(force: Array) -> int:
    """First sample at the level of the second half; 0 where a trace starts at that level."""
    if not len(force):
        return 0
    level = float(np.median(force[len(force) // 2 :]))
    first = float(np.median(force[: 1 + len(force) // (2 * DRIFT_BLOCKS)]))
    if not first * np.sign(level) < RELAXED * abs(level):
        return 0
    return int(np.argmax(force * np.sign(level) >= abs(level)))
