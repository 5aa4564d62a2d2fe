"""Read files of any kind as tables."""

from __future__ import annotations

import zipfile
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from pathlib import Path

from mesoslip.errors import FileError
from mesoslip.measured.reading import binary, tdms
from mesoslip.measured.reading.binary import read_binary
from mesoslip.measured.reading.source import bytes_of, text_of
from mesoslip.measured.reading.spreadsheet import MEMBER, text_of_workbook
from mesoslip.measured.reading.stamps import Order
from mesoslip.measured.reading.table import Table
from mesoslip.measured.reading.text import read_text

# Formats that are known by the first bytes of a file.
READERS = (*binary.READERS, tdms.READER)


def read_file(
    path: Path,
    *,
    decimal: str | None = None,
    dates: Order | None = None,
    has_headers: bool = False,
    sheet: str | None = None,
) -> Table:
    """Read a file of text, which may be compressed, a workbook, or a format of `READERS`.

    By default the decimal sign of a text and the order of its dates are found from its numbers.
    ``has_headers`` is whether there are other headers than those of the file; ``sheet`` is that of
    a workbook.
    """
    data = bytes_of(path)
    if _is_workbook(data):
        text, note = text_of_workbook(path, data, sheet)
        table = read_text(path, text, decimal=decimal, dates=dates, has_headers=has_headers)
        # The first note is about delimiters, which a workbook does not have.
        return replace(table, notes=[note, *table.notes[1:]])
    if sheet is not None:
        raise FileError(f"{path}: is not a workbook (.xlsx), and has no sheet {sheet!r}")
    for reader in READERS:
        if data.startswith(reader.start):
            return read_binary(reader, path, data)
    if path.suffix == ".toml":
        raise FileError(f"{path}: is a configuration, not a measurement")
    others = ", ".join(dict.fromkeys(one.kind for one in READERS))
    text = text_of(path, data, f"a workbook (.xlsx), {others}")
    return read_text(path, text, decimal=decimal, dates=dates, has_headers=has_headers)


def _is_workbook(data: bytes) -> bool:
    if data.startswith(b"PK"):
        with suppress(zipfile.BadZipFile), zipfile.ZipFile(BytesIO(data)) as archive:
            return MEMBER in archive.namelist()
    return False
