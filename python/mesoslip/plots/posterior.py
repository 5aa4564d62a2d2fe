"""Pictures of fits: the parameters, and what they predict beside what was measured."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mesoslip.plots.style import Canvas, canvas, styled

Array = NDArray[np.float64]

MEASURED = "black"
PREDICTED = "tab:blue"
# Short labels of keys, with a scale and the unit that it gives.
LABELS = {
    "contacts.static_force": ("$F_s$", 1e6, "µN"),
    "contacts.threshold.relative_width": ("$\\Delta f_s/f_s$", 1.0, ""),
    "contacts.delay": ("$\\tau_d$", 1e3, "ms"),
    "contacts.stiffness": ("$Nk$", 1.0, "N/m"),
    "contacts.back_force_ratio": ("$f_b/f_s$", 1.0, ""),
    "slider.stiffness": ("$K$", 1.0, "N/m"),
    "slider.mass": ("$M$", 1e3, "g"),
    "slider.damping_ratio": ("$\\eta_S/\\Omega_S$", 1.0, ""),
}
# Slips of a trace from which on there is a histogram.
BINS = 16
MOST_POINTS = 1500


def overview(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Pairs of parameters, the trace with what is predicted, and distributions of its slips."""
    with styled():
        names = list(tree["posterior"].data_vars)
        size = max(2, len(names))
        figure = canvas(figure, (7.0, 2.6 + 1.25 * size))
        whole = figure.add_gridspec(2, 1, height_ratios=[1.25 * size, 2.6])
        _pairs(figure, whole[0], tree)
        below = whole[1].subgridspec(2, 3, height_ratios=[1.2, 1])
        draw_trace(figure.add_subplot(below[0, :]), tree)
        _slips(figure, below, tree)
        figure.suptitle(tree.attrs.get("title", ""), x=0.01, ha="left", fontsize=8)
    return figure


def _label(name: str) -> tuple[str, float]:
    text, scale, unit = LABELS.get(name, (name.rpartition(".")[2].replace("_", " "), 1.0, ""))
    return (f"{text} ({unit})" if unit else text), scale


def _pairs(figure: Canvas, place: object, tree: xr.DataTree) -> None:
    """Draws of each pair of parameters, and of each its density beside the prior's."""
    group, prior = tree["posterior"].to_dataset(), tree["prior"].to_dataset()
    names = [str(name) for name in group.data_vars]
    grid = place.subgridspec(len(names), len(names))  # type: ignore[attr-defined]
    draws = {name: group[name].values.ravel() * _label(name)[1] for name in names}
    thin = slice(None, None, max(1, len(draws[names[0]]) // MOST_POINTS))
    for row, below in enumerate(names):
        for column, beside in enumerate(names[: row + 1]):
            axes = figure.add_subplot(grid[row, column])
            values = draws[beside]
            low, high = np.percentile(values, [0.1, 99.9])
            if row == column:
                axes.hist(values, 40, range=(low, high), density=True, color=PREDICTED)
                known = prior[beside].values.ravel() * _label(beside)[1]
                inside = np.mean((known >= low) & (known <= high)) / (high - low)
                axes.axhline(inside, color="0.5", linestyle=":", linewidth=0.8)
                axes.axvspan(*np.percentile(values, [5, 95]), color="0.9", zorder=0)
                axes.set_yticks([])
            else:
                axes.plot(values[thin], draws[below][thin], ".", color=PREDICTED, markersize=1.2)
                axes.set_ylim(*np.percentile(draws[below], [0.1, 99.9]))
            axes.set_xlim(low, high)
            axes.tick_params(labelsize=6)
            axes.xaxis.set_major_locator(MaxNLocator(3))
            if row == len(names) - 1:
                axes.set_xlabel(_label(beside)[0], fontsize=7)
            else:
                axes.set_xticklabels([])
            if column == 0 and row > 0:
                axes.set_ylabel(_label(below)[0], fontsize=7)
                axes.yaxis.set_major_locator(MaxNLocator(3))
            elif row != column:
                axes.set_yticklabels([])


def draw_trace(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the trace on the band of predicted ones."""
    observed = tree["observed_data"].to_dataset()["spring_force"]
    predicted = tree["posterior_predictive"].to_dataset()["spring_force"]
    bands = np.percentile(predicted.values[0], [5, 95], axis=0) * 1e6
    times = predicted["time"].values
    axes.fill_between(
        times, *bands, color=PREDICTED, alpha=0.35, linewidth=0, label="90 % of predictions"
    )
    axes.plot(times, predicted.values[0, 0] * 1e6, color=PREDICTED, linewidth=0.5, label="one")
    axes.plot(observed["time"], observed * 1e6, color=MEASURED, linewidth=0.6, label="measured")
    axes.set_xlim(times[0], times[-1])
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))
    axes.set_xlabel("time (s)")
    axes.set_ylabel("spring force (µN)")
    axes.legend(loc="upper right", ncols=3)


def _slips(figure: Canvas, grid: object, tree: xr.DataTree) -> None:
    """Distributions of the slips after the first of each trace."""
    groups = [tree[name].to_dataset() for name in ("observed_slips", "predicted_slips")]
    parts = [_later(group) for group in groups]
    titles = ("force before slips (µN)", "drop (µN)", "waiting time (s)")
    for column, title in enumerate(titles):
        axes = figure.add_subplot(grid[1, column])  # type: ignore[index]
        measured, predicted = (part[column] for part in parts)
        both = np.concatenate([measured, predicted])
        if both.size:
            low, high = np.percentile(both, [0.5, 99.5])
            edges = np.linspace(low, high if high > low else low + 1, BINS + 1)
            for values, style in (
                (predicted, {"color": PREDICTED, "alpha": 0.35, "label": "predicted"}),
                (
                    measured,
                    {"histtype": "step", "color": MEASURED, "label": "measured"},
                ),
            ):
                if values.size:
                    axes.hist(
                        np.clip(values, edges[0], edges[-1]),
                        edges.tolist(),
                        weights=np.full(values.size, 1 / values.size),
                        **style,
                    )
        axes.set_yticks([])
        axes.set_xlabel(title)
        if column == 0:
            axes.set_ylim(0, 1.5 * axes.get_ylim()[1])
            axes.legend(loc="upper left", ncols=2)


def _later(group: xr.Dataset) -> tuple[Array, Array, Array]:
    """Force before, drop, and waiting time of the slips after the first of each trace."""
    owner, start = group["trace"].values, group["start_time"].values
    later = np.diff(owner, prepend=-1) == 0
    before, after = group["force_before"].values, group["force_after"].values
    waiting = np.diff(start, prepend=np.nan)
    return 1e6 * before[later], 1e6 * np.abs(before - after)[later], waiting[later]
