"""Cycles of two strokes: loop energy, offset and stiffness, and their change over the record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mesoslip.analysis.steady_force import NORMAL_95, steady_mean, transient
from mesoslip.analysis.strokes.measure import Measured, Stroke
from mesoslip.analysis.strokes.record import StrokeRecord, loop_area

# Minimum number of cycles for a drift, and for the length of the running-in.
MIN_DRIFT, MIN_RUNNING_IN = 4, 10


@dataclass(frozen=True)
class Cycle:
    """Two strokes in opposite directions; energy and stiffness are NaN without a position."""

    start_time: float
    end_time: float
    mean_friction: Measured
    mean_friction_coefficient: Measured
    loop_energy: Measured
    offset: Measured
    stiffness: Measured


def cycles_of(record: StrokeRecord, strokes: Sequence[Stroke]) -> list[Cycle]:
    """The cycles of strokes that follow each other, each stroke in one cycle."""
    found: list[Cycle] = []
    end = -1
    for one, two in pairwise(strokes):
        if one.piece.first < end or two.piece.first != one.piece.after:
            continue
        found.append(_cycle(record, one, two))
        end = two.piece.after
    return found


def _cycle(record: StrokeRecord, one: Stroke, two: Stroke) -> Cycle:
    friction = _half(one.mean_friction, two.mean_friction)
    # Along the axis, friction has opposite signs in both directions.
    sign = record.sign * one.direction
    offset = _half(one.mean_friction, two.mean_friction.over(-1.0))
    return Cycle(
        one.start_time,
        two.end_time,
        friction,
        _half(one.mean_friction_coefficient, two.mean_friction_coefficient),
        _loop_energy(record, one, two),
        offset.over(sign),
        _known(one.stiffness, two.stiffness),
    )


def _half(one: Measured, two: Measured) -> Measured:
    """Half the sum of two values."""
    return Measured(
        0.5 * (one.value + two.value),
        0.5 * math.hypot(one.random, two.random),
        0.5 * (one.systematic + two.systematic),
    )


def _known(one: Measured, two: Measured) -> Measured:
    """Half the sum of two values, or the one that is known."""
    if math.isfinite(one.value + two.value):
        return _half(one, two)
    return one if math.isfinite(one.value) else two


def _loop_energy(record: StrokeRecord, one: Stroke, two: Stroke) -> Measured:
    """Integral of the force over the displacement around a closed loop.

    The systematic error is that by the distance of samples: the same integral with every second
    sample has four times that error.
    """
    if record.position is None:
        return Measured()
    samples = slice(one.piece.first, min(two.piece.after + 1, record.time.size))
    x, force = record.position[samples], record.force[samples]
    energy = loop_area(x, force)
    dx, dy = (0.5 * (np.roll(row, -1) - np.roll(row, 1)) for row in (x, force))
    by_noise = math.hypot(
        record.noise * math.sqrt(record.variance_ratio * float(dx @ dx)),
        record.position_noise * float(np.linalg.norm(dy)),
    )
    coarse = 0.5 * sum(loop_area(x[part::2], force[part::2]) for part in range(2))
    return Measured(energy, by_noise, (energy - coarse) / 3).over(record.sign)


@dataclass(frozen=True)
class Overall:
    """The mean of a quantity over cycles, and its change from cycle to cycle, with errors."""

    mean: float
    error: float
    drift: float
    """Slope over the number of the cycle, without the running-in."""
    drift_error: float
    running_in: int
    """Cycles at the start that are left out, as the quantity still changes there."""
    cycles: int


def overall(values: Sequence[Measured]) -> Overall | None:
    """The mean of cycles after the running-in; None without known values."""
    from scipy.special import stdtrit

    known = np.array([one for one in values if math.isfinite(one.value)]).reshape(-1, 3)
    if known.shape[0] == 0:
        return None
    start = transient(known[:, 0]) if known.shape[0] >= MIN_RUNNING_IN else 0
    rest, random, systematic = known[start:].T
    count = rest.size
    by_noise = float(np.linalg.norm(random)) / count
    scatter = 0.0
    if count > 1:
        # By Student's distribution, as there may be a few cycles.
        scatter = float(rest.std(ddof=1) * stdtrit(count - 1, 0.975)) / math.sqrt(count) / NORMAL_95
    found = steady_mean(rest[np.newaxis])
    if found is not None and found.start == 0 and math.isfinite(found.error):
        scatter = found.half_width / NORMAL_95
    drift = drift_error = math.nan
    if count >= MIN_DRIFT:
        number = np.arange(count) - (count - 1) / 2
        norm = float(number @ number)
        drift = float(number @ rest) / norm
        residual = rest - rest.mean() - drift * number
        scale = math.sqrt(float(residual @ residual) / (count - 2))
        drift_error = max(scale, by_noise * math.sqrt(count)) / math.sqrt(norm)
    error = math.hypot(max(by_noise, scatter), float(systematic.mean()))
    return Overall(float(rest.mean()), error, drift, drift_error, start, count)
