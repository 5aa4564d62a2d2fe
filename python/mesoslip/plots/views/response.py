"""View of the response to a drive with stages: record, steady forces, healing in holds."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.search import MAX_MISFIT, Fit, fit_laws
from mesoslip.analysis.response.dataset import response_of
from mesoslip.analysis.response.holds import healing_line, steady_line
from mesoslip.analysis.response.line import Line
from mesoslip.errors import RunError
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.forced_response import draw_forced
from mesoslip.plots.measured_response import draw_measured, draw_measured_record
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.response_record import draw_record, fit_label, title_record
from mesoslip.plots.style import FITTED, POINTS, RED, Canvas, canvas, write_title
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, percent, scale_for, with_error, with_unit

# Relative error of a slope below which the motion has no noise, as that of N → ∞.
NOISELESS = 1e-5


def _draw_fit(axes: Axes, experiment: Experiment, found: Fit, scale: Scale) -> None:
    """Draw the record that a rate-and-state law gives, on the same axes."""
    sign = next(one.direction for one in experiment.stages if one.direction)
    points = found.law.points
    drive = sign * np.interp(points.time + points.start, experiment.time, experiment.drive)
    force = (points.force - found.residual) / experiment.static_force
    parts = [
        f"{found.law.name} law",
        f"$a$ = {found.value('a') / experiment.static_force:.2g} $F_s$",
        f"$b$ = {found.value('b') / experiment.static_force:.2g} $F_s$",
        f"$D_c$ = {with_unit(found.value('slip_distance'), 'm', 3)}",
    ]
    # As the table does for a law that does not describe the record.
    misfit = found.relative_misfit
    parts += [f"misfit {percent(misfit)}"] if misfit > MAX_MISFIT else []
    label = fit_label(axes, parts)
    axes.plot(drive / scale.size, force, **FITTED, label=label)
    # Visible in the noise too, without hiding peaks.
    axes.plot(drive / scale.size, force, ":", color=RED, linewidth=0.6)
    axes.legend(loc="best")


def draw_force(axes: Axes, tree: Tree, _: Options) -> None:
    """Draw the force against the displacement of the load point, and the rate-and-state law that
    fits best."""
    experiment = Experiment(tree)
    scale = scale_for(float(np.max(np.abs(experiment.drive))), "m")
    if experiment.is_measured:
        draw_measured_record(axes, experiment, scale)
        return
    draw_record(axes, experiment, scale)
    records = records_of(experiment)
    if isinstance(records, str):
        return
    try:
        fits = fit_laws(records[0])
    except RunError:
        return
    best = min(fits.values(), key=lambda one: one.chi_square)
    _draw_fit(axes, experiment, best, scale)


def draw_steady(axes: Axes, data: Arrays) -> None:
    """Draw the steady force against the logarithm of the velocity, with a line fitted to it."""
    data = data.isel(velocity_stage=np.isfinite(data["steady_force"].values))
    velocity = np.abs(data["velocity"].values)
    reference = float(velocity[0])
    scale = _scale(data, "steady_force")
    steady = data["is_steady"].values == 1
    force = data["steady_force"].values * scale
    error = data["steady_force_half_width"].values * scale
    x = np.log(velocity / reference)
    for chosen, colour in ((steady, "black"), (~steady, "0.7")):
        if chosen.any():
            style = POINTS | {"color": colour}
            axes.errorbar(x[chosen], force[chosen], error[chosen], **style)
    found = steady_line(data)
    if found is not None:
        ends = np.array([x.min(), x.max()])
        values = (found.level + found.slope * (ends + math.log(reference))) * scale
        slope = _slope(found, scale)
        if np.unique(velocity).size > 2:
            axes.plot(ends, values, color=RED)
        else:
            slope += ", from two velocities"
        write_title(axes, f"$a - b$ = {slope}")
    axes.set_xlabel(f"$\\ln(V/V_0)$, $V_0$ = {with_unit(reference, 'm/s', 3)}")
    axes.set_ylabel("steady force over $F_s$")


def draw_healing(axes: Axes, data: Arrays) -> None:
    """Draw the growth of the restart peak against the hold time."""
    scale = _scale(data, "healing")
    hold = data["hold_time"].values
    error = np.nan_to_num(data["healing_error"].values) * scale
    axes.errorbar(hold, data["healing"].values * scale, error, **POINTS)
    found = healing_line(data)
    logarithmic(axes, "x")
    if found is not None:
        ends = np.array([hold.min(), hold.max()])
        axes.plot(ends, (found.level + found.slope * np.log10(ends)) * scale, color=RED)
        slope = _slope(found, scale)
        write_title(axes, f"healing per decade of hold time = {slope}")
    axes.set(xlabel="hold time (s)", ylabel="(peak - steady force) over $F_s$")


def _slope(found: Line, scale: float) -> str:
    """The slope of a line with its error, which is left out where it is far below what a motion
    without noise can tell."""
    value, error = found.slope * scale, found.slope_error * scale
    return with_error(value, error if error > NOISELESS * abs(value) else 0.0)


def _scale(data: Arrays, name: str) -> float:
    """One over the static force."""
    force, ratio = data[name].values, data[f"{name}_ratio"].values
    good = np.isfinite(force) & (force != 0)
    return float(ratio[good][0] / force[good][0]) if good.any() else 1.0


def draw(tree: Tree, options: Options, figure: Canvas | None) -> Canvas:
    """The record with the law that fits best, steady forces, healing; or a measured trace, or a
    slider under a force."""
    experiment = Experiment(tree)
    if experiment.is_measured:
        return draw_measured(tree, experiment, figure)
    if experiment.is_forced:
        return draw_forced(tree, experiment, figure)
    found = response_of([experiment], with_fit=False)
    steady, holds = found.children["steady"], found.children["holds"]
    velocities = steady["velocity"].values[np.isfinite(steady["steady_force"].values)]
    draws_steady = np.unique(np.abs(velocities)).size > 1
    draws_healing = bool(np.isfinite(holds["healing"].values).any())
    below = draws_steady + draws_healing
    is_stacked = is_narrow(figure) and below == 2
    rows = 3 if is_stacked else 2 if below else 1
    figure = canvas(figure, (3.4 if is_stacked else 6.5, 2.5 * rows if below else 3.0))
    columns = 1 if is_stacked else max(below, 1)
    panels = figure.add_gridspec(rows, columns)
    record = figure.add_subplot(panels[0, :])
    draw_force(record, tree, options)
    has_holds = any(stage.is_hold for stage in experiment.stages)
    title_record(record, tree, "blue: holds and their durations" if has_holds else "")
    if draws_steady:
        draw_steady(figure.add_subplot(panels[1, 0]), steady)
    if draws_healing:
        draw_healing(figure.add_subplot(panels[rows - 1, columns - 1]), holds)
    return figure


VIEW = View(
    name="response",
    kind="run",
    summary="steady forces, velocity steps and holds",
    draw_all=draw,
    panel=draw_force,
    takes_arrays=True,
)
