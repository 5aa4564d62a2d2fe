"""Folders of work in progress, which one process at a time writes to, and finished pieces.

A file is written under another name, flushed, and renamed, so it is whole whatever ends the
program. Files of other programs stay: only files of known names are replaced or removed, and only
in folders that this program has made.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self

from mesoslip.errors import FileError, WriteError
from mesoslip.execution.regular_files import open_regular, regular_descriptor

LOCK = "lock"


class Folder:
    """A folder that this program makes when it locks it, for files with a pattern of names.

    A shared one may hold other files from the beginning. The file named ``last`` is removed after
    all others.
    """

    def __init__(
        self, path: Path, kind: str, names: str, *, shared: bool = False, last: str = ""
    ) -> None:
        self.path = path
        self.kind = kind
        self._shared = shared
        self._last = last
        self._names = re.compile(names)
        self._lock: int | None = None

    @property
    def is_own(self) -> bool:
        """Whether this program has made it, or it is empty."""
        try:
            names = {one.name for one in self.path.iterdir()}
        except FileNotFoundError:
            return not self.path.is_symlink()
        except OSError as error:
            if error.errno in {errno.ENOTDIR, errno.ELOOP}:
                return False
            raise
        mark = self._mark()
        if mark == b"":
            # A process that was killed while it made the lock leaves an empty one.
            return names <= {LOCK} and not self.path.is_symlink()
        return mark == self._own_mark

    @property
    def _is_free(self) -> bool:
        """Whether it is a folder, not a link to one, without a lock or files of these names."""
        if self.path.is_symlink():
            return False
        try:
            names = [one.name for one in self.path.iterdir()]
        except OSError:
            return False
        parts = (name[1:-5] for name in names if name.startswith(".") and name.endswith(".part"))
        return LOCK not in names and not any(map(self._names.fullmatch, (*names, *parts)))

    @property
    def _own_mark(self) -> bytes:
        return f"mesoslip {self.kind}\n".encode()

    def _mark(self) -> bytes | None:
        """Content of the lock, empty if there is no lock; None if it is not a regular file."""
        try:
            with self.open(LOCK, "rb") as file:
                return file.read(100)
        except FileNotFoundError:
            return b""
        except OSError:
            return None

    def open(self, name: str, mode: str) -> IO[bytes]:
        """Open one of its files; see `open_regular`."""
        return open_regular(self.path / name, mode)

    def check(self) -> None:
        """Refuse a folder, or another file at its path, that this program has not made."""
        if self.is_own or (self._shared and self._is_free):
            return
        raise FileError(
            f"{self.path}: was not made by this program, which keeps its {self.kind} under this "
            "name; move it, or give another output (-o)"
        )

    def lock(self) -> None:
        """Make and lock the folder: a `FileError` if another process writes to it, an `OSError` if
        it cannot be made."""
        if self._lock is not None:
            return
        while True:
            self.check()
            self.path.mkdir(parents=True, exist_ok=True)
            number = regular_descriptor(self.path / LOCK, os.O_RDWR | os.O_CREAT)
            try:
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(number)
                raise FileError(
                    f"{self.path}: another run of this output is under way; wait for it, or give "
                    "another output (-o)"
                ) from None
            except OSError:
                # The file system has no locks, so concurrent runs are not detected.
                break
            # Another process may have removed the folder in the meantime.
            with suppress(OSError):
                if (self.path / LOCK).stat().st_ino == os.fstat(number).st_ino:
                    break
            os.close(number)
        try:
            if os.fstat(number).st_size == 0:
                os.write(number, self._own_mark)
                os.fsync(number)
        except OSError:
            os.close(number)
            raise
        self._lock = number

    def unlock(self) -> None:
        """Unlock it for other processes, and remove it if it is empty."""
        if self._lock is None:
            return
        with suppress(OSError):
            if [one.name for one in self.path.iterdir()] == [LOCK]:
                self._remove_lock()
        self._close()

    def remove(self) -> None:
        """Remove its files, and the folder unless it has other files."""
        with suppress(OSError):
            if not self.is_own:
                return
            self.remove_parts()
            # States, by their suffix, before the rows that they need.
            for one in sorted(self.path.iterdir(), key=self._removal_order):
                if self._names.fullmatch(one.name):
                    one.unlink()
            self._remove_lock()
        self._close()

    def _removal_order(self, path: Path) -> tuple[bool, str]:
        return path.name == self._last, path.suffix

    def move(self, path: Path) -> None:
        """Rename it, and unlock it for other processes."""
        self.path.replace(path)
        self._close()

    def _close(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _remove_lock(self) -> None:
        (self.path / LOCK).unlink(missing_ok=True)
        self.path.rmdir()

    def remove_parts(self) -> None:
        """Remove incomplete files of a process that was killed."""
        for one in self.path.glob(".*.part"):
            if self._names.fullmatch(one.name[1:-5]):
                with suppress(OSError):
                    one.unlink()

    @contextmanager
    def written(self, name: str, *, keep: str | None = None) -> Iterator[IO[bytes]]:
        """Write a file whole; the file that it replaces may be kept under another name."""
        part, target = self.path / f".{name}.part", self.path / name
        self.path.mkdir(parents=True, exist_ok=True)
        try:
            with open_regular(part, "xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if keep is not None and target.exists():
                target.replace(self.path / keep)
            part.replace(target)
        except BaseException:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            raise
        folder = os.open(self.path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


class Pieces:
    """Finished pieces of work in a folder that may not exist, a small file for each."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def names(self) -> set[str]:
        try:
            return {one.stem for one in self.path.iterdir() if NAME.fullmatch(one.name) is not None}
        except FileNotFoundError:
            return set()
        except OSError as error:
            raise FileError(f"{self.path}: cannot be read: {error.strerror}") from None

    def read(self, name: str) -> dict[str, Any] | None:
        """A piece; None if it is missing or damaged."""
        path = self.path / f"{name}.json"
        try:
            with open_regular(path, "rb") as file:
                content = file.read()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise FileError(f"{path}: cannot be read: {error.strerror}") from None
        try:
            body: dict[str, Any] = json.loads(content)
            is_whole = body.pop("checksum") == _checksum(body) and body["name"] == name
        # A number of thousands of digits is a ValueError.
        except (AttributeError, LookupError, RecursionError, TypeError, ValueError):
            return None
        return body if is_whole else None


