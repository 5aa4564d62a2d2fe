"""The values of an output of a run, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mesoslip.output.layout import DIMENSIONS, GroupLayout
from mesoslip.output.results import RunResults

Array = NDArray[Any]


class Values(Protocol):
    """The destination of a variable: an array, or a variable of a file."""

    def __setitem__(self, where: Any, values: Any) -> None: ...


# Numbers in a block of rows, the part of a table in memory during writing.
BLOCK_NUMBERS = 2**19

BLOCK_ROWS = 2**16


def longest(results: RunResults) -> int:
    """Index of the realization with the longest trace, which has the times of all."""
    return int(np.argmax([len(one.rows("trace")) for one in results.realizations]))


def fill(
    results: RunResults,
    layout: Mapping[str, GroupLayout],
    destinations: Mapping[str, Mapping[str, Values]],
) -> None:
    """Copy the values of an output, block by block, to their destinations by group and name."""
    timekeeper = longest(results)
    for group, form in layout.items():
        for name, entry in form.entries.items():
            if not entry.table and np.size(entry.values):
                destinations[group][name][...] = np.asarray(entry.values, dtype=entry.dtype)
        for table in dict.fromkeys(entry.table for entry in form.entries.values() if entry.table):
            of_table = {name: one for name, one in form.entries.items() if one.table == table}
            pieces = _ragged(results, table) if table in DIMENSIONS else _padded(results, table)
            for where, rows, owners in pieces:
                for name, entry in of_table.items():
                    assert entry.pick is not None
                    index = where if entry.is_padded else where[-1:]
                    # The times are those of the longest trace.
                    if entry.is_padded or len(where) == 1 or where[0] == timekeeper:
                        values = entry.pick(rows, owners)
                        destinations[group][name][index] = values.astype(entry.dtype, copy=False)


def _block_rows(results: RunResults, table: str) -> int:
    """Maximum number of rows of a table in memory."""
    width = 1
    if table == "snapshots":
        width = 3 * results.config.contacts.count
    elif table == "layers":
        width = results.config.slider.layer_count
    return max(1, min(BLOCK_ROWS, BLOCK_NUMBERS // width))


def _padded(results: RunResults, table: str) -> Iterator[tuple[tuple[Any, ...], Array, Array]]:
    """Blocks of a table by realization: index in the output, rows, their realizations."""
    for number, one in enumerate(results.realizations):
        start = 0
        for rows in one.rows(table).blocks(_block_rows(results, table)):
            yield (number, slice(start, start + len(rows))), rows, np.full(len(rows), number)
            start += len(rows)


def _ragged(results: RunResults, table: str) -> Iterator[tuple[tuple[Any, ...], Array, Array]]:
    """Blocks of a table, with short realizations joined: index, rows, their realizations."""
    max_rows, start = _block_rows(results, table), 0
    held: list[Array] = []
    owners: list[Array] = []
    count = 0

    def piece() -> tuple[tuple[Any, ...], Array, Array]:
        where = (slice(start, start + count),)
        return where, np.concatenate(held), np.concatenate(owners)

    for number, one in enumerate(results.realizations):
        for block in one.rows(table).blocks(max_rows):
            left = block
            while len(left):
                part, left = left[: max_rows - count], left[max_rows - count :]
                held.append(part)
                owners.append(np.full(len(part), number))
                count += len(part)
                if count == max_rows:
                    yield piece()
                    start, count = start + count, 0
                    held.clear()
                    owners.clear()
    if count:
        yield piece()
