"""View of the return map of a run: each peak of the force over the one before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.return_map import settled_peaks
from mesoslip.plots.style import BLUE, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

if TYPE_CHECKING:
    import xarray as xr


def draw_panel(axes: Axes, tree: xr.DataTree, options: Options) -> None:
    """Draw each peak of the second half of a run over the peak before it."""
    draw_map(axes, settled_peaks(tree, options.extent.realization or 0))
    titles(axes, tree)


def draw_map(axes: Axes, peaks: NDArray[np.float64]) -> None:
    """Draw peaks [N] over the ones before them."""
    scale = scale_for(float(np.max(np.abs(peaks), initial=0.0)) or 1.0, "N")
    shown = peaks / scale.size
    axes.plot(shown[:-1], shown[1:], ".", color=BLUE, markersize=3)
    if shown.size:
        ends = [shown.min(), shown.max()]
        axes.plot(ends, ends, color="grey", linewidth=0.7)
    axes.set_xlabel(scale.label("peak"))
    axes.set_ylabel(scale.label("next peak"))


VIEW = View(
    name="return-map",
    kind="run",
    summary="each peak of the force over the one before",
    panel=draw_panel,
    options=frozenset({"realization"}),
)
