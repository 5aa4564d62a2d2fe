"""The values of an output of a run, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.output.layout import DIMENSIONS, Entry, GroupLayout

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]


# Numbers in a block of rows, the part of a table in memory during writing.
BLOCK_NUMBERS = 2**19

BLOCK_ROWS = 2**16


def longest(results: Results) -> int:
    """Index of the realization with the longest trace, which has the times of all."""
    return int(np.argmax([len(one.rows("trace")) for one in results.realizations]))


@dataclass(frozen=True)
class Block:
    """Rows of a table, and the variables of a group that they fill.

    Attributes
    ----------
    group
        Name of the group.
    entries
        The variables by name.
    where
        Index of the rows in a variable: the realization, if the variables have that dimension, and
        a slice that starts at a multiple of `block_rows`.
    """

    group: str
    entries: Mapping[str, Entry]
    where: tuple[Any, ...]
    parts: Sequence[Array]
    owners: Sequence[int]

    def values(self) -> Iterator[tuple[str, tuple[Any, ...], Array]]:
        """Each variable with its name, the index and the values."""
        shape = (sum(map(len, self.parts)), *self.parts[0].shape[1:])
        # The values of a column lie side by side.
        rows = np.concatenate(self.parts, out=np.empty(shape, order="F"))
        owners = np.repeat(self.owners, [len(part) for part in self.parts])
        for name, entry in self.entries.items():
            assert entry.pick is not None
            where = self.where if entry.is_padded else self.where[-1:]
            yield name, where, entry.pick(rows, owners)


def fill(
    results: Results,
    layout: Mapping[str, GroupLayout],
    destinations: Mapping[str, Mapping[str, Array]],
) -> None:
    """Copy the values of an output to their destinations by group and name."""
    for group, form in layout.items():
        for name, entry in form.entries.items():
            if not entry.table and np.size(entry.values):
                destinations[group][name][...] = np.asarray(entry.values, dtype=entry.dtype)
    for block in blocks(results, layout):
        for name, where, values in block.values():
            destinations[block.group][name][where] = values


def blocks(results: Results, layout: Mapping[str, GroupLayout]) -> Iterator[Block]:
    """The rows of all tables of an output; each block is there once."""
    timekeeper = longest(results)
    for group, form in layout.items():
        for table in dict.fromkeys(entry.table for entry in form.entries.values() if entry.table):
            of_table = {name: one for name, one in form.entries.items() if one.table == table}
            # The times are those of the longest trace.
            padded = {name: one for name, one in of_table.items() if one.is_padded}
            for where, parts, owners in _joined(results, table):
                is_whole = len(where) == 1 or where[0] == timekeeper
                entries = of_table if is_whole else padded
                yield Block(group, entries, where, parts, owners)


def block_rows(config: Config, table: str) -> int:
    """Maximum number of rows of a table in memory."""
    width = 1
    if table == "snapshots":
        width = 3 * config.contacts.count
    elif table == "layers":
        width = config.slider.layer_count
    return max(1, min(BLOCK_ROWS, BLOCK_NUMBERS // width))


def _joined(
    results: Results, table: str
) -> Iterator[tuple[tuple[Any, ...], list[Array], list[int]]]:
    """Blocks of a table: index in the output, pieces of rows, the realization of each piece.

    Short realizations are joined in tables of all realizations, and apart in the others.
    """
    max_rows, is_ragged = block_rows(results.config, table), table in DIMENSIONS
    start = count = 0
    parts: list[Array] = []
    owners: list[int] = []
    for number, one in enumerate(results.realizations):
        before = () if is_ragged else (number,)
        for piece in one.rows(table).blocks(max_rows):
            left = piece
            while len(left):
                part, left = left[: max_rows - count], left[max_rows - count :]
                parts.append(part)
                owners.append(number)
                count += len(part)
                if count == max_rows:
                    yield (*before, slice(start, start + count)), parts, owners
                    start, count, parts, owners = start + count, 0, [], []
        is_last = number == len(results.realizations) - 1
        if count and (is_last or not is_ragged):
            yield (*before, slice(start, start + count)), parts, owners
        if not is_ragged:
            start, count, parts, owners = 0, 0, [], []
