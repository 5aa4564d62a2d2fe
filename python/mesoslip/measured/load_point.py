"""Stages of the drive, found in the displacement of the load point: steps, holds, ramps, reversals.

The displacement is a sequence of straight lines and parabolas, with noise. The partition of least
squares with a penalty for each piece is found exactly, by dynamic programming (Jackson et al., IEEE
Signal Processing Letters 12, 105 (2005)), on means of samples. In repeated passes, means near the
changes have fewer and fewer samples, down to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.noise.levels import NORMAL_MEDIAN
from mesoslip.array_types import Array

Integers = NDArray[np.int64]

# Maximum number of means; half of them are around changes.
MAX_POINTS = 1000
# Number of passes, and number of means on either side of a change that are divided in a pass.
PASSES = 4
NEAR = 3
# Penalties of a line and of a parabola, in units of the variance of the noise: chance improves
# twice the logarithm of the likelihood by less in a thousand records.
LINE_PENALTY = 50.0
PARABOLA_PENALTY = 65.0
# Minimum number of points of a piece.
MIN_LINE, MIN_PARABOLA = 3, 5
# Minimum relative change of the velocity from stage to stage, and within a ramp.
MIN_CHANGE = 0.2
# Maximum difference of a velocity from that of a ramp beside it, over the change in the ramp, for
# the two to be equal.
RAMP_SHARE = 0.25
# Distances of points over which noise is compared, and the minimum number of differences.
LAGS = (1, 2, 4, 8)
MIN_DIFFERENCES = 40
# Maximum multiple of a digital step among the differences that determine it.
MAX_MULTIPLE = 20.0
# Maximum number of pieces of an excursion from a constant velocity, and its maximum duration over
# those of the pieces before and after.
MAX_EXCURSION = 6
MAX_EXCURSION_SHARE = 0.2
# Means on either side from which the rate of digital steps is estimated.
STEP_WINDOW = 20
# Maximum velocity of a hold over the maximum velocity, and in standard errors.
HOLD_RATIO = 1e-4
HOLD_ERRORS = 3.0
# Minimum noise by rounding, over the range of the displacement, and in metres.
MIN_NOISE = 1e-9
MIN_DEVIATION = 1e-15


@dataclass(frozen=True)
class DriveStage:
    """A stage of the drive: times [s] and velocities of the load point [m/s], equal except in a
    ramp."""

    start: float
    end: float
    start_velocity: float
    end_velocity: float
    velocity_error: float
    """Standard error of the mean velocity."""

    @property
    def velocity(self) -> float:
        """Mean velocity [m/s]."""
        return 0.5 * (self.start_velocity + self.end_velocity)

    @property
    def kind(self) -> str:
        """ "hold", "ramp" or "steady"."""
        if self.start_velocity == self.end_velocity:
            return "steady" if self.start_velocity else "hold"
        return "ramp"


@dataclass(frozen=True)
class _Points:
    """Means of samples."""

    edges: Integers
    """First sample of each mean, and the end."""
    time: Array
    value: Array
    variance: Array


@dataclass(frozen=True)
class _Piece:
    """A line or parabola through points ``first`` to ``after - 1``."""

    first: int
    after: int
    time: float
    """Mean time, to which value and velocity belong."""
    value: float
    velocity: float
    acceleration: float
    error: float
    """Standard error of the velocity."""

    def at(self, time: float) -> tuple[float, float]:
        """Value and velocity at a time."""
        since = time - self.time
        velocity = self.velocity + self.acceleration * since
        return self.value + (self.velocity + 0.5 * self.acceleration * since) * since, velocity


def drive_stages(time: Array, load_point: Array) -> tuple[DriveStage, ...]:
    """Stages between changes of the velocity, from the first sample to the last.

    Times [s] increase at any intervals; displacements [m] that are not finite are left out. Smaller
    changes than 20 % are wander of the drive.
    """
    known = np.isfinite(load_point) & np.isfinite(time)
    time, load_point = time[known], load_point[known]
    if time.size < MIN_LINE:
        return ()
    origin, zero = float(time[0]), float(load_point[0])
    noise = _sample_noise(time, load_point - zero)
    edges = _even_edges(load_point, MAX_POINTS // 4)
    bounds: list[int] = []
    for _ in range(PASSES):
        points = _inflated(_means(time - origin, load_point - zero, edges, noise))
        bounds = _partition(points)
        finer = _refined(points, bounds)
        if finer.size == edges.size:
            break
        edges = finer
    pieces = [_fitted(points, first, after) for first, after in pairwise(bounds)]
    pieces = _merged(points, pieces)
    return _stages(time, points, pieces, origin)


def _sample_noise(time: Array, values: Array) -> tuple[float, float]:
    """Standard deviation of the noise of a sample, and the digital step, 0 without one."""
    size = values.size
    step = _digital_step(values)
    if size < 5:
        return step / math.sqrt(12), step
    # Distance of each sample from the line through its neighbours.
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    residual = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    residual = residual / np.sqrt(1 + share**2 + (1 - share) ** 2)
    # In a record with digital steps, more than half of the residuals may be 0.
    deviation = float(np.median(np.abs(residual))) / NORMAL_MEDIAN
    return max(deviation, MIN_NOISE * float(np.ptp(values)), step / math.sqrt(12)), step


def _digital_step(values: Array) -> float:
    """Digital step of a record, of which differences are multiples; 0 without one."""
    steps = np.diff(np.unique(values))
    # Equal values may differ by rounding.
    steps = steps[steps > MIN_NOISE * float(np.ptp(values))]
    if steps.size == 0:
        return 0.0
    step = float(np.quantile(steps, 0.02))
    ratio = steps / step
    few = ratio < MAX_MULTIPLE
    is_multiple = np.abs(ratio - np.round(ratio)) < 0.05
    return step if few.mean() > 0.5 and is_multiple[few].mean() > 0.95 else 0.0


def _inflated(points: _Points) -> _Points:
    """Points with a variance that includes the correlation of neighbours, by the median of third
    differences."""
    factor = 1.0
    for lag in LAGS:
        count = points.time.size - 3 * lag
        if count < MIN_DIFFERENCES:
            break
        rows = [slice(number * lag, number * lag + count) for number in range(4)]
        times = [points.time[one] for one in rows]
        residual, variance = np.zeros(count), np.zeros(count)
        for number, one in enumerate(rows):
            others = [times[number] - other for other in times if other is not times[number]]
            weight = 1 / (others[0] * others[1] * others[2])
            residual += weight * points.value[one]
            variance += weight**2 * points.variance[one]
        typical = float(np.median(np.abs(residual) / np.sqrt(variance))) / NORMAL_MEDIAN
        factor = max(factor, typical**2)
    return replace(points, variance=points.variance * factor)


def _even_edges(values: Array, count: int) -> Integers:
    """First samples, and the end, of at most ``count`` means of equal numbers of samples, divided
    where the path is long."""
    size = values.size
    edges = np.unique(np.linspace(0, size, min(size, count) + 1).astype(np.int64))
    means = np.add.reduceat(values, edges[:-1]) / np.diff(edges)
    path = np.abs(np.diff(means, prepend=means[0], append=means[-1]))
    path = np.maximum(path[:-1], path[1:])
    total = float(path.sum())
    if total == 0:
        return edges
    parts = np.maximum(1, np.ceil(count * path / total)).astype(np.int64)
    divided = [
        np.linspace(begin, end, min(part, end - begin) + 1).astype(np.int64)
        for begin, end, part in zip(edges[:-1], edges[1:], parts, strict=True)
    ]
    return np.unique(np.concatenate(divided))


def _means(time: Array, values: Array, edges: Integers, noise: tuple[float, float]) -> _Points:
    counts = np.diff(edges).astype(float)
    mean_time = np.add.reduceat(time, edges[:-1]) / counts
    mean = np.add.reduceat(values, edges[:-1]) / counts
    deviation, step = noise
    variance = deviation**2 / counts
    if step > 0:
        # Means within one digital step have the same error.
        window = min(STEP_WINDOW, mean.size - 1)
        here = np.arange(mean.size)
        low, high = np.maximum(here - window, 0), np.minimum(here + window, mean.size - 1)
        moved = np.abs(mean[high] - mean[low]) / np.maximum(high - low, 1)
        share = step / np.maximum(moved, step / STEP_WINDOW)
        variance = np.maximum(variance, np.where(share > 1, step**2 / 12 * share, 0.0))
    floor = max(MIN_NOISE * float(np.ptp(values)), MIN_DEVIATION) ** 2
    return _Points(edges, mean_time, mean, np.maximum(variance, floor))


def _partition(points: _Points) -> list[int]:
    """Bounds of the pieces of the best partition."""
    size = points.time.size
    best = np.full(size + 1, np.inf)
    best[0] = 0.0
    origin = np.zeros(size + 1, dtype=np.int64)
    for start in range(size):
        if not math.isfinite(best[start]):
            continue
        cost = best[start] + _costs(points, start)
        after = np.arange(start + 1, size + 1)
        better = cost < best[after]
        best[after[better]] = cost[better]
        origin[after[better]] = start
    bounds = [size]
    while bounds[-1] > 0:
        bounds.append(int(origin[bounds[-1]]))
    return bounds[::-1]


def _costs(points: _Points, start: int) -> Array:
    """Cost of one piece from a point to each later one."""
    weight = 1 / points.variance[start:]
    scale = max(float(points.time[-1] - points.time[start]), 1e-300)
    t = (points.time[start:] - points.time[start]) / scale
    x = points.value[start:] - points.value[start]
    w, wt = weight, weight * t
    s0, s1, s2 = np.cumsum(w), np.cumsum(wt), np.cumsum(wt * t)
    y0, y1, yy = np.cumsum(w * x), np.cumsum(wt * x), np.cumsum(w * x * x)
    wtt = wt * t
    s3, s4, y2 = np.cumsum(wtt * t), np.cumsum(wtt * t * t), np.cumsum(wtt * x)
    count = np.arange(1, t.size + 1)
    with np.errstate(all="ignore"):
        # Gram-Schmidt: 1, t - m, and the parabola orthogonal to both.
        m = s1 / s0
        g1 = s2 - s1 * m
        c1 = y1 - m * y0
        rest = yy - y0**2 / s0
        line = rest - c1**2 / g1
        p = s2 / s0
        q = (s3 - m * s2) / g1
        # The squared norm of t^2 - p - q (t - m), and its product with x.
        g2 = s4 - p * s2 - q * (s3 - m * s2)
        c2 = y2 - p * y0 - q * c1
        parabola = line - c2**2 / g2
    line = np.where((count >= MIN_LINE) & (g1 > 0), np.maximum(line, 0) + LINE_PENALTY, np.inf)
    parabola = np.where(
        (count >= MIN_PARABOLA) & (g2 > 1e-12 * s4),
        np.maximum(parabola, 0) + PARABOLA_PENALTY,
        np.inf,
    )
    # A record may be shorter than any piece.
    if start == 0 and t.size < MIN_LINE:
        line[-1] = 0.0
    return np.minimum(line, parabola)


def _refined(points: _Points, bounds: Sequence[int]) -> Integers:
    """Edges with additional ones around the bounds of pieces."""
    inner = bounds[1:-1]
    if not inner:
        return points.edges
    count = max(4, MAX_POINTS // 2 // (2 * NEAR * len(inner)))
    extra = [points.edges]
    for bound in inner:
        first = max(0, bound - NEAR)
        after = min(points.edges.size - 1, bound + NEAR)
        for one in range(first, after):
            begin, end = points.edges[one], points.edges[one + 1]
            extra.append(np.linspace(begin, end, min(count, end - begin) + 1).astype(np.int64))
    edges = np.unique(np.concatenate(extra))
    if edges.size <= 2 * MAX_POINTS:
        return edges
    return points.edges


def _fitted(points: _Points, first: int, after: int) -> _Piece:
    """The line or parabola through points, whichever has the lower cost."""
    inside = slice(first, after)
    w, t, x = 1 / points.variance[inside], points.time[inside], points.value[inside]
    middle = float(np.average(t, weights=w))
    t = t - middle
    root = np.sqrt(w)
    scale = max(float(np.ptp(t)), 1e-300)
    found = []
    for order, penalty in ((1, LINE_PENALTY), (2, PARABOLA_PENALTY)):
        if t.size < (MIN_LINE, MIN_PARABOLA)[order - 1] and order > 1:
            continue
        powers = np.stack([(t / scale) ** power for power in range(order + 1)], axis=1)
        matrix = powers * root[:, None]
        coefficients, *_ = np.linalg.lstsq(matrix, x * root, rcond=None)
        residual = x * root - matrix @ coefficients
        found.append((float(residual @ residual) + penalty, matrix, coefficients, residual))
    _, matrix, coefficients, residual = min(found, key=lambda one: one[0])
    covariance = np.linalg.pinv(matrix.T @ matrix) * _inflation(residual, coefficients.size)
    acceleration = 2 * coefficients[2] / scale**2 if coefficients.size > 2 else 0.0
    error = math.sqrt(max(float(covariance[1, 1]), 0.0)) / scale
    return _Piece(
        first, after, middle, float(coefficients[0]), float(coefficients[1]) / scale,
        float(acceleration), error,
    )  # fmt: skip


def _inflation(residual: Array, parameters: int) -> float:
    """Factor of the variance of a slope for residuals that exceed the noise or are correlated."""
    freedom = max(residual.size - parameters, 1)
    square = max(float(residual @ residual) / freedom, 1e-300)
    if residual.size < 20:
        return max(square, 1.0)
    # Integrated correlation with a window of five times its value (Sokal).
    size = 2 ** math.ceil(math.log2(2 * residual.size))
    spectrum = np.abs(np.fft.rfft(residual - residual.mean(), size)) ** 2
    correlation = np.fft.irfft(spectrum)[: residual.size // 2]
    time = 2 * np.cumsum(correlation / max(correlation[0], 1e-300)) - 1
    inside = np.flatnonzero(np.arange(time.size) >= 5 * time)
    length = float(time[inside[0]] if inside.size else time[-1])
    return max(square, 1e-300) * max(length, 1.0)


def _merged(points: _Points, pieces: list[_Piece]) -> list[_Piece]:
    """Pieces joined where the velocity changes by no more than wander of the drive."""
    top = max(max(abs(one.velocity) for one in pieces), 1e-300)
    while len(pieces) > 1:
        changes = [_change(points, one, other, top) for one, other in pairwise(pieces)]
        least = int(np.argmin(changes))
        if changes[least] < MIN_CHANGE:
            joined = [_fitted(points, pieces[least].first, pieces[least + 1].after)]
            pieces = pieces[:least] + joined + pieces[least + 2 :]
            continue
        shorter = _without_excursion(points, pieces, top)
        if shorter is None:
            return pieces
        pieces = shorter
    return pieces


def _without_excursion(points: _Points, pieces: list[_Piece], top: float) -> list[_Piece] | None:
    """Pieces without the first short excursion from a constant velocity, continued without it; None
    without excursions."""
    time = points.time
    for first in range(len(pieces) - 2):
        for last in range(first + 2, min(first + 2 + MAX_EXCURSION, len(pieces))):
            before, after = pieces[first], pieces[last]
            begin, end = float(time[before.after - 1]), float(time[after.first])
            (value, velocity), (reached, rate) = before.at(begin), after.at(end)
            size = MIN_CHANGE * max(abs(velocity), abs(rate), HOLD_RATIO * top)
            around = min(begin - time[before.first], time[after.after - 1] - end)
            mean = (reached - value) / (end - begin)
            if (
                abs(velocity - rate) < size
                and abs(mean - 0.5 * (velocity + rate)) < size
                and end - begin < MAX_EXCURSION_SHARE * around
            ):
                joined = [_fitted(points, before.first, after.after)]
                return pieces[:first] + joined + pieces[last + 1 :]
    return None


def _change(points: _Points, one: _Piece, other: _Piece, top: float) -> float:
    """Relative change of the velocity over a piece and the next."""
    velocities = [
        piece.at(float(points.time[index]))[1]
        for piece in (one, other)
        for index in (piece.first, piece.after - 1)
    ]
    size = max(*map(abs, velocities), HOLD_RATIO * top)
    spread = max(velocities) - min(velocities)
    return spread / size


def _stages(
    time: Array, points: _Points, pieces: list[_Piece], origin: float
) -> tuple[DriveStage, ...]:
    """Stages from pieces, which meet where their displacements are equal."""
    top = max(max(abs(one.velocity) for one in pieces), 1e-300)
    ramps = [_is_ramp(points, one, top) for one in pieces]
    # Velocities of pieces at their starts and ends, and the times at which they meet.
    speeds = [
        [one.at(0.5 * float(points.time[one.first] + points.time[one.after - 1]))[1]] * 2
        for one in pieces
    ]
    for piece, pair, ramp in zip(pieces, speeds, ramps, strict=True):
        if not ramp and abs(pair[0]) <= min(
            max(HOLD_RATIO * top, HOLD_ERRORS * piece.error), MIN_CHANGE * top
        ):
            pair[:] = [0.0, 0.0]
    ends = [float(time[0])]
    for number, (one, other) in enumerate(pairwise(pieces)):
        meeting = _meeting(points, one, other)
        if ramps[number] != ramps[number + 1]:
            curved = one if ramps[number] else other
            velocity = speeds[number + 1 if ramps[number] else number][0]
            length = float(points.time[curved.after - 1] - points.time[curved.first])
            change = abs(curved.acceleration) * length
            if abs(curved.at(meeting)[1] - velocity) < RAMP_SHARE * change:
                # A line that touches the parabola: the velocities determine the time better.
                touching = curved.time + (velocity - curved.velocity) / curved.acceleration
                if abs(touching - meeting) < RAMP_SHARE * length:
                    meeting = touching
        ends.append(max(ends[-1], min(origin + meeting, float(time[-1]))))
    ends.append(float(time[-1]))
    found = []
    for number, piece in enumerate(pieces):
        start, end = ends[number], ends[number + 1]
        first, last = speeds[number]
        if ramps[number]:
            first, last = (piece.at(when - origin)[1] for when in (start, end))
            size = RAMP_SHARE * abs(last - first)
            if number and not ramps[number - 1] and abs(first - speeds[number - 1][1]) < size:
                first = speeds[number - 1][1]
            after = speeds[number + 1][0] if number + 1 < len(pieces) else math.nan
            if number + 1 < len(pieces) and not ramps[number + 1] and abs(last - after) < size:
                last = after
        if end > start:
            found.append(DriveStage(start, end, first, last, piece.error))
    return tuple(found)


def _is_ramp(points: _Points, one: _Piece, top: float) -> bool:
    """Whether the velocity changes within a piece."""
    first, last = (one.at(float(points.time[index]))[1] for index in (one.first, one.after - 1))
    return abs(last - first) >= MIN_CHANGE * max(abs(first), abs(last), HOLD_RATIO * top)


def _meeting(points: _Points, one: _Piece, other: _Piece) -> float:
    """Time between two pieces at which their displacements are equal."""
    low, high = float(points.time[one.after - 1]), float(points.time[other.first])
    # Noise may move the intersection beyond the gap between the pieces.
    reach = max(
        high - low,
        3 * (points.variance[one.after - 1] ** 0.5 + points.variance[other.first] ** 0.5)
        / max(abs(other.at(high)[1] - one.at(low)[1]), 1e-300),
    )  # fmt: skip
    low_end = max(low - reach, float(points.time[one.first]))
    high_end = min(high + reach, float(points.time[other.after - 1]))
    middle = 0.5 * (low + high)
    curvature = 0.5 * (other.acceleration - one.acceleration)
    (value, velocity), (before, rate) = other.at(middle), one.at(middle)
    roots = np.roots([curvature, velocity - rate, value - before])
    roots = middle + np.real(roots[np.abs(np.imag(roots)) < 1e-9 * max(reach, 1e-300)])
    inside = roots[(roots >= low_end) & (roots <= high_end)]
    return float(inside[np.argmin(np.abs(inside - middle))]) if inside.size else middle
