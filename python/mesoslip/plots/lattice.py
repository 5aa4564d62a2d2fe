"""Snapshots of the contacts on their lattice."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.quantities import with_unit

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Contacts that are drawn as a polygon each; more of them become an image.
MAX_POLYGONS = 20_000
# Width of a lattice in a picture, or its height if that is greater [inch].
LATTICE_WIDTH = 2.6
# Width of the colours beside a lattice, and height of the title over it [inch].
BESIDE_LATTICE, OVER_LATTICE = 1.0, 0.45
# Colour of missing values.
BLANK = "0.93"


def draw_contacts(axes: Axes, snapshots: xr.Dataset, values: Array, **style: Any) -> Any:
    """Draw a value of each contact at its site, shape (rows, columns); NaN in light grey."""
    style["cmap"] = mpl.colormaps[style["cmap"]].with_extremes(bad=BLANK)
    x, y = snapshots["x"].values, snapshots["y"].values
    spacing = x[0, 1] - x[0, 0]
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    is_triangular = bool(x[1, 0] > 0.25 * spacing)
    if values.size > MAX_POLYGONS:
        height = y[1, 0] - y[0, 0]
        extent = (0, spacing * values.shape[1], 0, height * values.shape[0])
        return axes.imshow(values, origin="lower", extent=extent, interpolation="nearest", **style)
    corners = np.arange(6) / 6 + 1 / 12 if is_triangular else np.arange(4) / 4 + 1 / 8
    radius = 1.01 * spacing / (2 * np.cos(np.pi / len(corners)))
    shape = radius * np.stack([np.cos(2 * np.pi * corners), np.sin(2 * np.pi * corners)], axis=1)
    sites = np.stack([x.ravel(), y.ravel()], axis=1)
    polygons = PolyCollection(
        sites[:, None, :] + shape[None, :, :], array=np.ma.masked_invalid(values.ravel()), **style
    )
    axes.add_collection(polygons)
    axes.set_xlim(x.min() - spacing, x.max() + spacing)
    axes.set_ylim(y.min() - spacing, y.max() + spacing)
    return polygons


def chosen_snapshot(tree: xr.DataTree, number: int | None = None) -> xr.Dataset:
    """The snapshot of a number; by default that after the largest avalanche, or the last one.

    Raises
    ------
    FileError
        If the output has no snapshots, or no such snapshot.
    """
    if "snapshots" not in tree.children:
        raise FileError(
            "the output has no snapshots of its contacts; they are recorded at the times of "
            "output.snapshots, and after avalanches of output.snapshot_size and more"
        )
    data = group_of(tree, "snapshots")
    count = data.sizes["snapshot"]
    if count == 0:
        raise FileError(
            "the output has no snapshot: the run had no avalanche of output.snapshot_size, or "
            "ended before the first time of output.snapshots"
        )
    if number is None:
        sizes = data["avalanche_size"].values
        number = int(np.argmax(sizes)) if sizes.max() > 0 else count - 1
    if not 0 <= number < count:
        raise FileError(f"there is no snapshot {number}; the last one is {count - 1}")
    return data.isel(snapshot=number)


def chosen_lattice(tree: xr.DataTree, number: int | None = None) -> xr.Dataset:
    """The same of contacts on a lattice.

    Raises
    ------
    FileError
        If the output has no such snapshot, or its contacts have no sites.
    """
    snapshot = chosen_snapshot(tree, number)
    if not is_on_lattice(snapshot):
        raise FileError(
            "the contacts of the output have no sites, which [interaction] gives them; "
            '--view contacts (view="contacts") shows their stretches'
        )
    return snapshot


def is_on_lattice(snapshots: xr.Dataset) -> bool:
    """Whether the contacts of snapshots have sites."""
    return "row" in snapshots.sizes


def lattice_size(snapshots: xr.Dataset) -> tuple[float, float]:
    """Width and height of axes in which the lattice leaves no empty space [inch]."""
    x, y = snapshots["x"].values, snapshots["y"].values
    spacing = x[0, 1] - x[0, 0]
    aspect = (np.ptp(y) + 2 * spacing) / (np.ptp(x) + 2 * spacing)
    width = LATTICE_WIDTH * min(1.0, 1.0 / aspect)
    return width, width * aspect


def load_range(load: Array) -> Normalize:
    """Limits of the colours of loads: from 0, or the minimum, to the threshold."""
    return Normalize(min(0.0, math.floor(10 * np.nanmin(load, initial=0.0)) / 10), 1.0)


def draw_load(axes: Axes, snapshot: xr.Dataset) -> None:
    """Draw the force over threshold of the contacts of a snapshot."""
    load = snapshot["load"].values
    drawn = draw_contacts(axes, snapshot, load, cmap="viridis", norm=load_range(load))
    axes.figure.colorbar(drawn, ax=axes, label="force over threshold")
    time = with_unit(snapshot["snapshot_time"].item(), "s", 6)
    axes.set_title(f"snapshot at {time}\ngrey: detached", loc="left")


def draw_generations(axes: Axes, snapshot: xr.Dataset) -> None:
    """Draw the generation in which each contact of an avalanche broke."""
    generation = snapshot["generation"].values.astype(float)
    generation[generation == 0] = np.nan
    drawn = draw_contacts(
        axes, snapshot, generation, cmap="inferno_r", norm=Normalize(1, np.nanmax(generation))
    )
    axes.figure.colorbar(drawn, ax=axes, label="generation")
