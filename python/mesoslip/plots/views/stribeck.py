"""View of plateaus: the record with them, and Stribeck's curve."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.plateaus.catalogue import Plateaus, plateaus_of
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import force_among
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import POINTS, RED, Canvas, canvas, legend_above, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Maximum number of samples that are drawn.
MAX_DRAWN = 20000
# Minimum ratio of abscissas that are drawn on a logarithmic axis.
MIN_RATIO = 5.0
# Abscissas, by preference: column, label, and SI unit.
ABSCISSAS = (
    ("hersey_number", "viscosity × speed/load", "1/m"),
    ("sliding_speed", "speed", "m/s"),
    ("normal_force", "normal force", "N"),
    ("start_time", "time", "s"),
)


def _friction(found: Plateaus) -> tuple[str, str, str]:
    """Column of the friction, its label and its SI unit."""
    if np.isfinite(found.columns["mean_friction_coefficient"]).any():
        return "mean_friction_coefficient", "friction coefficient", "1"
    if found.force_unit == "1":
        return "mean_friction", "friction coefficient", "1"
    return "mean_friction", "friction force", "N"


def draw_curve(axes: Axes, found: Plateaus) -> None:
    """Draw the friction of each plateau over viscosity × speed/load, or the known part of that."""
    column, label, unit = _friction(found)
    name, title, abscissa_unit = next(
        one
        for one in ABSCISSAS
        if np.isfinite(x := found.columns[one[0]]).all() and (np.ptp(x) > 0 or one is ABSCISSAS[-1])
    )
    x = found.columns[name]
    y, error = found.columns[column], found.columns[f"{column}_error"]
    along, up = (
        scale_for(float(np.nanmax(np.abs(values))), one)
        for values, one in ((x, abscissa_unit), (y, unit))
    )
    axes.errorbar(x / along.size, y / up.size, error / up.size, **POINTS)
    if x.min() > 0 and x.max() > MIN_RATIO * x.min() and name != "start_time":
        axes.set_xscale("log")
    axes.set(xlabel=along.label(title), ylabel=up.label(label))


def draw_record(axes: Axes, tree: Tree, found: Plateaus) -> None:
    """Draw the force of the first realization, with the mean of each plateau over it."""
    root = tree.to_dataset()
    time, force = root["time"].values, root[force_among(root)].values[0]
    columns = found.columns
    mine = columns["realization_index"] == 0
    sign = -1.0 if np.nanmean(force) < 0 else 1.0
    step = max(1, time.size // MAX_DRAWN)
    along = scale_for(float(time[-1]), "s")
    up = scale_for(float(np.nanmax(np.abs(force))), found.force_unit)
    axes.plot(
        time[::step] / along.size, sign * force[::step] / up.size, color="0.6", linewidth=0.6,
        label="record",
    )  # fmt: skip
    starts, ends, means = (
        columns[one][mine] for one in ("start_time", "end_time", "mean_friction")
    )
    axes.hlines(
        means / up.size, starts / along.size, ends / along.size, color=RED, linewidth=1.6,
        label="plateaus", zorder=3,
    )  # fmt: skip
    axes.set_xlabel(along.label("time"))
    axes.set_ylabel(up.label("friction coefficient" if found.force_unit == "1" else "force"))
    legend_above(axes)


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:  # noqa: ARG001
    """The record with its plateaus, and the curve."""
    found = plateaus_of(tree)
    is_stacked = is_narrow(figure)
    figure = canvas(figure, (3.4, 5.2) if is_stacked else (7.0, 3.2))
    panels = figure.subplots(*((2, 1) if is_stacked else (1, 2)))
    draw_record(panels[0], tree, found)
    titles(panels[0], tree, beside_legend=True)
    draw_curve(panels[1], found)
    return figure


def draw_panel(axes: Axes, tree: Tree, options: Options) -> None:  # noqa: ARG001
    """Draw the curve alone."""
    draw_curve(axes, plateaus_of(tree))
    titles(axes, tree)


VIEW = View(
    name="stribeck",
    kind="run",
    summary="friction of plateaus of speed, load or force: the record, and Stribeck's curve",
    draw_all=draw,
    panel=draw_panel,
    takes_arrays=True,
)
