"""Summaries of a trace, independent of the phase of its slips.

After some slips a trace depends on single contacts: two runs with the same parameters only have the
same statistics. The first loading, peak and slip of N contacts differ from those of the master
equation by N^(-1/2) only, and are summarized point by point, along the waveform of the slip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.even_traces import power_spectrum
from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.analysis.sampled_slips.windows import Windows, lines_through
from mesoslip.analysis.strokes.segments import Piece
from mesoslip.analysis.strokes.slips import find_slips_between_reversals
from mesoslip.array_types import Array
from mesoslip.inference.features import (
    BANDS,
    CREEP_LAGS,
    LAGS,
    QUANTILES,
    WAVEFORM,
    Feature,
    features,
)
from mesoslip.quantities import with_unit

# Range of the force for the slope of the loading, over the first peak.
LOADING = (0.1, 0.6)
# Parts of the time between slips in which the force rises linearly, and minimum samples of it.
LINEAR_PART = (0.15, 0.6)
MIN_LOADING_SAMPLES = 12
# Frequency bands, from a fraction of the frequency of the setup to the Nyquist frequency, and
# length of the segments of the spectrum in periods of the setup.
MIN_FREQUENCY = 0.1
SEGMENT_PERIODS = 40
# Minimum number of slips for their statistics.
MIN_SLIPS = 3
# Minimum arguments of logarithms.
TINY = 1e-12


@dataclass(frozen=True)
class Summarizer:
    """Computes the summaries of traces with the same sampling."""

    time: Array
    """Times of the samples [s] from the start of the run, at equal intervals."""
    noise: float
    """Standard deviation of the noise of the force [N]."""
    period: float
    """Period of the setup for finding slips [s], the same for every trace."""
    scale: float
    """Unit of the forces [N], such as the maximum of the measured trace."""
    direction: float = 1.0
    """Sign of the drive's velocity."""
    has_start: bool = True
    """Whether the trace begins with the first loading of the run."""
    pieces: tuple[Piece, ...] | None = None
    """Pieces of a drive that goes back and forth, the same for every trace."""

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """The summaries in their order."""
        return tuple(self._labelled())

    def _labelled(self) -> Iterator[Feature]:
        """The summaries, with the frequencies of the spectrum."""
        edges = self._edges
        for one in features(self.scale, has_start=self.has_start):
            if one.kind != "log power":
                yield one
                continue
            low, high = edges[int(one.name.rpartition("_")[2]) :][:2]
            band = f"at {with_unit(low, 'Hz', 2)} to {with_unit(high, 'Hz', 2)}"
            yield replace(
                one,
                meaning=f"logarithm of the power {band}",
                label=f"amplitude {band}",
                high="the force oscillates too strongly",
                low="the force oscillates too weakly",
                factor=one.factor * math.sqrt(high - low),
            )

    @cached_property
    def _edges(self) -> Array:
        """Edges of the frequency bands [1/s]."""
        highest = 0.5 / self._interval * (1 + 1e-9)
        return np.geomspace(MIN_FREQUENCY / self.period, highest, BANDS + 1)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.features)

    def slips(self, force: Array) -> FoundSlips:
        return find_slips_between_reversals(
            self.pieces,
            self.time,
            force,
            noise=self.noise,
            period=self.period,
            direction=self.direction,
        )

    def __call__(self, force: Array, found: FoundSlips | None = None) -> Array:
        """The summaries of a trace of the force [N], whose slips may be given; NaN if undefined."""
        found = self.slips(force) if found is None else found
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
            values["first_rate"] = math.log(max(found.fall_rate[0] / self.scale, TINY))
            (waveform,) = self._waveforms(force, found.first[:1], found.last[:1])
            values |= {
                f"first_waveform_{at:+.2f}": value
                for at, value in zip(WAVEFORM, waveform, strict=True)
            }
        return values

    def _whole(self, force: Array) -> dict[str, float]:
        if force.size < 64:
            return {}
        values = {
            "mean_force": float(np.mean(force)),
            "force_deviation": math.log(float(np.std(force)) + TINY),
        }
        for one, value in zip(QUANTILES, np.percentile(force, QUANTILES), strict=True):
            values[f"force_quantile_{one}"] = float(value)
        length = round(SEGMENT_PERIODS * self.period / self._interval)
        frequency, power = power_spectrum(force, self._interval, max(64, length))
        edges = self._edges
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
            "rate": np.log(np.maximum(found.fall_rate / self.scale, TINY))[later],
            "waiting_time": np.log(np.diff(found.start_time)),
        }
        values = {}
        for name, column in columns.items():
            values[f"mean_{name}"] = float(np.mean(column))
            values[f"median_{name}"] = float(np.median(column))
            # Sampled durations may be equal.
            values[f"spread_{name}"] = math.log(float(np.std(column)) + 1e-3)
        changes = float(np.std(np.diff(before[later]))) / math.sqrt(2)
        values["wander"] = math.log((float(np.std(before[later])) + TINY) / (changes + TINY))
        one, other = drop[later][:-1], drop[later][1:]
        if np.std(one) > 0 and np.std(other) > 0:
            values["return_map"] = float(np.corrcoef(one, other)[0, 1])
        else:
            values["return_map"] = 0.0
        values |= self._loading(force, found, drop, later.start)
        mean = self._waveforms(force, found.first[later], found.last[later]).mean(axis=0)
        return values | {
            f"waveform_{at:+.2f}": value for at, value in zip(WAVEFORM, mean, strict=True)
        }

    def _loading(
        self, force: Array, found: FoundSlips, drop: Array, start: int
    ) -> dict[str, float]:
        """Slope of the loading between slips, and creep before slips, from their medians."""
        start = max(start, 1)
        first, last = found.last[start - 1 : -1], found.first[start:]
        # After the ringing, if there is time.
        ringing = round(2 * self.period / self._interval)
        settled = np.minimum(first + ringing, (first + last) // 2)
        low, high = (settled + part * (last - settled) for part in LINEAR_PART)
        low, high = np.ceil(low).astype(int), np.floor(high).astype(int)
        kept = high - low >= MIN_LOADING_SAMPLES
        if np.count_nonzero(kept) < MIN_SLIPS:
            return {}
        low, high, settled, last = (one[kept] for one in (low, high, settled, last))
        begin, size = self.time[low], np.exp(drop[start:][kept])
        lines = lines_through(self.time, force, Windows(low, high - low), begin)
        half = np.maximum(1, (last - settled) // 40)
        creep = []
        for lag in CREEP_LAGS:
            at = np.round(settled + lag * (last - settled)).astype(int)
            near = Windows(at - half, 2 * half + 1)
            means = [near.mean_of(one[near.samples]) for one in (self.time, force)]
            creep.append((lines.level + lines.slope * (means[0] - begin) - means[1]) / size)
        values = {"stick_slope": math.log(max(float(np.median(lines.slope)), TINY))}
        medians = np.median(creep, axis=1)
        return values | {
            f"creep_{lag:g}": float(one) for lag, one in zip(CREEP_LAGS, medians, strict=True)
        }

    def _waveforms(self, force: Array, first: Samples, last: Samples) -> Array:
        """Force at the points `WAVEFORM` of slips, shape (slips, points)."""
        slips = Windows(first, last - first + 1)
        half = (force[first] + force[last]) / 2
        lower = np.flatnonzero(force[slips.samples] <= slips.spread(half))
        below = slips.samples[lower[np.searchsorted(lower, slips.starts)]]
        above = np.maximum(below - 1, 0)
        step = force[above] - force[below]
        falls = step > 0
        start = self.time[above]
        start[falls] += ((force[above] - half)[falls] / step[falls]) * self._interval
        points = start[:, np.newaxis] + WAVEFORM * self.period
        return np.interp(points, self.time, force)


def _loaded(force: Array) -> int:
    """The end of the loading in a trace without slips: the first sample near the maximum."""
    return int(np.argmax(force >= 0.95 * np.max(force)))
