"""View of the peaks of several runs over the key in which they differ."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.return_map import settled_peaks
from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import flat, is_bookkeeping
from mesoslip.configuration.keys import key_kind
from mesoslip.errors import ConfigError
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.key_names import name_of
from mesoslip.plots.style import BLUE
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import scale_for

# Key of a single run, or of runs that do not differ.
DEFAULT_KEY = "drive.velocity"
# Ratio of the values from which their axis is logarithmic.
MIN_LOG_RATIO = 5.0


def draw_panel(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw the peaks of a run over the velocity of its drive."""
    draw_peaks(axes, [tree], [""], options)


def draw_peaks(axes: Axes, trees: Sequence[DataTree], _: Sequence[str], options: Options) -> None:
    """Draw the peaks of the second half of each run over the number in which the runs differ."""
    tables = [flat(Config.from_toml(tree.attrs["configuration"])) for tree in trees]
    key = _differing_key(tables)
    values = np.array([float(table[key]) for table in tables])
    peaks = [settled_peaks(tree, options.extent.realization or 0) for tree in trees]
    kind = key_kind(key)
    across = scale_for(float(np.abs(values).max()), (kind and kind.unit) or "1")
    up = scale_for(max(float(np.abs(one).max(initial=0.0)) for one in peaks) or 1.0, "N")
    for value, one in zip(values, peaks, strict=True):
        axes.plot(
            np.full(one.size, value / across.size), one / up.size, ".", color=BLUE, markersize=2
        )
    if values.min() > 0 and values.max() > MIN_LOG_RATIO * values.min():
        logarithmic(axes, "x")
    axes.set(xlabel=across.label(name_of(key)), ylabel=up.label("force at the starts of slips"))


def _differing_key(tables: Sequence[dict[str, object]]) -> str:
    """The key of a number in which configurations differ, if it is one."""
    keys = [
        key
        for key, value in tables[0].items()
        if isinstance(value, Real)
        and not isinstance(value, bool)
        and not is_bookkeeping(key)
        and all(isinstance(table.get(key), Real) for table in tables)
        and any(table[key] != value for table in tables)
    ]
    if not keys and isinstance(tables[0].get(DEFAULT_KEY), Real):
        keys = [DEFAULT_KEY]
    if len(keys) != 1:
        found = ", ".join(keys) or "none"
        text = "needs runs that differ in one number of the apparatus"
        raise ConfigError.of("--view bifurcation", text, found)
    return keys[0]


VIEW = View(
    name="bifurcation",
    kind="run",
    summary="peaks of the force of several runs over the key in which they differ",
    panel=draw_panel,
    options=frozenset({"realization"}),
    compare_panel=draw_peaks,
    legend_entries=0,
)
