"""Summaries of a trace, independent of the phase of its slips.

After some slips a trace depends on single contacts: two runs with the same parameters have the same
statistics only. The first loading, peak and slip of N contacts differ from those of the master
equation by N^(-1/2) only, and are summarized point by point, along the waveform of the slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips, find_slips

Array = NDArray[np.float64]

# Points of the waveform of a slip, in periods of the setup since the force fell by half.
WAVEFORM = np.arange(-10, 51) / 20
# Range of the force for the slope of the loading, over the first peak.
LOADING = (0.1, 0.6)
# Times of the comparison with linear loading, over the time of the first peak.
LAGS = (0.8, 0.9, 0.95, 0.97, 0.985)
# Quantiles of the force [%].
QUANTILES = (1, 5, 25, 50, 75, 95, 99)
# Frequency bands, from a fraction of the frequency of the setup to the Nyquist frequency, and
# length of the segments of the spectrum in periods of the setup.
BANDS = 12
MIN_FREQUENCY = 0.1
SEGMENT_PERIODS = 40
# Minimum number of slips for their statistics.
MIN_SLIPS = 3
# Minimum arguments of logarithms.
TINY = 1e-12


@dataclass(frozen=True)
class Feature:
    """A summary: its name, its group, and its meaning."""

    name: str
    group: str
    meaning: str


@dataclass(frozen=True)
class Summarizer:
    """Computes the summaries of traces with the same sampling.

    Attributes
    ----------
    time
        Times of the samples [s] from the start of the run, at equal intervals.
    noise
        Standard deviation of the noise of the force [N].
    period
        Period of the setup for finding slips [s], the same for every trace.
    scale
        Unit of the forces [N], such as the maximum of the measured trace.
    direction
        Sign of the drive's velocity.
    has_start
        Whether the trace begins with the first loading of the run.
    """

    time: Array
    noise: float
    period: float
    scale: float
    direction: float = 1.0
    has_start: bool = True

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """The summaries in their order."""
        found = [
            Feature("slip_count", "slips", "logarithm of the number of slips"),
            Feature("mean_force", "force", "mean force after the first slip"),
            Feature("force_deviation", "force", "logarithm of the standard deviation of the force"),
            *(
                Feature(f"force_quantile_{one}", "force", f"{one} % quantile of the force")
                for one in QUANTILES
            ),
            *(
                Feature(f"spectrum_{one}", "ringing", f"logarithm of the power in band {one}")
                for one in range(BANDS)
            ),
        ]
        if self.has_start:
            found += [
                Feature("loading_slope", "first loading", "logarithm of the slope of the loading"),
                Feature("loading_start", "first loading", "force at which the loading starts"),
                Feature("first_peak", "first peak", "force at the first peak"),
                Feature("first_peak_time", "first peak", "logarithm of the time of the first peak"),
                *(
                    Feature(f"softening_{one:g}", "first peak", "force relative to linear loading")
                    for one in LAGS
                ),
                Feature("first_drop", "first slip", "logarithm of the first force drop"),
                Feature(
                    "first_rate", "first slip", "logarithm of the maximum rate of the first slip"
                ),
                *(
                    Feature(
                        f"first_waveform_{one:+.2f}", "first slip", "force along the first slip"
                    )
                    for one in WAVEFORM
                ),
            ]
        for name, meaning in (
            ("peak", "force at the start of slips"),
            ("bottom", "force at the end of slips"),
            ("drop", "logarithm of force drops"),
            ("duration", "logarithm of durations"),
            ("rate", "logarithm of the maximum rate of fall"),
            ("waiting_time", "logarithm of waiting times"),
        ):
            found += [
                Feature(f"mean_{name}", "slips", f"mean of the {meaning}"),
                Feature(f"median_{name}", "slips", f"median of the {meaning}"),
                Feature(f"spread_{name}", "slips", f"logarithm of the spread of the {meaning}"),
            ]
        found += [
            Feature("return_map", "slips", "correlation of each force drop with the next"),
            *(
                Feature(f"waveform_{one:+.2f}", "slips", "mean force along slips")
                for one in WAVEFORM
            ),
        ]
        return tuple(found)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the summaries."""
        return tuple(one.name for one in self.features)

    def slips(self, force: Array) -> FoundSlips:
        """The slips of a trace."""
        return find_slips(
            self.time, force, noise=self.noise, period=self.period, direction=self.direction
        )

    def __call__(self, force: Array) -> Array:
        """The summaries of a trace of the force [N], shape (samples,); NaN if undefined."""
        found = self.slips(force)
        force = self.direction * force / self.scale
        values: dict[str, float] = {"slip_count": math.log(len(found) + 0.5)}
        first = int(found.first[0]) if len(found) else _loaded(force)
        end = int(found.last[0]) if len(found) else first
        if self.has_start:
            values |= self._start(force, found, first)
            settled = end + round(2 * self.period / self._interval)
        else:
            settled = 0
        values |= self._whole(force[settled:])
        values |= self._statistics(force, found)
        return np.array([values.get(name, math.nan) for name in self.names])

    @cached_property
    def _interval(self) -> float:
        return float(self.time[1] - self.time[0])

    def _start(self, force: Array, found: FoundSlips, first: int) -> dict[str, float]:
        time, peak = self.time, float(force[first])
        if len(found):
            peak = self.direction * float(found.force_before[0]) / self.scale
        values = {"first_peak": peak}
        end = time[first]
        if end <= 0 or peak <= 0:
            return values
        values["first_peak_time"] = math.log(end)
        inside = np.flatnonzero(force[:first] > LOADING[1] * peak)
        stop = int(inside[0]) if inside.size else first
        start = int(np.argmax(force[: stop + 1] > LOADING[0] * peak))
        if stop - start > 4:
            slope, level = np.polyfit(time[start:stop], force[start:stop], 1)
            values["loading_slope"] = math.log(max(slope, TINY))
            values["loading_start"] = float(level)
            for one in LAGS:
                near = slice(*np.searchsorted(time, [(one - 0.01) * end, (one + 0.01) * end]))
                if near.stop > near.start:
                    deviation = force[near] - level - slope * time[near]
                    values[f"softening_{one:g}"] = float(np.mean(deviation)) / peak
        if len(found):
            drop = self.direction * (found.force_before[0] - found.force_after[0]) / self.scale
            values["first_drop"] = math.log(max(drop, TINY))
            values["first_rate"] = math.log(found.fall_rate[0] / self.scale)
            waveform = self._waveform(force, int(found.first[0]), int(found.last[0]))
            values |= {
                f"first_waveform_{at:+.2f}": value
                for at, value in zip(WAVEFORM, waveform, strict=True)
            }
        return values

    def _whole(self, force: Array) -> dict[str, float]:
        from scipy.signal import welch

        if force.size < 64:
            return {}
        values = {
            "mean_force": float(np.mean(force)),
            "force_deviation": math.log(float(np.std(force)) + TINY),
        }
        for one, value in zip(QUANTILES, np.percentile(force, QUANTILES), strict=True):
            values[f"force_quantile_{one}"] = float(value)
        length = round(SEGMENT_PERIODS * self.period / self._interval)
        frequency, power = welch(
            force, fs=1 / self._interval, nperseg=max(64, min(length, force.size))
        )
        edges = np.geomspace(MIN_FREQUENCY / self.period, frequency[-1] * (1 + 1e-9), BANDS + 1)
        for band in range(BANDS):
            inside = (frequency >= edges[band]) & (frequency < edges[band + 1])
            if inside.any():
                values[f"spectrum_{band}"] = math.log(float(np.mean(power[inside])) + TINY**2)
        return values

    def _statistics(self, force: Array, found: FoundSlips) -> dict[str, float]:
        # The first slip of a run from its initial state differs from the others.
        later = slice(1 if self.has_start else 0, None)
        if len(found.start_time[later]) < MIN_SLIPS:
            return {}
        unit = self.direction / self.scale
        before, after = unit * found.force_before, unit * found.force_after
        drop = np.log(np.maximum(before - after, TINY))
        columns = {
            "peak": before[later],
            "bottom": after[later],
            "drop": drop[later],
            "duration": np.log(found.end_time - found.start_time)[later],
            "rate": np.log(found.fall_rate / self.scale)[later],
            "waiting_time": np.log(np.diff(found.start_time)),
        }
        values = {}
        for name, column in columns.items():
            values[f"mean_{name}"] = float(np.mean(column))
            values[f"median_{name}"] = float(np.median(column))
            # A sampled duration may have no spread.
            values[f"spread_{name}"] = math.log(float(np.std(column)) + 1e-3)
        one, other = drop[later][:-1], drop[later][1:]
        if np.std(one) > 0 and np.std(other) > 0:
            values["return_map"] = float(np.corrcoef(one, other)[0, 1])
        else:
            values["return_map"] = 0.0
        ends = zip(found.first[later], found.last[later], strict=True)
        waveforms = [self._waveform(force, int(first), int(last)) for first, last in ends]
        mean = np.mean(waveforms, axis=0)
        return values | {
            f"waveform_{at:+.2f}": value for at, value in zip(WAVEFORM, mean, strict=True)
        }

    def _waveform(self, force: Array, first: int, last: int) -> Array:
        """Force at the points `WAVEFORM` of a slip."""
        half = (force[first] + force[last]) / 2
        below = first + int(np.argmax(force[first : last + 1] <= half))
        above = max(below - 1, 0)
        step = force[above] - force[below]
        start = self.time[above]
        if step > 0:
            start += (force[above] - half) / step * self._interval
        waveform: Array = np.interp(start + WAVEFORM * self.period, self.time, force)
        return waveform


def _loaded(force: Array) -> int:
    """The end of the loading in a trace without slips: the first sample near the maximum."""
    return int(np.argmax(force >= 0.95 * np.max(force)))
