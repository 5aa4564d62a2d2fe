"""Slips in sampled, noisy traces of the spring force.

The rule, explained in `docs/fit.md`, for noise of standard deviation sigma:

- A **fall** is the decrease from a maximum of the force to the minimum before the next maximum.
  Maxima have a prominence of more than `PROMINENCE` sigma.
- A fall that begins within half a period of the setup after the end of another, and reaches a lower
  force, belongs to it.
- A fall is a **slip** if it is deep and steep: deeper than twice the increase of the force in the
  three quarters of a period before it, which ringing causes, and with a maximum rate of at least
  0.02 Omega_S F_s, the rate at the minimum slip velocity of a run. F_s is the maximum force of the
  trace.
- It starts where the force is last near its maximum and ends at its minimum. A fall from the first
  sample on has no start and does not count.

Runs make their catalogues by the same rule, with two more criteria that only a simulation has:
breaks of contacts, and the velocity of the slider.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Minimum prominence of a maximum, in standard deviations of the noise: a million samples of noise
# have no such maximum.
PROMINENCE = 8.0
# Minimum depth of a slip over the increase by ringing before it.
MIN_FALL_RATIO = 2.0
# Maximum time from a minimum to a maximum in ringing, in half periods of the setup.
MAX_RISE = 1.5
# Contribution of noise to the difference of a maximum and a minimum, in standard deviations.
EXTREME_NOISE = 4.0
# Minimum rate of fall, in Omega_S times the maximum force.
MIN_RATE = 0.02
# Minimum prominence of a maximum and depth of a slip, over the maximum force.
MIN_HEIGHT = 0.002
# Fraction of the depth of a fall at either end that is excluded from its duration.
MARGIN = 0.1
# Orders of differences for the estimate of the noise.
ORDERS = range(1, 8)
# Median of the absolute value of a standard normal deviate.
NORMAL_MEDIAN = 0.6744897501960817


@dataclass(frozen=True)
class FoundSlips:
    """Slips in a trace, each array of shape (slips,).

    Attributes
    ----------
    start_time, end_time
        Times of the maximum before and of the minimum after [s].
    force_before, force_after
        Forces at these times, averaged over the noise as far as the trace allows [N].
    fall_rate
        Maximum rate of fall [N/s].
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

    The estimate is the median absolute difference of the trace, on which the few slips have no
    influence, at the order 1 to 7 for which it is smallest: a smooth, well sampled signal
    contributes less at higher orders. A digitized trace has at least the noise of its resolution.
    Noise that is correlated from sample to sample, as behind a filter, is underestimated.

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
    """Period of the setup [s], estimated from the deepest falls of a trace; infinite without falls.

    The force of a slider without contacts falls for half a period of a sine; contacts that attach
    shorten the fall. As noise blurs the ends of a fall, its duration is that between 90 and 10 % of
    the depth. The estimate is from the median over the falls at least half as deep as the deepest.
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
        # Interpolated between the samples around each crossing.
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
        empty, no_samples = np.empty(0), np.empty(0, dtype=int)
        return FoundSlips(empty, empty, empty, empty, empty, no_samples, no_samples)
    half = max(1, round(period / 2 / interval))
    # Wide enough to average over noise, narrow enough for ringing faster than that of the setup.
    width = 2 * max(1, half // 8) + 1
    rate = savgol_filter(force, max(width, 3), 1, deriv=1, delta=interval, mode="nearest")
    regain = max(1, round(MAX_RISE * half))
    min_rate = MIN_RATE * 2 * math.pi / period * float(np.max(np.abs(force)))
    rows = []
    number = 0
    while number < len(tops):
        top, bottom, after = int(tops[number]), int(bottoms[number]), number + 1
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
        # Noise increases both, as they are differences of extremes.
        excess = min(drop, EXTREME_NOISE * noise)
        if drop - excess > MIN_FALL_RATIO * max(regained - excess, 0.0) and steepest > min_rate:
            rows.append((*_ends(time, force, top, bottom, noise, half), steepest))
        number = after
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
    """Minimum prominence of maxima [N]."""
    return max(PROMINENCE * noise, MIN_HEIGHT * float(np.max(np.abs(force))))


def _falls(force: Array, height: float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Samples of prominent maxima, and of the minimum before the next of them."""
    from scipy.signal import find_peaks

    # The ends of the trace may be maxima too.
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
    # The start of a fall at the first sample is not recorded.
    deep = (force[tops] - force[bottoms] > height) & (tops > 0)
    return tops[deep], bottoms[deep]


def _ends(
    time: Array, force: Array, top: int, bottom: int, noise: float, half: int
) -> tuple[float, float, float, float]:
    """Samples of start and end of a slip, and the forces there, averaged over the noise."""
    # The force grows slowly before a slip, so that noise decides which sample is the maximum. The
    # level is that of a line through the samples before, and the slip starts where means over
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
