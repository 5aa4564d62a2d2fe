"""View of a posterior of rates and states: parameters, and the record with predicted ones."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array, DataTree
from mesoslip.output.variables import FORCES, force_among
from mesoslip.plots.key_names import plain
from mesoslip.plots.parameter_pairs import draw_pairs
from mesoslip.plots.printing import current, is_narrow
from mesoslip.plots.style import BLUE, Canvas, canvas
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, scale_for


def draw(tree: DataTree, _: Options, figure: Canvas | None) -> Canvas:
    """Pairs of parameters of the first law, its record with predicted ones, and the residuals."""
    size = len(tree["posterior"].data_vars)
    narrow = is_narrow(figure)
    heights = [(0.6 if narrow else 1.1) * size, 2.4, 1.6]
    figure = canvas(figure, (3.4 if narrow else max(7.0, 1.1 * size), sum(heights)))
    grid = figure.add_gridspec(3, 1, height_ratios=heights)
    draw_pairs(figure, grid[0], tree)
    record = figure.add_subplot(grid[1])
    draw_record(record, tree, Options())
    record.set_xlabel("")
    _draw_residuals(figure.add_subplot(grid[2], sharex=record), tree)
    if current().title is None:
        law = tree["posterior"].attrs
        title = f"{tree.attrs['title']}: {law['law']} law, {law['verdict']}"
        figure.suptitle(plain(title), x=0.01, ha="left")
    return figure


def _parts(tree: DataTree) -> tuple[Array, Array, Array, Scale, Scale]:
    """Displacement of the load point, force and predicted forces in units for print."""
    observed = tree["observed_data"].to_dataset()
    name = force_among(observed)
    predicted = tree["posterior_predictive"].to_dataset()[name].values[0]
    force, moved = observed[name].values, observed["drive_displacement"].values
    unit = scale_for(float(np.max(np.abs(force))), FORCES[name])
    length = scale_for(float(np.max(moved)), "m")
    return moved / length.size, force / unit.size, predicted / unit.size, length, unit


def draw_record(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the record over the band of predicted ones, against the load point."""
    moved, force, predicted, length, unit = _parts(tree)
    band = np.percentile(predicted, [5, 95], axis=0)
    label = "90 % of predicted records"
    axes.fill_between(moved, *band, color=BLUE, alpha=0.35, linewidth=0, label=label)
    axes.plot(moved, force, ".", color="black", markersize=1.5, label="record")
    axes.set_xlabel(length.label("displacement of the load point"))
    axes.set_ylabel(unit.label("friction" if not unit.name else "force"))
    axes.legend()


def _draw_residuals(axes: Axes, tree: DataTree) -> None:
    """Draw the record less the median of predicted ones, over their band."""
    moved, force, predicted, length, unit = _parts(tree)
    middle = np.median(predicted, axis=0)
    band = np.percentile(predicted - middle, [5, 95], axis=0)
    axes.fill_between(moved, *band, color=BLUE, alpha=0.35, linewidth=0)
    axes.plot(moved, force - middle, ".", color="black", markersize=1.5)
    axes.axhline(0, color="0.5", linewidth=0.6)
    axes.set(xlabel=length.label("displacement of the load point"), ylabel=unit.label("residual"))


VIEW = View(
    name="rates",
    kind="rates",
    summary="parameters of a rate-and-state law, and the record with predicted ones",
    draw_all=draw,
    panel=draw_record,
)
