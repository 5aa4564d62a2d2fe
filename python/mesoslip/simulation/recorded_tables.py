"""The record of a run: tables of numbers, row by row, in memory or in the files of a checkpoint."""

from __future__ import annotations

import threading
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.errors import RunError
from mesoslip.simulation.kernel import name_list

Array = NDArray[np.float64]

# The columns of the tables, as the kernels state them.
TRACE_COLUMNS = name_list("trace")
SLIP_COLUMNS = name_list("slips")
STAGE_COLUMNS = name_list("stages")
AVALANCHE_COLUMNS = name_list("avalanches")
SNAPSHOT_COLUMNS = name_list("snapshot_events")
# Of each contact of a snapshot, and of each contact as it is.
SNAPSHOT_NUMBERS = name_list("snapshots")
CONTACT_COLUMNS = name_list("contacts")
ENERGY_COLUMNS = name_list("energy")

# Tables with named columns; a row of the others depends on the run: the displacements of the layers
# at a sample of the trace, all contacts of a snapshot.
COLUMNS: dict[str, tuple[str, ...]] = {
    "trace": TRACE_COLUMNS,
    "slip_trace": name_list("slip_trace"),
    "slips": SLIP_COLUMNS,
    "stages": STAGE_COLUMNS,
    "layers": (),
    "avalanches": AVALANCHE_COLUMNS,
    "snapshot_events": SNAPSHOT_COLUMNS,
    "snapshots": (),
}
TABLES = tuple(COLUMNS)


def structured(values: Array, columns: Sequence[str]) -> NDArray[np.void]:
    """Rows, shape (rows, columns), as a structured array, shape (rows), of which each column has a
    name; nothing is copied where rows lie one after another in memory."""
    row = np.dtype([(name, np.float64) for name in columns])
    return np.ascontiguousarray(values).view(row)[:, 0]


@dataclass(slots=True)
class Stored:
    """Rows in a file."""

    path: Path
    place: int
    """Where they start [bytes]."""
    shape: tuple[int, int]
    checksum: int

    def __len__(self) -> int:
        return self.shape[0]

    def load(self) -> Array:
        """Read them.

        Raises
        ------
        RunError
            If they are not what was written.
        """
        count = self.shape[0] * self.shape[1]
        try:
            values = np.fromfile(self.path, dtype=np.float64, count=count, offset=self.place)
        except OSError as error:
            raise RunError(f"{self.path}: cannot be read: {error.strerror}") from error
        if values.size != count or zlib.crc32(values.data) != self.checksum:
            raise RunError(f"{self.path}: damaged: it is not what the run has written")
        return values.reshape(self.shape)


class Rows:
    """The rows of a table of one realization, in pieces.

    Pieces are added by the thread of the realization, and put into files by another.

    Attributes
    ----------
    columns
        Numbers in a row.
    pieces
        The rows in their order.
    waiting_bytes
        Memory of the pieces that are in no file.
    """

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.pieces: list[Array | Stored] = []
        self.waiting_bytes = 0
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

    def waiting(self) -> list[tuple[int, Array]]:
        """Pieces that are in no file, with their numbers."""
        with self._lock:
            return [
                (number, one)
                for number, one in enumerate(self.pieces)
                if isinstance(one, np.ndarray)
            ]

    def store(self, number: int, stored: Stored) -> None:
        """A piece is in a file now."""
        with self._lock:
            piece = self.pieces[number]
            if isinstance(piece, np.ndarray):
                self.waiting_bytes -= piece.nbytes
            self.pieces[number] = stored

    def blocks(self, most: int) -> Iterator[Array]:
        """The rows in their order, at most so many at a time."""
        with self._lock:
            pieces = list(self.pieces)
        for piece in pieces:
            values = piece.load() if isinstance(piece, Stored) else piece
            for start in range(0, len(values), most):
                yield values[start : start + most]

    def read(self) -> Array:
        """All rows, shape (rows, columns)."""
        return np.concatenate(
            [np.empty((0, self.columns)), *self.blocks(max(1, len(self)))], dtype=np.float64
        )


class FirstRows:
    """The first rows of a table."""

    def __init__(self, rows: Rows, count: int) -> None:
        self._rows, self._count = rows, count
        self.columns = rows.columns

    def __len__(self) -> int:
        return self._count

    def blocks(self, most: int) -> Iterator[Array]:
        """See `Rows.blocks`."""
        left = self._count
        for block in self._rows.blocks(most):
            if left == 0:
                return
            yield block[:left]
            left -= min(left, len(block))

    def read(self) -> Array:
        """See `Rows.read`."""
        return np.concatenate([np.empty((0, self.columns)), *self.blocks(max(1, self._count))])
