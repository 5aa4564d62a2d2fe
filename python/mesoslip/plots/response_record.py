"""The record of a response: the force against the displacement of the load point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.transforms import offset_copy
from numpy.typing import NDArray

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.array_types import Array
from mesoslip.output.arrays import Tree
from mesoslip.plots.style import BLUE, axes_width, titles, wrapped
from mesoslip.quantities import Scale, scale_for, with_unit

# Samples of the record at equal intervals of time, and at equal intervals of displacement.
MAX_DOTS = 20_000
# Maximum numbers of stages whose starts are marked, and of stages with labels.
MAX_MARKS = 200
MAX_LABELS = 12
# Distance of the title from the record, with the labels of stages between them [pt].
LABEL_ROOM = 22
# Distance of the lines of a legend, over the size of its font.
LINE_SPACING = 1.5
# Minimum distance of two labels, as a fraction of the width.
LABEL_WIDTH = 0.03


def force_unit(experiment: Experiment) -> Scale:
    """The unit of forces in pictures, whose name is the label of their axis."""
    if experiment.config is not None:
        return Scale("force over $F_s$", experiment.static_force)
    if experiment.apparatus.force_unit == "1":
        return Scale("friction coefficient", 1.0)
    scale = scale_for(float(np.max(np.abs(experiment.force))), "N")
    return Scale(scale.label("force"), scale.size)


def draw_record(axes: Axes, experiment: Experiment, scale: Scale) -> None:
    """Draw the force against the displacement of the load point in a unit."""
    shown = _dots(experiment)
    sign = next((one.direction for one in experiment.stages if one.direction), 1.0)
    unit = force_unit(experiment)
    force = sign * experiment.force.mean(axis=0) / unit.size
    x = sign * experiment.drive
    axes.plot(x[shown] / scale.size, force[shown], color="black", linewidth=0.6)
    steady = next((one for one in experiment.stages if experiment.mean_of(one) is not None), None)
    if steady is not None and len(experiment.stages) > 1:
        # The range of forces after steady sliding is reached: before, it may be far larger.
        mean = experiment.mean_of(steady)
        assert mean is not None
        later = force[experiment.samples(steady).start + mean.start :]
        margin = 0.15 * max(float(np.ptp(later)), 1e-3)
        axes.set_ylim(later.min() - 2 * margin, later.max() + margin)
    axes.set(xlabel=scale.label("displacement of the load point"), ylabel=unit.name)
    for stage in experiment.stages[1 : MAX_MARKS + 1]:
        start = x[experiment.start_sample(stage)] / scale.size
        axes.axvline(start, color=BLUE if stage.is_hold else "0.8", linewidth=0.5, zorder=0)
    _label_stages(axes, experiment, x, scale)


def fit_label(axes: Axes, parts: Sequence[str]) -> str:
    """A law and its parameters as a label in lines that fit into axes, each part on one line."""
    text = ", ".join(one.replace(" ", "\N{NO-BREAK SPACE}") for one in parts)
    return wrapped(text, axes_width(axes))


def title_record(axes: Axes, tree: Tree, about: str = "") -> None:
    """Write the title of an output, a legend, and a line about its stages, above the labels of the
    stages."""
    titles(axes, tree, about)
    labels = axes.get_legend_handles_labels()[1]
    lines = sum(label.count("\n") + 1 for label in labels)
    size = FontProperties(size=mpl.rcParams["legend.fontsize"])
    line = LINE_SPACING * size.get_size_in_points()
    if labels:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0, 1.0),
            bbox_transform=offset_copy(
                axes.transAxes, axes.figure.figure, y=LABEL_ROOM, units="points"
            ),
            borderaxespad=0.0,
            borderpad=0.0,
            handlelength=1.6,
        )
    pad = LABEL_ROOM + lines * line
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=pad)


def _dots(experiment: Experiment) -> NDArray[np.int64]:
    """Indices of samples of a line: equidistant in time, and equidistant along the drive."""
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
        if stage.is_hold:
            index, color = experiment.start_sample(stage), BLUE
            label = with_unit(stage.duration, "s")
        else:
            inside = experiment.samples(stage)
            index, color = (inside.start + inside.stop) // 2, "0.4"
            label = with_unit(abs(stage.velocity), "m/s", 3)
        position = x[min(index, x.size - 1)]
        # Labels of short stages would lie over each other.
        if abs(position - last) < min_distance:
            continue
        last = position
        axes.annotate(
            label,
            (position / scale.size, 1.0),
            xycoords=("data", "axes fraction"),
            fontsize="small",
            ha="center",
            va="bottom",
            color=color,
            rotation=40 if len(experiment.stages) > 4 else 0,
        )
