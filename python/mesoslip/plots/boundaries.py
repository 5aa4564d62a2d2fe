"""Theoretical boundaries of regimes in pictures of sweeps."""

from __future__ import annotations

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
# Number of points along a key between which lines are straight.
FINE_POINTS = 200
# Power of the excess over a boundary by which it is interpolated: growth rates on both sides of a
# boundary may differ by decades. In five maps of runs/maps, zeros of the growth rate between
# neighbours are wrong by 0.20 of their distance in the mean and 0.67 at most; by 0.28 and 0.94
# without it.
EXCESS_POWER = 0.25
# Distance of the legend from axes, in sizes of its font.
LINES_BELOW = 3.6


class Boundary(NamedTuple):
    """The line on which a measure, which may be positive, has a value."""

    measure: str
    value: float
    style: Literal["-", "--", "-.", ":"]
    label: str
    is_positive: bool = False

    def excess(self, data: xr.Dataset, keys: list[SweptKey]) -> Array:
        """The mean of the measure over realizations beyond the value, compressed, in the order of
        the keys."""
        dimensions = data[REGIME].isel(realization=0).dims
        mean = data[self.measure].mean("realization").transpose(*dimensions).values
        mean = mean[np.ix_(*(key.order for key in keys))]
        if self.is_positive and not np.any(mean <= 0):
            logarithm: Array = np.log(mean / self.value)
            return logarithm
        excess = mean - self.value
        compressed: Array = np.sign(excess) * np.abs(excess) ** EXCESS_POWER
        return compressed


BOUNDARIES = (
    Boundary("growth_rate", 0.0, "-.", "steady sliding turns linearly unstable"),
    Boundary("stable_out_of_step", 0.5, "-", "the same, contacts out of step"),
    Boundary("critical_stiffness_ratio", 1.0, "--", "$K = K^*$", is_positive=True),
    Boundary("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$", is_positive=True),
)


def draw_contours(axes: Axes, data: xr.Dataset, keys: list[SweptKey]) -> list[Line2D]:
    """Draw the boundaries that a map over two keys crosses; returns lines for a legend."""
    drawn = []
    for one in BOUNDARIES:
        if one.measure not in data:
            continue
        excess = one.excess(data, keys)
        if min(excess.shape) > 1 and np.any(excess < 0) and np.any(excess > 0):
            line = axes.contour(*_interpolated(keys, excess), [0], colors="black", linewidths=1.2)
            line.set_linestyle(one.style)
            drawn.append(one)
    return _handles(drawn)


def _interpolated(keys: list[SweptKey], excess: Array) -> tuple[Array, Array, Any]:
    """Axes and values of an excess between the points of a sweep, masked beside unknown values.

    The interpolation is cubic and monotone along the first key and then the second, over the axes
    as they are drawn: it changes its sign only between neighbours of different signs.
    """
    from scipy.interpolate import PchipInterpolator

    known = np.isfinite(excess)
    between = np.stack([np.where(known, excess, 0.0), known])
    fine = []
    for axis, key in enumerate(keys, 1):
        places = np.linspace(key.places[0], key.places[-1], FINE_POINTS)
        between = PchipInterpolator(key.places, between, axis=axis)(places)
        fine.append(key.values_at(places))
    values, is_known = np.swapaxes(between, 1, 2)
    return fine[0], fine[1], np.ma.masked_where(is_known < 1 - 1e-9, values)


def draw_crossings(axes: Axes, data: xr.Dataset, key: SweptKey) -> list[Line2D]:
    """Draw the boundaries along one key, interpolated linearly; returns lines for a legend."""
    drawn = []
    for one in BOUNDARIES:
        if one.measure not in data:
            continue
        excess = one.excess(data, [key])
        changes = np.flatnonzero(excess[1:] * excess[:-1] < 0)
        for left in changes:
            part = excess[left] / (excess[left] - excess[left + 1])
            crossing = key.places[left] + part * np.diff(key.places)[left]
            axes.axvline(
                float(key.values_at(crossing)), color="black", linestyle=one.style, linewidth=1.2
            )
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
