"""What a run has recorded, table by table."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mesoslip.errors import RunError
from mesoslip.simulation.kernel import Array
from mesoslip.simulation.recorded_tables import (
    COLUMNS,
    SNAPSHOT_NUMBERS,
    FirstRows,
    Rows,
    structured,
)

# Sentinel: the stretch of a detached contact.
DETACHED = 1e300


class SnapshotRows:
    """Snapshots of the contacts, shape (snapshots, contacts, 3), see `SNAPSHOT_NUMBERS`."""

    def __init__(self, rows: Rows | FirstRows) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def _shaped(self, values: Array) -> Array:
        shaped = values.reshape(len(values), -1, len(SNAPSHOT_NUMBERS))
        return np.where(shaped > DETACHED, np.nan, shaped)

    def blocks(self, most: int) -> Iterator[Array]:
        """The snapshots in their order, at most so many at a time; NaN is a detached contact."""
        for values in self._rows.blocks(most):
            yield self._shaped(values)

    def read(self) -> Array:
        """All snapshots."""
        return self._shaped(self._rows.read())


class Recorded:
    """Rows that a run has recorded, by table."""

    def __init__(self) -> None:
        self._tables: dict[str, Rows] = {}

    def rows(self, table: str) -> Rows | FirstRows | SnapshotRows:
        """Rows recorded in a table, see `TABLES`; no samples of motions that became no slip."""
        rows = self._tables.get(table) or Rows(len(COLUMNS[table]))
        if table == "slip_trace":
            return FirstRows(rows, self._slip_samples(rows))
        if table == "snapshots":
            return SnapshotRows(rows)
        return rows

    def table(self, name: str) -> NDArray[np.void]:
        """Rows recorded in a table up to now, as a structured array with named columns.

        Parameters
        ----------
        name
            "trace", samples at fixed intervals; "slips" and "slip_trace", the finer samples around
            slips; "stages" of the drive that are over; "avalanches"; "snapshot_events", when there
            were snapshots.

        Returns
        -------
        Rows, shape (rows), with the columns that `mesoslip.simulation.recorded_tables` states, in
        SI units.

        Raises
        ------
        RunError
            If there is no such table, or its columns have no names.
        """
        columns = COLUMNS.get(name)
        if not columns:
            known = ", ".join(repr(other) for other, names in COLUMNS.items() if names)
            raise RunError(f"there is no table {name!r} with named columns, but there are {known}")
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
        """The finer samples: those of a trace and the number of the slip."""
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
        """When and where snapshots were taken, columns `SNAPSHOT_COLUMNS`."""
        return self.rows("snapshot_events").read()

    @property
    def snapshots(self) -> Array:
        """The snapshots, shape (snapshots, contacts, 3), numbers `SNAPSHOT_NUMBERS`."""
        return self.rows("snapshots").read()

    def _slip_samples(self, rows: Rows) -> int:
        """Samples of slips in the catalogue: those of a slip that has no end yet come last."""
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
        """Tables, which may hold rows that are in no file."""
        yield from list(self._tables.items())
