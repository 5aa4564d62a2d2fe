"""Theoretical boundaries of regimes and of types of fronts in pictures of sweeps."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from contourpy import contour_generator
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from numpy.polynomial import Polynomial

from mesoslip.analysis.fronts import SLOW
from mesoslip.array_types import Array, Dataset
from mesoslip.plots.sweep_axis import SweptKey

# The measures in whose pictures boundaries are drawn.
REGIME, FRONT_TYPE = "regime", "front_type"
# Maximum ratio of the sizes of an excess on both sides of a boundary for a cubic through them; the
# power that compresses others, as growth rates on both sides of a boundary differ by decades; and
# number of points of a line between two edges.
MAX_RATIO = 30.0
COMPRESSION = 0.25
FINE_POINTS = 20
# Coefficients of a cubic relative to the largest that are rounding errors.
ROUNDING = 1e-9
# Distance of the legend from axes, in sizes of its font.
LINES_BELOW = 3.6


class Boundary(NamedTuple):
    """The line on which a measure, which may be smooth or positive, has a value; it is drawn into
    the picture of a choice."""

    measure: str
    value: float
    style: Literal["-", "--", "-.", ":"]
    label: str
    is_smooth: bool = True
    is_positive: bool = False
    choice: str = REGIME

    def excess(self, data: Dataset, keys: list[SweptKey]) -> Array:
        """The mean of the measure over realizations beyond the value, in the order of the keys; of
        a positive one in logarithms."""
        dimensions = data[self.choice].isel(realization=0).dims
        mean = data[self.measure].mean("realization").transpose(*dimensions).values
        mean = mean[np.ix_(*(key.order for key in keys))]
        excess: Array = mean - self.value
        if self.is_positive and not np.any(mean <= 0):
            excess = np.log(mean / self.value)
        return excess


BOUNDARIES = (
    Boundary("growth_rate", 0.0, "-.", "steady sliding loses linear stability"),
    Boundary("stable_dephased", 0.5, "-", "the same, dephased contacts", is_smooth=False),
    Boundary("critical_stiffness_ratio", 1.0, "--", "$K = K^*$", is_positive=True),
    Boundary("waiting_over_damping", 1.0, ":", r"$\tau_{ss} \eta_S = 1$", is_positive=True),
    Boundary(
        "steady_front_speed_ratio",
        1.0,
        "-",
        "steady front as fast as sound",
        is_positive=True,
        choice=FRONT_TYPE,
    ),
    Boundary(
        "steady_front_speed_ratio",
        SLOW,
        "--",
        "a tenth of that",
        is_positive=True,
        choice=FRONT_TYPE,
    ),
)


def _boundaries(data: Dataset, choice: str) -> list[Boundary]:
    """The boundaries in the picture of a choice whose measures a sweep has."""
    return [one for one in BOUNDARIES if one.choice == choice and one.measure in data]


def boundary_measures(names: list[str]) -> set[str]:
    """Measures of a sweep that are drawn as boundaries, into the pictures of its others."""
    return {one.measure for one in BOUNDARIES if one.choice in names}


def draw_contours(axes: Axes, data: Dataset, choice: str, keys: list[SweptKey]) -> list[Line2D]:
    """Draw the boundaries that the map of a choice crosses, each edge between different signs once;
    returns lines for a legend."""
    drawn = []
    for one in _boundaries(data, choice):
        lines = _lines(one, one.excess(data, keys), keys)
        if lines:
            curves = [_curve(line, keys) for line in lines]
            contour = ContourSet(axes, [0.0], [curves], colors="black", linewidths=1.2)
            contour.set_linestyle(one.style)
            drawn.append(one)
    return _handles(drawn)


def _lines(boundary: Boundary, excess: Array, keys: list[SweptKey]) -> list[Array]:
    """Lines between points of different signs, as places of shape (vertices, 2) on the edges
    between neighbours; beside unknown values there are none."""
    if min(excess.shape) < 2:
        return []
    # The lines of signs cross the edges in their middles.
    signs = np.ma.masked_array(np.where(excess < 0, -1.0, 1.0), np.isnan(excess)).T
    found = []
    for line in contour_generator(z=signs, corner_mask=False).lines(0.0):
        vertices = []
        for column, row in np.asarray(line).tolist():
            left, low = math.floor(column), math.floor(row)
            x, y = keys[0].places[left], keys[1].places[low]
            if column > left:
                x = _crossing(boundary, keys[0].places, excess[:, low], left)
            else:
                y = _crossing(boundary, keys[1].places, excess[left], low)
            vertices.append((x, y))
        found.append(np.array(vertices))
    return found


def _crossing(boundary: Boundary, places: Array, excess: Array, left: int) -> float:
    """Place between a point and the next, of another sign, at which the excess is 0.

    It is that of a cubic spline, where that is monotone and the sizes of the excess on both sides
    are similar. Otherwise it is that of a straight line, in the compressed excess if it is smooth.
    """
    from scipy.interpolate import CubicSpline

    start, stop = places[left : left + 2]
    low, high = excess[left : left + 2]
    if boundary.is_smooth and low and high:
        near = excess[max(left - 1, 0) : left + 3]
        sizes = [np.nanmax(np.abs(near[near * one > 0])) for one in (low, high)]
        if np.isfinite(excess).all() and max(sizes) <= MAX_RATIO * min(sizes):
            # In a unit interval; rounding errors of a straight line would have turns of their own.
            powers = CubicSpline(places, excess).c[::-1, left] * (stop - start) ** np.arange(4)
            cubic = Polynomial(powers).trim(ROUNDING * np.abs(powers).max())
            turns, zeros = (
                [float(one.real) for one in each.roots() if np.isreal(one)]
                for each in (cubic.deriv(), cubic)
            )
            inside = [one for one in zeros if 0 < one < 1]
            if len(inside) == 1 and not any(0 < one < 1 for one in turns):
                return float(start + (stop - start) * inside[0])
        low, high = (math.copysign(abs(one) ** COMPRESSION, one) for one in (low, high))
    return float(start + (stop - start) * low / (low - high))


def _curve(line: Array, keys: list[SweptKey]) -> Array:
    """A curve through places, in the units of the axes; between two of them it stays in the
    rectangle that they span, as it is monotone."""
    from scipy.interpolate import PchipInterpolator

    sizes = np.array([np.ptp(key.places) for key in keys])
    is_new = np.append(True, np.any(np.diff(line, axis=0) != 0, axis=1))
    line = line[is_new]
    if len(line) < 3:
        fine = line
    else:
        is_closed = np.array_equal(line[0], line[-1])
        whole = np.concatenate([line[-2:-1], line, line[1:2]]) if is_closed else line
        along = np.append(0.0, np.cumsum(np.hypot(*(np.diff(whole, axis=0) / sizes).T)))
        ends = along[1:-1] if is_closed else along
        steps = np.linspace(ends[:-1], ends[1:], FINE_POINTS, endpoint=False, axis=1).ravel()
        fine = PchipInterpolator(along, whole)(np.append(steps, ends[-1]))
    return np.column_stack([key.values_at(one) for key, one in zip(keys, fine.T, strict=True)])


def draw_crossings(axes: Axes, data: Dataset, choice: str, key: SweptKey) -> list[Line2D]:
    """Draw the boundaries of a choice along one key; returns lines for a legend."""
    drawn = []
    for one in _boundaries(data, choice):
        excess = one.excess(data, [key])
        with np.errstate(invalid="ignore"):
            changes = np.flatnonzero((excess[1:] < 0) != (excess[:-1] < 0))
        changes = changes[np.isfinite(excess[changes] + excess[changes + 1])]
        for left in changes.tolist():
            crossing = key.values_at(np.array(_crossing(one, key.places, excess, left)))
            axes.axvline(float(crossing), color="black", linestyle=one.style, linewidth=1.2)
        if changes.size:
            drawn.append(one)
    return _handles(drawn)


def _handles(drawn: list[Boundary]) -> list[Line2D]:
    return [Line2D([], [], color="black", linestyle=one.style, label=one.label) for one in drawn]


def add_legend(axes: Axes, handles: list[Line2D], title: str) -> None:
    """Put the legend of boundaries below axes and the labels of their axis."""
    scale = axes.figure.figure.dpi_scale_trans
    below = ScaledTranslation(0, -LINES_BELOW * mpl.rcParams["font.size"] / 72, scale)
    axes.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0, 0),
        bbox_transform=axes.transAxes + below,
        borderaxespad=0,
        title=title,
        alignment="left",
    )
