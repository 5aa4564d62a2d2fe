"""View of a fit: parameters, and predicted traces beside the measured one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.output.access import trace_suffixes
from mesoslip.plots.extent import max_size
from mesoslip.plots.key_names import plain
from mesoslip.plots.parameter_pairs import draw_pairs
from mesoslip.plots.printing import current, is_narrow
from mesoslip.plots.style import BLUE, Canvas, canvas, legend_above
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

MEASURED = "black"
PREDICTED = BLUE
# Bins of the histograms of slips.
BINS = 16


def draw(tree: DataTree, _: Options, figure: Canvas | None) -> Canvas:
    """Pairs of parameters, the measured and predicted traces, and distributions of their slips."""
    names = list(tree["posterior"].data_vars)
    size, traces = max(2, len(names)), trace_suffixes(tree)
    is_stacked = is_narrow(figure)
    heights = [(0.8 if is_stacked else 1.25) * size, *(2.6 for _ in traces)]
    figure = canvas(figure, (3.4 if is_stacked else 7.0, sum(heights)))
    whole = figure.add_gridspec(1 + len(traces), 1, height_ratios=heights)
    draw_pairs(figure, whole[0], tree)
    for number, after in enumerate(traces, 1):
        below = whole[number].subgridspec(2, 3, height_ratios=[1.1, 1])
        axes = figure.add_subplot(below[0, :])
        _draw_one(axes, tree, after)
        if len(traces) > 1:
            axes.set_title(plain(tree[f"observed_data{after}"].attrs["title"]), loc="left")
        _slips(figure, [below[1, column] for column in range(3)], tree, after)
    if current().title is None:
        figure.suptitle(plain(tree.attrs.get("title", "")), x=0.01, ha="left")
    return figure


def draw_trace(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the measured trace, the first of several, over the band of predicted ones."""
    _draw_one(axes, tree, "")


def _draw_one(axes: Axes, tree: DataTree, after: str) -> None:
    """Draw a measured trace, whose groups have names with a suffix."""
    observed = tree[f"observed_data{after}"].to_dataset()["spring_force"]
    predicted = tree[f"posterior_predictive{after}"].to_dataset()["spring_force"]
    scale = scale_for(max_size(observed.values, predicted.values), "N")
    traces, times = predicted.values[0] / scale.size, predicted["time"].values
    band = np.percentile(traces, [5, 95], axis=0)
    label = "90 % of predicted traces"
    axes.fill_between(times, *band, color=PREDICTED, alpha=0.35, linewidth=0, label=label)
    axes.plot(times, traces[0], color=PREDICTED, linewidth=0.5, label="one predicted trace")
    axes.plot(
        observed["time"], observed / scale.size, color=MEASURED, linewidth=0.6, label="measured"
    )
    axes.set(xlim=(times[0], times[-1]), xlabel="time (s)", ylabel=scale.label("spring force"))
    if is_narrow(axes.figure):
        legend_above(axes, columns=1)
        return
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))
    axes.legend(loc="upper right", ncols=3)


def _slips(figure: Canvas, places: Sequence[Any], tree: DataTree, after: str) -> None:
    """Draw distributions of the slips, without the first one of each trace."""
    groups = [tree[f"{name}{after}"].to_dataset() for name in ("observed_slips", "predicted_slips")]
    parts = [_later(group) for group in groups]
    quantities = (("force before slips", "N"), ("force drop", "N"), ("waiting time", "s"))
    for column, (quantity, unit) in enumerate(quantities):
        axes = figure.add_subplot(places[column])
        scale = scale_for(max_size(*(part[column] for part in parts)), unit)
        measured, predicted = (part[column] / scale.size for part in parts)
        both = np.concatenate([measured, predicted])
        if both.size:
            low, high = np.percentile(both, [0.5, 99.5])
            edges = np.linspace(low, high if high > low else low + 1, BINS + 1)
            for values, style in (
                (predicted, {"color": PREDICTED, "alpha": 0.35, "label": "predicted"}),
                (measured, {"histtype": "step", "color": MEASURED, "label": "measured"}),
            ):
                if values.size:
                    axes.hist(
                        np.clip(values, edges[0], edges[-1]),
                        edges.tolist(),
                        weights=np.full(values.size, 1 / values.size),
                        **style,
                    )
        label = scale.label(quantity)
        if is_narrow(figure):
            axes.set_xlabel(label.replace(" (", "\n("), fontsize="small")
        else:
            axes.set_xlabel(label)
        if column == 0:
            axes.set_ylabel("share of slips")
        if is_narrow(figure):
            axes.xaxis.set_major_locator(MaxNLocator(2))
        if column == 0 and both.size and is_narrow(figure):
            legend_above(axes, columns=1)
        elif column == 0 and both.size:
            axes.set_ylim(0, 1.5 * axes.get_ylim()[1])
            axes.legend(loc="upper left", ncols=2)


def _later(group: Dataset) -> tuple[Array, Array, Array]:
    """Force before, drop, and waiting time of the slips, without the first one of each trace."""
    owner, start = group["trace"].values, group["start_time"].values
    later = np.diff(owner, prepend=-1) == 0
    before, after = group["force_before"].values, group["force_after"].values
    waiting = np.diff(start, prepend=np.nan)
    return before[later], np.abs(before - after)[later], waiting[later]


VIEW = View(
    name="fit",
    kind="fit",
    summary="parameters, and predicted traces beside the measured one",
    draw_all=draw,
    panel=draw_trace,
)
