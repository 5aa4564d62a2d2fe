"""Slips in sampled, noisy traces of the spring force.

The rule, which `docs/fit.md` explains. With a noise of standard deviation sigma:

- A **fall** leads from a maximum of the force to the least value before the next maximum; maxima
  are those that stand out by more than `PROMINENCE` sigma on both sides.
- Falls that begin within half a period of the setup of the end of one, and lead lower, are one.
- A fall is a **slip** if it is deeper than twice what the force had regained in the last three
  quarters of a period, which is what ringing gives back, and if it is steep: its greatest rate is
  at least that of a slider at the least slip velocity of a run, 0.02 Omega_S F_s, the greatest
  force of the trace standing for F_s.
- It starts where the force is last near its maximum, and ends at its least value. What falls from
  the first sample on has no start.

It is the rule by which a run makes its own catalogue, without what only a simulation knows: breaks
of contacts, and the velocity of the slider.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Height over the noise by which a maximum must stand out: at 8 standard deviations a million
# samples of noise have none.
PROMINENCE = 8.0
# A fall makes a slip if it is deeper than this many times what ringing had regained.
LEAST_FALL = 2.0
# Time in which ringing comes from a minimum to a maximum, in half periods of the setup.
LONGEST_RISE = 1.5
# What noise adds to the difference of a maximum and a minimum, in standard deviations.
EXTREME_NOISE = 4.0
# Least rate of fall, in Omega_S times the greatest force.
LEAST_RATE = 0.02
# Least height of a maximum and depth of a slip, in parts of the greatest force.
LEAST_HEIGHT = 0.002
# Part of the depth of a fall at either end that does not count for its duration.
MARGIN = 0.1
# Orders of differences of which one tells the noise.
ORDERS = range(1, 8)
# Median of the size of a standard normal deviate.
NORMAL_MEDIAN = 0.6744897501960817


@dataclass(frozen=True)
class FoundSlips:
    """Slips in a trace, one number a slip.

    Attributes
    ----------
    start_time, end_time
        Times of the maximum before, and of the minimum after [s].
    force_before, force_after
        Force there, with the noise averaged out as far as the trace allows [N].
    fall_rate
        Greatest rate of fall [N/s].
    first, last
        Samples of the maximum and of the minimum.
    """

    start_time: Array
    end_time: Array
    force_before: Array
    force_after: Array
    fall_rate: Array
    first: NDArray[np.int_]
    last: NDArray[np.int_]

    def __len__(self) -> int:
        return len(self.start_time)


def noise_level(force: Array) -> float:
    """Standard deviation of white noise on a trace [N].

    Of the differences of the trace of each order the median size tells it, as slips are few; what
    is smooth adds less the higher the order, as long as it is sampled well, so the least of all
    orders is taken. A digitized trace has at least the noise of its steps. Noise that is correlated
    from sample to sample, as behind a filter, is underestimated.

    Parameters
    ----------
    force
        Samples at equal intervals, shape (samples,).
    """
    found = []
    for order in ORDERS:
        if len(force) <= 2 * order:
            break
        # Sum of squares of the binomial coefficients.
        norm = math.sqrt(math.comb(2 * order, order))
        sizes = np.abs(np.diff(force, order))
        found.append(float(np.median(sizes)) / (NORMAL_MEDIAN * norm))
    steps = np.diff(np.unique(force))
    resolution = float(steps.min()) if 0 < steps.size < len(force) / 4 else 0.0
    return max(min(found, default=0.0), resolution / math.sqrt(12))


def estimated_period(time: Array, force: Array, noise: float) -> float:
    """Period of the setup [s], guessed from the deep falls of a trace; infinite if there are none.

    A slider without contacts falls for half a period, along half a wave; contacts that attach make
    that shorter. Noise blurs the ends of a fall, so the time between 90 and
    10 % of the depth counts, the median of all falls at least half as deep as the deepest.
    """
    tops, bottoms = _falls(force, _height(force, noise))
    if tops.size == 0:
        return math.inf
    depth = force[tops] - force[bottoms]
    interval = float(np.median(np.diff(time)))
    durations = []
    deep = depth >= depth.max() / 2
    for top, bottom in zip(tops[deep], bottoms[deep], strict=True):
        part = (force[top : bottom + 1] - force[bottom]) / (force[top] - force[bottom])
        high = int(np.flatnonzero(part >= 1 - MARGIN)[-1])
        low = high + int(np.flatnonzero(part[high:] <= MARGIN)[0])
        # Between the samples on both sides of either crossing.
        above = high + (part[high] - (1 - MARGIN)) / (part[high] - part[high + 1])
        below = low - (MARGIN - part[low]) / (part[low - 1] - part[low])
        durations.append((below - above) * interval)
    share = 1 - 2 * math.acos(1 - 2 * MARGIN) / math.pi
    return 2 * max(float(np.median(durations)) / share, interval)


def find_slips(
    time: Array,
    force: Array,
    *,
    noise: float | None = None,
    period: float | None = None,
    direction: float = 1.0,
) -> FoundSlips:
    """Find the slips in a trace.

    Parameters
    ----------
    time
        Times [s], shape (samples,), at equal intervals.
    force
        Force of the spring [N], shape (samples,).
    noise
        Standard deviation of the noise [N]; by default that of `noise_level`.
    period
        Period of the setup, 2 pi (M/K)^1/2 [s]; by default that of `estimated_period`.
    direction
        Sign of the drive's velocity.
    """
    from scipy.signal import savgol_filter

    force = direction * force
    noise = noise_level(force) if noise is None else noise
    period = estimated_period(time, force, noise) if period is None else period
    interval = float(np.median(np.diff(time)))
    height = _height(force, noise)
    tops, bottoms = _falls(force, height)
    if tops.size == 0 or not math.isfinite(period):
        nothing, none = np.empty(0), np.empty(0, dtype=int)
        return FoundSlips(nothing, nothing, nothing, nothing, nothing, none, none)
    half = max(1, round(period / 2 / interval))
    # Wide enough to average, narrow enough to follow what rings faster than the setup.
    width = 2 * max(1, half // 8) + 1
    rate = savgol_filter(force, max(width, 3), 1, deriv=1, delta=interval, mode="nearest")
    regain = max(1, round(LONGEST_RISE * half))
    least_rate = LEAST_RATE * 2 * math.pi / period * float(np.max(np.abs(force)))
    rows = []
    at = 0
    while at < len(tops):
        top, bottom, after = int(tops[at]), int(bottoms[at]), at + 1
        regained = force[top] - force[max(0, top - regain) : top + 1].min()
        while (
            after < len(tops)
            and tops[after] - bottom <= half
            and force[bottoms[after]] < force[bottom]
            and force[tops[after]] < force[top] - 0.5 * (force[top] - force[bottom])
        ):
            bottom = int(bottoms[after])
            after += 1
        drop = force[top] - force[bottom]
        steepest = float(-rate[top : bottom + 1].min())
        # Noise adds to both, as extremes are taken.
        excess = min(drop, EXTREME_NOISE * noise)
        if drop - excess > LEAST_FALL * max(regained - excess, 0.0) and steepest > least_rate:
            rows.append((*_ends(time, force, top, bottom, noise, half), steepest))
        at = after
    start, end, before, behind, steepest_rate = np.array(rows).reshape(-1, 5).T
    first, last = start.astype(int), end.astype(int)
    return FoundSlips(
        time[first],
        time[last],
        direction * before,
        direction * behind,
        steepest_rate,
        first,
        last,
    )


def _height(force: Array, noise: float) -> float:
    """Height by which maxima must stand out [N]."""
    return max(PROMINENCE * noise, LEAST_HEIGHT * float(np.max(np.abs(force))))


def _falls(force: Array, height: float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Samples of maxima that stand out, and of the least force before the next of them."""
    from scipy.signal import find_peaks

    # Ends of the trace may be maxima too.
    padded = np.concatenate([[-np.inf], force, [-np.inf]])
    tops = find_peaks(padded, prominence=height)[0] - 1
    if tops.size == 0:
        return tops, tops
    bottoms = np.array(
        [
            top + int(np.argmin(force[top:after]))
            for top, after in zip(tops, [*tops[1:], len(force)], strict=True)
        ]
    )
    # A trace that begins with a fall does not tell where that began.
    deep = (force[tops] - force[bottoms] > height) & (tops > 0)
    return tops[deep], bottoms[deep]


def _ends(
    time: Array, force: Array, top: int, bottom: int, noise: float, half: int
) -> tuple[float, float, float, float]:
    """Samples of start and end of a slip, and the forces there with noise averaged out."""
    # While it sticks the force grows slowly, so its greatest sample is any of the last ones: the
    # level is that of the line through them, and the start where means of some samples leave it.
    wide = max(1, min(half // 4, (bottom - top) // 3))
    low = max(0, top - max(4, half))
    level = force[top]
    if noise > 0 and top - low >= 3:
        # Without the greatest sample, which is so by its noise.
        span = slice(low, top)
        slope, fitted = np.polyfit(time[span] - time[top], force[span], 1)
        residual = np.std(force[span] - fitted - slope * (time[span] - time[top]))
        # Where it rings before the slip a straight line tells nothing.
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
