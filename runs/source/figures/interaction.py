"""Figures of contacts that interact."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from matplotlib.figure import Figure
from mesoslip.output.access import group_of
from mesoslip.plots.style import CONTACT, SPRING
from outputs import configuration

from figures.base import source_figure
from figures.panels import stacked
from figures.traces import draw_series


@source_figure(
    "S25",
    "spring force for different strengths of the interaction",
    ("S25a", "S25b", "S25c", "S25d"),
)
def interactions(trees: Sequence[xr.DataTree]) -> Figure:
    return stacked(trees, _strength)


@source_figure(
    "S26",
    "detached contacts in the first slip for different strengths of the interaction",
    ("S25a", "S25b", "S25c", "S25d"),
)
def detaching(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 4.2))
    for letter, axes, tree in zip("abcd", figure.subplots(2, 2).flat, trees, strict=True):
        draw_series(
            axes, tree, "detached_contacts", window=_first_slip(tree), time_unit=1e-3, color="black"
        )
        sizes = group_of(tree, "avalanches")["size"].values
        axes.set_title(f"({letter}) {_strength(tree)}; largest: {sizes.max()}", loc="left")
        axes.set(ylabel="$N_d$", xlabel="time in the first slip (ms)")
    return figure


@source_figure(
    "S27",
    "spring and contact force in the first slip for different strengths of the interaction",
    ("S25a", "S25b", "S25c", "S25d"),
)
def interacting_slips(trees: Sequence[xr.DataTree]) -> Figure:
    figure = Figure(figsize=(6.5, 4.2))
    all_axes = figure.subplots(2, 2).flat
    for letter, axes, tree in zip("abcd", all_axes, trees, strict=True):
        window = _first_slip(tree)
        draw_series(axes, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
        draw_series(axes, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
        axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
        axes.set_title(f"({letter}) {_strength(tree)}", loc="left")
        axes.set(ylabel="force (µN)", xlabel="time in the first slip (ms)")
    all_axes[0].legend()
    return figure


def _strength(tree: xr.DataTree) -> str:
    interaction = configuration(tree).interaction
    return rf"$\xi$ = {interaction.strength if interaction is not None else 0:g}"


def _first_slip(tree: xr.DataTree) -> tuple[float, float]:
    """Window from 2 ms before to 30 ms after the start of the first slip [s]."""
    start = group_of(tree, "slips")["start_time"].values[0]
    return start - 2e-3, start + 3e-2
