"""The tables of a run: rows of numbers, in memory or in the files of a checkpoint."""

from __future__ import annotations

import math
import os
import threading
import weakref
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import RunError, shown
from mesoslip.execution.regular_files import regular_descriptor
from mesoslip.simulation.fronts import FRONT_COLUMNS
from mesoslip.simulation.kernel import name_list

# Columns of the tables, as the kernels state them.
TRACE_COLUMNS = name_list("trace")
SLIP_COLUMNS = name_list("slips")
STAGE_COLUMNS = name_list("stages")
AVALANCHE_COLUMNS = name_list("avalanches")
RUPTURE_COLUMNS = name_list("ruptures")
SNAPSHOT_COLUMNS = name_list("snapshot_events")
# Numbers of each contact in a snapshot, and at present.
SNAPSHOT_NUMBERS = name_list("snapshots")
CONTACT_COLUMNS = name_list("contacts")
ENERGY_COLUMNS = name_list("energy")

# Columns by table. The width of the tables without named columns depends on the run: displacements
# of all layers, numbers of all blocks and of all contacts.
COLUMNS: dict[str, tuple[str, ...]] = {
    "trace": TRACE_COLUMNS,
    "slip_trace": name_list("slip_trace"),
    "slips": SLIP_COLUMNS,
    "stages": STAGE_COLUMNS,
    "layers": (),
    "blocks": (),
    "ruptures": RUPTURE_COLUMNS,
    "avalanches": AVALANCHE_COLUMNS,
    "snapshot_events": SNAPSHOT_COLUMNS,
    "snapshots": (),
    "fronts": FRONT_COLUMNS,
}
TABLES = tuple(COLUMNS)
# Numbers of each block in a row of the table of blocks, each for all blocks one after another.
BLOCK_NUMBERS = (
    *("block_displacement", "block_velocity", "block_contact_force"),
    "block_detached_contacts",
)

# Sentinel: the stretch of a detached contact.
DETACHED = 1e300

# Length of rows of which a place in a file would take as much memory [bytes].
MAX_SMALL_BYTES = 1024


def structured(values: Array, columns: Sequence[str]) -> NDArray[np.void]:
    """Rows of shape (rows, columns) as a structured array of shape (rows) with named columns."""
    row = np.dtype([(name, np.float64) for name in columns])
    return np.ascontiguousarray(values).view(row)[:, 0]


