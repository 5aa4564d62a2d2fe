"""Movies of the lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mesoslip.output.access import group_of
from mesoslip.plots.axis import time_since
from mesoslip.plots.curves import curve, draw_curves
from mesoslip.plots.extent import Extent
from mesoslip.plots.lattice import (
    BESIDE_LATTICE,
    MAX_POLYGONS,
    OVER_LATTICE,
    chosen_lattice,
    draw_contacts,
    lattice_size,
    load_range,
)
from mesoslip.plots.movie import MAX_FRAMES, Movie, chosen_frames, time_bar
from mesoslip.plots.trace import driving_force_of
from mesoslip.quantities import with_unit

if TYPE_CHECKING:
    import xarray as xr

# Height of the axes of the time and their labels [inch].
TIME_HEIGHT = 1.0


def lattice_movie(tree: xr.DataTree, number: int | None = None) -> Movie:
    """An avalanche that spreads, or the snapshots one after another with a bar of time."""
    snapshot = chosen_lattice(tree, number)
    if snapshot["avalanche_size"].item():
        return _spreading(snapshot)
    return _snapshots(tree, snapshot)


def _spreading(snapshot: xr.Dataset) -> Movie:
    """The avalanche before a snapshot, generation by generation."""
    generation = snapshot["generation"].values.astype(float)
    last = int(generation.max())
    steps = np.unique(np.linspace(0, last, min(MAX_FRAMES, last + 1)).astype(int))
    broken = np.array([np.count_nonzero((generation > 0) & (generation <= one)) for one in steps])
    generation[generation == 0] = np.nan
    figure, axes, below = _panels(snapshot)
    norm = Normalize(1, max(last, 2))
    empty = np.full(generation.shape, np.nan)
    drawn = draw_contacts(axes, snapshot, empty, cmap="inferno_r", norm=norm)
    figure.colorbar(ScalarMappable(norm, "inferno_r"), ax=axes, label="generation")
    below.plot(steps, broken, color="black")
    below.set_xlabel("generation")
    below.set_ylabel("broken")
    bar = time_bar(below)
    time = with_unit(snapshot["snapshot_time"].item(), "s", 6)
    axes.set_title(f"avalanche at {time}, size {snapshot['avalanche_size'].item()}", loc="left")

    def show(number: int) -> None:
        _recolor(drawn, np.where(generation <= steps[number], generation, np.nan))
        bar.set_xdata([steps[number]] * 2)

    return Movie(figure, len(steps), show)


def _snapshots(tree: xr.DataTree, snapshot: xr.Dataset) -> Movie:
    """The snapshots of a realization, above the force over time."""
    data = snapshots_of(tree, snapshot)
    frames = snapshot_frames(data)
    times = data["snapshot_time"].values
    figure, axes, below = _panels(snapshot)
    load = data["load"].values
    norm = load_range(load)
    drawn = draw_contacts(axes, snapshot, load[frames[0]], cmap="viridis", norm=norm)
    label = "force over threshold"
    figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, label=label)
    move = draw_time_bar(below, tree, snapshot, times)

    def show(number: int) -> None:
        index = frames[number]
        _recolor(drawn, load[index])
        axes.set_title(f"{with_unit(times[index], 's', 6)}; grey: detached", loc="left")
        move(times[index])

    return Movie(figure, len(frames), show)


def _panels(snapshot: xr.Dataset) -> tuple[Figure, Axes, Axes]:
    """A figure with axes for the lattice and, below it, for the time."""
    width, height = lattice_size(snapshot)
    heights = height + OVER_LATTICE, TIME_HEIGHT
    figure = Figure(figsize=(width + BESIDE_LATTICE, sum(heights)))
    axes, below = figure.subplots(2, 1, height_ratios=heights)
    return figure, axes, below


def _recolor(drawn: Any, values: Any) -> None:
    values = np.ma.masked_invalid(values)
    drawn.set_array(values if values.size > MAX_POLYGONS else values.ravel())


def snapshots_of(tree: xr.DataTree, snapshot: xr.Dataset) -> xr.Dataset:
    """The snapshots of the realization of one of them."""
    everything = group_of(tree, "snapshots")
    mine = everything["realization_index"].values == snapshot["realization_index"].item()
    return everything.isel(snapshot=np.flatnonzero(mine))


def snapshot_frames(data: xr.Dataset) -> Any:
    """Indices of the snapshots that become frames."""
    stretch = np.nan_to_num(data["stretch"].values.reshape(data.sizes["snapshot"], -1))
    activity = np.abs(np.diff(stretch, axis=0)).sum(axis=1)
    return chosen_frames(data["snapshot_time"].values, activity)


def draw_time_bar(axes: Any, tree: xr.DataTree, snapshot: xr.Dataset, times: Any) -> Any:
    """Draw the force over the time of snapshots, and a bar that the returned function moves."""
    margin = 0.02 * float(times[-1] - times[0])
    whole = tree.to_dataset()["time"].values
    window = max(times[0] - margin, whole[0]), min(times[-1] + margin, whole[-1])
    window = window if window[1] > window[0] else (float(whole[0]), float(whole[-1]))
    extent = Extent(int(snapshot["realization_index"].item()), *window)
    horizontal = time_since(window)
    name = driving_force_of(tree)
    draw_curves(axes, [curve(tree, name, extent, color="black")], name, horizontal, "force")
    bar = time_bar(axes)

    def move(time: float) -> None:
        bar.set_xdata([(time - horizontal.origin) / horizontal.scale.size] * 2)

    return move
