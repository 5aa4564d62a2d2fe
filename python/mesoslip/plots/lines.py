"""Lines of long traces: all samples of a window, or the extremes in each of its intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import Samples, samples
from mesoslip.plots.extent import MAX_PARTS, Extent

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
