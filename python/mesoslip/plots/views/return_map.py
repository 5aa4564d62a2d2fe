"""View of the return map of a run: each peak of the force over the one before."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mesoslip.analysis.return_map import settled_peaks
from mesoslip.array_types import DataTree
from mesoslip.plots.style import BLUE, Canvas, canvas, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Distance of the peaks from the frame over their range, and maximum number of intervals of an axis.
MARGIN, TICKS = 0.05, 5


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """The return map in a square."""
    figure = canvas(figure, (3.6, 3.8))
    draw_panel(figure.subplots(), tree, options)
    return figure


def draw_panel(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw each peak of the second half of a run over the peak before it."""
    draw_map(axes, settled_peaks(tree, options.extent.realization or 0))
    titles(axes, tree)


def draw_map(axes: Axes, peaks: NDArray[np.float64]) -> None:
    """Draw peaks [N] over the ones before them, on equal axes."""
    scale = scale_for(float(np.max(np.abs(peaks), initial=0.0)) or 1.0, "N")
    shown = peaks / scale.size
    axes.plot(shown[:-1], shown[1:], ".", color=BLUE, markersize=3)
    if shown.size:
        low, high = float(shown.min()), float(shown.max())
        margin = MARGIN * (high - low or abs(high) or 1.0)
        ends = low - margin, high + margin
        axes.plot(ends, ends, color="grey", linewidth=0.7, zorder=1)
        axes.set(xlim=ends, ylim=ends, aspect="equal")
        axes.xaxis.set_major_locator(MaxNLocator(TICKS))
        axes.yaxis.set_major_locator(MaxNLocator(TICKS))
    axes.set(xlabel=scale.label("peak"), ylabel=scale.label("next peak"))


VIEW = View(
    name="return-map",
    kind="run",
    summary="each peak of the force over the one before",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"realization"}),
)
