"""Duration of the rise before a fall over that of the fall, each in its upper part."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.analysis.sampled_slips.windows import Windows
from mesoslip.array_types import Array

# Part below the maximum, over the smaller one of rise and fall, in which durations are compared,
# and maximum of their ratio.
UPPER, MAX_RATIO = (0.1, 0.5), 100.0


def _none() -> Samples:
    return np.empty(0, dtype=int)


@dataclass
class Ratios:
    """The ratios of the falls of a trace, each computed once, when it is first asked for."""

    time: Array
    force: Array
    _keys: Samples = field(init=False, default_factory=_none)  # of known falls, in order
    _lows: Samples = field(init=False, default_factory=_none)
    _values: Array = field(init=False, default_factory=lambda: np.empty(0))

    def add(self, tops: Samples, bottoms: Samples, lows: Samples) -> None:
        """Add falls, in their order, or replace the minima from which their rises start."""
        keys = self._key(tops, bottoms)
        at = np.searchsorted(self._keys, keys)
        is_new = np.append(self._keys, -1)[at] != keys
        self._lows[at[~is_new]] = lows[~is_new]
        if is_new.any():
            more = np.full(np.count_nonzero(is_new), np.nan)
            every = np.concatenate([self._keys, keys[is_new]])
            order = np.argsort(every, kind="stable")
            self._keys = every[order]
            self._lows = np.concatenate([self._lows, lows[is_new]])[order]
            self._values = np.concatenate([self._values, more])[order]

    def of(self, tops: Samples, bottoms: Samples) -> Array:
        """The ratios of falls that were added."""
        at = np.searchsorted(self._keys, self._key(tops, bottoms))
        missing = np.isnan(self._values[at])
        if missing.any():
            some = at[missing]
            self._values[some] = self._computed(tops[missing], bottoms[missing], self._lows[some])
        return self._values[at]

    def _key(self, tops: Samples, bottoms: Samples) -> Samples:
        return tops * self.force.size + bottoms

    def _computed(self, tops: Samples, bottoms: Samples, lows: Samples) -> Array:
        force = self.force
        height = force[tops] - np.maximum(force[lows], force[bottoms])
        rises = self._durations(Windows(tops, tops - lows + 1, -1), height)
        falls = self._durations(Windows(tops, bottoms - tops + 1), height)
        return np.minimum(MAX_RATIO, rises / falls)

    def _durations(self, windows: Windows, height: Array) -> Array:
        """Time from the last sample near the maximum to the first one far below it."""
        found = np.empty(height.size)
        for some, block in windows.blocks():
            force, top = self.force[block.samples], self.force[block.first]
            upper, lower = (block.spread(top - part * height[some]) for part in UPPER)
            below, above = np.flatnonzero(force <= lower), np.flatnonzero(force >= upper)
            low = below[np.searchsorted(below, block.starts)]
            high = above[np.searchsorted(above, low) - 1]
            found[some] = np.abs(self.time[block.samples[low]] - self.time[block.samples[high]])
        return found
