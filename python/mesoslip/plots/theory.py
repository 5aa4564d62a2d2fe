"""Pictures of the theory: force curves and onsets of slip."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.plots.style import COLORS, Canvas, canvas, legend_above, plain, styled, titles
from mesoslip.quantities import Scale, scale_for, with_unit

Array = NDArray[np.float64]


def _units(trees: Sequence[xr.DataTree]) -> tuple[Scale, Scale]:
    """Units of displacement and force in which curves are best read."""
    data = [tree.to_dataset() for tree in trees]
    x = max(float(one["displacement"].values[-1]) for one in data)
    force = max(float(np.max(np.abs(one["contact_force"].values))) for one in data)
    return scale_for(x, "m"), scale_for(force, "N")


def _mark_instability(axes: Axes, tree: xr.DataTree, scale: Scale) -> None:
    """Mark X_c along the whole height of axes."""
    if "X_c" in tree.attrs:
        axes.axvline(
            tree.attrs["X_c"] / scale.size, color="tab:red", linewidth=0.7, alpha=0.6, zorder=0
        )


def draw_curve(axes: Axes, tree: xr.DataTree) -> None:
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
        color="tab:blue",
        linestyle=":",
        label=f"stationary sliding, {with_unit(steady, 'N')}",
    )
    if "X_c" in tree.attrs:
        _mark_instability(axes, tree, x)
        axes.plot(
            tree.attrs["X_c"] / x.size,
            tree.attrs["F_c"] / force.size,
            "o",
            color="tab:red",
            markersize=4,
            label=f"instability at $X_c$ = {with_unit(tree.attrs['X_c'], 'm')}",
        )
    axes.set_ylabel(force.label("force $F$"))
    axes.set_xlabel(x.label("displacement $X$"))
    axes.set_xlim(0, data["displacement"].values[-1] / x.size)
    spring = Config.from_toml(tree.attrs["configuration"]).spring_stiffness
    told = f"$K^*$ = {with_unit(tree.attrs['K_star'], 'N/m')}"
    if np.isfinite(spring):
        told += f", $K$ = {with_unit(spring, 'N/m')}"
    titles(axes, tree, mathematical=told, beside_legend=True)
    legend_above(axes)


def force_curve(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Force and slope of the master equation over displacement, with the points of instability."""
    config = Config.from_toml(tree.attrs["configuration"])
    x, _ = _units([tree])
    data = tree.to_dataset()
    values: Array = data["slope"].values
    scale = scale_for(float(np.max(np.abs(values))), "N/m")
    with styled():
        figure = canvas(figure, (6.5, 4.6))
        force, slope = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
        draw_curve(force, tree)
        force.set_xlabel("")
        slope.plot(data["displacement"].values / x.size, values / scale.size, color="black")
        slope.set_ylabel(scale.label("slope $F'$"))
        slope.set_xlabel(x.label("displacement $X$"))
        _mark_instability(slope, tree, x)
        if np.isfinite(config.spring_stiffness):
            slope.axhline(
                -config.spring_stiffness / scale.size,
                color="tab:red",
                linestyle="--",
                label="$-K$: unstable where the slope is below",
            )
            legend_above(slope)
    return figure


def draw_curves(axes: Axes, trees: Sequence[xr.DataTree], labels: Sequence[str]) -> None:
    """Draw several force curves over each other, each with its point of instability."""
    x, force = _units(trees)
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        color = COLORS[number % len(COLORS)]
        data = tree.to_dataset()
        axes.plot(
            data["displacement"].values / x.size,
            data["contact_force"].values / force.size,
            color=color,
            label=label,
        )
        if "X_c" in tree.attrs:
            place = tree.attrs["X_c"] / x.size, tree.attrs["F_c"] / force.size
            axes.plot(*place, "o", color=color, markersize=4)
    axes.set_ylabel(force.label("force $F$"))
    axes.set_xlabel(x.label("displacement $X$; dots: $X_c$"))
    axes.set_xlim(left=0)


