"""Checkpoints: a run that was stopped, killed or cut off goes on as if it never had been.

A checkpoint is a folder beside the output. ``TABLE.rows`` holds what was recorded, appended as the
run goes on, which also bounds its memory; ``state.npz`` the state of the kernels and how far each
table was then, ``state.previous.npz`` the one before. A state is written under another name,
flushed, and renamed, so whatever happens one of the two is whole. What was appended after it is cut
off again when the run goes on.
"""

from __future__ import annotations

import fcntl
import io
import json
import os
import shutil
import threading
import time
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mesoslip import _build
from mesoslip.errors import FileError
from mesoslip.simulation.realization import Realization, Saved
from mesoslip.simulation.tables import TABLES, Rows, Stored

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Of what is in the files; a run goes on only with the kernels that began it.
FORMAT = 1

# Wall time between two checkpoints [s].
INTERVAL = 60.0
# Time after which a full disk or the like is tried again [s].
RETRY = 10.0
# What may wait in memory before it is put into the files [bytes].
MOST_WAITING = 64e6

STATE, PREVIOUS, PART, LOCK = "state.npz", "state.previous.npz", "state.part", "lock"


class DamagedError(Exception):
    """A state that cannot be read, or whose tables are not there."""


def checkpoint_folder(output: Path) -> Path:
    """Where the checkpoint of an output is."""
    return output.with_name(f"{output.stem}.checkpoint")


def _program() -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": version("mesoslip"),
        "commit": _build.COMMIT,
        "compiler": _build.COMPILER,
    }


