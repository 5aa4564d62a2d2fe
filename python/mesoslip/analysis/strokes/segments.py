"""The monotone pieces of a record that goes back and forth, from reversal to reversal.

A reversal is an extreme of the displacement, between swings that stand out of its noise. Where the
displacement is at rest there, the reversal is in the middle of the rest. Without a displacement,
pieces are guessed from the sign of the force: it stays at one level while the drive moves in one
direction.
"""

from __future__ import annotations

import math
import tomllib
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mesoslip.analysis.alternating_extremes import Extremes, Samples, extremes_of
from mesoslip.analysis.noise import noise_level
from mesoslip.array_types import Array
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import force_among

# Motions that are given.
STROKES, ONE_WAY = "strokes", "one-way"
# Name of the quantity by which strokes are guessed.
FORCE = "sign of the force"
# Displacements by which strokes are found, in order of preference, and their variables.
POSITIONS = {"load point": "drive_displacement", "displacement of the slider": "displacement"}
# Minimum range of the noise over that of the displacement, where it has no noise.
MIN_RANGE = 1e-5
# Minimum number of swings above a gap of their sizes, and minimum size of a swing over the median.
MIN_SWINGS, MIN_SWING = 3, 0.1
# The same of a swing at either end of the record.
MIN_END = 0.01
# Minimum path backwards over that forwards: less is play or noise of one motion.
MIN_BACK = 0.05
# Maximum distance from an extreme at which the displacement rests, over the swing.
REST = 0.002
# The force without a displacement: quantiles that are its levels, and part of the distance from
# their middle to them that a change of level exceeds.
LEVELS, BEYOND = (0.1, 0.9), 0.5
# Limits of the time in which the force leaves its level, over that at its rate after it.
TIMES = (2.2, 0.5)
# Noise over the distance to the levels that smoothing leaves, and maximum share of a period over
# which the force is smoothed.
MAX_NOISE, SMOOTHED = 0.03, 1 / 32
# Minimum share of the time at the levels, and minimum number of changes from one to the other.
MIN_SHARE, MIN_CHANGES = 0.45, 4
# Minimum correlation with the mirrored force after half a period, in windows of some periods, each
# of which is known within a share.
MIN_MIRRORED, PERIODS, PERIOD_ERROR = 0.85, 3, 0.05


class Piece(NamedTuple):
    """Samples ``first`` to ``after - 1``, in which the drive moves in one direction, +1 or -1."""

    first: int
    after: int
    direction: int

    @property
    def samples(self) -> slice:
        return slice(self.first, self.after)

    @property
    def size(self) -> int:
        """The number of samples."""
        return self.after - self.first


def record_pieces(
    time: Array,
    force: Array,
    drive: Array | None,
    displacement: Array | None = None,
    motion: str | None = None,
) -> tuple[tuple[Piece, ...] | None, str]:
    """Pieces of a record, and the quantity in which they were found.

    That is the load point, or else the displacement of the slider, or else the sign of the force,
    which is a guess. The pieces are None if the record does not go back and forth. A motion that is
    given, `STROKES` or `ONE_WAY`, overrules the guess.
    """
    for values, name in zip((drive, displacement), POSITIONS, strict=True):
        if values is not None and np.isfinite(values).any():
            return None if motion == ONE_WAY else monotone_pieces(values), name
    if motion == ONE_WAY:
        return None, FORCE
    return pieces_of_force(time, force, is_given=motion == STROKES), FORCE


def output_pieces(tree: Tree, realization: int = 0) -> tuple[tuple[Piece, ...] | None, str]:
    """Pieces of a realization of an output, and the quantity in which they were found."""
    root = tree.to_dataset()
    force = root[force_among(root)].values[realization]
    drive, displacement = (
        root[one].values[realization] if one in root else None for one in POSITIONS.values()
    )
    # Forces are missing after the end of an interrupted run only.
    known = np.isfinite(force)
    motion = given_in(tree, "motion")
    return record_pieces(root["time"].values[known], force[known], drive, displacement, motion)


def given_in(tree: Tree, key: str) -> str | None:
    """A key of the description of a measured trace; None if it was not given."""
    value: str | None = tomllib.loads(tree.attrs.get("trace", "")).get("trace", {}).get(key)
    return value


