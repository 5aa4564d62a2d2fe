"""The events of a motion: slips where they carry it, oscillations of the force elsewhere.

The catalogue marks which falls of the force are ringing, at the frequencies of the setup, of pinned
contacts, of layers and base. Its slips carry the motion if their force drops add up to at least a
part of the loading by the drive, K v t; or if they are most of the cycles of the force, and more
regular, as they leave out the rebounds. Otherwise, as where each fall of an oscillation is regained
by the next rise, the cycles of the force are the events.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.cycles import MAX_PATTERN, MIN_CYCLES, Cycles, irregularity

Array = NDArray[np.float64]

# Minimum force drop of the slips of a motion over the loading by the drive.
MIN_SHARE = 0.5
# Minimum drop of a slip that counts, over the typical one: half of all falling is in larger slips.
MIN_DROP = 0.5


@dataclass(frozen=True)
class Slips:
    """Slips of a realization, arrays of shape (slips,).

    Attributes
    ----------
    start
        Starts [s].
    before
        Forces at the start, in the unit of the force.
    drop
        Drops of the force.
    """

    start: Array
    before: Array
    drop: Array

    def __len__(self) -> int:
        return len(self.start)

    def between(self, first: float, last: float, direction: float) -> Slips:
        """Those that start in an interval of time, with forces along the drive."""
        inside = (self.start >= first) & (self.start <= last)
        return Slips(self.start[inside], direction * self.before[inside], np.abs(self.drop[inside]))

    @property
    def large(self) -> Slips:
        """Slips that are not much smaller than those in which the force falls most."""
        if not len(self):
            return self
        drops = np.sort(self.drop)
        typical = drops[np.searchsorted(np.cumsum(drops), 0.5 * drops.sum())]
        kept = self.drop >= MIN_DROP * typical
        return Slips(self.start[kept], self.before[kept], self.drop[kept])

    @property
    def as_cycles(self) -> Cycles:
        """The cycles from slip to slip."""
        return Cycles(np.diff(self.start), self.drop, self.before)


NO_SLIPS = Slips(np.empty(0), np.empty(0), np.empty(0))


def events_of(slips: Slips, cycles: Cycles, loading: float) -> tuple[Cycles, bool]:
    """The events of a motion, and whether they are its slips.

    Parameters
    ----------
    slips
        Slips in the evaluated window.
    cycles
        Cycles of the force there.
    loading
        Loading of the spring by the drive, K v t; 0 if slips count however small their share is.
    """
    found = slips.large.as_cycles
    if len(found.periods) < MIN_CYCLES:
        return cycles, False
    if slips.drop.sum() >= MIN_SHARE * loading:
        return found, True
    has_most = len(found.periods) >= len(cycles.periods) / MAX_PATTERN
    is_regular = not irregularity(found.periods) >= irregularity(cycles.periods)
    return (found, True) if has_most and is_regular else (cycles, False)
