"""Files that commands write: whether they can be written, and that they are whole."""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mesoslip.configuration.reading import is_directory
from mesoslip.errors import FileError, WriteError
from mesoslip.output.file_locks import NO_LOCKS, refused_lock

# How names of files end that are no outputs.
OTHER_KINDS = {".csv", ".txt", ".png", ".pdf", ".svg", ".html", ".json"}

# Bytes that are written to see whether more can be.
PROBE_BYTES = 2**16


def check_writable(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Make sure, before a run, that its output can be written.

    Parameters
    ----------
    path
        The output.
    reads
        Files that the command reads and must not overwrite.

    Raises
    ------
    FileError
        If the path cannot be a file, is one of those, or its folder cannot be created or written
        to.
    """
    if path.suffix == ".toml":
        raise FileError(f"{path}: is the name of a configuration; give another one to the output")
    target = _target(path)
    for one in map(Path, reads):
        if target.exists() and one.exists() and target.samefile(one):
            raise FileError(f"{path}: is what the command reads; give another name for its output")
    part = _temporary(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_left_behind(target)
        # A full disk takes an empty file.
        part.write_bytes(bytes(PROBE_BYTES))
    except (OSError, ValueError) as error:
        raise _not_written(path, target, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def check_output(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Make sure that a path is one for an output, and that it can be written; see `check_writable`.

    Raises
    ------
    FileError
        Also if its name ends like that of another kind of file.
    """
    if path.suffix.lower() in OTHER_KINDS:
        raise FileError(
            f"{path}: an output is netCDF, and its name must not end in {path.suffix}; "
            f"{path.with_suffix('.nc')} would be right"
        )
    check_writable(path, reads)


def _target(path: Path) -> Path:
    """The path to write a file to: links are followed; only regular files are accepted.

    Raises
    ------
    FileError
        If there is something else at the path.
    """
    if is_directory(path):
        raise FileError(f"{path}: cannot be written: is a directory; give the name of a file in it")
    try:
        target = path.resolve()
        is_refused = target.exists() and not target.is_file()
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"{path}: cannot be written: {error}") from error
    if is_refused:
        raise FileError(f"{path}: cannot be written: is a device or the like, not a file")
    return target


def _not_written(path: Path, target: Path, error: Exception) -> FileError:
    """The error of a file that could not be written."""
    reason = getattr(error, "strerror", None) or error
    is_full = getattr(error, "errno", None) in {errno.ENOSPC, errno.EDQUOT}
    # HDF5 reports a full disk as an error of its own, or as a lack of permission.
    with suppress(OSError):
        is_full = is_full or shutil.disk_usage(target.parent).free < PROBE_BYTES
    if is_full:
        return WriteError(f"{path}: cannot be written: no space left on the disk")
    if "HDF" in str(error):
        refused = refused_lock(target.parent)
        if refused:
            return FileError(f"{path}: cannot be written: {NO_LOCKS.format(refused)}")
        return WriteError(f"{path}: cannot be written: {reason}; is the disk full?")
    if getattr(error, "errno", None) in {errno.EFBIG, errno.EIO}:
        return WriteError(f"{path}: cannot be written: {reason}")
    return FileError(f"{path}: cannot be written: {reason}")


def _temporary(path: Path) -> Path:
    """A name beside a file, with its ending, that no other process or thread has."""
    owner = f"{platform.node()}-{os.getpid()}-{threading.get_ident()}"
    return path.with_name(f".{owner}.{path.name}")


def _remove_left_behind(path: Path) -> None:
    """Remove parts of a file that processes of this machine left behind, when they were killed."""
    node = re.escape(platform.node())
    pattern = re.compile(rf"\.{node}-(\d+)-\d+\.{re.escape(path.name)}")
    for other in path.parent.iterdir():
        match = pattern.fullmatch(other.name)
        if match is None:
            continue
        try:
            os.kill(int(match[1]), 0)
        except ProcessLookupError:
            with suppress(OSError):
                other.unlink(missing_ok=True)
        except (OSError, OverflowError):
            # A process of another user, still running, or a number that no process has.
            continue


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary file that replaces a file when it is complete.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    target = _target(path)
    part = _temporary(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(target)
    except (OSError, RuntimeError, ValueError) as error:
        raise _not_written(path, target, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
