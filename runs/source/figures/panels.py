"""Panels that several figures share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.traces import draw_series


def shared_panels(figure: Figure, rows: int, columns: int) -> NDArray[Any]:
    """Panels with common axes, shape (rows, columns)."""
    return np.asarray(figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row"))


def stacked(trees: Sequence[xr.DataTree], title: Callable[[xr.DataTree], str]) -> Figure:
    """The spring forces of runs, one below the other."""
    figure = Figure(figsize=(6.5, 1.5 * len(trees) + 0.5))
    panels = shared_panels(figure, len(trees), 1)[:, 0]
    for letter, axes, tree in zip("abcdefgh", panels, trees, strict=False):
        draw_series(axes, tree, "spring_force", color="black")
        axes.set_title(f"({letter}) {title(tree)}", loc="left")
        axes.set(ylabel="$F_d$ (µN)", xlim=(0, tree["time"].max().item()))
    panels[-1].set_xlabel("time (s)")
    return figure
