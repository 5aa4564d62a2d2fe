"""View of a run with inertia or of a measured trace: forces, velocity and detached contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mesoslip.output.access import config_of, group_of, is_measured
from mesoslip.output.arrays import Tree
from mesoslip.plots.axis import HorizontalAxis, horizontal_axis
from mesoslip.plots.close_up import draw_slip, largest_slip
from mesoslip.plots.curves import about_realizations, curve, draw_curves, others_behind
from mesoslip.plots.extent import EVERYTHING, Extent
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import (
    BLUE,
    OTHERS,
    RED,
    YELLOW,
    Canvas,
    canvas,
    curve_style,
    legend_above,
    shared_legend,
    titles,
)
from mesoslip.plots.trace_variables import UNITS, force_of, is_known, label_of
from mesoslip.plots.views.base import EXTENT, Options, View
from mesoslip.quantities import scale_for

# Maximum number of slips or impulses that are marked: more would be a band.
MAX_MARKS = 2000


def draw_marks(
    axes: Axes, tree: Tree, name: str, extent: Extent, horizontal: HorizontalAxis
) -> bool:
    """Mark starts and ends of slips, and impulses, on the force of a measured trace; whether
    anything is marked."""
    root = tree.to_dataset()
    time, force = root["time"].values, root[name].values[0]
    window = extent.window(tree)
    inside = (time >= window[0]) & (time <= window[1])
    scale = scale_for(float(np.max(np.abs(force[inside]), initial=0.0)), UNITS[name])
    across = root[extent.horizontal[0]].values
    across = across if across.ndim == 1 else across[0]
    slips = group_of(tree, "slips")
    starts = slips["start_time"].values, slips["force_before"].values
    ends = slips["end_time"].values, slips["force_after"].values
    marks = [(*starts, "v", "start of a slip", RED), (*ends, "^", "end of a slip", BLUE)]
    if "noise" in tree.children and "impulse_time" in tree.children["noise"]:
        at = group_of(tree, "noise")["impulse_time"].values
        marks.append((at, np.interp(at, time, force), "x", "impulse, removed", YELLOW))
    found = False
    for at, level, marker, label, color in marks:
        shown = (at >= window[0]) & (at <= window[1])
        if not 0 < np.count_nonzero(shown) <= MAX_MARKS:
            continue
        place = np.interp(at[shown], time, across)
        axes.plot(
            (place - horizontal.origin) / horizontal.scale.size,
            level[shown] / scale.size,
            marker,
            color=color,
            markersize=3.5,
            markeredgewidth=0.8,
            label=label,
            zorder=3,
        )
        found = True
    return found


BELOW = ("velocity", "detached_contacts")
BESIDE = "with the largest slip beside them"


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:
    """Force, velocity and detached contacts; beside them the same during the largest slip."""
    extent = options.extent
    slip, horizontal = largest_slip(tree, extent), horizontal_axis([tree], extent)
    below = _known_below([tree])
    is_stacked = slip is not None and is_narrow(figure)
    size = (6.5 if slip is None else 8.0, _height(below))
    figure = canvas(figure, (3.4, 2.9 + 0.9 * len(below)) if is_stacked else size)
    whole, near = _panels(figure, 1 + len(below), slip is not None, is_stacked)
    _draw_force(whole[0], tree, extent, horizontal)
    for axes, name in zip(whole[1:], below, strict=False):
        _draw_variable(axes, tree, name, extent, horizontal)
    if slip is not None:
        is_shaded = extent.horizontal[0] == "time"
        place = "above" if is_stacked else "at left"
        title = f"largest slip (shaded {place})" if is_shaded else "largest slip"
        draw_slip(near, tree, slip, below, extent, title)
        if is_shaded:
            edges = [slip[name] / horizontal.scale.size for name in ("start_time", "end_time")]
            for axes in whole:
                axes.axvspan(*edges, color=YELLOW, alpha=0.4, linewidth=0.8, zorder=0)
    for axes in (*whole[:-1], *near[:-1]):
        axes.set_xlabel("")
    figure.align_ylabels([*whole, *near] if is_stacked else None)
    return figure


def _panels(
    figure: Canvas, rows: int, has_slip: bool, is_stacked: bool
) -> tuple[list[Axes], list[Axes]]:
    """Panels of the run, and those of its slip beside them, or below the force of the run."""
    ratios = [1.7, *(1 for _ in range(rows - 1))]
    if not is_stacked:
        columns = 2 if has_slip else 1
        widths = [2.1, 1][:columns]
        panels = figure.subplots(
            rows, columns, sharex="col", squeeze=False, height_ratios=ratios, width_ratios=widths
        )
        return list(panels[:, 0]), list(panels[:, 1]) if has_slip else []
    force, *near = figure.subplots(1 + rows, 1, height_ratios=[1.7, *ratios])
    for axes in near[:-1]:
        axes.sharex(near[-1])
        axes.tick_params(labelbottom=False)
    return [force], near


def draw_force(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the spring force; of an elastic slider its mean force, and the force at the drive."""
    _draw_force(axes, tree, options.extent, horizontal_axis([tree], options.extent))


