"""Pictures of runs: what happened, against time or displacement."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from mesoslip.analysis.slips import slips
from mesoslip.configuration.units import from_cf_units
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.access import is_measured
from mesoslip.output.samples import Samples, samples, times_of
from mesoslip.output.variables import TRACE
from mesoslip.plots.style import (
    COLORS,
    CONTACT,
    OTHERS,
    SPRING,
    Canvas,
    canvas,
    legend_above,
    shared_legend,
    styled,
    titles,
)
from mesoslip.quantities import Scale, scale_for

Array = NDArray[np.float64]

# Scale in which a variable is drawn where no other one is asked for: that of the source.
SCALES = {
    "spring_force": Scale("µN", 1e-6),
    "contact_force": Scale("µN", 1e-6),
    "elastic_force": Scale("µN", 1e-6),
    "velocity": Scale("µm/s", 1e-6),
    "detached_contacts": Scale("", 1.0),
}

# What a run may be drawn against: the variable, and what it is called.
ABSCISSAE = {
    "time": ("time", "time"),
    "displacement": ("displacement", "displacement"),
    "drive": ("drive_displacement", "displacement of the drive"),
}

# Parts of a window of time of each of which a line shows the extremes, where it has more samples
# than that: several for each dot of a picture.
MOST_PARTS = 4000
# Samples that are read at a time.
BLOCK = 2**20
# Other realizations than the first one that are drawn behind it.
MOST_OTHERS = 20
# Instants of a space-time picture.
MOST_INSTANTS = 2000


@dataclass(frozen=True)
class Extent:
    """What of a run is drawn, and against what.

    Attributes
    ----------
    realization
        Number of the realization; the first one, with the others behind it, if it is None.
    start, end
        Times [s].
    against
        "time", "displacement" or "drive"; by default what suits the picture.
    parts
        Parts of the window of each of which a line shows the extremes.
    """

    realization: int | None = None
    start: float = -math.inf
    end: float = math.inf
    against: str | None = None
    parts: int = MOST_PARTS

    def __post_init__(self) -> None:
        found = []
        if self.against not in {None, *ABSCISSAE}:
            choice = ", ".join(ABSCISSAE)
            found.append(Problem("", "x", f"unknown; choose of {choice}", self.against))
        if not self.start < self.end:
            found.append(Problem("", "from, to", f"{self.start:g} s is not before {self.end:g} s"))
        if found:
            raise ConfigError(found)

    @property
    def first(self) -> int:
        """Number of the realization that is drawn in the foreground."""
        return self.realization or 0

    @property
    def abscissa(self) -> tuple[str, str]:
        """Variable against which it is drawn, and what that is called."""
        return ABSCISSAE[self.against or "time"]

    @property
    def is_whole(self) -> bool:
        """Whether no window of time was asked for."""
        return self.start == -math.inf and self.end == math.inf

    def window(self, tree: xr.DataTree) -> tuple[float, float]:
        """Start and end [s] of what is drawn of an output.

        Raises
        ------
        FileError
            If the output has no such realization, or nothing in the window.
        """
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


def _between(start: float, end: float) -> str:
    """A window of time in words; it may be open at either end."""
    parts = [f"from {start:g} s on"] if math.isfinite(start) else []
    parts += [f"until {end:g} s"] if math.isfinite(end) else []
    return " ".join(parts).replace(" on until", " to")


EVERYTHING = Extent()


def is_known(tree: xr.DataTree, name: str) -> bool:
    """Whether an output has values of a variable of the trace: a measured one may not."""
    if not is_measured(tree):
        return True
    return bool(np.isfinite(tree.to_dataset()[name][0, 0].item()))


def extremes(
    parts: list[Samples],
    names: Sequence[str],
    window: tuple[float, float],
    count: int = MOST_PARTS,
) -> list[Array]:
    """Samples at which variables are least and greatest, in each part of a window of time.

    Parts are as long as each other, or have as many samples if the time is not among the variables.

    Parameters
    ----------
    parts
        Samples of a realization.
    names
        The variables.
    window
        Start and end [s].
    count
        Number of parts.

    Returns
    -------
    list of array
        Values of each variable at those samples, in the order of time.
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
                place = np.minimum(((times - start) * scale).astype(int), count - 1)
            else:
                # A slip, short in time, is a long way: as many samples in each part.
                place = (np.arange(at, to) - first) * count // (after - first)
            begins = np.flatnonzero(np.diff(place, prepend=-1))
            lengths = np.diff(begins, append=len(place))
            columns = [part.values(name, at, to) for name in names]
            chosen: list[NDArray[np.intp]] = []
            for name, values in zip(names, columns, strict=True):
                if name == "time":
                    continue
                for least in (np.fmin, np.fmax):
                    extreme = np.repeat(least.reduceat(values, begins), lengths)
                    hits = np.flatnonzero(values == extreme)
                    chosen.append(hits[np.diff(place[hits], prepend=-1) > 0])
            places = np.unique(np.concatenate(chosen))
            kept_times.append(times[places])
            for one, values in zip(kept, columns, strict=True):
                one.append(values[places])
    if not kept_times:
        return [np.empty(0) for _ in names]
    order = np.argsort(np.concatenate(kept_times), kind="stable")
    return [np.concatenate(one)[order] for one in kept]


