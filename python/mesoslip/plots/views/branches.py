"""View of branches: amplitude and period over a parameter, up and down."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.style import Canvas, canvas, legend_above, titles
from mesoslip.plots.sweep_axis import DIRECTION_STYLES, SweptKey, scale_of
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Ratio of the amplitudes of the two directions from which they are different motions.
DIFFERENT = 2.0
IRREGULAR = 2
# Room above the maximum, as a fraction of it.
HEADROOM = 0.08


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Amplitude and period of the settled motion over the parameter."""
    data, axis = _data(tree)
    figure = canvas(figure, (6.5, 5.0))
    amplitude, period = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    draw_amplitude(amplitude, tree, options)
    amplitude.set_xlabel("")
    values = data["period"].values
    scale = scale_for(float(np.nanmax(values, initial=0.0)) or 1.0, "s")
    for row, (_, style) in enumerate(DIRECTION_STYLES.items()):
        period.plot(axis.values, values[row] / scale.size, linestyle="", **style)
    period.set_ylabel(scale.label("period"))
    _begin_at_zero(period, values / scale.size)
    period.set_xlabel(axis.label)
    return figure


def draw_amplitude(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the amplitude over the parameter, with the linear boundary and hysteresis."""
    data, axis = _data(tree)
    ratio, motion = data["amplitude_ratio"].values, data["motion"].values
    for row, (direction, style) in enumerate(DIRECTION_STYLES.items()):
        axes.plot(axis.values, ratio[row], linewidth=0.7, label=direction, **style)
        irregular = motion[row] == IRREGULAR
        axes.plot(
            axis.values[irregular],
            ratio[row][irregular],
            linestyle="",
            marker="o",
            markersize=9,
            markerfacecolor="none",
            color=style["color"],
            label="irregular" if row == 0 else None,
        )
    _mark_hysteresis(axes, axis.values, ratio)
    _mark_boundary(axes, axis.values, data["growth_rate"].values)
    if "end_value" in data:
        _mark_ends(axes, data)
    if axis.is_logarithmic:
        logarithmic(axes, "x")
    axes.set_ylabel("amplitude over $F_s$")
    _begin_at_zero(axes, ratio)
    axes.set_xlabel(axis.label)
    titles(axes, tree, beside_legend=True)
    legend_above(axes)


def _begin_at_zero(axes: Axes, values: Array) -> None:
    """Begin the axis at 0, and leave room above the maximum."""
    axes.set_ylim(0, (1 + HEADROOM) * float(np.nanmax(values, initial=0.0)) or None)


def _data(tree: DataTree) -> tuple[Dataset, SweptKey]:
    data = tree.to_dataset()
    return data, SweptKey.of(data[tree.attrs["continued_key"]])


def _mark_hysteresis(axes: Axes, values: Array, ratio: Array) -> None:
    """Shade where the directions differ."""
    low, high = ratio.min(axis=0), ratio.max(axis=0)
    differs = np.flatnonzero(high > DIFFERENT * np.maximum(low, 1e-12))
    for number, at in enumerate(differs):
        left = values[at] if at == 0 else np.sqrt(values[at] * values[at - 1])
        right = values[at] if at == len(values) - 1 else np.sqrt(values[at] * values[at + 1])
        axes.axvspan(
            left,
            right,
            color="0.9",
            linewidth=0,
            zorder=0,
            label="directions differ" if number == 0 else None,
        )


def _mark_boundary(axes: Axes, values: Array, growth: Array) -> None:
    """Mark where smooth sliding changes its linear stability."""
    unstable = growth > 0
    known = np.isfinite(growth[1:]) & np.isfinite(growth[:-1])
    for number, at in enumerate(np.flatnonzero((unstable[1:] != unstable[:-1]) & known)):
        axes.axvline(
            float(np.sqrt(values[at] * values[at + 1])),
            color="black",
            linestyle="--",
            label="linear stability of smooth sliding" if number == 0 else None,
        )


def _mark_ends(axes: Axes, data: Dataset) -> None:
    """Mark where oscillations end in smooth sliding, up to their last amplitude."""
    scale = scale_of(data[data.attrs["continued_key"]])
    styles = list(DIRECTION_STYLES.values())
    for end in range(data.sizes["end"]):
        one = data.isel(end=end)
        value = (one["end_value"].item() + one["end_beyond"].item()) / 2 / scale.size
        axes.plot(
            [value, value],
            [0, one["end_amplitude_ratio"].item()],
            color=styles[one["end_direction"].item()]["color"],
            linestyle=":",
            label="end of the oscillation" if end == 0 else None,
        )


VIEW = View(
    name="branches",
    kind="branches",
    summary="amplitude and period over the parameter",
    draw_all=draw,
    panel=draw_amplitude,
)
