"""A settled cycle in the layout of an output file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import CYCLE, CYCLE_TRACE

if TYPE_CHECKING:
    from mesoslip.cycles.cycle import Cycle
    from mesoslip.cycles.section import Trace

# Attributes that are words; the others are numbers.
MOTION = "settled_motion"


def tree_of(cycle: Cycle) -> xr.DataTree:
    """A cycle as an output: passages and multipliers; groups ``trace`` and ``state``."""
    leading = np.array(cycle.multipliers, dtype=complex)
    root = xr.Dataset(
        {
            "duration": CYCLE.variable("duration", ("passage",), np.array(cycle.durations)),
            "peak_force": CYCLE.variable("peak_force", ("passage",), np.array(cycle.peaks)),
            "low_force": CYCLE.variable("low_force", ("passage",), np.array(cycle.lows)),
            "multiplier_real": CYCLE.variable("multiplier_real", ("multiplier",), leading.real),
            "multiplier_imaginary": CYCLE.variable(
                "multiplier_imaginary", ("multiplier",), leading.imag
            ),
        },
        attrs=program_attributes(cycle.config, "cycle"),
    )
    summary = cycle.summary()
    root.attrs[MOTION] = summary.pop("motion")
    for name, value in summary.items():
        if value is not None:
            root.attrs[name] = str(value).lower() if isinstance(value, bool) else value
    root.attrs["comment"] = cycle.verdict
    level = cycle.section
    if level is not None:
        root.attrs["section_force"], root.attrs["section_reset"] = level.force, level.reset
    words = xr.Dataset({"words": (("word",), cycle.state, {"long_name": "state at the section"})})
    return xr.DataTree(
        root, children={"trace": xr.DataTree(cycle.trace()), "state": xr.DataTree(words)}
    )


def trace_of(trace: Trace) -> xr.Dataset:
    """Samples of a cycle over the time from the section."""
    time = trace["time"] - (trace["time"][0] if len(trace) else 0.0)
    return xr.Dataset(
        {
            name: CYCLE_TRACE.variable(name, ("time",), trace[name].copy())
            for name in CYCLE_TRACE
            if name != "time"
        },
        coords={"time": CYCLE_TRACE.variable("time", ("time",), time)},
    )
