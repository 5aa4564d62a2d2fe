"""Pictures of sweeps: each measure over one swept key, or as a map over two, with the lines that
theory gives where the sweep has its measures."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mesoslip.configuration.units import from_cf_units
from mesoslip.errors import FileError
from mesoslip.plots.style import Canvas, canvas, styled
from mesoslip.quantities import Scale, scale_for

Array = NDArray[np.float64]

# Measures of which there is room for a panel.
MOST_PANELS = 6
# Axes over more than this factor are logarithmic.
WIDE = 5.0
# Places of an axis of a map of which each is labelled.
MOST_LABELS = 8
# Smooth, stick-slip, irregular, transient; further choices of measures to come.
CHOICES = ("#a6cee3", "#ee8877", "#e6d488", "#d9d9d9", "#7fbf7b", "#c2a5cf")
# What theory says, as lines of a map of the regime: the measure, the value at the line, its style,
# and what it is.
LineStyle = Literal["-", "--", "-.", ":"]
BOUNDARIES: tuple[tuple[str, float, LineStyle, str], ...] = (
    ("growth_rate", 0.0, "-.", "steady sliding with delay turns unstable"),
    ("stable_out_of_step", 0.5, "-", "the same, contacts out of step"),
    ("critical_stiffness_ratio", 1.0, "--", "$K = K^*$"),
    ("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$"),
)
# The measure that tells most, in whose map the lines are drawn.
REGIME = "regime"
# Maps of one measure in a row.
MOST_COLUMNS = 3


@dataclass(frozen=True)
class _Scale:
    """An axis of a picture: where the places of a swept key are, in the unit of its label."""

    label: str
    places: Array
    names: tuple[str, ...]
    is_logarithmic: bool

    @classmethod
    def of(cls, coordinate: xr.DataArray) -> _Scale:
        values = coordinate.values
        if values.dtype.kind not in "fiu":
            places = np.arange(len(values), dtype=np.float64)
            return cls(str(coordinate.name), places, tuple(map(str, values)), False)
        unit = _unit_of(coordinate)
        is_wide = bool(np.min(values) > 0 and np.max(values) > WIDE * np.min(values))
        return cls(unit.label(str(coordinate.name)), values / unit.size, (), is_wide)

    @property
    def edges(self) -> Array:
        """Half-way between the places, and as far beyond the first and the last."""
        order = np.argsort(self.places)
        places = self.places[order]
        places = np.log(places) if self.is_logarithmic else places
        if len(places) == 1:
            return self.places[0] * np.array([0.5, 1.5]) if self.places[0] else np.array([-1, 1])
        middles = (places[1:] + places[:-1]) / 2
        edges = np.concatenate(
            [[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]]
        )
        return np.exp(edges) if self.is_logarithmic else edges

    def apply(self, axes: Axes, which: str) -> None:
        """Label an axis of a panel."""
        getattr(axes, f"set_{which}label")(self.label)
        if self.is_logarithmic:
            getattr(axes, f"set_{which}scale")("log")
        if self.names:
            getattr(axes, f"set_{which}ticks")(self.places, self.names)

    def label_places(self, axes: Axes, which: str) -> None:
        """Label each place of an axis of a map, if they are few."""
        if len(self.places) <= MOST_LABELS and not self.names:
            getattr(axes, f"set_{which}ticks")([], minor=True)
            getattr(axes, f"set_{which}ticks")(self.places, [f"{one:.3g}" for one in self.places])


def _unit_of(data: xr.DataArray) -> Scale:
    """The unit in which a key or a measure is best read."""
    values = np.abs(data.values[np.isfinite(data.values)])
    units = from_cf_units(data.attrs.get("units", "1"))
    return scale_for(float(values.max(initial=0.0)), units)


def _chosen(data: xr.Dataset) -> tuple[xr.Dataset, list[str], str]:
    """What is drawn of a sweep: two dimensions at most, the keys along them, and what is left out.

    Of further dimensions it is the first place.
    """
    dimensions = [str(name) for name in data["status"].dims if name != "realization"]
    further = dimensions[2:]
    left_out = ", ".join(f"{name} = {data[name].values[0]:g}" for name in further)
    data = data.isel(dict.fromkeys(further, 0))
    keys = []
    for name in dimensions[:2]:
        # The samples of a hypercube are drawn over the first of its keys.
        along = [key for key in data.coords if data[key].dims == (name,) and key != name]
        keys.append(str(along[0]) if name == "sample" and along else name)
    return data, keys, left_out


def measures(data: xr.Dataset) -> list[str]:
    """Measures that are drawn of a sweep: those that are lines in the map of another are not."""
    names = [str(name) for name in data.data_vars if name != "status"]
    lines = {one[0] for one in BOUNDARIES}
    return [name for name in names if REGIME not in names or name not in lines]


def draw_measure(axes: Axes, tree: xr.DataTree, name: str | None = None) -> None:
    """Draw a measure of a sweep, the first by default: dots of realizations and their mean over one
    key, or the mean as a map over two; of a choice such as the regime, the most frequent one.

    Raises
    ------
    FileError
        If the sweep has no such measure.
    """
    data = tree.to_dataset()
    _draw(axes, data, _known(data, name) if name else measures(data)[0])


def _known(data: xr.Dataset, name: str) -> str:
    there = [str(one) for one in data.data_vars if one != "status"]
    if name not in there:
        raise FileError(f"the sweep has no measure {name!r}; it has {', '.join(there)}")
    return name


def _draw(axes: Axes, data: xr.Dataset, name: str) -> None:
    data, keys, left_out = _chosen(data)
    measure = data[name]
    flags = tuple(measure.attrs.get("flag_meanings", "").split())
    unit = _unit_of(measure)
    measure = (measure / unit.size).assign_attrs(measure.attrs)
    title = unit.label(name)
    scales = [_Scale.of(data[key]) for key in keys]
    if len(keys) == 1:
        _draw_line(axes, measure, scales[0], flags)
        if name == REGIME:
            _draw_crossings(axes, data, scales[0])
    else:
        _draw_map(axes, measure, scales, flags)
        if name == REGIME:
            _draw_boundaries(axes, data, measure.dims[:2], scales)
        scales[1].apply(axes, "y")
    scales[0].apply(axes, "x")
    if len(scales) == 2:
        for scale, which in zip(scales, "xy", strict=True):
            scale.label_places(axes, which)
    axes.set_title(title + (f"; {left_out}" if left_out else ""), loc="left")


def _draw_line(axes: Axes, measure: xr.DataArray, scale: _Scale, flags: tuple[str, ...]) -> None:
    values = measure.transpose(..., "realization").values
    axes.plot(scale.places, values, ".", color="tab:blue", markersize=3)
    if flags:
        axes.set_yticks(range(len(flags)), [name.replace("_", "-") for name in flags])
        axes.set_ylim(-0.5, len(flags) - 0.5)
    elif values.shape[1] > 1 and measure.dims[0] != "sample":
        order = np.argsort(scale.places)
        mean = measure.mean("realization").values
        axes.plot(scale.places[order], mean[order], color="black")


def _draw_map(
    axes: Axes, measure: xr.DataArray, scales: list[_Scale], flags: tuple[str, ...]
) -> None:
    values = measure.transpose(..., "realization").values
    shown = _most_frequent(values, len(flags)) if flags else measure.mean("realization").values
    shown = shown[np.ix_(*(np.argsort(scale.places) for scale in scales))].T
    where = scales[0].edges, scales[1].edges
    if not flags:
        mesh = axes.pcolormesh(*where, shown, cmap="viridis")
        axes.figure.colorbar(mesh, ax=axes)
        return
    colours = ListedColormap(CHOICES[: len(flags)])
    norm = BoundaryNorm(np.arange(len(flags) + 1) - 0.5, len(flags))
    mesh = axes.pcolormesh(*where, shown, cmap=colours, norm=norm)
    bar = axes.figure.colorbar(mesh, ax=axes, ticks=range(len(flags)))
    bar.ax.set_yticklabels([name.replace("_", "-") for name in flags])


def _draw_boundaries(
    axes: Axes, data: xr.Dataset, dimensions: tuple[Hashable, ...], scales: list[_Scale]
) -> None:
    """Draw the lines that theory gives, those of which there are measures that pass their value."""
    order = [np.argsort(scale.places) for scale in scales]
    x, y = (scale.places[one] for scale, one in zip(scales, order, strict=True))
    handles = []
    for name, level, style, meaning in BOUNDARIES:
        if name not in data:
            continue
        values = data[name].mean("realization").transpose(*dimensions).values
        values = np.ma.masked_invalid(values[np.ix_(*order)].T)
        if values.count() and values.min() < level < values.max():
            axes.contour(x, y, values, [level], colors="black", linestyles=style, linewidths=1.2)
            handles.append(_line_of(style, meaning))
    _tell_lines(axes, handles)


def _draw_crossings(axes: Axes, data: xr.Dataset, scale: _Scale) -> None:
    """Draw where theory puts a change along one key, by straight lines between its places."""
    order = np.argsort(scale.places)
    places = np.log(scale.places[order]) if scale.is_logarithmic else scale.places[order]
    handles = []
    for name, level, style, meaning in BOUNDARIES:
        if name not in data:
            continue
        above = data[name].mean("realization").values[order] - level
        changes = np.flatnonzero(above[1:] * above[:-1] < 0)
        for one in changes:
            share = above[one] / (above[one] - above[one + 1])
            place = places[one] + share * (places[one + 1] - places[one])
            place = math.exp(place) if scale.is_logarithmic else place
            axes.axvline(place, color="black", linestyle=style, linewidth=1.2)
        if changes.size:
            handles.append(_line_of(style, meaning))
    _tell_lines(axes, handles)


def _line_of(style: LineStyle, meaning: str) -> Line2D:
    return Line2D([], [], color="black", linestyle=style, label=meaning)


def _tell_lines(axes: Axes, handles: list[Line2D]) -> None:
    if handles:
        axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0, -0.2), ncols=1)


def _most_frequent(values: Array, count: int) -> Array:
    """The most frequent of some choices over the last dimension; NaN where there are none."""
    counts = np.stack([np.sum(values == one, axis=-1) for one in range(count)])
    return np.where(counts.sum(axis=0) > 0, np.argmax(counts, axis=0), np.nan)


def overview(tree: xr.DataTree, figure: Canvas | None = None, name: str | None = None) -> Canvas:
    """A panel for each measure of a sweep, six at most; or one measure, at each place of the
    dimension before the last two.

    Raises
    ------
    FileError
        If the sweep has no such measure.
    """
    data = tree.to_dataset()
    if name is None:
        parts = [(data, one) for one in measures(data)[:MOST_PANELS]]
        most = 2
    else:
        parts = [(part, _known(data, name)) for part in _places(data)]
        most = MOST_COLUMNS
    columns = min(len(parts), most)
    rows = -(-len(parts) // columns)
    with styled(), mpl.rc_context({"axes.spines.top": True, "axes.spines.right": True}):
        figure = canvas(figure, (max(4.4, 3.4 * columns), 2.5 * rows + 0.4))
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, (part, one) in zip(panels, parts, strict=False):
            _draw(axes, part, one)
        for axes in panels[len(parts) :]:
            axes.remove()
    return figure


def _places(data: xr.Dataset) -> Iterator[xr.Dataset]:
    """The sweep at each place of its first dimension, if it has three."""
    dimensions = [str(name) for name in data["status"].dims if name != "realization"]
    if len(dimensions) != 3:
        yield data
        return
    first = dimensions[0]
    for place in range(data.sizes[first]):
        # The dimension comes last, where a single place of it is told.
        yield data.isel({first: [place]}).transpose(*dimensions[1:], first, ...)
