"""Pictures of what those who measure friction look at: steps, steady forces, holds."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.experiment import Experiment
from mesoslip.analysis.rate_and_state import (
    LAWS,
    MAX_MISFIT,
    Fit,
    Record,
    fit,
    record_of,
)
from mesoslip.analysis.response import healing_line, response_of, steady_line
from mesoslip.errors import RunError
from mesoslip.plots.style import Canvas, canvas, styled
from mesoslip.quantities import percent

Array = NDArray[np.float64]

# Most dots of a line.
MOST_DOTS = 20_000
# Changes of the drive that are marked, and stages that are told above them.
MOST_MARKS = 200
MOST_LABELS = 12
# Least distance of two labels, as a part of the width.
LABEL_WIDTH = 0.03


def _draw_record(axes: Axes, experiment: Experiment) -> None:
    """The force against the displacement of the load point, or against time if there are holds."""
    shown = _dots(experiment)
    sign = next((one.direction for one in experiment.stages if one.direction), 1.0)
    force = sign * experiment.force.mean(axis=0) / experiment.static_force
    axes.plot(sign * experiment.drive[shown] * 1e6, force[shown], color="black", linewidth=0.6)
    steady = next((one for one in experiment.stages if experiment.mean_of(one) is not None), None)
    if steady is not None and len(experiment.stages) > 1:
        # What comes before steady sliding would make the rest small.
        mean = experiment.mean_of(steady)
        assert mean is not None
        later = force[experiment.samples(steady).start + mean.start :]
        margin = 0.15 * max(float(np.ptp(later)), 1e-3)
        axes.set_ylim(later.min() - 2 * margin, later.max() + margin)
    axes.set_xlabel("displacement of the load point (µm)")
    axes.set_ylabel("force / $F_s$")
    for stage in experiment.stages[1 : MOST_MARKS + 1]:
        at = sign * experiment.drive[experiment.start_sample(stage)] * 1e6
        axes.axvline(at, color="tab:blue" if stage.is_hold else "0.8", linewidth=0.5, zorder=0)
    _label_stages(axes, experiment, sign)


def _dots(experiment: Experiment) -> NDArray[np.int64]:
    """Samples that a line shows: so many evenly in time, so many along the drive."""
    count = experiment.time.size
    if count <= 2 * MOST_DOTS:
        return np.arange(count)
    way = np.append(0.0, np.cumsum(np.abs(np.diff(experiment.drive))))
    even = np.linspace(0, count - 1, MOST_DOTS).astype(np.int64)
    along = np.searchsorted(way, np.linspace(0, way[-1], MOST_DOTS)).astype(np.int64)
    return np.union1d(even, np.minimum(along, count - 1))


def _label_stages(axes: Axes, experiment: Experiment, sign: float) -> None:
    """The velocity of each stage, or how long the drive stands, above the record."""
    if len(experiment.stages) > MOST_LABELS:
        return
    apart = LABEL_WIDTH * float(np.ptp(experiment.drive))
    last = -math.inf
    for stage in experiment.stages:
        inside = experiment.samples(stage)
        if stage.is_hold or stage.is_steady:
            place = (
                experiment.start_sample(stage)
                if stage.is_hold
                else (inside.start + inside.stop) // 2
            )
            place = min(place, experiment.time.size - 1)
            # Those of short stages would lie over each other.
            if abs(experiment.drive[place] - last) < apart:
                continue
            last = float(experiment.drive[place])
            text = (
                f"{stage.duration:.4g} s"
                if stage.is_hold
                else f"{abs(stage.velocity) * 1e6:.3g} µm/s"
            )
            axes.annotate(
                text,
                (sign * experiment.drive[place] * 1e6, 1.0),
                xycoords=("data", "axes fraction"),
                fontsize=6,
                ha="center",
                va="bottom",
                color="tab:blue" if stage.is_hold else "0.4",
                rotation=40 if len(experiment.stages) > 4 else 0,
            )


def _draw_law(axes: Axes, experiment: Experiment, record: Record, found: Fit) -> None:
    """What a law makes of the record, on the same axes."""
    sign = next(one.direction for one in experiment.stages if one.direction)
    drive = sign * np.interp(record.time + record.start, experiment.time, experiment.drive)
    force = (record.force - found.residual) / experiment.static_force
    label = f"{found.law.law} law, $a$ = {found.law.a / experiment.static_force:.2g} $F_s$, "
    label += f"$b$ = {found.law.b / experiment.static_force:.2g} $F_s$, "
    label += f"$D_c$ = {found.law.slip_distance * 1e9:.3g} nm"
    # As the table says of a law that does not describe the record.
    missed = found.relative_misfit(record)
    label += f" (misses {percent(missed)})" if missed > MAX_MISFIT else ""
    axes.plot(drive * 1e6, force, color="tab:red", label=label)
    axes.legend(loc="lower right")


def draw_force(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the force against the displacement of the load point, and the law that is nearer to
    it."""
    experiment = Experiment(tree)
    _draw_record(axes, experiment)
    record = record_of(experiment)
    if not isinstance(record, str):
        fits = []
        for law in LAWS:
            try:
                fits.append(fit(record, law))
            except RunError:
                continue
        if fits:
            _draw_law(axes, experiment, record, min(fits, key=lambda one: one.chi_square))


def draw_steady(axes: Axes, data: xr.Dataset) -> None:
    """Draw the steady force against the logarithm of the velocity, with its line."""
    data = data.isel(velocity_stage=np.isfinite(data["steady_force"].values))
    velocity = np.abs(data["velocity"].values)
    reference = float(velocity[0])
    scale = _scale(data, "steady_force")
    steady = data["is_steady"].values == 1
    force = data["steady_force"].values * scale
    error = data["steady_force_half_width"].values * scale
    at = np.log(velocity / reference)
    for chosen, colour in ((steady, "black"), (~steady, "0.7")):
        if chosen.any():
            axes.errorbar(
                at[chosen], force[chosen], error[chosen], fmt="o", color=colour, markersize=3
            )
    found = steady_line(data)
    if found is not None:
        ends = np.array([at.min(), at.max()])
        values = (found.level + found.slope * (ends + math.log(reference))) * scale
        error_text = "" if math.isnan(found.slope_error) else f" ± {found.slope_error * scale:.1g}"
        axes.plot(ends, values, color="tab:red")
        axes.set_title(f"$a - b$ = {found.slope * scale:.4f}{error_text}", loc="left")
    axes.set_xlabel(f"$\\ln(V/V_0)$, $V_0$ = {reference * 1e6:.3g} µm/s")
    axes.set_ylabel("steady force / $F_s$")


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
        error = "" if math.isnan(found.slope_error) else f" ± {found.slope_error * scale:.1g}"
        axes.set_title(f"$\\beta$ = {found.slope * scale:.4f}{error} per decade", loc="left")
    axes.set_xlabel("hold time (s)")
    axes.set_ylabel("(peak - steady force) / $F_s$")


def _scale(data: xr.Dataset, name: str) -> float:
    """One over the static force."""
    force, ratio = data[name].values, data[f"{name}_ratio"].values
    good = np.isfinite(force) & (force != 0)
    return float(ratio[good][0] / force[good][0]) if good.any() else 1.0


def overview(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """The record with the law that is nearer to it; steady forces; healing in holds."""
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
        draw_force(record, tree)
        record.set_title(tree.attrs.get("title", ""), loc="left", pad=22)
        if draws_steady:
            draw_steady(figure.add_subplot(panels[1, 0]), steady)
        if draws_healing:
            draw_healing(figure.add_subplot(panels[1, below - 1]), holds)
    return figure
