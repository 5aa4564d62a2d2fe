"""View of the contacts on their lattice, and of the avalanche before a snapshot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from mesoslip.plots.lattice import (
    BESIDE_LATTICE,
    OVER_LATTICE,
    chosen_lattice,
    draw_generations,
    draw_load,
    lattice_size,
)
from mesoslip.plots.lattice_movie import lattice_movie
from mesoslip.plots.printing import is_narrow
from mesoslip.plots.style import Canvas, canvas, styled
from mesoslip.plots.views.base import Options, View

if TYPE_CHECKING:
    import xarray as xr


def draw(tree: xr.DataTree, options: Options, figure: Canvas | None = None) -> Canvas:
    """Force over threshold of each contact, and generations of the avalanche before."""
    snapshot = chosen_lattice(tree, options.snapshot)
    size = snapshot["avalanche_size"].item()
    with styled():
        count = 2 if size else 1
        width, height = lattice_size(snapshot)
        rows, columns = (count, 1) if is_narrow(figure) else (1, count)
        whole = columns * (width + BESIDE_LATTICE), rows * (height + OVER_LATTICE)
        figure = canvas(figure, whole)
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        draw_load(panels[0], snapshot)
        if size:
            draw_generations(panels[1], snapshot)
            panels[1].set_title(f"avalanche of size {size}", loc="left")
    return figure


def draw_panel(axes: Axes, tree: xr.DataTree, options: Options) -> None:
    """Draw the force over threshold of each contact."""
    draw_load(axes, chosen_lattice(tree, options.snapshot))


VIEW = View(
    name="lattice",
    kind="run",
    summary="contacts on their lattice, at a snapshot; movie",
    draw=draw,
    panel=draw_panel,
    options=frozenset({"snapshot"}),
    movie=lambda tree, options: lattice_movie(tree, options.snapshot),
)
