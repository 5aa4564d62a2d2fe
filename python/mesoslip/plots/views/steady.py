"""View of steady sliding over velocity: force, and the stiffness that makes it stable."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.output.access import config_of
from mesoslip.plots.style import BLUE, RED, Canvas, canvas, legend_above, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, scale_for, with_unit


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Force and critical stiffness over velocity, with the configured spring."""
    data = tree.to_dataset()
    critical = data["critical_stiffness"].values
    if not np.isfinite(critical).any():
        # As of a slider whose motion is prescribed.
        figure = canvas(figure, (6.5, 3.2))
        draw_force(figure.subplots(), tree, options)
        return figure
    figure = canvas(figure, (6.5, 4.8))
    force, stiffness = figure.subplots(2, 1, sharex=True, height_ratios=[1.3, 1])
    draw_force(force, tree, options)
    force.set_xlabel("")
    spring = config_of(tree).spring_stiffness
    has_spring = 0 < spring < np.inf
    scale = scale_for(float(np.nanmax([*critical, spring if has_spring else 1.0])), "N/m")
    speed = _speed(tree)
    # Where sliding is stable with any spring there is no point on the logarithmic axis.
    shown = np.where(critical > 0, critical / scale.size, np.nan)
    at = data["velocity"].values / speed.size
    stiffness.plot(at, shown, color="black", marker="o", markersize=3, label="$K_c$")
    if has_spring:
        label = f"spring, {with_unit(spring, 'N/m')}: unstable where $K_c$ is above it"
        stiffness.axhline(spring / scale.size, color=RED, linestyle="--", label=label)
    if np.any(np.isfinite(shown)):
        stiffness.set_yscale("log")
    stiffness.set(ylabel=scale.label("stiffness"), xlabel=speed.label("velocity $v$"))
    for one in np.atleast_1d(tree.attrs.get("boundaries", [])):
        stiffness.axvline(one / speed.size, color=RED, linewidth=0.7, alpha=0.6, zorder=0)
    legend_above(stiffness)
    return figure


def draw_force(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the steady force over velocity, with the velocity of the drive."""
    data, speed = tree.to_dataset(), _speed(tree)
    values = data["steady_force"].values
    scale = scale_for(float(np.max(np.abs(values))), "N")
    axes.plot(
        data["velocity"].values / speed.size,
        values / scale.size,
        color="black",
        marker="o",
        markersize=3,
        label="$F(v)$",
    )
    drive = config_of(tree).drive_speed
    if drive > 0:
        label = f"drive, {with_unit(drive, 'm/s')}"
        axes.axvline(drive / speed.size, color=BLUE, linestyle=":", label=label)
    axes.set(xscale="log", ylabel=scale.label("steady force $F$"))
    axes.set_xlabel(speed.label("velocity $v$"))
    titles(axes, tree, beside_legend=True)
    legend_above(axes)


def _speed(tree: DataTree) -> Scale:
    values = tree.to_dataset()["velocity"].values
    return scale_for(float(np.sqrt(values[0] * values[-1])), "m/s")


VIEW = View(
    name="steady",
    kind="steady",
    summary="force of steady sliding and critical stiffness over velocity",
    draw_all=draw,
    panel=draw_force,
)
