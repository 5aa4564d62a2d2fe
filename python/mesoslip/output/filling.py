"""The values of an output of a run, block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.output.layout import DIMENSIONS, Entry, GroupLayout
from mesoslip.simulation.recorded_tables import BLOCK_NUMBERS as NUMBERS_OF_BLOCK

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]


# Maximum numbers and rows in a block, the part of a table in memory during writing.
BLOCK_NUMBERS = 2**19
BLOCK_ROWS = 2**16


@dataclass(frozen=True)
class Block:
    """Rows of a table, in parts with the indices of their realizations, and the variables of a
    group that they fill.

    The index of the rows in a variable, ``where``, is the realization, if variables have that
    dimension, and a slice that starts at a multiple of `block_rows`.
    """

    group: str
    entries: Mapping[str, Entry]
    where: tuple[Any, ...]
    parts: Sequence[Array]
    owners: Sequence[int]

    def values(self) -> Iterator[tuple[str, tuple[Any, ...], Array]]:
        """The name, index and values of each variable."""
        shape = (sum(map(len, self.parts)), *self.parts[0].shape[1:])
        # Columns are contiguous.
        rows = np.concatenate(self.parts, out=np.empty(shape, order="F"))
        owners = np.repeat(self.owners, [len(part) for part in self.parts])
        for name, entry in self.entries.items():
            assert entry.pick is not None
            where = self.where if entry.is_padded else self.where[-1:]
            yield name, where, entry.pick(rows, owners)


def blocks(results: Results, layout: Mapping[str, GroupLayout]) -> Iterator[Block]:
    """The rows of all tables of an output, each once."""
    longest = int(np.argmax([len(one.rows("trace")) for one in results.realizations]))
    for group, form in layout.items():
        for table in dict.fromkeys(entry.table for entry in form.entries.values() if entry.table):
            of_table = {name: one for name, one in form.entries.items() if one.table == table}
            # The times, which have no dimension realization, are those of the longest trace.
            padded = {name: one for name, one in of_table.items() if one.is_padded}
            for where, parts, owners in _joined(results, table):
                is_whole = len(where) == 1 or where[0] == longest
                entries = of_table if is_whole else padded
                yield Block(group, entries, where, parts, owners)


def row_count(results: Results, layout: Mapping[str, GroupLayout]) -> int:
    """Number of rows of all tables of an output."""
    tables = [
        one
        for form in layout.values()
        for one in dict.fromkeys(entry.table for entry in form.entries.values() if entry.table)
    ]
    return sum(len(each.rows(one)) for each in results.realizations for one in tables)


def reported(
    blocks: Iterable[Block], rows: int, progress: Callable[[float], None]
) -> Iterator[Block]:
    """Blocks, with calls of ``progress`` with the fraction of the rows that came before."""
    done = 0
    for block in blocks:
        yield block
        done += sum(map(len, block.parts))
        progress(done / max(rows, 1))


def block_rows(config: Config, table: str) -> int:
    """Maximum number of rows of a table in memory."""
    width = 1
    if table == "snapshots":
        width = 3 * config.contact_kind.site_count(config.contacts)
    elif table == "layers":
        width = config.slider.layer_count
    elif table == "blocks":
        width = len(NUMBERS_OF_BLOCK) * config.slider.block_count
    return max(1, min(BLOCK_ROWS, BLOCK_NUMBERS // width))


def _joined(
    results: Results, table: str
) -> Iterator[tuple[tuple[Any, ...], list[Array], list[int]]]:
    """Blocks of a table: index in the output, pieces of rows, the realization of each piece.

    Catalogues have the rows of all realizations one after another.
    """
    max_rows, is_ragged = block_rows(results.config, table), table in DIMENSIONS
    start = count = 0
    parts: list[Array] = []
    owners: list[int] = []
    for number, one in enumerate(results.realizations):
        before = () if is_ragged else (number,)
        for piece in one.rows(table).blocks(max_rows):
            remaining = piece
            while len(remaining):
                part, remaining = remaining[: max_rows - count], remaining[max_rows - count :]
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
