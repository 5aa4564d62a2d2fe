"""The sliding parts of a record that goes back and forth, put one after the other.

A sliding part is from where the force reaches its level after a reversal to the next reversal, with
the force along the motion. So a record in strokes becomes one as of a drive in one direction,
without the changes of sign at reversals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.strokes.segments import Piece
from mesoslip.array_types import Array

# Share of a piece, in its middle, whose median is the level at which sliding begins.
MIDDLE = 0.8
# Minimum number of samples of a sliding part.
MIN_SAMPLES = 5


@dataclass(frozen=True)
class Sliding:
    """The sliding parts of a record, one after the other, each array of shape (samples,)."""

    samples: NDArray[np.int_]
    """Samples of the record."""
    piece: NDArray[np.int32]
    """Number of the piece."""
    sign: NDArray[np.int8]
    """Sign of the force along the motion in the record."""
    force: Array
    """Force along the motion."""

    @property
    def parts(self) -> Iterator[slice]:
        ends = np.flatnonzero(np.diff(self.piece, append=-1)) + 1
        start = 0
        for end in ends.tolist():
            yield slice(start, end)
            start = end

    @cached_property
    def trend(self) -> Array:
        """Mean growth of the force in a part, about the middle of each part.

        Put one after the other, strokes in which the force grows would be a sawtooth.
        """
        rates = []
        since = np.empty(self.force.size)
        for one in self.parts:
            values = self.force[one]
            tenth = max(1, values.size // 10)
            growth = np.median(values[-tenth:]) - np.median(values[:tenth])
            rates.append(growth / values.size)
            since[one] = np.arange(values.size) - (values.size - 1) / 2
        # Partial strokes at the ends have other rates.
        return max(float(np.median(rates)), 0.0) * since if rates else since

    def unfolded(self) -> Array:
        """The force without steps from part to part."""
        force = self.force.copy()
        level = float(force[0]) if force.size else 0.0
        for one in self.parts:
            force[one] += level - force[one.start]
            level = float(force[one.stop - 1])
        return force

    def aligned(self) -> Array:
        """The force without trend, each part about the mean of all."""
        force = self.force - self.trend
        mean = float(self.force.mean()) if self.force.size else 0.0
        for one in self.parts:
            force[one] += mean - float(np.median(force[one]))
        return force


def sliding_of(force: Array, pieces: Sequence[Piece]) -> Sliding:
    """The sliding parts of a record that goes back and forth."""
    pole = polarity(force, pieces)
    starts, sizes, signs = (np.empty(len(pieces), dtype=int) for _ in range(3))
    for number, one in enumerate(pieces):
        signs[number] = pole * one.direction
        along = signs[number] * force[one.samples]
        start = int(np.argmax(along >= np.median(along[_middle(one.size)])))
        starts[number], sizes[number] = one.first + start, one.size - start
    sizes[sizes < MIN_SAMPLES] = 0
    # Long records are not repeated in lists.
    piece = np.repeat(np.arange(len(pieces), dtype=np.int32), sizes)
    sign = np.repeat(signs.astype(np.int8), sizes)
    at = np.arange(piece.size) + np.repeat(starts - (np.cumsum(sizes) - sizes), sizes)
    return Sliding(at, piece, sign, sign * force[at])


def polarity(force: Array, pieces: Sequence[Piece]) -> float:
    """+1 if the force of a record is along the motion in the middle of the pieces, or else -1."""
    # The first and the last may be parts of strokes.
    whole = pieces[1:-1] if len(pieces) > 3 else pieces
    means = np.array([np.mean(force[one.samples][_middle(one.size)]) for one in whole])
    forwards = np.array([one.direction for one in whole]) > 0
    if forwards.all():
        return -1.0 if means.mean() < 0 else 1.0
    # The difference is free of an offset of the force.
    return -1.0 if means[forwards].mean() < means[~forwards].mean() else 1.0


def _middle(size: int) -> slice:
    """The middle of a number of samples."""
    edge = int(size * (1 - MIDDLE) / 2)
    return slice(edge, size - edge)
