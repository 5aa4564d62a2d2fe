"""The median and the minimum fall at which slips stand out of the noise."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.sampled_slips.levels import Level
from mesoslip.array_types import Array

# Ratio of thresholds for which slips are counted.
THRESHOLD_RATIO = 1.25
# Maximum expected share of slips that are noise.
MAX_FALSE = 0.02
# Maximum share of mirrored slips that are the trace's own: those that are left at the end of a
# plateau, where noise would have fewer.
MAX_OWN = 0.15
# Significance of the record as a whole, in standard deviations: probability 0.001 by chance.
SIGNIFICANCE = 3.0
# More for the mean of few ratios, which is not normal and the largest of many: over their number.
FEW = 1.5
# Standard deviation of the logarithm of the duration of a rise over that of the fall after it, and
# coefficient of variation of squared falls above a threshold, in noise of any spectrum.
NOISE_RATIOS, NOISE_FALLS = 0.85, 0.7
# Maximum coherence of the phases of events that are no hum, and maximum number of events for it.
MAX_COHERENCE, MAX_EVENTS = 0.7, 1000
# Number of mirrored slips at which noise dominates, and smaller minimum falls are not tried.
MAX_NOISE = 50
# A plateau: maximum relative change of the count, at least 1, and minimum ratio of its thresholds.
MAX_CHANGE, MIN_PLATEAU = 0.1, 1.5


@dataclass(frozen=True)
class SlipCounts:
    """How the number of slips depends on the minimum fall, arrays of shape (thresholds,)."""

    threshold: Array = field(default_factory=lambda: np.empty(0))
    """Minimum falls, in the unit of the force."""
    count: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))
    mirrored_count: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))
    """Numbers of steep falls in the trace mirrored in its loading, as many as noise makes."""
    plateau: tuple[float, float] | None = None
    """First and last minimum fall of the range in which the number hardly changes, if any."""

    def with_row(self, threshold: float, count: int, mirrored_count: int) -> SlipCounts:
        """The counts with those of another minimum fall, such as a given one."""
        rest = self.threshold != threshold
        at = int(np.searchsorted(self.threshold[rest], threshold))
        return SlipCounts(
            np.insert(self.threshold[rest], at, threshold),
            np.insert(self.count[rest], at, count),
            np.insert(self.mirrored_count[rest], at, mirrored_count),
            self.plateau,
        )


class Choice(NamedTuple):
    """The chosen median and minimum fall, and the slips there."""

    level: Level
    min_fall: float
    tops: Samples
    bottoms: Samples
    counts: SlipCounts


def chosen(every: Iterable[Level]) -> Choice:
    """The smallest minimum fall at which slips stand out, of the median with the longest plateau of
    those that find about as many; on the plateau, the smallest one from which their number is
    constant over a factor of 1.5, or over the widest range."""
    best = max((_at(level) for level in every), key=_persistence)
    if best.counts.plateau is None:
        return best
    first, last = best.counts.plateau
    inside = (best.counts.threshold >= first) & (best.counts.threshold <= last)
    threshold, count = best.counts.threshold[inside], best.counts.count[inside]
    starts = np.flatnonzero(np.diff(count, prepend=-1))
    ends = np.append(starts[1:], count.size) - 1
    ratio = threshold[ends] / threshold[starts]
    is_wide = ratio >= min(MIN_PLATEAU, float(ratio.max()))
    min_fall = float(threshold[starts[np.argmax(is_wide)]])
    tops, bottoms = best.level.slips(min_fall)
    return best._replace(min_fall=min_fall, tops=tops, bottoms=bottoms)


def _persistence(choice: Choice) -> float:
    """Number of slips times the length of its plateau in steps of the minimum fall; 0 for a median
    wider than half the time between slips."""
    waiting = np.diff(choice.level.trace.time[choice.tops])
    if waiting.size and choice.level.width > float(np.median(waiting)) / 2:
        return 0.0
    plateau = choice.counts.plateau
    length = 1.0 if plateau is None else plateau[1] / plateau[0]
    return choice.tops.size * (1 + math.log(length, THRESHOLD_RATIO))


def _at(level: Level) -> Choice:
    """The slips at the smallest minimum fall at which they stand out; none if they do nowhere."""
    sizes = level.trace.extremes.fall_sizes
    deepest = float(sizes[-1]) if sizes.size else 0.0
    steps = 0
    if deepest > level.floor > 0:
        steps = math.ceil(math.log(deepest / level.floor) / math.log(THRESHOLD_RATIO))
    rows: list[tuple[float, int, int, int]] = []
    mirror = level.mirror()
    for number in reversed(range(steps)):
        threshold = level.floor * THRESHOLD_RATIO**number
        slip_count, steep_count = level.trace.numbers(threshold)
        mirrored = mirror.numbers(threshold)[1]
        rows.append((threshold, slip_count, steep_count, mirrored))
        if mirrored > max(MAX_NOISE, steep_count / 2):
            break
    thresholds: Array = np.array([one[0] for one in rows[::-1]])
    count, steep, noise = np.array([one[1:] for one in rows[::-1]], dtype=int).reshape(-1, 3).T
    for at, threshold in enumerate(thresholds.tolist()):
        # Up to where the number is about the same.
        same = count[at:] >= count[at] - max(1.0, MAX_CHANGE * count[at])
        last = at + (int(np.argmin(same)) if not same.all() else len(same)) - 1
        plateau = None
        if thresholds[last] >= MIN_PLATEAU * threshold:
            plateau = threshold, float(thresholds[last])
        own = 0 if plateau is None else min(noise[last], MAX_OWN * steep[at])
        few = noise[at] - own <= MAX_FALSE * steep[at]
        if count[at] and _stands_out(level, threshold, few):
            counts = SlipCounts(thresholds, count, noise, plateau)
            return Choice(level, threshold, *level.slips(threshold), counts)
    nothing = np.empty(0, dtype=int)
    return Choice(
        level, max(level.floor, deepest), nothing, nothing, SlipCounts(thresholds, count, noise)
    )


def _stands_out(level: Level, threshold: float, is_one_sided: bool) -> bool:
    """Whether falls above a threshold differ from those of noise.

    In noise rises and falls are alike: the logarithm of the ratio of their durations has mean 0.
    Falls as fast as rises, in an oscillation, are more equal than those of noise, whose squares
    above a threshold are about exponentially distributed.
    """
    tops, bottoms = level.trace.falls(threshold)
    chance = SIGNIFICANCE / math.sqrt(tops.size)
    if is_one_sided:
        # Of falls that follow slow rises, as slips do, the ratios are chosen.
        every = level.trace.exceeding(threshold, with_rebounds=True)
        ratios = np.log(level.trace.ratios(*every))
        significance = SIGNIFICANCE / math.sqrt(ratios.size) + FEW / ratios.size
        if float(ratios.mean()) >= NOISE_RATIOS * significance:
            return True
    excess = (level.trace.force[tops] - level.trace.force[bottoms]) ** 2 - threshold**2
    is_regular = float(np.std(excess)) <= NOISE_FALLS * (1 - chance) * float(excess.mean())
    return is_regular and not _is_clock(level.trace.time[tops])


def _is_clock(times: Array) -> bool:
    """Whether events keep the phase of a clock, as hum does."""
    if times.size < 3:
        return False
    times = times[:MAX_EVENTS] - times[0]
    near, width = 1 / float(np.median(np.diff(times))), 1 / float(times[-1])
    phases = np.exp(2j * math.pi * 0.8 * near * times)
    turn = np.exp(2j * math.pi * width / 4 * times)
    for _ in range(math.ceil(1.6 * near / width)):
        if abs(phases.sum()) > MAX_COHERENCE * times.size:
            return True
        phases *= turn
    return False
