"""Measured properties of a stroke.

The friction is the mean over the middle of the stroke, as far as it slides there. A stroke begins
with the reversal, in which sensor and interface are strained from one level of the force to the
other; the slider does not slide yet. It may be longer than the margin of the middle, and is left
out. Where the force grows up to the end, as with partial slip, there is no sliding friction, and
the mean is that of the whole middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mesoslip.analysis.steady_force import MARGIN, MAX_DISCARDED, NORMAL_95, steady_mean, transient
from mesoslip.analysis.strokes.record import StrokeRecord
from mesoslip.analysis.strokes.segments import Piece
from mesoslip.array_types import Array

# Share of a stroke that is its middle.
MIDDLE = 0.8
# Minimum number of samples of a middle.
MIN_SAMPLES = 3
# The reversal: its length over twice that to half of its swing, the part of the middle in which the
# level of sliding is, the minimum share of the middle without reversal, and the maximum slope of
# the force there, over that of the reversal, and growth over its swing.
REVERSAL, LAST, MIN_SLIDING, MAX_SLOPE, MAX_GROWTH = 1.1, 1 / 4, 0.15, 0.1, 0.25
# Maximum length of a reversal over the stroke without a position: a rest is like sliding, and more
# may be all of the motion.
MAX_REVERSAL = 0.5
# Minimum fall of a slip, over the noise and over the swing: it shows that a shorter part slides, in
# which the force grows or falls by as much, depending on where slips start and end.
MIN_FALL = (6.0, 0.05)
# Samples over which the maximum is a mean: a share of the stroke, and the maximum number.
PEAK_SHARE, MAX_PEAK = 0.01, 9
# Shares of the swing at a reversal over which lines are fitted, the longest first; minimum number
# of samples; and minimum curvature in standard errors for which the line is not straight.
SWINGS = (0.85, 0.6, 0.42, 0.3, 0.2, 0.14)
MIN_POINTS, MAX_CURVATURE = 4, 1.5


class Measured(NamedTuple):
    """A value with two standard errors; NaN if it is unknown."""

    value: float = math.nan
    random: float = math.nan
    """By noise, which differs from stroke to stroke."""
    systematic: float = 0.0
    """By what may be the same in all strokes; with its sign, where that is known."""

    @property
    def error(self) -> float:
        """Both errors together."""
        return math.hypot(self.random, self.systematic)

    def over(self, size: float) -> Measured:
        """The value over a size, which may be negative."""
        return Measured(self.value / size, self.random / abs(size), self.systematic / size)


@dataclass(frozen=True)
class Stroke:
    """A measured stroke; lengths, velocity and stiffness are NaN without a position."""

    piece: Piece
    direction: int
    start_time: float
    end_time: float
    length: float
    velocity: float
    mean_friction: Measured
    mean_friction_coefficient: Measured
    max_friction: float
    max_friction_position: float
    start_force: float
    end_force: float
    stiffness: Measured
    slides: bool


def measure_all(record: StrokeRecord, middle: float = MIDDLE) -> list[Stroke]:
    """Measure the whole strokes of a record that have enough samples.

    Either all slide or none: most of them decide.
    """
    pieces = record.pieces[1:-1]
    found = [one for one in (measure(record, piece, middle) for piece in pieces) if one]
    slides = 2 * sum(one.slides for one in found) >= len(found)
    return [
        one if one.slides == slides else measure(record, one.piece, middle, slides) or one
        for one in found
    ]


def measure(
    record: StrokeRecord, piece: Piece, middle: float = MIDDLE, slides: bool | None = None
) -> Stroke | None:
    """Measure a stroke, which slides or not; None if its middle has too few samples."""
    samples = slice(piece.first, min(piece.after + 1, record.time.size))
    time = record.time[samples]
    along = record.sign * piece.direction * record.force[samples]
    if record.position is None:
        position = (time - time[0]) / (time[-1] - time[0])
        length = 1.0
    else:
        position = piece.direction * (record.position[samples] - record.position[piece.first])
        length = float(position[-1])
    edge = 0.5 * (1 - middle) * length
    first = int(np.argmax(position >= edge))
    after = first + int(np.argmin(position[first:] <= length - edge)) if length > 0 else first
    if after - first < MIN_SAMPLES:
        return None
    bottom, level, end = _reversal(position, along, first, after)
    start = max(first, end)
    swing = level - bottom
    fall = _fall(along[start:after])
    if fall <= max(MIN_FALL[0] * record.noise, MIN_FALL[1] * swing) or swing <= 0:
        fall = 0.0
    least = 0.0 if fall > 0 else MIN_SLIDING * (after - first)
    if after - start < max(MIN_SAMPLES, least):
        start, slides = (max(first, after - MIN_SAMPLES), True) if slides else (first, False)
    if slides is None:
        share = float(position[after - 1] - position[start]) / max(float(position[end]), 1e-300)
        growth = _growth(position[start:after], along[start:after]) - fall
        slides = growth / swing < min(MAX_GROWTH, MAX_SLOPE * REVERSAL * share)
        if record.position is None and fall == 0 and end < position.size:
            slides &= float(position[end]) <= MAX_REVERSAL
    if slides:
        start += _transient(along[start:after])
    inside = slice(start if slides else first, after)
    friction = (
        mean_of(record, along[inside])
        if slides
        else _whole_mean(record, piece.direction, position, along, (edge, length - edge), inside)
    )
    coefficient = Measured()
    if record.normal is not None:
        coefficient = friction.over(float(record.normal[samples][inside].mean()))
    width = max(1, min(MAX_PEAK, round(PEAK_SHARE * along.size)))
    means = np.convolve(along[:after], np.full(width, 1 / width), "valid")
    peak = int(np.argmax(means)) + width // 2
    moved = float(position[inside][-1] - position[inside][0])
    has_position = record.position is not None
    start_force, end_force = (
        float(record.force[max(0, one - width) : one + width + 1].mean())
        for one in (piece.first, samples.stop - 1)
    )
    return Stroke(
        piece,
        piece.direction,
        float(time[0]),
        float(time[-1]),
        length if has_position else math.nan,
        moved / float(np.ptp(time[inside])) if has_position else math.nan,
        friction,
        coefficient,
        float(means.max()),
        float(position[peak]) if has_position else math.nan,
        start_force,
        end_force,
        _stiffness(record, position, along, bottom, level) if has_position else Measured(),
        slides,
    )


def _reversal(position: Array, along: Array, first: int, after: int) -> tuple[float, float, int]:
    """Force at the start of a reversal, level of the force after it, and its last sample.

    ``first`` to ``after - 1`` is the middle of the stroke. Half of the swing is passed steeply, so
    that noise hardly changes where.
    """
    low = int(np.argmin(along[: max(1, along.size // 2)]))
    bottom = float(np.median(along[max(0, low - 2) : low + 3]))
    last = max(1, round(LAST * (after - first)))
    level = float(np.median(along[after - last : after]))
    above = along >= 0.5 * (bottom + level)
    begins = int(np.argmax(above))
    ends = int(np.flatnonzero(~above[: 3 * begins + 1])[-1]) if begins else 0
    half = 0.5 * float(position[begins] + position[ends])
    end = int(np.argmax(position > 2 * REVERSAL * half))
    return bottom, level, end if end or begins == 0 else after


def _growth(position: Array, along: Array) -> float:
    """Growth of the force along a line through samples."""
    since = position - position.mean()
    spread = float(since @ since)
    slope = float(since @ along) / spread if spread > 0 else 0.0
    return slope * float(position[-1] - position[0])


def _fall(along: Array) -> float:
    """The deepest fall of the force from a maximum before it."""
    return float((np.maximum.accumulate(along) - along).max()) if along.size else 0.0


def _transient(values: Array) -> int:
    """Samples at the start that are not steady yet, as where a reversal ends slowly."""
    found = steady_mean(values[np.newaxis])
    if found is not None:
        return found.start if found.is_steady else 0
    return min(MARGIN * transient(values), int(MAX_DISCARDED * values.size))


def mean_of(record: StrokeRecord, values: Array) -> Measured:
    """Mean of a steady force. Fluctuations beyond the noise may be those of the track."""
    by_noise = record.noise * math.sqrt(record.variance_ratio / values.size)
    found = steady_mean(values[np.newaxis])
    if found is not None and found.start == 0 and math.isfinite(found.error):
        error = found.half_width / NORMAL_95
    else:
        error = float(values.std(ddof=1)) / math.sqrt(values.size)
    more = math.sqrt(max(error**2 - by_noise**2, 0.0))
    return Measured(float(values.mean()), by_noise, more)


def _whole_mean(
    record: StrokeRecord,
    direction: int,
    position: Array,
    along: Array,
    ends: tuple[float, float],
    inside: slice,
) -> Measured:
    """Mean of a force that grows, over the position between two ends; unknown without one.

    A reversal is up to half a step of the position from its nearest sample, on either side. By half
    the difference of both distances the middle is shifted, in the strokes of both directions alike:
    friction is right, and the offset of the force wrong.
    """
    if record.position is None:
        return Measured()
    first, after = max(inside.start, 1), min(inside.stop, along.size - 1)
    edges = [
        float(along[at - 1] + (along[at] - along[at - 1]) * share)
        for at, end in ((first, ends[0]), (after, ends[1]))
        for share in [(end - position[at - 1]) / (position[at] - position[at - 1])]
    ]
    x = np.concatenate([[ends[0]], position[first:after], [ends[1]]])
    y = np.concatenate([edges[:1], along[first:after], edges[1:]])
    width = ends[1] - ends[0]
    slope = (edges[1] - edges[0]) / width
    noise = record.noise * math.sqrt(record.variance_ratio / max(after - first, 1))
    shift = math.hypot(position[2] - position[1], position[-2] - position[-3]) / (8 * math.sqrt(3))
    return Measured(
        float(np.trapezoid(y, x)) / width,
        math.hypot(noise, slope * record.position_noise),
        direction * slope * shift,
    )


def _stiffness(
    record: StrokeRecord, position: Array, along: Array, bottom: float, level: float
) -> Measured:
    """Slope of the force over the displacement after a reversal.

    The line is fitted over the longest part of the swing of the force in which it is straight.
    """
    best = Measured()
    for share in SWINGS:
        above = along >= bottom + share * (level - bottom)
        end = int(np.argmax(above)) if above.any() else along.size
        if end < MIN_POINTS:
            break
        best, curvature = _line(record, position[:end], along[:end])
        if curvature < MAX_CURVATURE:
            break
    return best


def _line(record: StrokeRecord, x: Array, y: Array) -> tuple[Measured, float]:
    """Slope of a line, and the curvature of the points in standard errors.

    Noise of x makes the slope of least squares smaller, by its share in the variance of x. The
    systematic error is the slope of a parabola at the first point less that of the line.
    """
    count = x.size
    since, rise = x - x.mean(), y - y.mean()
    spread = float(since @ since) - (count - 1) * record.position_noise**2
    if spread <= 0:
        return Measured(), 0.0
    slope = float(since @ rise) / spread
    residual = rise - slope * since
    noise = math.hypot(record.noise, slope * record.position_noise)
    scatter = max(float(residual @ residual) / max(count - 2, 1), noise**2)
    # The parabola that is orthogonal to the line.
    bend = since**2 - float((since**2).mean())
    tilt = float(bend @ since) / float(since @ since)
    bend = bend - tilt * since
    norm = float(bend @ bend)
    size = float(bend @ residual) / norm if norm > 0 else 0.0
    error = math.sqrt(scatter * record.variance_ratio)
    steeper = size * (2 * float(since[0]) - tilt)
    found = Measured(slope, error / math.sqrt(spread), steeper)
    return found, abs(size) * math.sqrt(norm) / error if error > 0 else 0.0
