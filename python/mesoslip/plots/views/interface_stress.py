"""View of the stress along an interface with a length, before and after an event."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.output.access import config_of, group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import times_of
from mesoslip.plots.style import BLUE, RED, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.plots.views.fronts import picture_of
from mesoslip.quantities import scale_for, with_unit


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:
    """Draw the force of each block on its contacts at the samples around an event or a window."""
    picture = picture_of(tree, options)
    times, config = times_of(tree), config_of(tree)
    low = int(np.searchsorted(times, picture.window[0], "right") - 1)
    # Blocks are at rest some half periods of the setup after an event.
    end = picture.window[1] + (3 * config.slider.quiet_time if options.extent.is_whole else 0.0)
    high = min(int(np.searchsorted(times, end)), times.size - 1)
    force = group_of(tree, "blocks")["block_contact_force"].isel(realization=picture.realization)
    scale = scale_for(picture.length, "m")
    for index, color, word in ((low, BLUE, "before"), (high, RED, "after")):
        values = np.asarray(force.isel(time=index).values)
        axes.plot(
            picture.places / scale.size,
            values / config.block_strengths,
            ".-",
            color=color,
            label=f"{word}, at {with_unit(float(times[index]), 's', 5)}",
        )
    axes.set_xlim(0, picture.length / scale.size)
    axes.axhline(0, color="0.8", zorder=0)
    axes.set(xlabel=scale.label("position, from the edge"), ylabel="stress/strength")
    titles(axes, tree)


VIEW = View(
    name="interface-stress",
    kind="run",
    summary="stress along an interface before and after an event",
    panel=draw_panel,
    options=frozenset({"realization", "start, end"}),
)
