"""View of a sweep: each measure over one swept key, or as a map over two."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mesoslip.errors import FileError
from mesoslip.plots.boundaries import BOUNDARIES, REGIME, add_legend, draw_contours, draw_crossings
from mesoslip.plots.key_names import name_of, symbol_or_name
from mesoslip.plots.logarithmic import logarithmic
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import BLUE, Canvas, axes_width, canvas, plain, wrapped
from mesoslip.plots.sweep_axis import (
    DIRECTION,
    DIRECTION_STYLES,
    SweptKey,
    scale_of,
    spans_decades,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Measures of an overview.
MAX_PANELS = 6
# Panels in a row, of an overview and of the maps of one measure.
COLUMNS = 2
MAP_COLUMNS = 3
# Smooth, stick-slip, irregular, transient, which differ in lightness; further choices.
CHOICE_COLORS = ("#a3cbe5", "#cc6677", "#f5e9b0", "#a5a5a5", "#5aa382", "#84669e")


def draw(tree: xr.DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """A panel for each of the first measures of a sweep; or one measure, with a panel for each
    value of the first of three dimensions."""
    data = tree.to_dataset()
    if options.measure is None:
        panels = [(data, one) for one in measures(data)[:MAX_PANELS]]
    else:
        name = _known(data, options.measure)
        panels = [(part, name) for part in _parts(data)]
    columns = min(len(panels), COLUMNS if options.measure is None else MAP_COLUMNS)
    columns = 1 if is_narrow(figure) else columns
    rows = -(-len(panels) // columns)
    with mpl.rc_context({"axes.spines.top": True, "axes.spines.right": True}):
        figure = canvas(figure, (max(4.4, 3.4 * columns), 2.5 * rows + 0.4))
        all_axes = figure.subplots(rows, columns, squeeze=False).ravel()
        lines: dict[str, Line2D] = {}
        for axes, (part, name) in zip(all_axes, panels, strict=False):
            lines |= {str(one.get_label()): one for one in _draw_measure(axes, part, name)}
        if lines:
            figure.legend(handles=list(lines.values()), loc="outside lower left")
        for axes in all_axes[len(panels) :]:
            axes.remove()
    return figure


def draw_panel(axes: Axes, tree: xr.DataTree, options: Options) -> None:
    """Draw a measure of a sweep, the first one by default.

    Over one key it is dots for realizations and a line for their mean; over two a map of the mean,
    or of the most frequent one of a choice such as the regime.
    """
    data = tree.to_dataset()
    name = measures(data)[0] if options.measure is None else _known(data, options.measure)
    add_legend(axes, _draw_measure(axes, data, name))


def measures(data: xr.Dataset) -> list[str]:
    """Measures of a sweep that have a picture: with the regime, not those of its boundaries."""
    names = [str(name) for name in data.data_vars if name != "status"]
    lines = {one.measure for one in BOUNDARIES}
    return [name for name in names if REGIME not in names or name not in lines]


def _known(data: xr.Dataset, name: str) -> str:
    there = [str(one) for one in data.data_vars if one != "status"]
    if name not in there:
        raise FileError(f"the sweep has no measure {name!r}; it has {', '.join(there)}")
    return name


def _draw_measure(axes: Axes, data: xr.Dataset, name: str) -> list[Line2D]:
    """Draw a measure; returns lines for a legend, of boundaries or directions."""
    lines: list[Line2D] = []
    data, names, fixed = _shown_keys(data)
    keys = [SweptKey.of(data[one]) for one in names]
    scale = scale_of(data[name])
    measure = (data[name] / scale.size).assign_attrs(data[name].attrs)
    choices = tuple(measure.attrs.get("flag_meanings", "").replace("_", "-").split())
    if len(keys) == 1:
        if DIRECTION in data.dims:
            lines = _draw_directions(axes, measure, keys[0])
            data = data.isel({DIRECTION: 0})
        else:
            _draw_dots(axes, measure, keys[0], choices)
        _scale_values(axes, measure, choices)
        if name == REGIME:
            lines += draw_crossings(axes, data, keys[0])
    else:
        _draw_map(axes, measure, keys, choices)
        if name == REGIME:
            lines = draw_contours(axes, data, keys)
    for key, which in zip(keys, "xy", strict=False):
        key.apply(axes, which)
        if len(keys) == 2:
            key.label_values(axes, which)
    title = "; ".join([scale.label(name_of(name)), *fixed])
    axes.set_title(wrapped(title, axes_width(axes)), loc="left")
    return lines


def _shown_keys(data: xr.Dataset) -> tuple[xr.Dataset, list[str], list[str]]:
    """A sweep at the first values of its third and further dimensions, the keys along the first
    two, and the values of the others in words. If it goes up and down a key, only that is shown."""
    dimensions = _dimensions(data)
    if DIRECTION in data.dims:
        dimensions.sort(key=lambda name: name != data.attrs["continued_key"])
    further = dimensions[1 if DIRECTION in data.dims else 2 :]
    fixed = [f"{symbol_or_name(name)} = {_value(data[name])}" for name in further]
    data = data.isel(dict.fromkeys(further, 0))
    keys = []
    for name in dimensions[: len(dimensions) - len(further)]:
        # The samples of a hypercube are drawn over the first of its keys.
        along = [key for key in data.coords if data[key].dims == (name,) and key != name]
        keys.append(str(along[0]) if name == "sample" and along else name)
    return data, keys, fixed


def _value(coordinate: xr.DataArray) -> str:
    """The first value of a swept key, with the unit that suits all of them."""
    value = coordinate.values[0]
    if coordinate.dtype.kind not in "fiu":
        return plain(str(value))
    scale = scale_of(coordinate)
    return f"{number(value / scale.size)} {scale.name}".rstrip()


def _dimensions(data: xr.Dataset) -> list[str]:
    """Dimensions along which keys vary."""
    without = {"realization", DIRECTION}
    return [str(name) for name in data["status"].dims if name not in without]


def _draw_directions(axes: Axes, measure: xr.DataArray, key: SweptKey) -> list[Line2D]:
    """Draw a measure up and down one key, as dots, and as lines through the means, which it
    returns."""
    lines = []
    for direction, style in DIRECTION_STYLES.items():
        branch = measure.sel({DIRECTION: direction}).transpose(..., "realization")
        axes.plot(key.values, branch.values, linestyle="", **style)
        mean = branch.mean("realization").values[key.order]
        lines += axes.plot(key.values[key.order], mean, linewidth=0.7, label=direction, **style)
    return lines


def _scale_values(axes: Axes, measure: xr.DataArray, choices: tuple[str, ...]) -> None:
    """Label the choices of a measure on its axis, or choose its scale."""
    if choices:
        axes.set_yticks(range(len(choices)), choices)
        axes.set_ylim(-0.5, len(choices) - 0.5)
    elif spans_decades(measure.values):
        logarithmic(axes, "y")


def _draw_dots(axes: Axes, measure: xr.DataArray, key: SweptKey, choices: tuple[str, ...]) -> None:
    values = measure.transpose(..., "realization").values
    axes.plot(key.values, values, ".", color=BLUE, markersize=3)
    if not choices and values.shape[1] > 1 and measure.dims[0] != "sample":
        mean = measure.mean("realization").values
        axes.plot(key.values[key.order], mean[key.order], color="black")


def _draw_map(
    axes: Axes, measure: xr.DataArray, keys: list[SweptKey], choices: tuple[str, ...]
) -> None:
    values = measure.transpose(..., "realization").values
    shown = _most_frequent(values, len(choices)) if choices else _mean(values)
    shown = shown[np.ix_(*(key.order for key in keys))].T
    edges = keys[0].edges, keys[1].edges
    if not choices:
        scale = LogNorm() if spans_decades(shown) else None
        mesh = axes.pcolormesh(*edges, shown, cmap="viridis", norm=scale, rasterized=True)
        axes.figure.colorbar(mesh, ax=axes)
        return
    colors = ListedColormap(CHOICE_COLORS[: len(choices)])
    norm = BoundaryNorm(np.arange(len(choices) + 1) - 0.5, len(choices))
    mesh = axes.pcolormesh(*edges, shown, cmap=colors, norm=norm, rasterized=True)
    bar = axes.figure.colorbar(mesh, ax=axes, ticks=range(len(choices)))
    bar.ax.set_yticklabels(choices)
    bar.minorticks_off()


def _mean(values: Array) -> Array:
    """Mean over the last dimension, without missing values; NaN where all are missing."""
    known = np.isfinite(values)
    counts = known.sum(axis=-1)
    sums = np.where(known, values, 0.0).sum(axis=-1)
    mean: Array = np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0)
    return mean


def _most_frequent(values: Array, count: int) -> Array:
    """The most frequent of some choices over the last dimension; NaN where there are none."""
    counts = np.stack([np.sum(values == one, axis=-1) for one in range(count)])
    return np.where(counts.sum(axis=0) > 0, np.argmax(counts, axis=0), np.nan)


def _parts(data: xr.Dataset) -> Iterator[xr.Dataset]:
    """The sweep at each value of its first dimension, if it has three; or of the other dimension,
    if it has two and goes up and down one."""
    dimensions = _dimensions(data)
    if len(dimensions) != (2 if DIRECTION in data.dims else 3):
        yield data
        return
    first = next(one for one in dimensions if one != data.attrs.get("continued_key"))
    dimensions.sort(key=lambda name: name != first)
    for index in range(data.sizes[first]):
        # The dimension comes last, where its single value becomes part of the title.
        yield data.isel({first: [index]}).transpose(*dimensions[1:], first, ...)


VIEW = View(
    name="sweep",
    kind="sweep",
    summary="measures over the swept keys",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"measure"}),
)
