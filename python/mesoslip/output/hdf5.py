"""HDF5 below netCDF-4: a lock for its library, and checks that files are self-contained and end."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from mesoslip.errors import FileError

# The library is not thread-safe: this lock is held while a file is opened, read, written or closed.
LOCK = threading.RLock()

# Start of a heap, which has strings of any length and references, with the version.
HEAP = b"GCOL\x01\0\0\0"
# Bytes of a file that are searched for heaps at once; a heap of strings takes 4096 as a rule.
BLOCK_BYTES = 2**23
# Processor time in which the library has to read all heaps of a doubtful file [s].
MAX_SECONDS = 1.0


def check_name(path: Path) -> None:
    """Refuse a name that netCDF's library does not take."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise FileError(f"{path}: the name of an output must be UTF-8 for netCDF") from None


def check_heaps(file: IO[bytes]) -> None:
    """Refuse a file with a damaged heap, the part without checksums that the library may read
    endlessly; an `OSError`, as the library raises for other damages.

    A damaged heap may be the remainder of one that is not used any more, or data that look like a
    heap. So the library reads the file in another process, and the file is refused if that does
    not end.
    """
    if not all(map(_is_sound, _heaps(file))) and not _can_be_read(file):
        raise OSError("a heap is damaged")
    file.seek(0)


def _heaps(file: IO[bytes]) -> Iterator[memoryview]:
    """The heaps of a file, as far as a block reaches."""
    file.seek(0)
    data = b""
    while True:
        block = file.read(BLOCK_BYTES)
        data += block
        at = data.find(HEAP)
        while at >= 0:
            size = min(max(16, int.from_bytes(data[at + 8 : at + 16], "little")), BLOCK_BYTES)
            if block and len(data) < at + size:
                # The next block has its end.
                break
            yield memoryview(data)[at : at + size]
            at = data.find(HEAP, at + size)
        if not block:
            return
        # A heap may begin with the last bytes.
        data = data[at if at >= 0 else 1 - len(HEAP) :]


def _is_sound(heap: memoryview) -> bool:
    """Whether the objects of a heap follow one another, as far as the bytes reach.

    Each has a header of 16 bytes with its number and size. The size of free space, number 0,
    includes its header; objects take multiples of 8 bytes.
    """
    at = 16
    end = int.from_bytes(heap[8:at], "little")
    while at + 16 <= min(end, len(heap)):
        number, size = struct.unpack_from("<H6xQ", heap, at)
        step = 16 + -(-size // 8) * 8 if number else size
        if not 0 < step <= end - at:
            return False
        at += step
    return True


def _can_be_read(file: IO[bytes]) -> bool:
    """Whether the library can read all that is in heaps, tried in a process of its own."""
    code = "from mesoslip.output.hdf5 import read_heaps; read_heaps('/dev/stdin')"
    line = [sys.executable, "-P", "-c", code]
    quiet = subprocess.DEVNULL
    return subprocess.run(line, stdin=file, stdout=quiet, stderr=quiet, check=False).returncode == 0


def read_heaps(path: str) -> None:
    """Read all attributes, strings and references of a file; this process is ended after a time.

    By both packages, which have libraries of their own. What they refuse does not matter here.
    """
    import h5py
    import netCDF4

    def read(_: str, one: Any) -> None:
        for name in one.attrs:
            with suppress(Exception):
                one.attrs[name]
        if isinstance(one, h5py.Dataset) and one.dtype.hasobject:
            with suppress(Exception):
                one[()]

    signal.setitimer(signal.ITIMER_PROF, MAX_SECONDS)
    with suppress(Exception), h5py.File(path, "r") as file:
        read("/", file)
        file.visititems(read)
    # Which reads attributes as it opens a file.
    with suppress(Exception):
        netCDF4.Dataset(path).close()


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
