"""The values of an output of a run, block by block."""

from __future__ import annotations

import math
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
    group that they fill at the index ``where``.

    It is a slice of each dimension that belongs to realizations and rows, and begins where a chunk
    does, see `chunk_shape`.
    """

    group: str
    entries: Mapping[str, Entry]
    where: tuple[slice, ...]
    parts: Sequence[Array]
    owners: Sequence[int]

    def values(self) -> Iterator[tuple[str, tuple[slice, ...], Array]]:
        """The name, index and values of each variable."""
        lengths = [len(part) for part in self.parts]
        shape = (sum(lengths), *self.parts[0].shape[1:])
        # Columns are contiguous.
        rows = np.concatenate(self.parts, out=np.empty(shape, order="F"))
        owners = np.repeat(self.owners, lengths)
        place = self._place(owners)
        for name, entry in self.entries.items():
            assert entry.pick is not None
            values = entry.pick(rows, owners)
            yield name, self.where, values if len(self.where) == 1 else place(values)

    def _place(self, owners: Array) -> Callable[[Array], Array]:
        """How values of the rows become those of realizations and times, NaN after the last."""
        shape = tuple(one.stop - one.start for one in self.where)
        if len(owners) == math.prod(shape):
            return lambda values: values.reshape(*shape, *values.shape[1:])
        number = owners - self.where[0].start
        first = np.searchsorted(number, np.arange(shape[0]))
        where = number, np.arange(len(number)) - first[number]

        def place(values: Array) -> Array:
            padded = np.full((*shape, *values.shape[1:]), np.nan)
            padded[where] = values
            return padded

        return place


def blocks(results: Results, layout: Mapping[str, GroupLayout]) -> Iterator[Block]:
    """The rows of all tables of an output, each once; those of times twice."""
    for group, form in layout.items():
        for table, of_table in _by_table(form).items():
            padded = {name: one for name, one in of_table.items() if one.is_padded}
            others = {name: one for name, one in of_table.items() if not one.is_padded}
            if padded:
                for where, parts, owners in _padded(results, table, layout[""].sizes["time"]):
                    yield Block(group, padded, where, parts, owners)
            if others:
                pieces = _pieces(results, table, _owners(results, is_of_times=bool(padded)))
                for along, parts, owners in _cut(pieces, block_rows(results.config, table)):
                    yield Block(group, others, (along,), parts, owners)


def row_count(results: Results, layout: Mapping[str, GroupLayout]) -> int:
    """Number of rows of all blocks of an output."""
    count = 0
    for form in layout.values():
        for table, entries in _by_table(form).items():
            if table in DIMENSIONS:
                count += form.sizes[DIMENSIONS[table]]
                continue
            count += sum(len(one.rows(table)) for one in results.realizations)
            if not all(one.is_padded for one in entries.values()):
                count += layout[""].sizes["time"]
    return count


def _by_table(form: GroupLayout) -> dict[str, dict[str, Entry]]:
    """The variables of a group that are filled by rows, by table."""
    found: dict[str, dict[str, Entry]] = {}
    for name, one in form.entries.items():
        if one.table:
            found.setdefault(one.table, {})[name] = one
    return found


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


def chunk_shape(config: Config, table: str, samples: int) -> tuple[int, int]:
    """Realizations and samples of a chunk of a table: many realizations, or a part of one."""
    rows = block_rows(config, table)
    return (max(1, rows // max(samples, 1)), min(rows, samples))


def _owners(results: Results, *, is_of_times: bool) -> Iterable[int]:
    """Numbers of all realizations; for times, which have no realization, of the longest trace."""
    if not is_of_times:
        return range(len(results.realizations))
    return [int(np.argmax([len(one.rows("trace")) for one in results.realizations]))]


def _pieces(results: Results, table: str, numbers: Iterable[int]) -> Iterator[tuple[int, Array]]:
    """The rows of a table of some realizations in pieces, each with its realization."""
    max_rows = block_rows(results.config, table)
    for number in numbers:
        rows = results.realizations[number].rows(table)
        if len(rows):
            for piece in rows.blocks(max_rows):
                yield number, piece


# Rows: their slice, pieces, and the realization of each piece.
Cut = tuple[slice, list[Array], list[int]]


def _cut(pieces: Iterable[tuple[int, Array]], max_rows: int) -> Iterator[Cut]:
    """Pieces of rows one after another, cut where a number of rows is reached."""
    start = count = 0
    parts: list[Array] = []
    owners: list[int] = []
    for number, piece in pieces:
        remaining = piece
        if count + len(piece) < max_rows:
            parts.append(piece)
            owners.append(number)
            count += len(piece)
            continue
        while len(remaining):
            part, remaining = remaining[: max_rows - count], remaining[max_rows - count :]
            parts.append(part)
            owners.append(number)
            count += len(part)
            if count == max_rows:
                yield slice(start, start + count), parts, owners
                start, count, parts, owners = start + count, 0, [], []
    if count:
        yield slice(start, start + count), parts, owners


def _padded(
    results: Results, table: str, samples: int
) -> Iterator[tuple[tuple[slice, slice], list[Array], list[int]]]:
    """Blocks of a table with a row for each time; see `chunk_shape`."""
    together, length = chunk_shape(results.config, table, samples)
    total = len(results.realizations)
    for first in range(0, total, together):
        numbers = range(first, min(first + together, total))
        for along, parts, owners in _cut(_pieces(results, table, numbers), together * length):
            where = slice(0, samples) if together > 1 else along
            yield (slice(numbers.start, numbers.stop), where), parts, owners