def back_and_forth(count: int, name: str) -> str:
    """A sentence about a record that was cut by a quantity into a number of pieces."""
    reversals = "1 reversal" if count == 2 else f"{count - 1} reversals"
    text = f"goes back and forth, with {reversals}; slips are those between them"
    if name != FORCE:
        return text
    return (
        f"guess, by the {name}: {text}; give --motion one-way if the drive moves in one direction"
    )


def monotone_pieces(displacement: Array) -> tuple[Piece, ...] | None:
    """Pieces of a displacement between its reversals; None if it does not go back and forth.

    The first and the last piece may be parts of strokes. Missing samples (NaN) belong to the piece
    around them.
    """
    known = np.flatnonzero(np.isfinite(displacement))
    if known.size < 4:
        return None
    values = displacement[known] - displacement[known[0]]
    noise = _range_of_noise(values, noise_level(values))
    extremes = extremes_of(values)
    threshold = _min_swing(values, extremes, noise)
    if threshold is None:
        return None
    tops, bottoms = extremes.falls(threshold)
    at = np.sort(np.concatenate([tops, bottoms]))
    at = _with_ends(values, at, max(noise, MIN_END / MIN_SWING * threshold))
    if at.size == 0:
        return None
    swings = np.diff(values[[0, *at, -1]])
    paths = sorted(np.abs(swings[number::2]).sum() for number in range(2))
    if paths[0] < MIN_BACK * paths[1]:
        return None
    typical = float(np.median(np.abs(swings)))
    near = max(noise, REST * typical)
    bounds = [_middle_of_rest(values, int(one), near) for one in at]
    ends = [0, *known[bounds].tolist(), displacement.size]
    first = 1 if values[at[0]] > values[0] else -1
    return tuple(
        Piece(begin, end, first * (-1) ** number)
        for number, (begin, end) in enumerate(pairwise(ends))
    )


def path_of(displacement: Array) -> float:
    """Length of the path of a displacement, forth and back, without its noise [m]."""
    x = displacement[np.isfinite(displacement)]
    pieces = monotone_pieces(x) or (Piece(0, x.size, 1),)
    return sum(abs(float(x[one.after - 1] - x[one.first])) for one in pieces if x.size)


