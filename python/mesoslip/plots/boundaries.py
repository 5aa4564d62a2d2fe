"""Theoretical boundaries of regimes in pictures of sweeps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from mesoslip.plots.sweep_axis import SweptKey

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# The measure in whose pictures the boundaries are drawn.
REGIME = "regime"
# Minimum number of points along a key for smooth lines, and number of interpolated points.
MIN_POINTS = 4
FINE_POINTS = 200
# Distance of the legend from axes, in sizes of its font.
LINES_BELOW = 3.6


class Boundary(NamedTuple):
    """The line on which a measure, which may be smooth or positive, has a value."""

    measure: str
    value: float
    style: Literal["-", "--", "-.", ":"]
    label: str
    is_smooth: bool = True
    is_positive: bool = False


BOUNDARIES = (
    Boundary("growth_rate", 0.0, "-.", "steady sliding turns linearly unstable"),
    Boundary("stable_out_of_step", 0.5, "-", "the same, contacts out of step", is_smooth=False),
    Boundary("critical_stiffness_ratio", 1.0, "--", "$K = K^*$", is_positive=True),
    Boundary("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$", is_positive=True),
)


def draw_contours(axes: Axes, data: xr.Dataset, keys: list[SweptKey]) -> list[Line2D]:
    """Draw the boundaries that a map over two keys crosses; returns lines for a legend."""
    dimensions = data[REGIME].dims[:2]
    drawn = []
    for one in BOUNDARIES:
        if one.measure not in data:
            continue
        values = data[one.measure].mean("realization").transpose(*dimensions).values
        values = np.ma.masked_invalid(values[np.ix_(*(key.order for key in keys))].T)
        if values.count() and values.min() < one.value < values.max():
            x, y, values, level = _interpolated(one, keys, values)
            line = axes.contour(x, y, values, [level], colors="black", linewidths=1.2)
            line.set_linestyle(one.style)
            drawn.append(one)
    return _handles(drawn)


def _interpolated(
    boundary: Boundary, keys: list[SweptKey], values: Any
) -> tuple[Array, Array, Any, float]:
    """Axes, values of a measure and level, interpolated between the points of a sweep.

    Cubic splines interpolate smooth measures that are known everywhere, positive ones by their
    logarithm, over the axes as they are drawn. Other measures are not interpolated.
    """
    from scipy.interpolate import RectBivariateSpline

    axes = [key.values[key.order] for key in keys]
    level = boundary.value
    if (
        not boundary.is_smooth
        or not np.isfinite(np.ma.filled(values, np.nan)).all()
        or min(values.shape) < MIN_POINTS
    ):
        return axes[0], axes[1], values, level
    if boundary.is_positive and values.min() > 0:
        values, level = np.log(values), math.log(level)
    places = [
        np.log(one) if key.is_logarithmic else one for one, key in zip(axes, keys, strict=True)
    ]
    fine = [np.linspace(one[0], one[-1], FINE_POINTS) for one in places]
    spline = RectBivariateSpline(places[1], places[0], np.asarray(values))
    between = spline(fine[1], fine[0])
    x, y = (np.exp(one) if key.is_logarithmic else one for one, key in zip(fine, keys, strict=True))
    return x, y, between, level


def draw_crossings(axes: Axes, data: xr.Dataset, key: SweptKey) -> list[Line2D]:
    """Draw the boundaries along one key, interpolated linearly; returns lines for a legend."""
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
    return _handles(drawn)


def _handles(drawn: list[Boundary]) -> list[Line2D]:
    return [Line2D([], [], color="black", linestyle=one.style, label=one.label) for one in drawn]


def add_legend(axes: Axes, handles: list[Line2D]) -> None:
    """Put the legend of boundaries below axes and the labels of their axis."""
    if handles:
        scale = axes.figure.figure.dpi_scale_trans
        below = ScaledTranslation(0, -LINES_BELOW * mpl.rcParams["font.size"] / 72, scale)
        axes.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(0, 0),
            bbox_transform=axes.transAxes + below,
            borderaxespad=0,
        )