def line(
    tree: xr.DataTree, names: Sequence[str], extent: Extent, window: tuple[float, float]
) -> list[Array]:
    """Values of variables for a line: all samples of a window, or if they are many the extremes."""
    parts = samples(tree, extent.first)
    if sum(np.subtract(*part.inside(window)[::-1]) for part in parts) > 4 * extent.parts:
        return extremes(parts, names, window, extent.parts)
    times = np.concatenate([part.values("time", *part.inside(window)) for part in parts])
    order = np.argsort(times, kind="stable")
    return [
        np.concatenate([part.values(name, *part.inside(window)) for part in parts])[order]
        for name in names
    ]


def draw_series(
    axes: Axes,
    tree: xr.DataTree,
    name: str,
    *,
    window: tuple[float, float] | None = None,
    time_unit: float = 1.0,
    **style: Any,
) -> None:
    """Draw a variable in the source's unit against time, or the time since a window's start.

    Only what a picture can show is drawn, and only that is read.

    Parameters
    ----------
    axes, tree, name
        Where, of which output, and which variable.
    window
        Start and end [s]; everything by default.
    time_unit
        Unit of the time axis [s].
    style
        Of the line.
    """
    start = 0.0 if window is None else window[0]
    times, values = line(tree, ("time", name), EVERYTHING, window or EVERYTHING.window(tree))
    axes.plot((times - start) / time_unit, values / SCALES[name].size, **style)


def largest_slip(tree: xr.DataTree, extent: Extent = EVERYTHING) -> xr.Dataset | None:
    """The slip with the greatest drop of the spring force; None if there is no slip."""
    all_slips = slips(tree)
    starts = all_slips["start_time"].values
    mine = np.flatnonzero(
        (all_slips["realization_index"].values == extent.first)
        & (starts >= extent.start)
        & (starts <= extent.end)
    )
    if mine.size == 0:
        return None
    drops = all_slips["force_drop"].values[mine]
    return all_slips.isel(slip=mine[np.argmax(np.abs(drops))])


def slip_window(slip: xr.Dataset, before: float = 0.3, after: float = 2.0) -> tuple[float, float]:
    """Start and end [s] of a window around a slip, in parts of its duration."""
    start, length = slip["start_time"].item(), slip["duration"].item()
    return start - before * length, start + (1 + after) * length


def force_of(tree: xr.DataTree) -> str:
    """The force by which a run is judged: of an elastic slider the mean one in it."""
    return "elastic_force" if "elastic_force" in tree.data_vars else "spring_force"


NAMES = {
    "spring_force": "spring force",
    "elastic_force": "mean elastic force",
    "contact_force": "contact force",
    "velocity": "velocity",
    "detached_contacts": "detached contacts",
}
# Units of the trace as a configuration writes them.
UNITS = {name: from_cf_units(one.units) for name, one in TRACE.items()} | {"time": "s"}


class Curve(NamedTuple):
    """A line of a picture in SI, and how it looks."""

    x: Array
    y: Array
    style: dict[str, Any]


def curve(tree: xr.DataTree, name: str, extent: Extent, **style: Any) -> Curve:
    """The line of a variable of a run."""
    along, _ = extent.abscissa
    x, y = line(tree, (along, name), extent, extent.window(tree))
    there = np.isfinite(y)
    if np.count_nonzero(there) == 1:
        # A line of one sample has no length.
        style = {"marker": ".", **style}
    return Curve(x, y, style)


