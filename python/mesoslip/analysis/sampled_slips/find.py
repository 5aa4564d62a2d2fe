"""Find the slips in a trace, and measure them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.noise import TraceNoise, estimate_noise
from mesoslip.analysis.sampled_slips.choice import SlipCounts, chosen
from mesoslip.analysis.sampled_slips.ends import ends_of, fall_period, fall_rates
from mesoslip.analysis.sampled_slips.levels import Level, levels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FoundSlips:
    """Slips in a trace, each array of shape (slips,)."""

    start_time: Array
    """Times of the maximum before [s]."""
    end_time: Array
    """Times of the minimum after [s]."""
    force_before: Array
    """Forces at the start, averaged over the noise as far as the trace allows [N]."""
    force_after: Array
    fall_rate: Array
    """Maximum rate of fall [N/s]."""
    first: Samples
    """Samples of the maximum before."""
    last: Samples
    """Samples of the minimum after."""
    min_fall: float = 0.0
    """Minimum fall of a slip [N]."""
    period: float = math.inf
    """Given period of the setup, or twice the duration of deep falls [s]; infinite without falls.
    """
    counts: SlipCounts = field(default_factory=SlipCounts)
    """Slips by minimum fall; empty if noise or minimum fall were given."""

    def __len__(self) -> int:
        return len(self.start_time)


def find_slips(
    time: Array,
    force: Array,
    *,
    noise: float | TraceNoise | None = None,
    period: float | None = None,
    direction: float = 1.0,
    min_fall: float | None = None,
    loading_rate: float | None = None,
) -> FoundSlips:
    """Find the slips in a trace of increasing times [s] and finite forces [N], or coefficients.

    The noise is estimated by default. If it is a number, the standard deviation of white noise,
    nothing is removed and the minimum fall follows from it. The period of the setup, 2 pi
    (M/K)^1/2, is by default twice the duration of deep falls [s]. The minimum fall follows from the
    trace by default; if it is given, every fall above it counts but for rebounds. The rate at which
    the force of a slider at rest grows is that of the rises of the trace [N/s]. The direction is
    the sign of the drive's velocity.
    """
    force = direction * np.asarray(force, dtype=float)
    if len(force) < 4:
        return _none(period)
    if noise is None:
        noise = estimate_noise(time, force)
        cleaned = noise.clean(time, force)
    elif isinstance(noise, TraceNoise):
        cleaned = direction * noise.clean(time, direction * force)
    else:
        cleaned = force
    del force
    sigma = noise.total_deviation if isinstance(noise, TraceNoise) else noise
    every = partial(levels, time, cleaned, noise, period=period, loading_rate=loading_rate)
    choice = chosen(every())
    level, tops, bottoms, counts = choice.level, choice.tops, choice.bottoms, choice.counts
    if min_fall is None:
        min_fall = choice.min_fall
    else:
        level = _level_of(every(min_fall=min_fall), min_fall)
        tops, bottoms = level.trace.exceeding(min_fall)
        counts = counts.with_row(min_fall, tops.size, level.mirror().numbers(min_fall)[1])
    if tops.size == 0:
        return _none(period, min_fall, counts)
    if period is None:
        period = fall_period(time, level.trace.force, tops, bottoms)
    rates = fall_rates(level, period, tops, bottoms)
    tops, last = level.on_samples(cleaned, tops, bottoms)
    half = level.half_samples(tops, period)
    first, last, before, after = ends_of(time, cleaned, tops, last, sigma, half)
    return FoundSlips(
        time[first],
        time[last],
        direction * before,
        direction * after,
        rates,
        first,
        last,
        min_fall,
        period,
        counts,
    )


def _level_of(every: Iterator[Level], min_fall: float) -> Level:
    """The widest median that hardly changes a fall."""
    level = next(every)
    whole = level.trace
    widest = fall_period(whole.time, whole.force, *whole.exceeding(min_fall)) / 4
    for one in every:
        if one.width > widest:
            break
        level = one
    return level


def estimated_period(time: Array, force: Array, noise: float) -> float:
    """Period of the setup [s], estimated from the deepest falls of a trace; infinite without falls.

    The force of a slider without contacts falls for half a period of a sine; contacts that attach
    shorten the fall.
    """
    period = math.inf
    for level in levels(time, np.asarray(force, dtype=float), noise):
        if level.width > period / 4:
            break
        tops, bottoms = level.trace.falls(level.floor)
        if tops.size:
            period = fall_period(time, level.trace.force, tops, bottoms)
    return period


def _none(
    period: float | None, min_fall: float = 0.0, counts: SlipCounts | None = None
) -> FoundSlips:
    empty, no_samples = np.empty(0), np.empty(0, dtype=int)
    return FoundSlips(
        empty,
        empty,
        empty,
        empty,
        empty,
        no_samples,
        no_samples,
        min_fall,
        math.inf if period is None else period,
        SlipCounts() if counts is None else counts,
    )
