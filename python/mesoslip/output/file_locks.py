"""Locks of file systems, which the library of netCDF wants of a file."""

from __future__ import annotations

import fcntl
import tempfile
from contextlib import suppress
from pathlib import Path

NO_LOCKS = (
    "its file system gives no locks ({}); the environment variable HDF5_USE_FILE_LOCKING=FALSE "
    "does without them"
)


def lock_held(path: Path) -> str:
    """The reason why the library may have been refused a lock on a file; empty if it was not.

    The library reports a refused lock like a damaged file.
    """
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return "is locked by a program that writes to it; try again when that is done"
    except OSError as error:
        return NO_LOCKS.format(error.strerror)
    return ""


def refused_lock(folder: Path) -> str:
    """The error of the file system of a folder when asked for a lock; empty if it grants it."""
    with suppress(OSError), tempfile.TemporaryFile(dir=folder) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.strerror or str(error)
    return ""
