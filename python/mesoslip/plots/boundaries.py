"""Theoretical boundaries of regimes in pictures of sweeps."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mesoslip.plots.sweep_axis import SweptKey

# The measure in whose pictures the boundaries are drawn.
REGIME = "regime"


class Boundary(NamedTuple):
    """The line on which a measure has a value."""

    measure: str
    value: float
    style: Literal["-", "--", "-.", ":"]
    label: str


BOUNDARIES = (
    Boundary("growth_rate", 0.0, "-.", "steady sliding with delay turns unstable"),
    Boundary("stable_out_of_step", 0.5, "-", "the same, contacts out of step"),
    Boundary("critical_stiffness_ratio", 1.0, "--", "$K = K^*$"),
    Boundary("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$"),
)


def draw_contours(axes: Axes, data: xr.Dataset, keys: list[SweptKey]) -> None:
    """Draw the boundaries in a map over two keys, those whose measures pass their value."""
    dimensions = data[REGIME].dims[:2]
    x, y = (key.values[key.order] for key in keys)
    drawn = []
    for one in BOUNDARIES:
        if one.measure not in data:
            continue
        values = data[one.measure].mean("realization").transpose(*dimensions).values
        values = np.ma.masked_invalid(values[np.ix_(*(key.order for key in keys))].T)
        if values.count() and values.min() < one.value < values.max():
            line = axes.contour(x, y, values, [one.value], colors="black", linewidths=1.2)
            line.set_linestyle(one.style)
            drawn.append(one)
    _add_legend(axes, drawn)


def draw_crossings(axes: Axes, data: xr.Dataset, key: SweptKey) -> None:
    """Draw the boundaries along one key, interpolated between its values."""
    values = key.values[key.order]
    x = np.log(values) if key.is_logarithmic else values
    drawn = []
    for one in BOUNDARIES:
        if one.measure not in data:
            continue
        excess = data[one.measure].mean("realization").values[key.order] - one.value
        changes = np.flatnonzero(excess[1:] * excess[:-1] < 0)
        for left in changes:
            part = excess[left] / (excess[left] - excess[left + 1])
            crossing = x[left] + part * (x[left + 1] - x[left])
            crossing = math.exp(crossing) if key.is_logarithmic else crossing
            axes.axvline(crossing, color="black", linestyle=one.style, linewidth=1.2)
        if changes.size:
            drawn.append(one)
    _add_legend(axes, drawn)


def _add_legend(axes: Axes, drawn: list[Boundary]) -> None:
    handles = [Line2D([], [], color="black", linestyle=one.style, label=one.label) for one in drawn]
    if handles:
        axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0, -0.2), ncols=1)
