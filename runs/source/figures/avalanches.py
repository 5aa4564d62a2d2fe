"""Figures of avalanches: one that spreads, and sizes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mesoslip.analysis import avalanches as avalanche_catalogue
from mesoslip.analysis.avalanche_sizes import fit_power_law
from mesoslip.plots.snapshots import chosen_snapshot
from mesoslip.plots.style import BLUE, RED, YELLOW
from mesoslip.plots.views.avalanches import draw_distribution
from mesoslip.plots.views.lattice import draw_contacts
from mesoslip.quantities import with_error
from outputs import configuration

from figures.base import source_figure


@source_figure("avalanche", "an avalanche through the whole system at four stages", ("avalanche",))
def spreading_avalanche(trees: Sequence[xr.DataTree]) -> Figure:
    (tree,) = trees
    snapshot = chosen_snapshot(tree)
    generation = snapshot["generation"].values.astype(float)
    stages = np.quantile(generation[generation > 0], (0.02, 0.2, 0.5, 1.0)).astype(int)
    figure = Figure(figsize=(6.5, 6.2))
    panels = figure.subplots(2, 2)
    for axes, stage in zip(panels.flat, stages, strict=True):
        broken = np.where((generation > 0) & (generation <= stage), generation, np.nan)
        drawn = draw_contacts(
            axes, snapshot, broken, cmap="inferno_r", norm=Normalize(1, generation.max())
        )
        count = np.count_nonzero(np.isfinite(broken))
        axes.set_title(f"generation {stage}: {count} contacts", loc="left")
    figure.colorbar(drawn, ax=panels, shrink=0.6, label="generation in which a contact breaks")
    return figure


@source_figure(
    "sizes",
    "sizes of avalanches of sliders without inertia, and of a fibre bundle",
    ("sizes-2000", "sizes-200", "sizes-20", "bundle"),
)
def avalanche_sizes(trees: Sequence[xr.DataTree]) -> Figure:
    *sliders, bundle = trees
    figure = Figure(figsize=(7.5, 3.2))
    stationary, failing = figure.subplots(1, 2)
    for tree, color in zip(sliders, (YELLOW, RED, BLUE), strict=True):
        config = configuration(tree)
        sizes = avalanche_catalogue.avalanches(tree)["size"].values
        fit = fit_power_law(sizes, min_size=10)
        label = f"$K/Nk$ = {config.spring_stiffness / config.contacts.stiffness:g}"
        if fit is not None:
            label += rf": $\tau$ = {with_error(fit.exponent, fit.exponent_error)}"
            label += f", $s_c$ = {with_error(fit.cutoff, fit.cutoff_error)}"
            if fit.is_rejected:
                label += f" (rejected, p = {fit.p_value:.2g})"
        draw_distribution(stationary, sizes, fit, color=color, label=label)
    for tree, min_ratio, color, exponent in (
        (bundle, None, "black", 2.5),
        (bundle, 0.999, BLUE, 1.5),
    ):
        bursts = avalanche_catalogue.avalanches(tree, min_force_ratio=min_ratio)
        sizes = bursts["size"].values[~avalanche_catalogue.failures(tree, bursts)]
        label = "all bursts" if min_ratio is None else f"above {min_ratio:g} of the strength"
        draw_distribution(failing, sizes, color=color, label=label)
        over = np.array([1.0, 300.0])
        failing.loglog(over, over**-exponent, ":", color=color, label=f"$s^{{-{exponent:g}}}$")
    over = np.array([1.0, 1e4])
    stationary.loglog(over, 0.3 * over**-1.5, ":", color="black", label="$s^{-3/2}$")
    stationary.set_title("sliding, stationary", loc="left")
    failing.set_title("fibre bundle", loc="left")
    for axes in (stationary, failing):
        axes.set(xlabel="avalanche size $s$", ylabel="$P(s)$")
        axes.set_ylim(bottom=1e-10)
        axes.set_xlim(0.7, 3e5 if axes is stationary else 2e4)
        axes.legend(loc="lower left")
    return figure
