"""Maps: what the runs of a sweep did, over two of the keys that were swept."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter
from numpy.typing import NDArray

from mesoslip.errors import FileError
from mesoslip.plots.style import Canvas, canvas, styled

Array = NDArray[np.float64]

# Of regimes: smooth, stick-slip, irregular, transient; in this order for other choices too.
COLORS = ("#a6dba0", "#d6604d", "#f4a582", "#d9d9d9", "#92c5de", "#c2a5cf")
# What theory says, as lines of a map: the measure, the value at the line, its style, what it is.
BOUNDARIES: tuple[tuple[str, float, Literal["-", "--", ":"], str], ...] = (
    ("critical_stiffness_ratio", 1.0, "--", "$K = K^*$"),
    (
        "growth_rate",
        0.0,
        "-",
        "steady sliding with delay is stable on one side",
    ),
    ("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$"),
)
# Maps in a row.
MOST_COLUMNS = 3
# What is drawn if nothing else is asked for, and there is some.
FIRST = "regime"


def swept(data: xr.Dataset) -> list[str]:
    """Dimensions of a sweep of more than one value, but for the realizations."""
    return [
        str(name)
        for name in data["status"].dims
        if name != "realization" and data.sizes[name] > 1 and name in data.coords
    ]


def measures(data: xr.Dataset) -> list[str]:
    """Measures of a sweep."""
    return [str(name) for name in data.data_vars if name != "status"]


def overview(tree: xr.DataTree, figure: Canvas | None = None, name: str | None = None) -> Canvas:
    """A measure of a sweep over the keys that were swept; the regime by default.

    Over one key: each realization, and their mean. Over two: a map. Over three: a map for each
    value of the first.

    Raises
    ------
    FileError
        If the sweep has no such measure, or not one, two or three keys.
    """
    data = tree.to_dataset()
    name = _measure(data, name)
    keys = swept(data)
    if not 1 <= len(keys) <= 3:
        raise FileError(
            f"the sweep has {len(keys)} swept dimensions; one, two or three can be drawn"
        )
    with styled():
        if len(keys) == 1:
            figure = canvas(figure, (5.0, 3.2))
            draw_line(figure.subplots(), data, name)
            return figure
        parts = list(_parts(data, keys))
        columns = min(len(parts), MOST_COLUMNS)
        rows = -(-len(parts) // columns)
        figure = canvas(figure, (0.8 + 3.2 * columns, 0.6 + 2.9 * rows))
        panels = np.ravel(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True))
        for axes, (title, part) in zip(panels, parts, strict=False):
            draw_map(axes, part, name)
            axes.set_title(title, loc="left")
        for axes in panels[len(parts) :]:
            axes.set_axis_off()
    return figure


def draw_panel(axes: Axes, tree: xr.DataTree) -> None:
    """A measure of a sweep over one or two keys."""
    data = tree.to_dataset()
    name, keys = _measure(data, None), swept(data)
    if len(keys) == 1:
        draw_line(axes, data, name)
    else:
        draw_map(axes, next(part for _, part in _parts(data, keys)), name)


def _measure(data: xr.Dataset, name: str | None) -> str:
    there = measures(data)
    if name is None:
        return FIRST if FIRST in there else there[0]
    if name not in there:
        raise FileError(f"the sweep has no measure {name!r}; it has {', '.join(there)}")
    return name


def _parts(data: xr.Dataset, keys: list[str]) -> Iterator[tuple[str, xr.Dataset]]:
    if len(keys) == 2:
        yield "", data
        return
    for value in data[keys[0]].values:
        yield f"{_label(data, keys[0])} {_shown(data, keys[0], value)}", data.sel({keys[0]: value})


def draw_line(axes: Axes, data: xr.Dataset, name: str) -> None:
    """A measure over one key, each realization as a dot, and their mean as a line."""
    (key,) = swept(data)
    values = data[name].transpose(key, ...).values.reshape(data.sizes[key], -1).astype(float)
    x = data[key].values
    axes.plot(x, values, ".", color="0.6", markersize=4)
    if "flag_meanings" in data[name].attrs:
        meanings = data[name].attrs["flag_meanings"].split()
        axes.set_yticks(range(len(meanings)), [one.replace("_", "-") for one in meanings])
    else:
        axes.plot(x, np.nanmean(values, axis=1), "-", color="black")
        axes.set_ylabel(f"{data[name].attrs['long_name']} ({data[name].attrs.get('units', '1')})")
    _set_axis(axes, data, key, "x")


def draw_map(axes: Axes, data: xr.Dataset, name: str) -> None:
    """A measure over two keys: of choices the commonest of all realizations, else their mean."""
    along, across = (key for key in swept(data))
    x, y = data[along].values, data[across].values
    values = data[name].transpose(across, along, "realization").values.astype(float)
    is_choice = "flag_meanings" in data[name].attrs
    edges = _edges(x), _edges(y)
    if is_choice:
        meanings = data[name].attrs["flag_meanings"].split()
        colors = ListedColormap(COLORS[: len(meanings)])
        norm = BoundaryNorm(np.arange(len(meanings) + 1) - 0.5, len(meanings))
        axes.pcolormesh(*edges, commonest(values), cmap=colors, norm=norm)
        handles: list[Patch | Line2D] = [
            Patch(color=color, label=text.replace("_", "-"))
            for color, text in zip(COLORS, meanings, strict=False)
        ]
    else:
        drawn = axes.pcolormesh(*edges, _mean(values), cmap="viridis")
        attributes = data[name].attrs
        axes.figure.colorbar(
            drawn, ax=axes, label=f"{attributes['long_name']} ({attributes.get('units', '1')})"
        )
        handles = []
    handles += _boundaries(axes, data, (along, across))
    _set_axis(axes, data, along, "x")
    _set_axis(axes, data, across, "y")
    if handles:
        axes.legend(
            handles=handles, loc="lower left", bbox_to_anchor=(0, 1.06), ncols=2, fontsize=6
        )


def commonest(values: Array) -> Array:
    """The commonest of whole numbers along the last axis; NaN where there are none."""
    choices = np.unique(values[np.isfinite(values)])
    if not choices.size:
        return np.full(values.shape[:-1], np.nan)
    counts = np.stack([np.sum(values == one, axis=-1) for one in choices], axis=-1)
    found = choices[np.argmax(counts, axis=-1)]
    return np.where(counts.max(axis=-1) > 0, found, np.nan)


def _mean(values: Array) -> Array:
    known = np.isfinite(values)
    total = np.sum(np.where(known, values, 0), axis=-1)
    count = known.sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _boundaries(axes: Axes, data: xr.Dataset, keys: tuple[str, str]) -> list[Line2D]:
    """Draw the lines that theory gives, those there are."""
    handles = []
    for name, level, style, meaning in BOUNDARIES:
        if name not in data:
            continue
        values = _mean(data[name].transpose(*keys[::-1], "realization").values.astype(float))
        known = values[np.isfinite(values)]
        if known.size and known.min() < level < known.max():
            axes.contour(
                *(data[key].values for key in keys),
                np.ma.masked_invalid(values),
                [level],
                colors="black",
                linestyles=style,
                linewidths=1.2,
            )
            handles.append(Line2D([], [], color="black", linestyle=style, label=meaning))
    return handles


def _is_logarithmic(values: Array) -> bool:
    """Whether values are spaced evenly, more or less, on a logarithmic scale only."""
    if len(values) < 3 or np.any(values <= 0):
        return False
    steps, ratios = np.abs(np.diff(values)), np.abs(np.diff(np.log(values)))
    return bool(np.std(ratios) / np.mean(ratios) < np.std(steps) / np.mean(steps) - 1e-9)


def _edges(values: Array) -> Array:
    """Edges of cells around values in their order."""
    place = np.log(values) if _is_logarithmic(values) else values
    middle = (place[1:] + place[:-1]) / 2
    edges = np.concatenate([[2 * place[0] - middle[0]], middle, [2 * place[-1] - middle[-1]]])
    return np.exp(edges) if _is_logarithmic(values) else edges


def _unit(data: xr.Dataset, key: str) -> str:
    unit = data[key].attrs.get("units", "1")
    return "" if unit == "1" else unit.replace(" m-1", "/m").replace(" s-1", "/s")


def _label(data: xr.Dataset, key: str) -> str:
    return str(data[key].attrs.get("long_name", key))


def _shown(data: xr.Dataset, key: str, value: float) -> str:
    return EngFormatter(unit=_unit(data, key))(float(value))


def _set_axis(axes: Axes, data: xr.Dataset, key: str, which: str) -> None:
    """Scale, label and ticks of an axis."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    if _is_logarithmic(data[key].values):
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    axis.set_major_formatter(EngFormatter(unit=_unit(data, key)))
    axis.set_label_text(_label(data, key))
