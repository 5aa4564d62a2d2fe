"""Curves of traces in the source's units."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from mesoslip.plots.extent import EVERYTHING, line

# Units of variables, in SI: µN, µm/s, 1.
UNITS = {
    "spring_force": 1e-6,
    "contact_force": 1e-6,
    "elastic_force": 1e-6,
    "velocity": 1e-6,
    "detached_contacts": 1.0,
}


def draw_series(
    axes: Axes,
    tree: xr.DataTree,
    name: str,
    *,
    window: tuple[float, float] | None = None,
    time_unit: float = 1.0,
    **style: Any,
) -> None:
    """Draw a variable against time, or against the time since the start of a window [s].

    Only samples that a picture can show are read and drawn. The unit of the time axis is in s.
    """
    start = 0.0 if window is None else window[0]
    times, values = line(tree, ("time", name), EVERYTHING, window or EVERYTHING.window(tree))
    axes.plot((times - start) / time_unit, values / UNITS[name], **style)