def _draw_force(axes: Axes, tree: Tree, extent: Extent, horizontal: HorizontalAxis) -> None:
    name = force_of(tree)
    is_elastic = name == "elastic_force"
    curves = [curve(tree, name, other, **OTHERS) for other in others_behind(tree, extent)]
    front: dict[str, Any] = {"color": "black"}
    if is_elastic:
        at_drive = {"color": BLUE, "alpha": 0.5, "label": "force at the drive"}
        curves.append(curve(tree, "spring_force", extent, **at_drive))
        front["label"] = "mean elastic force $K(X_d - X_1)$"
    curves.append(curve(tree, name, extent, **front))
    draw_curves(axes, curves, name, horizontal, label_of(tree, name))
    if is_measured(tree):
        marked = draw_marks(axes, tree, name, extent, horizontal)
        if marked:
            legend_above(axes)
        is_elastic = is_elastic or marked
    titles(axes, tree, about_realizations(tree, extent), beside_legend=is_elastic)
    if is_elastic and not is_measured(tree):
        legend_above(axes)


def _draw_variable(
    axes: Axes, tree: Tree, name: str, extent: Extent, horizontal: HorizontalAxis
) -> None:
    """Draw a variable of the trace, with other realizations behind it."""
    curves = [curve(tree, name, other, **OTHERS) for other in others_behind(tree, extent)]
    draw_curves(axes, [*curves, curve(tree, name, extent, color="black")], name, horizontal)


def _known_below(trees: Sequence[Tree]) -> list[str]:
    """The variables below the force that an output has."""
    below = [name for name in BELOW if any(is_known(tree, name) for tree in trees)]
    loaded = any(not is_measured(tree) and config_of(tree).pressing.varies for tree in trees)
    return [*below, "normal_force"] if loaded else below


def caption(tree: Tree) -> str:
    """The panels that an output has."""
    *others, last = ["force", *(name.replace("_", " ") for name in _known_below([tree]))]
    panels = f"{', '.join(others)} and {last}" if others else last
    return panels if largest_slip(tree, EVERYTHING) is None else f"{panels}, {BESIDE}"


def _height(below: Sequence[str]) -> float:
    """Height of a figure with panels below the force [inch]."""
    return 2.8 + 1.2 * len(below)


def compare(
    trees: Sequence[Tree],
    labels: Sequence[str],
    options: Options,
    figure: Canvas | None,
) -> Canvas:
    """Force, velocity and detached contacts of several runs over each other."""
    horizontal = horizontal_axis(trees, options.extent)
    below = _known_below(trees)
    figure = canvas(figure, (6.5, _height(below) + 0.16 * len(trees)))
    ratios = [1.7, *(1 for _ in below)]
    panels = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)
    for axes, name in zip(panels[:, 0], (None, *below), strict=True):
        _compare(axes, trees, labels, name, options.extent, horizontal)
    for axes in panels[:-1, 0]:
        axes.set_xlabel("")
    shared_legend(figure, panels[0, 0])
    return figure


def compare_forces(
    axes: Axes, trees: Sequence[Tree], labels: Sequence[str], options: Options
) -> None:
    """Draw the forces of several runs over each other."""
    extent = options.extent
    _compare(axes, trees, labels, None, extent, horizontal_axis(trees, extent))


def _compare(
    axes: Axes,
    trees: Sequence[Tree],
    labels: Sequence[str],
    name: str | None,
    extent: Extent,
    horizontal: HorizontalAxis,
) -> None:
    """Draw a variable of several runs, or the force of each (`force_of`), over each other."""
    names = [name or force_of(tree) for tree in trees]
    # The noise of measured traces must not hide computed traces.
    curves = [
        curve(
            tree,
            one,
            extent,
            label=label,
            **curve_style(number),
            alpha=0.8,
            zorder=1.9 if is_measured(tree) else 2.0,
        ).after(horizontal.start(number))
        for number, (tree, one, label) in enumerate(zip(trees, names, labels, strict=True))
        if name is None or is_known(tree, name)
    ]
    quantities = ", ".join(dict.fromkeys(map(label_of, trees, names)))
    draw_curves(axes, curves, names[0], horizontal, quantities)


VIEW = View(
    name="run",
    kind="run",
    summary="force, velocity and detached contacts, with the largest slip beside them",
    caption=caption,
    draw_all=draw,
    panel=draw_force,
    options=EXTENT,
    compare_all=compare,
    compare_panel=compare_forces,
    takes_arrays=True,
    applies=lambda tree: is_measured(tree) or not config_of(tree).slider.jumps,
)