def greatest(*values: Array) -> float:
    """Greatest size of values, those that are missing apart; 0 of none."""
    return max(float(np.max(np.abs(one[np.isfinite(one)]), initial=0.0)) for one in values)


def draw_curves(
    axes: Axes, curves: Sequence[Curve], name: str, along: Abscissa, label: str | None = None
) -> None:
    """Draw lines of one kind in the unit in which they are best read.

    Parameters
    ----------
    axes, curves
        Where, and what.
    name
        A variable that has their unit.
    along
        What they are drawn against.
    label
        What they are; the variable by default.
    """
    scale = scale_for(greatest(*(one.y for one in curves)), UNITS[name])
    for x, y, style in curves:
        axes.plot((x - along.origin) / along.scale.size, y / scale.size, **style)
    axes.set_ylabel(scale.label(label or NAMES[name]))
    if name == "detached_contacts" and greatest(*(one.y for one in curves)) == 0:
        axes.set_ylim(-0.05, 1)
    along.prepare(axes)


@dataclass(frozen=True)
class Abscissa:
    """What a picture is drawn against: its unit and label, the limits of the axis in that unit, and
    where it counts from, in SI."""

    scale: Scale
    label: str
    limits: tuple[float, float] | None
    origin: float = 0.0

    def prepare(self, axes: Axes) -> None:
        """Set the label and the limits of an axis."""
        axes.set_xlabel(self.scale.label(self.label))
        if self.limits is not None:
            axes.set_xlim(*self.limits)


def abscissa(trees: Sequence[xr.DataTree], extent: Extent) -> Abscissa:
    """The axis that fits what is drawn of outputs."""
    name, label = extent.abscissa
    if name != "time" and not all(is_known(tree, name) for tree in trees):
        raise FileError(
            f"the measured trace does not tell the {label}: mesoslip trace finds it with the "
            "velocity of the drive and the stiffness of the spring, or with --config"
        )
    windows = np.array([extent.window(tree) for tree in trees])
    if name != "time":
        lines = [
            line(tree, (name,), extent, window)[0]
            for tree, window in zip(trees, windows, strict=True)
        ]
        return Abscissa(scale_for(greatest(*lines), UNITS[name]), label, None)
    scale = scale_for(greatest(windows), "s")
    low, high = float(windows[:, 0].min()), float(windows[:, 1].max())
    return Abscissa(scale, label, (low / scale.size, high / scale.size) if high > low else None)


def since(window: tuple[float, float]) -> Abscissa:
    """The time after the start of a window."""
    start, length = window[0], window[1] - window[0]
    scale = scale_for(length, "s")
    label = "time"
    if start != 0:
        unit = scale_for(start, "s")
        # As many digits as tell the place in the whole.
        digits = max(3, 2 + math.ceil(math.log10(max(abs(start) / max(length, 1e-300), 1.0))))
        label = f"time after {start / unit.size:.{digits}g} {unit.name}"
    limits = (0.0, length / scale.size) if length > 0 else None
    return Abscissa(scale, label, limits, start)


