"""Which picture is drawn of which outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import xarray as xr
from matplotlib.axes import Axes

from mesoslip.analysis.avalanches import NO_AVALANCHES
from mesoslip.configuration import differences
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.access import config_of, is_measured
from mesoslip.output.kinds import kind_of, kind_of_all
from mesoslip.plots import avalanches, posterior, response, run, sweep, theory
from mesoslip.plots.run import EVERYTHING, Extent
from mesoslip.plots.style import Canvas, canvas, legend_above, shared_legend, styled

VIEWS = ("run", "avalanches", "lattice", "layers", "response")


class Picture(NamedTuple):
    """A picture of outputs: the whole of it, and the panel that tells most of it."""

    whole: Callable[[Canvas | None], Canvas]
    panel: Callable[[Axes], None]


def picture(
    tree: xr.DataTree,
    view: str | None = None,
    snapshot: int | None = None,
    extent: Extent = EVERYTHING,
) -> Picture:
    """The picture of an output of any command; see `draw`."""
    kind = kind_of(tree)
    _check_view(kind, view, extent)
    if kind == "curve":
        return Picture(
            lambda figure: theory.force_curve(tree, figure),
            lambda axes: theory.draw_curve(axes, tree),
        )
    if kind == "onset":
        return Picture(
            lambda figure: theory.slip_onset(tree, figure),
            lambda axes: theory.draw_drop(axes, tree),
        )
    if kind == "sweep":
        return Picture(
            lambda figure: sweep.overview(tree, figure, view),
            lambda axes: sweep.draw_measure(axes, tree, view),
        )
    if kind == "fit":
        return Picture(
            lambda figure: posterior.overview(tree, figure),
            lambda axes: posterior.draw_trace(axes, tree),
        )
    if view == "lattice":
        chosen = avalanches.chosen_snapshot(tree, snapshot)
        return Picture(
            lambda figure: avalanches.lattice(tree, snapshot, figure),
            lambda axes: avalanches.draw_load(axes, chosen),
        )
    if view == "layers":
        return Picture(
            lambda figure: run.layers(tree, figure, extent),
            lambda axes: run.draw_layers(axes, tree, extent),
        )
    if view == "avalanches":
        _check_avalanches(tree)
        return Picture(
            lambda figure: avalanches.distribution(tree, figure),
            lambda axes: avalanches.draw_density(axes, tree),
        )
    if view == "response":
        return Picture(
            lambda figure: response.overview(tree, figure),
            lambda axes: response.draw_force(axes, tree),
        )
    room = run if is_measured(tree) or not config_of(tree).slider.jumps else avalanches
    return Picture(
        lambda figure: room.overview(tree, figure, extent),
        lambda axes: room.draw_force(axes, tree, extent),
    )


def comparison(
    trees: Sequence[xr.DataTree],
    names: Sequence[str],
    view: str | None = None,
    extent: Extent = EVERYTHING,
) -> Picture:
    """The picture of several outputs of one command over each other; see `draw`."""
    kind = kind_of_all(trees, names)
    if kind in {"sweep", "fit"}:
        raise FileError(f"{kind}s are drawn one at a time")
    _check_view(kind, view, extent)
    labels = labels_of(trees, names)
    if kind == "curve":
        return _alone(lambda axes: theory.draw_curves(axes, trees, labels), len(trees))
    if kind == "onset":
        return _alone(lambda axes: theory.draw_drops(axes, trees, labels), 2 * len(trees))
    if view == "avalanches":
        for tree in trees:
            _check_avalanches(tree)
        return Picture(
            lambda figure: avalanches.distributions(trees, labels, figure),
            _with_legend(lambda axes: avalanches.draw_densities(axes, trees, labels)),
        )
    if view not in {None, "run"}:
        raise ConfigError([Problem("", "view", "is of one output, not of several", view)])
    return Picture(
        lambda figure: run.comparison(trees, labels, figure, extent),
        lambda axes: run.compare_forces(axes, trees, labels, extent),
    )


def labels_of(trees: Sequence[xr.DataTree], names: Sequence[str]) -> list[str]:
    """A label for each output that says how it differs from the others."""
    short = [Path(name).stem if name.endswith(".nc") else name for name in names]
    try:
        configs = [config_of(tree) for tree in trees]
    except FileError:
        # Of a measured trace less may be known.
        return short
    labels = differences.labels(configs, short)
    return [
        f"measured: {name}" if is_measured(tree) else label
        for tree, name, label in zip(trees, short, labels, strict=True)
    ]


def _with_legend(panel: Callable[[Axes], None]) -> Callable[[Axes], None]:
    """What draws a panel, with a legend above it."""

    def drawn(axes: Axes) -> None:
        panel(axes)
        if axes.get_legend_handles_labels()[0]:
            legend_above(axes, columns=1)

    return drawn


def _alone(panel: Callable[[Axes], None], entries: int) -> Picture:
    """A picture that is one panel, with a legend of so many entries."""

    def whole(figure: Canvas | None) -> Canvas:
        with styled():
            figure = canvas(figure, (6.5, 3.2 + 0.16 * entries))
            axes = figure.subplots()
            panel(axes)
            if axes.get_legend_handles_labels()[0]:
                shared_legend(figure, axes)
        return figure

    return Picture(whole, _with_legend(panel))


def _check_view(kind: str, view: str | None, extent: Extent) -> None:
    """Whether there is such a picture of an output of a kind."""
    if kind == "sweep" and extent == EVERYTHING:
        return
    if view not in {None, *VIEWS}:
        choice = ", ".join(VIEWS)
        raise ConfigError([Problem("", "view", f"no such picture; choose of {choice}", view)])
    if kind == "run":
        return
    if view is not None:
        raise FileError(f"the output is not one of mesoslip run: it has no view {view!r}")
    if extent != EVERYTHING:
        raise FileError(
            "the output is not one of mesoslip run: it has no realizations, and no times to "
            "choose from"
        )


def _check_avalanches(tree: xr.DataTree) -> None:
    if "avalanches" not in tree.children:
        raise FileError(NO_AVALANCHES)


def draw(
    trees: Sequence[xr.DataTree],
    names: Sequence[str],
    view: str | None = None,
    snapshot: int | None = None,
    *,
    extent: Extent = EVERYTHING,
    figure: Canvas | None = None,
    axes: Axes | None = None,
) -> Canvas:
    """Draw a picture of outputs of any command.

    Parameters
    ----------
    trees, names
        The outputs, and what they are called where they do not differ. Several are drawn over each
        other.
    view
        Of a run: "run", "avalanches", "lattice", "layers" or "response"; by default what tells
        most.
    snapshot
        Number of the snapshot of a lattice; that after the largest avalanche by default.
    extent
        Which realization of a run, which times of it, and against what they are drawn.
    figure
        What to draw it into; a new figure by default.
    axes
        Where to draw only the panel that tells most.

    Raises
    ------
    FileError
        If the outputs do not have what is to be drawn.
    ConfigError
        If there is no such view.
    """
    if len(trees) == 1:
        chosen = picture(trees[0], view, snapshot, extent)
    else:
        chosen = comparison(trees, names, view, extent)
    if axes is None:
        return chosen.whole(figure)
    with styled():
        chosen.panel(axes)
    return axes.figure
