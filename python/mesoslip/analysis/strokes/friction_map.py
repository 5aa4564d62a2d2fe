"""The friction over position and stroke: the triboscopic map of a record in strokes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.strokes.measure import Stroke
from mesoslip.analysis.strokes.record import StrokeRecord
from mesoslip.array_types import Array

# Maximum number of bins along a stroke, and minimum mean number of samples in one.
MAX_BINS, MIN_SAMPLES = 80, 3


class FrictionMap(NamedTuple):
    """Mean force along the motion in bins of the position, for the strokes in one direction."""

    edges: Array
    """Edges of the bins [m], from the middle of the track; shares of a stroke's time without a
    position."""
    number: NDArray[np.int_]
    """Numbers of the strokes, from 1."""
    friction: Array
    """Shape (bins, strokes); NaN where there is no sample."""


def friction_map(record: StrokeRecord, strokes: Sequence[Stroke], direction: int) -> FrictionMap:
    """The map of the strokes in a direction; of coefficients where the normal force is known."""
    chosen = [(at, one) for at, one in enumerate(strokes, 1) if one.direction == direction]
    sizes = [one.piece.size for _, one in chosen]
    bins = max(1, min(MAX_BINS, math.floor(min(sizes, default=1) / MIN_SAMPLES)))
    places = [place_of(record, one) for _, one in chosen]
    low = min((float(one.min()) for one in places), default=0.0)
    high = max((float(one.max()) for one in places), default=1.0)
    edges = np.linspace(low, high, bins + 1)
    friction = np.full((bins, len(chosen)), np.nan)
    for column, ((_, one), place) in enumerate(zip(chosen, places, strict=True)):
        values = along(record, one)
        index = np.clip(np.searchsorted(edges, place, "right") - 1, 0, bins - 1)
        count = np.bincount(index, minlength=bins)
        total = np.bincount(index, values, minlength=bins)
        friction[count > 0, column] = total[count > 0] / count[count > 0]
    return FrictionMap(edges, np.array([at for at, _ in chosen], dtype=int), friction)


def place_of(record: StrokeRecord, stroke: Stroke) -> Array:
    """Positions in a stroke from the middle of the track [m], or shares of its time."""
    if record.position is None:
        time = record.time[stroke.piece.samples]
        share: Array = (time - time[0]) / (time[-1] - time[0])
        return share
    whole = record.position[record.pieces[0].after : record.pieces[-1].first]
    middle = 0.5 * float(whole.min() + whole.max())
    return record.position[stroke.piece.samples] - middle


def along(record: StrokeRecord, stroke: Stroke) -> Array:
    """Force along the motion in a stroke, or the coefficient where the normal force is known."""
    values: Array = record.sign * stroke.direction * record.force[stroke.piece.samples]
    return values if record.normal is None else values / record.normal[stroke.piece.samples]
