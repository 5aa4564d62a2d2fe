"""Tables of measurements: columns of numbers with units in their headers, checked line by line."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.units import to_si
from mesoslip.errors import FileError

Array = NDArray[np.float64]

# What a column may be called, what it is, its unit in SI, and what a good header looks like.
COLUMNS = {
    "time": ("time", "s", "time [s]"),
    "force": ("force", "N", "force [uN]"),
    "spring_force": ("force", "N", "force [uN]"),
    "displacement": ("displacement", "m", "displacement [nm]"),
    "drive": ("drive", "m", "drive [nm]"),
    "drive_displacement": ("drive", "m", "drive [nm]"),
}
# What stands for a column that is not read.
IGNORED = "-"
HEADER = re.compile(r"(?P<name>[^\[(]*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")
DELIMITERS = ",;\t"
# An interval between two samples is a gap if it is longer than this many usual ones.
GAP = 1.5
# Size of the longest file that is read [bytes].
LONGEST_FILE = 2**31


@dataclass(frozen=True)
class Measurements:
    """What was measured.

    Attributes
    ----------
    time
        Times of the samples [s], shape (samples,), increasing.
    force
        Force of the spring [N].
    displacement, drive
        Displacements of the slider and of the drive [m]; None if they were not measured.
    """

    time: Array
    force: Array
    displacement: Array | None
    drive: Array | None


def read_table(
    path: Path,
    *,
    columns: str | None = None,
    rate: float | None = None,
    largest_gap: float | None = None,
) -> Measurements:
    """Read a table of measurements: comma, semicolon, tab or blanks between columns.

    Lines that are empty or start with ``#`` are passed over. With another separator than the comma,
    decimal commas are read as well.

    Parameters
    ----------
    path
        The file.
    columns
        Headers, such as "time [s], force [uN], -", in the place of those of the file.
    rate
        Samples in a second [1/s], if the file has no times.
    largest_gap
        Longest time without values [s] that is filled by straight lines; none by default.

    Raises
    ------
    FileError
        If the file cannot be read, or anything in it is wrong: the message tells the line.
    """
    lines = _lines(path)
    delimiter = _delimiter(lines[0][1])
    first = _split(lines[0][1], delimiter)
    has_header = not any(_is_number(cell, delimiter) for cell in first)
    if has_header:
        lines = lines[1:]
    elif columns is None:
        raise FileError(
            f"{path}: line {lines[0][0]}: has no header such as 'time [s], force [uN]'; write one, "
            "or give one with --columns"
        )
    headers = first if columns is None else [one.strip() for one in columns.split(",")]
    if len(headers) != len(first):
        raise FileError(
            f"{path}: --columns names {len(headers)} columns, the file has {len(first)}; "
            f"'{IGNORED}' stands for one that is not read"
        )
    place = _places(path, headers, has_rate=rate is not None)
    if "time" in place and rate is not None:
        raise FileError(
            f"{path}: has times, so no rate must be given; '{IGNORED}' in --columns leaves them out"
        )
    values = _values(path, lines, delimiter, place, keep_missing=largest_gap is not None)
    numbers = np.array([number for number, _ in lines])
    if "time" not in place:
        assert rate is not None
        values["time"] = np.arange(len(numbers)) / rate
    return _checked(path, values, numbers, largest_gap)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Lines of a file with their numbers, without comments."""
    if path.is_dir():
        raise FileError(f"{path}: is a directory, not a table of measurements")
    try:
        if not path.exists():
            raise FileError(f"{path}: no such file")
        if not path.is_file():
            raise FileError(f"{path}: is a device or the like, not a table of measurements")
        if path.stat().st_size > LONGEST_FILE:
            raise FileError(f"{path}: is longer than {LONGEST_FILE / 2**30:g} GiB")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        is_output = path.suffix == ".nc"
        told = "is an output already" if is_output else f"is not a text in UTF-8: {error.reason}"
        raise FileError(f"{path}: {told}; expected a table of measurements") from None
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    lines = [
        (number, line.strip())
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise FileError(f"{path}: is empty; expected columns such as 'time [s], force [uN]'")
    return lines


def _delimiter(line: str) -> str:
    """What separates columns; a blank stands for any number of blanks."""
    found = {one: line.count(one) for one in DELIMITERS}
    # A comma beside a semicolon or a tab is a decimal one.
    if found[";"] or found["\t"]:
        return ";" if found[";"] >= found["\t"] else "\t"
    return "," if found[","] else " "


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        # Units stand apart from names.
        return re.findall(r"\S+(?:\s*[\[(][^\])]*[\])])?", line)
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _number(cell: str, delimiter: str) -> float:
    return float(cell if delimiter == "," else cell.replace(",", "."))


def _is_number(cell: str, delimiter: str) -> bool:
    try:
        return math.isfinite(_number(cell, delimiter))
    except ValueError:
        return False


def _places(path: Path, headers: Sequence[str], *, has_rate: bool) -> dict[str, tuple[int, float]]:
    """Where columns are that are read, and their units in SI."""
    place: dict[str, tuple[int, float]] = {}
    for number, header in enumerate(headers):
        match = HEADER.fullmatch(header)
        name = "" if match is None else match["name"].strip().lower().replace(" ", "_")
        if match is None or name not in COLUMNS:
            continue
        what, unit, example = COLUMNS[name]
        if what in place:
            raise FileError(f"{path}: has two columns of {what}: give other ones a '{IGNORED}'")
        if not match["unit"]:
            raise FileError(f"{path}: column {header!r} has no unit; write it as {example!r}")
        try:
            place[what] = number, to_si(f"1 {match['unit']}", unit, f"1 {unit}")
        except ValueError:
            raise FileError(
                f"{path}: column {header!r} has the unit {match['unit']!r}, which is none of "
                f"{what}; write it as {example!r}"
            ) from None
    there = ", ".join(repr(header) for header in headers)
    if "force" not in place:
        raise FileError(
            f"{path}: has no column of the force, such as 'force [uN]'; it has {there}; "
            "--columns gives them other headers"
        )
    if "time" not in place and not has_rate:
        raise FileError(
            f"{path}: has no column of the time, such as 'time [s]'; it has {there}; give "
            "--columns with other headers, or --rate with samples in a second"
        )
    return place


def _values(
    path: Path,
    lines: Sequence[tuple[int, str]],
    delimiter: str,
    place: dict[str, tuple[int, float]],
    *,
    keep_missing: bool,
) -> dict[str, Array]:
    """Values of the columns in SI."""
    rows = np.empty((len(place), len(lines)))
    wanted = list(place.values())
    last = max(number for number, _ in wanted)
    for row, (line, text) in enumerate(lines):
        cells = _split(text, delimiter)
        if len(cells) <= last:
            raise FileError(
                f"{path}: line {line}: has {len(cells)} columns; there must be {last + 1}"
            )
        for at, (number, unit) in enumerate(wanted):
            cell = cells[number]
            is_missing = keep_missing and cell == ""
            try:
                value = math.nan if is_missing else _number(cell, delimiter)
            except ValueError:
                raise FileError(f"{path}: line {line}: {cell!r} is no number") from None
            if not (math.isfinite(value) or (keep_missing and math.isnan(value))):
                raise FileError(
                    f"{path}: line {line}: {cell!r} is not a finite number; --largest-gap fills "
                    "what is missing by straight lines"
                )
            rows[at, row] = value * unit
    return dict(zip(place, rows, strict=True))


def _checked(
    path: Path, values: dict[str, Array], numbers: NDArray[np.int_], largest_gap: float | None
) -> Measurements:
    """Measurements whose times increase without gaps."""
    whole = np.isfinite(list(values.values())).all(axis=0)
    values = {name: column[whole] for name, column in values.items()}
    numbers = numbers[whole]
    time = values["time"]
    if len(time) < 4:
        raise FileError(f"{path}: has {len(time)} samples; a trace needs more")
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        at = back[0]
        raise FileError(
            f"{path}: line {numbers[at + 1]}: the time {time[at + 1]:g} s does not come after "
            f"{time[at]:g} s on line {numbers[at]}; times must increase"
        )
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    for at in gaps:
        if largest_gap is None or steps[at] > largest_gap:
            raise FileError(
                f"{path}: line {numbers[at + 1]}: a gap of {steps[at]:g} s after {time[at]:g} s, "
                f"where samples are {usual:g} s apart; cut the file there, or fill it with "
                "--largest-gap"
            )
    if gaps.size:
        counts = [round(steps[at] / usual) for at in gaps]
        filled = [
            time[at] + np.arange(1, count) * steps[at] / count
            for at, count in zip(gaps, counts, strict=True)
        ]
        whole_time = np.sort(np.concatenate([time, *filled]))
        values = {
            name: np.interp(whole_time, time, column)
            for name, column in values.items()
            if name != "time"
        } | {"time": whole_time}
    return Measurements(
        values["time"], values["force"], values.get("displacement"), values.get("drive")
    )
