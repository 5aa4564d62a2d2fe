"""Files that commands write: checks before, and writing as a whole."""

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

# Endings of files other than outputs.
OTHER_KINDS = {".csv", ".txt", ".png", ".pdf", ".svg", ".html", ".json"}

# Bytes that are written to test whether the disk is full.
PROBE_BYTES = 2**16


def check_writable(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Refuse, before a run, a path that cannot be written, or that the command ``reads``."""
    if path.suffix == ".toml":
        raise FileError(f"{path}: is the name of a configuration; give the output another name")
    target = _target(path)
    for one in map(Path, reads):
        if target.exists() and one.exists() and target.samefile(one):
            raise FileError(f"{path}: is read by the command; give its output another name")
    part = _temporary(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_left_behind(target)
        # An empty file can be written to a full disk.
        part.write_bytes(bytes(PROBE_BYTES))
    except (OSError, ValueError) as error:
        raise _not_written(path, target, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def check_output(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Refuse a path with the ending of another kind of file, or as `check_writable`."""
    if path.suffix.lower() in OTHER_KINDS:
        raise FileError(
            f"{path}: an output is netCDF, and its name must not end in {path.suffix}; "
            f"use {path.with_suffix('.nc')}"
        )
    check_writable(path, reads)


def _target(path: Path) -> Path:
    """The path at which a file is written: links are followed, and other objects are refused."""
    if is_directory(path):
        raise FileError(f"{path}: cannot be written: is a directory; give the name of a file in it")
    try:
        target = path.resolve()
        is_refused = target.exists() and not target.is_file()
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"{path}: cannot be written: {error}") from error
    if is_refused:
        raise FileError(f"{path}: cannot be written: is not a regular file")
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
    """A name beside a file, with its ending, that only this thread uses."""
    owner = f"{platform.node()}-{os.getpid()}-{threading.get_ident()}"
    return path.with_name(f".{owner}.{path.name}")


def _remove_left_behind(path: Path) -> None:
    """Remove parts of a file that killed processes of this machine have left."""
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
            # The process of another user is running, or no process can have the number.
            continue


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary file that replaces a file when it is complete."""
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
