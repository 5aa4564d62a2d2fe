"""Read files of any kind as tables."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from pathlib import Path

from mesoslip.errors import FileError
from mesoslip.measured.reading.binary import READERS
from mesoslip.measured.reading.source import bytes_of, text_of
from mesoslip.measured.reading.spreadsheet import MEMBER, text_of_workbook
from mesoslip.measured.reading.table import Table
from mesoslip.measured.reading.tdms import read_tdms
from mesoslip.measured.reading.text import read_text


def read_file(
    path: Path, *, decimal: str | None = None, has_headers: bool = False, sheet: str | None = None
) -> Table:
    """Read a file of text, which may be compressed, a workbook, LabVIEW, MATLAB, HDF5, netCDF or
    NumPy.

    By default the decimal sign of a text is found from its numbers. ``has_headers`` is whether
    there are other headers than those of the file; ``sheet`` is that of a workbook.
    """
    data = bytes_of(path)
    if _is_workbook(data):
        text, note = text_of_workbook(path, data, sheet)
        table = read_text(path, text, decimal=decimal, has_headers=has_headers)
        # The first note is about delimiters, which a workbook does not have.
        return replace(table, notes=[note, *table.notes[1:]])
    if sheet is not None:
        raise FileError(f"{path}: is not a workbook (.xlsx), and has no sheet {sheet!r}")
    reader = _reader(data)
    if reader is not None:
        return reader(path, data)
    if path.suffix == ".toml":
        raise FileError(f"{path}: is a configuration, not a measurement")
    data = text_of(path, data)
    return read_text(path, data, decimal=decimal, has_headers=has_headers)


def _reader(data: bytes) -> Callable[[Path, bytes], Table] | None:
    """The reader of a file that is not text, by its first bytes."""
    every = ((b"TDSm", read_tdms), *READERS)
    return next((read for start, read in every if data.startswith(start)), None)


def _is_workbook(data: bytes) -> bool:
    if data.startswith(b"PK"):
        with suppress(zipfile.BadZipFile), zipfile.ZipFile(BytesIO(data)) as archive:
            return MEMBER in archive.namelist()
    return False
