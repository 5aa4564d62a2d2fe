"""Regular files, opened without following links, which archives and other users may have made."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import IO


def open_regular(path: Path, mode: str) -> IO[bytes]:
    """Open a regular file, "rb", "r+b", or "xb" for a new one in the place of an old one; an
    `OSError` for links and other objects."""
    if mode == "xb":
        path.unlink(missing_ok=True)
    return open(path, mode, opener=regular_descriptor)


def regular_descriptor(path: str | Path, flags: int) -> int:
    """Open a regular file without waiting for the other end of a pipe; see `open_regular`."""
    try:
        number = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "is a link", str(path)) from None
        raise
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
    return number
