"""Pictures of runs: what happened, against time."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mesoslip.analysis.slips import slips
from mesoslip.output.layout import group_of
from mesoslip.plots.style import CONTACT, SPRING, STYLE

Array = NDArray[np.float64]

# Scale and unit in which a variable is drawn.
SCALES = {
    "spring_force": (1e6, "µN"),
    "contact_force": (1e6, "µN"),
    "elastic_force": (1e6, "µN"),
    "velocity": (1e6, "µm/s"),
    "detached_contacts": (1.0, ""),
}


def series(tree: xr.DataTree, name: str, realization: int = 0) -> tuple[Array, Array]:
    """Times [s] and values of a variable of a realization, with the finer samples of its slips."""
    root = tree.to_dataset().isel(realization=realization)
    times, values = root["time"].values, root[name].values.astype(float)
    if "slip_traces" in tree.children:
        fine = group_of(tree, "slip_traces")
        mine = fine["realization_index"].values == realization
        times = np.concatenate([times, fine["sample_time"].values[mine]])
        values = np.concatenate([values, fine[name].values[mine].astype(float)])
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
    return times, values


def draw_series(
    axes: Axes,
    tree: xr.DataTree,
    name: str,
    *,
    window: tuple[float, float] | None = None,
    time_unit: float = 1.0,
    **style: Any,
) -> None:
    """Draw a variable against time, or against the time since a window's start.

    Parameters
    ----------
    axes, tree, name
        Where, of which output, and which variable.
    window
        Start and end [s]; everything by default.
    time_unit
        Unit of the time axis [s].
    style
        Of the line.
    """
    times, values = series(tree, name)
    start = 0.0
    if window is not None:
        start, end = window
        inside = (times >= start) & (times <= end)
        times, values = times[inside], values[inside]
    axes.plot((times - start) / time_unit, values * SCALES[name][0], **style)


def largest_slip(tree: xr.DataTree) -> xr.Dataset | None:
    """The slip with the greatest drop of the spring force; None if there is no slip."""
    all_slips = slips(tree)
    mine = np.flatnonzero(all_slips["realization_index"].values == 0)
    if mine.size == 0:
        return None
    drops = all_slips["force_drop"].values[mine]
    return all_slips.isel(slip=mine[np.argmax(drops)])


def slip_window(slip: xr.Dataset, before: float = 0.3, after: float = 2.0) -> tuple[float, float]:
    """Start and end [s] of a window around a slip, in parts of its duration."""
    start, length = slip["start_time"].item(), slip["slip_time"].item()
    return start - before * length, start + (1 + after) * length


def overview(tree: xr.DataTree) -> Figure:
    """Spring force with a slip in an inset, velocity, and detached contacts against time."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 5.2))
        force, velocity, detached = figure.subplots(
            3, 1, sharex=True, gridspec_kw={"height_ratios": [2.4, 1, 1]}
        )
        draw_series(force, tree, "spring_force", color="black")
        force.set_ylabel("spring force (µN)")
        draw_series(velocity, tree, "velocity", color="black")
        velocity.set_ylabel("velocity (µm/s)")
        draw_series(detached, tree, "detached_contacts", color="black")
        detached.set_ylabel("detached contacts")
        detached.set_xlabel("time (s)")
        detached.set_xlim(0, tree["time"].max().item())

        slip = largest_slip(tree)
        if slip is not None:
            low, high = force.get_ylim()
            force.set_ylim(low, high + 0.75 * (high - low))
            inset = force.inset_axes((0.3, 0.60, 0.45, 0.38))
            window = slip_window(slip)
            draw_series(inset, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
            draw_series(inset, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
            inset.set_xlabel(f"time after {window[0]:.3f} s (ms)", fontsize=7)
            inset.set_ylabel("force (µN)", fontsize=7)
            inset.tick_params(labelsize=7)
            inset.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        title = tree.attrs.get("title", "")
        if tree.attrs.get("complete") == "false":
            title = f"{title} ({tree.attrs['comment']})"
        force.set_title(title, loc="left")
    return figure
