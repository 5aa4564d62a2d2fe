"""View of a fit: where the traces disagree with what the posterior predicts."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.output.access import trace_suffixes
from mesoslip.plots.extent import max_size
from mesoslip.plots.key_names import plain
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import BLUE, RED, Canvas, canvas, legend_above
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

MEASURED, PREDICTED, WORST = "black", BLUE, RED
# Maximum number of summaries that are listed, and end of their axis [spreads].
LISTED = 14
MAX_SCORE = 30.0
# Length of an excerpt in mean times between slips.
CYCLES = 5
# Characters in a line of the title of a wide figure.
WIDTH = 115


def draw(tree: DataTree, _: Options, figure: Canvas | None) -> Canvas:
    """Excerpts of measured and predicted traces, the shapes of slips, and the worst summaries."""
    suffixes = trace_suffixes(tree)
    is_stacked = is_narrow(figure)
    heights = [*(3.0 if is_stacked else 1.9 for _ in suffixes), 1.8 if is_stacked else 3.0]
    figure = canvas(figure, (3.4 if is_stacked else 7.0, 0.6 + sum(heights)))
    rows = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    for number, after in enumerate(suffixes):
        pair = (
            rows[number].subgridspec(2, 1)
            if is_stacked
            else rows[number].subgridspec(1, 2, width_ratios=[1.7, 1])
        )
        _excerpt(figure.add_subplot(pair[0]), tree, after, named=len(suffixes) > 1)
        _shape(figure.add_subplot(pair[1]), tree, number)
    draw_scores(figure.add_subplot(rows[len(suffixes)]), tree, Options())
    characters = 55 if is_stacked else WIDTH
    figure.suptitle(_title(tree, characters), x=0.01, ha="left", fontsize=8)
    return figure


def _title(tree: DataTree, characters: int) -> str:
    probability = float(tree.attrs["agreement_probability"])
    groups = ", ".join(str(tree.attrs["disagreeing"]).split("\n"))
    text = f"Agreement of model and trace: p = {probability:.2g}"
    if groups:
        text += f"; the model does not describe: {groups}"
    return "\n".join(textwrap.wrap(plain(text), characters))


def _excerpt(axes: Axes, tree: DataTree, after: str, *, named: bool) -> None:
    """Draw some cycles of the measured trace and of a predicted one, each from one of its slips."""
    observed = tree[f"observed_data{after}"].to_dataset()["spring_force"]
    predicted = tree[f"posterior_predictive{after}"].to_dataset()["spring_force"]
    slips = tree[f"observed_slips{after}"].to_dataset()
    others = tree[f"predicted_slips{after}"].to_dataset()
    first = others["start_time"].values[others["trace"].values == 0]
    own = slips["start_time"].values
    whole = float(observed["time"].values[-1] - observed["time"].values[0])
    cycle = float(np.median(np.diff(own))) if len(own) > 2 else whole / CYCLES
    scale = scale_for(max_size(observed.values, predicted.values[0, 0]), "N")
    unit = scale_for(CYCLES * cycle, "s")
    for starts, data, color, label in (
        (first, predicted[0, 0], PREDICTED, "one predicted trace"),
        (own, observed, MEASURED, "measured"),
    ):
        times = data["time"].values
        middle = (times[0] + times[-1]) / 2
        later = starts[starts >= middle]
        start = (later[0] if later.size else middle) - cycle / 2
        inside = (times >= start) & (times <= start + CYCLES * cycle)
        axes.plot(
            (times[inside] - start) / unit.size,
            data.values[inside] / scale.size,
            color=color,
            label=label,
        )
    axes.set_xlabel(unit.label("time from half a cycle before a slip"))
    axes.set_ylabel(scale.label("spring force"))
    if is_narrow(axes.figure):
        legend_above(axes, columns=1)
    else:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.3 * (high - low))
        axes.legend(loc="upper right", ncols=2)
    if named:
        title = tree[f"observed_data{after}"].attrs["title"]
        axes.set_title(plain(str(title)), loc="left")


def _shape(axes: Axes, tree: DataTree, number: int) -> None:
    """Draw the mean force during slips, measured and predicted."""
    data = tree["summaries"].to_dataset()
    names = [str(one) for one in data["summary"].values]
    chosen = [
        index
        for index, name in enumerate(names)
        if "waveform_" in name
        and "first_waveform_" not in name
        and int(data["trace"].values[index]) == number
    ]
    if not chosen:
        axes.set_axis_off()
        return
    at = np.array([float(names[index].rpartition("_")[2]) for index in chosen])
    part = data.isel(summary=chosen)
    factor = part["factor"].values
    ends = (part["observed"].values, part["predicted_95"].values)
    scale = scale_for(max_size(*(one * factor for one in ends)), "N")
    low, middle, high = (
        part[f"predicted_{one}"].values * factor / scale.size for one in ("05", "50", "95")
    )
    axes.fill_between(at, low, high, color=PREDICTED, alpha=0.35, linewidth=0)
    axes.plot(at, middle, color=PREDICTED)
    axes.plot(at, part["observed"].values * factor / scale.size, color=MEASURED)
    axes.set(xlabel="time (periods of the setup)", ylabel=scale.label("mean along slips"))


def draw_scores(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the summaries that are farthest from their predictions, with 90 % of these."""
    data = tree["summaries"].to_dataset()
    scores = data["score"].values
    labels = [str(one) for one in data["label"].values]
    size = np.where(np.isfinite(scores) & np.array([bool(one) for one in labels]), scores, 0.0)
    chosen: list[int] = []
    for index in np.argsort(-np.abs(size)):
        name = (labels[index], int(data["trace"].values[index]))
        listed = {(labels[one], int(data["trace"].values[one])) for one in chosen}
        if name not in listed and size[index] != 0:
            chosen.append(int(index))
        if len(chosen) == (LISTED // 2 if is_narrow(axes.figure) else LISTED):
            break
    bad = set(str(tree.attrs["disagreeing"]).split("\n"))
    several = len(trace_suffixes(tree)) > 1
    titles = str(tree.attrs["traces"]).split("\n")
    for row, index in enumerate(reversed(chosen)):
        one = data.isel(summary=index)
        middle = one["predicted_50"].item()
        spread = (one["observed"].item() - middle) / size[index]
        ends = [(one[f"predicted_{end}"].item() - middle) / spread for end in ("05", "95")]
        color = WORST if str(one["group"].item()) in bad else MEASURED
        # Solid: print has dashes from the fifth curve on.
        axes.plot(ends, [row, row], "-", color=PREDICTED, linewidth=4, alpha=0.4)
        shown = float(np.clip(size[index], -MAX_SCORE, MAX_SCORE))
        axes.plot(shown, row, "o", color=color, markersize=4)
    axes.set_yticks(
        range(len(chosen)),
        [
            plain(labels[one] + (f", {titles[int(data['trace'].values[one])]}" if several else ""))
            for one in reversed(chosen)
        ],
    )
    axes.axvline(0, color="0.6", linewidth=0.6)
    axes.set_xscale("symlog", linthresh=3)
    axes.set_xlim(-1.1 * MAX_SCORE, 1.1 * MAX_SCORE)
    is_small = is_narrow(axes.figure)
    ticks = (-30, 0, 30) if is_small else (-30, -10, -3, 0, 3, 10, 30)
    if is_small:
        axes.tick_params(axis="y", labelsize="x-small")
        axes.minorticks_off()
    axes.set_xticks(ticks, [str(one) for one in ticks])
    axes.set_xlabel(
        "measured - predicted (spreads)\nblue: 90 % of predictions\nred: groups that disagree"
    )


VIEW = View(
    name="misfit",
    kind="fit",
    summary="where the traces disagree with the predictions",
    draw_all=draw,
    panel=draw_scores,
)
