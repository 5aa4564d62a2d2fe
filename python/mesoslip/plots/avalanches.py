"""Pictures of avalanches: how large they are, and how one spreads over the lattice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import (
    PowerLawFit,
    ccdf,
    fit_power_law,
    logarithmic_bins,
)
from mesoslip.analysis.avalanches import failures
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.output.samples import times_of
from mesoslip.output.targets import written_whole
from mesoslip.plots.run import (
    EVERYTHING,
    Abscissa,
    Extent,
    about,
    abscissa,
    curve,
    draw_curves,
)
from mesoslip.plots.style import (
    COLORS,
    Canvas,
    canvas,
    shared_legend,
    styled,
    titles,
)

Array = NDArray[np.float64]

# Contacts up to which each is drawn as a polygon; more of them make an image.
MOST_POLYGONS = 20_000
# Frames of an animation at most, and how long each is shown [s].
MOST_FRAMES = 100
FRAME_SECONDS = 0.08

# Avalanches of which each is a mark of its own in a picture without dots of its own.
MOST_MARKS = 3000

BLANK = "0.93"


def _against_displacement(extent: Extent) -> Extent:
    """What is drawn, against the displacement unless something else was asked for."""
    return replace(extent, against=extent.against or "displacement")


def draw_force(
    axes: Axes, tree: xr.DataTree, extent: Extent = EVERYTHING, along: Abscissa | None = None
) -> None:
    """Draw the contact force against the displacement of the slider."""
    extent = _against_displacement(extent)
    curves = [curve(tree, "contact_force", extent, color="black")]
    draw_curves(axes, curves, "contact_force", along or abscissa([tree], extent))
    titles(axes, tree, about(tree, Extent(extent.first)))


def overview(
    tree: xr.DataTree, figure: Canvas | None = None, extent: Extent = EVERYTHING
) -> Canvas:
    """Contact force and sizes of avalanches against the displacement of the slider."""
    extent = _against_displacement(extent)
    along, data = abscissa([tree], extent), _catalogue(tree, extent)
    count = Config.from_toml(tree.attrs["configuration"]).contacts.count
    with styled():
        figure = canvas(figure, (6.5, 5))
        force, sizes = figure.subplots(2, 1, sharex=True)
        draw_force(force, tree, extent, along)
        force.set_xlabel("")
        name, _ = extent.abscissa
        if name == "time":
            where = data["start_time"].values
        elif name == "displacement":
            where = data["displacement"].values
        else:
            moved = tree.to_dataset()[name].isel(realization=extent.first).values
            where = np.interp(data["start_time"].values, times_of(tree), moved)
        sizes.semilogy(
            where / along.scale.size,
            data["size"].values,
            ".",
            color="black",
            markersize=2,
            rasterized=where.size > MOST_MARKS,
        )
        sizes.set_ylabel("avalanche size")
        sizes.set_ylim(0.8, 1.25 * max(count, data["size"].values.max(initial=1)))
        sizes.axhline(count, color="tab:red", linewidth=0.6)
        found = "" if where.size else "no avalanche; "
        sizes.set_title(f"{found}red: as many as all contacts", loc="left")
        along.prepare(sizes)
    return figure


def _catalogue(tree: xr.DataTree, extent: Extent) -> xr.Dataset:
    """Avalanches of a realization in a window of time."""
    data = group_of(tree, "avalanches")
    starts = data["start_time"].values
    mine = data["realization_index"].values == extent.first
    mine &= (starts >= extent.start) & (starts <= extent.end)
    return data.isel(avalanche=np.flatnonzero(mine))


def draw_distribution(
    axes: Axes, sizes: Array, fit: PowerLawFit | None = None, **style: Any
) -> None:
    """Density of avalanche sizes in logarithmic bins, and a law that was fitted to them."""
    bins = logarithmic_bins(sizes)
    (points,) = axes.loglog(
        bins.centre, bins.density, "o", markersize=2.5, **{"color": "black"} | style
    )
    if fit is None:
        return
    fitted = bins.centre >= fit.min_size
    centre, width = bins.centre[fitted], np.diff(bins.edges[fitted], axis=1)[:, 0]
    law = fit.forms[0].relative_probability(centre)
    law *= np.sum(bins.density[fitted] * width) / np.sum(law * width)
    axes.loglog(centre, law, color=points.get_color(), linewidth=0.7, alpha=0.7)


def sizes_of_law(tree: xr.DataTree) -> Array:
    """Sizes of the avalanches of an output, without those that broke all that was left."""
    data = group_of(tree, "avalanches")
    sizes: Array = data["size"].values[~failures(tree, data)]
    return sizes


def draw_density(axes: Axes, tree: xr.DataTree) -> None:
    """Draw the density of the sizes of avalanches, and the law that fits them."""
    sizes = sizes_of_law(tree)
    fit = fit_power_law(sizes)
    draw_distribution(axes, sizes, fit)
    axes.set_xlabel("avalanche size $s$")
    axes.set_ylabel("$P(s)$")
    if fit is not None:
        cutoff = {1.0: "e^{-s/s_c}", 2.0: "e^{-(s/s_c)^2}"}.get(fit.form.cutoff_shape, "")
        label = rf"$s^{{-\tau}}{cutoff}$, $\tau$ = {fit.exponent:.3f} ± "
        label += f"{fit.exponent_error:.3f}"
        if fit.cutoff_is_resolved:
            label += f"\n$s_c$ = {fit.cutoff:.3g} ± {fit.cutoff_error:.2g}"
        label += f"\nfrom $s$ = {fit.min_size} on, {fit.count / sizes.size:.2g} of them"
        if fit.is_rejected:
            label += f"\nrejected: sizes do not follow this law (p = {fit.p_value:.2g})"
        axes.set_title(label, loc="left", color="tab:red" if fit.is_rejected else "black")


def distribution(tree: xr.DataTree, figure: Canvas | None = None) -> Canvas:
    """Density and complementary cumulative distribution of the sizes of avalanches."""
    with styled():
        figure = canvas(figure, (6.5, 3))
        density, cumulative = figure.subplots(1, 2)
        draw_density(density, tree)
        cumulative.loglog(*ccdf(sizes_of_law(tree)), color="black", drawstyle="steps-pre")
        cumulative.set_xlabel("avalanche size $s$")
        cumulative.set_ylabel("$P(S \\geq s)$")
        titles(cumulative, tree)
    return figure


def draw_densities(axes: Axes, trees: Sequence[xr.DataTree], labels: Sequence[str]) -> None:
    """Draw the densities of the sizes of avalanches of several outputs over each other."""
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        color = COLORS[number % len(COLORS)]
        draw_distribution(axes, sizes_of_law(tree), color=color, label=label)
    axes.set_xlabel("avalanche size $s$")
    axes.set_ylabel("$P(s)$")


def distributions(
    trees: Sequence[xr.DataTree], labels: Sequence[str], figure: Canvas | None = None
) -> Canvas:
    """Densities and complementary cumulative distributions of avalanches of several outputs."""
    with styled():
        figure = canvas(figure, (6.5, 3 + 0.16 * len(trees)))
        density, cumulative = figure.subplots(1, 2)
        draw_densities(density, trees, labels)
        for number, tree in enumerate(trees):
            color = COLORS[number % len(COLORS)]
            cumulative.loglog(*ccdf(sizes_of_law(tree)), color=color, drawstyle="steps-pre")
        cumulative.set_xlabel("avalanche size $s$")
        cumulative.set_ylabel("$P(S \\geq s)$")
        shared_legend(figure, density)
    return figure


def draw_contacts(axes: Axes, snapshots: xr.Dataset, values: Array, **style: Any) -> Any:
    """Draw a value of each contact at its place, shape (rows, columns); NaN in light grey."""
    style["cmap"] = mpl.colormaps[style["cmap"]].with_extremes(bad=BLANK)
    x, y = snapshots["x"].values, snapshots["y"].values
    spacing = x[0, 1] - x[0, 0]
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    is_triangular = bool(x[1, 0] > 0.25 * spacing)
    if values.size > MOST_POLYGONS:
        height = y[1, 0] - y[0, 0]
        extent = (0, spacing * values.shape[1], 0, height * values.shape[0])
        return axes.imshow(values, origin="lower", extent=extent, interpolation="nearest", **style)
    corners = np.arange(6) / 6 + 1 / 12 if is_triangular else np.arange(4) / 4 + 1 / 8
    radius = 1.01 * spacing / (2 * np.cos(np.pi / len(corners)))
    shape = radius * np.stack([np.cos(2 * np.pi * corners), np.sin(2 * np.pi * corners)], axis=1)
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    polygons = PolyCollection(
        places[:, None, :] + shape[None, :, :], array=np.ma.masked_invalid(values.ravel()), **style
    )
    axes.add_collection(polygons)
    axes.set_xlim(x.min() - spacing, x.max() + spacing)
    axes.set_ylim(y.min() - spacing, y.max() + spacing)
    return polygons


def chosen_snapshot(tree: xr.DataTree, number: int | None = None) -> xr.Dataset:
    """A snapshot: that of the given number, or after the largest avalanche, or the last.

    Raises
    ------
    FileError
        If the output has no snapshots, or none of this number.
    """
    if "snapshots" not in tree.children:
        raise FileError(
            "the output has no snapshots of the lattice; ask for them by output.snapshots (times) "
            "or output.snapshot_size (after avalanches at least that large)"
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


def draw_load(axes: Axes, snapshot: xr.Dataset) -> None:
    """Draw how near to breaking the contacts of a snapshot are."""
    drawn = draw_contacts(
        axes, snapshot, snapshot["load"].values, cmap="viridis", norm=Normalize(-1, 1)
    )
    axes.figure.colorbar(drawn, ax=axes, shrink=0.8, label="force over threshold")
    axes.set_title(f"{snapshot['snapshot_time'].item():.6g} s; grey: detached", loc="left")


def lattice(tree: xr.DataTree, number: int | None = None, figure: Canvas | None = None) -> Canvas:
    """The contacts on their lattice: how near to breaking, and in what order those of an avalanche
    broke."""
    snapshot = chosen_snapshot(tree, number)
    size = snapshot["avalanche_size"].item()
    with styled():
        figure = canvas(figure, (6.5, 3.4) if size else (3.6, 3.4))
        panels = figure.subplots(1, 2 if size else 1, squeeze=False)[0]
        draw_load(panels[0], snapshot)
        if size:
            draw_generations(panels[1], snapshot)
            panels[1].set_title(f"an avalanche of {size} breaks", loc="left")
    return figure


def draw_generations(axes: Axes, snapshot: xr.Dataset) -> None:
    """Draw the order in which the contacts of an avalanche let go."""
    generation = snapshot["generation"].values.astype(float)
    generation[generation == 0] = np.nan
    drawn = draw_contacts(
        axes, snapshot, generation, cmap="inferno_r", norm=Normalize(1, np.nanmax(generation))
    )
    axes.figure.colorbar(drawn, ax=axes, shrink=0.8, label="generation")


def animate(tree: xr.DataTree, path: Path, number: int | None = None) -> Figure:
    """Write an animation: an avalanche that spreads, or else the snapshots one after another.

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
            steps = np.unique(np.linspace(0, last, min(MOST_FRAMES, int(last) + 1)).astype(int))
            generation[generation == 0] = np.nan
            frames = [np.where(generation <= now, generation, np.nan) for now in steps]
            titles = [f"generation {now}" for now in steps]
            style: dict[str, Any] = {"cmap": "inferno_r", "norm": Normalize(1, max(last, 2))}
        else:
            chosen = np.unique(
                np.linspace(0, everything.sizes["snapshot"] - 1, MOST_FRAMES).astype(int)
            )
            frames = [everything["load"].values[one] for one in chosen]
            titles = [f"{everything['snapshot_time'].values[one]:.6g} s" for one in chosen]
            style = {"cmap": "viridis", "norm": Normalize(-1, 1)}
        drawn = draw_contacts(axes, snapshot, frames[0], **style)
        label = "generation" if spreads else "force over threshold"
        figure.colorbar(ScalarMappable(style["norm"], style["cmap"]), ax=axes, label=label)

        def show(frame: int) -> list[Any]:
            values = np.ma.masked_invalid(frames[frame])
            drawn.set_array(values if frames[frame].size > MOST_POLYGONS else values.ravel())
            axes.set_title(titles[frame], loc="left")
            return [drawn]

        film = FuncAnimation(figure, show, frames=len(frames))
        with written_whole(path) as part:
            film.save(part, writer=PillowWriter(fps=round(1 / FRAME_SECONDS)))
    return figure