def _others(tree: xr.DataTree, extent: Extent) -> Iterator[Extent]:
    """Realizations that are drawn behind the first one, if none was chosen."""
    if extent.realization is None:
        for number in range(1, min(tree.sizes["realization"], MOST_OTHERS + 1)):
            yield Extent(number, extent.start, extent.end, extent.against, extent.parts // 4)


def about(tree: xr.DataTree, extent: Extent) -> str:
    """Which of several realizations are shown."""
    count = tree.sizes["realization"]
    if count == 1:
        return ""
    if extent.realization is not None:
        return f"realization {extent.realization} (0 to {count - 1})"
    grey = min(count - 1, MOST_OTHERS)
    return f"black: realization 0; grey: {grey} of the other {count - 1}"


def draw_force(
    axes: Axes, tree: xr.DataTree, extent: Extent = EVERYTHING, along: Abscissa | None = None
) -> None:
    """Draw the spring force; of an elastic slider the mean force in it, and that at the drive."""
    name = force_of(tree)
    is_elastic = name != "spring_force"
    curves = [curve(tree, name, other, **OTHERS) for other in _others(tree, extent)]
    front: dict[str, Any] = {"color": "black"}
    if is_elastic:
        at_drive = {"color": "tab:blue", "alpha": 0.5, "label": "force at the drive"}
        curves.append(curve(tree, "spring_force", extent, **at_drive))
        front["label"] = "mean elastic force $K(X_d - X_1)$"
    curves.append(curve(tree, name, extent, **front))
    draw_curves(axes, curves, name, along or abscissa([tree], extent))
    titles(axes, tree, about(tree, extent), beside_legend=is_elastic)
    if is_elastic:
        legend_above(axes)


def _draw_one(axes: Axes, tree: xr.DataTree, name: str, extent: Extent, along: Abscissa) -> None:
    """Draw a variable of the trace, with other realizations behind it."""
    curves = [curve(tree, name, other, **OTHERS) for other in _others(tree, extent)]
    draw_curves(axes, [*curves, curve(tree, name, extent, color="black")], name, along)


def _known_below(trees: Sequence[xr.DataTree]) -> list[str]:
    """What is drawn below the force, as far as some output has it."""
    names = ("velocity", "detached_contacts")
    return [name for name in names if any(is_known(tree, name) for tree in trees)]


def _height(below: Sequence[str]) -> float:
    """Height of a picture [inch] of the force with so many panels below."""
    return 2.8 + 1.2 * len(below)


def overview(
    tree: xr.DataTree, figure: Canvas | None = None, extent: Extent = EVERYTHING
) -> Canvas:
    """Force, velocity and detached contacts; beside them the same of the largest slip."""
    slip, along = largest_slip(tree, extent), abscissa([tree], extent)
    below = _known_below([tree])
    with styled():
        figure = canvas(figure, (6.5 if slip is None else 8.0, _height(below)))
        columns = 1 if slip is None else 2
        panels = figure.subplots(
            1 + len(below),
            columns,
            sharex="col",
            squeeze=False,
            height_ratios=[1.7, *(1 for _ in below)],
            width_ratios=[2.1, 1][:columns],
        )
        draw_force(panels[0, 0], tree, extent, along)
        for axes, name in zip(panels[1:, 0], below, strict=True):
            _draw_one(axes, tree, name, extent, along)
        if slip is not None:
            draw_slip(list(panels[:, 1]), tree, slip, extent)
            if extent.abscissa[0] == "time":
                edges = [
                    slip[name].item() / along.scale.size for name in ("start_time", "end_time")
                ]
                for axes in panels[:, 0]:
                    axes.axvspan(*edges, color="tab:orange", alpha=0.25, linewidth=0.8, zorder=0)
        for axes in panels[:-1].flat:
            axes.set_xlabel("")
    return figure


def draw_slip(
    panels: Sequence[Axes], tree: xr.DataTree, slip: xr.Dataset, extent: Extent = EVERYTHING
) -> None:
    """Draw both forces, the velocity and the detached contacts of a slip, each into axes.

    Of a measured trace what is known of them, into as many axes.
    """
    times = times_of(tree)
    low, high = slip_window(slip)
    near = Extent(extent.first, max(low, times[0]), min(high, times[-1]), parts=extent.parts)
    along = since((near.start, near.end))
    force, *others = panels
    curves = []
    if is_known(tree, "contact_force"):
        curves.append(curve(tree, "contact_force", near, **CONTACT))
    if force_of(tree) == "elastic_force":
        curves.append(curve(tree, "elastic_force", near, color="tab:green", label="mean elastic"))
    curves.append(curve(tree, "spring_force", near, **SPRING))
    draw_curves(force, curves, "spring_force", along, "force")
    legend_above(force, columns=1, title="largest slip, orange on the left")
    for axes, name in zip(others, _known_below([tree]), strict=True):
        draw_curves(axes, [curve(tree, name, near, color="black")], name, along)


def compare_forces(
    axes: Axes, trees: Sequence[xr.DataTree], labels: Sequence[str], extent: Extent = EVERYTHING
) -> None:
    """Draw the forces of several runs over each other, with a legend."""
    _compare(axes, trees, labels, "", extent, abscissa(trees, extent))
    legend_above(axes, columns=1)


def _compare(
    axes: Axes,
    trees: Sequence[xr.DataTree],
    labels: Sequence[str],
    name: str,
    extent: Extent,
    along: Abscissa,
) -> None:
    """Draw a variable of several runs over each other; the force that each is judged by if it has
    no name."""
    names = [name or force_of(tree) for tree in trees]
    # The noise of what was measured must not hide what was computed.
    curves = [
        curve(
            tree,
            one,
            extent,
            label=label,
            color=COLORS[number % len(COLORS)],
            alpha=0.8,
            zorder=1.9 if is_measured(tree) else 2.0,
        )
        for number, (tree, one, label) in enumerate(zip(trees, names, labels, strict=True))
    ]
    told = dict.fromkeys(NAMES[one] for one in names)
    draw_curves(axes, curves, names[0], along, ", ".join(told))


def comparison(
    trees: Sequence[xr.DataTree],
    labels: Sequence[str],
    figure: Canvas | None = None,
    extent: Extent = EVERYTHING,
) -> Canvas:
    """Force, velocity and detached contacts of several runs over each other."""
    along = abscissa(trees, extent)
    below = _known_below(trees)
    with styled():
        figure = canvas(figure, (6.5, _height(below) + 0.16 * len(trees)))
        ratios = [1.7, *(1 for _ in below)]
        panels = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)
        for axes, name in zip(panels[:, 0], ("", *below), strict=True):
            _compare(axes, trees, labels, name, extent, along)
        for axes in panels[:-1, 0]:
            axes.set_xlabel("")
        shared_legend(figure, panels[0, 0])
    return figure


