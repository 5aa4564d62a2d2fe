"""A measured trace as an output, with the layout of that of a run."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesoslip.analysis.apparatus import first_velocity
from mesoslip.analysis.noise import TraceNoise
from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.analysis.strokes.revolutions import angle_of, are_of_track
from mesoslip.analysis.strokes.segments import FORCE, back_and_forth, path_of, record_pieces
from mesoslip.analysis.strokes.slips import find_slips_between_reversals
from mesoslip.array_types import Array, DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike
from mesoslip.errors import ConfigError
from mesoslip.measured.load_point import drive_stages
from mesoslip.measured.measured_record import Record, RecordedColumn
from mesoslip.measured.output_groups import count_group, noise_group, slip_group, stage_group
from mesoslip.measured.understanding import Understood, understand
from mesoslip.output import variables
from mesoslip.output.inputs import ConfigLike
from mesoslip.output.provenance import program_attributes


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
    file: PathLike | Sequence[PathLike],
    *,
    columns: str | None = None,
    decimal: str | None = None,
    dates: str | None = None,
    missing: str | float | None = None,
    sheet: str | None = None,
    rate: str | float | None = None,
    velocity: str | float | None = None,
    stiffness: str | float | None = None,
    radius: str | float | None = None,
    viscosity: str | float | None = None,
    motion: str | None = None,
    force_direction: str | None = None,
    normal_force: str | float | None = None,
    normal_stress: str | float | None = None,
    area: str | float | None = None,
    start: str | float | None = None,
    end: str | float | None = None,
    hum: str | float | None = None,
    trend: str | None = None,
    config: ConfigLike | None = None,
    noise: str | float | None = None,
    period: str | float | None = None,
    part: int | None = None,
    min_fall: str | float | None = None,
) -> DataTree:
    """Read a measured trace as the laboratory wrote it, as an output like that of a run.

    Quantities are strings with units, such as "1002 N/m", or numbers in SI. They replace keys of
    the table [trace] of a file such as EXPERIMENT.toml.

    Parameters
    ----------
    file
        The file of the measurement, or a TOML file with a table [trace] that names it. Several
        files are parts of one test, in their order; they have the same columns.
    columns
        Headers instead of those of the file, such as "time [s], force [uN], -".
    decimal
        Decimal sign, "." or ",", if the file allows both.
    dates
        Order of day, month and year in dates such as 04/03/2026: "dmy", "mdy" or "ymd".
    missing
        Numbers that stand for missing ones, such as "-99, 0", or "none".
    sheet
        Sheet of a workbook (.xlsx); by default the one with the most numbers.
    rate
        Sampling rate [1/s] of a file without times; one with times is thinned to this rate, after a
        low-pass.
    velocity
        Velocity of the drive [m/s], where no load point was recorded.
    stiffness
        Spring constant [N/m]; for friction coefficients with a unit such as "1.6e-3 1/um".
    radius
        Radius of the track on a disc [m], by which torques become forces and rotations speeds.
    viscosity
        Viscosity of a lubricant [Pa s], for Stribeck curves.
    motion
        "strokes" or "one-way": whether the drive goes back and forth, if the guess is wrong.
    force_direction
        "along" or "against": the direction of the force in strokes, if the guess is wrong.
    normal_force
        Normal force [N]; friction coefficients become forces with it.
    normal_stress, area
        Normal stress [Pa], and the area [m^2] by which stresses become forces.
    start, end
        Times of the file from which, and until which, samples are used [s].
    hum
        Frequency of a hum that is removed [1/s].
    trend
        "none" or "linear": trend of the friction with displacement, for rates and states.
    config
        Configuration of a model of the experiment, with drive and spring. The output contains it,
        so that every command works on the output.
    noise
        Standard deviation of the noise, in the unit of the force; estimated by default.
    period
        Period of the setup [s]; by default that of the configuration, or an estimate.
    part
        Which part of a file whose clock starts again, from 1; by default the longest.
    min_fall
        Minimum fall of a slip, in the unit of the force; by default from the noise and the number
        of slips.

    Returns
    -------
    xarray.DataTree
        The layout of a run's output. Attribute ``origin`` is "measured"; ``trace`` repeats the
        reading. Root: ``spring_force`` [N] or ``friction_coefficient``, dimensions (realization,
        time) at any increasing times, and displacements and velocity as far as they are known.
        Groups: ``slips``; ``recorded`` with the columns of the file as it has them.

    Raises
    ------
    FileError
        If the file cannot be read or understood; the message names the line.
    ConfigError
        If the description is wrong, or arguments contradict each other.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("measured/paper-k1002-v42")  # writes the file and a description
    >>> tree = mesoslip.read_trace(path, end="200 s")
    >>> tree["spring_force"].dims, tree["slips"].sizes["slip"] > 3
    (('realization', 'time'), True)
    """
    options = {name: value for name, value in locals().items() if name != "file"}
    options["headers"] = options.pop("columns")
    return trace_of(understand(file, **options))


def trace_of(understood: Understood) -> DataTree:
    """The output of the interpretation of a file; see `read_trace`."""
    record, trace = understood.record, understood.experiment.trace
    measured_file = ", ".join(one.name for one in understood.paths)
    title = understood.experiment.title or f"Measured: {measured_file}"
    velocity, stiffness = trace.si("velocity"), understood.stiffness
    period = trace.si("period")
    known: Config | PartialConfig = PartialConfig(title, velocity, stiffness)
    config = understood.config
    if config is not None:
        known = _as_measured(config, record, title)
        if period is None and config.slider.quiet_time > 0:
            period = 2 * config.slider.quiet_time
    loading_rate = None
    if velocity is not None and stiffness is not None and record.load_point is None:
        loading_rate = abs(velocity) * stiffness
    drive, velocity = _drive(record, velocity, config, stiffness)
    noise = understood.noise
    displacement = _displacement(record, record.force, drive, stiffness)
    smooth = displacement
    if isinstance(noise, TraceNoise):
        # Impulses and hum are no motion.
        cleaned = noise.clean(record.time, record.force)
        smooth = _displacement(record, cleaned, drive, stiffness)
    pieces, cut_by = record_pieces(
        record.time, record.force, drive, record.displacement, trace.motion
    )
    if pieces is None and trace.motion == "strokes":
        message = f"the {cut_by} has no reversals that stand out of the noise"
        raise ConfigError.of("--motion", message, trace.motion)
    if pieces is not None:
        # Only its size is known, as the drive goes back and forth.
        velocity = None if drive is None else _mean_speed(record.time, drive)
    direction = -1.0 if velocity is not None and velocity < 0 else 1.0
    found = find_slips_between_reversals(
        pieces,
        record.time,
        record.force,
        noise=noise,
        are_guessed=cut_by == FORCE,
        period=period,
        direction=direction,
        min_fall=trace.si("min_fall"),
        loading_rate=loading_rate,
    )
    comments = []
    if trace.min_fall is None and _are_of_track(record, found):
        comments.append(
            f"guess: {len(found)} falls keep the phase of the rotation, and are those of the "
            "track, no slips; --min-fall counts all above it"
        )
        found = found.without_slips()
    level = noise.deviation if isinstance(noise, TraceNoise) else noise
    comments += (
        _comments(direction * record.force, level, found.period)
        if pieces is None
        else [back_and_forth(len(pieces), cut_by)]
    )
    comment = "; ".join(comments)
    details = {
        "origin": "measured",
        "measured_file": measured_file,
        "trace": understood.experiment.trace.to_toml(),
        "understood": "\n".join(understood.report),
        "complete": "true",
        **({"comment": comment} if comment else {}),
        "noise": level,
        "min_fall": found.min_fall,
        "setup_period": found.period,
        "setup_period_origin": "estimated" if period is None else "given",
    }
    attributes = program_attributes(known, "trace") | details
    return _tree(
        understood,
        drive,
        displacement,
        None if smooth is None else _velocity(record.time, smooth, found.period),
        found,
        velocity,
        attributes,
    )


def _are_of_track(record: Record, found: FoundSlips) -> bool:
    """Whether the falls of a record are those of the track of a disc."""
    revolutions, speed = (record.signals.get(name) for name in ("revolutions", "rotation_speed"))
    known = speed if revolutions is None else revolutions
    if known is None or not np.isfinite(known).any():
        return False
    angle = angle_of(record.time, revolutions, speed)
    return are_of_track(found, record.time, angle)


def _comments(force: Array, noise: float, period: float) -> Iterator[str]:
    """Signs that a force along the drive is not a friction force with slips."""
    if float(np.median(force)) < -noise:
        yield (
            "the force is against the drive most of the time; if the sensor has the opposite sign, "
            "give a velocity of the opposite sign, here or in the configuration"
        )
    if not math.isfinite(period):
        yield "no slips stand out of the noise, so the period of the setup is unknown"


def _mean_speed(time: Array, drive: Array) -> float:
    """Mean speed of a drive that goes back and forth [m/s]."""
    known = np.flatnonzero(np.isfinite(drive))
    return path_of(drive) / float(time[known[-1]] - time[known[0]])


def _as_measured(config: Config, record: Record, title: str) -> Config:
    """The configuration with the duration and sampling interval of the trace."""
    time = record.time
    # Differences of times have rounding errors.
    duration, interval = (
        float(f"{one:.9g}") for one in (time[-1] - time[0], np.median(np.diff(time)))
    )
    changes: dict[str, Any] = {
        "title": config.own_title or title,
        "output.interval": min(interval, duration),
    }
    if not config.drive.parts:
        changes["run.duration"] = duration
    return config.adapted(lambda one: one.replace(changes))


def _drive(
    record: Record,
    velocity: float | None,
    config: Config | None,
    stiffness: float | None,
) -> tuple[Array | None, float | None]:
    """Displacement of the drive [m] and its first nonzero velocity [m/s], as far as known."""
    time = record.time - record.time[0]
    start = 0.0
    if stiffness is not None and 0 < stiffness < math.inf:
        # The slider starts at displacement 0.
        start = record.force[0] / stiffness
    if config is not None and config.drive.force_rate is None:
        velocity = first_velocity(config)
        drive = start + _drive_displacement(config, time)
    elif velocity is not None:
        drive = start + velocity * time
    else:
        drive = None
    if record.load_point is not None:
        if velocity is None:
            known = np.isfinite(record.load_point)
            velocity = float(np.polyfit(time[known], record.load_point[known], 1)[0])
        drive = record.load_point
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
    record: Record, force: Array, drive: Array | None, stiffness: float | None
) -> Array | None:
    """Displacement of the slider [m], recorded or from the stretch of the spring, if known."""
    if record.displacement is not None:
        return record.displacement
    if drive is None or stiffness is None or not 0 < stiffness < math.inf:
        return None
    return drive - force / stiffness


def _tree(
    understood: Understood,
    drive: Array | None,
    displacement: Array | None,
    speed: Array | None,
    found: FoundSlips,
    velocity: float | None,
    attributes: dict[str, Any],
) -> DataTree:
    import xarray as xr

    record = understood.record
    unit = "1" if record.is_friction else "N"
    traces = {
        "drive_displacement": drive,
        "displacement": displacement,
        "velocity": speed,
        record.force_name: record.force,
        **record.signals,
    }
    if not record.is_friction and "normal_force" in record.signals:
        traces["friction_coefficient"] = record.force / _pressing(record.signals["normal_force"])
    root = {
        name: variables.ROOT.variable(name, ("realization", "time"), values[np.newaxis])
        for name, values in traces.items()
        if values is not None
    }
    coordinates = {
        "realization": variables.ROOT.variable("realization", ("realization",), [0]),
        "time": variables.ROOT.variable("time", ("time",), record.time),
    }
    recorded = {
        name: xr.Variable(("row",), one.values, {"long_name": one.header, "units": one.unit})
        for name, one in _names(record).items()
    }
    groups = {
        "/": xr.Dataset(root, coordinates, attributes),
        "/slips": slip_group(found, velocity, understood.stiffness, unit),
        "/slip_counts": count_group(found, unit),
        "/recorded": xr.Dataset(recorded),
    }
    if isinstance(understood.noise, TraceNoise):
        groups["/noise"] = noise_group(understood.noise, unit)
    if record.load_point is not None and understood.config is None:
        known = np.isfinite(record.load_point)
        groups["/stages"] = stage_group(drive_stages(record.time[known], record.load_point[known]))
    return xr.DataTree.from_dict(groups)


def _pressing(normal: Array) -> Array:
    """A normal force that presses, NaN where there is none; sensors have either sign."""
    size = np.abs(normal)
    return np.where(size > 0, size, np.nan)


def _names(record: Record) -> dict[str, RecordedColumn]:
    """Columns of the file by unique names that are valid in netCDF."""
    found: dict[str, RecordedColumn] = {}
    for number, one in enumerate(record.columns, 1):
        name = re.sub(r"\W+", "_", one.header, flags=re.ASCII).strip("_")
        if not name or name[0].isdigit() or name in {*found, "time", "realization"}:
            name = f"column_{number}_{name}".rstrip("_")
        found[name] = one
    return found


def _velocity(time: Array, displacement: Array, period: float) -> Array:
    """Rate of the displacement [m/s]: differences of means over a sixteenth of a period."""
    interval = float(np.median(np.diff(time)))
    samples = period / 32 / interval if math.isfinite(period) else 1
    half = max(1, min(round(samples), len(time) // 2))
    known = np.isfinite(displacement)
    if not known.all():
        displacement = np.interp(time, time[known], displacement[known])
    index = np.arange(len(time))
    # At the ends there are fewer samples on one side.
    below, above = np.maximum(index - half, 0), np.minimum(index + half + 1, len(time))
    sums = [np.concatenate([[0.0], np.cumsum(one - one[0])]) for one in (time, displacement)]
    after = [(one[above] - one[index]) / (above - index) for one in sums]
    before = [(one[index + 1] - one[below]) / (index + 1 - below) for one in sums]
    rate: Array = (after[1] - before[1]) / (after[0] - before[0])
    rate[~known] = np.nan
    return rate
