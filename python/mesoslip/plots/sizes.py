"""Distributions of the sizes of avalanches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import PowerLawFit, logarithmic_bins
from mesoslip.analysis.avalanches import NO_AVALANCHES, failures
from mesoslip.errors import FileError
from mesoslip.output.access import group_of

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


def scaling_sizes(tree: xr.DataTree) -> Array:
    """Sizes of the avalanches of an output, without those that broke all remaining contacts.

    Raises
    ------
    FileError
        If the output has no avalanches.
    """
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
    (points,) = axes.loglog(
        bins.centre, bins.density, "o", markersize=2.5, **{"color": "black"} | style
    )
    if fit is None:
        return
    fitted = bins.centre >= fit.min_size
    centre, width = bins.centre[fitted], np.diff(bins.edges[fitted], axis=1)[:, 0]
    density = fit.forms[0].relative_probability(centre)
    density *= np.sum(bins.density[fitted] * width) / np.sum(density * width)
    axes.loglog(centre, density, color=points.get_color(), linewidth=0.7, alpha=0.7)
