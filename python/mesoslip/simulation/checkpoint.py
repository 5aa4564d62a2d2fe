"""Checkpoints, from which a run that was stopped or killed is resumed to the bit.

A checkpoint is a folder beside the output. ``TABLE.rows`` holds recorded rows, appended during the
run, which also bounds its memory. ``state.npz`` holds the state of the kernels and the length of
each table at that time, ``state.previous.npz`` the state before. A state is written under another
name, flushed, and renamed, so one of the two is always whole. Rows appended after it are dropped
when the run is resumed.
"""

from __future__ import annotations

import io
import json
import os
import re
import threading
import time
import tomllib
import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from mesoslip import _build
from mesoslip.configuration.differences import by_dotted_key
from mesoslip.errors import FileError, NoMemoryError
from mesoslip.execution.store import Folder
from mesoslip.memory_limit import is_memory_short
from mesoslip.simulation.memory import free_memory
from mesoslip.simulation.realization import Realization, Saved
from mesoslip.simulation.recorded_tables import MAX_SMALL_BYTES, TABLES, RowFile, Rows, Stored
from mesoslip.simulation.saved_states import NUMBERS, from_arrays, to_arrays

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Version of the files' content; only the program that started a run resumes it.
FORMAT = 3

# Wall time between two checkpoints [s].
INTERVAL = 60.0
# Time after which a failed write, as on a full disk, is tried again [s].
RETRY_SECONDS = 10.0
# Rows in memory above which they are written to the files [bytes], and where memory is scarce.
# Writing rows twice, and reading them, takes a tenth of a run with fine traces.
MAX_WAITING_BYTES = 512e6
MAX_WAITING_IF_SCARCE = 64e6

ADVICE = (
    "; without --resume the run starts from the beginning, and with another output (-o) this "
    "checkpoint is kept"
)

STATE, PREVIOUS = "state.npz", "state.previous.npz"
DAMAGED = "damaged."
ROWS = "{}.rows"
NAMES = rf"(damaged\.)?state(\.previous)?\.npz|({'|'.join(TABLES)})\.rows"


def max_waiting_bytes() -> float:
    """Rows in memory above which they are written to the files [bytes]."""
    wanted = int(4 * MAX_WAITING_BYTES)
    is_scarce = is_memory_short(wanted) or free_memory() < wanted
    return MAX_WAITING_IF_SCARCE if is_scarce else MAX_WAITING_BYTES


class DamagedError(Exception):
    """A state that cannot be read, or whose rows are missing."""


def checkpoint_folder(output: Path) -> Path:
    return output.with_name(f"{output.stem}.checkpoint")


def _folder(path: Path) -> Folder:
    return Folder(path, "checkpoint", NAMES)


def _program() -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": version("mesoslip"),
        "commit": _build.COMMIT,
        "compiler": _build.COMPILER,
    }


