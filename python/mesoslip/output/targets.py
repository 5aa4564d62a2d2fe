"""Files that commands write: checks before, and writing as a whole.

A file is made in a new folder beside its place, which nobody else can enter, and takes its name
when it is complete.
"""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import re
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from mesoslip.configuration.reading import is_directory
from mesoslip.errors import FileError, WriteError
from mesoslip.output.file_locks import NO_LOCKS, refused_lock
from mesoslip.output.hdf5 import check_name

# Endings of files other than outputs.
OTHER_KINDS = {".csv", ".txt", ".png", ".pdf", ".svg", ".html", ".json"}

# Bytes that are written to test whether the disk is full.
PROBE_BYTES = 2**16


def check_writable(path: Path | None, reads: Iterable[str | Path] = ()) -> None:
    """Refuse, before a run, a path that cannot be written, or that the command ``reads``; None if
    nothing is written."""
    if path is not None:
        _check(path, reads, is_output=False)


def check_output(path: Path | None, reads: Iterable[str | Path] = ()) -> None:
    """Refuse a path with the ending or the content of another kind of file, or as
    `check_writable`."""
    if path is None:
        return
    if path.suffix.lower() in OTHER_KINDS:
        raise FileError(
            f"{path}: an output is netCDF, and its name must not end in {path.suffix}; "
            f"use {path.with_suffix('.nc')}"
        )
    check_name(path)
    _check(path, reads, is_output=True)


def _check(path: Path, reads: Iterable[str | Path], *, is_output: bool) -> None:
    if path.suffix == ".toml":
        raise FileError(f"{path}: is the name of a configuration; give the output another name")
    for one in map(Path, reads):
        with suppress(OSError, ValueError):
            if path.samefile(one):
                raise FileError(f"{path}: is read by the command; give its output another name")
    if path.suffix == ".nc" and not is_output:
        raise FileError(f"{path}: is the name of an output; give the file another name")
    target = _target(path, is_output=is_output)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_left_behind(target.parent)
        with private_folder(target.parent) as folder:
            # An empty file can be written to a full disk.
            (folder.path / target.name).write_bytes(bytes(PROBE_BYTES))
    except (OSError, ValueError) as error:
        raise _not_written(path, target, error) from error


def _target(path: Path, *, is_output: bool) -> Path:
    """The path at which a file is written; other objects are refused.

    An output replaces nothing but another one, also through a link. Other files replace those of
    their name, but no output, and none to which a link leads.
    """
    if is_directory(path):
        raise FileError(f"{path}: cannot be written: is a directory; give the name of a file in it")
    try:
        target = path.resolve()
        is_there = target.exists()
        is_refused = is_there and not target.is_file()
        is_empty = not is_there or target.stat().st_size == 0
        link = f"is a link to {path.readlink()}" if path.is_symlink() else ""
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"{path}: cannot be written: {error}") from error
    if is_refused:
        raise FileError(f"{path}: cannot be written: is not a regular file")
    if is_output and not is_empty and not _is_output(target):
        problem = f"{link or 'exists'}, and is not an output of mesoslip"
    elif not is_output and not is_empty and _is_output(target):
        problem = "exists, and is an output of mesoslip"
    elif link and not is_output and not is_empty:
        problem = link
    # Another program may execute the file.
    elif link and is_empty and not path.suffix == target.suffix != "":
        problem = f"{link}, a name of another kind"
    else:
        return target
    raise FileError(f"{path}: cannot be written: {problem}; give another name, or remove it")


def _is_output(path: Path) -> bool:
    # Imported where a file would be replaced.
    from mesoslip.output.files import is_output

    return is_output(path)


