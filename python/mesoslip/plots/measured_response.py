"""The response of a measured trace: record with fit, residuals, a - b against velocity, healing."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.search import Fit, fit_laws, preferred_law
from mesoslip.analysis.response.dataset import response_of, rows_of
from mesoslip.array_types import Array
from mesoslip.errors import RunError
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.response_record import draw_record, fit_label, force_unit, title_record
from mesoslip.plots.style import POINTS, RED, Canvas, canvas
from mesoslip.quantities import Scale, scale_for, with_error

# Factor between the velocities of steps and the ends of their axis.
MARGIN = 3.0


def best_fit(experiment: Experiment) -> Fit | None:
    """The law that the record prefers, or the best of one state; None without one."""
    records = records_of(experiment)
    if isinstance(records, str):
        return None
    try:
        fits = fit_laws(records[0])
    except RunError:
        return None
    preferred = preferred_law(fits)
    if preferred:
        return fits[preferred]
    able = [one for one in fits.values() if one.law.states == 1]
    return min(able, key=lambda one: one.information_criterion, default=None)


def draw_measured_record(axes: Axes, experiment: Experiment, scale: Scale) -> None:
    """Draw the record of a measured trace with the law that fits it best."""
    draw_record(axes, experiment, scale)
    found = best_fit(experiment)
    if found is not None:
        _draw_fit(axes, experiment, found, scale)


def _horizontal(experiment: Experiment, found: Fit) -> Array:
    """Displacement of the load point at the points of a fit [m]."""
    points = found.law.points
    sign = experiment.stages[0].direction or 1.0
    return sign * np.interp(points.time + points.start, experiment.time, experiment.drive)


def _draw_fit(axes: Axes, experiment: Experiment, found: Fit, scale: Scale) -> None:
    unit = force_unit(experiment)
    force = (found.law.points.force - found.residual) / unit.size
    parts = [f"{found.law.name} law"]
    if found.is_determined:
        a, b = (
            with_error(found.value(name) / unit.size, found.error(name) / unit.size)
            for name in ("a", "b")
        )
        distance = with_error(found.value("slip_distance"), found.error("slip_distance"), "m")
        parts += [f"$a$ = {a}", f"$b$ = {b}", f"$D_c$ = {distance}"]
    else:
        parts += ["not determined"]
    label = fit_label(axes, parts)
    axes.plot(
        _horizontal(experiment, found) / scale.size, force, color=RED, linewidth=0.8, label=label
    )
    axes.legend(loc="best")


def _draw_residuals(axes: Axes, experiment: Experiment, found: Fit, scale: Scale) -> None:
    """Draw the residuals of the points over their noise."""
    deviation = found.noise.point_deviation * found.law.scale
    x = _horizontal(experiment, found) / scale.size
    axes.plot(x, found.residual / deviation, ".", color="black", markersize=2)
    axes.axhline(0, color=RED)
    axes.set(ylabel="residual over noise", xlabel=scale.label("displacement of the load point"))


def _draw_rates(axes: Axes, response: Arrays, unit: Scale) -> None:
    """Draw a - b of each step against the velocity after it, with standard errors."""
    steps = response.children["steps"]
    velocity = np.abs(steps["velocity_after"].values)
    name = next(one for one in ("rate_dependence_coefficient", "rate_dependence") if one in steps)
    value, error = steps[name].values / unit.size, steps[f"{name}_error"].values / unit.size
    scale = scale_for(float(velocity.max()), "m/s")
    axes.errorbar(velocity / scale.size, value, error, **POINTS, label="means")
    fits = [
        row
        for row in rows_of(response, "rate_and_state")
        if row["is_preferred"] and np.isfinite(row[_key(row)])
    ]
    stages = {number: one for one, number in enumerate(steps["stage_number"].values)}
    shown = [row for row in fits if row["stage_number"] in stages]
    if not shown and steps.sizes["step"] == 1:
        shown = [row | {"stage_number": steps["stage_number"].values[0]} for row in fits]
    for row in shown:
        x = 1.03 * velocity[stages[row["stage_number"]]] / scale.size
        value, error = row[_key(row)] / unit.size, row[f"{_key(row)}_error"] / unit.size
        axes.errorbar(x, value, error, **POINTS | {"fmt": "s", "color": RED})
    if shown:
        axes.plot([], [], "s", color=RED, markersize=3, label="law")
        axes.legend()
    axes.axhline(0, color="0.7", zorder=0)
    logarithmic(axes, "x")
    axes.set_xlim(velocity.min() / scale.size / MARGIN, velocity.max() / scale.size * MARGIN)
    axes.set(xlabel=scale.label("velocity after the step"), ylabel=f"$a - b$ ({unit.name})")


def _key(row: dict[str, float]) -> str:
    return "a_minus_b_coefficient" if "a_minus_b_coefficient" in row else "a_minus_b"


def _draw_healing(axes: Axes, response: Arrays, unit: Scale) -> None:
    """Draw the healing against the hold time."""
    holds = response.children["holds"]
    name = next(one for one in ("healing_coefficient", "healing") if one in holds)
    error = np.nan_to_num(holds[f"{name}_error"].values) / unit.size
    axes.errorbar(holds["hold_time"].values, holds[name].values / unit.size, error, **POINTS)
    logarithmic(axes, "x")
    axes.set(xlabel="hold time (s)", ylabel=f"healing ({unit.name})")


def draw_measured(tree: Tree, experiment: Experiment, figure: Canvas | None) -> Canvas:
    """The record with the law that fits best, residuals, a - b against velocity, and healing."""
    found = best_fit(experiment)
    response = response_of([experiment])
    has_steps = response.children["steps"].sizes["step"] > 0
    has_holds = response.children["holds"].sizes["hold"] > 0
    unit = force_unit(experiment)
    scale = scale_for(float(np.max(np.abs(experiment.drive))), "m")
    below = has_steps + has_holds
    rows = below if is_narrow(figure) else min(below, 1)
    columns = 1 if rows > 1 else max(below, 1)
    size = (3.4 if rows > 1 else 6.5, 3.0 + 1.4 * (found is not None) + 2.2 * rows)
    figure = canvas(figure, size)
    heights = [2.2, *([1.0] if found is not None else []), *([1.8] * rows)]
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    record = figure.add_subplot(grid[0, :])
    draw_record(record, experiment, scale)
    if found is not None:
        _draw_fit(record, experiment, found, scale)
    title_record(record, tree)
    if found is not None:
        residuals = figure.add_subplot(grid[1, :], sharex=record)
        _draw_residuals(residuals, experiment, found, scale)
        record.set_xlabel("")
    if has_steps:
        _draw_rates(figure.add_subplot(grid[-max(rows, 1), 0]), response, unit)
    if has_holds:
        _draw_healing(figure.add_subplot(grid[-1, columns - 1]), response, unit)
    return figure