NO_LAYERS = (
    "the output has no displacements of layers: they are recorded with "
    'slider.kind = "layered" and output.layers = true'
)


def layer_motion(
    tree: xr.DataTree, extent: Extent, window: tuple[float, float]
) -> tuple[Array, Array]:
    """Times [s], shape (T + 1), and mean velocities of the layers between them, shape (T, layers).

    Raises
    ------
    FileError
        If the output does not have them.
    """
    if "layer_displacement" not in tree.data_vars:
        raise FileError(NO_LAYERS)
    times = times_of(tree)
    first, after = np.searchsorted(times, window[0]), np.searchsorted(times, window[1], "right")
    step = max(1, math.ceil((after - first) / MOST_INSTANTS))
    places = slice(int(first), int(after), step)
    data = tree.to_dataset()["layer_displacement"].isel(realization=extent.first, time=places)
    times = times[places]
    if len(times) < 2:
        raise FileError("the output has not two samples of the layers in the window of time")
    return times, np.diff(data.values, axis=0) / np.diff(times)[:, None]


def draw_layers(
    axes: Axes,
    tree: xr.DataTree,
    extent: Extent = EVERYTHING,
    window: tuple[float, float] | None = None,
) -> None:
    """Draw how fast each layer moves, over time and the number of the layer."""
    window = window or _layer_window(tree, extent)
    times, velocity = layer_motion(tree, extent, window)
    most, along = greatest(velocity) or 1.0, since(window)
    scale = scale_for(most, "m/s")
    drawn = axes.pcolormesh(
        (times - window[0]) / along.scale.size,
        np.arange(velocity.shape[1] + 1) + 0.5,
        velocity.T / scale.size,
        cmap="RdBu_r",
        norm=Normalize(-most / scale.size, most / scale.size),
        rasterized=True,
    )
    axes.figure.colorbar(drawn, ax=axes, label=scale.label("velocity of the layer"))
    axes.set_ylabel("layer, 1 at the contacts")
    along.prepare(axes)
    titles(axes, tree, about(tree, Extent(extent.first)))


def _layer_window(tree: xr.DataTree, extent: Extent) -> tuple[float, float]:
    """What was asked for, or else the largest slip and what follows it."""
    slip = largest_slip(tree, extent)
    window = extent.window(tree)
    if not extent.is_whole or slip is None:
        return window
    low, high = slip_window(slip)
    return max(low, window[0]), min(high, window[1])


def layers(tree: xr.DataTree, figure: Canvas | None = None, extent: Extent = EVERYTHING) -> Canvas:
    """Waves in an elastic slider over time and layers, above the forces at both of its ends."""
    if "layer_displacement" not in tree.data_vars:
        raise FileError(NO_LAYERS)
    window = _layer_window(tree, extent)
    near = Extent(extent.first, *window, parts=extent.parts)
    with styled():
        figure = canvas(figure, (6.5, 5.0))
        waves, force = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
        draw_layers(waves, tree, extent, window)
        waves.set_xlabel("")
        curves = [
            curve(tree, "contact_force", near, color="black", label="contact force"),
            curve(tree, "elastic_force", near, color="tab:green", label="mean elastic force"),
            curve(tree, "spring_force", near, **SPRING | {"label": "force at the drive"}),
        ]
        draw_curves(force, curves, "spring_force", since(window), "force")
        legend_above(force)
    return figure