# Colours of the equations for the onset of slip, as in the source.
ONSETS: dict[str, dict[str, Any]] = {
    "sequential": {"color": "black", "label": "one after another (S46)"},
    "melting": {"color": "tab:blue", "label": "instant melting (S47)"},
}


def draw_onset(axes: Axes, tree: xr.DataTree, **style: Any) -> None:
    """Draw the change of the spring force by S46 and S47 against the time since the onset."""
    for name, colour in ONSETS.items():
        if name in tree.children:
            data = tree.children[name].to_dataset()
            axes.plot(
                data["onset_time"].values, data["relative_force_drop"].values, **(colour | style)
            )


def draw_drop(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the drop of the spring force after the onset of slip."""
    draw_drops(axes, [tree], [""])
    titles(axes, tree, beside_legend=bool(tree.children))
    if tree.children:
        legend_above(axes)
    else:
        axes.set_axis_off()
        text = textwrap.fill(plain(tree.attrs["comment"]), 90)
        axes.text(0.5, 0.6, text, ha="center", va="center", transform=axes.transAxes)


def _onset_curves(
    trees: Sequence[xr.DataTree],
) -> list[tuple[int, str, Array, Array, Array]]:
    """For each solution of each output: its place, its equation, times [s], the change of the
    spring force [N], and that at short times [N]."""
    found = []
    for place, tree in enumerate(trees):
        static = Config.from_toml(tree.attrs["configuration"]).contacts.static_force
        for name in ONSETS:
            if name in tree.children:
                data = tree.children[name].to_dataset()
                times = data["onset_time"].values / tree.attrs["omega_s"]
                drops = (data[one].values * static for one in ("relative_force_drop", "asymptote"))
                found.append((place, name, times, *drops))
    return found


def draw_drops(axes: Axes, trees: Sequence[xr.DataTree], labels: Sequence[str]) -> None:
    """Draw the drops of the spring force of several onsets of slip over each other."""
    curves = _onset_curves(trees)
    time = scale_for(max((one[2][-1] for one in curves), default=1.0), "s")
    force = scale_for(max((np.abs(one[3]).max() for one in curves), default=1.0), "N")
    for place, name, times, drop, _ in curves:
        style = ONSETS[name]
        if labels[place]:
            style = {
                "color": COLORS[place % len(COLORS)],
                "linestyle": "-" if name == "sequential" else "--",
                "label": f"{labels[place]}: {style['label']}",
            }
        axes.plot(times / time.size, drop / force.size, **style)
        if name == "sequential":
            # Where S46 ends, which may be so early that its line is not seen.
            end = times[-1] / time.size, drop[-1] / force.size
            axes.plot(*end, ".", color=style["color"], markersize=3)
    axes.set_xlabel(time.label("time $t - t_c$ since the onset"))
    axes.set_ylabel(force.label(r"change of the spring force $\Delta F_d$"))


def slip_onset(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Drop of the spring force after the onset of slip, with double logarithmic axes beside it."""
    curves = _onset_curves([tree])
    with styled():
        figure = canvas(figure, (6.5, 3.2))
        if not curves:
            draw_drop(figure.subplots(), tree)
            return figure
        plain, logarithmic = figure.subplots(1, 2)
        draw_drop(plain, tree)
        time = scale_for(max(one[2][-1] for one in curves), "s")
        force = scale_for(max(np.abs(one[3]).max() for one in curves), "N")
        for _, name, times, drop, asymptote in curves:
            color, falls = ONSETS[name]["color"], drop < 0
            logarithmic.loglog(times[falls] / time.size, -drop[falls] / force.size, color=color)
            logarithmic.loglog(
                times[1:] / time.size, -asymptote[1:] / force.size, color=color, linestyle=":"
            )
        logarithmic.set_xlabel(time.label("time $t - t_c$"))
        logarithmic.set_ylabel(force.label(r"$-\Delta F_d$"))
        logarithmic.set_title("dotted: at short times", loc="left")
    return figure
