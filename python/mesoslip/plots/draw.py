"""Which picture is drawn of which output."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from mesoslip.analysis.avalanches import NO_AVALANCHES
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.plots import avalanches, run, theory


def draw(tree: xr.DataTree, view: str | None = None, snapshot: int | None = None) -> Figure:
    """A picture of an output of any command.

    Parameters
    ----------
    tree
        The output.
    view
        Of a run: "run", "avalanches" or "lattice"; by default what tells most.
    snapshot
        Number of the snapshot of a lattice; that after the largest avalanche by default.

    Raises
    ------
    FileError
        If the output does not have what is to be drawn.
    """
    if "spring_force" not in tree.data_vars:
        if view is not None:
            raise FileError(f"the output is not one of mesoslip run: it has no view {view!r}")
        return theory.force_curve(tree) if "slope" in tree.data_vars else theory.slip_onset(tree)
    if view == "lattice":
        return avalanches.lattice(tree, snapshot)
    if view == "avalanches":
        if "avalanches" not in tree.children:
            raise FileError(NO_AVALANCHES)
        return avalanches.distribution(tree)
    if Config.from_toml(tree.attrs["configuration"]).slider.jumps:
        return avalanches.overview(tree)
    return run.overview(tree)
