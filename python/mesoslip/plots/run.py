"""Pictures of runs: what happened, against time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.slips import slips
from mesoslip.output.layout import group_of
from mesoslip.plots.style import CONTACT, SPRING, Canvas, canvas, styled

Array = NDArray[np.float64]

# Scale and unit in which a variable is drawn.
SCALES = {
    "spring_force": (1e6, "µN"),
    "contact_force": (1e6, "µN"),
    "elastic_force": (1e6, "µN"),
    "velocity": (1e6, "µm/s"),
    "detached_contacts": (1.0, ""),
}


# Parts of the time axis of which a line shows the least and the greatest value, where it has more
# samples than that: several for each dot of a picture.
MOST_PARTS = 4000
# Samples that are read at a time.
BLOCK = 2**20


@dataclass(frozen=True)
class Samples:
    """Samples of a realization in the order of their times [s], which need not be in memory."""

    data: xr.Dataset
    dimension: str
    times: Array
    start: int = 0

    def inside(self, window: tuple[float, float]) -> tuple[int, int]:
        """Places of the first sample of a window of time, and of the first one after it."""
        first = np.searchsorted(self.times, window[0], "left")
        return int(first), int(np.searchsorted(self.times, window[1], "right"))

    def values(self, name: str, first: int, after: int) -> Array:
        """Values of a variable."""
        places = slice(self.start + first, self.start + after)
        values: Array = self.data[name].isel({self.dimension: places}).values.astype(float)
        return values


def samples(tree: xr.DataTree, realization: int = 0) -> list[Samples]:
    """Samples of a realization: those of the whole trace, and the finer ones of its slips."""
    root = tree.to_dataset().isel(realization=realization)
    parts = [Samples(root, "time", root["time"].values)]
    if "slip_traces" in tree.children:
        fine = group_of(tree, "slip_traces")
        times, start = fine["sample_time"].values, 0
        if tree.sizes["realization"] > 1:
            places = fine["realization_index"].values
            start, end = np.searchsorted(places, (realization, realization + 1))
            times = times[start:end]
        parts.append(Samples(fine, "sample", times, int(start)))
    return parts


def series(
    tree: xr.DataTree,
    name: str,
    realization: int = 0,
    window: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[Array, Array]:
    """Times [s] and values of a variable of a realization, with the finer samples of its slips."""
    all_times, all_values = [], []
    for part in samples(tree, realization):
        first, after = part.inside(window)
        all_times.append(part.times[first:after])
        all_values.append(part.values(name, first, after))
    times, values = np.concatenate(all_times), np.concatenate(all_values)
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def envelope(parts: list[Samples], name: str, window: tuple[float, float]) -> tuple[Array, Array]:
    """Least and greatest value of a variable in each part of a window, one after the other.

    Parameters
    ----------
    parts
        Samples of a realization.
    name
        The variable.
    window
        Start and end [s].

    Returns
    -------
    times, values
        Two points for each of at most `MOST_PARTS` parts in which there are samples.
    """
    start, end = window
    scale = MOST_PARTS / max(end - start, np.finfo(float).tiny)
    low, high = np.full(MOST_PARTS, np.nan), np.full(MOST_PARTS, np.nan)
    for part in parts:
        first, after = part.inside(window)
        for at in range(first, after, BLOCK):
            to = min(at + BLOCK, after)
            place = ((part.times[at:to] - start) * scale).astype(int)
            place = np.minimum(place, MOST_PARTS - 1)
            values = part.values(name, at, to)
            begins = np.flatnonzero(np.diff(place, prepend=-1))
            where = place[begins]
            low[where] = np.fmin(low[where], np.fmin.reduceat(values, begins))
            high[where] = np.fmax(high[where], np.fmax.reduceat(values, begins))
    there = np.flatnonzero(np.isfinite(low))
    times = start + (there + 0.5) / scale
    return np.repeat(times, 2), np.stack([low[there], high[there]], axis=1).ravel()


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

    Only what a picture can show is drawn, and only that is read.

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
    parts = samples(tree)
    start = 0.0 if window is None else window[0]
    if window is None:
        window = (float(parts[0].times[0]), float(parts[0].times[-1]))
    if sum(np.subtract(*part.inside(window)[::-1]) for part in parts) > 4 * MOST_PARTS:
        times, values = envelope(parts, name, window)
    else:
        times, values = series(tree, name, window=window)
    axes.plot((times - start) / time_unit, values * SCALES[name][0], **style)


def is_known(tree: xr.DataTree, name: str) -> bool:
    """Whether a trace has a variable: a measured one may not."""
    return bool(np.isfinite(tree[name].isel(realization=0, time=0).item()))


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


def draw_force(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the spring force against time."""
    draw_series(axes, tree, "spring_force", color="black")
    axes.set_ylabel("spring force (µN)")
    axes.set_xlabel("time (s)")
    axes.set_xlim(min(0, tree["time"].min().item()), tree["time"].max().item())
    title = tree.attrs.get("title", "")
    if tree.attrs.get("complete") == "false":
        title = f"{title} ({tree.attrs['comment']})"
    axes.set_title(title, loc="left")


def overview(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Spring force with a slip in an inset, velocity, and detached contacts against time."""
    with styled():
        below = {"velocity": "velocity (µm/s)", "detached_contacts": "detached contacts"}
        below = {name: label for name, label in below.items() if is_known(tree, name)}
        figure = canvas(figure, (6.5, 2.8 + 1.2 * len(below)))
        panels = figure.subplots(
            1 + len(below),
            1,
            sharex=True,
            gridspec_kw={"height_ratios": [2.4, *([1] * len(below))]},
        )
        force, *others = np.atleast_1d(panels)
        draw_force(force, tree)
        for axes, (name, label) in zip(others, below.items(), strict=True):
            draw_series(axes, tree, name, color="black")
            axes.set_ylabel(label)
            axes.set_xlabel("time (s)")
        for axes in (force, *others)[:-1]:
            axes.set_xlabel("")
        slip = largest_slip(tree)
        if slip is not None:
            low, high = force.get_ylim()
            force.set_ylim(low, high + 0.75 * (high - low))
            inset = force.inset_axes((0.3, 0.60, 0.45, 0.38))
            window = slip_window(slip)
            if is_known(tree, "contact_force"):
                draw_series(inset, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
            draw_series(inset, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
            inset.set_xlabel(f"time after {window[0]:.3f} s (ms)", fontsize=7)
            inset.set_ylabel("force (µN)", fontsize=7)
            inset.tick_params(labelsize=7)
            inset.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
