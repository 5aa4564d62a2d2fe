"""View of an interface with a length: ruptures and fronts in space and time; its movie."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.fronts import Fronts, fronts_of
from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.output.access import config_of, group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import times_of
from mesoslip.output.variables import force_among
from mesoslip.plots.axis import HorizontalAxis, time_since
from mesoslip.plots.curves import curve, draw_curves
from mesoslip.plots.extent import Extent
from mesoslip.plots.movie import Movie, chosen_frames, time_bar
from mesoslip.plots.style import BLUE, RED, SPRING, Canvas, canvas, legend_above, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import number, scale_for

# Time before and after the fronts of the event that is drawn, over their duration.
BEFORE, AFTER = 0.08, 0.6
# Samples in a window from which the record of the blocks is drawn below the ruptures, and the
# maximum number that is.
MIN_SAMPLES, MAX_SAMPLES = 30, 1500
# Fronts whose speeds are written beside them, at most.
MAX_SPEEDS = 12


class Picture(NamedTuple):
    """What is drawn of a realization: its fronts, its ruptures, and a window of time [s]."""

    found: Fronts
    ruptures: dict[str, NDArray[Any]]
    window: tuple[float, float]
    realization: int
    spacing: float
    length: float

    @property
    def places(self) -> Array:
        """Middles of the blocks, from the edge [m]."""
        return np.arange(0.5, round(self.length / self.spacing)) * self.spacing


def picture_of(tree: Tree, options: Options) -> Picture:
    """The window of the options, by default around the event with most blocks."""
    realization = options.extent.first
    found = fronts_of(tree, realization=realization)
    if not found.events["event"].size:
        raise FileError(
            f"realization {realization} has no ruptures of half the contacts of a block"
        )
    data = group_of(tree, "ruptures")
    mine = np.asarray(data["realization_index"].values) == realization
    names = ("block_number", "start_time", "rupture_time", "end_time")
    ruptures = {name: np.asarray(data[name].values)[mine] for name in names}
    window = options.extent.window(tree)
    if options.extent.is_whole:
        # Of several whole events the first.
        largest = int(np.argmax(found.events["block_count"]))
        low, high = (float(found.events[one][largest]) for one in ("start_time", "end_time"))
        size = max(high - low, 1e-6 * (window[1] - window[0]))
        window = max(window[0], low - BEFORE * size), min(window[1], high + AFTER * size)
    slider = config_of(tree).slider
    spacing = slider.block_spacing
    return Picture(found, ruptures, window, realization, spacing, spacing * slider.block_count)


def draw_fronts(axes: Axes, tree: Tree, picture: Picture, horizontal: HorizontalAxis) -> None:
    """Draw slips of blocks as bars, their ruptures as points, and fronts as lines with speeds."""
    scale, (low, high) = scale_for(picture.length, "m"), picture.window
    _draw_detached(axes, tree, picture, horizontal)

    def shown(times: NDArray[Any]) -> NDArray[Any]:
        return (times - horizontal.origin) / horizontal.scale.size

    ruptures = picture.ruptures
    inside = (ruptures["end_time"] >= low) & (ruptures["start_time"] <= high)
    places = (ruptures["block_number"][inside] - 0.5) * picture.spacing / scale.size
    height = 0.35 * picture.spacing / scale.size
    starts, ends = (shown(ruptures[name][inside]) for name in ("start_time", "end_time"))
    axes.barh(
        places, ends - starts, 2 * height, starts, color="0.6", alpha=0.45, label="block slips"
    )
    axes.plot(
        shown(ruptures["rupture_time"][inside]),
        places,
        *(".",),
        color="black",
        markersize=3,
        label="half of its contacts have broken",
    )
    fronts = picture.found.fronts
    chosen = np.flatnonzero((fronts["end_time"] >= low) & (fronts["start_time"] <= high))
    labelled = int(np.isfinite(fronts["speed_ratio"][chosen]).sum()) <= MAX_SPEEDS
    for place, index in enumerate(chosen.tolist()):
        times = shown(np.array([fronts["start_time"][index], fronts["end_time"][index]]))
        ends = np.array([fronts["start_position"][index], fronts["end_position"][index]])
        label = "" if place else "front"
        axes.plot(times, ends / scale.size, color=RED, linestyle="-", linewidth=1.2, label=label)
        ratio = fronts["speed_ratio"][index]
        if labelled and np.isfinite(ratio):
            axes.annotate(
                f"{number(float(ratio), 2)} c",
                (times.mean(), ends.mean() / scale.size),
                xytext=(6, -4),
                textcoords="offset points",
                color=RED,
                fontsize="small",
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
            )
    axes.set_xlim(*shown(np.array(picture.window)))
    axes.set(ylim=(0, picture.length / scale.size), ylabel=scale.label("position, from the edge"))


def _draw_detached(axes: Axes, tree: Tree, picture: Picture, horizontal: HorizontalAxis) -> None:
    """Draw the share of detached contacts of blocks, where there are enough samples."""
    times = times_of(tree)
    samples = _samples(times, picture.window, MIN_SAMPLES)
    if samples is None:
        return
    data = group_of(tree, "blocks")["block_detached_contacts"]
    detached = np.asarray(data.isel(realization=picture.realization, time=samples).values)
    config = config_of(tree)
    scale = scale_for(picture.length, "m")
    drawn = axes.pcolormesh(
        (times[samples] - horizontal.origin) / horizontal.scale.size,
        picture.places / scale.size,
        (detached / config.block_shares).T * picture.places.size / config.contacts.count,
        cmap="cividis",
        vmin=0,
        vmax=1,
        shading="nearest",
        rasterized=True,
    )
    axes.figure.colorbar(drawn, ax=axes, label="detached contacts (share)")


def _samples(times: NDArray[Any], window: tuple[float, float], least: int) -> slice | None:
    """Samples in a window of time, up to a maximum number; None for fewer than the least."""
    chosen = np.flatnonzero((times >= window[0]) & (times <= window[1]))
    if chosen.size < least:
        return None
    return slice(int(chosen[0]), int(chosen[-1]) + 1, -(-chosen.size // MAX_SAMPLES))


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:
    """Space and time of an event, above the force of the drive over the whole run."""
    picture = picture_of(tree, options)
    figure = canvas(figure, (6.5, 5.6))
    above, below = figure.subplots(2, 1, height_ratios=[2.2, 1])
    draw_panel(above, tree, options)
    window = options.extent.window(tree)
    whole = Extent(picture.realization)
    name = force_among(tree.data_vars)
    horizontal = time_since(Extent().window(tree))
    draw_curves(below, [curve(tree, name, whole, **SPRING)], name, horizontal, "force")
    for one in picture.window if picture.window != window else ():
        below.axvline((one - horizontal.origin) / horizontal.scale.size, color=BLUE, linewidth=0.8)
    return figure


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw an event in space and time."""
    picture = picture_of(tree, options)
    horizontal = time_since(picture.window)
    draw_fronts(axes, tree, picture, horizontal)
    horizontal.prepare(axes)
    titles(axes, tree, beside_legend=True)
    legend_above(axes)


