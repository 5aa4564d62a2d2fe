"""Axes of pictures of sweeps: swept keys, and the two directions along one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mesoslip.array_types import Array, DataArray
from mesoslip.configuration.units import from_cf_units
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.key_names import name_of, symbol_or_name
from mesoslip.plots.style import BLUE, RED, axes_height, axes_width, characters, wrapped
from mesoslip.quantities import Scale, number, scale_for

# Dimension of the directions, up and down again.
DIRECTION = "direction"
# Colours, markers and sizes of the directions, so that both are visible where they agree.
DIRECTION_STYLES: dict[str, dict[str, Any]] = {
    "up": {"color": RED, "marker": "^", "markersize": 6},
    "down": {"color": BLUE, "marker": "v", "markersize": 4},
}
# Keys whose values span more than this factor have a logarithmic axis.
LOGARITHMIC_RANGE = 5.0
# Measures that span more than this factor have logarithmic colours and axes.
LOGARITHMIC_MEASURE = 15.0
# Share of the width of a map that its colour bar takes.
COLOR_BAR = 0.4
# Values of an axis of a map up to which each has a label.
MAX_LABELS = 8


@dataclass(frozen=True)
class SweptKey:
    """An axis of a swept key: its label, and its values in the unit of the label, 0, 1, 2, ... for
    words."""

    label: str
    values: Array
    words: tuple[str, ...]
    is_logarithmic: bool
    symbol: str
    """The symbol with its unit, where there is no room for the label."""

    @classmethod
    def of(cls, coordinate: DataArray) -> SweptKey:
        """The axis of a coordinate of a sweep."""
        values, name = coordinate.values, str(coordinate.name)
        if values.dtype.kind not in "fiu":
            positions = np.arange(len(values), dtype=np.float64)
            words = tuple(map(str, values))
            return cls(name_of(name), positions, words, False, symbol_or_name(name))
        scale = scale_of(coordinate)
        is_wide = np.min(values) > 0 and np.max(values) > LOGARITHMIC_RANGE * np.min(values)
        label, symbol = (scale.label(one) for one in (name_of(name), symbol_or_name(name)))
        return cls(label, values / scale.size, (), bool(is_wide), symbol)

    @property
    def order(self) -> NDArray[np.intp]:
        """Indices of the values in increasing order."""
        return np.argsort(self.values)

    @property
    def places(self) -> Array:
        """Places of the values along the axis, in increasing order."""
        values = self.values[self.order]
        return np.log(values) if self.is_logarithmic else values

    def values_at(self, places: Array) -> Array:
        """The values at places along the axis."""
        return np.exp(places) if self.is_logarithmic else places

    @property
    def edges(self) -> Array:
        """Midpoints between the values, and the edges of the first and the last cell."""
        places = self.places
        if len(places) == 1:
            only = self.values[0]
            return only * np.array([0.5, 1.5]) if only else np.array([-1.0, 1.0])
        middles = (places[1:] + places[:-1]) / 2
        return self.values_at(
            np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
        )

    def apply(self, axes: Axes, which: str) -> None:
        """Label an axis ("x" or "y") of a panel."""
        label = wrapped(self.label, axes_width(axes) if which == "x" else axes_height(axes))
        getattr(axes, f"set_{which}label")(label if label.count("\n") < 2 else self.symbol)
        if self.is_logarithmic:
            logarithmic(axes, which)
        if self.words:
            getattr(axes, f"set_{which}ticks")(self.values, self.words)

    def label_values(self, axes: Axes, which: str) -> None:
        """Label each value of an axis of a map, if they are few."""
        if len(self.values) <= MAX_LABELS and not self.words:
            getattr(axes, f"set_{which}ticks")([], minor=True)
            values = self.values[self.order]
            labels = [number(one, 3) for one in values.tolist()]
            if which == "x":
                labels = self._without_collisions(axes, labels)
            getattr(axes, f"set_{which}ticks")(values, labels)

    def _without_collisions(self, axes: Axes, labels: list[str]) -> list[str]:
        """Labels of ticks, without those that would reach into the one before."""
        edges = np.log(self.edges) if self.is_logarithmic else self.edges
        room = characters(axes_width(axes)) * (1 - COLOR_BAR)
        places = room * (self.places - edges[0]) / (edges[-1] - edges[0])
        shown, end = [], -np.inf
        for place, label in zip(places.tolist(), labels, strict=True):
            fits = place - len(label) / 2 >= end
            shown.append(label if fits else "")
            end = place + len(label) / 2 + 1 if fits else end
        return shown


def spans_decades(values: Array) -> bool:
    """Whether values of a measure are best shown on a logarithmic scale."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0 and known.max() > LOGARITHMIC_MEASURE * known.min())


def scale_of(data: DataArray) -> Scale:
    """The unit that suits the values of a key or a measure."""
    values = np.abs(data.values[np.isfinite(data.values)])
    unit = from_cf_units(data.attrs.get("units", "1"))
    return scale_for(float(values.max(initial=0.0)), unit)
