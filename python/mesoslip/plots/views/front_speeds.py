"""View of the speeds of fronts of an interface with a length against the stress before them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.fronts import fronts_of
from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree
from mesoslip.plots.style import BLUE, RED, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.simulation.fronts import ARRESTED, ARRESTS


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the speed over that of sound against the stress over strength before the front."""
    fronts = fronts_of(tree, realization=options.extent.realization).fronts
    known = np.isfinite(fronts["speed_ratio"])
    if not known.any():
        raise FileError("no front of the output has a speed: none passes two blocks")
    stopped = fronts["arrest"] == ARRESTS.index(ARRESTED)
    for mine, color, marker, label in (
        (known & ~stopped, BLUE, "o", "met another or reached an end"),
        (known & stopped, RED, "x", "arrested"),
    ):
        axes.plot(
            fronts["stress_ratio_before"][mine],
            fronts["speed_ratio"][mine],
            marker,
            color=color,
            markersize=4,
            linestyle="none",
            label=label,
        )
    axes.axhline(1, color="0.6", linewidth=0.8, zorder=0)
    axes.set(yscale="log", xlabel="stress/strength at the start of the slips", ylabel="speed/c")
    titles(axes, tree)


VIEW = View(
    name="front-speeds",
    kind="run",
    summary="speeds of fronts of an interface against the stress before them",
    panel=draw_panel,
    options=frozenset({"realization"}),
    takes_arrays=True,
)
