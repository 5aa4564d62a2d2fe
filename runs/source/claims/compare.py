"""Comparison of judgements with those of an earlier page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mesoslip.errors import FileError
from mesoslip.quantities import LETTERS, PREFIXED

from claims.base import Judgement
from claims.page import measured_page, measured_path

HEADING = re.compile(r"## (C\d+)")
VERDICT = re.compile(r"\*\*(.+?)\.\*\*")
VALUE = re.compile(
    r"\(?(?P<mean>[-+.\de]+)(?: ± (?P<error>[.\de-]+))?(?:\)e(?P<power>-?\d+))?(?: (?P<unit>.+))?"
)
# Maximum difference of numbers in errors, and relative to them where there is no error: results of
# chaotic runs depend on the last digit of a machine's arithmetic.
MAX_ERRORS = 2.0
MAX_RELATIVE = 2e-3


class Value(NamedTuple):
    """A number of a page in its SI unit, and its error, 0 for none."""

    mean: float
    error: float
    unit: str

    def agrees(self, other: Value) -> bool:
        """Whether two numbers are the same within their errors."""
        allowed = MAX_ERRORS * max(self.error, other.error)
        allowed = max(allowed, MAX_RELATIVE * max(abs(self.mean), abs(other.mean)))
        return self.unit == other.unit and abs(self.mean - other.mean) <= allowed


def differences(judgements: Sequence[Judgement], page: Path) -> list[str]:
    """Lines on judgements that differ from those measured for an earlier page."""
    page = measured_path(page)
    try:
        earlier = _tables(page.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{page}: cannot be read: {error}") from None
    found = []
    for name, table in _tables(measured_page(judgements)).items():
        there = earlier.get(name)
        if there is None:
            found.append(f"{name}: is not on {page}")
            continue
        for quantity in sorted(table.keys() | there.keys()):
            new, old = table.get(quantity, "none"), there.get(quantity, "none")
            if not _agree(new, old):
                found.append(f"{name}, {quantity}: {new}, on {page} {old}")
    return found


def _tables(page: str) -> dict[str, dict[str, str]]:
    """Quantities of each claim by name, and the verdict, as texts."""
    tables: dict[str, dict[str, str]] = {}
    table: dict[str, str] = {}
    for line in page.splitlines():
        if heading := HEADING.fullmatch(line):
            table = tables.setdefault(heading[1], {})
        elif verdict := VERDICT.match(line):
            table["verdict"] = verdict[1]
        elif tables and line.startswith("| "):
            name, value, *_ = (cell.strip() for cell in line.strip("|").split("|"))
            if name != "quantity":
                table[name] = value
    return tables


def _agree(new: str, old: str) -> bool:
    """Whether two cells are the same text, or the same number within errors."""
    if new == old:
        return True
    values = _value(new), _value(old)
    return values[0] is not None and values[1] is not None and values[0].agrees(values[1])


def _value(cell: str) -> Value | None:
    """The number of a cell, if it is one."""
    match = VALUE.fullmatch(cell)
    if match is None:
        return None
    scale, unit = 10.0 ** int(match["power"] or 0), match["unit"] or "1"
    letter = {one: power for power, one in LETTERS.items() if one}.get(unit[0])
    if letter is not None and unit[1:] in PREFIXED:
        scale, unit = scale * 10.0**letter, unit[1:]
    try:
        return Value(scale * float(match["mean"]), scale * float(match["error"] or 0.0), unit)
    except ValueError:
        return None
