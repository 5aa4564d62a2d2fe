"""HDF5 below netCDF-4: a lock for its library, and checks that files are self-contained and end."""

from __future__ import annotations

import os
import struct
import threading
from pathlib import Path
from typing import IO, Any

from mesoslip.errors import FileError

# The library is not thread-safe: this lock is held while a file is opened, read, written or closed.
LOCK = threading.RLock()

# Start of a heap, which has strings of any length and references, with the version.
HEAP = b"GCOL\x01\0\0\0"
# Bytes at both ends of a file in which heaps are checked.
CHECKED_BYTES = 2**23


def check_name(path: Path) -> None:
    """Refuse a name that netCDF's library does not take."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise FileError(f"{path}: the name of an output must be UTF-8 for netCDF") from None


def check_heaps(file: IO[bytes]) -> None:
    """Refuse a file with a damaged heap, the part without checksums that the library may read
    endlessly; an `OSError`, as the library raises for other damages."""
    size = file.seek(0, os.SEEK_END)
    for start in {0, max(0, size - CHECKED_BYTES)}:
        file.seek(start)
        data = file.read(CHECKED_BYTES)
        at = data.find(HEAP)
        while at >= 0:
            _check_heap(data, at)
            at = data.find(HEAP, at + 1)
    file.seek(0)


def _check_heap(data: bytes, start: int) -> None:
    """Follow the objects of a heap, as far as the data reach.

    Each has a header of 16 bytes with its number and size. The size of free space, number 0,
    includes its header; objects take multiples of 8 bytes.
    """
    at = start + 16
    end = start + int.from_bytes(data[start + 8 : at], "little")
    while at + 16 <= min(end, len(data)):
        number, size = struct.unpack_from("<H6xQ", data, at)
        step = 16 + -(-size // 8) * 8 if number else size
        if not 0 < step <= end - at:
            raise OSError("a heap is damaged")
        at += step


def check_links(path: Path) -> None:
    """Refuse soft and external links, which may lead to files of others or to one without end, data
    in other files, and two names of one object."""
    import h5py

    with path.open("rb") as source:
        check_heaps(source)
    with LOCK, h5py.File(path, "r") as file:
        root = file.id
        seen = {h5py.h5o.get_info(root).addr}
        groups: list[tuple[str, Any]] = [("", root)]
        while groups:
            parent, group = groups.pop()
            for name in list(group):
                where = f"{parent}/{name.decode(errors='backslashreplace')}"
                if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
                    raise FileError(f"{path}: {where} is a link, which an output does not have")
                target = h5py.h5o.open(group, name)
                address = h5py.h5o.get_info(target).addr
                if address in seen:
                    raise FileError(f"{path}: {where} has another name too; an output is a tree")
                seen.add(address)
                if isinstance(target, h5py.h5g.GroupID):
                    groups.append((where, target))
                elif isinstance(target, h5py.h5d.DatasetID) and _is_elsewhere(target):
                    raise FileError(f"{path}: {where} has its data in another file")


def _is_elsewhere(dataset: Any) -> bool:
    """Whether data are in other files, as external storage or as a virtual dataset."""
    import h5py

    creation = dataset.get_create_plist()
    return bool(creation.get_external_count() or creation.get_layout() == h5py.h5d.VIRTUAL)
