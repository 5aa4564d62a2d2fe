"""View of an onset of slip: the change of the spring force after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array, DataTree
from mesoslip.output.access import config_of
from mesoslip.plots.style import (
    BLUE,
    Canvas,
    curve_color,
    filled,
    legend_above,
    side_by_side,
    titles,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Share of the range of forces from which sequential breaking is visible; range of an inset for it
# over its own.
VISIBLE, ENLARGED = 0.1, 1.5
# Styles of the equations for the onset of slip, as in the source.
EQUATIONS: dict[str, dict[str, Any]] = {
    "sequential": {"color": "black", "label": "sequential breaking (S46)"},
    "melting": {"color": BLUE, "label": "instant melting (S47)"},
}


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Change of the spring force after the onset of slip, beside it with logarithmic axes."""
    solutions = _solutions([tree])
    figure, (linear, *others) = side_by_side(figure, (6.5, 3.2), 2 if solutions else 1)
    draw_drop(linear, tree, options)
    if not solutions:
        return figure
    _enlarge_start(linear, solutions)
    (logarithmic,) = others
    time = scale_for(max(one.times[-1] for one in solutions), "s")
    force = scale_for(max(np.abs(one.drop).max() for one in solutions), "N")
    for one in solutions:
        color, falls = EQUATIONS[one.equation]["color"], one.drop < 0
        times = one.times / time.size
        logarithmic.loglog(times[falls], -one.drop[falls] / force.size, color=color)
        asymptote = -one.asymptote[1:] / force.size
        logarithmic.loglog(times[1:], asymptote, color=color, linestyle=":")
    logarithmic.set_xlabel(time.label("time $t - t_c$ since the onset"))
    logarithmic.set_ylabel(force.label(r"$-\Delta F_d$"))
    logarithmic.set_title("dotted: short-time asymptotes", loc="left")
    return figure


def _enlarge_start(axes: Axes, solutions: Sequence[_Solution]) -> None:
    """Draw the start of slip in an inset, where sequential breaking ends so early that it is not
    visible beside instant melting."""
    early = [one for one in solutions if one.equation == "sequential"]
    if not early or np.ptp(early[0].drop) > VISIBLE * max(np.ptp(one.drop) for one in solutions):
        return
    end, depth = ENLARGED * early[0].times[-1], ENLARGED * np.ptp(early[0].drop)
    if not (end > 0 and depth > 0):
        return
    time, force = scale_for(end, "s"), scale_for(depth, "N")
    inset = axes.inset_axes((0.66, 0.6, 0.34, 0.3))
    for one in solutions:
        style = EQUATIONS[one.equation] | {"label": None}
        inset.plot(one.times / time.size, one.drop / force.size, **style)
    inset.set(xlim=(0, end / time.size), ylim=(-depth / force.size, 0.1 * depth / force.size))
    inset.tick_params(labelsize="small")
    inset.set_title(f"start, {force.name} over {time.name}", fontsize="small", loc="left", pad=2)


def draw_drop(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw the change of the spring force after the onset of slip."""
    draw_drops(axes, [tree], [""], options)
    titles(axes, tree, beside_legend=bool(tree.children))
    if tree.children:
        legend_above(axes)
    else:
        axes.set_axis_off()
        text = filled(tree.attrs["comment"], 0.9 * axes.figure.bbox.width / axes.figure.figure.dpi)
        axes.text(0.5, 0.6, text, ha="center", va="center", transform=axes.transAxes)


def draw_drops(axes: Axes, trees: Sequence[DataTree], labels: Sequence[str], _: Options) -> None:
    """Draw the change of the spring force after several onsets of slip over each other."""
    solutions = _solutions(trees)
    time = scale_for(max((one.times[-1] for one in solutions), default=1.0), "s")
    force = scale_for(max((np.abs(one.drop).max() for one in solutions), default=1.0), "N")
    for one in solutions:
        style, label = EQUATIONS[one.equation], labels[one.output]
        is_sequential = one.equation == "sequential"
        if label:
            style = {
                "color": curve_color(one.output),
                "linestyle": "-" if is_sequential else "--",
                "label": f"{label}: {style['label']}",
            }
        axes.plot(one.times / time.size, one.drop / force.size, **style)
        if is_sequential:
            # S46 may end so early that its line is not visible.
            end = one.times[-1] / time.size, one.drop[-1] / force.size
            axes.plot(*end, ".", color=style["color"], markersize=3)
    axes.set_xlabel(time.label("time $t - t_c$ since the onset"))
    axes.set_ylabel(force.label(r"change of the spring force $\Delta F_d$"))


class _Solution(NamedTuple):
    """A solution of an equation: index of the output, name of the equation, times [s], change of
    the spring force [N], and that at short times [N]."""

    output: int
    equation: str
    times: Array
    drop: Array
    asymptote: Array


def _solutions(trees: Sequence[DataTree]) -> list[_Solution]:
    found = []
    for index, tree in enumerate(trees):
        static = config_of(tree).contacts.static_force
        for name in EQUATIONS:
            if name in tree.children:
                data = tree.children[name].to_dataset()
                times = data["onset_time"].values / tree.attrs["omega_s"]
                drops = (data[one].values * static for one in ("relative_force_drop", "asymptote"))
                found.append(_Solution(index, name, times, *drops))
    return found


VIEW = View(
    name="onset",
    kind="onset",
    summary="change of the spring force after the onset of slip",
    draw_all=draw,
    panel=draw_drop,
    compare_panel=draw_drops,
    legend_entries=len(EQUATIONS),
)
