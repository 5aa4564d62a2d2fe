"""View of the response to a drive with stages: record, steady forces, healing in holds."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.experiment import Experiment
from mesoslip.analysis.rate_and_state import LAWS, MAX_MISFIT, Fit, Record, fit, record_of
from mesoslip.analysis.response import healing_line, response_of, steady_line
from mesoslip.errors import RunError
from mesoslip.plots.style import Canvas, canvas, plain, styled
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, percent, scale_for, with_error, with_unit

Array = NDArray[np.float64]

# Samples of the record at equal intervals of time, and as many at equal distances.
MAX_DOTS = 20_000
# Stages whose starts are marked, and stages with a label.
MAX_MARKS = 200
MAX_LABELS = 12
# Minimum distance of two labels, as a part of the width.
LABEL_WIDTH = 0.03


def _draw_record(axes: Axes, experiment: Experiment, scale: Scale) -> None:
    """Draw the force against the displacement of the load point."""
    shown = _dots(experiment)
    sign = next((one.direction for one in experiment.stages if one.direction), 1.0)
    force = sign * experiment.force.mean(axis=0) / experiment.static_force
    x = sign * experiment.drive
    axes.plot(x[shown] / scale.size, force[shown], color="black", linewidth=0.6)
    steady = next((one for one in experiment.stages if experiment.mean_of(one) is not None), None)
    if steady is not None and len(experiment.stages) > 1:
        # The range after steady sliding is reached: what comes before may be far larger.
        mean = experiment.mean_of(steady)
        assert mean is not None
        later = force[experiment.samples(steady).start + mean.start :]
        margin = 0.15 * max(float(np.ptp(later)), 1e-3)
        axes.set_ylim(later.min() - 2 * margin, later.max() + margin)
    axes.set_xlabel(scale.label("displacement of the load point"))
    axes.set_ylabel("force over $F_s$")
    for stage in experiment.stages[1 : MAX_MARKS + 1]:
        start = x[experiment.start_sample(stage)] / scale.size
        axes.axvline(start, color="tab:blue" if stage.is_hold else "0.8", linewidth=0.5, zorder=0)
    _label_stages(axes, experiment, x, scale)


def _dots(experiment: Experiment) -> NDArray[np.int64]:
    """Samples of a line: equidistant ones in time, and as many along the drive."""
    count = experiment.time.size
    if count <= 2 * MAX_DOTS:
        return np.arange(count)
    path_length = np.append(0.0, np.cumsum(np.abs(np.diff(experiment.drive))))
    even = np.linspace(0, count - 1, MAX_DOTS).astype(np.int64)
    along = np.searchsorted(path_length, np.linspace(0, path_length[-1], MAX_DOTS)).astype(np.int64)
    return np.union1d(even, np.minimum(along, count - 1))


def _label_stages(axes: Axes, experiment: Experiment, x: Array, scale: Scale) -> None:
    """Write the velocity of each stage, or the duration of a hold, above the record."""
    if len(experiment.stages) > MAX_LABELS:
        return
    min_distance = LABEL_WIDTH * float(np.ptp(x))
    last = -math.inf
    for stage in experiment.stages:
        if not (stage.is_hold or stage.is_steady):
            continue
        inside = experiment.samples(stage)
        index = (
            experiment.start_sample(stage) if stage.is_hold else (inside.start + inside.stop) // 2
        )
        position = x[min(index, x.size - 1)]
        # Labels of short stages would lie over each other.
        if abs(position - last) < min_distance:
            continue
        last = position
        axes.annotate(
            with_unit(stage.duration, "s")
            if stage.is_hold
            else with_unit(abs(stage.velocity), "m/s", 3),
            (position / scale.size, 1.0),
            xycoords=("data", "axes fraction"),
            fontsize=6,
            ha="center",
            va="bottom",
            color="tab:blue" if stage.is_hold else "0.4",
            rotation=40 if len(experiment.stages) > 4 else 0,
        )


def _draw_fit(axes: Axes, experiment: Experiment, record: Record, found: Fit, scale: Scale) -> None:
    """Draw the record that a rate-and-state law gives, on the same axes."""
    sign = next(one.direction for one in experiment.stages if one.direction)
    drive = sign * np.interp(record.time + record.start, experiment.time, experiment.drive)
    force = (record.force - found.residual) / experiment.static_force
    label = f"{found.law.law} law, $a$ = {found.law.a / experiment.static_force:.2g} $F_s$, "
    label += f"$b$ = {found.law.b / experiment.static_force:.2g} $F_s$, "
    label += f"$D_c$ = {with_unit(found.law.slip_distance, 'm', 3)}"
    # As the table does for a law that does not describe the record.
    misfit = found.relative_misfit(record)
    label += f" (misfit {percent(misfit)})" if misfit > MAX_MISFIT else ""
    axes.plot(drive / scale.size, force, color="tab:red", label=label)
    axes.legend(loc="lower right")


def draw_force(axes: Axes, tree: xr.DataTree, _: Options) -> None:
    """Draw the force against the displacement of the load point, and the rate-and-state law that
    fits better."""
    experiment = Experiment(tree)
    scale = scale_for(float(np.max(np.abs(experiment.drive))), "m")
    _draw_record(axes, experiment, scale)
    record = record_of(experiment)
    if isinstance(record, str):
        return
    fits = []
    for law in LAWS:
        try:
            fits.append(fit(record, law))
        except RunError:
            continue
    if fits:
        best = min(fits, key=lambda one: one.chi_square)
        _draw_fit(axes, experiment, record, best, scale)


def draw_steady(axes: Axes, data: xr.Dataset) -> None:
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
            axes.errorbar(
                x[chosen], force[chosen], error[chosen], fmt="o", color=colour, markersize=3
            )
    found = steady_line(data)
    if found is not None:
        ends = np.array([x.min(), x.max()])
        values = (found.level + found.slope * (ends + math.log(reference))) * scale
        slope = with_error(found.slope * scale, found.slope_error * scale)
        axes.plot(ends, values, color="tab:red")
        axes.set_title(f"$a - b$ = {slope}", loc="left")
    axes.set_xlabel(f"$\\ln(V/V_0)$, $V_0$ = {with_unit(reference, 'm/s', 3)}")
    axes.set_ylabel("steady force over $F_s$")


def draw_healing(axes: Axes, data: xr.Dataset) -> None:
    """Draw the growth of the restart peak against the hold time."""
    scale = _scale(data, "healing")
    hold = data["hold_time"].values
    axes.errorbar(
        hold,
        data["healing"].values * scale,
        np.nan_to_num(data["healing_error"].values) * scale,
        fmt="o",
        color="black",
        markersize=3,
    )
    found = healing_line(data)
    axes.set_xscale("log")
    if found is not None:
        ends = np.array([hold.min(), hold.max()])
        axes.plot(ends, (found.level + found.slope * np.log10(ends)) * scale, color="tab:red")
        slope = with_error(found.slope * scale, found.slope_error * scale)
        axes.set_title(f"healing per decade of hold time = {slope}", loc="left")
    axes.set_xlabel("hold time (s)")
    axes.set_ylabel("(peak - steady force) over $F_s$")


def _scale(data: xr.Dataset, name: str) -> float:
    """One over the static force."""
    force, ratio = data[name].values, data[f"{name}_ratio"].values
    good = np.isfinite(force) & (force != 0)
    return float(ratio[good][0] / force[good][0]) if good.any() else 1.0


def draw(tree: xr.DataTree, options: Options, figure: Canvas | None = None) -> Canvas:
    """The record with the law that fits better; steady forces; healing in holds."""
    experiment = Experiment(tree)
    found = response_of([experiment], with_fit=False)
    steady, holds = found["steady"].to_dataset(), found["holds"].to_dataset()
    velocities = steady["velocity"].values[np.isfinite(steady["steady_force"].values)]
    draws_steady = np.unique(np.abs(velocities)).size > 1
    draws_healing = bool(np.isfinite(holds["healing"].values).any())
    below = draws_steady + draws_healing
    with styled():
        figure = canvas(figure, (6.5, 5.0 if below else 3.0))
        if below:
            panels = figure.add_gridspec(2, below)
            record = figure.add_subplot(panels[0, :])
        else:
            record = figure.subplots()
        draw_force(record, tree, options)
        title = plain(tree.attrs.get("title", ""))
        if any(stage.is_hold for stage in experiment.stages):
            title += "\nblue: holds and their durations"
        record.set_title(title, loc="left", pad=22)
        if draws_steady:
            draw_steady(figure.add_subplot(panels[1, 0]), steady)
        if draws_healing:
            draw_healing(figure.add_subplot(panels[1, below - 1]), holds)
    return figure


VIEW = View(
    name="response",
    kind="run",
    summary="steady forces, velocity steps and holds",
    draw=draw,
    panel=draw_force,
)
