"""View of the stretches of contacts at a snapshot, with their thresholds, and which break next."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import StepPatch
from numpy.typing import NDArray

from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.output.access import config_of
from mesoslip.plots.movie import Movie
from mesoslip.plots.snapshots import chosen_snapshot, draw_time_bar, snapshot_frames, snapshots_of
from mesoslip.plots.style import BLUE, RED, Canvas, canvas, legend_above, legend_rows
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for, with_unit

BINS = 80
# Relative rounding errors of stretches and displacements.
ROUNDING = 1e-9
# Loads below which a threshold does not follow from stretch and load.
MIN_LOAD = 1e-6


def breaking(before: Dataset, after: Dataset | None) -> NDArray[np.bool_]:
    """Which pinned contacts break before a later snapshot: they do not stretch with the slider."""
    stretch = before["stretch"].values.ravel()
    if after is None:
        return np.zeros(stretch.shape, dtype=bool)
    later = after["stretch"].values.ravel()
    moved = after["displacement"].item() - before["displacement"].item()
    size = np.nanmax(np.abs(stretch), initial=0.0) + abs(after["displacement"].item())
    pinned = np.isfinite(stretch)
    found: NDArray[np.bool_] = pinned & ~(np.abs(later - stretch - moved) <= ROUNDING * size)
    return found


def thresholds(tree: DataTree, snapshot: Dataset) -> Array | None:
    """Stretches at which the pinned contacts of a snapshot break [m]; None with interaction."""
    if config_of(tree).contact_kind.has_neighbours:
        return None
    stretch, load = snapshot["stretch"].values.ravel(), snapshot["load"].values.ravel()
    known = np.abs(np.nan_to_num(load)) > MIN_LOAD
    found: Array = stretch[known] / load[known]
    return found


class _Histogram:
    """A histogram of stretches, for one snapshot after another."""

    def __init__(self, axes: Axes, tree: DataTree, data: Dataset) -> None:
        self.tree, self.axes = tree, axes
        config = config_of(tree)
        self.count = config.contacts.count
        mean = config.contacts.break_stretch
        low, high = (float(extreme(data["stretch"].values)) for extreme in (np.nanmin, np.nanmax))
        first = thresholds(tree, data.isel(snapshot=0))
        top = mean if first is None or not first.size else float(np.max(first))
        low, high = min(low, 0.0), max(high, top, mean) * 1.02
        self.scale = scale_for(max(-low, high), "m")
        self.edges = np.linspace(low, high, BINS + 1)
        edges = self.edges / self.scale.size
        self.pinned = _steps(edges, BLUE, alpha=0.55, label="pinned contacts")
        self.broken = _steps(edges, RED, label="break before the next snapshot")
        outline = {"fill": False, "edgecolor": "black", "linewidth": 0.9}
        self.limits = _steps(edges, "none", label="their thresholds", **outline)
        for one in (self.pinned, self.broken, self.limits):
            axes.add_patch(one)
        if first is None:
            self.limits.set_visible(False)
            self.limits.set_label("_thresholds")
            label = "mean threshold without neighbours"
            axes.axvline(mean / self.scale.size, color="black", linestyle="--", label=label)
        highest = 1
        for index, stretch in enumerate(data["stretch"].values):
            highest = max(highest, *self._counts(stretch.ravel()))
            limits = thresholds(tree, data.isel(snapshot=index))
            if limits is not None:
                highest = max(highest, *self._counts(limits))
        axes.set_xlim(edges[0], edges[-1])
        # A few contacts that break are visible beside many that do not.
        axes.set_yscale("symlog", linthresh=10)
        axes.set(ylim=(0, 1.5 * highest), xlabel=self.scale.label("stretch"), ylabel="contacts")
        legend_above(axes)

    def _counts(self, values: Array) -> NDArray[np.intp]:
        return np.histogram(values[np.isfinite(values)], self.edges)[0]

    def show(self, snapshot: Dataset, after: Dataset | None) -> None:
        """Show a snapshot, with the contacts that break before the next one."""
        stretch = snapshot["stretch"].values.ravel()
        is_breaking = breaking(snapshot, after)
        self.pinned.set_data(self._counts(stretch))
        self.broken.set_data(self._counts(stretch[is_breaking]))
        limits = thresholds(self.tree, snapshot)
        if limits is not None:
            self.limits.set_data(self._counts(limits))
        detached = int(np.count_nonzero(~np.isfinite(stretch)))
        time = with_unit(snapshot["snapshot_time"].item(), "s", 6)
        text = f"{time}: {detached} of {self.count} detached"
        if after is not None:
            text += f", {int(is_breaking.sum())} break"
        self.axes.set_title(text + "\n" * legend_rows(self.axes), loc="left")


def _steps(edges: Array, color: str, **style: object) -> StepPatch:
    style = {"fill": True, "facecolor": color, "edgecolor": "none"} | style
    return StepPatch(np.zeros(edges.size - 1), edges, baseline=0, **style)  # type: ignore[arg-type]


def _panel(axes: Axes, tree: DataTree, options: Options) -> None:
    snapshot = chosen_snapshot(tree, options.snapshot)
    data = snapshots_of(tree, snapshot)
    index = int(np.flatnonzero(data["snapshot_time"].values == snapshot["snapshot_time"].item())[0])
    later = data.isel(snapshot=index + 1) if index + 1 < data.sizes["snapshot"] else None
    _Histogram(axes, tree, data.isel(snapshot=[index])).show(snapshot, later)


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Stretches of the contacts at a snapshot."""
    figure = canvas(figure, (4.4, 3.2))
    _panel(figure.subplots(), tree, options)
    return figure


def movie(tree: DataTree, options: Options) -> Movie:
    """The stretches at one snapshot after another, above the force over time."""
    data = snapshots_of(tree, chosen_snapshot(tree, options.snapshot))
    frames, times = snapshot_frames(data), data["snapshot_time"].values
    figure = canvas(None, (4.4, 4.2))
    above, below = figure.subplots(2, 1, height_ratios=[3, 1])
    histogram = _Histogram(above, tree, data)
    move: Callable[[float], None] = draw_time_bar(below, tree, data.isel(snapshot=0), times)

    def show(number: int) -> None:
        index = frames[number]
        later = frames[number + 1] if number + 1 < len(frames) else None
        after = None if later is None else data.isel(snapshot=later)
        histogram.show(data.isel(snapshot=index), after)
        move(times[index])

    return Movie(figure, len(frames), show)  # type: ignore[arg-type]


VIEW = View(
    name="contacts",
    kind="run",
    summary="stretches of the contacts with their thresholds, at a snapshot; movie",
    draw_all=draw,
    panel=_panel,
    options=frozenset({"snapshot"}),
    movie=movie,
)
