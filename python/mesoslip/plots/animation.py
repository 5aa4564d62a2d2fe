"""Animations of the lattice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mesoslip.output.access import group_of
from mesoslip.output.targets import written_whole
from mesoslip.plots.lattice import MAX_POLYGONS, chosen_snapshot, draw_contacts
from mesoslip.plots.style import styled

MAX_FRAMES = 100
# Time for which a frame is shown [s].
FRAME_SECONDS = 0.08


def animate(tree: xr.DataTree, path: Path, number: int | None = None) -> Figure:
    """Write an animation: an avalanche that spreads, or the snapshots one after another.

    Raises
    ------
    FileError
        If there is no snapshot, or the file cannot be written.
    """
    snapshot = chosen_snapshot(tree, number)
    everything = group_of(tree, "snapshots")
    mine = everything["realization_index"].values == snapshot["realization_index"].item()
    everything = everything.isel(snapshot=np.flatnonzero(mine))
    spreads = bool(snapshot["avalanche_size"].item())
    with styled():
        figure = Figure(figsize=(3.6, 3.4), dpi=120)
        axes = figure.subplots()
        if spreads:
            generation = snapshot["generation"].values.astype(float)
            last = generation.max()
            steps = np.unique(np.linspace(0, last, min(MAX_FRAMES, int(last) + 1)).astype(int))
            generation[generation == 0] = np.nan
            frames = [np.where(generation <= now, generation, np.nan) for now in steps]
            titles = [f"generation {now}" for now in steps]
            style: dict[str, Any] = {"cmap": "inferno_r", "norm": Normalize(1, max(last, 2))}
        else:
            chosen = np.unique(
                np.linspace(0, everything.sizes["snapshot"] - 1, MAX_FRAMES).astype(int)
            )
            frames = [everything["load"].values[one] for one in chosen]
            titles = [f"{everything['snapshot_time'].values[one]:.6g} s" for one in chosen]
            style = {"cmap": "viridis", "norm": Normalize(-1, 1)}
        drawn = draw_contacts(axes, snapshot, frames[0], **style)
        label = "generation" if spreads else "force over threshold"
        figure.colorbar(ScalarMappable(style["norm"], style["cmap"]), ax=axes, label=label)

        def show(frame: int) -> list[Any]:
            values = np.ma.masked_invalid(frames[frame])
            drawn.set_array(values if frames[frame].size > MAX_POLYGONS else values.ravel())
            axes.set_title(titles[frame], loc="left")
            return [drawn]

        film = FuncAnimation(figure, show, frames=len(frames))
        with written_whole(path) as part:
            film.save(part, writer=PillowWriter(fps=round(1 / FRAME_SECONDS)))
    return figure
