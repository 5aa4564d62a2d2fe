"""Which part of a run is drawn, against which variable, and lines of it, long ones by extremes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import Samples, samples, times_of

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


# Samples that are read at once.
BLOCK = 2**20


def extremes(
    parts: list[Samples],
    names: Sequence[str],
    window: tuple[float, float],
    count: int = MAX_PARTS,
) -> list[Array]:
    """Values of variables, in order of time, at the samples where one of them is minimal or maximal
    in an interval of a window of time [s].

    Intervals have the same duration, or the same number of samples if the time is not among the
    variables.
    """
    start, end = window
    scale = count / max(end - start, np.finfo(float).tiny)
    kept_times: list[Array] = []
    kept: list[list[Array]] = [[] for _ in names]
    for part in parts:
        first, after = part.inside(window)
        for at in range(first, after, BLOCK):
            to = min(at + BLOCK, after)
            times = part.times[at:to]
            if "time" in names:
                interval = np.minimum(((times - start) * scale).astype(int), count - 1)
            else:
                # A slip is short in time and long in space.
                interval = (np.arange(at, to) - first) * count // (after - first)
            begins = np.flatnonzero(np.diff(interval, prepend=-1))
            lengths = np.diff(begins, append=len(interval))
            columns = [part.values(name, at, to) for name in names]
            chosen: list[NDArray[np.intp]] = []
            for name, values in zip(names, columns, strict=True):
                if name == "time":
                    continue
                for extreme_of in (np.fmin, np.fmax):
                    extreme = np.repeat(extreme_of.reduceat(values, begins), lengths)
                    hits = np.flatnonzero(values == extreme)
                    chosen.append(hits[np.diff(interval[hits], prepend=-1) > 0])
            shown = np.unique(np.concatenate(chosen))
            kept_times.append(times[shown])
            for one, values in zip(kept, columns, strict=True):
                one.append(values[shown])
    if not kept_times:
        return [np.empty(0) for _ in names]
    order = np.argsort(np.concatenate(kept_times), kind="stable")
    return [np.concatenate(one)[order] for one in kept]


def line(
    tree: Tree, names: Sequence[str], extent: Extent, window: tuple[float, float]
) -> list[Array]:
    """Values of variables along a line: all samples of a window, or the extremes of too many."""
    parts = samples(tree, extent.first)
    if sum(np.subtract(*part.inside(window)[::-1]) for part in parts) > 4 * extent.parts:
        return extremes(parts, names, window, extent.parts)
    times = np.concatenate([part.values("time", *part.inside(window)) for part in parts])
    order = np.argsort(times, kind="stable")
    return [
        np.concatenate([part.values(name, *part.inside(window)) for part in parts])[order]
        for name in names
    ]


def max_size(*values: Array) -> float:
    """Maximum absolute value, without missing ones; 0 if there is none."""
    return max(float(np.max(np.abs(one[np.isfinite(one)]), initial=0.0)) for one in values)
