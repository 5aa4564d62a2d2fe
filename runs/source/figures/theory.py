"""Figures of the theory: the force curve, the onset of slip, the limit of many contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mesoslip.output.samples import series
from mesoslip.plots.style import RED, YELLOW
from mesoslip.plots.views.onset import EQUATIONS
from outputs import configuration

from figures.base import source_figure


@source_figure(
    "S18",
    "force $F(X)$ of the master equation against displacement, in units of $F_s$ and $f_s/k$",
    ("S18.curve",),
)
def force_over_displacement(trees: Sequence[xr.DataTree]) -> Figure:
    (tree,) = trees
    data, contacts = tree.to_dataset(), configuration(tree).contacts
    figure = Figure(figsize=(4.5, 3))
    axes = figure.subplots()
    axes.plot(
        data["displacement"].values * contacts.stiffness / contacts.static_force,
        data["contact_force"].values / contacts.static_force,
        color="black",
    )
    axes.axhline(tree.attrs["F_steady"] / contacts.static_force, color="0.8", zorder=0)
    axes.set(xlabel="displacement $X$", ylabel="force $F(X)$", xlim=(0, 6), ylim=(0, 1))
    return figure


# The source's D0, D2 and D3 at each dispersion of S19; an exponent is missing in it.
SOURCE_COEFFICIENTS = {0.01: "0.94, 2.2e5, 1.91e?", 0.1: "0.794, 3.61e3, 4.03e2"}


@source_figure(
    "S19",
    "drop of the spring force after the instability by Eqs. S46 and S47, and in slips",
    ("S19a.onset", "S19a", "S19a-me", "S19b.onset", "S19b", "S19b-me"),
)
def onset_of_slip(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 5.4))
    rows = figure.subplots(2, 2)
    for columns, group in zip(rows.T, (trees[:3], trees[3:]), strict=True):
        onset, contacts, infinite = group
        width = configuration(onset).contacts.threshold.relative_width
        static = configuration(onset).contacts.static_force
        for axes in columns:
            for tree, style in (
                (contacts, {"color": YELLOW, "label": "N contacts"}),
                (infinite, {"color": RED, "label": r"$N \to \infty$"}),
            ):
                times, force = series(tree, "spring_force")
                _, displacement = series(tree, "displacement")
                start = int(np.argmax(displacement >= onset.attrs["X_c"]))
                tau = onset.attrs["omega_s"] * (times - times[start])
                axes.plot(tau, (force - force[start]) / static, **style)
            _draw_onset(axes, onset)
            axes.set(xlabel=r"$\tau = \Omega_S (t - t_c)$", ylabel=r"$\Delta F_d/F_s$")
        whole, start_of_slip = columns
        whole.set(xlim=(0, 5), ylim=(-2.1, 0.1))
        end = 3 * onset.attrs["expansion_end_time"]
        start_of_slip.set(xlim=(0, end), ylim=(-0.02 * end**2, 0.002 * end**2))
        whole.set_title(
            rf"$\Delta f_s/f_s$ = {width:g}"
            "\n"
            rf"$D_0, D_2, D_3$: {onset.attrs['D0']:.3g}, {onset.attrs['D2']:.3g}, "
            rf"{onset.attrs['D3']:.3g}"
            f"\nin the source: {SOURCE_COEFFICIENTS.get(width, 'none')}",
            loc="left",
        )
    rows[0, 0].legend()
    return figure


def _draw_onset(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the change of the spring force by S46 and S47 against the time since the onset."""
    for name, style in EQUATIONS.items():
        if name in tree.children:
            data = tree.children[name].to_dataset()
            axes.plot(
                data["onset_time"].values,
                data["relative_force_drop"].values,
                **style | {"linestyle": "--"},
            )


@source_figure(
    "limit",
    "force under a slider that moves forth and back, and its difference from N to infinity",
    ("limit-me", *(f"limit-{power}" for power in range(2, 7))),
)
def limit_of_many_contacts(trees: Sequence[xr.DataTree]) -> Figure:
    exact, *finite = trees
    figure = Figure(figsize=(6.5, 3))
    force, difference = figure.subplots(1, 2, width_ratios=[1.6, 1])
    infinite = exact.to_dataset()["contact_force"].values[0]
    counts, errors = [], []
    for tree in finite:
        config = configuration(tree)
        counts.append(config.contacts.count)
        deviation = (
            tree.to_dataset()["contact_force"].values - infinite
        ) / config.contacts.static_force
        errors.append(np.sqrt(np.mean(deviation**2)))
    times = exact.to_dataset()["time"].values
    force.plot(
        times,
        finite[0].to_dataset()["contact_force"].values[0] * 1e6,
        color="0.7",
        label=f"$N$ = {counts[0]}",
    )
    force.plot(times, infinite * 1e6, color="black", label=r"$N \to \infty$")
    force.set(xlabel="time (s)", ylabel="contact force (µN)")
    force.legend()
    difference.loglog(counts, errors, "o", color="black", markersize=4)
    slope = errors[-1] * np.sqrt(counts[-1] / np.array(counts))
    difference.loglog(counts, slope, color=RED, linestyle="--", label="$N^{-1/2}$")
    difference.set(xlabel="$N$", ylabel="rms difference over $F_s$")
    difference.legend()
    return figure
