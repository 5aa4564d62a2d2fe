"""A measured trace as an output, with the layout of that of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.even_traces import evenly_sampled, first_velocity
from mesoslip.analysis.sampled_slips import FoundSlips, estimated_period, find_slips, noise_level
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, Problem
from mesoslip.measured.table import Measurements, read_table
from mesoslip.output import variables
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.provenance import program_attributes

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PartialConfig:
    """The known part of the configuration of an experiment."""

    title: str
    drive_velocity: float | None
    stiffness: float | None
    base: None = None

    def to_toml(self) -> str:
        """The known keys as TOML."""
        import tomli_w

        tables: dict[str, Any] = {"title": self.title}
        if self.drive_velocity is not None:
            tables["drive"] = {"velocity": self.drive_velocity}
        if self.stiffness is not None:
            tables["slider"] = {"stiffness": self.stiffness}
        return tomli_w.dumps(tables)


def read_trace(
    file: PathLike,
    *,
    columns: str | None = None,
    rate: float | None = None,
    max_gap: float | None = None,
    drive_velocity: float | None = None,
    stiffness: float | None = None,
    config: ConfigLike | None = None,
    noise: float | None = None,
    period: float | None = None,
) -> xr.DataTree:
    """Read a measured trace from a table, as an output like that of a run, with its slips.

    Missing columns are computed where possible: the displacement of the drive from its velocity,
    that of the slider from the drive and the stretch of the spring, the velocity of the slider from
    its displacement. Other variables, such as the detached contacts, are NaN.

    Parameters
    ----------
    file
        The table: columns with units in their headers, such as ``time [s]``, ``force [uN]``,
        ``displacement [nm]``.
    columns
        Headers instead of those of the file, such as "time [s], force [uN], -".
    rate
        Sampling rate [1/s], for a table without times.
    max_gap
        Maximum length [s] of gaps, which are interpolated linearly; by default gaps are errors.
    drive_velocity
        Velocity of the drive [m/s].
    stiffness
        Spring constant [N/m].
    config
        Configuration of the experiment as far as it is known, with drive and spring. The output
        contains it, so that every command works on the output.
    noise
        Standard deviation of the noise of the force [N]; estimated by default.
    period
        Period of the setup [s]; by default that of the configuration, or an estimate.

    Returns
    -------
    xarray.DataTree
        The layout of a run's output; attribute ``origin`` is "measured". Slips are found by the
        rule of `mesoslip.analysis.sampled_slips`.

    Raises
    ------
    FileError
        If the table cannot be read or is invalid; the message names the line.
    ConfigError
        If the arguments contradict each other.
    """
    path = as_path(file)
    if config is not None:
        config = as_config(config)
    measured = read_table(path, columns=columns, rate=rate, max_gap=max_gap)
    if config is not None and (drive_velocity is not None or stiffness is not None):
        name = "drive_velocity" if drive_velocity is not None else "stiffness"
        message = "is given in the configuration; change it there"
        raise ConfigError([Problem("", name, message)])
    if noise is not None and noise < 0:
        raise ConfigError([Problem("", "noise", "must not be negative", noise)])
    if period is not None and period <= 0:
        raise ConfigError([Problem("", "period", "must be greater than 0", period)])
    title = f"Measured: {path.name}"
    known: Config | PartialConfig = PartialConfig(title, drive_velocity, stiffness)
    if config is not None:
        known = _as_measured(config, measured, title)
        stiffness = config.spring_stiffness
        if period is None and config.slider.quiet_time > 0:
            period = 2 * config.slider.quiet_time
    drive, velocity = _drive(measured, drive_velocity, config, stiffness)
    displacement = _displacement(measured, drive, stiffness)
    time, force = evenly_sampled(measured.time, measured.force)
    noise = noise_level(force) if noise is None else noise
    estimated = period is None
    direction = -1.0 if velocity is not None and velocity < 0 else 1.0
    period = estimated_period(time, direction * force, noise) if period is None else period
    found = find_slips(time, force, noise=noise, period=period, direction=direction)
    details = {
        "origin": "measured",
        "measured_file": path.name,
        "complete": "true",
        "comment": "; ".join(_comments(direction * force, noise, period)),
        "noise": noise,
        "setup_period": period,
        "setup_period_origin": "estimated" if estimated else "given",
    }
    attributes = program_attributes(known, "trace") | details
    return _tree(measured, drive, displacement, found, velocity, stiffness, period, attributes)


def _comments(force: Array, noise: float, period: float) -> Iterator[str]:
    """Signs that a force along the drive is not a friction force with slips."""
    if float(np.median(force)) < -noise:
        yield (
            "the force is against the drive most of the time; if the sensor has the opposite sign, "
            "give a velocity of the opposite sign, here or in the configuration"
        )
    if not math.isfinite(period):
        yield "no fall of the force exceeds the noise: no slips, and no period of the setup"


def _as_measured(config: Config, measured: Measurements, title: str) -> Config:
    """The configuration of an experiment with the duration and sampling interval of its trace."""
    time = measured.time
    # Rounded, as differences of times have rounding errors.
    duration, interval = (
        float(f"{one:.9g}") for one in (time[-1] - time[0], np.median(np.diff(time)))
    )
    changes: dict[str, Any] = {
        "title": config.title or title,
        "output.interval": min(interval, duration),
    }
    if not config.drive.parts:
        changes["run.duration"] = duration
    return config.replace(changes)


def _drive(
    measured: Measurements,
    velocity: float | None,
    config: Config | None,
    stiffness: float | None,
) -> tuple[Array | None, float | None]:
    """Displacement of the drive [m] and its first nonzero velocity [m/s], as far as known."""
    time = measured.time - measured.time[0]
    start = 0.0
    if stiffness is not None and 0 < stiffness < math.inf:
        # The slider starts at 0.
        start = measured.force[0] / stiffness
    if config is not None and config.drive.force_rate is None:
        velocity = first_velocity(config)
        drive = start + _drive_displacement(config, time)
    elif velocity is not None:
        drive = start + velocity * time
    else:
        drive = None
    if measured.drive is not None:
        if velocity is None:
            velocity = float(np.polyfit(time, measured.drive, 1)[0])
        drive = measured.drive
    return drive, velocity


def _drive_displacement(config: Config, time: Array) -> Array:
    """Displacement of the configured drive since its start [m]."""
    duration, start, end, _ = np.array(config.drive_parts).T
    begin = np.cumsum(duration) - duration
    ends = np.cumsum(0.5 * (start + end) * duration)
    part = np.searchsorted(begin, time, "right") - 1
    since = time - begin[part]
    # The drive continues after its last part.
    within = np.minimum(since, duration[part])
    ramp = 0.5 * (end - start)[part] / duration[part] * within**2
    before = np.concatenate([[0.0], ends])[part]
    displacement: Array = before + start[part] * within + ramp + end[part] * (since - within)
    return displacement


def _displacement(
    measured: Measurements, drive: Array | None, stiffness: float | None
) -> Array | None:
    if measured.displacement is not None:
        return measured.displacement
    if drive is None or stiffness is None or not 0 < stiffness < math.inf:
        return None
    return drive - measured.force / stiffness


def _tree(
    measured: Measurements,
    drive: Array | None,
    displacement: Array | None,
    found: FoundSlips,
    velocity: float | None,
    stiffness: float | None,
    period: float,
    attributes: dict[str, Any],
) -> xr.DataTree:
    import xarray as xr

    unknown = np.full(len(measured.time), np.nan)
    traces = {
        "drive_displacement": unknown if drive is None else drive,
        "displacement": unknown if displacement is None else displacement,
        "velocity": unknown
        if displacement is None
        else _velocity(measured.time, displacement, period),
        "spring_force": measured.force,
        "contact_force": unknown,
        "detached_contacts": unknown,
    }
    root = {
        name: variables.ROOT.variable(name, ("realization", "time"), values[np.newaxis])
        for name, values in traces.items()
    }
    coordinates = {
        "realization": variables.ROOT.variable("realization", ("realization",), [0]),
        "time": variables.ROOT.variable("time", ("time",), measured.time),
    }
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
    }
    slips = {
        name: variables.SLIPS.variable(name, ("slip",), values) for name, values in columns.items()
    }
    return xr.DataTree.from_dict(
        {"/": xr.Dataset(root, coordinates, attributes), "/slips": xr.Dataset(slips)}
    )


def _velocity(time: Array, displacement: Array, period: float) -> Array:
    """Derivative of the displacement [m/s], by linear fits over a sixteenth of a period."""
    from scipy.signal import savgol_filter

    interval = float(np.median(np.diff(time)))
    samples = period / 16 / interval if math.isfinite(period) else 1
    width = min(2 * max(1, round(samples / 2)) + 1, len(time) - 1 + len(time) % 2)
    even, values = evenly_sampled(time, displacement)
    rate: Array = savgol_filter(values, width, 1, deriv=1, delta=interval, mode="nearest")
    return np.interp(time, even, rate)
