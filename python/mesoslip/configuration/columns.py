"""Tables with units: columns of numbers under headers such as ``time [s]``, read strictly.

Ambiguous numbers are refused; the message names the line and the fix.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from mesoslip.configuration.units import GROUPED, number_of, to_si
from mesoslip.errors import FileError, shown

# Header of a column that is not read.
IGNORED = "-"
HEADER = re.compile(r"(?P<name>[^\[(]*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")
DELIMITERS = ",;\t"


class Quantity(NamedTuple):
    """A quantity of a column: its name in messages, its SI unit, and an example of a header."""

    name: str
    unit: str
    header: str


class FoundColumn(NamedTuple):
    """Index of a column in a table, and the size of its unit in SI."""

    column: int
    size: float


@dataclass(frozen=True)
class Cells:
    """A table as text, of a file ``source``: the delimiter (a space stands for any number of them),
    cells of the first row, and the lines of numbers with their line numbers."""

    source: str
    delimiter: str
    first: tuple[str, ...]
    has_header: bool
    lines: Sequence[tuple[int, str]]


def cells_of(text: str, source: str) -> Cells:
    """A table as text, with columns between commas, semicolons, tabs or spaces; empty lines and
    those after ``#`` are skipped."""
    lines = [
        (number, line.strip(" \r"))
        for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise FileError(f"{source}: is empty; expected columns with units, such as 'time [s]'")
    number, line = lines[0]
    found = {one: line.count(one) for one in DELIMITERS}
    # In a line with semicolons or tabs, a comma does not separate columns.
    delimiter = "," if found[","] else " "
    if found[";"] or found["\t"]:
        delimiter = ";" if found[";"] >= found["\t"] else "\t"
    first = _split(line, delimiter, source, number)
    has_header = not any(_is_number(cell, delimiter) for cell in first)
    return Cells(source, delimiter, tuple(first), has_header, lines[has_header:])


def _split(line: str, delimiter: str, source: str, number: int) -> list[str]:
    if delimiter == " ":
        # A space may separate a name from its unit.
        return re.findall(r"\S+(?:\s*[\[(][^\])]*[\])])?", line)
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True))]
    except csv.Error as error:
        raise FileError(f"{source}: line {number}: cannot be read: {error}") from None


def _is_number(cell: str, delimiter: str) -> bool:
    try:
        return math.isfinite(number_of(cell if delimiter == "," else cell.replace(",", ".")))
    except ValueError:
        return False


def find_columns(
    headers: Sequence[str], known: Mapping[str, Quantity], source: str
) -> dict[str, FoundColumn]:
    """The columns of known quantities, by name; one that occurs twice, or without a unit of its
    dimension, is refused."""
    places: dict[str, FoundColumn] = {}
    for column, header in enumerate(headers):
        match = HEADER.fullmatch(header)
        name = "" if match is None else match["name"].strip().lower().replace(" ", "_")
        if match is None or name not in known:
            continue
        quantity = known[name]
        if quantity.name in places:
            raise FileError(f"{source}: has two columns of {quantity.name}")
        right = f"write it as {quantity.header!r}"
        if not match["unit"]:
            raise FileError(f"{source}: column {shown(header)} has no unit; {right}")
        try:
            size = to_si(f"1 {match['unit'].strip()}", quantity.unit, f"1 {quantity.unit}")
        except ValueError:
            raise FileError(
                f"{source}: column {shown(header)} has the unit {shown(match['unit'])}, which is "
                f"not a unit of {quantity.name}; {right}"
            ) from None
        places[quantity.name] = FoundColumn(column, size)
    return places


def values_of(
    cells: Cells, headers: Sequence[str], places: Mapping[str, FoundColumn]
) -> dict[str, list[float]]:
    """Values in SI of the columns in ``places``, see `find_columns`; missing or ambiguous numbers
    and cells beyond the headers are refused."""
    values: dict[str, list[float]] = {name: [] for name in places}
    decimal = "." if cells.delimiter == "," else _decimal_of(cells, places.values())
    for number, line in cells.lines:
        row = _split(line, cells.delimiter, cells.source, number)
        where = f"{cells.source}: line {number}"
        if len(row) > len(headers) and any(row[len(headers) :]):
            raise FileError(f"{where}: has {len(row)} cells under {len(headers)} headers{POINT}")
        for name, (column, size) in places.items():
            cell = row[column] if column < len(row) else ""
            if cell == "":
                raise FileError(f"{where}: the {name} is missing")
            try:
                value = size * number_of(cell, decimal)
            except ValueError as error:
                raise FileError(f"{where}: the {name}, {error}") from None
            if not math.isfinite(value):
                raise FileError(f"{where}: the {name}, {shown(cell)}, is not a finite number")
            values[name].append(value)
    return values


# Hint for tables whose columns are separated by commas.
POINT = "; numbers have a decimal point, and a comma would begin another cell"


def _decimal_of(cells: Cells, places: Iterable[FoundColumn]) -> str:
    """The decimal sign of a table: a comma if one cannot group thousands, and no number has a
    point."""
    columns = [place.column for place in places]
    has_comma = False
    for number, line in cells.lines:
        if "," not in line:
            continue
        row = _split(line, cells.delimiter, cells.source, number)
        numbers = [row[one] for one in columns if one < len(row)]
        if any("." in cell for cell in numbers):
            return "."
        has_comma |= any("," in cell and not GROUPED.fullmatch(cell) for cell in numbers)
    return "," if has_comma else "."
