"""Logarithmic axes whose labels do not collide over any number of decades."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

from mesoslip.quantities import number

# Decades from which only powers of ten are labelled; with fewer, multiples of them too.
MANY_DECADES = 2.0
MULTIPLES = ((1, 2, 5), (1, 1.5, 2, 3, 5, 7), tuple(np.arange(10, 100) / 10))
# Minimum number of labels of an axis, if its range allows it.
MIN_LABELS = 3


def logarithmic(axes: Axes, which: str) -> None:
    """Give axes a logarithmic scale, "x" or "y"."""
    getattr(axes, f"set_{which}scale")("log")
    label_powers(getattr(axes, f"{which}axis"))


def label_powers(axis: Axis) -> None:
    """Label a logarithmic axis, such as that of a colour bar."""
    axis.set_major_locator(_Locator())
    axis.set_major_formatter(_Formatter())
    axis.set_minor_formatter(NullFormatter())


class _Locator(LogLocator):
    """Powers of ten; over few decades 1, 2, 5 times them, or more multiples."""

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        low, high = sorted((vmin, vmax))
        if not 0 < low < high or math.log10(high / low) >= MANY_DECADES:
            return super().tick_values(vmin, vmax)
        powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        candidates = [np.unique(np.outer(powers, one).round(12).ravel()) for one in MULTIPLES]
        # Over a few per cent, at equal distances.
        candidates.append(np.asarray(MaxNLocator(MIN_LABELS + 1).tick_values(low, high)))
        for places in candidates:
            inside = places[(places >= low) & (places <= high)]
            if len(inside) >= MIN_LABELS:
                break
        step = math.ceil(len(inside) / (2 * MIN_LABELS))
        chosen: list[float] = inside[:: max(step, 1)].tolist()
        return chosen


class _Formatter(LogFormatterSciNotation):
    """Powers of ten; over few decades plain numbers."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        assert self.axis is not None
        low, high = sorted(self.axis.get_view_interval())
        if 0 < low < high and math.log10(high / low) < MANY_DECADES and 1e-3 <= x < 1e5:
            return number(x, 3)
        return str(super().__call__(x, pos))
