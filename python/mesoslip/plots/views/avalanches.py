"""View of the sizes of avalanches: density and complementary cumulative distribution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from mesoslip.analysis.avalanche_sizes import PowerLawFit, ccdf, fit_power_law
from mesoslip.plots.sizes import draw_distribution, scaling_sizes
from mesoslip.plots.style import (
    RED,
    Canvas,
    curve_color,
    shared_legend,
    side_by_side,
    styled,
    titles,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import percent, with_error

if TYPE_CHECKING:
    import xarray as xr

# Cutoffs of the fitted laws in formulas, by the exponent of s/s_c.
CUTOFFS = {1.0: "e^{-s/s_c}", 2.0: "e^{-(s/s_c)^2}"}


def draw(tree: xr.DataTree, options: Options, figure: Canvas | None = None) -> Canvas:
    """Density and complementary cumulative distribution of the sizes of avalanches."""
    sizes = scaling_sizes(tree)
    with styled():
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
    """A fitted power law in words."""
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
    figure: Canvas | None = None,
) -> Canvas:
    """Densities and complementary cumulative distributions of avalanches of several outputs."""
    all_sizes = [scaling_sizes(tree) for tree in trees]
    with styled():
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
    draw=draw,
    panel=draw_density,
    compare=compare,
    compare_panel=compare_densities,
)
