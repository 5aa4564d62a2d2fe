"""Groups of a measured output: slips, noise, stages of the drive."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mesoslip.analysis.noise import TraceNoise
from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.array_types import Dataset
from mesoslip.measured.load_point import DriveStage
from mesoslip.output import variables


def slip_group(
    found: FoundSlips, velocity: float | None, stiffness: float | None, unit: str
) -> Dataset:
    """The catalogue of slips in the unit of the force, "N" or "1", with peak velocities if drive
    and stiffness are known."""
    drop = found.force_before - found.force_after
    peak = np.full(len(found), np.nan)
    if stiffness is not None and 0 < stiffness < math.inf and velocity is not None:
        peak = np.copysign(found.fall_rate / stiffness + abs(velocity), drop)
    columns = {
        "realization_index": np.zeros(len(found), dtype=np.int64),
        "start_time": found.start_time,
        "end_time": found.end_time,
        "force_before": found.force_before,
        "force_after": found.force_after,
        "force_drop": drop,
        "peak_velocity": peak,
        "contacts_broken": np.full(len(found), np.nan),
        "peak_fall_rate": found.fall_rate,
    }
    return variables.MEASURED_SLIPS.dataset(("slip",), columns, unit)


def noise_group(noise: TraceNoise, unit: str) -> Dataset:
    """The noise: scalars, the samples of impulses, and lines of hum."""
    import xarray as xr

    hum = {
        "hum_frequency": np.array([one.frequency for one in noise.hum]),
        "hum_amplitude": np.array([one.amplitude for one in noise.hum]),
    }
    impulses = {"impulse_time": noise.impulse_time}
    return xr.merge(
        [
            variables.NOISE.dataset((), noise.scalars(), unit),
            variables.NOISE.dataset(("impulse",), impulses, unit),
            variables.NOISE.dataset(("line",), hum, unit),
        ]
    )


def count_group(found: FoundSlips, unit: str) -> Dataset:
    """Numbers of slips by minimum fall, with the minimum fall of the catalogue."""
    counts = found.counts
    columns = {
        "min_fall": counts.threshold,
        "slip_count": counts.count,
        "mirrored_count": counts.mirrored_count,
    }
    data = variables.SLIP_COUNTS.dataset(("threshold",), columns, unit)
    data.attrs["used"] = found.min_fall
    if counts.plateau is not None:
        data.attrs["plateau"] = list(counts.plateau)
    return data


def stage_group(stages: Sequence[DriveStage]) -> Dataset:
    group = variables.MEASURED_STAGES
    columns = {
        "realization_index": [0] * len(stages),
        "stage_number": list(range(len(stages))),
        "stage_start_time": [one.start for one in stages],
        "stage_end_time": [one.end for one in stages],
        "drive_start_velocity": [one.start_velocity for one in stages],
        "drive_end_velocity": [one.end_velocity for one in stages],
        "drive_velocity_error": [one.velocity_error for one in stages],
    }
    arrays = {name: np.array(one, dtype=group[name].dtype) for name, one in columns.items()}
    return group.dataset(("stage",), arrays)
