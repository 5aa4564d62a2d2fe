"""Long files block by block, each as a table, in bounded memory."""

from __future__ import annotations

import lzma
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.measured.reading.binary import binary_blocks
from mesoslip.measured.reading.file import READERS, read_file
from mesoslip.measured.reading.source import (
    CHANGED,
    COMPRESSIONS,
    NEWLINE,
    check_file,
    text_of,
)
from mesoslip.measured.reading.stamps import Order, past_midnight
from mesoslip.measured.reading.table import BadCell, Table
from mesoslip.measured.reading.text import read_text

# Size of a block [bytes].
BLOCK = 2**24
# Bytes by which a format is known.
HEAD = 16
# First bytes of files that are read as a whole: of archives, workbooks and UTF-16.
WHOLE = (b"PK", b"\xff\xfe", b"\xfe\xff", *(one.start for one in READERS))


def blocks_of(
    path: Path,
    *,
    decimal: str | None = None,
    dates: Order | None = None,
    has_headers: bool = False,
    sheet: str | None = None,
) -> Iterator[Table]:
    """The tables of the blocks of a file; one that is not read in parts is a block. See
    `read_file`."""
    check_file(path)
    with path.open("rb") as file:
        head = file.read(HEAD)
    name = next((key for key, (start, _) in COMPRESSIONS.items() if head.startswith(start)), "")
    reader = next((one for one in READERS if one.has_parts and head.startswith(one.start)), None)
    if sheet is None and reader is not None:
        with path.open("rb") as file:
            yield from binary_blocks(reader, path, file, BLOCK)
        return
    if sheet is not None or head.startswith(WHOLE):
        yield read_file(path, decimal=decimal, dates=dates, has_headers=has_headers, sheet=sheet)
        return
    above = b""
    lines = 0
    latest: dict[int, float] = {}
    unpacked: Any = COMPRESSIONS[name][1] if name else nullcontext
    try:
        with path.open("rb") as file, unpacked(file) as stream:
            size = os.fstat(file.fileno()).st_size
            for data in _pieces(stream):
                text = text_of(path, data, "text")
                table = read_text(
                    path, above + text, decimal=decimal, dates=dates, has_headers=has_headers
                )
                # Blocks below are read as those above.
                dates = table.dates
                if above:
                    table = _below(table, lines - above.count(NEWLINE), latest)
                else:
                    above = b"".join(text.splitlines(keepends=True)[: int(table.lines[0])])
                lines += text.count(NEWLINE)
                latest = {
                    column: _latest(table.values[column])
                    for column, clock in table.clocks.items()
                    if clock.chosen is None
                }
                yield table
            if os.fstat(file.fileno()).st_size != size:
                raise FileError(f"{path}: {CHANGED}")
    except (EOFError, OSError, lzma.LZMAError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from None


def _pieces(stream: IO[bytes]) -> Iterator[bytes]:
    """Whole lines of about the size of a block."""
    rest = b""
    while data := stream.read(BLOCK):
        end = data.rfind(NEWLINE) + 1
        if not end:
            rest += data
            continue
        yield rest + data[:end]
        rest = data[end:]
    if rest.strip():
        yield rest


def _latest(values: Array) -> float:
    """The last known value; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(known[-1]) if known.size else math.nan


def _below(table: Table, shift: int, latest: Mapping[int, float]) -> Table:
    """A table without its first row, that of the first block, and with the lines of the file.

    Clocks without dates continue after their latest times.
    """

    def moved(cells: list[BadCell]) -> list[BadCell]:
        return [one._replace(line=one.line + shift) for one in cells]

    values = table.values[:, 1:]
    for column, last in latest.items():
        values[column] = past_midnight(values[column], last)
    return replace(
        table,
        values=values,
        lines=table.lines[1:] + shift,
        bad={column: moved(cells) for column, cells in table.bad.items()},
        notes=[one for one in table.notes if one.startswith("guess: ")],
    )
