"""View of strokes: loops, friction over cycles in both directions, and friction maps."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mesoslip.analysis.strokes.catalogue import Strokes, strokes_of
from mesoslip.analysis.strokes.friction_map import FrictionMap, along, friction_map, place_of
from mesoslip.analysis.strokes.measure import MIDDLE
from mesoslip.array_types import Array
from mesoslip.output.arrays import Tree
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import (
    BLUE,
    POINTS,
    RED,
    Canvas,
    axes_height,
    canvas,
    legend_above,
    titles,
    wrapped,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, scale_for

# Maximum number of loops in a picture; those between are left out.
MAX_LOOPS = 12
# Quantiles of the friction in the middle of strokes that limit the colours of maps.
RANGE = (0.02, 0.98)
DIRECTIONS = {1: "forwards", -1: "backwards"}


def _unit(found: Strokes) -> tuple[str, str]:
    """Name and SI unit of the friction that is drawn."""
    if found.records[0].normal is not None or found.force_unit == "1":
        return "friction coefficient", "1"
    return "friction", found.force_unit


def _place(found: Strokes) -> tuple[str, Scale]:
    """Label of the position, and its scale."""
    record = found.records[0]
    if record.position is None:
        return f"share of the time of a {record.singular}", Scale("", 1.0)
    size = max(one.length for one in found.strokes[0])
    scale = scale_for(size / 2, "m")
    return scale.label("position on the track"), scale


def draw_loops(axes: Axes, found: Strokes) -> None:
    """Draw the force over the position in some cycles, from blue for the first to red."""
    record, strokes = found.records[0], found.strokes[0]
    name, unit = _unit(found)
    label, place = _place(found)
    pairs = list(zip(strokes[::2], strokes[1::2], strict=False))
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(MAX_LOOPS, len(pairs))).astype(int))
    size = max(float(np.abs(along(record, one)).max()) for one in strokes)
    scale = scale_for(size, unit)
    for index in chosen.tolist():
        share = index / max(1, len(pairs) - 1)
        colour = tuple(
            (1 - share) * one + share * two
            for one, two in zip((0, 0.27, 0.53), (0.73, 0.33, 0.4), strict=True)
        )
        # Without a position, each begins at the left.
        gap = [] if record.position is not None else [np.nan]
        x = np.concatenate([[*place_of(record, one), *gap] for one in pairs[index]])
        y = np.concatenate([[*one.direction * along(record, one), *gap] for one in pairs[index]])
        axes.plot(x / place.size, y / scale.size, color=colour, linestyle="-", linewidth=0.7)
    axes.set(xlabel=label, ylabel=scale.label(f"{name}, signed"))


def draw_cycles(axes: Axes, found: Strokes) -> None:
    """Draw the mean friction of each stroke, each direction in a colour; the maximum where no mean
    is known."""
    name, unit = _unit(found)
    columns = found.columns["strokes"]
    key, label = "mean_friction", f"mean {name}"
    if unit == "1" and found.force_unit != "1":
        key = "mean_friction_coefficient"
    mine = columns["realization_index"] == 0
    if not np.isfinite(columns[key][mine]).any():
        key, label, unit = "max_friction", "maximum friction", found.force_unit
    values = columns[key]
    errors = columns.get(f"{key}_error", np.zeros(values.size))
    known = mine & np.isfinite(values)
    scale = scale_for(float(np.max(np.abs(values[known]), initial=0.0)) or 1.0, unit)
    for direction, colour in ((1, RED), (-1, BLUE)):
        shown = known & (columns["direction"] == direction)
        if not shown.any():
            continue
        axes.errorbar(
            columns["stroke_number"][shown],
            values[shown] / scale.size,
            errors[shown] / scale.size,
            **(POINTS | {"color": colour, "label": DIRECTIONS[direction]}),
        )
    axes.set(xlabel=found.records[0].singular, ylabel=scale.label(label))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if len(set(columns["direction"][known].tolist())) > 1:
        legend_above(axes)


def _draw_map(axes: Axes, found: Strokes, one: FrictionMap, limits: tuple[float, float]) -> None:
    """Draw the friction over stroke and position."""
    name, unit = _unit(found)
    label, place = _place(found)
    scale = scale_for(max(map(abs, limits)), unit)
    edges = np.concatenate([one.number - 1.0, one.number[-1:] + 1.0])
    drawn = axes.pcolormesh(
        edges,
        one.edges / place.size,
        one.friction / scale.size,
        cmap="cividis",
        vmin=limits[0] / scale.size,
        vmax=limits[1] / scale.size,
        rasterized=True,
    )
    axes.set(xlabel=found.records[0].singular, ylabel=wrapped(label, axes_height(axes)))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.figure.colorbar(drawn, ax=axes, label=scale.label(name))


def _sliding(one: FrictionMap) -> Array:
    """The friction in the middle of the strokes, without the reversals."""
    edge = round(0.5 * (1 - MIDDLE) * one.friction.shape[0])
    middle = one.friction[edge : one.friction.shape[0] - edge]
    return middle[np.isfinite(middle)]


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:
    """Loops, friction over strokes, and a friction map for each direction."""
    found = _found(tree, options)
    is_stacked = is_narrow(figure)
    figure = canvas(figure, (3.4, 9.0) if is_stacked else (7.0, 5.4))
    maps = {
        direction: one
        for direction in DIRECTIONS
        if (one := friction_map(found.records[0], found.strokes[0], direction)).number.size
    }
    rows, columns = (2 + len(maps), 1) if is_stacked else (2, 2)
    grid = figure.add_gridspec(rows, columns)
    places = [grid[0, 0], grid[1, 0] if is_stacked else grid[0, 1]]
    places += [
        grid[2 + number, 0] if is_stacked else grid[1, number if len(maps) > 1 else slice(None)]
        for number in range(len(maps))
    ]
    panels = [figure.add_subplot(one) for one in places]
    draw_loops(panels[0], found)
    titles(panels[0], tree)
    draw_cycles(panels[1], found)
    values = np.concatenate([_sliding(one) for one in maps.values()])
    low, high = (float(one) for one in np.quantile(values, RANGE))
    for axes, (direction, one) in zip(panels[2:], maps.items(), strict=True):
        _draw_map(axes, found, one, (low, high))
        if len(maps) > 1:
            axes.set_title(DIRECTIONS[direction], loc="left")
    return figure


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the loops alone."""
    draw_loops(axes, _found(tree, options))
    titles(axes, tree)


def _found(tree: Tree, options: Options) -> Strokes:
    return strokes_of(tree, realization=options.extent.realization or 0, period=options.period)


VIEW = View(
    name="strokes",
    kind="run",
    summary="loops, friction over strokes, and over position and stroke",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"realization", "period"}),
    takes_arrays=True,
)
