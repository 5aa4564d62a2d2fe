"""Cells of a text: numbers, and entries for missing ones."""

from __future__ import annotations

import csv
import re

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
