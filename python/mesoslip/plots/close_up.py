"""The largest slip of a run in close-up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from mesoslip.analysis.slips import catalogue_of
from mesoslip.output.access import config_of, is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.samples import samples, times_of
from mesoslip.output.variables import force_among
from mesoslip.plots.axis import time_since
from mesoslip.plots.curves import Curve, curve, draw_curves
from mesoslip.plots.extent import EVERYTHING, Extent
from mesoslip.plots.style import BLUE, CONTACT, RED, SPRING, legend_above
from mesoslip.plots.trace_variables import NAMES, force_of, is_known, label_of

# A slip: its columns of the catalogue, in SI.
Slip = Mapping[str, float]


def largest_slip(tree: Tree, extent: Extent = EVERYTHING) -> Slip | None:
    """The slip with the largest drop of the spring force, if there is a slip."""
    columns = catalogue_of(tree, extent.first).columns
    starts = columns["start_time"].values
    inside = np.flatnonzero((starts >= extent.start) & (starts <= extent.end))
    if inside.size == 0:
        return None
    largest = inside[np.argmax(np.abs(columns["force_drop"].values[inside]))]
    return {name: float(one.values[largest]) for name, one in columns.items()}


def slip_window(slip: Slip, before: float = 0.3, after: float = 2.0) -> tuple[float, float]:
    """Start and end [s] of a window around a slip; margins in units of its duration."""
    start, duration = slip["start_time"], slip["duration"]
    return start - before * duration, start + (1 + after) * duration


def draw_slip(
    panels: Sequence[Axes],
    tree: Tree,
    slip: Slip,
    names: Sequence[str],
    extent: Extent = EVERYTHING,
    title: str = "largest slip",
) -> None:
    """Draw the forces during a slip, and some variables of the trace in panels below, by the
    extent."""
    times = times_of(tree)
    low, high = slip_window(slip)
    near = Extent(extent.first, max(low, times[0]), min(high, times[-1]), parts=extent.parts)
    horizontal = time_since((near.start, near.end))
    sampling = Sampling.of(tree, slip, extent.first)
    name, (force, *below) = force_among(tree.data_vars), panels
    curves = []
    if is_known(tree, "contact_force"):
        curves.append(sampling.curve(tree, "contact_force", near, **CONTACT))
    if force_of(tree) == "elastic_force":
        style = {"color": BLUE, "label": "mean elastic force"}
        curves.append(sampling.curve(tree, "elastic_force", near, **style))
    is_force, label = name == "spring_force", label_of(tree, name)
    style = SPRING if label == NAMES["spring_force"] else SPRING | {"label": label}
    curves.append(sampling.curve(tree, name, near, **style))
    if not sampling.resolves(name):
        curves.append(_recorded_slip(slip))
    draw_curves(force, curves, name, horizontal, "force" if is_force else NAMES[name])
    note = sampling.note(tree, (name, *names))
    legend_above(force, title="\n".join(one for one in (title, note) if one))
    for axes, one in zip(below, names, strict=True):
        shown = [sampling.curve(tree, one, near, color="black")]
        if one == "velocity" and not sampling.resolves(one):
            shown.append(_recorded_peak(slip))
        draw_curves(axes, shown, one, horizontal)
        if len(shown) > 1:
            axes.legend(loc="upper right")


TIMES, FORCES = ("start_time", "end_time"), ("force_before", "force_after")
# Minimum numbers of samples in a slip, in a delay, and in a period of the ringing of the pinned
# slider, for lines between samples to show the motion.
MIN_SAMPLES = {"slip": 12, "delay": 2, "period": 6}
# Variables that change with every contact.
OF_CONTACTS = frozenset({"contact_force", "detached_contacts"})


class Sampling(NamedTuple):
    """Number of samples in a slip, their mean interval, and the intervals that would resolve the
    motion of the slider and of the contacts [s]."""

    size: int
    interval: float
    max_interval: float
    max_contact_interval: float

    @classmethod
    def of(cls, tree: Tree, slip: Slip, realization: int) -> Sampling:
        start, end = slip["start_time"], slip["end_time"]
        parts = [one.inside((start, end)) for one in samples(tree, realization)]
        count = sum(after - first for first, after in parts)
        limit = fine = (end - start) / MIN_SAMPLES["slip"]
        if not is_measured(tree):
            config = config_of(tree)
            fine = min(fine, config.slider.ringing_period(config) / MIN_SAMPLES["period"])
            if config.contacts.delay > 0:
                fine = min(fine, config.contacts.delay / MIN_SAMPLES["delay"])
        return cls(count, (end - start) / max(count, 1), limit, fine)

    def resolves(self, name: str) -> bool:
        """Whether lines between samples of a variable show its motion."""
        limit = self.max_contact_interval if name in OF_CONTACTS else self.max_interval
        return self.interval <= limit * (1 + 1e-6)

    def curve(self, tree: Tree, name: str, extent: Extent, **style: Any) -> Curve:
        """The curve of a variable, or its samples if they do not resolve it."""
        if not self.resolves(name):
            style |= {"linestyle": "", "marker": ".", "markersize": 2.5}
        return curve(tree, name, extent, **style)

    def note(self, tree: Tree, names: Sequence[str]) -> str:
        """A note on motion that is not resolved, with the key that helps; else empty."""
        if all(self.resolves(one) for one in (*names, *OF_CONTACTS) if is_known(tree, one)):
            return ""
        text = f"dots: samples, {self.size} in the slip"
        return text if is_measured(tree) else f"{text};\nfiner: output.slip_interval"


def _recorded_slip(slip: Slip) -> Curve:
    """The spring force at both ends of a slip, from the catalogue."""
    times, forces = (np.array([slip[one] for one in pair]) for pair in (TIMES, FORCES))
    style = {"color": SPRING["color"], "linewidth": 0.7, "label": "from start to end"}
    return Curve(times, forces, style)


def _recorded_peak(slip: Slip) -> Curve:
    """The peak velocity of a slip, from the catalogue."""
    times = np.array([slip[one] for one in TIMES])
    peak = np.full(2, slip["peak_velocity"])
    return Curve(times, peak, {"color": RED, "linestyle": "--", "label": "peak"})
