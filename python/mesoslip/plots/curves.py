"""Curves of runs: variables of the trace over a horizontal axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from mesoslip.array_types import Array
from mesoslip.output.access import is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import times_of
from mesoslip.plots.axis import HorizontalAxis
from mesoslip.plots.extent import Extent, line, max_size
from mesoslip.plots.trace_variables import NAMES, UNITS
from mesoslip.quantities import scale_for

# Maximum number of other realizations that are drawn behind the first one.
MAX_OTHERS = 20
# Minimum time without samples at which a line ends, over the usual interval of all samples and of
# those around it, a number on each side; with more such times the sampling is uneven.
MIN_GAP, AROUND, MAX_GAPS = 10.0, 15, 1000


class Curve(NamedTuple):
    """A curve in SI, and its style."""

    x: Array
    y: Array
    style: dict[str, Any]

    def after(self, start: float) -> Curve:
        """The curve with its horizontal axis from a start on."""
        return self._replace(x=self.x - start)


def curve(tree: Tree, name: str, extent: Extent, **style: Any) -> Curve:
    """The curve of a variable of a run."""
    horizontal, _ = extent.horizontal
    x, y = line(tree, (horizontal, name), extent, extent.window(tree))
    if horizontal == "time" and is_measured(tree):
        at = np.searchsorted(x, _gaps(times_of(tree)))
        at = at[(at > 0) & (at < len(x))]
        x, y = np.insert(x, at, x[at]), np.insert(y, at, np.nan)
    if np.count_nonzero(np.isfinite(y)) == 1:
        # A line of one sample has no length.
        style = {"marker": ".", **style}
    return Curve(x, y, style)


def _gaps(time: Array) -> Array:
    """Ends of the gaps of a record [s]."""
    steps = np.diff(time)
    found = np.flatnonzero(steps > MIN_GAP * np.median(steps)) if steps.size else steps.astype(int)
    if len(found) > MAX_GAPS:
        return np.empty(0)
    around = [steps[max(one - AROUND, 0) : one + AROUND + 1] for one in found.tolist()]
    usual = np.array([np.median(one) for one in around])
    ends: Array = time[found[steps[found] > MIN_GAP * usual] + 1]
    return ends


def draw_curves(
    axes: Axes,
    curves: Sequence[Curve],
    name: str,
    horizontal: HorizontalAxis,
    label: str | None = None,
) -> None:
    """Draw curves in the unit of a variable with a suitable prefix, on an axis with its name or
    another label."""
    largest = max_size(*(one.y for one in curves))
    scale = scale_for(largest, UNITS[name])
    for x, y, style in curves:
        # The dashes of the style are for curves of several outputs.
        style = {"linestyle": "-"} | style
        axes.plot((x - horizontal.origin) / horizontal.scale.size, y / scale.size, **style)
    axes.set_ylabel(scale.label(label or NAMES[name]))
    if name == "detached_contacts" and largest == 0:
        axes.set_ylim(-0.05, 1)
    horizontal.prepare(axes)


def others_behind(tree: Tree, extent: Extent) -> Iterator[Extent]:
    """Extents of the realizations behind the first one, if none was chosen."""
    if extent.realization is None:
        for number in range(1, min(tree.sizes["realization"], MAX_OTHERS + 1)):
            yield Extent(number, extent.start, extent.end, extent.against, extent.parts // 4)


def about_realizations(tree: Tree, extent: Extent) -> str:
    """A line on which of several realizations are shown."""
    others = tree.sizes["realization"] - 1
    if others == 0:
        return ""
    if extent.realization is not None:
        return f"realization {extent.realization} (0 to {others})"
    if others > MAX_OTHERS:
        return f"black: realization 0; grey: {MAX_OTHERS} of the other {others} realizations"
    if others > 1:
        return f"black: realization 0; grey: the other {others} realizations"
    return "black: realization 0; grey: realization 1"
