"""View of the lengths of events of an interface against the force of the drive."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.fronts import fronts_of, residual_of, static_balance
from mesoslip.output.access import config_of
from mesoslip.output.arrays import Tree
from mesoslip.plots.style import BLUE, RED, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for
from mesoslip.simulation.fronts import KINDS


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the length of each event over the force before it, and the static balance."""
    found, config = fronts_of(tree, realization=options.extent.realization), config_of(tree)
    events, slider = found.events, config.slider
    length = slider.block_spacing * slider.block_count
    scale = scale_for(config.contacts.static_force, "N")
    for value, (kind, color, marker) in enumerate(zip(KINDS, (BLUE, RED), "os", strict=True)):
        mine = events["kind"] == value
        axes.plot(
            events["spring_force"][mine] / scale.size,
            events["length"][mine] / length,
            marker,
            color=color,
            markersize=4,
            linestyle="none",
            label={"precursor": "precursors", "whole": "whole events"}[kind],
        )
    residual = residual_of(tree, options.extent.realization)
    forces = None if math.isnan(residual) else static_balance(config, residual)
    if forces is not None:
        axes.plot(
            forces / scale.size,
            np.arange(slider.block_count) / slider.block_count,
            color="black",
            linestyle="-",
            label=f"static balance, {residual:.2f} of the strength behind",
        )
    axes.set_xlabel(scale.label("force of the drive before the event"))
    axes.set_ylabel("detached length/length of the interface")
    titles(axes, tree)


VIEW = View(
    name="precursors",
    kind="run",
    summary="lengths of partial and whole events of an interface against the force of the drive",
    panel=draw_panel,
    options=frozenset({"realization"}),
    takes_arrays=True,
)