# Files of a piece: its hash or number, then `.json`, or `.nc` for its output.
PIECE = r"[0-9a-f]{6,32}"
NAME = re.compile(rf"{PIECE}\.json")
MANIFEST = "manifest.json"


class Store(Pieces):
    """Finished pieces, such as "points", in a folder that this process alone writes to.

    All pieces belong to one fingerprint, which is empty if their names contain it. Raises a
    `FileError` if the folder cannot be locked, or its pieces have another fingerprint.
    """

    def __init__(self, path: Path, kind: str, fingerprint: str = "") -> None:
        super().__init__(path)
        # The manifest is removed last: if a removal is interrupted, the remaining pieces still have
        # their fingerprint.
        names = rf"{PIECE}\.(json|nc)|{re.escape(MANIFEST)}"
        self._folder = Folder(path, kind, names, shared=True, last=MANIFEST)
        try:
            self._folder.lock()
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {error.strerror}") from None
        self._folder.remove_parts()
        if fingerprint:
            self._check(fingerprint)

    def _check(self, fingerprint: str) -> None:
        try:
            with self._folder.open(MANIFEST, "rb") as file:
                there = json.load(file).get("fingerprint")
        except FileNotFoundError:
            there = None if self.names() else fingerprint
            if there:
                self.write_manifest({"fingerprint": fingerprint})
        except (OSError, AttributeError, RecursionError, ValueError):
            there = None
        if there != fingerprint:
            self.close()
            raise FileError(
                f"{self.path}: is of another configuration, trace or version; remove it to start "
                "again"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Unlock it for other processes."""
        self._folder.unlock()

    def remove(self) -> None:
        """Remove it, when the whole work is complete."""
        self._folder.remove()

    def write(self, name: str, body: Mapping[str, Any], output: bytes | None = None) -> None:
        """Write a piece, after its output if it has one."""
        if output is not None:
            self._write(f"{name}.nc", output)
        body = {"name": name, **body}
        content = json.dumps({"checksum": _checksum(body), **body}, indent=1)
        self._write(f"{name}.json", content.encode())

    def write_manifest(self, manifest: Mapping[str, Any]) -> None:
        """Write the data that belong to all pieces."""
        self._write(MANIFEST, json.dumps(manifest).encode())

    def _write(self, name: str, content: bytes) -> None:
        try:
            with self._folder.written(name) as file:
                file.write(content)
        except OSError as error:
            raise not_written(self.path / name, error) from error


def not_written(path: Path, error: OSError) -> FileError:
    if error.errno in {errno.ENOSPC, errno.EDQUOT}:
        return WriteError(f"{path}: cannot be written: no space left on the disk")
    return FileError(f"{path}: cannot be written: {error.strerror or error}")


def _checksum(body: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(body, sort_keys=True).encode())
