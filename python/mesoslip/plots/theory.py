"""Pictures of the theory: force curves and onsets of slip."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.plots.style import Canvas, canvas, styled

Array = NDArray[np.float64]


def draw_curve(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the force of the master equation over displacement, with the point of instability."""
    contacts = Config.from_toml(tree.attrs["configuration"]).contacts
    unit = contacts.static_force / contacts.stiffness
    data = tree.to_dataset()
    x: Array = data["displacement"].values / unit
    axes.plot(x, data["contact_force"].values / contacts.static_force, color="black")
    steady = tree.attrs["F_steady"] / contacts.static_force
    axes.axhline(steady, color="tab:blue", linestyle=":", label="stationary sliding")
    if "X_c" in tree.attrs:
        axes.plot(
            tree.attrs["X_c"] / unit,
            tree.attrs["F_c"] / contacts.static_force,
            "o",
            color="tab:red",
            markersize=4,
            label="instability $X_c$",
        )
    axes.set_ylabel("$F/F_s$")
    axes.set_xlabel("displacement $X k/f_s$")
    axes.set_xlim(0, x[-1])
    axes.legend()
    axes.set_title(f"{tree.attrs['title']}; $K^*$ = {tree.attrs['K_star']:.4g} N/m", loc="left")


def force_curve(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Force and slope of the master equation over displacement, with the points of instability."""
    config = Config.from_toml(tree.attrs["configuration"])
    contacts = config.contacts
    unit = contacts.static_force / contacts.stiffness
    data = tree.to_dataset()
    x: Array = data["displacement"].values / unit
    with styled():
        figure = canvas(figure, (6.5, 4.2))
        force, slope = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
        draw_curve(force, tree)
        force.set_xlabel("")
        slope.plot(x, data["slope"].values / contacts.stiffness, color="black")
        slope.set_ylabel("$F'/Nk$")
        slope.set_xlabel("displacement $X k/f_s$")
        if np.isfinite(config.spring_stiffness):
            spring = -config.spring_stiffness / contacts.stiffness
            slope.axhline(spring, color="tab:red", linestyle="--", label="$-K/Nk$")
            slope.legend(loc="lower right")
    return figure


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
    draw_onset(axes, tree)
    axes.set_xlabel(r"$\tau = \Omega_S (t - t_c)$")
    axes.set_ylabel(r"$\Delta F_d/F_s$")
    if tree.children:
        axes.legend()
    else:
        axes.set_title(tree.attrs["comment"], loc="left")


def slip_onset(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Drop of the spring force after the onset of slip, with double logarithmic axes beside it."""
    with styled():
        figure = canvas(figure, (6.5, 3))
        plain, logarithmic = figure.subplots(1, 2)
        draw_drop(plain, tree)
        for name, style in ONSETS.items():
            if name not in tree.children:
                continue
            data = tree.children[name].to_dataset()
            time, drop = data["onset_time"].values[1:], -data["relative_force_drop"].values[1:]
            logarithmic.loglog(time[drop > 0], drop[drop > 0], color=style["color"])
            logarithmic.loglog(
                time, -data["asymptote"].values[1:], color=style["color"], linestyle=":"
            )
        logarithmic.set_xlabel(r"$\tau$")
        logarithmic.set_ylabel(r"$-\Delta F_d/F_s$; dotted: at short times")
    return figure
