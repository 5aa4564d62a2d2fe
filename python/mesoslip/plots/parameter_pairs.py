"""Draws of parameters from a posterior, in pairs."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from mesoslip.array_types import DataTree
from mesoslip.configuration.units import from_cf_units
from mesoslip.plots.key_names import symbol_or_name
from mesoslip.plots.printing import UNLETTERED, is_narrow
from mesoslip.plots.style import BLUE, Canvas
from mesoslip.quantities import Scale, scale_for

# Maximum number of draws of a pair of parameters that are shown.
MAX_POINTS = 1500


def _label(name: str, scale: Scale) -> str:
    """Symbol and unit of a parameter."""
    return scale.label(symbol_or_name(name))


def draw_pairs(figure: Canvas, place: object, tree: DataTree) -> None:
    """Draw pairs of parameters, and on the diagonal the density of each with that of its prior."""
    group, prior = tree["posterior"].to_dataset(), tree["prior"].to_dataset()
    names = [str(name) for name in group.data_vars]
    grid = place.subgridspec(len(names), len(names))  # type: ignore[attr-defined]
    medians = {name: float(np.median(np.abs(group[name].values))) for name in names}
    units = {name: from_cf_units(group[name].attrs["units"]) for name in names}
    scales = {name: scale_for(medians[name], units[name]) for name in names}
    draws = {name: group[name].values.ravel() / scales[name].size for name in names}
    thin = slice(None, None, max(1, len(draws[names[0]]) // MAX_POINTS))
    for row, below in enumerate(names):
        for column, beside in enumerate(names[: row + 1]):
            axes = figure.add_subplot(grid[row, column])
            axes.set_label(UNLETTERED if row or column else "")
            values = draws[beside]
            low, high = np.percentile(values, [0.1, 99.9])
            if row == column:
                axes.hist(values, 40, range=(low, high), density=True, color=BLUE)
                known = prior[beside].values.ravel() / scales[beside].size
                inside = np.mean((known >= low) & (known <= high)) / (high - low)
                axes.axhline(inside, color="0.5", linestyle=":", linewidth=0.8)
                axes.axvspan(*np.percentile(values, [5, 95]), color="0.9", zorder=0)
            else:
                axes.plot(values[thin], draws[below][thin], ".", color=BLUE, markersize=1.2)
                axes.set_ylim(*np.percentile(draws[below], [0.1, 99.9]))
            axes.set_xlim(low, high)
            axes.tick_params(labelsize="x-small")
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(_formatter())
                axis.set_major_locator(MaxNLocator(2 if is_narrow(figure) else 3, prune="both"))
            if row == column:
                axes.set_yticks([])
            if row == len(names) - 1:
                axes.set_xlabel(_label(beside, scales[beside]), fontsize="small")
            else:
                axes.set_xticklabels([])
            if column == 0 and row > 0:
                axes.set_ylabel(_label(below, scales[below]), fontsize="small")
            elif row != column:
                axes.set_yticklabels([])


def _formatter() -> ScalarFormatter:
    """Labels of ticks with whole numbers, not differences from an offset."""
    formatter = ScalarFormatter(useOffset=False)
    formatter.set_powerlimits((-4, 5))
    return formatter