class Checkpoint:
    """The checkpoint of a run, written every ``interval`` [s] of wall time, or with 0 only when the
    run is stopped; ``report`` is called with messages for the user."""

    def __init__(
        self,
        folder: Path,
        config: Config,
        *,
        interval: float = INTERVAL,
        resume: bool = False,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.folder = folder
        self._files = _folder(folder)
        self.saved_time: float | None = None
        self._config = config
        self._interval = interval
        self._resume = resume
        self._report = report
        # The running version: another one may be installed before a checkpoint is written.
        self._program = _program()
        self._sizes = dict.fromkeys(TABLES, 0)
        # By number of the realization: the latest state with its epoch.
        self._saved: dict[int, tuple[int, Saved]] = {}
        # Those that are over, which no longer change.
        self._over: dict[int, Realization] = {}
        # Those with new rows.
        self._grown: dict[int, Realization] = {}
        # By table: number of the realization, place, rows, columns and checksum of each piece in
        # the files, one after another.
        self._pieces: dict[str, array[int]] = {table: array("q") for table in TABLES}
        # Rows of these in memory [bytes]: of each when it was visited, and of all.
        self._waiting: dict[int, int] = {}
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        # Number of the latest checkpoint that was due, and of the latest one written.
        self._epoch = self._written = 0
        self._start = self._last = time.perf_counter()
        self._earlier_seconds = 0.0
        self._is_failing = False
        self._last_failure = -RETRY_SECONDS

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Called by the threads of realizations.

    def visit(self, *realizations: Realization) -> None:
        """Note realizations between two segments, and save those that are not over if a checkpoint
        is due."""
        for one in realizations:
            epoch, _ = self._saved.get(one.number, (-1, None))
            is_over = one.finished
            saved = one.save() if epoch < self._epoch and not is_over else None
            with self._lock:
                self._count_waiting(one)
                if is_over:
                    self._over[one.number] = one
                    self._saved.pop(one.number, None)
                elif saved is not None:
                    self._saved[one.number] = (self._epoch, saved)

    def _count_waiting(self, one: Realization) -> None:
        """Note that a realization has rows in memory."""
        waiting = sum(rows.waiting_bytes for _, rows in one.waiting)
        self._waiting_bytes += waiting - self._waiting.get(one.number, 0)
        self._waiting[one.number] = waiting
        self._grown[one.number] = one

    # Called by the main thread.

    def update(self, realizations: Sequence[Realization]) -> None:
        """Begin a checkpoint when it is due, and write it when all realizations are saved."""
        if self._epoch > self._written:
            # Realizations of a resumed run that wait for a worker have not changed.
            running = [one for one in realizations if one.is_open and one.advances > 0]
            running = [one for one in running if not one.finished]
            if all(self._saved.get(one.number, (-1,))[0] == self._epoch for one in running):
                self._write(realizations)
        elif 0 < self._interval <= time.perf_counter() - self._last:
            self._epoch += 1
        is_time = time.perf_counter() - self._last_failure >= RETRY_SECONDS
        if self._waiting_bytes > max_waiting_bytes() and (is_time or not self._is_failing):
            with self._lock:
                grown = list(self._grown.values())
            self._attempt(lambda: self._flush(grown))

    @property
    def is_written(self) -> bool:
        """Whether the folder has a state."""
        return (self.folder / STATE).exists()

    def write(self, realizations: Sequence[Realization]) -> bool:
        """Write a checkpoint of a run that is not advancing; returns whether that succeeded. Of
        what failed the latest state before is kept."""
        self._epoch += 1
        for one in realizations:
            if one.finished:
                self._over[one.number] = one
                self._saved.pop(one.number, None)
            elif one.advances > 0 and not one.has_failed:
                with suppress(MemoryError, NoMemoryError):
                    self._saved[one.number] = (self._epoch, one.save())
        return self._write(realizations)

    def restore(self, realizations: Sequence[Realization]) -> float:
        """Restore realizations, if there is a checkpoint; returns its wall time [s]. A `FileError`
        if it is in use or of another run."""
        with suppress(OSError):
            self._files.lock()
        there = [name for name in (STATE, PREVIOUS) if (self.folder / name).exists()]
        if not self._resume:
            if there:
                self._set_aside("starts from the beginning")
            return 0.0
        for name in there:
            try:
                return self._read(self.folder / name, realizations)
            except DamagedError as error:
                message = f"{self.folder / name}: damaged ({error})"
                if name != there[-1]:
                    message += f"; the state before it is used, {there[-1]}"
                self._report(message)
                # It must not replace the previous state, which may be whole.
                (self.folder / name).replace(self.folder / f"{DAMAGED}{name}")
        if there:
            self._set_aside("no checkpoint can be resumed: starts from the beginning")
        else:
            self._report(f"no checkpoint in {self.folder}: starts from the beginning")
        return 0.0

    def _set_aside(self, reason: str) -> None:
        """Rename the checkpoint of an earlier run, which is not resumed."""
        for number in count(1):
            aside = self.folder.with_name(f"{self.folder.name}.old{number if number > 1 else ''}")
            if not os.path.lexists(aside):
                break
        self._files.move(aside)
        with suppress(OSError):
            self._files.lock()
        self._report(
            f"{reason}; the checkpoint of the earlier run is kept as {aside} until this run is "
            f"complete (to resume it, rename it to {self.folder} and use --resume)"
        )

    def remove(self) -> None:
        """Remove the checkpoint and those of earlier runs, when the output is complete."""
        old = re.compile(rf"{re.escape(self.folder.name)}\.old\d*")
        with suppress(OSError):
            for path in self.folder.parent.iterdir():
                if old.fullmatch(path.name):
                    _folder(path).remove()
        self._files.remove()

    def close(self) -> None:
        """Unlock the folder, and remove it if it is empty."""
        self._files.unlock()

    def _attempt(self, action: Callable[[], None]) -> bool:
        """Write to the folder; a failure, as on a full disk, is reported and the run continues."""
        try:
            self._files.lock()
            action()
        except (OSError, MemoryError) as error:
            if not self._is_failing:
                reason = "not enough memory"
                if isinstance(error, OSError):
                    reason = error.strerror or str(error)
                self._report(
                    f"{self.folder}: the checkpoint cannot be written: {reason}; "
                    "the run continues, and tries again later"
                )
            self._is_failing = True
            self._last_failure = time.perf_counter()
            return False
        self._is_failing = False
        return True

    def _flush(self, realizations: Sequence[Realization]) -> None:
        """Append rows in memory to the files."""
        waiting: dict[str, list[tuple[Realization, Rows]]] = {}
        for one in realizations:
            with self._lock:
                self._grown.pop(one.number, None)
                self._waiting_bytes -= self._waiting.pop(one.number, 0)
            for table, rows in one.waiting:
                if rows.waiting_bytes:
                    waiting.setdefault(table, []).append((one, rows))
        try:
            self._append(waiting)
        except BaseException:
            # Rows that are in no file still wait.
            with self._lock:
                for one in realizations:
                    self._count_waiting(one)
            raise

    def _append(self, waiting: Mapping[str, Sequence[tuple[Realization, Rows]]]) -> None:
        """Append rows by table to the files, each table wholly or not at all."""
        for table, all_rows in waiting.items():
            place = self._sizes[table]
            appended: list[tuple[Rows, list[Stored | None]]] = []
            found = array("q")
            with self._files.open(ROWS.format(table), "r+b" if place else "xb") as file:
                store = RowFile(self.folder / ROWS.format(table))
                file.seek(place)
                for one, rows in all_rows:
                    stored: list[Stored | None] = []
                    for values in rows.waiting():
                        data = np.ascontiguousarray(values)
                        length, columns = data.shape
                        checksum = zlib.crc32(data.data)
                        file.write(data.data)
                        large = data.nbytes > MAX_SMALL_BYTES
                        stored.append(
                            Stored(store, place, (length, columns), checksum) if large else None
                        )
                        found.extend((one.number, place, length, columns, checksum))
                        place += data.nbytes
                    appended.append((rows, stored))
            # After an error of the disk none of them is in the file.
            self._sizes[table] = place
            self._pieces[table].extend(found)
            for rows, stored in appended:
                rows.store(stored)

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
        # Before rows are written: a realization that ends meanwhile is saved with more rows.
        with self._lock:
            running = {number: one for number, (_, one) in self._saved.items()}
            over = dict(self._over)
        self._flush([realizations[number] for number in (*running, *over)])
        for table, size in self._sizes.items():
            if size:
                with self._files.open(ROWS.format(table), "r+b") as file:
                    file.truncate(size)
                    os.fsync(file.fileno())
        arrays: dict[str, Any] = to_arrays(running, over.values())
        for table in TABLES:
            counts = zip(arrays[NUMBERS].tolist(), arrays[f"counts.{table}"].tolist(), strict=True)
            arrays[f"pieces.{table}"] = _first_rows(self._pieces[table], dict(counts))
        header = self._program | {
            "configuration": self._config.to_toml(),
            "wall_seconds": self._earlier_seconds + time.perf_counter() - self._start,
        }
        arrays["header"] = np.array(json.dumps(header))
        with self._files.written(STATE, keep=PREVIOUS) as file:
            np.savez(file, checksum=_checksum(arrays), **arrays)

    def _read(self, path: Path, realizations: Sequence[Realization]) -> float:
        """Restore realizations from a state, unless it is damaged, or of another program
        or configuration."""
        data = self._content(path.name)
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            header = dict(json.loads(str(arrays["header"])))
            checksum = int(arrays.pop("checksum", -1))
        # The libraries do not specify the errors of a damaged archive.
        except Exception as error:
            raise DamagedError(str(error) or type(error).__name__) from error
        self._compare_programs(header)
        if checksum != _checksum(arrays):
            raise DamagedError("it differs from what the run wrote")
        self._compare_configurations(header["configuration"])
        states = from_arrays(arrays)
        sizes = dict.fromkeys(TABLES, 0)
        tables: dict[int, dict[str, Rows]] = {number: {} for number in states}
        for table in TABLES:
            pieces = arrays[f"pieces.{table}"].tolist()
            for number, stored in self._stored(ROWS.format(table), pieces):
                rows = tables[number].setdefault(table, Rows(stored.shape[1]))
                rows.add(stored)
                sizes[table] = max(sizes[table], stored.end)
        for number, one in states.items():
            if {table: len(rows) for table, rows in tables[number].items()} != one.counts:
                raise DamagedError("rows are missing")
        # No realization is restored unless all can be.
        for number, one in states.items():
            realizations[number].restore(one, tables[number])
            if realizations[number].finished:
                self._over[number] = realizations[number]
            else:
                self._saved[number] = (0, one)
        self._pieces = {
            table: array("q", arrays[f"pieces.{table}"].ravel().tolist()) for table in TABLES
        }
        self._sizes = sizes
        self._earlier_seconds = float(header["wall_seconds"])
        return self._earlier_seconds

    def _content(self, name: str) -> bytes:
        try:
            with self._files.open(name, "rb") as file:
                return file.read()
        except OSError as error:
            raise _not_read(self.folder / name, error) from error

    def _stored(self, name: str, pieces: list[list[int]]) -> Iterator[tuple[int, Stored]]:
        """Numbers of realizations and their rows in a file, which must be as they were written."""
        if not pieces:
            return
        store = RowFile(self.folder / name)
        try:
            with self._files.open(name, "rb") as file:
                for number, place, length, columns, checksum in pieces:
                    stored = Stored(store, place, (length, columns), checksum)
                    if not stored.is_whole(file):
                        raise DamagedError(f"{name} differs from the rows that the run wrote")
                    yield number, stored
        except FileNotFoundError:
            raise DamagedError(f"{name} is missing") from None
        except OSError as error:
            raise _not_read(self.folder / name, error) from error

    def _compare_programs(self, header: dict[str, Any]) -> None:
        """Refuse a state of another program."""
        for name, value in self._program.items():
            if header.get(name) != value:
                raise FileError(
                    f"{self.folder}: the checkpoint was made with {name} {header.get(name)} of "
                    f"mesoslip, not {value}: only the same program resumes it to the bit" + ADVICE
                )

    def _compare_configurations(self, configuration: str) -> None:
        """Refuse a state of another configuration."""
        own = self._config.to_toml()
        if configuration != own:
            raise FileError(
                f"{self.folder}: the checkpoint is of another configuration: "
                + _difference(configuration, own)
                + ADVICE
            )


def _checksum(arrays: Mapping[str, NDArray[Any]]) -> int:
    """A checksum of arrays with their names, types and shapes."""
    found = 0
    for name, values in sorted(arrays.items()):
        kind = f"{name} {values.dtype.str} {values.shape}"
        found = zlib.crc32(
            np.ascontiguousarray(values).view(np.uint8).data, zlib.crc32(kind.encode(), found)
        )
    return found


def _first_rows(pieces: array[int], counts: Mapping[int, int]) -> NDArray[np.int64]:
    """The pieces of the first rows of realizations, given how many rows each has; shape (pieces,
    5), see `Checkpoint`."""
    found = np.array(pieces, dtype=np.int64).reshape(-1, 5)
    # Pieces of each realization one after another, in their order.
    order = np.argsort(found[:, 0], kind="stable")
    numbers, lengths = found[order][:, [0, 2]].T
    first = np.flatnonzero(np.diff(numbers, prepend=-1))
    pieces_of_each = np.diff(first, append=len(numbers))
    before = np.cumsum(lengths) - lengths
    before -= np.repeat(before[first], pieces_of_each)
    wanted = np.array([counts.get(one, 0) for one in numbers[first].tolist()], dtype=np.int64)
    kept = np.zeros(len(found), dtype=bool)
    kept[order] = before < np.repeat(wanted, pieces_of_each)
    return found[kept]


def _not_read(path: Path, error: OSError) -> FileError:
    return FileError(f"{path}: cannot be read: {error.strerror or error}")


def _difference(old: str, new: str) -> str:
    """The first keys in which two configurations, as TOML, differ."""
    before, now = (by_dotted_key(tomllib.loads(text)) for text in (old, new))
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    return ", ".join(f"{name} was {before.get(name)}, is {now.get(name)}" for name in names[:3])
