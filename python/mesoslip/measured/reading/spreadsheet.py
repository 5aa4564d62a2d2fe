"""Workbooks of spreadsheets (.xlsx): the cells of one sheet, read as a text with tabs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import date, datetime, time, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

from mesoslip.errors import FileError, shown
from mesoslip.measured.reading.packages import needed
from mesoslip.measured.reading.source import MAX_BYTES

# The member of a zipped workbook by which it is recognized.
MEMBER = "xl/workbook.xml"


def text_of_workbook(path: Path, data: bytes, sheet: str | None) -> tuple[bytes, str]:
    """The cells of a sheet, by default that with the most numbers, as lines of a text, and a note
    about the sheet."""
    try:
        openpyxl = needed("openpyxl", "a workbook (.xlsx)", "openpyxl")
        # Without links to other workbooks, and with the results of formulas.
        book = openpyxl.load_workbook(
            BytesIO(data), read_only=True, data_only=True, keep_links=False
        )
        sheets = {one.title: one for one in book.worksheets}
        if sheet is not None and sheet not in sheets:
            names = ", ".join(shown(one) for one in sheets)
            raise FileError(f"has no sheet {shown(sheet)}; its sheets are {names}")
        asked = sheets if sheet is None else {sheet: sheets[sheet]}
        texts = {title: _lines(one.iter_rows(values_only=True)) for title, one in asked.items()}
    except FileError as error:
        raise FileError(f"{path}: {error}") from None
    # The library raises errors of any type for a damaged file.
    except Exception as error:
        raise FileError(f"{path}: a damaged workbook (.xlsx): {error}") from None
    if not texts:
        raise FileError(f"{path}: a workbook without a sheet of cells")
    chosen = max(texts, key=lambda title: texts[title][1])
    text, numbers = texts[chosen]
    if numbers == 0:
        raise FileError(f"{path}: has no sheet with numbers")
    note = f"workbook: sheet {shown(chosen)}"
    if sheet is None and len(sheets) > 1:
        others = ", ".join(shown(title) for title in sheets if title != chosen)
        note = f"guess: {note}, which has the most numbers; the others are {others} (--sheet)"
    return text, note


def _lines(rows: Iterable[tuple[Any, ...]]) -> tuple[bytes, int]:
    """Rows of cells as lines with tabs, and how many numbers they have."""
    lines: list[bytes] = []
    size = numbers = 0
    for row in rows:
        numbers += sum(isinstance(one, int | float) for one in row)
        lines.append(
            "\t".join(_cells(row)).encode() if any(one is not None for one in row) else b""
        )
        size += len(lines[-1])
        if size > MAX_BYTES:
            raise FileError("is too large; export the measurement as text")
    return b"\n".join([*lines, b""]), numbers


def _cells(row: tuple[Any, ...]) -> Iterator[str]:
    for one in row:
        if isinstance(one, bool | str):
            yield " ".join(str(one).split())
        elif isinstance(one, datetime | date | time):
            yield one.isoformat()
        elif isinstance(one, timedelta):
            yield repr(one.total_seconds())
        else:
            yield "" if one is None else repr(one)
