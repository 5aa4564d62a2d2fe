"""Snapshots of contacts: which are shown, and the time at which they were taken."""

from __future__ import annotations

from typing import Any

import numpy as np

from mesoslip.array_types import Dataset, DataTree
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.output.variables import force_among
from mesoslip.plots.axis import time_since
from mesoslip.plots.curves import curve, draw_curves
from mesoslip.plots.extent import Extent
from mesoslip.plots.movie import chosen_frames, time_bar


def chosen_snapshot(tree: DataTree, number: int | None = None) -> Dataset:
    """The snapshot of a number; by default that after the largest avalanche, or the last one."""
    if "snapshots" not in tree.children:
        raise FileError(
            "the output has no snapshots of its contacts; they are recorded at the times of "
            "output.snapshots, and after avalanches of output.snapshot_size and more"
        )
    data = group_of(tree, "snapshots")
    count = data.sizes["snapshot"]
    if count == 0:
        raise FileError(
            "the output has no snapshot: the run had no avalanche of output.snapshot_size, or "
            "ended before the first time of output.snapshots"
        )
    if number is None:
        sizes = data["avalanche_size"].values
        number = int(np.argmax(sizes)) if sizes.max() > 0 else count - 1
    if not 0 <= number < count:
        raise FileError(f"there is no snapshot {number}; the last one is {count - 1}")
    return data.isel(snapshot=number)


def is_on_lattice(snapshots: Dataset) -> bool:
    """Whether the contacts of snapshots have sites."""
    return "row" in snapshots.sizes


def snapshots_of(tree: DataTree, snapshot: Dataset) -> Dataset:
    """All snapshots of the realization of one."""
    everything = group_of(tree, "snapshots")
    mine = everything["realization_index"].values == snapshot["realization_index"].item()
    return everything.isel(snapshot=np.flatnonzero(mine))


def snapshot_frames(data: Dataset) -> Any:
    """Indices of the snapshots that become frames."""
    stretch = np.nan_to_num(data["stretch"].values.reshape(data.sizes["snapshot"], -1))
    activity = np.abs(np.diff(stretch, axis=0)).sum(axis=1)
    return chosen_frames(data["snapshot_time"].values, activity)


def draw_time_bar(axes: Any, tree: DataTree, snapshot: Dataset, times: Any) -> Any:
    """Draw the force over the time of snapshots, and a bar; returns the function that moves it."""
    margin = 0.02 * float(times[-1] - times[0])
    whole = tree.to_dataset()["time"].values
    window = max(times[0] - margin, whole[0]), min(times[-1] + margin, whole[-1])
    window = window if window[1] > window[0] else (float(whole[0]), float(whole[-1]))
    extent = Extent(int(snapshot["realization_index"].item()), *window)
    horizontal = time_since(window)
    name = force_among(tree.data_vars)
    draw_curves(axes, [curve(tree, name, extent, color="black")], name, horizontal, "force")
    bar = time_bar(axes)

    def move(time: float) -> None:
        bar.set_xdata([(time - horizontal.origin) / horizontal.scale.size] * 2)

    return move
