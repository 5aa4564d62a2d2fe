"""Which part of a run is drawn, and against which variable."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import times_of

# Horizontal axes: name of the variable, and its label.
HORIZONTAL = {
    "time": ("time", "time"),
    "displacement": ("displacement", "displacement"),
    "drive": ("drive_displacement", "displacement of the drive"),
}

# Intervals of a window of time in each of which a line shows the extremes, if there are more
# samples: several for each pixel of a picture.
MAX_PARTS = 4000


@dataclass(frozen=True)
class Extent:
    """Realization, window of time [s] and horizontal axis of a picture of a run."""

    realization: int | None = None
    """None for the first one with the others behind it."""
    start: float = -math.inf
    end: float = math.inf
    against: str | None = None
    """A key of `HORIZONTAL`; by default that of the view."""
    parts: int = MAX_PARTS
    """Intervals of the window in each of which a line shows the extremes."""

    def __post_init__(self) -> None:
        found = []
        if self.against not in (None, *HORIZONTAL):
            choice = ", ".join(HORIZONTAL)
            found.append(Problem("", "x", f"unknown; choose from {choice}", self.against))
        if not self.start < self.end:
            found.append(Problem("", "from, to", f"{self.start:g} s is not before {self.end:g} s"))
        if found:
            raise ConfigError(found)

    @property
    def first(self) -> int:
        """Number of the realization in the foreground."""
        return self.realization or 0

    @property
    def horizontal(self) -> tuple[str, str]:
        """Variable of the horizontal axis, and its label."""
        return HORIZONTAL[self.against or "time"]

    @property
    def is_whole(self) -> bool:
        """Whether the window of time is the whole run."""
        return self.start == -math.inf and self.end == math.inf

    def window(self, tree: Tree) -> tuple[float, float]:
        """Start and end [s] of the part of an output that is drawn, which has a sample."""
        last = tree.sizes["realization"] - 1
        if not 0 <= self.first <= last:
            raise FileError(f"there is no realization {self.first}; the last one is {last}")
        times = times_of(tree)
        window = max(self.start, float(times[0])), min(self.end, float(times[-1]))
        if not np.any((times >= window[0]) & (times <= window[1])):
            raise FileError(
                f"there is no sample {_between(self.start, self.end)}: the run goes from "
                f"{times[0]:g} s to {times[-1]:g} s"
            )
        return window


EVERYTHING = Extent()


def _between(start: float, end: float) -> str:
    """A window of time, which may be open at either end, in words."""
    parts = [f"from {start:g} s on"] if math.isfinite(start) else []
    parts += [f"until {end:g} s"] if math.isfinite(end) else []
    return " ".join(parts).replace(" on until", " to")
