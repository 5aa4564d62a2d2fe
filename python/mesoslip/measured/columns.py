"""Columns of a file by what they hold: from their headers, or as described."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mesoslip.analysis.strokes.segments import monotone_pieces
from mesoslip.array_types import Array
from mesoslip.configuration.columns import IGNORED
from mesoslip.configuration.units import NUMBER, is_number, to_si
from mesoslip.errors import ConfigError, FileError, Problem, shown
from mesoslip.measured.description import Column, Columns
from mesoslip.measured.headers import (
    BRACKETS,
    EITHER,
    QUANTITIES,
    Heading,
    bare_name,
    name_of,
    read_header,
)
from mesoslip.measured.reading.table import Table, listed
from mesoslip.measured.units import plain, size_of, unit_named

# Examples of headers.
EXAMPLES = {
    "time": "time [s]",
    "force": "force [uN]",
    "shear_stress": "shear_stress [MPa]",
    "friction": "friction [1]",
    "normal_force": "normal_force [N]",
    "normal_stress": "normal_stress [MPa]",
    "load_point": "load_point [um]",
    "displacement": "displacement [nm]",
    "revolutions": "revolutions [1]",
    "rotation_speed": "rotation_speed [rpm]",
    "torque": "torque [N m]",
    "radius": "radius [mm]",
    "sliding_speed": "sliding_speed [m/s]",
    "viscosity": "viscosity [mPa*s]",
    "acoustic_emission": "acoustic_emission [V]",
}
# Other names in the headers of options and tables.
OTHER_NAMES = {
    "spring_force": "force",
    "drive": "load_point",
    "drive_displacement": "load_point",
    "friction_coefficient": "friction",
    "mu": "friction",
    "rotation": "revolutions",
    "angle": "revolutions",
}
# Examples of factors of columns of a voltage, by SI unit.
EXAMPLE_FACTORS = {
    "N": "12.4 mN/V",
    "N*m": "1 N m/V",
    "m": "0.5 mm/V",
    "Pa": "2 MPa/V",
    "s": "1 s/V",
}
# Minimum number of values of a time over that of another one beside it.
MIN_TIMES = 0.2
# Maximum correlation of steps of the force with those of the displacement of a slider.
MAX_SLIDER = -0.3
# Quantities that are a force or become one, in order of preference.
FORCES = ("force", "torque", "shear_stress", "friction")


@dataclass
class Used:
    """A used column: (number - offset) x size is the quantity in SI."""

    index: int
    unit: str
    """Its unit as written; may be empty."""
    size: float
    offset: float = 0.0


@dataclass
class Assignment:
    """The used columns by quantity, and notes about the others by index."""

    used: dict[str, Used] = field(default_factory=dict)
    unused: dict[int, str] = field(default_factory=dict)
    guesses: list[str] = field(default_factory=list)


def assign(table: Table, columns: Columns, headers: str | None) -> Assignment:
    """Find the quantity of each column, from its description, or else from its header; ``headers``
    replace those of the file."""
    given = None if headers is None else _given(table, headers)
    found = Assignment()
    problems = []
    for name in columns.model_fields_set:
        column = getattr(columns, name)
        if column is None:
            continue
        try:
            found.used[name] = _described(table, name, column, found.guesses)
        except ValueError as error:
            problems.append(Problem(str(table.path), f"trace.columns.{name}", str(error)))
    if problems:
        raise ConfigError(problems)
    taken = {one.index for one in found.used.values()}
    headings = {
        index: (_explicit(table, header) if given is not None else read_header(header, unit))
        for index, (header, unit) in enumerate(
            zip(given if given is not None else table.headers, table.units, strict=True)
        )
        if index not in taken and header != IGNORED
    }
    _from_headings(table, headings, found)
    for index in range(len(table.headers)):
        if index not in {one.index for one in found.used.values()}:
            found.unused.setdefault(index, "" if given is None else "as asked")
    return found


def _given(table: Table, headers: str) -> list[str]:
    """Headers of an option, one for each column."""
    cells = [one.strip() for one in re.split(r",(?![^\[({]*[\])}])", headers)]
    if len(cells) != len(table.headers):
        raise FileError(
            f"{table.path}: --columns names {len(cells)} columns, the file has "
            f"{len(table.headers)}; '{IGNORED}' stands for a column to ignore"
        )
    return cells


def _explicit(table: Table, header: str) -> Heading:
    """Meaning of a header in an option, which must name a quantity."""
    heading = read_header(header)
    name = re.sub(r"\s*[\[({].*", "", header).strip().lower().replace(" ", "_")
    quantity = name if name in QUANTITIES else OTHER_NAMES.get(name, heading.quantity)
    if quantity in {None, EITHER}:
        known = ", ".join(QUANTITIES)
        raise FileError(
            f"{table.path}: --columns: {header!r} is none of {known}; '{IGNORED}' stands for a "
            "column to ignore"
        )
    given = BRACKETS.search(header)
    unit = given[0][1:-1].strip() if given else ""
    # Acoustic emission is often in arbitrary units.
    if unit not in {"", "-"} and heading.unit is None and quantity != "acoustic_emission":
        raise FileError(f"{table.path}: --columns: {header!r}: {unit!r} is not a unit")
    return heading._replace(quantity=quantity)


def _described(table: Table, name: str, column: Column, guesses: list[str]) -> Used:
    """A column as a table describes it, with guesses about its unit; a ValueError if it is missing
    or its units disagree."""
    index = _index_of(table, column.column)
    heading = read_header(table.headers[index], table.units[index])
    unit = plain(column.unit if column.unit is not None else heading.unit or "")
    if column.factor is None:
        size, guess = _size(unit, name, table.headers[index])
        guesses += [guess] if guess else []
        return Used(index, unit or _assumed(name), size, _offset(column.offset, unit))
    # Pure numbers of revolutions.
    si = QUANTITIES[name].replace("rev", "1")
    factor, unit = _factor(column.factor, unit, si)
    return Used(index, unit, factor, _offset(column.offset, unit))


def _index_of(table: Table, column: str) -> int:
    """Index of a column by its header, its name without the unit, or its number from 1."""
    for named in (
        lambda text: text.strip().casefold(),
        lambda text: re.sub(r"\s*[\[({<].*", "", text).strip().casefold(),
        name_of,
        bare_name,
    ):
        target = named(column)
        matches = [n for n, one in enumerate(table.headers) if target and named(one) == target]
        if len(matches) == 1:
            return matches[0]
        if len(matches) > 1:
            raise ValueError(
                f"columns {listed([one + 1 for one in matches])} have the name {shown(column)}; "
                "give the number of one"
            )
    if column.isascii() and column.isdigit() and 1 <= int(column) <= len(table.headers):
        return int(column) - 1
    raise ValueError(f"no column {shown(column)}; the file has {_names(table.headers)}")


def _names(headers: Sequence[str]) -> str:
    if not any(headers):
        return f"{len(headers)} columns without names: give their numbers from 1"
    return ", ".join(shown(one) for one in headers)


def _size(unit: str, quantity: str, header: str) -> tuple[float, str]:
    """Size of a unit, and doubts about it; a ValueError if it has another dimension."""
    si, right = QUANTITIES[quantity], f"write it as {EXAMPLES[quantity]!r}"
    if not unit and si in {"1", "rev", "V"}:
        return 1.0, ""
    if not unit and quantity == "time":
        return 1.0, f"{shown(header)} has no unit: taken as seconds"
    if not unit:
        raise ValueError(f"column {shown(header)} has no unit; {right}")
    try:
        found = size_of(unit, si)
    except ValueError:
        found = None
    if found is None:
        hint = ""
        if size_of_voltage(unit):
            hint = f", or give its factor, such as {_factor_example(si)!r} in [trace.columns]"
        raise ValueError(
            f"column {shown(header)} has the unit {shown(unit)}, which is not a unit of "
            f"{quantity.replace('_', ' ')}; {right}{hint}"
        )
    return found.size, f"{shown(header)}: {found.note}" if found.note else ""


def _assumed(quantity: str) -> str:
    """The unit of a column without one."""
    return "s" if quantity == "time" else ""


def size_of_voltage(unit: str) -> float | None:
    """Size of a unit of voltage [V]; None for other units."""
    try:
        found = size_of(unit, "V")
    except ValueError:
        return None
    return None if found is None else found.size


def _factor_example(si: str) -> str:
    return EXAMPLE_FACTORS.get(si, "0.1 1/V")


def _factor(text: str, unit: str, si: str) -> tuple[float, str]:
    """A factor in SI for one unit of a column, and that unit; a ValueError for other dimensions."""
    text = plain(text)
    try:
        # A quantity for each number of the column, whatever its unit.
        return to_si(float(text) if is_number(text) and si == "1" else text, si, ""), unit
    except ValueError:
        pass
    above, slash, below = text.rpartition("/")
    wanted = (
        f"factor = {shown(text)}: expected a quantity for one unit of the column, such as "
        f"{_factor_example(si)!r} or '2 {si}'"
    )
    name = unit_named(below) if slash else None
    if name in {None, "1"}:
        raise ValueError(wanted)
    quantity = above.strip()
    # "0.1 1/V" is a coefficient for a volt.
    match = NUMBER.match(quantity)
    if si == "1" and match and quantity[match.end() :].strip() in {"", "1"}:
        size = float(match[0])
    else:
        try:
            size = to_si(quantity, si, "")
        except ValueError:
            raise ValueError(wanted) from None
    if not unit or unit_named(unit) == name:
        return size, unit or str(name)
    volts, of_column = size_of_voltage(str(name)), size_of_voltage(unit)
    if volts is None or of_column is None:
        raise ValueError(f"{wanted}; the column is in {shown(unit)}, not in {shown(below)}")
    return size * of_column / volts, unit


def _offset(text: str | None, unit: str) -> float:
    """The number to subtract, in the unit of a column; a ValueError for other units."""
    if text is None:
        return 0.0
    text = plain(text)
    match = NUMBER.match(text)
    wanted = f"offset = {shown(text)}: expected a number in the unit of the column"
    named = f", such as '0.3 {unit}'" if unit else ", such as '0.3'"
    if match is None:
        raise ValueError(wanted + named)
    number, given = float(match[0]), text[match.end() :].strip()
    if not given or unit_named(given) == unit_named(unit):
        return number
    volts, of_column = size_of_voltage(given), size_of_voltage(unit)
    if volts is not None and of_column is not None:
        return number * volts / of_column
    if not unit:
        return number
    raise ValueError(wanted + named)


def _from_headings(table: Table, headings: Mapping[int, Heading], found: Assignment) -> None:
    """Assign columns by their headers."""
    by_quantity: dict[str, list[int]] = {}
    for index, heading in headings.items():
        if heading.quantity is not None:
            by_quantity.setdefault(heading.quantity, []).append(index)
    either = by_quantity.pop(EITHER, [])
    has_force = not found.used.keys().isdisjoint(FORCES)
    names = {
        index: bare_name(table.headers[index])
        for index, one in headings.items()
        if one.unit and one.quantity is None
    }
    loads = [index for index, name in names.items() if name in {"load", "load cell"}]
    is_normal = has_force or bool(set(FORCES) & by_quantity.keys())
    if len(loads) == 1 and not (is_normal and "normal_force" in by_quantity):
        # Beside a friction it presses, alone or beside a normal force it pulls.
        (index,) = loads
        quantity, why = ("normal_force", "beside") if is_normal else ("force", "without")
        what = quantity.replace("_", " ")
        guess = f"{shown(table.headers[index])} taken as the {what}, {why} another force"
        _use(table, quantity, index, Heading(quantity, headings[index].unit, guess), found)
    for quantity, indices in by_quantity.items():
        if quantity in found.used or (has_force and quantity in FORCES):
            continue
        if len(indices) > 1:
            _two(table, quantity, indices, headings, found)
        else:
            _use(table, quantity, indices[0], headings[indices[0]], found)
    stamps = [one for one in table.clocks if one in headings and headings[one].quantity is None]
    if "time" not in found.used and len(stamps) == 1:
        found.used["time"] = Used(stamps[0], "s", 1.0)
    for index in either:
        found.unused[index] = "a displacement of the load point or of the slider?"
    if len(either) == 1 and not ({"load_point", "displacement"} <= found.used.keys()):
        _use_either(table, either[0], headings[either[0]], found)


def _two(
    table: Table,
    quantity: str,
    indices: Sequence[int],
    headings: Mapping[int, Heading],
    found: Assignment,
) -> None:
    """Use the one column of a quantity that has numbers and a unit; refuse two of a needed one."""
    usable = []
    for index in indices:
        try:
            if quantity != "time":
                _size(headings[index].unit or "", quantity, table.headers[index])
        except ValueError as error:
            found.unused[index] = str(error)
        else:
            if np.isfinite(table.values[index]).any():
                usable.append(index)
            else:
                found.unused[index] = "has no numbers"
    if quantity == "time" and usable:
        usable = _clocks(table, usable, found)
    if len(usable) == 1:
        _use(table, quantity, usable[0], headings[usable[0]], found)
        return
    headers = " and ".join(shown(table.headers[one]) for one in usable)
    if usable and quantity in {"time", *FORCES}:
        raise FileError(
            f"{table.path}: has two columns of {quantity.replace('_', ' ')}: {headers}; name one "
            f"in [trace.columns], or ignore one in --columns with '{IGNORED}'"
        )
    for index in usable:
        found.unused[index] = f"two columns of {quantity.replace('_', ' ')}"


def _clocks(table: Table, indices: Sequence[int], found: Assignment) -> list[int]:
    """Columns of times without those that are the same as the finest one, or hardly change."""
    counts = {one: np.unique(table.values[one]).size for one in indices}
    finest = max(reversed(indices), key=counts.__getitem__)
    for one in indices:
        if one == finest:
            continue
        if _same_clock(table.values[one], table.values[finest]):
            found.unused[one] = "another column has the same time"
        elif counts[one] < MIN_TIMES * counts[finest]:
            found.unused[one] = "hardly changes: a duration, beside another time"
    return [one for one in indices if one not in found.unused]


def _same_clock(one: Array, other: Array) -> bool:
    """Whether two columns of times differ by a constant, up to the steps in which they are read."""
    known = np.isfinite(one) & np.isfinite(other)
    if np.count_nonzero(known) < 2:
        return False
    steps = [np.abs(np.diff(row[known])) for row in (one, other)]
    # Rounded times are equal in several rows.
    step = max(float(np.median(row[row > 0])) if row.any() else 0.0 for row in steps)
    return float(np.ptp(one[known] - other[known])) <= 2 * step


def _use(table: Table, quantity: str, index: int, heading: Heading, found: Assignment) -> None:
    """Use a column for a quantity, if its unit is known."""
    header, unit = table.headers[index], heading.unit or ""
    if quantity == "load_point" and _is_constant(table.values[index]):
        found.unused[index] = "constant: a load point moves"
        return
    try:
        size, guess = _size(unit, quantity, header)
    except ValueError as error:
        found.unused[index] = str(error)
        return
    found.used[quantity] = Used(index, unit or _assumed(quantity), size)
    found.guesses += [one for one in (guess, heading.guess) if one]


def _use_either(table: Table, index: int, heading: Heading, found: Assignment) -> None:
    """Use a displacement as that of the load point or of the slider, depending on its motion."""
    if _is_constant(table.values[index]):
        found.unused[index] = "constant: neither a load point nor a slider moves so"
        return
    if "load_point" in found.used:
        quantity, why = "displacement", "as the load point has a column of its own"
    elif "displacement" in found.used:
        quantity, why = "load_point", "as the slider has a column of its own"
    elif monotone_pieces(table.values[index]) is not None:
        quantity, why = "load_point", "as it goes back and forth"
    elif _moves_in_slips(table, index, found):
        quantity, why = "displacement", "as it moves ahead where the force falls"
    else:
        quantity, why = "load_point", "as it does not move ahead where the force falls"
    _use(table, quantity, index, heading, found)
    if quantity in found.used:
        found.unused.pop(index, None)
        what = {"displacement": "the slider", "load_point": "the load point (drive)"}[quantity]
        found.guesses.append(
            f"{shown(table.headers[index])} taken as the displacement of {what}, {why}"
        )


def _is_constant(values: Array) -> bool:
    """Whether a column has a single number."""
    known = values[np.isfinite(values)]
    return not known.size or float(np.ptp(known)) == 0.0


def _moves_in_slips(table: Table, index: int, found: Assignment) -> bool:
    """Whether a displacement moves ahead where the force falls, as that of a slider does."""
    force = next((found.used[one] for one in FORCES if one in found.used), None)
    if force is None:
        return False
    x, f = table.values[index], force.size * table.values[force.index]
    known = np.isfinite(x) & np.isfinite(f)
    steps, falls = np.diff(x[known]), np.diff(f[known])
    if len(steps) < 3 or np.std(steps) == 0 or np.std(falls) == 0:
        return False
    direction = 1.0 if x[known][-1] >= x[known][0] else -1.0
    return bool(direction * np.corrcoef(steps, falls)[0, 1] < MAX_SLIDER)


def values_of(table: Table, name: str, used: Used) -> Array:
    """Values of a column in SI; NaN for missing cells."""
    bad = table.bad.get(used.index)
    if bad:
        first, *others = bad
        header = table.headers[used.index]
        column = f"column {shown(header)}" if header else f"column {used.index + 1}"
        more = f" (and {len(others)} more of the column)" if others else ""
        raise FileError(
            f"{table.path}: line {first.line}: {column}: the {name.replace('_', ' ')}, "
            f"{shown(first.text)}, is not a number{first.hint}{more}"
        )
    recorded: Array = table.values[used.index]
    if used.offset == 0 and used.size == 1:
        return recorded
    return (recorded - used.offset) * used.size
