"""The store of a sweep: a folder with one small file for each point that is done.

A file is named by the hash of everything that its numbers follow from, so points of another base,
of other measures or of another program have other names and never mix. It is written under another
name, flushed, and renamed: it is there as a whole or not at all. What is damaged all the same, as
by a disk, counts as missing.
"""

from __future__ import annotations

import fcntl
import io
import json
import os
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from mesoslip.campaign.point import FORMAT, Outcome, Task
from mesoslip.errors import FileError
from mesoslip.output.targets import written_whole

LOCK, MANIFEST = "lock", "sweep.json"


@dataclass(frozen=True)
class Stored:
    """What is kept of a point: its measures by name, and its computing time [s]."""

    measures: dict[str, float]
    seconds: float


def store_folder(output: Path) -> Path:
    """Where the points of an output are."""
    return output.with_name(f"{output.stem}.points")


class Points:
    """The points of a store, to be read.

    Parameters
    ----------
    folder
        Where they are; it need not be there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def trace_path(self, name: str) -> Path:
        """Where the output of a point is, if it is kept."""
        return self.folder / f"{name}.nc"

    def names(self) -> set[str]:
        """Names of the points that are there."""
        try:
            paths = list(self.folder.glob("*.json"))
        except OSError as error:
            raise FileError(f"{self.folder}: cannot be read: {error.strerror}") from None
        # Without those that are being written.
        return {path.stem for path in paths if not path.name.startswith((".", MANIFEST))}

    def read(self, name: str) -> Stored | None:
        """A point; None if it is not there or damaged.

        Raises
        ------
        FileError
            If it is there and the disk does not give it.
        """
        path = self.folder / f"{name}.json"
        try:
            whole = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise FileError(f"{path}: cannot be read: {error.strerror}") from None
        try:
            body = json.loads(whole)
            if body.pop("checksum") != _checksum(body) or body["name"] != name:
                return None
            measures = {key: float(value) for key, value in body["measures"].items()}
            return Stored(measures, float(body["seconds"]))
        except (AttributeError, LookupError, TypeError, ValueError):
            return None


class Store(Points):
    """A store that this process alone writes to.

    Parameters
    ----------
    folder
        Where it is; made if it is not there.

    Raises
    ------
    FileError
        If it cannot be written to, or another process is at work in it.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._lock: io.TextIOBase | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / LOCK).open("w")
        except OSError as error:
            raise FileError(f"{folder}: cannot be written: {error.strerror}") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise FileError(f"{folder}: another sweep is at work there") from None
        except OSError:
            # A file system without locks, such as some of networks: there is nothing to be had.
            pass
        # Nobody else writes here: these are of a process that was killed.
        for path in folder.glob(".*"):
            with suppress(OSError):
                path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others write to it."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def write(self, task: Task, outcome: Outcome, values: Mapping[str, Any]) -> None:
        """Keep a point; its output first, so that a point with a file has all that belongs to it.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        if outcome.trace is not None:
            _write(self.trace_path(task.name), outcome.trace)
        body = {
            "format": FORMAT,
            "name": task.name,
            "program": task.program,
            "point": dict(values),
            "realization": task.realization,
            # Numbers as Python writes them come back to the bit.
            "measures": {name: repr(value) for name, value in outcome.measures.items()},
            "seconds": outcome.seconds,
        }
        whole = json.dumps({"checksum": _checksum(body), **body}, indent=1)
        _write(self.folder / f"{task.name}.json", whole.encode())

    def write_manifest(self, manifest: Mapping[str, Any]) -> None:
        """Keep what belongs to the sweep.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        _write(self.folder / MANIFEST, json.dumps(manifest, indent=1).encode())


def _checksum(body: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(body, sort_keys=True).encode())


def _write(path: Path, content: bytes) -> None:
    """Write a file whole, and have the disk keep it before its name appears."""
    with written_whole(path) as part, part.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
