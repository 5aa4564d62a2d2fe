"""View of the contacts on their lattice, and of the avalanche before a snapshot."""

from __future__ import annotations

import math
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.errors import FileError
from mesoslip.plots.movie import MAX_FRAMES, Movie, time_bar
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.snapshots import (
    chosen_snapshot,
    draw_time_bar,
    is_on_lattice,
    snapshot_frames,
    snapshots_of,
)
from mesoslip.plots.style import Canvas, canvas
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import with_unit

# Maximum number of contacts that are drawn as polygons; more of them become an image.
MAX_POLYGONS = 20_000
# Width of a lattice in a picture, or its height if that is larger [inch].
LATTICE_WIDTH = 2.6
# Width of the colours beside a lattice, and height of the title over it [inch].
BESIDE_LATTICE, OVER_LATTICE = 1.0, 0.45
# Width of a narrow figure, and height of the colours and the title there [inch].
NARROW, BELOW_LATTICE = 3.4, 0.75
# Height of the axes of the time below a lattice, with their labels [inch].
TIME_HEIGHT = 1.0
# Colour of missing values.
BLANK = "0.93"


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Force over threshold of each contact, and generations of the avalanche before."""
    snapshot = _chosen_lattice(tree, options)
    size = snapshot["avalanche_size"].item()
    count = 2 if size else 1
    width, height = _lattice_size(snapshot)
    inches = count * (width + BESIDE_LATTICE), height + OVER_LATTICE
    if count > 1 and is_narrow(figure):
        # Colours are below the lattices, which share the width.
        inches = NARROW, NARROW / count * height / width + BELOW_LATTICE
    figure = canvas(figure, inches)
    panels = figure.subplots(1, count, squeeze=False).ravel()
    _draw_load(panels[0], snapshot)
    if size:
        _draw_generations(panels[1], snapshot)
        panels[1].set_title(f"avalanche of size {size}", loc="left")
    return figure


def draw_panel(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw the force over threshold of each contact."""
    _draw_load(axes, _chosen_lattice(tree, options))


def movie(tree: DataTree, options: Options) -> Movie:
    """An avalanche that spreads, or the snapshots one after another with a bar of time."""
    snapshot = _chosen_lattice(tree, options)
    if snapshot["avalanche_size"].item():
        return _spreading(snapshot)
    return _snapshots(tree, snapshot)


def _chosen_lattice(tree: DataTree, options: Options) -> Dataset:
    snapshot = chosen_snapshot(tree, options.snapshot)
    if not is_on_lattice(snapshot):
        raise FileError(
            "the contacts of the output have no sites, which [interaction] gives them; "
            '--view contacts (view="contacts") shows their stretches'
        )
    return snapshot


def draw_contacts(axes: Axes, snapshots: Dataset, values: Array, **style: Any) -> Any:
    """Draw a value of each contact at its site, shape (rows, columns); NaN in light grey."""
    style["cmap"] = mpl.colormaps[style["cmap"]].with_extremes(bad=BLANK)
    x, y = snapshots["x"].values, snapshots["y"].values
    spacing = x[0, 1] - x[0, 0]
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    is_triangular = bool(x[1, 0] > 0.25 * spacing)
    if values.size > MAX_POLYGONS:
        height = y[1, 0] - y[0, 0]
        extent = (0, spacing * values.shape[1], 0, height * values.shape[0])
        return axes.imshow(values, origin="lower", extent=extent, interpolation="nearest", **style)
    corners = np.arange(6) / 6 + 1 / 12 if is_triangular else np.arange(4) / 4 + 1 / 8
    radius = 1.01 * spacing / (2 * np.cos(np.pi / len(corners)))
    shape = radius * np.stack([np.cos(2 * np.pi * corners), np.sin(2 * np.pi * corners)], axis=1)
    sites = np.stack([x.ravel(), y.ravel()], axis=1)
    polygons = PolyCollection(
        sites[:, None, :] + shape[None, :, :], array=np.ma.masked_invalid(values.ravel()), **style
    )
    axes.add_collection(polygons)
    axes.set_xlim(x.min() - spacing, x.max() + spacing)
    axes.set_ylim(y.min() - spacing, y.max() + spacing)
    return polygons