def movie(tree: Any, options: Options) -> Movie:
    """Force on the contacts and velocity along the interface, above the force over time."""
    picture = picture_of(tree, options)
    times = times_of(tree)
    window = picture.window
    if options.extent.is_whole and _samples(times, window, MIN_SAMPLES) is None:
        # An event between samples: the whole run shows the force before and after it.
        window = options.extent.window(tree)
    samples = _samples(times, window, 2)
    if samples is None:
        raise FileError("the output has fewer than two samples in the window of time")
    group = group_of(tree, "blocks")
    force, velocity = (
        np.asarray(group[name].isel(realization=picture.realization, time=samples).values)
        for name in ("block_contact_force", "block_velocity")
    )
    own = times[samples]
    frames = chosen_frames(own, np.abs(np.diff(force, axis=0)).sum(axis=1))
    length = scale_for(picture.length, "m")
    figure = canvas(None, (5.0, 5.0))
    panels = figure.subplots(3, 1, height_ratios=[1.3, 1, 1])
    speed = scale_for(float(np.abs(velocity).max()) or 1.0, "m/s")
    lines = []
    for axes, values, label in (
        (panels[0], force / config_of(tree).block_strengths, "stress/strength"),
        (panels[1], velocity / speed.size, speed.label("velocity")),
    ):
        (line,) = axes.plot(picture.places / length.size, values[0], color="black", linestyle="-")
        margin = 0.05 * max(float(np.ptp(values)), 1e-12)
        axes.set_ylim(values.min() - margin, values.max() + margin)
        axes.set_xlim(0, picture.length / length.size)
        axes.axhline(0, color="0.8", zorder=0)
        axes.set_ylabel(label)
        lines.append((line, values))
    panels[1].set_xlabel(length.label("position, from the edge"))
    horizontal = time_since(window)
    name = force_among(tree.data_vars)
    near = Extent(picture.realization, *window)
    draw_curves(panels[2], [curve(tree, name, near, **SPRING)], name, horizontal, "force")
    bar = time_bar(panels[2])

    def show(frame: int) -> None:
        index = int(frames[frame])
        for line, values in lines:
            line.set_ydata(values[index])
        time = (own[index] - horizontal.origin) / horizontal.scale.size
        panels[0].set_title(f"{time:.2f} {horizontal.scale.name}")
        bar.set_xdata([time] * 2)

    return Movie(figure, len(frames), show)  # type: ignore[arg-type]


VIEW = View(
    name="fronts",
    kind="run",
    summary="fronts of an interface with a length in space and time; movie",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"realization", "start, end"}),
    movie=movie,
)
