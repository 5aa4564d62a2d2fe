"""Find the slips in a trace, by a minimum fall at the plateau of their number."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.noise import TraceNoise, estimate_noise
from mesoslip.analysis.sampled_slips.denoised import denoise
from mesoslip.analysis.sampled_slips.search import SlipSearch, is_loaded

Array = NDArray[np.float64]

# Ratio of thresholds for which slips are counted.
THRESHOLD_RATIO = 1.25
# A plateau: maximum change of the count, and minimum ratio of its thresholds.
MAX_CHANGE, MIN_PLATEAU = 0.1, 1.5
# Minimum number of slips at the plateau, over that at the lowest threshold.
MIN_KEPT = 0.5


@dataclass(frozen=True)
class SlipCounts:
    """How the number of slips depends on the minimum fall, arrays of shape (thresholds,)."""

    threshold: Array = field(default_factory=lambda: np.empty(0))
    """Minimum falls, in the unit of the force."""
    count: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))
    plateau: tuple[float, float] | None = None
    """First and last minimum fall of the range in which the number hardly changes, if any."""


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
    (M/K)^1/2, is by default twice the duration of deep falls [s]; the minimum fall follows from the
    noise and the number of slips; the rate at which the force of a slider at rest grows is that of
    the rises of the trace [N/s]. The direction is the sign of the drive's velocity.
    """
    force = direction * np.asarray(force, dtype=float)
    if len(force) < 4:
        return _none(math.inf)
    if noise is None:
        noise = estimate_noise(time, force)
        cleaned = noise.clean(time, force)
    elif isinstance(noise, TraceNoise):
        cleaned = direction * noise.clean(time, direction * force)
    else:
        cleaned = force
    sigma = noise.total_deviation if isinstance(noise, TraceNoise) else noise
    trace = denoise(time, cleaned, noise, period)
    if trace is None:
        return _none(math.inf if period is None else period)
    search = SlipSearch(trace, loading_rate)
    counts = SlipCounts()
    if min_fall is None:
        min_fall = trace.floor
        if isinstance(noise, TraceNoise):
            counts = count_slips(search)
            plateau = counts.plateau
            if plateau is not None:
                tops, bottoms, _ = search.slips(plateau[0])
                if is_loaded(trace, tops, bottoms) or plateau[0] <= trace.floor <= plateau[1]:
                    min_fall = plateau[0]
                else:
                    counts = replace(counts, plateau=None)
    tops, bottoms, rates = search.slips(min_fall)
    if not (is_loaded(trace, tops, bottoms) or search.is_oscillation(tops, bottoms)):
        tops = tops[:0]
    if tops.size == 0:
        return _none(math.inf if period is None else period, min_fall, counts)
    rows = [
        _ends(time, cleaned, top, bottom, sigma, trace.half_samples(top))
        for top, bottom in trace.on_samples(cleaned, tops, bottoms)
    ]
    start, end, before, after = np.array(rows).T
    first, last = start.astype(int), end.astype(int)
    return FoundSlips(
        time[first],
        time[last],
        direction * before,
        direction * after,
        rates,
        first,
        last,
        min_fall,
        trace.period,
        counts,
    )


def count_slips(search: SlipSearch) -> SlipCounts:
    """Number of slips by threshold, and the plateau of that number.

    Thresholds start at the range of the white noise: apparently correlated noise may be the trace.
    """
    trace = search.trace
    deepest = float(trace.extremes.fall_sizes[-1])
    steps = max(1, math.ceil(math.log(deepest / trace.white_floor) / math.log(THRESHOLD_RATIO)))
    thresholds: Array = trace.white_floor * THRESHOLD_RATIO ** np.arange(steps, dtype=np.float64)
    counts = np.array([len(search.slips(float(one))[0]) for one in thresholds])
    for first, count in enumerate(counts):
        same = np.abs(counts[first:] - count) <= max(1.0, MAX_CHANGE * count)
        last = first + (int(np.argmin(same)) if not same.all() else len(same)) - 1
        # A few deep falls, as at the start of a run, are no plateau.
        if count < MIN_KEPT * counts[0]:
            break
        if thresholds[last] >= MIN_PLATEAU * thresholds[first]:
            return SlipCounts(
                thresholds, counts, (float(thresholds[first]), float(thresholds[last]))
            )
    return SlipCounts(thresholds, counts)


def estimated_period(time: Array, force: Array, noise: float) -> float:
    """Period of the setup [s], estimated from the deepest falls of a trace; infinite without falls.

    The force of a slider without contacts falls for half a period of a sine; contacts that attach
    shorten the fall.
    """
    trace = denoise(time, np.asarray(force, dtype=float), noise, None)
    return math.inf if trace is None else trace.period


def _none(period: float, min_fall: float = 0.0, counts: SlipCounts | None = None) -> FoundSlips:
    empty, no_samples = np.empty(0), np.empty(0, dtype=int)
    counts = SlipCounts() if counts is None else counts
    return FoundSlips(
        empty, empty, empty, empty, empty, no_samples, no_samples, min_fall, period, counts
    )


def _ends(
    time: Array, force: Array, top: int, bottom: int, noise: float, half: int
) -> tuple[float, float, float, float]:
    """Samples of start and end of a slip, and the forces there, averaged over the noise."""
    # The force grows slowly before a slip, so that noise determines which sample is the maximum.
    # The level is that of a line through the samples before, and the slip starts where means over
    # some samples fall below it.
    wide = max(1, min(half // 4, (bottom - top) // 3))
    low = max(0, top - max(4, half))
    level = force[top]
    if noise > 0 and top - low >= 3:
        # Without the maximum, which is biased by its noise.
        span = slice(low, top)
        slope, fitted = np.polyfit(time[span] - time[top], force[span], 1)
        residual = np.std(force[span] - fitted - slope * (time[span] - time[top]))
        # Ringing before the slip does not follow a straight line.
        if residual < 2 * noise:
            level = float(fitted)
    means = np.convolve(force[top : bottom + wide], np.full(wide, 1 / wide), "valid")
    high = np.flatnonzero(means >= level - 2 * noise / math.sqrt(wide))
    start = min(top + (int(high[-1]) if high.size else 0), bottom - 1)
    around = slice(max(start, bottom - max(1, half // 8)), bottom + max(1, half // 8) + 1)
    after = float(force[bottom])
    if noise > 0 and force[around].size >= 4:
        after = float(np.polynomial.Polynomial.fit(time[around], force[around], 2)(time[bottom]))
    return float(start), float(bottom), float(level), after
