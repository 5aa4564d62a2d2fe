"""The largest slip of a run in close-up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mesoslip.analysis.slips import slips
from mesoslip.output.samples import times_of
from mesoslip.plots.axis import time_since
from mesoslip.plots.curves import curve, draw_curves
from mesoslip.plots.extent import EVERYTHING, Extent
from mesoslip.plots.style import CONTACT, SPRING, legend_above
from mesoslip.plots.trace import NAMES, driving_force_of, force_of, is_known


def largest_slip(tree: xr.DataTree, extent: Extent = EVERYTHING) -> xr.Dataset | None:
    """The slip with the largest drop of the spring force; None if there is no slip."""
    all_slips = slips(tree)
    starts = all_slips["start_time"].values
    inside = np.flatnonzero(
        (all_slips["realization_index"].values == extent.first)
        & (starts >= extent.start)
        & (starts <= extent.end)
    )
    if inside.size == 0:
        return None
    drops = all_slips["force_drop"].values[inside]
    return all_slips.isel(slip=inside[np.argmax(np.abs(drops))])


def slip_window(slip: xr.Dataset, before: float = 0.3, after: float = 2.0) -> tuple[float, float]:
    """Start and end [s] of a window around a slip; margins in units of its duration."""
    start, duration = slip["start_time"].item(), slip["duration"].item()
    return start - before * duration, start + (1 + after) * duration


def draw_slip(
    panels: Sequence[Axes],
    tree: xr.DataTree,
    slip: xr.Dataset,
    names: Sequence[str],
    extent: Extent = EVERYTHING,
    title: str = "largest slip",
) -> None:
    """Draw the forces during a slip, and variables of the trace below them.

    Parameters
    ----------
    panels
        Axes for the forces, and one for each variable.
    tree, slip
        The output, and a slip of its catalogue.
    names
        The variables.
    extent
        Realization, and number of intervals.
    title
        Title of the legend.
    """
    times = times_of(tree)
    low, high = slip_window(slip)
    near = Extent(extent.first, max(low, times[0]), min(high, times[-1]), parts=extent.parts)
    horizontal = time_since((near.start, near.end))
    force, *below = panels
    curves = []
    if is_known(tree, "contact_force"):
        curves.append(curve(tree, "contact_force", near, **CONTACT))
    if force_of(tree) == "elastic_force":
        label = "mean elastic force"
        curves.append(curve(tree, "elastic_force", near, color="tab:green", label=label))
    driving = driving_force_of(tree)
    style = SPRING if driving == "spring_force" else SPRING | {"label": NAMES[driving]}
    curves.append(curve(tree, driving, near, **style))
    name = "force" if driving == "spring_force" else NAMES[driving]
    draw_curves(force, curves, driving, horizontal, name)
    legend_above(force, columns=1, title=title)
    for axes, name in zip(below, names, strict=True):
        draw_curves(axes, [curve(tree, name, near, color="black")], name, horizontal)
