"""View of a run of a slider without inertia: contact force and sizes of avalanches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array, Dataset
from mesoslip.output.access import config_of, group_of, is_measured
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.output.samples import times_of
from mesoslip.plots.axis import HorizontalAxis, horizontal_axis
from mesoslip.plots.curves import about_realizations, curve, draw_curves
from mesoslip.plots.extent import Extent
from mesoslip.plots.style import RED, Canvas, canvas, titles
from mesoslip.plots.views import run
from mesoslip.plots.views.base import EXTENT, Options, View

# Maximum number of avalanches with a vector mark each; more of them become an image.
MAX_MARKS = 3000


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:
    """Contact force and sizes of avalanches against the displacement of the slider."""
    extent = _against_displacement(options.extent)
    horizontal, data = horizontal_axis([tree], extent), _catalogue(tree, extent)
    count = config_of(tree).contacts.count
    figure = canvas(figure, (6.5, 5))
    force, sizes = figure.subplots(2, 1, sharex=True)
    _draw_force(force, tree, extent, horizontal)
    force.set_xlabel("")
    x = _positions(tree, data, extent)
    sizes.semilogy(
        x / horizontal.scale.size,
        data["size"].values,
        ".",
        color="black",
        markersize=2,
        rasterized=x.size > MAX_MARKS,
    )
    sizes.set_ylabel("avalanche size")
    sizes.set_ylim(0.8, 1.25 * max(count, data["size"].values.max(initial=1)))
    sizes.axhline(count, color=RED, linewidth=0.6)
    title = f"red: number of contacts, {count}"
    sizes.set_title(title if x.size else f"no avalanche; {title}", loc="left")
    horizontal.prepare(sizes)
    return figure


def draw_force(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the contact force against the displacement of the slider."""
    extent = _against_displacement(options.extent)
    _draw_force(axes, tree, extent, horizontal_axis([tree], extent))


def _draw_force(axes: Axes, tree: Tree, extent: Extent, horizontal: HorizontalAxis) -> None:
    curves = [curve(tree, "contact_force", extent, color="black")]
    draw_curves(axes, curves, "contact_force", horizontal)
    # No other realizations are behind it.
    titles(axes, tree, about_realizations(tree, replace(extent, realization=extent.first)))


def _against_displacement(extent: Extent) -> Extent:
    return replace(extent, against=extent.against or "displacement")


def _catalogue(tree: Tree, extent: Extent) -> Dataset | Arrays:
    """Avalanches of a realization in a window of time."""
    data = group_of(tree, "avalanches")
    starts = data["start_time"].values
    inside = data["realization_index"].values == extent.first
    inside &= (starts >= extent.start) & (starts <= extent.end)
    return data.isel(avalanche=np.flatnonzero(inside))


def _positions(tree: Tree, data: Dataset | Arrays, extent: Extent) -> Array:
    """Avalanches along the horizontal axis, in SI."""
    name, _ = extent.horizontal
    starts: Array = data["start_time"].values
    if name == "time":
        return starts
    if name == "displacement":
        return data["displacement"].values
    moved = tree.to_dataset()[name].isel(realization=extent.first).values
    return np.interp(starts, times_of(tree), moved)


VIEW = View(
    name="run",
    kind="run",
    summary="contact force and avalanches of a slider without inertia",
    draw_all=draw,
    panel=draw_force,
    options=EXTENT,
    compare_all=run.compare,
    compare_panel=run.compare_forces,
    takes_arrays=True,
    applies=lambda tree: not is_measured(tree) and config_of(tree).slider.jumps,
)
