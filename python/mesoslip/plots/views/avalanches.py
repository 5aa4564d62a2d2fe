"""View of the sizes of avalanches: density and complementary cumulative distribution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import PowerLawFit, ccdf, fit_power_law, logarithmic_bins
from mesoslip.analysis.avalanches import NO_AVALANCHES, failures
from mesoslip.array_types import Array, DataTree
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.plots.style import (
    POINTS,
    RED,
    Canvas,
    curve_color,
    shared_legend,
    side_by_side,
    titles,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import percent, with_error

# Probability beyond either end of an interval of one standard deviation.
TAIL = 0.1587
# Cutoffs of the fitted laws in formulas, by the exponent of s/s_c.
CUTOFFS = {1.0: "e^{-s/s_c}", 2.0: "e^{-(s/s_c)^2}"}


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """Density and complementary cumulative distribution of the sizes of avalanches."""
    sizes = scaling_sizes(tree)
    figure, (density, cumulative) = side_by_side(figure, (6.5, 3))
    draw_density(density, tree, options)
    titles(density, tree)
    cumulative.loglog(*ccdf(sizes), color="black", drawstyle="steps-pre")
    _label_cumulative(cumulative)
    return figure


def draw_density(axes: Axes, tree: DataTree, _: Options) -> None:
    """Draw the density of the sizes of avalanches, and the power law fitted to them."""
    sizes = scaling_sizes(tree)
    fit = fit_power_law(sizes)
    law = "" if fit is None else _describe(fit, fit.count / sizes.size)
    draw_distribution(axes, sizes, fit, law)
    _label_density(axes)
    if law:
        axes.legend(loc="lower left")


def _describe(fit: PowerLawFit, part: float) -> str:
    """A fitted power law in words, and the part of the sizes that it was fitted to."""
    exponent = with_error(fit.exponent, fit.exponent_error)
    cutoff = CUTOFFS.get(fit.form.cutoff_shape, "")
    lines = [rf"$s^{{-\tau}}{cutoff}$, $\tau$ = {exponent}"]
    if fit.cutoff_is_resolved:
        lines.append(f"$s_c$ = {with_error(fit.cutoff, fit.cutoff_error)}")
    lines.append(f"$s$ ≥ {fit.min_size}, {percent(part)} of the sizes")
    if fit.is_rejected:
        lines.append(f"rejected: sizes do not\nfollow this law (p = {fit.p_value:.2g})")
    return "\n".join(lines)


def compare(
    trees: Sequence[DataTree],
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
    axes: Axes, trees: Sequence[DataTree], labels: Sequence[str], _: Options
) -> None:
    """Draw the densities of the sizes of avalanches of several outputs over each other."""
    for number, (tree, label) in enumerate(zip(trees, labels, strict=True)):
        color = curve_color(number)
        draw_distribution(axes, scaling_sizes(tree), color=color, label=label)
    _label_density(axes)


def scaling_sizes(tree: DataTree) -> Array:
    """Sizes of the avalanches of an output, without those that broke all remaining contacts."""
    if "avalanches" not in tree.children:
        raise FileError(NO_AVALANCHES)
    data = group_of(tree, "avalanches")
    return data["size"].values[~failures(tree, data)]


def draw_distribution(
    axes: Axes, sizes: Array, fit: PowerLawFit | None = None, law: str = "", **style: Any
) -> None:
    """Draw the density of avalanche sizes in logarithmic bins with intervals of 68 %, and the
    fitted power law."""
    bins = logarithmic_bins(sizes)
    style = POINTS | {"markersize": 2.5, "elinewidth": 0.7} | style
    ends = counting_interval(bins.count) * bins.density / bins.count
    errors = np.abs(ends - bins.density)
    axes.errorbar(bins.centre, bins.density, errors, **style)
    axes.set(xscale="log", yscale="log")
    if fit is None:
        return
    fitted = bins.centre >= fit.min_size
    centre, width = bins.centre[fitted], np.diff(bins.edges[fitted], axis=1)[:, 0]
    density = fit.forms[0].relative_probability(centre)
    density *= np.sum(bins.density[fitted] * width) / np.sum(density * width)
    color = RED if law else style["color"]
    axes.plot(centre, density, "-", color=color, linewidth=0.9, label=law or None, zorder=3)


def counting_interval(count: NDArray[np.int64]) -> Array:
    """Ends of the interval of 68 % of the expectation of counts by Garwood, shape (2, bins)."""
    from scipy.stats import chi2

    low, high = chi2.ppf(TAIL, 2 * count) / 2, chi2.isf(TAIL, 2 * count + 2) / 2
    return np.stack([low, high])


def _label_density(axes: Axes) -> None:
    axes.set(xlabel="avalanche size $s$", ylabel="$P(s)$")


def _label_cumulative(axes: Axes) -> None:
    axes.set(xlabel="avalanche size $s$", ylabel="$P(S \\geq s)$")


VIEW = View(
    name="avalanches",
    kind="run",
    summary="sizes of avalanches, with the power law fitted to them",
    draw_all=draw,
    panel=draw_density,
    compare_all=compare,
    compare_panel=compare_densities,
)
