"""View of the waves in an elastic slider."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from mesoslip.array_types import Array, DataTree
from mesoslip.errors import FileError
from mesoslip.output.samples import times_of
from mesoslip.plots.axis import HorizontalAxis, time_since
from mesoslip.plots.close_up import largest_slip, slip_window
from mesoslip.plots.curves import about_realizations, curve, draw_curves
from mesoslip.plots.extent import Extent, max_size
from mesoslip.plots.movie import Movie, chosen_frames, time_bar
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import BLUE, SPRING, Canvas, canvas, legend_above, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Maximum number of instants at which the velocities of layers are drawn.
MAX_INSTANTS = 2000
NO_LAYERS = (
    "the output has no displacements of layers: they are recorded with "
    'slider.kind = "layered" and output.layers = true'
)


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Velocities of layers over time, above the forces at both ends of the slider."""
    extent = options.extent
    window = _window(tree, extent)
    near = Extent(extent.first, *window, parts=extent.parts)
    figure = canvas(figure, (6.5, 5.0))
    waves, force = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    draw_waves(waves, tree, options)
    waves.set_xlabel("")
    _draw_forces(force, tree, near, time_since(window), "black")
    # In a column of a journal the colour bar takes the width of a second entry.
    legend_above(force, columns=1 if is_narrow(figure) else 3)
    return figure


def draw_waves(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw the velocity of each layer over time and the number of the layer."""
    extent = options.extent
    window = _window(tree, extent)
    times, velocity = layer_motion(tree, extent, window)
    largest, horizontal = max_size(velocity) or 1.0, time_since(window)
    scale = scale_for(largest, "m/s")
    drawn = axes.pcolormesh(
        (times - window[0]) / horizontal.scale.size,
        np.arange(velocity.shape[1] + 1) + 0.5,
        velocity.T / scale.size,
        cmap="cividis",
        norm=Normalize(-largest / scale.size, largest / scale.size),
        rasterized=True,
    )
    axes.figure.colorbar(drawn, ax=axes, label=scale.label("velocity of the layer"))
    axes.set_ylabel("layer, 1 at the contacts")
    horizontal.prepare(axes)
    titles(axes, tree, about_realizations(tree, Extent(extent.first)))


def _draw_forces(
    axes: Axes, tree: DataTree, extent: Extent, horizontal: HorizontalAxis, color: str
) -> None:
    """Draw the forces at both ends of the slider, that of the contacts in a colour, and inside."""
    curves = [
        curve(tree, "contact_force", extent, color=color, label="contact force"),
        curve(tree, "elastic_force", extent, color=BLUE, label="mean elastic force"),
        curve(tree, "spring_force", extent, **SPRING | {"label": "force at the drive"}),
    ]
    draw_curves(axes, curves, "spring_force", horizontal, "force")


def _window(tree: DataTree, extent: Extent) -> tuple[float, float]:
    """The window of time of the options, by default around the largest slip."""
    if "layer_displacement" not in tree.data_vars:
        raise FileError(NO_LAYERS)
    slip = largest_slip(tree, extent)
    window = extent.window(tree)
    if not extent.is_whole or slip is None:
        return window
    low, high = slip_window(slip)
    return max(low, window[0]), min(high, window[1])


def layer_motion(
    tree: DataTree, extent: Extent, window: tuple[float, float]
) -> tuple[Array, Array]:
    """Times [s], shape (T + 1), and mean velocities of the layers between them [m/s], shape
    (T, layers)."""
    times = times_of(tree)
    first, after = np.searchsorted(times, window[0]), np.searchsorted(times, window[1], "right")
    step = max(1, math.ceil((after - first) / MAX_INSTANTS))
    samples = slice(int(first), int(after), step)
    data = tree.to_dataset()["layer_displacement"].isel(realization=extent.first, time=samples)
    times = times[samples]
    if len(times) < 2:
        raise FileError("the output has fewer than two samples of the layers in the window of time")
    return times, np.diff(data.values, axis=0) / np.diff(times)[:, None]


def movie(tree: DataTree, options: Options) -> Movie:
    """Displacement and velocity of each layer, above the forces over time."""
    window = _window(tree, options.extent)
    times, velocity = layer_motion(tree, options.extent, window)
    middles = (times[1:] + times[:-1]) / 2
    moved = np.cumsum(velocity * np.diff(times)[:, None], axis=0)
    # Many frames where layers move against each other.
    activity = np.abs(np.diff(moved, axis=0)).sum(axis=1)
    frames = chosen_frames(middles, activity)
    layers = np.arange(velocity.shape[1]) + 1
    figure = canvas(None, (5.0, 4.2))
    grid = figure.add_gridspec(2, 2, height_ratios=[2.4, 1])
    panels = []
    drawn = ((moved, "m", "displacement"), (velocity, "m/s", "velocity"))
    for column, (values, unit, name) in enumerate(drawn):
        axes, scale = figure.add_subplot(grid[0, column]), scale_for(max_size(values), unit)
        values = values / scale.size
        (line,) = axes.plot(values[0], layers, ".-", color="black" if column else BLUE)
        margin = 0.05 * max(float(np.ptp(values)), 1e-12)
        axes.set(xlim=(values.min() - margin, values.max() + margin), ylim=(0.5, layers[-1] + 0.5))
        axes.axvline(0, color="0.8", zorder=0)
        axes.set_xlabel(scale.label(f"{name} of the layer"))
        panels.append((line, values))
    first = figure.axes[0]
    first.set_ylabel("layer, 1 at the contacts")
    below, horizontal = figure.add_subplot(grid[1, :]), time_since(window)
    near = Extent(options.extent.first, *window)
    _draw_forces(below, tree, near, horizontal, "0.7")
    legend_above(below)
    bar = time_bar(below)

    def show(number: int) -> None:
        index = frames[number]
        for line, values in panels:
            line.set_xdata(values[index])
        time = middles[index] - window[0]
        first.set_title(f"{time / horizontal.scale.size:.2f} {horizontal.scale.name}")
        bar.set_xdata([time / horizontal.scale.size] * 2)

    return Movie(figure, len(frames), show)  # type: ignore[arg-type]


VIEW = View(
    name="layers",
    kind="run",
    summary="waves in an elastic slider; movie",
    draw_all=draw,
    panel=draw_waves,
    options=frozenset({"realization", "start, end"}),
    movie=movie,
)
