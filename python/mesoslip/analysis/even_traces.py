"""Traces at equal intervals, and the direction in which they were driven."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

# Intervals that differ by less, relative to the usual one, count as equal.
EVEN = 1e-3


def even_trace(tree: xr.DataTree, realization: int = 0) -> tuple[Array, Array]:
    """Times [s] and spring force [N] of a trace at equal intervals.

    Times whose intervals differ are replaced by even ones, with forces on straight lines between.
    """
    root = tree.to_dataset()
    time = root["time"].values
    force = root["spring_force"].values[realization].astype(float)
    there = np.isfinite(force)
    return evenly_sampled(time[there], force[there])


def evenly_sampled(time: Array, force: Array) -> tuple[Array, Array]:
    """Times [s] and forces at equal intervals, on straight lines between samples where needed."""
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.all(np.abs(steps - interval) <= EVEN * interval):
        return time, force
    even = time[0] + interval * np.arange(math.floor((time[-1] - time[0]) / interval) + 1)
    return even, np.interp(even, time, force)


def first_velocity(config: Config) -> float:
    """The first velocity of a drive that is not 0 [m/s], or the rate of its force [N/s]; 0 if there
    is none."""
    parts = config.drive_parts
    velocities = (one for part in parts for one in (part.start_velocity, part.end_velocity))
    return next((one for one in velocities if one), 0.0)
