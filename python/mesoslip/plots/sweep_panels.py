"""Panels of pictures of sweeps: a measure over one swept key, or as a map over two."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mesoslip.array_types import Array, Dataset
from mesoslip.plots.axis import label_powers, logarithmic
from mesoslip.plots.boundaries import REGIME
from mesoslip.plots.style import POINTS
from mesoslip.plots.sweep_axis import DIRECTION, DIRECTION_STYLES, SweptKey, spans_decades

# Smooth, stick-slip, irregular, transient, which differ in lightness; further choices.
CHOICE_COLORS = ("#a3cbe5", "#cc6677", "#f5e9b0", "#a5a5a5", "#5aa382", "#84669e")
# Measures of cycles, which have no meaning where there are none: the regimes without, their marks.
OF_CYCLES = {
    *("period", "period_variation", "period_irregularity", "mean_waiting_time"),
    *("mean_slip_duration", "mean_force_drop", "mean_peak_force", "peak_variation"),
    *("peak_spread", "peak_irregularity", "fall_variation", "fall_irregularity"),
}
WITHOUT_CYCLES = {0: ("smooth", "o"), 3: ("transient", "x")}
# Grey of cells without cycles, and of realizations behind their mean.
BLANK, BEHIND = "0.9", "0.7"


class Measured(NamedTuple):
    """A measure in the unit of its label, shape (keys…, realization), and what belongs to it."""

    values: Array
    label: str
    choices: tuple[str, ...]
    """Meanings of the values 0, 1, 2, … of a choice; empty for numbers."""
    regimes: Array | None
    """The most frequent regime at each point, shape (keys…), for a measure of cycles."""

    @property
    def realizations(self) -> int:
        return int(self.values.shape[-1])

    @property
    def shown(self) -> Array:
        """The mean over realizations, or the most frequent choice, shape (keys…)."""
        return most_frequent(self.values) if self.choices else mean_and_error(self.values)[0]

    @property
    def has_cycles(self) -> NDArray[np.bool_]:
        """Which points have the motion that the measure is of, shape (keys…)."""
        if self.regimes is None:
            return np.ones(self.values.shape[:-1], dtype=bool)
        return ~np.isin(self.regimes, list(WITHOUT_CYCLES))

    @property
    def rows(self) -> list[int]:
        """The values of a choice that occur."""
        return _different(self.values)


def measured(data: Dataset, name: str, label: str, unit: float) -> Measured:
    """A measure of a sweep in a unit [SI]."""
    measure = data[name].transpose(..., "realization")
    choices = tuple(measure.attrs.get("flag_meanings", "").replace("_", "-").split())
    regimes = None
    if name in OF_CYCLES and REGIME in data:
        regimes = most_frequent(data[REGIME].transpose(*measure.dims).values)
    return Measured(measure.values / unit, label, choices, regimes)


def draw_line(axes: Axes, one: Measured, key: SweptKey, *, is_line: bool) -> list[Line2D]:
    """Draw realizations of a measure over one key, open without cycles, and their mean; returns
    lines for a legend."""
    axes.set_ylabel(one.label)
    if one.choices:
        _draw_choices(axes, one, key)
        return []
    order, x = key.order, key.values[key.order]
    mean, error = (values[order] for values in mean_and_error(one.values))
    if one.realizations > 1:
        behind: dict[str, Any] = {"color": BEHIND, "markersize": 2.5, "zorder": 1}
        axes.plot(x, one.values[order], ".", linestyle="", **behind)
    style = POINTS | {"fmt": "o-" if is_line else "o", "linewidth": 0.7, "elinewidth": 0.9}
    axes.errorbar(x, mean, np.where(error > 0, error, np.nan), **style)
    if spans_decades(one.values):
        logarithmic(axes, "y")
    without = ~one.has_cycles[order] & np.isfinite(mean)
    if not without.any():
        return []
    hollow: dict[str, Any] = {
        "color": POINTS["color"],
        "markersize": 3.2,
        "markerfacecolor": "white",
        "zorder": 4,
    }
    label = "open: smooth or transient"
    return axes.plot(x[without], mean[without], "o", label=label, linestyle="", **hollow)


def _draw_choices(axes: Axes, one: Measured, key: SweptKey) -> None:
    """Draw how often each choice that occurs does, as the areas of points."""
    for row, code in enumerate(one.rows):
        share = np.mean(one.values == code, axis=-1)
        color = POINTS["color"]
        axes.scatter(
            key.values, np.full(key.values.size, row), 22 * share, color=color, linewidth=0
        )
    _name_rows(axes, one)


def _name_rows(axes: Axes, one: Measured) -> None:
    axes.set_yticks(range(len(one.rows)), [one.choices[code] for code in one.rows])
    axes.set_ylim(-0.5, len(one.rows) - 0.5)


def draw_directions(axes: Axes, data: Dataset, one: Measured, key: SweptKey) -> list[Line2D]:
    """Draw a measure up and down one key, the dimension before the realizations; returns lines for
    a legend."""
    axes.set_ylabel(one.label)
    rows = {code: row for row, code in enumerate(one.rows)}
    lines = []
    for number, direction in enumerate(data[DIRECTION].values.tolist()):
        style = DIRECTION_STYLES[direction]
        values = one.values[:, number]
        if one.choices:
            places = np.vectorize(lambda code: rows.get(code, np.nan), otypes=[float])(values)
            mean, error = places[:, 0], np.full(len(places), np.nan)
        else:
            mean, error = mean_and_error(values)
        error = np.where(error > 0, error, np.nan)
        drawn = axes.errorbar(
            key.values[key.order], mean[key.order], error[key.order], linewidth=0.7, **style
        )
        drawn[0].set_label(direction)
        lines.append(drawn[0])
    if one.choices:
        _name_rows(axes, one)
    elif spans_decades(one.values):
        logarithmic(axes, "y")
    return lines


def draw_map(
    axes: Axes, one: Measured, keys: list[SweptKey], norm: Normalize | None = None
) -> list[Line2D]:
    """Draw a measure over two keys by a norm, points without cycles or value in grey; returns marks
    for a legend."""
    order = np.ix_(*(key.order for key in keys))
    shown = one.shown[order].T
    edges = keys[0].edges, keys[1].edges
    if one.choices:
        _draw_choice_map(axes, one, edges, shown)
        return []
    has_cycles = one.has_cycles[order].T
    cells = np.ma.masked_invalid(np.where(has_cycles, shown, np.nan))
    norm = norm or norm_of([one])
    mesh = axes.pcolormesh(*edges, cells, cmap="viridis", norm=norm, rasterized=True)
    bar = axes.figure.colorbar(mesh, ax=axes, label=one.label)
    if isinstance(norm, LogNorm):
        label_powers(bar.ax.yaxis)
    blank = np.ma.getmaskarray(cells)
    grey = np.ma.masked_array(np.zeros(shown.shape), ~blank)
    axes.pcolormesh(*edges, grey, cmap=ListedColormap([BLANK]), rasterized=True, zorder=0.9)
    marks = [("no value", "_", blank & has_cycles)]
    if one.regimes is not None:
        regimes = one.regimes[order].T
        marks += [(*mark, regimes == code) for code, mark in WITHOUT_CYCLES.items()]
    handles = []
    x, y = np.meshgrid(*(key.values[key.order] for key in keys))
    for label, marker, there in marks:
        if there.any():
            style: dict[str, Any] = {"marker": marker, "color": "0.35", "markerfacecolor": "none"}
            style |= {"linestyle": "", "markersize": 3.5, "markeredgewidth": 0.7, "label": label}
            handles += axes.plot(x[there], y[there], **style)
    return handles


def _draw_choice_map(axes: Axes, one: Measured, edges: tuple[Array, Array], shown: Array) -> None:
    """Draw the choices that occur, each in its colour."""
    rows = _different(shown)
    colors = ListedColormap([CHOICE_COLORS[code % len(CHOICE_COLORS)] for code in rows])
    places = np.full(shown.shape, np.nan)
    for row, code in enumerate(rows):
        places[shown == code] = row
    norm = BoundaryNorm(np.arange(len(rows) + 1) - 0.5, len(rows))
    mesh = axes.pcolormesh(*edges, places, cmap=colors, norm=norm, rasterized=True)
    bar = axes.figure.colorbar(mesh, ax=axes, ticks=range(len(rows)), label=one.label)
    bar.ax.set_yticklabels([one.choices[code] for code in rows])
    bar.minorticks_off()


def _different(values: Array) -> list[int]:
    return [int(one) for one in np.unique(values[np.isfinite(values)])]


def norm_of(panels: list[Measured]) -> Normalize:
    """The range of colours of panels: of points with cycles, logarithmic over decades."""
    values = np.concatenate([one.shown[one.has_cycles].ravel() for one in panels])
    known = values[np.isfinite(values)]
    limits = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return (LogNorm if spans_decades(known) else Normalize)(*limits)


def mean_and_error(values: Array) -> tuple[Array, Array]:
    """Mean over the last dimension and its standard error; NaN where they are unknown."""
    known = np.isfinite(values)
    counts = known.sum(axis=-1)
    sums = np.where(known, values, 0.0).sum(axis=-1)
    mean: Array = np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0)
    squares = np.where(known, (values - mean[..., None]) ** 2, 0.0).sum(axis=-1)
    scale = counts * (counts - 1.0)
    error = np.sqrt(np.divide(squares, scale, out=np.full(sums.shape, np.nan), where=counts > 1))
    return mean, error


def most_frequent(values: Array) -> Array:
    """The most frequent of the choices 0, 1, … over the last dimension; NaN where there is none."""
    codes = np.unique(values[np.isfinite(values)])
    if not codes.size:
        return np.full(values.shape[:-1], np.nan)
    counts = np.stack([np.sum(values == one, axis=-1) for one in codes])
    return np.where(counts.sum(axis=0) > 0, codes[np.argmax(counts, axis=0)], np.nan)