class Checkpoint:
    """The checkpoint of a run, kept while it goes on.

    Parameters
    ----------
    folder
        Where it is.
    config
        What is run.
    interval
        Wall time between two checkpoints [s]; 0 for none but when the run is stopped.
    resume
        Whether to go on from what is there.
    tell
        Called with a sentence about what the user should know.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        *,
        interval: float = INTERVAL,
        resume: bool = False,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.folder = folder
        self.saved_time: float | None = None
        self._config = config
        self._interval = interval
        self._resume = resume
        self._tell = tell
        # What runs now, not what is installed by the time of a checkpoint.
        self._program = _program()
        self._paths = {table: folder / f"{table}.rows" for table in TABLES}
        self._sizes = dict.fromkeys(TABLES, 0)
        self._saved: dict[int, tuple[int, Saved]] = {}
        self._grown: dict[int, Realization] = {}
        self._lock = threading.Lock()
        self._epoch = self._written = 0
        self._start = self._last = time.perf_counter()
        self._before = 0.0
        self._lock_file: io.TextIOBase | None = None
        self._is_failing = False
        self._last_failure = -RETRY

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # What the threads of realizations call.

    def visit(self, realization: Realization) -> None:
        """Between two segments of a realization: save it if it is wanted, or over."""
        epoch, _ = self._saved.get(realization.number, (-1, None))
        saved = None
        if epoch < self._epoch or realization.finished:
            saved = realization.save()
        with self._lock:
            self._grown[realization.number] = realization
            if saved is not None:
                self._saved[realization.number] = (self._epoch, saved)

    # What the main thread calls.

    def look(self, realizations: Sequence[Realization]) -> None:
        """Now and then: begin a checkpoint when it is time, finish one that all are saved for."""
        if self._epoch > self._written:
            # Those of a run that was taken up wait for a worker as they were saved.
            running = [one for one in realizations if one.is_open and one.advances > 0]
            running = [one for one in running if not one.finished]
            if all(self._saved.get(one.number, (-1,))[0] == self._epoch for one in running):
                self._write(realizations)
        elif 0 < self._interval <= time.perf_counter() - self._last:
            self._epoch += 1
        with self._lock:
            grown = list(self._grown.values())
        waiting = sum(rows.waiting_bytes for one in grown for _, rows in one.waiting)
        is_time = time.perf_counter() - self._last_failure >= RETRY
        if waiting > MOST_WAITING and (is_time or not self._is_failing):
            self._attempt(lambda: self._flush(grown))

    def write(self, realizations: Sequence[Realization]) -> bool:
        """Write a checkpoint of a run that stands still; whether it was possible."""
        self._epoch += 1
        for one in realizations:
            if one.advances > 0:
                self._saved[one.number] = (self._epoch, one.save())
        return self._write(realizations)

    def restore(self, realizations: Sequence[Realization]) -> float:
        """Set realizations to the state of the checkpoint, if it is wanted and there is one.

        Returns
        -------
        float
            Wall time of the run before [s].

        Raises
        ------
        FileError
            If the checkpoint is of another configuration or program, or in use.
        """
        with suppress(OSError):
            self._take_lock()
        there = [name for name in (STATE, PREVIOUS) if (self.folder / name).exists()]
        if not self._resume:
            if there:
                self._set_aside("starts anew")
            return 0.0
        for name in there:
            try:
                return self._read(self.folder / name, realizations)
            except DamagedError as error:
                self._tell(f"{self.folder / name}: damaged ({error})")
                # It must not take the place of the previous one, which may be whole.
                (self.folder / name).replace(self.folder / f"damaged.{name}")
        if there:
            self._set_aside("no checkpoint can be taken up: starts at the beginning")
        else:
            self._tell(f"no checkpoint in {self.folder}: starts at the beginning")
        return 0.0

    def _set_aside(self, what: str) -> None:
        """Keep what another run has left, and this one does not go on with, under another name."""
        self.close()
        shutil.rmtree(self._aside, ignore_errors=True)
        self.folder.replace(self._aside)
        self._take_lock()
        self._tell(
            f"{what}; the checkpoint of a run that was stopped is kept as {self._aside} until this "
            f"one is complete (as {self.folder}, --resume goes on with it)"
        )

    @property
    def _aside(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}.old")

    def remove(self) -> None:
        """Remove it, when the output is there."""
        for folder in (self.folder, self._aside):
            shutil.rmtree(folder, ignore_errors=True)
        self.close()

    def close(self) -> None:
        """Leave it to another run; it stays where it is, unless nothing is in it."""
        if self._lock_file is None:
            return
        with suppress(OSError):
            if [one.name for one in self.folder.iterdir()] == [LOCK]:
                shutil.rmtree(self.folder)
        self._lock_file.close()
        self._lock_file = None

    def _take_lock(self) -> None:
        """Be the only run of this output.

        Raises
        ------
        FileError
            If another one is under way.
        """
        if self._lock_file is not None:
            return
        path = self.folder / LOCK
        while True:
            self.folder.mkdir(parents=True, exist_ok=True)
            file = path.open("w")
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.close()
                raise FileError(
                    f"{self.folder}: another run of this output is under way; wait for it, or give "
                    "this one another output (-o)"
                ) from None
            except OSError:
                # A file system without locks: there is nothing to be had.
                break
            # Another run may have removed the folder meanwhile.
            with suppress(OSError):
                if path.stat().st_ino == os.fstat(file.fileno()).st_ino:
                    break
            file.close()
        self._lock_file = file

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Do what a full disk or the like may prevent: the run goes on without it, and says so."""
        try:
            self._take_lock()
            action()
        except OSError as error:
            if not self._is_failing:
                self._tell(
                    f"{self.folder}: the checkpoint cannot be written: {error.strerror or error}; "
                    "the run goes on, and tries again"
                )
            self._is_failing = True
            self._last_failure = time.perf_counter()
            return False
        self._is_failing = False
        return True

    def _flush(self, realizations: Sequence[Realization]) -> None:
        """Append what waits in memory to the files."""
        for one in realizations:
            with self._lock:
                self._grown.pop(one.number, None)
            for table, rows in one.waiting:
                for number, values in rows.waiting():
                    rows.store(number, self._append(table, values))

    def _append(self, table: str, values: Any) -> Stored:
        path, place = self._paths[table], self._sizes[table]
        data = np.ascontiguousarray(values, dtype=np.float64)
        with path.open("r+b" if place else "wb") as file:
            file.seek(place)
            file.write(data.data)
        self._sizes[table] = place + data.nbytes
        return Stored(path, place, (data.shape[0], data.shape[1]), zlib.crc32(data.data))

    def _write(self, realizations: Sequence[Realization]) -> bool:
        self._last = time.perf_counter()
        self._written = self._epoch
        is_written = self._attempt(lambda: self._write_state(realizations))
        self._last = time.perf_counter()
        if is_written:
            self.saved_time = min(
                (one.time for one in realizations if not one.finished), default=None
            )
        return is_written

    def _write_state(self, realizations: Sequence[Realization]) -> None:
        # Before rows are put into files, as one that ends meanwhile is saved with more of them.
        with self._lock:
            saved = {number: one for number, (_, one) in self._saved.items()}
        self._flush([realizations[number] for number in saved])
        for table, size in self._sizes.items():
            if size:
                with self._paths[table].open("r+b") as file:
                    file.truncate(size)
                    os.fsync(file.fileno())
        arrays: dict[str, Any] = {}
        tables: dict[str, list[tuple[int, ...]]] = {table: [] for table in TABLES}
        for number, one in saved.items():
            if one.words is not None:
                arrays[f"words.{number}"] = one.words
            for table, rows in realizations[number].waiting:
                left = one.counts.get(table, 0)
                for piece in rows.pieces:
                    if left <= 0:
                        break
                    assert isinstance(piece, Stored)
                    tables[table].append((number, piece.place, *piece.shape, piece.checksum))
                    left -= len(piece)
        for table, pieces in tables.items():
            arrays[f"pieces.{table}"] = np.array(pieces, dtype=np.int64).reshape(-1, 5)
        header = self._program | {
            "configuration": self._config.to_toml(),
            "wall_seconds": self._before + time.perf_counter() - self._start,
            "realizations": {
                number: {"scalars": one.scalars, "counts": one.counts}
                for number, one in saved.items()
            },
        }
        part = self.folder / PART
        try:
            with part.open("wb") as file:
                np.savez(file, header=np.array(json.dumps(header)), **arrays)
                file.flush()
                os.fsync(file.fileno())
        except OSError:
            part.unlink(missing_ok=True)
            raise
        if (self.folder / STATE).exists():
            (self.folder / STATE).replace(self.folder / PREVIOUS)
        part.replace(self.folder / STATE)
        folder = os.open(self.folder, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def _read(self, path: Path, realizations: Sequence[Realization]) -> float:
        """Set realizations to a state.

        Raises
        ------
        DamagedError
            If it is not whole.
        FileError
            If it is of another configuration or program.
        """
        try:
            data = path.read_bytes()
        except OSError as error:
            raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as file:
                header = json.loads(str(file["header"]))
                arrays = {name: file[name] for name in file.files if name != "header"}
        # What a damaged archive has the libraries raise is not specified.
        except Exception as error:
            raise DamagedError(str(error) or type(error).__name__) from error
        self._compare(header)
        if missing := {f"pieces.{table}" for table in TABLES} - arrays.keys():
            raise DamagedError(f"without {min(missing)}")
        sizes = dict.fromkeys(TABLES, 0)
        tables: dict[int, dict[str, Rows]] = {}
        for text, kept in header["realizations"].items():
            columns = kept["scalars"]["columns"]
            tables[int(text)] = {table: Rows(columns[table]) for table in columns}
        for table in TABLES:
            file_path = self._paths[table]
            for number, place, length, columns, checksum in arrays[f"pieces.{table}"].tolist():
                stored = Stored(file_path, place, (length, columns), checksum)
                tables[number][table].add(stored)
                sizes[table] = max(sizes[table], place + 8 * length * columns)
            if sizes[table] and (not file_path.exists() or file_path.stat().st_size < sizes[table]):
                raise DamagedError(f"{file_path.name} is too short")
        for text, kept in header["realizations"].items():
            number = int(text)
            counts = {table: len(rows) for table, rows in tables[number].items()}
            if counts != kept["counts"]:
                raise DamagedError("rows are missing")
            saved = Saved(kept["scalars"], kept["counts"], arrays.get(f"words.{number}"))
            realizations[number].restore(saved, tables[number])
            self._saved[number] = (0, saved)
        self._sizes = sizes
        self._before = float(header["wall_seconds"])
        return self._before

    def _compare(self, header: dict[str, Any]) -> None:
        """Refuse a state that this run cannot go on from.

        Raises
        ------
        FileError
            If it is of another configuration or program.
        """
        advice = (
            "; run without --resume to start anew, or give another output (-o) to keep this one"
        )
        for name, value in self._program.items():
            if header.get(name) != value:
                raise FileError(
                    f"{self.folder}: the checkpoint was made with {name} {header.get(name)} of "
                    f"mesoslip, and this is {value}: only the same program goes on to the bit"
                    + advice
                )
        if header["configuration"] != self._config.to_toml():
            raise FileError(
                f"{self.folder}: the checkpoint is of another configuration: "
                + _difference(header["configuration"], self._config.to_toml())
                + advice
            )


def _difference(old: str, new: str) -> str:
    """The first keys in which two configurations differ."""
    import tomllib

    def flat(tables: dict[str, Any], outer: str = "") -> dict[str, Any]:
        keys: dict[str, Any] = {}
        for name, value in tables.items():
            if isinstance(value, dict):
                keys |= flat(value, f"{outer}{name}.")
            else:
                keys[outer + name] = value
        return keys

    before, now = flat(tomllib.loads(old)), flat(tomllib.loads(new))
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    told = [f"{name} was {before.get(name)}, is {now.get(name)}" for name in names[:3]]
    return ", ".join(told)
