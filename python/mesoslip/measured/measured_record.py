"""A measured record out of a file: columns to quantities, rows to samples in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mesoslip.analysis.strokes.segments import monotone_pieces, path_of
from mesoslip.array_types import Array
from mesoslip.errors import FileError, shown
from mesoslip.measured.columns import FORCES, Assignment, Used, assign, values_of
from mesoslip.measured.description import Column, TraceDescription
from mesoslip.measured.headers import QUANTITIES, name_of
from mesoslip.measured.missing import sentinels
from mesoslip.measured.parts import continued, joined
from mesoslip.measured.reading.blocks import blocks_of
from mesoslip.measured.reading.file import read_file
from mesoslip.measured.reading.table import Table, listed
from mesoslip.measured.sampling import in_order, sampling_report, sampling_summary
from mesoslip.measured.thinning import thinned
from mesoslip.quantities import number, with_unit

MIN_SAMPLES = 4
# Quantities of a record that are variables of outputs.
SIGNALS = (
    *("normal_force", "normal_stress", "revolutions", "rotation_speed", "sliding_speed"),
    *("viscosity", "acoustic_emission"),
)


@dataclass(frozen=True)
class RecordedColumn:
    """A column of the file as it is: its header, its unit as written, its numbers."""

    header: str
    unit: str
    values: Array
    use: str
    """The quantity that the column was taken for; empty if none."""
    reference: str
    """Unique name of the column, or its number from 1."""


@dataclass(frozen=True)
class Record:
    """Samples in SI at increasing times, each array of shape (samples,)."""

    time: Array
    force: Array
    """Force of the spring, or friction coefficient."""
    is_friction: bool
    mean_normal_force: float | None
    """Mean normal force, recorded or given."""
    load_point: Array | None
    """Displacement of the drive; NaN for missing samples, as in the next two."""
    displacement: Array | None
    """Displacement of the slider."""
    signals: Mapping[str, Array]
    """The recorded ones of `SIGNALS`: rotations in revolutions, emission in V or plain numbers."""
    columns: Sequence[RecordedColumn]
    """All columns of numbers of the file, with the rows that are not used."""
    report: Sequence[str]
    """Lines about the interpretation of the file."""
    summary: Sequence[str]
    """The same, short where samples are uneven."""

    @property
    def force_name(self) -> str:
        return "friction_coefficient" if self.is_friction else "spring_force"


def read_record(paths: Sequence[Path], trace: TraceDescription) -> Record:
    """Read the files of a measurement; ``trace`` has the properties that they do not contain."""
    path = paths[0]
    tables = [_read(one, trace) for one in paths]
    table = joined(tables)
    columns = assign(table, trace.columns, trace.headers)
    _check_needed(table, columns, trace)
    values, notes = {}, []
    for name, used in columns.used.items():
        values[name] = values_of(table, name, used)
        missing, note = sentinels(table, used, trace.missing_numbers if name != "time" else None)
        if missing.any():
            values[name] = np.where(missing, np.nan, values[name])
        notes += [note] if note else []
    described = _column_report(table, columns, values)
    try:
        made = _force(values, trace)
        notes += _complete(values, made, trace)
    except ValueError as error:
        names = _described(table, columns)
        raise FileError(f"{path}: {error}{names}") from None
    force = made.values
    if "time" in values:
        time, moved = continued(values["time"], tables, columns.used["time"].index)
        notes += moved
    else:
        rate, guess = _rate(values, trace)
        columns.guesses += guess
        time = np.arange(len(table.lines)) / rate
    _check_span(time, trace)
    inside = _inside(time, trace)
    whole = np.isfinite(time) & np.isfinite(force)
    left_out = inside & ~whole
    if left_out.any():
        lines = table.lines[left_out].tolist()
        notes.append(f"left out, without time or force: {table.row} {listed(lines)}")
    rows = np.flatnonzero(whole & inside)
    if len(rows) < MIN_SAMPLES:
        given = trace.si("rate")
        where = [
            *(["between start and end"] if not inside.all() else []),
            *([f"at {with_unit(given, 'Hz')}"] if given is not None else []),
            *([f"beside {left_out.sum()} without time or force"] if left_out.any() else []),
        ]
        counted = " ".join([f"{len(rows)} samples", *where])
        raise FileError(f"{path}: has {counted}; a trace needs at least {MIN_SAMPLES}")
    # A slice has no copies.
    usable = rows if len(rows) < len(whole) else slice(None)
    times = time[usable]
    others = [one[usable] for name, one in values.items() if name != "time"]
    order = in_order(path, times, others, table.lines[usable], trace.part, table.row)
    if len(order.rows) < MIN_SAMPLES:
        raise FileError(f"{path}: has {len(order.rows)} samples whose times increase")
    picked = usable if order.time is times else rows[order.rows]
    notes += order.notes
    kept = {
        name: values[name][picked]
        for name in ("load_point", "displacement", *SIGNALS)
        if name in values
    }
    for name, one in kept.items():
        if count := int(np.isnan(one).sum()):
            notes.append(f"{_in_words(name)}: missing in {count} samples")
    radius = _radius(values, trace)
    notes += _turned(order.time, kept, radius[picked] if isinstance(radius, np.ndarray) else radius)
    if inside.sum() < len(inside):
        outside = int((~inside).sum())
        notes.append(f"left out, before start or after end: {outside} of {inside.size}")
    before = [*described, made.line]
    after = [*notes, *(f"guess: {one}" for one in columns.guesses)]
    return Record(
        order.time,
        force[picked],
        made.is_friction,
        made.mean_normal,
        kept.pop("load_point", None),
        kept.pop("displacement", None),
        kept,
        columns=[
            _recorded(table, columns, index)
            for index in range(len(table.headers))
            if np.isfinite(table.values[index]).any()
        ],
        report=[*before, *sampling_report(order.time), *after],
        summary=[*before, *sampling_summary(order.time), *after],
    )


def _read(path: Path, trace: TraceDescription) -> Table:
    """The table of a file, thinned to a rate that is given beside a column of times."""
    rate = trace.si("rate")
    has_headers = trace.headers is not None or bool(trace.columns.model_fields_set)
    read: Callable[..., Any] = read_file if rate is None else blocks_of
    found = read(
        path,
        decimal=trace.decimal,
        dates=trace.dates,
        sheet=trace.sheet,
        has_headers=has_headers,
    )
    if rate is not None:
        found = thinned(
            found,
            rate,
            lambda one: assign(one, trace.columns, trace.headers),
            trace.missing_numbers,
        )
    table: Table = found
    return table


def resolve(trace: TraceDescription, record: Record) -> TraceDescription:
    """A description with the columns that were found, so that it repeats the reading."""
    columns = dict(trace.columns)
    for one in record.columns:
        if one.use and columns.get(one.use) is None:
            columns[one.use] = Column(column=one.reference, unit=one.unit or None)
    return trace.model_copy(
        update={"columns": {key: one for key, one in columns.items() if one}, "headers": None}
    )


def _recorded(table: Table, columns: Assignment, index: int) -> RecordedColumn:
    header, position = table.headers[index], str(index + 1)
    use = next((name for name, one in columns.used.items() if one.index == index), "")
    unit = columns.used[use].unit if use else table.units[index]
    names = [name_of(one) for one in table.headers]
    is_unique = bool(header.strip()) and names.count(name_of(header)) == 1
    return RecordedColumn(
        header or f"column {position}",
        unit,
        table.values[index],
        use,
        header if is_unique else position,
    )


def _check_needed(table: Table, columns: Assignment, trace: TraceDescription) -> None:
    """Check that the file has the time and a force, stress or coefficient."""
    used, names = columns.used, _described(table, columns)
    rate = trace.si("rate")
    if not set(FORCES) & used.keys():
        raise FileError(
            f"{table.path}: has no column of the force, such as 'force [uN]', 'shear stress "
            f"(MPa)' or 'friction'{names}; say what they are with "
            "--columns, or in [trace.columns] of an EXPERIMENT.toml"
        )
    has_rate = rate is not None or ("load_point" in used and trace.si("velocity"))
    if "time" not in used and not has_rate:
        raise FileError(
            f"{table.path}: has no column of the time, such as 'time [s]'{names}; say what they "
            "are with --columns, or give a sampling rate with --rate, or for a column of the load "
            "point its speed with --velocity"
        )


def _described(table: Table, columns: Assignment) -> str:
    """The unused columns of a file, and the reasons; empty without any."""
    texts = []
    for index, header in enumerate(table.headers):
        if any(one.index == index for one in columns.used.values()):
            continue
        why = columns.unused.get(index, "")
        texts.append(f"{shown(header)}{f' ({why})' if why and why != 'as asked' else ''}")
    return f"; its other columns are {', '.join(texts)}" if texts else ""


class Force(NamedTuple):
    """A force [N] or friction coefficient, a line about it, and the normal force [N]."""

    values: Array
    is_friction: bool
    line: str
    normal: Array | float | None

    @property
    def mean_normal(self) -> float | None:
        """Mean normal force [N]."""
        return None if self.normal is None else float(np.nanmean(self.normal))


def _rate(values: dict[str, Array], trace: TraceDescription) -> tuple[float, list[str]]:
    """Sampling rate of a file without times [Hz]: given, or a guess by the path of the load point
    at its velocity."""
    given = trace.si("rate")
    if given is not None:
        return given, []
    position, velocity = values["load_point"], abs(trace.si("velocity") or 0.0)
    path = path_of(position)
    if not path > 0:
        raise FileError("the load point does not move: give a sampling rate with --rate")
    rate = velocity * (len(position) - 1) / path
    return rate, [
        f"samples are even in time, at {with_unit(rate, 'Hz')}, as the load point moves by "
        f"{with_unit(path, 'm')} at {with_unit(velocity, 'm/s')} (--rate)"
    ]


def _complete(values: dict[str, Array], made: Force, trace: TraceDescription) -> list[str]:
    """Add the quantities that follow from others, and lines about them."""
    lines = []
    if made.normal is not None:
        values["normal_force"] = np.broadcast_to(made.normal, made.values.shape)
    radius = _radius(values, trace)
    if radius is not None and "rotation_speed" in values and "sliding_speed" not in values:
        values["sliding_speed"] = math.tau * radius * np.abs(values["rotation_speed"])
        lines.append(
            f"sliding speed: 2 pi x radius ({_mean(radius, 'm')}) x rotation speed, "
            f"{_range(values['sliding_speed'], 'sliding_speed')}"
        )
    return lines


def _turned(time: Array, kept: dict[str, Array], radius: Array | float | None) -> list[str]:
    """Unwrap an angle that starts again after each revolution, and make a rotation back and forth
    the motion of a load point; lines about it."""
    source = next((one for one in ("revolutions", "rotation_speed") if one in kept), None)
    if source is None:
        return []
    turned = kept[source]
    known = np.isfinite(turned)
    if not known.any():
        return []
    if source == "rotation_speed":
        speed = np.interp(time, time[known], turned[known])
        steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
        turned = np.concatenate([[0.0], np.cumsum(steps)])
    elif np.ptp(turned[known]) <= 1 and np.abs(np.diff(turned[known])).max() > 0.5:
        kept[source] = turned.copy()
        kept[source][known] = np.unwrap(turned[known], period=1)
        return ["revolutions: of an angle that starts again after each one"]
    if "load_point" in kept or monotone_pieces(turned) is None:
        return []
    del kept[source]
    if radius is None:
        return ["guess: the rotation goes back and forth; strokes by it need a --radius"]
    kept["load_point"] = math.tau * radius * turned
    return [
        f"load point: 2 pi x radius ({_mean(radius, 'm')}) x {_in_words(source)}, as that "
        f"goes back and forth, {_range(kept['load_point'], 'load_point')}"
    ]


def _radius(values: dict[str, Array], trace: TraceDescription) -> Array | float | None:
    """Radius of the track [m]; one that is given goes before a column."""
    given = trace.si("radius")
    return values.get("radius") if given is None else given


def _mean(values: Array | float, unit: str) -> str:
    return with_unit(float(np.nanmean(values)), unit)


def _force(values: dict[str, Array], trace: TraceDescription) -> Force:
    """The force or friction coefficient; a ValueError if a shear stress becomes neither."""
    area, given_force, given_stress = (
        trace.si(name) for name in ("area", "normal_force", "normal_stress")
    )
    stress: Array | float | None = values.get("normal_stress", given_stress)
    normal: Array | float | None = values.get("normal_force", given_force)
    from_what = "normal force"
    if normal is None and stress is not None and area is not None:
        normal, from_what = stress * area, "normal stress x area"
    if "force" in values:
        return Force(values["force"], False, "force: as recorded", normal)
    if "torque" in values:
        radius = _radius(values, trace)
        if radius is None:
            raise ValueError("the force is a torque: give --radius, such as '30 mm'")
        line = f"force: torque / radius ({_mean(radius, 'm')})"
        return Force(values["torque"] / radius, False, line, normal)
    if "shear_stress" in values:
        shear = values["shear_stress"]
        if area is not None:
            line = f"force: shear stress x area ({number(area, 6)} m^2)"
            return Force(shear * area, False, line, normal)
        if stress is None and normal is not None:
            raise ValueError("a shear stress and a normal force need an area: give --area")
        if stress is not None:
            line = "friction coefficient: shear stress / normal stress"
            return Force(shear / stress, True, line, None)
        if "friction" not in values:
            raise ValueError(
                "the force is a shear stress: give --area to make it a force, or --normal-stress "
                "to make it a friction coefficient"
            )
    friction = values["friction"]
    if normal is None:
        line = "friction coefficient: as recorded (no normal force is known)"
        return Force(friction, True, line, None)
    line = f"force: friction coefficient x {from_what} ({_mean(normal, 'N')})"
    return Force(friction * normal, False, line, normal)


def _check_span(time: Array, trace: TraceDescription) -> None:
    """Check that start and end are within the record."""
    known = time[np.isfinite(time)]
    if known.size == 0:
        return
    for name, is_wrong in (("start", known.max()), ("end", known.min())):
        value = trace.si(name)
        if value is not None and (value > is_wrong if name == "start" else value < is_wrong):
            raise FileError(
                f"--{name} {value:g} s is outside of the record, which is from {known.min():g} s "
                f"to {known.max():g} s"
            )


def _inside(time: Array, trace: TraceDescription) -> np.ndarray[tuple[int], np.dtype[np.bool]]:
    """Rows between start and end, and those without a time."""
    start, end = trace.si("start"), trace.si("end")
    inside = np.ones(len(time), dtype=bool)
    if start is not None:
        inside &= ~(time < start)
    if end is not None:
        inside &= ~(time > end)
    return inside


def _column_report(table: Table, columns: Assignment, values: dict[str, Array]) -> list[str]:
    """Lines about the file and its columns."""
    lines = list(table.notes)
    used = dict(columns.used)
    force = next((name for name in FORCES if name in used), None)
    for name, one in used.items():
        header = shown(table.headers[one.index]) if table.headers[one.index] else ""
        place = f"column {one.index + 1}{f' {header}' if header else ''}"
        lines.append(f"{_in_words(name)}: {place}{_scale(name, one)}, {_range(values[name], name)}")
    for name in FORCES:
        if name in used and name != force and not (force == "shear_stress" and name == "friction"):
            lines.append(f"not used: {_in_words(name)}, as there is a {force}")
    for index, why in sorted(columns.unused.items()):
        header = shown(table.headers[index]) if table.headers[index] else "without a name"
        lines.append(f"not used: column {index + 1} {header}{f' ({why})' if why else ''}")
    return lines


def _si(name: str) -> str:
    """SI unit in print, of revolutions that of pure numbers."""
    return QUANTITIES[name].replace("rev", "1")


def _in_words(name: str) -> str:
    return "slider displacement" if name == "displacement" else name.replace("_", " ")


def _scale(name: str, used: Used) -> str:
    unit = _si(name)
    if unit == "1":
        text = "" if used.size == 1 else f", each {number(used.size, 6)}"
    else:
        text = f", in {used.unit}" if used.unit else ""
        if used.unit != unit:
            text += f" ({used.size:.7g} {unit})"
    return text + (f" after subtracting {used.offset:g}" if used.offset else "")


def _range(values: Array, name: str) -> str:
    known = values[np.isfinite(values)]
    if known.size == 0:
        return "no number"
    unit = _si(name)
    low, high = float(known.min()), float(known.max())
    if name == "time":
        return f"{low:.10g} to {high:.10g} s"
    return f"{with_unit(low, unit, 5)} to {with_unit(high, unit, 5)}"
