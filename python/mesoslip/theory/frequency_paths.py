"""Frequencies at which the response of contacts is computed, for roots and critical springs.

The response turns with the frequency: by the time from birth to birth of a contact, while lives are
alike enough for it not to average out, and by a delay that all contacts have. A path resolves these
turns wherever contacts may outweigh the slider.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mesoslip.array_types import Array, Complex
from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.theory.critical_spring import balancing_spring, outweighed_from
from mesoslip.theory.sliders import dynamic_stiffness

# Points of a path for each turn of the response.
POINTS_A_TURN = 10
# Maximum angle between the slider's function and its leading power where a path ends.
UNLIKE_POWER = 0.3
# Maximum number of points of a path.
MAX_POINTS = 400_000
# Points of the search for the frequency up to which contacts may feed the slider, and maximum
# number of points of the search for a critical spring.
SEARCH_POINTS, MAX_SEARCH_POINTS = 300, 20_000
# Number of points that resolve each turn by lives, wherever contacts may feed the slider, from
# which on only those turns are resolved that may matter.
FEW_POINTS = 8000
# Standard deviation of lives, times the frequency, at which they do not turn the response unless
# their distribution has steps.
AVERAGED_OUT = 12.0
# Transform of the lives below which they turn nothing.
NO_LIFE = 1e-6
# Part of the response that turns with lives, over the rest of the imaginary part, that does not
# change the sign of this.
SMALL_TURN = 0.5


class Parts(NamedTuple):
    """Λ = fed/births + free, for each rate; ``life`` is |ψ e^(-λ τ_d)|."""

    fed: Complex
    births: Complex
    free: Complex
    life: Array


class Turns(NamedTuple):
    """The times with which the response turns: mean time from birth to birth [s], the frequency up
    to which lives are alike enough for the response to turn with it [1/s], infinite if it is not
    known, and the delay of all contacts [s], 0 where each has its own."""

    period: float
    until: float
    delay: float


def counting_path(
    slider: SliderTable, response: Callable[[Complex], Parts], scale: float, turns: Turns
) -> Array:
    """Ascending frequencies from 0 along which the roots of a slider of a frequency ``scale`` are
    counted [1/s], by Λ at rates [1/s]."""
    # Beyond the last frequency the slider outweighs any response of the contacts.
    coarse = scale * np.geomspace(1e-2, 1e6, 1500)
    own = dynamic_stiffness(slider, 1j * coarse)
    assert own is not None
    parts = response(1j * coarse)
    whole = np.abs(own.numerator + own.denominator * parts.free)
    weak = np.flatnonzero(whole < 3 * np.abs(own.denominator) * _most_fed(parts))
    last = coarse[weak[-1]] if weak.size else coarse[0]
    # There it grows as the power of λ, off the axis as well, where no part is real.
    slanting = np.exp(0.25j * math.pi)
    free = dynamic_stiffness(slider, slanting * coarse)
    assert free is not None
    turn_left = np.angle(free.numerator * slanting**-free.degree)
    unlike = np.flatnonzero(np.abs(turn_left) > UNLIKE_POWER)
    last = 1.5 * max(last, coarse[unlike[-1]] if unlike.size else coarse[0])
    until = min(last, turns.until)
    if _points(until, turns.period) > FEW_POINTS:
        rest = np.imag(own.numerator / own.denominator + parts.free + parts.fed)
        until = min(until, _turned_until(coarse, _turning(parts), rest))
    by_lives = _spaced(0.0, until, turns.period)
    by_delay = _spaced(until, last, turns.delay)
    smooth = np.geomspace(1e-3 * scale, last, max(400, 100 * own.degree))
    return np.unique(np.concatenate([[0.0], by_lives, by_delay, smooth[smooth <= last]]))


def search_path(
    slider: SliderTable,
    response: Callable[[Complex], Parts],
    scale: float,
    turns: Turns,
    path: Array,
) -> Array | None:
    """Ascending frequencies [1/s] between which critical ones of any spring are sought, by the path
    of counting; None if contacts feed stiff springs too fast."""
    frequency = scale * np.geomspace(1e-2, 1e6, SEARCH_POINTS)
    parts = response(1j * frequency)
    # The fed part itself turns with lives, by as much as it is.
    fed = np.maximum.accumulate(2 * _most_fed(parts)[::-1])[::-1]
    last = outweighed_from(slider, frequency, parts.free, fed)
    until = min(last, turns.until)
    if _points(until, turns.period) > FEW_POINTS:
        # The softest spring, with the least damping, that turns make of the one without them.
        turning = _turning(parts)
        _, rest = balancing_spring(slider, frequency, parts.free + parts.fed + turning)
        until = min(until, _turned_until(frequency, turning, rest))
    if not _points(until, turns.period) + _points(last, turns.delay) < MAX_SEARCH_POINTS:
        return None
    beyond = np.geomspace(path[-1], max(last, path[-1]), SEARCH_POINTS)
    by_lives = _spaced(path[0], until, turns.period)
    by_delay = _spaced(path[0], last, turns.delay)
    return np.unique(np.concatenate([path[path <= last], beyond, by_lives, by_delay]))


def _most_fed(parts: Parts) -> Array:
    """Bound on the part of Λ that comes with births [N/m]."""
    bound: Array = np.abs(parts.fed) / (1 - np.minimum(parts.life, 1 - 1e-12))
    return bound


def _turning(parts: Parts) -> Array:
    """Bound on the part of Λ that turns with the lives, from each frequency on [N/m]."""
    life = np.maximum.accumulate(parts.life[::-1])[::-1]
    life[life < NO_LIFE] = 0.0
    return life * _most_fed(parts._replace(life=life))


def _turned_until(frequency: Array, turning: Array, rest: Array) -> float:
    """Frequency up to which lives that are alike may change the sign of the imaginary part, which
    is ``rest`` [N/m] without them."""
    crossed = np.append(np.diff(np.sign(rest)) != 0, False)
    turned = np.flatnonzero((turning > SMALL_TURN * np.abs(rest)) | (crossed & (turning > 0)))
    return float(frequency[min(turned[-1] + 1, len(frequency) - 1)]) if turned.size else 0.0


def _points(until: float, turn: float) -> float:
    """Number of points from 0 on that resolve turns with a time."""
    return POINTS_A_TURN * until * turn / (2 * math.pi)


def _spaced(low: float, high: float, turn: float) -> Array:
    """Points between two limits that resolve turns with a time, unless there would be too many."""
    if high <= low:
        return np.empty(0)
    count = min(math.ceil(_points(high - low, turn)) + 1, MAX_POINTS // 4)
    return np.linspace(low, high, count)
