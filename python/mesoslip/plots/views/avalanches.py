"""View of the sizes of avalanches: density and complementary cumulative distribution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import PowerLawFit, ccdf, fit_power_law, logarithmic_bins
from mesoslip.analysis.avalanches import NO_AVALANCHES, failures
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.plots.style import RED, Canvas, curve_color, shared_legend, side_by_side, titles
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import percent, with_error

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Cutoffs of the fitted laws in formulas, by the exponent of s/s_c.
CUTOFFS = {1.0: "e^{-s/s_c}", 2.0: "e^{-(s/s_c)^2}"}


def draw(tree: xr.DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Density and complementary cumulative distribution of the sizes of avalanches."""
    sizes = scaling_sizes(tree)
    figure, (density, cumulative) = side_by_side(figure, (6.5, 3))
    draw_density(density, tree, options)
    cumulative.loglog(*ccdf(sizes), color="black", drawstyle="steps-pre")
    _label_cumulative(cumulative)
    titles(cumulative, tree)
    return figure


def draw_density(axes: Axes, tree: xr.DataTree, _: Options) -> None:
    """Draw the density of the sizes of avalanches, and the power law fitted to them."""
    sizes = scaling_sizes(tree)
    fit = fit_power_law(sizes)
    draw_distribution(axes, sizes, fit)
    _label_density(axes)
    if fit is not None:
        color = RED if fit.is_rejected else "black"
        axes.set_title(_describe(fit, fit.count / sizes.size), loc="left", color=color)


def _describe(fit: PowerLawFit, part: float) -> str:
    """A fitted power law in words, and the part of the sizes that it was fitted to."""
    exponent = with_error(fit.exponent, fit.exponent_error)
    cutoff = CUTOFFS.get(fit.form.cutoff_shape, "")
    lines = [rf"$s^{{-\tau}}{cutoff}$, $\tau$ = {exponent}"]
    if fit.cutoff_is_resolved:
        lines.append(f"$s_c$ = {with_error(fit.cutoff, fit.cutoff_error)}")
    lines.append(f"fitted to $s$ ≥ {fit.min_size}, {percent(part)} of the sizes")
    if fit.is_rejected:
        lines.append(f"rejected: sizes do not follow this law (p = {fit.p_value:.2g})")
    return "\n".join(lines)


def compare(
    trees: Sequence[xr.DataTree],
    labels: Sequence[str],
    options: Options,
    figure: Canvas | None,
) -> Canvas:
    """Densities and complementary cumulative distributions of avalanches of several outputs."""
    all_sizes = [scaling_sizes(tree) for tree in trees]
    size = (6.5, 3 + 0.16 * len(trees))
    figure, (density, cumulative) = side_by_side(figure, size)
    compare_densities(density, trees, labels, options)
    for number, sizes in enumerate(all_sizes):
        cumulative.loglog(*ccdf(sizes), color=curve_color(number), drawstyle="steps-pre")
    _label_cumulative(cumulative)
    shared_legend(figure, density)
    return figure


def compare_densities(
    axes: Axes, trees: Sequence[xr.DataTree], labels: Sequence[str], _: Options
) -> None:
    """Draw the densities of the sizes of avalanches of several outputs over each other."""
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        color = curve_color(number)
        draw_distribution(axes, scaling_sizes(tree), color=color, label=label)
    _label_density(axes)


def scaling_sizes(tree: xr.DataTree) -> Array:
    """Sizes of the avalanches of an output, without those that broke all remaining contacts."""
    if "avalanches" not in tree.children:
        raise FileError(NO_AVALANCHES)
    data = group_of(tree, "avalanches")
    sizes: Array = data["size"].values[~failures(tree, data)]
    return sizes


def draw_distribution(
    axes: Axes, sizes: Array, fit: PowerLawFit | None = None, **style: Any
) -> None:
    """Draw the density of avalanche sizes in logarithmic bins, and the power law fitted to them."""
    bins = logarithmic_bins(sizes)
    style = {"color": "black", "markersize": 2.5} | style
    (points,) = axes.loglog(bins.centre, bins.density, "o", **style)
    if fit is None:
        return
    fitted = bins.centre >= fit.min_size
    centre, width = bins.centre[fitted], np.diff(bins.edges[fitted], axis=1)[:, 0]
    density = fit.forms[0].relative_probability(centre)
    density *= np.sum(bins.density[fitted] * width) / np.sum(density * width)
    axes.loglog(centre, density, color=points.get_color(), linewidth=0.7, alpha=0.7)


def _label_density(axes: Axes) -> None:
    axes.set_xlabel("avalanche size $s$")
    axes.set_ylabel("$P(s)$")


def _label_cumulative(axes: Axes) -> None:
    axes.set_xlabel("avalanche size $s$")
    axes.set_ylabel("$P(S \\geq s)$")


VIEW = View(
    name="avalanches",
    kind="run",
    summary="sizes of avalanches, with the power law fitted to them",
    draw_all=draw,
    panel=draw_density,
    compare_all=compare,
    compare_panel=compare_densities,
)