class RowFile:
    """A file of rows, which stays open from the first reading on."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._number: int | None = None

    def read(self, place: int, count: int) -> Array:
        """Numbers from a place [bytes] on, fewer at the end of the file; a `RunError` if they
        cannot be read."""
        try:
            if self._number is None:
                self._number = regular_descriptor(self._path, os.O_RDONLY)
                weakref.finalize(self, os.close, self._number)
            values = np.empty(count)
            length = os.preadv(self._number, [values.data.cast("B")], place)
        except OSError as error:
            raise RunError(f"{self._path}: cannot be read: {error.strerror}") from error
        return values[: length // values.itemsize]

    def __str__(self) -> str:
        return str(self._path)


@dataclass(slots=True)
class Stored:
    """Rows in a file, from ``place`` [bytes] on."""

    file: RowFile
    place: int
    shape: tuple[int, int]
    checksum: int

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def end(self) -> int:
        """The place after them [bytes]."""
        return self.place + math.prod(self.shape) * np.dtype(np.float64).itemsize

    def load(self) -> Array:
        """Read them; raises a `RunError` if they differ from the written rows."""
        values = self.file.read(self.place, math.prod(self.shape))
        if not self._equals(values):
            raise RunError(f"{self.file}: damaged: it differs from the rows that the run wrote")
        return values.reshape(self.shape)

    def is_whole(self, file: IO[bytes]) -> bool:
        """Whether their file, which is open, has the written rows."""
        file.seek(self.place)
        values = np.fromfile(file, dtype=np.float64, count=math.prod(self.shape))
        return self._equals(values)

    def _equals(self, values: Array) -> bool:
        return values.size == math.prod(self.shape) and zlib.crc32(values.data) == self.checksum


class Rows:
    """The rows of a table of one realization with a number of columns, added by its thread and
    written by another."""

    __slots__ = ("_count", "_lock", "_written", "columns", "pieces", "waiting_bytes")

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.pieces: list[Array | Stored] = []
        # Memory of the pieces that are not in a file yet, and number of those that are.
        self.waiting_bytes = 0
        self._written = 0
        self._lock = threading.Lock()
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, values: Array | Stored) -> None:
        """Add rows, shape (rows, columns)."""
        if len(values) == 0:
            return
        with self._lock:
            self.pieces.append(values)
            self._count += len(values)
            if isinstance(values, np.ndarray):
                self.waiting_bytes += values.nbytes
            else:
                self._written += 1

    def waiting(self) -> list[Array]:
        """Pieces that are not in a file yet."""
        with self._lock:
            return [one for one in self.pieces[self._written :] if isinstance(one, np.ndarray)]

    def store(self, stored: Iterable[Stored | None]) -> None:
        """Note that the next pieces are in a file, where those stay only that have a place."""
        with self._lock:
            for one in stored:
                piece = self.pieces[self._written]
                assert isinstance(piece, np.ndarray)
                self.waiting_bytes -= piece.nbytes
                if one is not None:
                    self.pieces[self._written] = one
                self._written += 1

    def blocks(self, max_rows: int) -> Iterator[Array]:
        """The rows in their order, at most ``max_rows`` at a time."""
        with self._lock:
            pieces = list(self.pieces)
        for piece in pieces:
            values = piece.load() if isinstance(piece, Stored) else piece
            if len(values) <= max_rows:
                yield values
                continue
            for start in range(0, len(values), max_rows):
                yield values[start : start + max_rows]

    def read(self) -> Array:
        """All rows, shape (rows, columns)."""
        return np.concatenate(
            [np.empty((0, self.columns)), *self.blocks(max(1, len(self)))], dtype=np.float64
        )


# Of tables without rows.
NO_ROWS = {table: Rows(len(columns)) for table, columns in COLUMNS.items()}


class FirstRows:
    def __init__(self, rows: Rows, count: int) -> None:
        self._rows, self._count = rows, count
        self.columns = rows.columns

    def __len__(self) -> int:
        return self._count

    def blocks(self, max_rows: int) -> Iterator[Array]:
        remaining = self._count
        for block in self._rows.blocks(max_rows):
            if remaining == 0:
                return
            yield block[:remaining]
            remaining -= min(remaining, len(block))

    def read(self) -> Array:
        return np.concatenate([np.empty((0, self.columns)), *self.blocks(max(1, self._count))])


class SnapshotRows:
    """Snapshots of the contacts, shape (snapshots, contacts, 3), see `SNAPSHOT_NUMBERS`."""

    def __init__(self, rows: Rows | FirstRows) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def _shaped(self, values: Array) -> Array:
        contacts = values.size // (len(SNAPSHOT_NUMBERS) * max(1, len(values)))
        shaped = values.reshape(len(values), contacts, len(SNAPSHOT_NUMBERS))
        return np.where(shaped > DETACHED, np.nan, shaped)

    def blocks(self, max_rows: int) -> Iterator[Array]:
        """The snapshots in their order; the stretch of a detached contact is NaN."""
        for values in self._rows.blocks(max_rows):
            yield self._shaped(values)

    def read(self) -> Array:
        return self._shaped(self._rows.read())


class Recorded:
    """Rows that a run has recorded, by table."""

    __slots__ = ("_tables",)

    def __init__(self) -> None:
        self._tables: dict[str, Rows] = {}

    def rows(self, table: str) -> Rows | FirstRows | SnapshotRows:
        """Rows of one of `TABLES`; samples around a slip come with the slip's row."""
        if not isinstance(table, str) or table not in COLUMNS:
            raise RunError(f"there is no table {shown(table)}, but there are {', '.join(COLUMNS)}")
        rows = self._tables.get(table, NO_ROWS[table])
        if table == "slip_trace" and len(rows):
            return FirstRows(rows, self._slip_samples(rows))
        if table == "snapshots":
            return SnapshotRows(rows)
        return rows

    def records(self, name: str) -> NDArray[np.void]:
        """Rows recorded in a table with named columns up to now, as a structured array of shape
        (rows), in SI units; raises a `RunError` if there is no such table."""
        columns = COLUMNS.get(name) if isinstance(name, str) else None
        if not columns:
            known = ", ".join(repr(other) for other, names in COLUMNS.items() if names)
            raise RunError(
                f"there is no table {shown(name)} with named columns, but there are {known}"
            )
        return structured(self.rows(name).read(), columns)

    @property
    def trace(self) -> Array:
        """The samples of the trace, columns `TRACE_COLUMNS`."""
        return self.rows("trace").read()

    @property
    def slips(self) -> Array:
        """The catalogue of slips, columns `SLIP_COLUMNS`."""
        return self.rows("slips").read()

    @property
    def slip_trace(self) -> Array:
        """The finer samples around slips: columns of the trace and the number of the slip."""
        return self.rows("slip_trace").read()

    @property
    def layer_trace(self) -> Array:
        """Displacements of the layers at the samples of the trace."""
        return self.rows("layers").read()

    @property
    def avalanches(self) -> Array:
        """The catalogue of avalanches, columns `AVALANCHE_COLUMNS`."""
        return self.rows("avalanches").read()

    @property
    def snapshot_events(self) -> Array:
        """Times and displacements of the snapshots, columns `SNAPSHOT_COLUMNS`."""
        return self.rows("snapshot_events").read()

    @property
    def snapshots(self) -> Array:
        """The snapshots, shape (snapshots, contacts, 3), numbers `SNAPSHOT_NUMBERS`."""
        return self.rows("snapshots").read()

    def _slip_samples(self, rows: Rows) -> int:
        """Number of samples that belong to completed slips; those of a slip under way follow."""
        slips = len(self._tables["slips"]) if "slips" in self._tables else 0
        count = len(rows)
        for piece in reversed(rows.pieces):
            number = (piece if isinstance(piece, np.ndarray) else piece.load())[:, -1]
            if number[0] < slips:
                return count - int(np.count_nonzero(number >= slips))
            count -= len(piece)
        return count

    @property
    def waiting(self) -> Iterator[tuple[str, Rows]]:
        """Tables with their rows, some of which may not be in a file yet."""
        yield from list(self._tables.items())
