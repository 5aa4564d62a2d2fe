"""Groups of a measured output about its noise and its slips."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.analysis.noise import TraceNoise
from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.output import variables

if TYPE_CHECKING:
    import xarray as xr


def slip_group(
    found: FoundSlips, velocity: float | None, stiffness: float | None, unit: str
) -> xr.Dataset:
    """The catalogue of slips.

    Parameters
    ----------
    found
        The slips.
    velocity, stiffness
        Of drive [m/s] and spring, as far as known: then slips have a peak velocity.
    unit
        Unit of the force, "N" or "1".
    """
    speed = np.full(len(found), np.nan)
    if stiffness is not None and 0 < stiffness < math.inf and velocity is not None:
        speed = found.fall_rate / stiffness + abs(velocity)
    columns = {
        "realization_index": np.zeros(len(found), dtype=np.int64),
        "start_time": found.start_time,
        "end_time": found.end_time,
        "force_before": found.force_before,
        "force_after": found.force_after,
        "force_drop": found.force_before - found.force_after,
        "peak_velocity": speed,
        "contacts_broken": np.full(len(found), np.nan),
        "peak_fall_rate": found.fall_rate,
    }
    return _group(variables.MEASURED_SLIPS, columns, "slip", unit)


def noise_group(noise: TraceNoise, unit: str) -> xr.Dataset:
    """The noise: scalars, the samples of impulses, and lines of hum."""
    import xarray as xr

    return xr.merge(
        [
            _group(variables.NOISE, noise.scalars(), None, unit),
            _group(variables.NOISE, {"impulse_time": noise.impulse_time}, "impulse", unit),
            _group(
                variables.NOISE,
                {
                    "hum_frequency": np.array([one.frequency for one in noise.hum]),
                    "hum_amplitude": np.array([one.amplitude for one in noise.hum]),
                },
                "line",
                unit,
            ),
        ]
    )


def count_group(found: FoundSlips, unit: str) -> xr.Dataset:
    """Numbers of slips by minimum fall, with the one that is used."""
    counts = found.counts
    columns = {"min_fall": counts.threshold, "slip_count": counts.count}
    data = _group(variables.SLIP_COUNTS, columns, "threshold", unit)
    data.attrs["used"] = found.min_fall
    if counts.plateau is not None:
        data.attrs["plateau"] = list(counts.plateau)
    return data


def _group(
    group: variables.Group,
    columns: Mapping[str, Any],
    dimension: str | None,
    unit: str,
) -> xr.Dataset:
    """A group with the unit of the force in place of newtons."""
    import xarray as xr

    dimensions = () if dimension is None else (dimension,)
    data = xr.Dataset(
        {name: group.variable(name, dimensions, values) for name, values in columns.items()}
    )
    for one in data.data_vars.values():
        units = one.attrs["units"]
        if unit == "1" and units.split()[0] == "N":
            one.attrs["units"] = units.partition(" ")[2] or "1"
    return data
