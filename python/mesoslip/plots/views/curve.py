"""View of a force curve: force and slope of the master equation over displacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array, DataTree
from mesoslip.output.access import config_of
from mesoslip.plots.style import (
    BLUE,
    RED,
    Canvas,
    canvas,
    curve_color,
    curve_style,
    legend_above,
    titles,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, scale_for, with_unit


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Force and slope of the master equation over displacement, with the point of instability."""
    spring = config_of(tree).series_stiffness
    x, _ = _units([tree])
    data = tree.to_dataset()
    values: Array = data["slope"].values
    scale = scale_for(float(np.max(np.abs(values))), "N/m")
    figure = canvas(figure, (6.5, 4.6))
    force, slope = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    draw_curve(force, tree, options)
    force.set_xlabel("")
    slope.plot(data["displacement"].values / x.size, values / scale.size, color="black")
    slope.set(ylabel=scale.label("slope $F'$"), xlabel=x.label("displacement $X$"))
    _mark_instability(slope, tree, x)
    if np.isfinite(spring):
        slope.axhline(
            -spring / scale.size,
            color=RED,
            linestyle="--",
            label="$-K$: unstable below this line",
        )
        legend_above(slope)
    return figure


def draw_curve(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the force of the master equation over displacement, with the point of instability."""
    x, force = _units([tree])
    data = tree.to_dataset()
    axes.plot(
        data["displacement"].values / x.size,
        data["contact_force"].values / force.size,
        color="black",
        label="$F(X)$",
    )
    steady = tree.attrs["F_steady"]
    axes.axhline(
        steady / force.size,
        color=BLUE,
        linestyle=":",
        label=f"steady sliding, {with_unit(steady, 'N')}",
    )
    if "X_c" in tree.attrs:
        _mark_instability(axes, tree, x)
        axes.plot(
            tree.attrs["X_c"] / x.size,
            tree.attrs["F_c"] / force.size,
            "o",
            color=RED,
            markersize=4,
            label=f"instability at $X_c$ = {with_unit(tree.attrs['X_c'], 'm')}",
        )
    axes.set(ylabel=force.label("force $F$"), xlabel=x.label("displacement $X$"))
    axes.set_xlim(0, data["displacement"].values[-1] / x.size)
    spring = config_of(tree).spring_stiffness
    stiffnesses = f"$K^*$ = {with_unit(tree.attrs['K_star'], 'N/m')}"
    if np.isfinite(spring):
        stiffnesses += f", $K$ = {with_unit(spring, 'N/m')}"
    titles(axes, tree, mathematical=stiffnesses, beside_legend=True)
    legend_above(axes)


def draw_curves(axes: Axes, trees: Sequence[DataTree], labels: Sequence[str], _: Options) -> None:
    """Draw several force curves over each other, each with its point of instability."""
    x, force = _units(trees)
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        style = curve_style(number)
        data = tree.to_dataset()
        axes.plot(
            data["displacement"].values / x.size,
            data["contact_force"].values / force.size,
            **style,
            label=label,
        )
        if "X_c" in tree.attrs:
            point = tree.attrs["X_c"] / x.size, tree.attrs["F_c"] / force.size
            axes.plot(*point, "o", color=curve_color(number), markersize=4)
    axes.set(ylabel=force.label("force $F$"), xlabel=x.label("displacement $X$; dots: $X_c$"))
    axes.set_xlim(left=0)


def _units(trees: Sequence[DataTree]) -> tuple[Scale, Scale]:
    """Units of displacement and force that suit all of some curves."""
    data = [tree.to_dataset() for tree in trees]
    x = max(float(one["displacement"].values[-1]) for one in data)
    force = max(float(np.max(np.abs(one["contact_force"].values))) for one in data)
    return scale_for(x, "m"), scale_for(force, "N")


def _mark_instability(axes: Axes, tree: DataTree, scale: Scale) -> None:
    """Mark X_c over the height of axes."""
    if "X_c" in tree.attrs:
        axes.axvline(tree.attrs["X_c"] / scale.size, color=RED, linewidth=0.7, alpha=0.6, zorder=0)


VIEW = View(
    name="curve",
    kind="curve",
    summary="force and its slope over displacement",
    draw_all=draw,
    panel=draw_curve,
    compare_panel=draw_curves,
)
