"""Figures of stick-slip: traces and slips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr
from matplotlib.figure import Figure
from mesoslip.output.access import group_of
from mesoslip.plots.close_up import largest_slip, slip_window
from mesoslip.plots.style import CONTACT, RED, SPRING
from outputs import configuration

from figures.base import power_of_ten, source_figure
from figures.panels import shared_panels, stacked
from figures.traces import draw_series


@source_figure("S20", "spring force in stick-slip; inset: one slip", ("S20",))
def stick_slip(trees: Sequence[xr.DataTree]) -> Figure:
    (tree,) = trees
    figure = Figure(figsize=(6.5, 3.6))
    axes = figure.subplots()
    draw_series(axes, tree, "spring_force", color="black")
    axes.set(xlabel="time (s)", ylabel="spring force $F_d$ (µN)")
    axes.set_xlim(0, tree["time"].max().item())
    slip = largest_slip(tree)
    if slip is not None:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.6 * (high - low))
        inset = axes.inset_axes((0.4, 0.62, 0.57, 0.36))
        window = slip_window(slip, before=0.5, after=9)
        draw_series(inset, tree, "spring_force", window=window, time_unit=1e-3, color="black")
        inset.set_xlabel(f"time after {window[0]:.3f} s (ms)", fontsize=7)
        inset.tick_params(labelsize=7)
    return figure


@source_figure(
    "S21", "details of the first slip: (a) velocity, (b) forces, (c) detached contacts", ("S21",)
)
def slip_details(trees: Sequence[xr.DataTree]) -> Figure:
    (tree,) = trees
    figure = Figure(figsize=(4.5, 6))
    velocity, force, detached = figure.subplots(3, 1, sharex=True)
    slip = largest_slip(tree)
    if slip is not None:
        window = slip_window(slip, before=0.1, after=0.8)
        for axes, name in ((velocity, "velocity"), (detached, "detached_contacts")):
            draw_series(axes, tree, name, window=window, time_unit=1e-3, color="black")
        draw_series(force, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
        draw_series(force, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
        detached.set_xlabel(f"time after {window[0]:.4f} s (ms)")
        force.legend()
    velocity.set_ylabel("slider velocity (µm/s)")
    force.set_ylabel("force (µN)")
    detached.set_ylabel("detached contacts $N_d$")
    for letter, axes in zip("abc", (velocity, force, detached), strict=True):
        axes.set_title(f"({letter})", loc="left")
    return figure


@source_figure(
    "S22",
    "spring force for different delays, at first (left) and after 388 s (right)",
    ("S22a", "S22b", "S22c", "S22d"),
)
def delays(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 1.5 * len(trees) + 0.5))
    panels = shared_panels(figure, len(trees), 2)
    span = 12.0
    for letter, row, tree in zip("abcdefgh", panels, trees, strict=False):
        end = tree["time"].max().item()
        for axes, window in zip(row, ((0, span), (end - span, end)), strict=True):
            draw_series(axes, tree, "spring_force", window=window, color="black")
            axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.set_xlim(0, span)
        delay = configuration(tree).contacts.delay
        row[0].set_title(rf"({letter}) $\tau_d$ = {delay * 1e3:g} ms", loc="left")
        row[0].set_ylabel("$F_d$ (µN)")
        row[1].set_title(f"after {end - span:g} s", loc="left")
    for axes in panels[-1]:
        axes.set_xlabel("time (s)")
    return figure


@source_figure(
    "S23", "spring force for different dispersions of the thresholds", ("S23a", "S23b", "S23c")
)
def dispersions(trees: Sequence[xr.DataTree]) -> Figure:

    def width(tree: xr.DataTree) -> str:
        return rf"$\Delta f_s/f_s$ = {configuration(tree).contacts.threshold.relative_width:g}"

    return stacked(trees, width)


@source_figure(
    "S24", "slips of elastic sliders of 16 and 64 layers; insets: the whole cycle", ("S24a", "S24b")
)
def layers(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 3.4))
    panels = figure.subplots(1, 2)
    names = ("elastic_force", "spring_force")
    titles = ("mean elastic force $K(X_d - X_1)$", "force at the drive")
    for letter, axes, name, title in zip("ab", panels, names, titles, strict=True):
        inset = axes.inset_axes((0.45, 0.62, 0.53, 0.36))
        for tree, style in zip(trees, ("--", "-"), strict=True):
            count = configuration(tree).slider.layer_count
            color = RED if style == "--" else "black"
            line: dict[str, Any] = {"color": color, "linestyle": style}
            slips = group_of(tree, "slips")
            if slips.sizes["slip"]:
                start = slips["start_time"].values[0] - 3e-3
                draw_series(
                    axes,
                    tree,
                    name,
                    window=(start, start + 0.02),
                    time_unit=1e-3,
                    label=f"$N_l$ = {count}",
                    **line,
                )
            draw_series(inset, tree, name, window=(0, 6), linewidth=0.5, color=color)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.9 * (high - low))
        inset.tick_params(labelsize=6)
        inset.set_xlabel("time (s)", fontsize=6)
        axes.set(xlabel="time in the first slip (ms)", ylabel=f"({letter}) {title} (µN)")
        axes.legend(loc="lower left")
    return figure


@source_figure(
    "S28",
    "spring force for different viscosities of the film, and its first drop",
    ("S28a", "S28b", "S28c"),
)
def viscosities(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 3))
    whole, detail = figure.subplots(1, 2, width_ratios=[2, 1])
    for tree, style in zip(trees, ("-", "--", ":", "-."), strict=False):
        rate = configuration(tree).contacts.drag_rate
        label = rf"$\eta$ = {power_of_ten(rate)} s$^{{-1}}$"
        draw_series(whole, tree, "spring_force", linestyle=style, label=label)
        slip = largest_slip(tree)
        if slip is not None:
            start = slip["start_time"] - 5e-3
            draw_series(
                detail,
                tree,
                "spring_force",
                window=(start, start + 0.045),
                time_unit=1e-3,
                linestyle=style,
            )
    whole.set(xlabel="time (s)", ylabel="spring force $F_d$ (µN)")
    whole.legend()
    detail.set_xlabel("time in the first slip (ms)")
    return figure