def pieces_of_force(
    time: Array, force: Array, *, is_given: bool = False
) -> tuple[Piece, ...] | None:
    """Pieces guessed from the sign of a force; None if it does not look like friction in strokes.

    The force has two levels, at which it is most of the time, and is mirrored in their middle after
    half a period. Slips fall faster than the force rises. The levels differ by more than their
    mean: they have opposite signs, or one is small, as with partial slip and an offset. Both may
    have any sign if strokes are given.
    """
    if force.size < 4 * MIN_CHANGES:
        return None
    low, high = (float(one) for one in np.quantile(force, LEVELS))
    middle, half = (low + high) / 2, (high - low) / 2
    if not is_given and 2 * half < abs(middle):
        return None
    level = noise_level(force)
    if 2 * half * (1 - BEYOND) < _range_of_noise(force, level) / 2:
        return None
    last, next_one, sides = _changes(force, middle, BEYOND * half)
    at_levels = float(np.mean(np.abs(force - middle) > BEYOND * half))
    if last.size < MIN_CHANGES or (at_levels < MIN_SHARE and not is_given):
        return None
    if not (is_given or _mirrored(time, force, next_one[::2]) >= MIN_MIRRORED):
        return None
    # Means over a small part of a period have less noise.
    width = int(min((level / (MAX_NOISE * half)) ** 2, SMOOTHED * 2 * force.size / last.size)) or 1
    if width > 1:
        force = np.convolve(np.pad(force, width // 2, "edge"), np.full(width, 1 / width), "same")
        force = force[width // 2 : width // 2 + time.size]
        level *= min(1.0, 2 / math.sqrt(width))
        last, next_one, sides = _changes(force, middle, BEYOND * half)
    # The force leaves its level as long before as it would take at this rate.
    bounds: list[int] = []
    for one, two, side in zip(last.tolist(), next_one.tolist(), sides.tolist(), strict=True):
        rest = (1 - BEYOND) / (2 * BEYOND) * (two - one)
        before = bounds[-1] + 1 if bounds else 0
        start, end = (max(before, one - round(share * rest)) for share in TIMES)
        part = side * force[start : end + 1]
        bounds.append(start + int(np.flatnonzero(part >= part.max() - 3 * level)[-1]))
    ends = [0, *bounds, force.size]
    first = int(sides[0])
    return tuple(
        Piece(begin, end, first * (-1) ** number)
        for number, (begin, end) in enumerate(pairwise(ends))
        if begin < end
    )


def _changes(force: Array, middle: float, reach: float) -> tuple[Samples, Samples, Samples]:
    """Last samples before and first samples after changes of the level, and the side before, 1 or
    -1."""
    side = np.where(force > middle + reach, 1, 0)
    side[force < middle - reach] = -1
    beyond = np.flatnonzero(side)
    change = np.flatnonzero(np.diff(side[beyond]))
    return beyond[change], beyond[change + 1], side[beyond[change]]


def _mirrored(time: Array, force: Array, starts: Samples) -> float:
    """Correlation of a force with the mirrored one after half a period; samples start periods."""
    count = min(PERIODS, starts.size - 1)
    found = []
    for first, after in pairwise(starts[::count].tolist() if count > 0 else []):
        size = after - first
        even = np.linspace(time[first], time[after], size, endpoint=False)
        values = np.interp(even, time[first:after], force[first:after])
        values -= values.mean()
        lags = np.linspace(1 - PERIOD_ERROR, 1 + PERIOD_ERROR, 11) * size / (2 * count)
        products = [
            float(values[one:] @ values[:-one]) / (size - one)
            for one in np.unique(lags.astype(int)).tolist()
            if 0 < one < size
        ]
        found.append(-min(products, default=0.0) * size / max(float(values @ values), 1e-300))
    return float(np.median(found)) if found else 0.0


def _range_of_noise(values: Array, level: float) -> float:
    """Range that noise of a standard deviation hardly exceeds in a record."""
    return max(
        (2 * math.sqrt(2 * math.log(values.size)) + 1) * level, MIN_RANGE * float(np.ptp(values))
    )


def _min_swing(values: Array, extremes: Extremes, noise: float) -> float | None:
    """Minimum size of a swing that is a stroke; None without swings above the noise.

    It is at the widest gap of the sizes on a logarithmic scale, from the noise on: vibrations and
    play of the drive are far smaller than its strokes.
    """
    sizes = np.concatenate([extremes.fall_sizes, extremes_of(-values).fall_sizes])
    sizes = np.sort(sizes[sizes > noise])
    if sizes.size == 0 or noise == 0:
        return None
    lower = np.concatenate([[noise], sizes[:-1]])[: max(1, sizes.size - MIN_SWINGS + 1)]
    widest = int(np.argmax(sizes[: lower.size] / lower))
    return max(float(lower[widest]), MIN_SWING * float(np.median(sizes[widest:])))


def _with_ends(values: Array, at: Samples, min_size: float) -> Samples:
    """Extremes without a first and last one at which the record begins and ends, and with those of
    short swings there. The first one is a maximum, the last one a minimum."""
    if at.size == 0:
        return at
    start = _at_start(values[: at[0] + 1], min_size)
    end = values.size - 1 - _at_start(-values[at[-1] :][::-1], min_size)
    return np.concatenate([start, at[1:-1], end[::-1]])


def _at_start(values: Array, min_size: float) -> Samples:
    """The extremes of the start of a record that ends with a maximum."""
    top = values.size - 1
    bottom = int(np.argmin(values))
    if values[top] - values[bottom] <= min_size:
        return np.empty(0, dtype=int)
    first = int(np.argmax(values[: bottom + 1]))
    return np.array([bottom, top] if values[first] - values[bottom] > min_size else [top])


def _middle_of_rest(values: Array, at: int, near: float) -> int:
    """Middle of the samples around an extreme that are near its value."""
    window = 16
    while True:
        first, after = max(0, at - window), min(values.size, at + window + 1)
        away = np.flatnonzero(np.abs(values[first:after] - values[at]) > near) + first
        before, behind = away[away < at], away[away > at]
        is_left, is_right = before.size > 0 or first == 0, behind.size > 0 or after == values.size
        if is_left and is_right:
            left = int(before[-1]) + 1 if before.size else 0
            right = int(behind[0]) - 1 if behind.size else values.size - 1
            return (left + right + 1) // 2
        window *= 4