def _lattice_size(snapshots: Dataset) -> tuple[float, float]:
    """Width and height of axes in which the lattice leaves no empty space [inch]."""
    x, y = snapshots["x"].values, snapshots["y"].values
    spacing = x[0, 1] - x[0, 0]
    aspect = (np.ptp(y) + 2 * spacing) / (np.ptp(x) + 2 * spacing)
    width = LATTICE_WIDTH * min(1.0, 1.0 / aspect)
    return width, width * aspect


def _load_range(load: Array) -> Normalize:
    """Limits of the colours of loads: tenths of the threshold around those that occur."""
    known = load[np.isfinite(load)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    low, high = math.floor(10 * low) / 10, math.ceil(10 * high) / 10
    return Normalize(low, high if high > low else low + 0.1)


def _add_colors(axes: Axes, drawn: Any, label: str) -> None:
    """A colour bar beside a lattice, or below it where two of them share a narrow figure."""
    place = axes.get_subplotspec()
    is_shared = place is not None and place.get_gridspec().ncols > 1
    location = "bottom" if is_shared and is_narrow(axes.figure) else "right"
    axes.figure.colorbar(drawn, ax=axes, label=label, location=location)


def _draw_load(axes: Axes, snapshot: Dataset) -> None:
    """Draw the force over threshold of the contacts of a snapshot."""
    load = snapshot["load"].values
    drawn = draw_contacts(axes, snapshot, load, cmap="viridis", norm=_load_range(load))
    _add_colors(axes, drawn, "force over threshold")
    time = with_unit(snapshot["snapshot_time"].item(), "s", 6)
    axes.set_title(f"snapshot at {time}\ngrey: detached", loc="left")


def _draw_generations(axes: Axes, snapshot: Dataset) -> None:
    """Draw the generation in which each contact of an avalanche broke."""
    generation = snapshot["generation"].values.astype(float)
    generation[generation == 0] = np.nan
    norm = Normalize(1, np.nanmax(generation))
    drawn = draw_contacts(axes, snapshot, generation, cmap="inferno_r", norm=norm)
    _add_colors(axes, drawn, "generation")


def _spreading(snapshot: Dataset) -> Movie:
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
    below.set(xlabel="generation", ylabel="broken")
    bar = time_bar(below)
    time = with_unit(snapshot["snapshot_time"].item(), "s", 6)
    axes.set_title(f"avalanche at {time}, size {snapshot['avalanche_size'].item()}", loc="left")

    def show(number: int) -> None:
        _recolor(drawn, np.where(generation <= steps[number], generation, np.nan))
        bar.set_xdata([steps[number]] * 2)

    return Movie(figure, len(steps), show)


def _snapshots(tree: DataTree, snapshot: Dataset) -> Movie:
    """The snapshots of a realization, above the force over time."""
    data = snapshots_of(tree, snapshot)
    frames = snapshot_frames(data)
    times = data["snapshot_time"].values
    figure, axes, below = _panels(snapshot)
    load = data["load"].values
    norm = _load_range(load)
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


def _panels(snapshot: Dataset) -> tuple[Figure, Axes, Axes]:
    """A figure with axes for the lattice and, below it, for the time."""
    width, height = _lattice_size(snapshot)
    heights = height + OVER_LATTICE, TIME_HEIGHT
    figure = Figure(figsize=(width + BESIDE_LATTICE, sum(heights)))
    axes, below = figure.subplots(2, 1, height_ratios=heights)
    return figure, axes, below


def _recolor(drawn: Any, values: Any) -> None:
    values = np.ma.masked_invalid(values)
    drawn.set_array(values if values.size > MAX_POLYGONS else values.ravel())


VIEW = View(
    name="lattice",
    kind="run",
    summary="contacts on their lattice, at a snapshot; movie",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"snapshot"}),
    movie=movie,
)
