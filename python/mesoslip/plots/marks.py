"""Marks in pictures of measured traces: slips, and impulses of the noise."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree
from mesoslip.plots.axis import HorizontalAxis
from mesoslip.plots.extent import Extent
from mesoslip.plots.style import BLUE, RED, YELLOW
from mesoslip.plots.trace_variables import UNITS
from mesoslip.quantities import scale_for

# Maximum number of slips or impulses that are marked: more would be a band.
MAX_MARKS = 2000


def draw_marks(
    axes: Axes, tree: Tree, name: str, extent: Extent, horizontal: HorizontalAxis
) -> bool:
    """Mark starts and ends of slips, and impulses, on the force of a measured trace; whether
    anything is marked."""
    root = tree.to_dataset()
    time, force = root["time"].values, root[name].values[0]
    window = extent.window(tree)
    inside = (time >= window[0]) & (time <= window[1])
    scale = scale_for(float(np.max(np.abs(force[inside]), initial=0.0)), UNITS[name])
    across = root[extent.horizontal[0]].values
    across = across if across.ndim == 1 else across[0]
    slips = group_of(tree, "slips")
    starts = slips["start_time"].values, slips["force_before"].values
    ends = slips["end_time"].values, slips["force_after"].values
    marks = [(*starts, "v", "start of a slip", RED), (*ends, "^", "end of a slip", BLUE)]
    if "noise" in tree.children and "impulse_time" in tree.children["noise"]:
        at = group_of(tree, "noise")["impulse_time"].values
        marks.append((at, np.interp(at, time, force), "x", "impulse, removed", YELLOW))
    found = False
    for at, level, marker, label, color in marks:
        shown = (at >= window[0]) & (at <= window[1])
        if not 0 < np.count_nonzero(shown) <= MAX_MARKS:
            continue
        place = np.interp(at[shown], time, across)
        axes.plot(
            (place - horizontal.origin) / horizontal.scale.size,
            level[shown] / scale.size,
            marker,
            color=color,
            markersize=3.5,
            markeredgewidth=0.8,
            label=label,
            zorder=3,
        )
        found = True
    return found