def _not_written(path: Path, target: Path, error: Exception) -> FileError:
    reason = getattr(error, "strerror", None) or error
    is_full = getattr(error, "errno", None) in {errno.ENOSPC, errno.EDQUOT}
    # HDF5 reports a full disk as an error of its own, or as a lack of permission.
    with suppress(OSError):
        disk = shutil.disk_usage(target.parent)
        # A file system of the kernel, as /proc, has no disk.
        is_full = is_full or disk.free < PROBE_BYTES <= PROBE_BYTES * disk.total
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


class PrivateFolder(NamedTuple):
    """A folder by its descriptor, with the folder in which it is; its path stays if others rename
    it."""

    number: int
    parent: int
    path: Path

    def set_aside(self, name: str) -> None:
        """Move an object of its parent into it."""
        os.rename(name, ".replaced", src_dir_fd=self.parent, dst_dir_fd=self.number)

    def release(self, name: str) -> None:
        """Move what was made in it to its parent, where it replaces a file of that name."""
        os.replace(name, name, src_dir_fd=self.number, dst_dir_fd=self.parent)

    def clear(self) -> None:
        """Remove its content."""
        with suppress(OSError), os.scandir(self.number) as entries:
            for one in entries:
                if one.is_dir(follow_symlinks=False):
                    shutil.rmtree(one.name, ignore_errors=True, dir_fd=self.number)
                else:
                    os.unlink(one.name, dir_fd=self.number)


@contextmanager
def private_folder(parent: Path) -> Iterator[PrivateFolder]:
    """A new folder with a name that cannot be guessed, removed with its content."""
    name = f".mesoslip-{platform.node()}-{os.getpid()}-{secrets.token_hex(8)}"
    with _opened(parent) as outer:
        try:
            os.mkdir(name, 0o700, dir_fd=outer)
            with _cleared(name, outer, parent) as folder:
                # Processes of other containers do not see whether this one is running.
                with suppress(OSError):
                    fcntl.flock(folder.number, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield folder
        finally:
            # There still if an interrupt came while it was made or cleared.
            shutil.rmtree(name, ignore_errors=True, dir_fd=outer)


@contextmanager
def _opened(path: str | Path, outer: int | None = None) -> Iterator[int]:
    """The descriptor of a folder, not of a link to one if it is in an ``outer`` one."""
    flags = os.O_RDONLY | os.O_DIRECTORY | (0 if outer is None else os.O_NOFOLLOW)
    number = os.open(path, flags, dir_fd=outer)
    try:
        yield number
    finally:
        os.close(number)


@contextmanager
def _cleared(name: str, outer: int, parent: Path) -> Iterator[PrivateFolder]:
    """A private folder that exists, removed with its content."""
    with _opened(name, outer) as number:
        here = Path(f"/proc/{os.getpid()}/fd/{number}")
        folder = PrivateFolder(number, outer, here if here.is_dir() else parent / name)
        try:
            yield folder
        finally:
            folder.clear()
            with suppress(OSError):
                os.rmdir(name, dir_fd=outer)


def _remove_left_behind(parent: Path) -> None:
    """Remove private folders that killed processes of this machine have left."""
    node = re.escape(platform.node())
    pattern = re.compile(rf"\.mesoslip-{node}-(\d+)-[0-9a-f]{{16}}")
    for path in parent.iterdir():
        match = pattern.fullmatch(path.name)
        if match is None:
            continue
        try:
            os.kill(int(match[1]), 0)
        except ProcessLookupError:
            with suppress(OSError), _opened(parent) as outer, _opened(path.name, outer) as number:
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
                with _cleared(path.name, outer, parent):
                    pass
        except (OSError, OverflowError):
            # The process of another user is running, or no process can have the number.
            continue


@contextmanager
def written_whole(path: Path, *, is_output: bool = False) -> Iterator[Path]:
    """A file that replaces that of the same name when it is complete, if that may be replaced."""
    target = _target(path, is_output=is_output)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with private_folder(target.parent) as folder:
            yield folder.path / target.name
            folder.release(target.name)
    except (OSError, RuntimeError, ValueError) as error:
        raise _not_written(path, target, error) from error
