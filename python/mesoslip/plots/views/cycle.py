"""View of a settled cycle: force, velocity and detached contacts over a period."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.plots.style import CONTACT, SPRING, Canvas, canvas, curve_style, legend_above, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import Scale, scale_for, with_unit


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Forces, and the velocity of the slider, over a cycle."""
    data = tree["trace"].to_dataset()
    time, _ = _units([tree])
    speed = scale_for(_largest(data["velocity"].values), "m/s")
    figure = canvas(figure, (6.5, 4.6))
    force, velocity = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    draw_forces(force, tree, options)
    force.set_xlabel("")
    velocity.plot(
        data["time"].values / time.size, data["velocity"].values / speed.size, color="black"
    )
    velocity.set(ylabel=speed.label("velocity $V$"), xlabel=time.label("time from the section"))
    return figure


def draw_forces(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw spring and contact force over a cycle."""
    time, force = _units([tree])
    data = tree["trace"].to_dataset()
    at = data["time"].values / time.size
    axes.plot(at, data["contact_force"].values / force.size, **CONTACT)
    axes.plot(at, data["spring_force"].values / force.size, **SPRING)
    axes.set(ylabel=force.label("force"), xlabel=time.label("time from the section"))
    titles(axes, tree, mathematical=_summary(tree), beside_legend=True)
    legend_above(axes)


def draw_cycles(axes: Axes, trees: Sequence[DataTree], labels: Sequence[str], _: Options) -> None:
    """Draw the spring force of several cycles over each other."""
    time, force = _units(trees)
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        data = tree["trace"].to_dataset()
        axes.plot(
            data["time"].values / time.size,
            data["spring_force"].values / force.size,
            **curve_style(number),
            label=label,
        )
    axes.set(ylabel=force.label("spring force $F_d$"), xlabel=time.label("time from the section"))


def _summary(tree: DataTree) -> str:
    """The motion, its period and its leading multiplier."""
    motion = str(tree.attrs["settled_motion"])
    if motion == "smooth":
        return "smooth sliding"
    text = f"{motion}, $T$ = {with_unit(float(tree.attrs['period']), 's')}"
    multiplier = float(tree.attrs.get("multiplier", np.nan))
    return text if np.isnan(multiplier) else f"{text}, leading multiplier {multiplier:.2g}"


def _units(trees: Sequence[DataTree]) -> tuple[Scale, Scale]:
    """Units of time and force that suit all of some cycles."""
    data = [tree["trace"].to_dataset() for tree in trees]
    time = max(_largest(one["time"].values) for one in data)
    force = max(_largest(one["contact_force"].values) for one in data)
    return scale_for(time, "s"), scale_for(force, "N")


def _largest(values: np.ndarray) -> float:
    """Maximum of the absolute values; 1 if all are 0."""
    return float(np.max(np.abs(values), initial=0.0)) or 1.0


VIEW = View(
    name="cycle",
    kind="cycle",
    summary="forces and velocity over a cycle",
    draw_all=draw,
    panel=draw_forces,
    compare_panel=draw_cycles,
)
