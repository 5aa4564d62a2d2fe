"""Locks of file systems, which netCDF's library needs to open a file."""

from __future__ import annotations

import fcntl
import tempfile
from contextlib import suppress
from pathlib import Path

NO_LOCKS = (
    "its file system has no locks ({}); the environment variable HDF5_USE_FILE_LOCKING=FALSE "
    "turns them off"
)


def lock_held(path: Path) -> str:
    """The reason for which a lock on a file may be refused, or empty; the library reports a refused
    lock like a damaged file."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return "is locked by a program that writes to it; try again when that is done"
    except OSError as error:
        return NO_LOCKS.format(error.strerror)
    return ""


def refused_lock(folder: Path) -> str:
    """The error of a lock in a folder; empty if its file system grants it."""
    with suppress(OSError), tempfile.TemporaryFile(dir=folder) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.strerror or str(error)
    return ""
