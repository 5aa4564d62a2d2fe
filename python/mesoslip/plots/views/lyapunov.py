"""View of a Lyapunov exponent: growth of the distances of twins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.plots.style import BLUE, Canvas, curve_color, side_by_side, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.plots.views.return_map import draw_map
from mesoslip.quantities import with_error


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Distances of twins over time, and the return map of peaks beside them."""
    figure, (growth, peaks) = side_by_side(figure, (6.5, 3.2))
    draw_growth(growth, tree, options)
    draw_map(peaks, tree.to_dataset()["peak_force"].values)
    peaks.set_title("return map of peaks", loc="left")
    return figure


def draw_growth(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the distances of twins over the time since their start, and the mean growth."""
    data = tree.to_dataset()
    times, distances = data["growth_time"].values, data["distance"].values
    axes.semilogy(times.T, distances.T, color=BLUE, linestyle="-", linewidth=0.6, alpha=0.6)
    exponent, error = (float(tree[name]) for name in ("lyapunov_exponent", "lyapunov_error"))
    low, high = float(tree["min_distance"]), float(tree["max_distance"])
    axes.axhline(high, color="grey", linewidth=0.7, linestyle=":")
    if low > 0:
        axes.axhline(low, color="grey", linewidth=0.7, linestyle=":")
    if np.isfinite(exponent):
        middle = np.exp(np.mean(np.log(distances), axis=0))
        time = times.mean(axis=0)
        inside = (middle >= max(low, middle.min())) & (middle <= high)
        if inside.any():
            first = int(np.argmax(inside))
            line = middle[first] * np.exp(exponent * (time - time[first]))
            shown = line <= distances.max()
            label = rf"$\lambda$ = {with_error(exponent, error, '1/s')}"
            axes.semilogy(time[shown], line[shown], color="black", label=label)
            axes.legend()
    axes.set(xlabel="time since the start of a twin (s)", ylabel="distance")
    titles(axes, tree)


def draw_mean_growth(
    axes: Axes, trees: Sequence[DataTree], labels: Sequence[str], _: Options
) -> None:
    """Draw the mean growth of several outputs over each other."""
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        data = tree.to_dataset()
        mean = np.exp(np.mean(np.log(data["distance"].values), axis=0))
        time = data["growth_time"].values.mean(axis=0)
        axes.semilogy(time, mean, color=curve_color(number), label=label)
    axes.set_xlabel("time since the start of a twin (s)")
    axes.set_ylabel("distance, geometric mean of twins")


VIEW = View(
    name="lyapunov",
    kind="lyapunov",
    summary="distances of twins over time, and the return map of peaks",
    draw_all=draw,
    panel=draw_growth,
    compare_panel=draw_mean_growth,
)
