"""Which picture is drawn of which output."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import xarray as xr
from matplotlib.axes import Axes

from mesoslip.analysis.avalanches import NO_AVALANCHES
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.plots import avalanches, posterior, run, theory
from mesoslip.plots.style import Canvas, styled

VIEWS = ("run", "avalanches", "lattice")


class Picture(NamedTuple):
    """A picture of an output: the whole of it, and the panel that tells most of it."""

    whole: Callable[[xr.DataTree, Canvas | None], Canvas]
    panel: Callable[[Axes, xr.DataTree], None]


def picture(tree: xr.DataTree, view: str | None = None, snapshot: int | None = None) -> Picture:
    """The picture of an output of any command; see `draw`."""
    if view not in {None, *VIEWS}:
        choice = ", ".join(VIEWS)
        raise ConfigError([Problem("", "view", f"no such picture; choose of {choice}", view)])
    if "spring_force" not in tree.data_vars:
        if view is not None:
            raise FileError(f"the output is not one of mesoslip run: it has no view {view!r}")
        if "posterior" in tree.children:
            return Picture(posterior.overview, posterior.draw_trace)
        if "slope" in tree.data_vars:
            return Picture(theory.force_curve, theory.draw_curve)
        return Picture(theory.slip_onset, theory.draw_drop)
    if view == "lattice":
        chosen = avalanches.chosen_snapshot(tree, snapshot)
        return Picture(
            lambda tree, figure: avalanches.lattice(tree, snapshot, figure),
            lambda axes, _: avalanches.draw_load(axes, chosen),
        )
    if view == "avalanches":
        if "avalanches" not in tree.children:
            raise FileError(NO_AVALANCHES)
        return Picture(avalanches.distribution, avalanches.draw_density)
    if tree.attrs.get("origin") == "measured":
        return Picture(run.overview, run.draw_force)
    if Config.from_toml(tree.attrs["configuration"]).slider.jumps:
        return Picture(avalanches.overview, avalanches.draw_force)
    return Picture(run.overview, run.draw_force)


def draw(
    tree: xr.DataTree,
    view: str | None = None,
    snapshot: int | None = None,
    *,
    figure: Canvas | None = None,
    axes: Axes | None = None,
) -> Canvas:
    """Draw a picture of an output of any command.

    Parameters
    ----------
    tree
        The output.
    view
        Of a run: "run", "avalanches" or "lattice"; by default what tells most.
    snapshot
        Number of the snapshot of a lattice; that after the largest avalanche by default.
    figure
        What to draw it into; a new figure by default.
    axes
        Where to draw only the panel that tells most.

    Raises
    ------
    FileError
        If the output does not have what is to be drawn.
    ConfigError
        If there is no such view.
    """
    chosen = picture(tree, view, snapshot)
    if axes is None:
        return chosen.whole(tree, figure)
    with styled():
        chosen.panel(axes, tree)
    return axes.figure
