"""The response to a drive by force: displacement, velocities of creep, static friction."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.response.dataset import response_of
from mesoslip.analysis.response.forces import creep_line, friction_line
from mesoslip.array_types import Array
from mesoslip.configuration.config import Config
from mesoslip.errors import MesoslipError
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.response_record import MAX_MARKS
from mesoslip.plots.style import BLUE, POINTS, RED, Canvas, canvas, titles, write_title
from mesoslip.quantities import scale_for, with_error
from mesoslip.theory.contacts import contact_theory

# Maximum number of samples of the displacement that are drawn; velocities of the theory.
MAX_DOTS, THEORY_POINTS = 20_000, 30


def draw_forced(tree: Tree, experiment: Experiment, figure: Canvas | None) -> Canvas:
    """Displacement over time; creep velocities with those of the theory; static friction."""
    found = response_of([experiment], with_fit=False)
    creep, ramps = found.children["creep"], found.children["ramps"]
    creep = creep.isel(force_stage=creep["velocity"].values > 2 * creep["velocity_error"].values)
    ramps = ramps.isel(ramp=np.isfinite(ramps["static_friction"].values))
    drawn = ((_draw_creep, creep), (_draw_friction, ramps))
    panels = [(draw, data) for draw, data in drawn if data["stage_number"].values.size]
    figure = canvas(figure, (6.5, 5.0 if panels else 3.0))
    grid = figure.add_gridspec(2 if panels else 1, max(1, len(panels)))
    _draw_displacement(figure.add_subplot(grid[0, :]), tree, experiment)
    for column, (draw, data) in enumerate(panels):
        draw(figure.add_subplot(grid[1, column]), experiment, data)
    return figure


def _draw_displacement(axes: Axes, tree: Tree, experiment: Experiment) -> None:
    """Draw the displacement of each realization over time, and the starts of stages."""
    step = max(1, experiment.time.size // MAX_DOTS)
    length = scale_for(float(np.max(np.abs(experiment.displacement))), "m")
    time = scale_for(float(experiment.time[-1]), "s")
    x = experiment.time[::step] / time.size
    for one in experiment.displacement[:, ::step]:
        axes.plot(x, one / length.size, color="black", linewidth=0.6)
    for stage in experiment.stages[1 : MAX_MARKS + 1]:
        axes.axvline(stage.start / time.size, color="0.8", linewidth=0.5, zorder=0)
    force = axes.twinx()
    force.plot(x, experiment.force[0, ::step] / experiment.static_force, color=BLUE, linewidth=0.8)
    force.set_ylabel("force over $F_s$", color=BLUE)
    force.tick_params(axis="y", colors=BLUE)
    force.spines["right"].set(visible=True, color=BLUE)
    # From no force on, so that the size of steps is seen.
    low, high = min(0.0, force.get_ylim()[0]), max(0.0, force.get_ylim()[1])
    force.set_ylim(1.1 * low, 1.1 * high)
    axes.set(xlabel=time.label("time"), ylabel=length.label("displacement"))
    titles(axes, tree)


def _draw_creep(axes: Axes, experiment: Experiment, data: Arrays) -> None:
    """Draw the force over the velocity of creep, and that of the theory with damping."""
    velocity, force = data["velocity"].values, data["force"].values / experiment.static_force
    unit = scale_for(float(np.max(velocity)), "m/s")
    is_steady = data["is_steady"].values == 1
    error = data["velocity_error"].values / unit.size
    for chosen, colour in ((is_steady, "black"), (~is_steady, "0.7")):
        x, xerr = velocity[chosen] / unit.size, error[chosen]
        axes.errorbar(x, force[chosen], xerr=xerr, **POINTS | {"color": colour})
    config = experiment.config
    grid = np.geomspace(0.5 * velocity.min(), 2 * velocity.max(), THEORY_POINTS)
    theory = None if config is None else _creep_forces(config, grid)
    if theory is not None:
        relative = theory / experiment.static_force
        axes.plot(grid / unit.size, relative, color=RED, label="$F(v)$ and damping, theory")
        axes.legend(loc="upper left")
    logarithmic(axes, "x")
    line = creep_line(data)
    if line is not None:
        scale = 1 / experiment.static_force
        slope = with_error(line.slope * scale, line.slope_error * scale)
        write_title(axes, f"$dF/d\\ln v$ = {slope} $F_s$")
    axes.set(xlabel=unit.label("velocity of creep"), ylabel="force over $F_s$")


def _creep_forces(config: Config, velocity: Array) -> Array | None:
    """Forces of creep at velocities [m/s], in N; None without a theory."""
    theory = contact_theory(config)
    try:
        return np.array([theory.creep_force(one) for one in velocity])
    except MesoslipError:
        return None


def _draw_friction(axes: Axes, experiment: Experiment, data: Arrays) -> None:
    """Draw the static friction over the rate of the force, with a line."""
    scale = 1 / experiment.static_force
    rate, friction = data["force_rate"].values, data["static_friction"].values
    unit = scale_for(float(np.max(rate)), "N/s")
    error = np.nan_to_num(data["static_friction_error"].values) * scale
    axes.errorbar(rate / unit.size, friction * scale, error, **POINTS)
    logarithmic(axes, "x")
    line = friction_line(data)
    if line is not None:
        ends = np.array([rate.min(), rate.max()])
        axes.plot(ends / unit.size, (line.level + line.slope * np.log(ends)) * scale, color=RED)
        slope = with_error(line.slope * scale, line.slope_error * scale)
        write_title(axes, f"slope over ln of the rate = {slope} $F_s$")
    axes.set(xlabel=unit.label("rate of the force"), ylabel="static friction over $F_s$")
