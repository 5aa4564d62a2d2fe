"""Read files of any kind as tables."""

from __future__ import annotations

from pathlib import Path

from mesoslip.errors import FileError
from mesoslip.measured.reading.binary import READERS, read_binary
from mesoslip.measured.reading.source import bytes_of, text_of
from mesoslip.measured.reading.table import Table
from mesoslip.measured.reading.text import read_text


def read_file(path: Path, *, decimal: str | None = None, has_headers: bool = False) -> Table:
    """Read a file of text, which may be compressed, or of a format in `READERS`.

    By default the decimal sign of a text is found from its numbers. ``has_headers`` is whether
    there are other headers than those of the file.
    """
    data = bytes_of(path)
    for reader in READERS:
        if data.startswith(reader.start):
            return read_binary(reader, path, data)
    if path.suffix == ".toml":
        raise FileError(f"{path}: is a configuration, not a measurement")
    others = ", ".join(dict.fromkeys(one.kind for one in READERS))
    text = text_of(path, data, others)
    return read_text(path, text, decimal=decimal, has_headers=has_headers)
