"""Cells of a text: numbers, entries for missing ones, time stamps."""

from __future__ import annotations

import csv
import re
from datetime import datetime

from mesoslip.configuration.columns import IGNORED
from mesoslip.configuration.units import GROUPED, number_of

# Numbers with digits 0 to 9 that are not grouped.
POINTED = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
WITH_COMMA = re.compile(r"[+-]?(?:[0-9]+(?:,[0-9]*)?|,[0-9]+)(?:[eE][+-]?[0-9]+)?")
NUMBERS = {".": POINTED, ",": WITH_COMMA}

# Entries that instruments and programs write where there is no number.
MISSING = {
    *("", "-", "--", "---", "n/a", "na", "#n/a", "#value!", "nan", "+nan", "-nan", "1.#qnan"),
    *("-1.#ind", "1.#inf", "-1.#inf", "inf", "+inf", "-inf", "infinity", "+infinity"),
    *("-infinity", "null", "none", "over", "under", "overflow", "underflow", "overrange", "ol"),
    *("over range", "overload", "-over", "+over", "missing", "*", "**", "***", "?", "."),
}
# A time of the day, perhaps of 12 hours, perhaps after a date of ISO 8601 or with points.
STAMP = re.compile(
    r"(?:(?P<date>[0-9]{4}-[0-9]{2}-[0-9]{2}|[0-9]{2}\.[0-9]{2}\.[0-9]{4})[T ]+)?"
    r"(?P<clock>[0-9]{1,2}:[0-9]{2}:[0-9]{2})(?:[.,](?P<part>[0-9]{1,9}))?"
    r"(?: ?(?P<half>[AaPp])[Mm])?(?:Z|[+-][0-9]{2}:?[0-9]{2})?"
)
# The form of time stamps in place of a unit, such as "dd.mm.yyyy hh:mm:ss".
STAMP_FORM = re.compile(r"(?i)(?=.*(?:yy|hh|jj))[dmyjhst.:/,f -]+")
DAY = 86_400 * 10**9
# Beginnings of lines that are comments.
COMMENT = re.compile(r"\s*(?:#|%|//|!|\*)")
# Delimiters, in order of preference; a space stands for any number of blanks.
DELIMITERS = ("\t", ";", "|", ",", " ")


def split(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without the blanks around them; a ValueError if quotes are not closed."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        rows = list(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error as error:
        raise ValueError(str(error)) from None
    return [cell.strip() for cell in rows[0]]


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with a decimal sign."""
    return NUMBERS[decimal].fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell stands for a missing number."""
    return cell.lower() in MISSING or cell == IGNORED


def hint_for(cell: str, decimal: str) -> str:
    """The fix for a cell that is not a number; empty if it is unknown."""
    try:
        number_of(cell, decimal)
    except ValueError as error:
        return str(error).partition("is not a number")[2]
    return ""


def may_group(cell: str) -> bool:
    """Whether the comma of a number may group its digits."""
    return GROUPED.fullmatch(cell) is not None


class Clock:
    """Time stamps of a column as seconds from the first one. Without dates they pass midnight."""

    def __init__(self) -> None:
        self.first = ""
        self._start = self._last = self._days = 0

    def seconds(self, cell: str) -> float | None:
        """Seconds of a cell; None if it is not a time stamp."""
        found = STAMP.fullmatch(cell)
        if found is None:
            return None
        date = found["date"] or ""
        form = "%Y-%m-%d" if "-" in date else "%d.%m.%Y"
        try:
            day = datetime.strptime(date, form).toordinal() if date else self._days
            clock = datetime.strptime(found["clock"], "%H:%M:%S")
        except ValueError:
            return None
        hour = clock.hour
        if found["half"]:
            hour = hour % 12 + (12 if found["half"] in "Pp" else 0)
        second = 3600 * hour + 60 * clock.minute + clock.second
        now = day * DAY + second * 10**9 + int(f"{found['part'] or 0:0<9}")
        if not date and self.first and now < self._last - DAY // 2:
            self._days += 1
            now += DAY
        if not self.first:
            self.first, self._start = cell, now
        self._last = now
        return (now - self._start) / 1e9
