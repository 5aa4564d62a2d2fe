"""Bytes and text of a file: compression and encodings."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from mesoslip.configuration.reading import is_directory, is_file
from mesoslip.errors import FileError, shown

# Maximum size of a file, compressed or not [bytes].
MAX_BYTES = 2**31
CHANGED = "changed while it was read; copy it when it is complete, and read the copy"
# Bytes from which the encoding is determined.
HEAD = 4096
# Maximum share of null characters in a damaged text.
MAX_NULLS = 0.01

# Members of a zip archive that is one file: arrays of NumPy, a workbook.
PACKED = (".npy", "xl/workbook.xml")

NEWLINE = b"\n"
# Line breaks and minus signs, and what stands for them.
PLAIN = ((b"\r\n", NEWLINE), (b"\r", NEWLINE), ("\N{MINUS SIGN}".encode(), b"-"))

# Compressions: their first bytes, and their readers.
COMPRESSIONS: dict[str, tuple[bytes, Callable[[IO[bytes]], Any]]] = {
    "gzip": (b"\x1f\x8b", lambda file: gzip.GzipFile(fileobj=file)),
    "bzip2": (b"BZh", bz2.BZ2File),
    "xz": (b"\xfd7zXZ\x00", lzma.LZMAFile),
}


def check_file(path: Path) -> None:
    """Check that a path is that of a regular file."""
    try:
        if is_directory(path):
            raise FileError(f"{path}: is a directory, not a file of a measurement")
        if not path.exists():
            raise FileError(f"{path}: no such file")
        if not is_file(path):
            raise FileError(f"{path}: is not a regular file")
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise FileError(f"{shown(path)}: is not the name of a file: {error}") from None


def bytes_of(path: Path) -> bytes:
    """The bytes of a file, decompressed."""
    check_file(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise FileError(f"{path}: is too large; the maximum is {MAX_BYTES / 2**30:.0f} GiB")
        data = path.read_bytes()
        if len(data) != size:
            raise FileError(f"{path}: {CHANGED}")
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    return _decompressed(path, data)


def _decompressed(path: Path, data: bytes) -> bytes:
    is_zip = data.startswith(b"PK\x03\x04")
    name = "zip" if is_zip else _compression(data)
    try:
        if is_zip:
            with zipfile.ZipFile(BytesIO(data)) as archive:
                files = [one for one in archive.infolist() if not one.is_dir()]
                if any(one.filename.endswith(PACKED) for one in files):
                    return data
                if len(files) != 1:
                    raise FileError(
                        f"{path}: the archive has {len(files)} files; unpack the one to read"
                    )
                with archive.open(files[0]) as member:
                    return _limited(path, member)
        if name:
            with COMPRESSIONS[name][1](BytesIO(data)) as member:
                return _limited(path, member)
    except EOFError:
        raise FileError(f"{path}: the compressed file ({name}) is cut short") from None
    except (
        OSError,
        zlib.error,
        lzma.LZMAError,
        zipfile.BadZipFile,
        NotImplementedError,
        RuntimeError,
        ValueError,
    ) as error:
        raise FileError(f"{path}: the compressed file ({name}) is damaged: {error}") from None
    return data


def _compression(data: bytes) -> str:
    """The compression of a file; empty if it has none."""
    return next((name for name, (start, _) in COMPRESSIONS.items() if data.startswith(start)), "")


def _limited(path: Path, file: IO[bytes]) -> bytes:
    data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise FileError(f"{path}: is too large unpacked; the maximum is {MAX_BYTES >> 30} GiB")
    return data


def text_of(path: Path, data: bytes, others: str) -> bytes:
    """The text of a file in UTF-8, from that, UTF-16 or an encoding of Western Europe.

    Line breaks are `\\n`, and minus signs hyphens. A text that is like this already is not copied.
    ``others`` are the formats besides text.
    """
    text = _in_utf8(data)
    if text is not None and 0 < text.count(b"\0") < MAX_NULLS * len(text):
        at = text.index(b"\0")
        raise FileError(f"{path}: line {text.count(NEWLINE, 0, at) + 1}: has a null character")
    if text is None or b"\0" in text:
        raise FileError(
            f"{path}: is no text, and no file of {others}: it begins with {shown(data[:12])}"
        )
    for old, new in PLAIN:
        if old in text:
            text = text.replace(old, new)
    return text.removeprefix("\ufeff".encode())


def _in_utf8(data: bytes) -> bytes | None:
    head = data[:HEAD]
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        encodings = ["utf-16"]
    elif head.count(0) > MAX_NULLS * len(head):
        # UTF-16 without a mark has a null beside each Latin character.
        little = head[1::2].count(0) > head[0::2].count(0)
        encodings = ["utf-16-le" if little else "utf-16-be"]
    elif data.isascii():
        return data
    else:
        encodings = ["utf-8", "cp1252", "latin-1"]
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        return data if encoding == "utf-8" else text.encode()
    return None
