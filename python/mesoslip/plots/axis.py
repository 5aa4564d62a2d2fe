"""Axes of pictures: horizontal ones of runs, and logarithmic ones whose labels do not collide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree
from mesoslip.plots.extent import Extent, line, max_size
from mesoslip.plots.trace_variables import UNITS, is_known
from mesoslip.quantities import Scale, number, scale_for

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


# Times from this one on are far from 0: axes of short traces have the unit of their length [s].
LATE = 60.0


@dataclass(frozen=True)
class HorizontalAxis:
    """A horizontal axis: unit, label, limits in that unit, and origin [SI]."""

    scale: Scale
    label: str
    limits: tuple[float, float] | None
    origin: float = 0.0
    starts: tuple[float, ...] = ()
    """What each of several outputs counts its time from, where their times do not overlap [s]."""

    def start(self, number: int) -> float:
        """Time that counts as 0 for one of several outputs [s]."""
        return self.starts[number] if self.starts else 0.0

    def prepare(self, axes: Axes) -> None:
        """Set the label and the limits of axes."""
        axes.set_xlabel(self.scale.label(self.label))
        if self.limits is not None:
            axes.set_xlim(*self.limits)


def horizontal_axis(trees: Sequence[Tree], extent: Extent) -> HorizontalAxis:
    """The horizontal axis of the part of outputs that is drawn."""
    name, label = extent.horizontal
    if name != "time" and not all(is_known(tree, name) for tree in trees):
        raise FileError(
            f"the measured trace has no {label}: mesoslip trace computes it from the velocity of "
            "the drive and the stiffness of the spring, or with --config"
        )
    windows = np.array([extent.window(tree) for tree in trees])
    if name != "time":
        lines = [
            line(tree, (name,), extent, window)[0]
            for tree, window in zip(trees, windows, strict=True)
        ]
        return HorizontalAxis(scale_for(max_size(*lines), UNITS[name]), label, None)
    starts: tuple[float, ...] = ()
    if windows[:, 0].max() > windows[:, 1].min():
        # A record whose clock ran before it, and a run: each from its start.
        starts, label = tuple(windows[:, 0].tolist()), "time from each start"
        windows = windows - windows[:, :1]
    low, high = float(windows[:, 0].min()), float(windows[:, 1].max())
    # The clock of an instrument may be at hours when a trace of seconds starts.
    is_late = low > high - low and high > LATE
    scale = scale_for(high - low if is_late else max_size(windows), "s")
    limits = (low / scale.size, high / scale.size) if high > low else None
    return HorizontalAxis(scale, label, limits, starts=starts)


def time_since(window: tuple[float, float]) -> HorizontalAxis:
    """The axis of time after the start of a window."""
    start, length = window[0], window[1] - window[0]
    scale = scale_for(length, "s")
    label = "time"
    if start != 0:
        unit = scale_for(min(start, LATE / 2), "s")
        # Enough digits to find the window in the whole trace.
        digits = max(3, 2 + math.ceil(math.log10(max(abs(start) / max(length, 1e-300), 1.0))))
        label = f"time after {start / unit.size:.{digits}g} {unit.name}"
    limits = (0.0, length / scale.size) if length > 0 else None
    return HorizontalAxis(scale, label, limits, start)
