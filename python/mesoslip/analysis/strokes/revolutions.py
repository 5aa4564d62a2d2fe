"""Means over revolutions of a disc, in place of strokes.

The angle is that of a column of revolutions, or the integral of the speed of rotation, or by a
given period. A row is one revolution, or as many whole ones as have enough samples for a mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.analysis.strokes.cycles import Cycle
from mesoslip.analysis.strokes.measure import Measured, Stroke, mean_of
from mesoslip.analysis.strokes.record import StrokeRecord, record_in
from mesoslip.analysis.strokes.segments import Piece
from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree
from mesoslip.quantities import with_unit

# Minimum correlation of a revolution with the next ones.
MIN_CORRELATION = 0.3
# Minimum number of samples of a row.
MIN_SAMPLES = 20
# Maximum distance of samples in a row, over its time.
MAX_GAP = 0.2
# Change of the mean normal force from row to row, over the mean, that is not printed.
MAX_CHANGE = 0.02
COUNT, SPEED = "revolutions", "rotation_speed"
# Falls of the track: minimum number, maximum number that is compared, minimum duration over the
# time between them, minimum number of revolutions, and minimum coherence with the rotation, whose
# speed may be wrong by a share, or with a multiple of it.
MIN_FALLS, MAX_FALLS, MIN_SLOW, MIN_REVOLUTIONS, MIN_COHERENCE = 20, 1000, 0.1, 3.0, 0.7
SPEED_ERROR, MAX_MULTIPLE = 0.02, 4


def has_rotation(tree: Tree) -> bool:
    """Whether the revolutions of a disc are recorded in an output, or its speed."""
    return any(one in tree.data_vars for one in (COUNT, SPEED))


def revolutions_of(
    tree: Tree, realization: int = 0, period: float | None = None, name: str = "the output"
) -> tuple[StrokeRecord, list[Stroke], list[Cycle]]:
    """The record of a disc, and its revolutions as strokes and as cycles.

    The period [s] may be given.
    """
    record = record_in(tree, realization, (), "")
    angle, source = _angle(tree, realization, record.time, period, name)
    turned = float(angle[-1] - angle[0])
    per_revolution = record.time.size / turned if turned > 0 else 0.0
    each = max(1, math.ceil(MIN_SAMPLES / max(per_revolution, 1e-300)))
    marks = np.arange(math.ceil(angle[0]), angle[-1], each)
    at = np.searchsorted(angle, marks).tolist()
    if len(at) < 2:
        raise FileError(
            f"{name}: has {turned:.3g} revolutions by the {source}, with {per_revolution:.3g} "
            f"samples each; a mean needs whole revolutions with {MIN_SAMPLES} samples"
        )
    first, *rest = (Piece(*ends, 1) for ends in pairwise([0, *at, record.time.size]))
    pieces = (first, *(one for one in rest[:-1] if _is_whole(record.time, one)), rest[-1])
    speed = turned / float(record.time[-1] - record.time[0])
    remarks = [
        f"{turned:.6g} revolutions at {60 * speed:.4g} rpm on average, {per_revolution:.3g} "
        "samples in each"
    ]
    if record.normal is not None:
        remarks.append(_about_load(record.normal, pieces))
    if each > 1:
        remarks.append(
            "a revolution has too few samples for a mean of its own: rows are of "
            f"{each} revolutions"
        )
    noun = "revolutions" if each == 1 else f"groups of {each} revolutions"
    record = record_in(tree, realization, pieces, source, noun, tuple(remarks))
    track = _of_track(record, angle) if each == 1 else np.zeros_like(angle)
    rows = [_row(record, one, track[one.samples]) for one in pieces[1:-1]]
    return record, rows, [_as_cycle(one) for one in rows]


def found_period(time: Array, force: Array) -> float | None:
    """Period of a force that repeats itself [s], from its autocorrelation; None if it does not.

    A lag is compared by the mean squared difference of the force and itself after it, over the mean
    of those of all smaller lags, as of the pitch of a voice (de Cheveigne & Kawahara 2002): a
    running-in hardly changes it. The period is the first lag at which it is within a tenth of the
    best one, for three periods or more.
    """
    from scipy.signal import correlate, detrend, find_peaks

    count = max(time.size, 2)
    interval = float(time[-1] - time[0]) / (count - 1)
    even = detrend(np.interp(time[0] + interval * np.arange(count), time, force))
    # Lags up to a third of the record, each over the samples that it has.
    lags = np.arange(count // 3)
    if lags.size < 2 * MIN_SAMPLES or not even.any():
        return None
    products = correlate(even, even, method="fft")[count - 1 :][: lags.size]
    squares = np.concatenate([[0.0], np.cumsum(even**2)])
    both = squares[count - lags] + squares[count] - squares[lags]
    difference = (both - 2 * products) / (count - lags)
    smaller = np.cumsum(difference)[1:] / lags[1:]
    correlation = np.concatenate([[0.0], 1 - difference[1:] / np.maximum(smaller, 1e-300)])
    below = np.flatnonzero(correlation < 0)
    if not below.size:
        return None
    start = int(below[0])
    peaks = find_peaks(correlation[start:])[0] + start
    if not peaks.size or correlation[peaks].max() < MIN_CORRELATION:
        return None
    first = int(peaks[correlation[peaks] > 0.9 * correlation[peaks].max()][0])
    # Multiples of it have smaller relative errors, by which larger ones are found.
    lag, times = _peak(correlation, first, first // 4), 1
    while times < (last := int((lags.size - 1) / lag - 0.5)):
        times = min(2 * times, last)
        lag = _peak(correlation, round(times * lag), first // 4) / times
    return lag * interval


def _peak(correlation: Array, near: int, reach: int) -> float:
    """Lag of the maximum near a lag, of a parabola through three samples."""
    start = max(1, near - reach)
    at = start + int(np.argmax(correlation[start : near + reach + 1]))
    if at + 1 >= correlation.size:
        return float(at)
    left, middle, right = correlation[at - 1 : at + 2].tolist()
    bend = left - 2 * middle + right
    return at + (0.5 * (left - right) / bend if bend < 0 else 0.0)


def _angle(
    tree: Tree, realization: int, time: Array, period: float | None, name: str
) -> tuple[Array, str]:
    """Revolutions at the samples, which do not decrease, and the quantity they are from."""
    if period is not None:
        interval = float(time[-1] - time[0]) / (time.size - 1)
        if period < 2 * interval:
            raise FileError(
                f"{name}: a period of {with_unit(period, 's')} is shorter than two samples, "
                f"{with_unit(2 * interval, 's')}"
            )
        return (time - time[0]) / period, "period"
    root = tree.to_dataset()
    column = COUNT if COUNT in root else SPEED
    values = root[column].values[realization][: time.size].astype(float)
    if column == COUNT:
        return angle_of(time, values, None), "column of revolutions"
    return angle_of(time, None, values), "speed of rotation"


def angle_of(time: Array, count: Array | None, speed: Array | None) -> Array:
    """Revolutions at some times, which do not decrease, by a count or else by a speed of rotation;
    NaN are missing."""
    values = count if count is not None else speed
    if values is None:
        raise ValueError("neither revolutions nor their speed are known")
    known = np.isfinite(values)
    values = np.abs(np.interp(time, time[known], values[known]))
    if count is not None:
        found: Array = np.maximum.accumulate(values)
        return found
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def are_of_track(slips: FoundSlips, time: Array, angle: Array) -> bool:
    """Whether falls are those of the track of a disc, which turned by some angles [revolutions].

    They are slow, and keep the phase of the rotation, whose speed is known within some percent, or
    of a multiple of it.
    """
    if len(slips) < MIN_FALLS:
        return False
    took, waited = slips.end_time - slips.start_time, np.diff(slips.start_time)
    if float(np.median(took)) < MIN_SLOW * float(np.median(waited)):
        return False
    at = np.interp(slips.start_time, time, angle)[:MAX_FALLS]
    if at[-1] - at[0] < MIN_REVOLUTIONS:
        return False
    for multiple in range(1, MAX_MULTIPLE + 1):
        span = multiple * float(at[-1] - at[0])
        count = 2 * math.ceil(4 * SPEED_ERROR * span) + 1
        for factor in np.linspace(1 - SPEED_ERROR, 1 + SPEED_ERROR, count).tolist():
            phases = np.exp(2j * math.pi * multiple * factor * (at - at[0]))
            if abs(phases.sum()) > MIN_COHERENCE * at.size:
                return True
    return False


def _about_load(normal: Array, pieces: Sequence[Piece]) -> str:
    """A sentence on the normal force, with its range if it changes."""
    means = [float(normal[one.samples].mean()) for one in pieces if one.size]
    mean, low, high = float(normal.mean()), min(means), max(means)
    text = f"normal force {with_unit(mean, 'N')} on average"
    if high - low <= MAX_CHANGE * mean:
        return text
    return f"{text}; means of rows are from {with_unit(low, 'N')} to {with_unit(high, 'N')}"


def _is_whole(time: Array, piece: Piece) -> bool:
    """Whether a piece, which has neighbours, has no gap in it or beside it."""
    if piece.size < 2:
        return False
    span = float(time[piece.after] - time[piece.first])
    around = time[max(piece.first - 1, 0) : piece.after + 1]
    return float(np.diff(around).max()) <= MAX_GAP * span


def _of_track(record: StrokeRecord, angle: Array) -> Array:
    """The part of the force along the motion that is the same in every revolution, of mean zero."""
    part = np.floor((angle % 1) * MIN_SAMPLES).astype(int) % MIN_SAMPLES
    sums, counts = np.zeros(MIN_SAMPLES), np.zeros(MIN_SAMPLES)
    for one in record.pieces[1:-1]:
        along = record.sign * record.force[one.samples]
        sums += np.bincount(part[one.samples], along - along.mean(), MIN_SAMPLES)
        counts += np.bincount(part[one.samples], minlength=MIN_SAMPLES)
    means = sums / np.maximum(counts, 1)
    middles = (np.arange(MIN_SAMPLES) + 0.5) / MIN_SAMPLES
    track: Array = np.interp(angle % 1, middles, means - means.mean(), period=1)
    return track


def _row(record: StrokeRecord, piece: Piece, track: Array) -> Stroke:
    """The friction of a row, which has neither ends nor a reversal; the part of the track, which
    averages out, is no error of its mean."""
    time, along = record.time[piece.samples], record.sign * record.force[piece.samples]
    friction = mean_of(record, along - track)
    coefficient = Measured()
    if record.normal is not None:
        coefficient = friction.over(float(record.normal[piece.samples].mean()))
    unknown = math.nan
    return Stroke(
        piece=piece,
        direction=piece.direction,
        start_time=float(time[0]),
        end_time=float(record.time[piece.after]),
        length=unknown,
        velocity=unknown,
        mean_friction=friction,
        mean_friction_coefficient=coefficient,
        max_friction=float(along.max()),
        max_friction_position=unknown,
        start_force=unknown,
        end_force=unknown,
        stiffness=Measured(),
        slides=True,
    )


def _as_cycle(one: Stroke) -> Cycle:
    """A row as a cycle: in one direction, friction and offset cannot be told apart."""
    return Cycle(
        one.start_time,
        one.end_time,
        one.mean_friction,
        one.mean_friction_coefficient,
        Measured(),
        Measured(),
        Measured(),
    )
