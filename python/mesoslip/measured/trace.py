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
class Known:
    """What is known of an experiment without a whole configuration of it."""

    title: str
    drive_velocity: float | None
    stiffness: float | None
    base: None = None

    def to_toml(self) -> str:
        """The part of a configuration that is known."""
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
    """Read a measured trace from a table: an output like that of a run, with the slips found in it.

    What the table does not hold follows from what is known: the displacement of the drive from its
    velocity, that of the slider from the drive's and the stretch of the spring, the velocity from
    the displacement. What does not follow is NaN, such as detached contacts.

    Parameters
    ----------
    file
        The table: columns with units in their headers, such as ``time [s]``, ``force [uN]``,
        ``displacement [nm]``.
    columns
        Headers instead of those of the file, such as "time [s], force [uN], -".
    rate
        Sampling rate [1/s], if the table has no times.
    max_gap
        Longest time without values [s] that is filled by straight lines; none by default.
    drive_velocity
        Velocity of the drive [m/s].
    stiffness
        Spring constant [N/m].
    config
        Configuration of the experiment as far as it is known, drive and spring included. The output
        takes it over, so that every command works on it.
    noise
        Standard deviation of the noise of the force [N]; estimated by default.
    period
        Period of the setup [s]; from the configuration, or else estimated.

    Returns
    -------
    xarray.DataTree
        The layout of a run's output; attribute ``origin`` is "measured". Slips are found by the
        rule of `mesoslip.analysis.sampled_slips`.

    Raises
    ------
    FileError
        If the table cannot be read or is wrong; the message names the line.
    ConfigError
        If what is known contradicts itself.
    """
    path = as_path(file)
    if config is not None:
        config = as_config(config)
    measured = read_table(path, columns=columns, rate=rate, max_gap=max_gap)
    if config is not None and (drive_velocity is not None or stiffness is not None):
        name = "drive_velocity" if drive_velocity is not None else "stiffness"
        message = "the configuration tells drive and spring; change them there"
        raise ConfigError([Problem("", name, message)])
    if noise is not None and noise < 0:
        raise ConfigError([Problem("", "noise", "must not be negative", noise)])
    if period is not None and period <= 0:
        raise ConfigError([Problem("", "period", "must be greater than 0", period)])
    title = f"Measured: {path.name}"
    described: Config | Known = Known(title, drive_velocity, stiffness)
    if config is not None:
        described = _as_measured(config, measured, title)
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
        "comment": "; ".join(_doubts(direction * force, noise, period)),
        "noise": noise,
        "setup_period": period,
        "setup_period_origin": "estimated" if estimated else "given",
    }
    attributes = program_attributes(described, "trace") | details
    return _tree(measured, drive, displacement, found, velocity, stiffness, period, attributes)


def _doubts(force: Array, noise: float, period: float) -> Iterator[str]:
    """What makes a force along the drive unlike one that friction gives."""
    if float(np.median(force)) < -noise:
        yield (
            "the force is against the drive most of the time; if the cell counts it the other way, "
            "give a velocity of the other sign, here or in the configuration"
        )
    if not math.isfinite(period):
        yield "no fall of the force stands out of the noise: there is no slip, and no period"


def _as_measured(config: Config, measured: Measurements, title: str) -> Config:
    """The configuration of an experiment, with the duration and the interval of its trace."""
    time = measured.time
    # As people write them, without the rounding of differences.
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
    """Displacement of the drive [m], and its first velocity that is not zero [m/s], if known."""
    time = measured.time - measured.time[0]
    start = 0.0
    if stiffness is not None and 0 < stiffness < math.inf:
        # The slider starts at 0.
        start = measured.force[0] / stiffness
    if config is not None and config.drive.force_rate is None:
        velocity = first_velocity(config)
        drive = start + _way(config, time)
    elif velocity is not None:
        drive = start + velocity * time
    else:
        drive = None
    if measured.drive is not None:
        if velocity is None:
            velocity = float(np.polyfit(time, measured.drive, 1)[0])
        drive = measured.drive
    return drive, velocity


def _way(config: Config, time: Array) -> Array:
    """Displacement of a drive since its start [m]."""
    duration, start, end, _ = np.array(config.drive_parts).T
    begin = np.cumsum(duration) - duration
    ways = np.cumsum(0.5 * (start + end) * duration)
    place = np.searchsorted(begin, time, "right") - 1
    since = time - begin[place]
    # Beyond its last part, which ends with the run, the drive goes on.
    within = np.minimum(since, duration[place])
    ramp = 0.5 * (end - start)[place] / duration[place] * within**2
    before = np.concatenate([[0.0], ways])[place]
    way: Array = before + start[place] * within + ramp + end[place] * (since - within)
    return way


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
    """Derivative of the displacement, straight lines through a sixteenth of a period [m/s]."""
    from scipy.signal import savgol_filter

    interval = float(np.median(np.diff(time)))
    samples = period / 16 / interval if math.isfinite(period) else 1
    width = min(2 * max(1, round(samples / 2)) + 1, len(time) - 1 + len(time) % 2)
    even, values = evenly_sampled(time, displacement)
    rate: Array = savgol_filter(values, width, 1, deriv=1, delta=interval, mode="nearest")
    return np.interp(time, even, rate)
