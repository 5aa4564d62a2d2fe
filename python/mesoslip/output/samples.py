"""Samples of a realization: its trace, and finer samples around its slips."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array, Dataset
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Arrays, Tree


def times_of(tree: Tree) -> Array:
    """Times of the trace [s]."""
    return tree.to_dataset()["time"].values


@dataclass(frozen=True)
class Samples:
    """Samples of a realization in order of time [s]; those in a file are read when needed."""

    data: Dataset | Arrays
    dimension: str
    times: Array
    start: int = 0

    def inside(self, window: tuple[float, float]) -> tuple[int, int]:
        """Indices of the first sample in a window of time, and of the first one after it."""
        first = np.searchsorted(self.times, window[0], "left")
        return int(first), int(np.searchsorted(self.times, window[1], "right"))

    def values(self, name: str, first: int, after: int) -> Array:
        """Values of a variable, or the times."""
        if name == "time":
            return self.times[first:after]
        chosen = slice(self.start + first, self.start + after)
        return self.data[name].isel({self.dimension: chosen}).values.astype(float)


def samples(tree: Tree, realization: int = 0) -> list[Samples]:
    """Samples of a realization: those of the trace, and the finer ones around slips."""
    root = tree.to_dataset().isel(realization=realization)
    parts = [Samples(root, "time", root["time"].values)]
    if "slip_traces" in tree.children:
        fine = group_of(tree, "slip_traces")
        start, end = 0, fine.sizes["sample"]
        if tree.sizes["realization"] > 1:
            # Rows of all realizations may take more memory than there is.
            owner = fine.variables["realization_index"]
            start, end = (
                bisect_left(range(end), one, key=lambda row: int(owner[row].values))
                for one in (realization, realization + 1)
            )
        times = fine.variables["sample_time"].isel(sample=slice(start, end)).values
        parts.append(Samples(fine, "sample", times, start))
    return parts


def series(
    tree: Tree,
    name: str,
    realization: int = 0,
    window: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[Array, Array]:
    """Times [s] and values of a variable of a realization, with the finer samples around slips."""
    all_times, all_values = [], []
    for part in samples(tree, realization):
        first, after = part.inside(window)
        all_times.append(part.times[first:after])
        all_values.append(part.values(name, first, after))
    times, values = np.concatenate(all_times), np.concatenate(all_values)
    order = np.argsort(times, kind="stable")
    return times[order], values[order]
