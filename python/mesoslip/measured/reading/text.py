"""Tables of text. Regular rows are read by pandas, all others cell by cell; no number is guessed.

Text is read block by block, so that it takes little more memory than its numbers and itself. A row
is regular if it has the usual number of cells and only characters of numbers.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import FileError, shown
from mesoslip.measured.reading.cells import COMMENT, hint_for, is_missing, is_number, split
from mesoslip.measured.reading.layout import Layout, check_decimal_comma, find_layout, header_cells
from mesoslip.measured.reading.stamps import (
    Chosen,
    Clock,
    Order,
    chosen_order,
    date_of,
    dates_of,
    only_order,
    order_of,
    past_midnight,
)
from mesoslip.measured.reading.table import BadCell, Table, listed

# Maximum share of rows with fewer cells than others.
MAX_SHORT = 0.05
# Number of rows before the last one with which its digits are compared.
COMPARED = 20
# Maximum share of rows with fewer decimal points than others that are reported.
MAX_ODD = 1e-3
POINT = "; numbers have a decimal point, and a comma would begin another cell"

NEWLINE = ord("\n")
# Size of the text that is read at once [bytes].
BLOCK = 2**22
# In a number of decimal signs of a line: not a regular row.
NO_SIGNS = 2**16 - 1

Numbers = NDArray[np.int_]


class Lines(Sequence[str]):
    """The lines of a text in UTF-8, decoded when they are asked for."""

    def __init__(self, text: bytes) -> None:
        self.bytes = np.frombuffer(text, np.uint8)
        blocks = range(0, len(text), BLOCK)
        breaks = [np.flatnonzero(self.bytes[at : at + BLOCK] == NEWLINE) + at for at in blocks]
        self.ends: Numbers = np.concatenate([*breaks, [len(text)]])
        """Place of the line break after each line, and of the end of the text."""

    def __len__(self) -> int:
        return len(self.ends)

    def start(self, index: int) -> int:
        """Place of the first byte of a line."""
        return int(self.ends[index - 1]) + 1 if index > 0 else 0

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            return [self[one] for one in range(*index.indices(len(self)))]
        index = range(len(self))[index]
        return self.bytes[self.start(index) : self.ends[index]].tobytes().decode()


def read_text(
    path: Path,
    text: bytes,
    *,
    decimal: str | None = None,
    dates: Order | None = None,
    has_headers: bool = False,
) -> Table:
    """Read a text in UTF-8; see `mesoslip.measured.reading.file.read_file`."""
    lines = Lines(text)
    layout = find_layout(path, lines, decimal, has_headers=has_headers)
    if layout.delimiter != "," and layout.decimal == "," and decimal is None:
        check_decimal_comma(path, lines, layout)
    body = _Body(path, lines, layout, dates, is_ended=text.endswith(b"\n"))
    values, numbers = body.read()
    units = list(layout.units or ("",) * layout.count)
    for column in body.clocks:
        units[column] = "s"
    return Table(
        path,
        layout.headers or ("",) * layout.count,
        tuple(units),
        values,
        numbers,
        body.bad,
        True,
        [*_layout_notes(layout), *body.notes()],
        body.order_of_dates,
        body.clocks,
    )


def _layout_notes(layout: Layout) -> list[str]:
    name = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
    sign = {".": "point", ",": "comma"}[layout.decimal]
    between = f" between {name[layout.delimiter]}" if layout.count > 1 else ""
    columns = f"{layout.count} columns" if layout.count > 1 else "1 column"
    header = "" if layout.headers else ", no header"
    return [f"text: {columns}{between}, decimal {sign}{header}"]


@dataclass
class _Body:
    """The rows of a text, and numbers of notable lines."""

    path: Path
    lines: Lines
    layout: Layout
    dates: Order | None
    """The order of dates, if it is given."""
    is_ended: bool
    bad: dict[int, list[BadCell]] = field(default_factory=dict)
    comments: list[int] = field(default_factory=list)
    restarts: list[int] = field(default_factory=list)
    texts: list[int] = field(default_factory=list)
    short: list[int] = field(default_factory=list)
    empty: list[int] = field(default_factory=list)
    odd: list[int] = field(default_factory=list)
    cut: int | None = None
    above: set[str] = field(default_factory=set)
    clocks: dict[int, Clock] = field(default_factory=dict)
    """Columns of time stamps."""
    stamps: dict[int, Array] = field(default_factory=dict)
    """Their seconds in the lines of a block; NaN where they are not known."""
    top: int = 0
    """Index of the first line of the block."""

    def read(self) -> tuple[Array, Numbers]:
        """Numbers, shape (columns, rows), and the line of each row."""
        layout = self.layout
        # Lines above the numbers may be repeated.
        self.above = {line.strip() for line in self.lines[: layout.first]}
        self.clocks = self._find_clocks()
        count = len(self.lines) - layout.first
        values = np.full((layout.count, count), np.nan)
        is_row = np.zeros(count, dtype=bool)
        signs = np.full(count, NO_SIGNS, dtype=np.uint16)
        for block in self._blocks():
            self._read_block(block, values, is_row, signs)
        for column, clock in self.clocks.items():
            if clock.chosen is None:
                values[column] = past_midnight(values[column])
        self._find_odd(signs)
        self._check_short(int(is_row.sum()))
        self._cut_off(is_row)
        kept = np.flatnonzero(is_row)
        if kept.size and kept[-1] == kept.size - 1:
            return values[:, : kept.size], kept + layout.first + 1
        return values[:, kept], kept + layout.first + 1

    def _blocks(self) -> Iterator[slice]:
        """Blocks of lines below the header; each ends with a line."""
        first, at = self.layout.first, 0
        while at < len(self.lines) - first:
            place = self.lines.start(first + at) + BLOCK
            to = max(at + 1, int(np.searchsorted(self.lines.ends, place)) - first)
            yield slice(at, to)
            at = to

    def _bytes(self, block: slice) -> tuple[NDArray[np.uint8], Numbers, Numbers]:
        """The bytes of a block, and where each of its lines starts and ends in them."""
        first = self.layout.first + block.start
        start = self.lines.start(first)
        ends = self.lines.ends[first : self.layout.first + block.stop] - start
        data = self.lines.bytes[start : start + ends[-1] + 1]
        if len(data) == ends[-1]:
            data = np.append(data, np.uint8(NEWLINE))
        return data, np.concatenate([[0], ends[:-1] + 1]), ends

    def _find_clocks(self) -> dict[int, Clock]:
        """Columns of time stamps, by the first row."""
        layout = self.layout
        for line in islice(self.lines, layout.first, None):
            if not line.strip() or COMMENT.match(line) or self._is_header(line):
                continue
            try:
                cells = split(line, layout.delimiter)[: layout.count]
            except ValueError:
                break
            if any(is_number(cell, layout.decimal) for cell in cells):
                return {
                    column: Clock(self._order_of_dates(column, date) if date else None)
                    for column, cell in enumerate(cells)
                    if (date := date_of(cell)) is not None and Clock().seconds(cell) is not None
                }
        return {}

    @property
    def order_of_dates(self) -> Order | None:
        """The order of the dates, as far as it is known from them or guessed."""
        known = (one.chosen for one in self.clocks.values() if one.chosen is not None)
        return next((one.order for one in known if not one.is_open), None)

    def _order_of_dates(self, column: int, first: str) -> Chosen:
        """The order of the dates of a column, of which the first is known: as given, by the line of
        units, or by all dates."""
        layout = self.layout
        given = self.dates or (order_of(layout.units[column]) if layout.units else None)
        given = given or only_order(first)
        if given is not None:
            return Chosen(given)
        dates: dict[str, None] = {first: None}
        for block in self._blocks():
            data, starts, ends = self._bytes(block)
            _, begins, stops = self._spans(data, starts, ends)
            spans = _inner(data, begins[:, column], stops[:, column])
            dates |= dict.fromkeys(dates_of(data, *spans))
        return chosen_order([*dates])

    def _read_block(
        self, block: slice, values: Array, is_row: NDArray[np.bool], signs: NDArray[np.uint16]
    ) -> None:
        """Read some lines: their numbers, which of them are rows, and their decimal signs."""
        first = self.layout.first + block.start
        self.top = first
        data, starts, ends = self._bytes(block)
        is_regular = np.ones(len(starts), dtype=bool)
        if self.clocks:
            data, is_regular = self._without_stamps(data, starts, ends)
        is_regular &= self._regular(data, starts, ends)
        points = _counts(data == ord(self.layout.decimal), ends)
        signs[block][is_regular] = np.minimum(points[is_regular], NO_SIGNS - 1)
        if is_regular.any():
            values[:, block][:, is_regular] = self._fast(data, starts, ends, is_regular, first)
            for column, seconds in self.stamps.items():
                values[column, block][is_regular] = seconds[is_regular]
        is_row[block] = is_regular
        for at in np.flatnonzero(~is_regular):
            row = self._cells(int(at) + first)
            if row is not None:
                values[:, block.start + at], is_row[block.start + at] = row, True

    def _regular(self, data: NDArray[np.uint8], starts: Numbers, ends: Numbers) -> NDArray[np.bool]:
        """Whether lines have the usual number of cells and only characters of numbers."""
        layout = self.layout
        allowed = np.zeros(256, dtype=bool)
        comma = layout.decimal if layout.delimiter != "," or layout.decimal != "," else "."
        allowed[list(b"0123456789+-eE \n" + (comma + layout.delimiter).encode())] = True
        if layout.delimiter == " ":
            allowed[ord("\t")] = True
        strange = np.flatnonzero(~allowed[data])
        has_strange = np.zeros(len(starts), dtype=bool)
        has_strange[np.searchsorted(ends, strange)] = True
        if layout.delimiter == " ":
            is_blank = _is_blank(data)
            begins = ~is_blank
            begins[1:] &= is_blank[:-1]
            count = _counts(begins, ends)
        else:
            count = 1 + _counts(data == ord(layout.delimiter), ends)
        if layout.count == 1:
            count[ends == starts] = 0
        regular: NDArray[np.bool] = (count == layout.count) & ~has_strange
        return regular

    def _without_stamps(
        self, data: NDArray[np.uint8], starts: Numbers, ends: Numbers
    ) -> tuple[NDArray[np.uint8], NDArray[np.bool]]:
        """A block with zeros for its time stamps, and the lines in which all of them are known, or
        missing, and there are other digits."""
        lines, begins, stops = self._spans(data, starts, ends)
        is_known = np.zeros(len(starts), dtype=bool)
        is_known[lines] = True
        is_stamp = np.zeros(len(data) + 1, dtype=np.int8)
        for column, clock in self.clocks.items():
            first, after = _inner(data, begins[:, column], stops[:, column])
            found = np.full(len(starts), np.nan)
            found[lines] = clock.read(data, first, after)
            self.stamps[column] = found
            known = np.isfinite(found[lines])
            is_known[lines[~known & (first < after)]] = False
            is_stamp[begins[known, column]] += 1
            is_stamp[stops[known, column]] -= 1
        is_stamp = np.cumsum(is_stamp[:-1], dtype=np.int8)
        digits = (data >= ord("0")) & (data <= ord("9")) & (is_stamp == 0)
        is_known &= _counts(digits, ends) > 0
        return np.where(is_stamp > 0, np.uint8(ord("0")), data), is_known

    def _spans(
        self, data: NDArray[np.uint8], starts: Numbers, ends: Numbers
    ) -> tuple[Numbers, Numbers, Numbers]:
        """Lines with the usual number of cells, and where each cell begins and ends, shape (lines,
        columns)."""
        layout = self.layout
        if layout.delimiter == " ":
            is_blank = _is_blank(data)
            before = np.append(True, is_blank[:-1])
            begins, stops = np.flatnonzero(~is_blank & before), np.flatnonzero(is_blank & ~before)
        else:
            cuts = np.flatnonzero(data == ord(layout.delimiter))
            begins, stops = np.sort(np.append(starts, cuts + 1)), np.sort(np.append(ends, cuts))
        last = np.searchsorted(begins, ends, side="right")
        lines = np.flatnonzero(np.diff(last, prepend=0) == layout.count)
        cells = last[lines, np.newaxis] + np.arange(-layout.count, 0)
        return lines, begins[cells], stops[cells]

    def _find_odd(self, signs: NDArray[np.uint16]) -> None:
        """Find rare rows with fewer decimal signs than all others."""
        regular = np.flatnonzero(signs != NO_SIGNS)
        if not regular.size:
            return
        odd = regular[signs[regular] < signs[regular].max()]
        if 0 < len(odd) <= max(1, MAX_ODD * len(regular)):
            self.odd = [int(one) + self.layout.first + 1 for one in odd]

    def _fast(
        self,
        data: NDArray[np.uint8],
        starts: Numbers,
        ends: Numbers,
        is_regular: NDArray[np.bool],
        first: int,
    ) -> Array:
        """Numbers of regular lines of a block, whose first line has an index; shape (columns,
        lines)."""
        import pandas as pd

        layout = self.layout
        kept = data if is_regular.all() else data[np.repeat(is_regular, ends - starts + 1)]
        text = kept.tobytes()
        if layout.decimal == ",":
            text = text.replace(b",", b".")
        try:
            frame = pd.read_csv(
                BytesIO(text),
                sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                header=None,
                names=list(range(layout.count)),
                index_col=False,
                dtype="float64",
                keep_default_na=False,
                na_values=[""],
                quoting=csv.QUOTE_NONE,
                engine="c",
                skip_blank_lines=False,
            )
            values: Array = frame.to_numpy().T
        except ValueError:
            values = np.full((layout.count, 0), np.nan)
        if values.shape[1] != is_regular.sum() or np.isinf(values).any():
            return self._slow(np.flatnonzero(is_regular) + first)
        return values

    def _slow(self, indices: Numbers) -> Array:
        """Numbers of regular lines in which a cell, such as "1-5", is not a number."""
        rows = [self._cells(int(one)) for one in indices]
        none = [math.nan] * self.layout.count
        return np.array([none if row is None else row for row in rows]).T

    def _cells(self, index: int) -> list[float] | None:
        """Numbers of one line; None if it is not a row."""
        line, number, layout = self.lines[index], index + 1, self.layout
        if not line.strip():
            return None
        if COMMENT.match(line) or (line.lstrip()[0] == ";" and layout.delimiter != ";"):
            cells = line.lstrip("#%/!*; \t").split(
                None if layout.delimiter == " " else layout.delimiter
            )
            is_row = len(cells) == layout.count and all(
                is_number(cell.strip(), layout.decimal) for cell in cells
            )
            (self.texts if is_row else self.comments).append(number)
            return None
        try:
            cells = split(line, layout.delimiter)
        except ValueError as error:
            raise FileError(f"{self.path}: line {number}: cannot be read: {error}") from None
        if self._is_header(line):
            self.restarts.append(number)
            return None
        numbers = [is_number(cell, layout.decimal) for cell in cells]
        if not any(numbers):
            is_empty = all(is_missing(cell) for cell in cells)
            (self.empty if is_empty else self.texts).append(number)
            return None
        if len(cells) > layout.count and any(cells[layout.count :]):
            self._refuse_long(number, cells)
        if len(cells) < layout.count:
            self.short.append(number)
            return None
        return [self._number(number, *one) for one in enumerate(cells[: layout.count])]

    def _number(self, line: int, column: int, cell: str) -> float:
        """The number of a cell; NaN without one."""
        decimal = self.layout.decimal
        clock = self.clocks.get(column)
        if clock is not None:
            seconds = self.stamps[column][line - 1 - self.top]
            if math.isnan(seconds):
                seconds = clock.seconds(cell)
            if seconds is not None:
                return float(seconds)
        if clock is None and is_number(cell, decimal):
            value = float(cell.replace(",", "."))
            if math.isfinite(value):
                return value
            self.bad.setdefault(column, []).append(BadCell(line, cell, ", is too large"))
        elif not is_missing(cell):
            hint = hint_for(cell, decimal)
            if clock is not None and clock.chosen is not None and date_of(cell):
                hint = f", nor a date as {clock.chosen.name} (--dates)"
            self.bad.setdefault(column, []).append(BadCell(line, cell, hint))
        return math.nan

    def _is_header(self, line: str) -> bool:
        """Whether a line repeats the header or the units, as an instrument does that restarts."""
        layout = self.layout
        if layout.headers is None:
            return False
        if line.strip() in self.above:
            return True
        cells = header_cells(line, layout.delimiter, layout.decimal, layout.count)
        return cells is not None and cells in {layout.headers, layout.units}

    def _refuse_long(self, number: int, cells: Sequence[str]) -> None:
        usual = self.layout.count
        under = f"{usual} headers" if self.layout.headers else f"{usual} cells of other lines"
        hint = POINT if self.layout.delimiter == "," else ""
        raise FileError(
            f"{self.path}: line {number}: has {len(cells)} cells under {under}: column "
            f"{usual + 1} is {shown(cells[usual])}{hint}"
        )

    def _check_short(self, rows: int) -> None:
        if len(self.short) <= max(3, MAX_SHORT * rows):
            return
        number = self.short[0]
        count = len(split(self.lines[number - 1], self.layout.delimiter))
        raise FileError(
            f"{self.path}: line {number}: has {count} cells, where other lines have "
            f"{self.layout.count}, and so have {len(self.short)} lines: which column is missing "
            "is unknown; write a missing cell as nan"
        )

    def _cut_off(self, is_row: NDArray[np.bool]) -> None:
        """Leave out the last row if it may be cut within its last number."""
        layout, rows = self.layout, np.flatnonzero(is_row)
        if self.is_ended or len(rows) < 3 or rows[-1] + layout.first != len(self.lines) - 1:
            return
        last, *others = (
            _digits(split(self.lines[one + layout.first], layout.delimiter)[-1], layout.decimal)
            for one in rows[: -COMPARED - 1 : -1]
        )
        if last < min(others):
            is_row[rows[-1]] = False
            self.cut = int(rows[-1]) + layout.first + 1

    def notes(self) -> list[str]:
        """Lines about the rows."""
        found = [
            (self.comments, "comments"),
            (self.restarts, "the header again, as of an instrument that restarts"),
            (self.empty, "rows without a number, left out"),
            (self.short, "rows that stop short, left out"),
            (self.odd, "rows with fewer decimal signs than all others: are they damaged?"),
        ]
        notes = [
            f"line{'s' if len(lines) > 1 else ''} {listed(lines)}: {what}"
            for lines, what in found
            if lines
        ]
        for column, clock in self.clocks.items():
            chosen = clock.chosen
            guess, order = "", ""
            if chosen is not None and chosen.is_guess:
                guess, order = "guess: ", f", dates as {chosen.name} (--dates)"
            notes.append(
                f"{guess}column {column + 1}: time stamps, as seconds from {clock.first}{order}"
            )
        for number in self.texts[:3]:
            notes.append(f"line {number}: text, left out: {shown(self.lines[number - 1].strip())}")
        if len(self.texts) > 3:
            notes.append(f"lines {listed(self.texts[3:])}: text too, left out")
        if self.cut is not None:
            notes.append(f"line {self.cut}: the last row seems to be cut short, left out")
        return notes


def _is_blank(data: NDArray[np.uint8]) -> NDArray[np.bool]:
    """Which bytes are between cells, or lines, of a table with blanks between its cells."""
    is_blank: NDArray[np.bool] = (data == ord(" ")) | (data == ord("\t")) | (data == NEWLINE)
    return is_blank


def _inner(data: NDArray[np.uint8], first: Numbers, after: Numbers) -> tuple[Numbers, Numbers]:
    """Where cells begin and end without the blanks and the quotes around them."""

    is_around = (data == ord(" ")) | (data == ord('"'))
    first, after = first.copy(), after.copy()
    while (outside := (first < after) & is_around[first]).any():
        first[outside] += 1
    while (outside := (first < after) & is_around[after - 1]).any():
        after[outside] -= 1
    return first, after


def _counts(is_there: NDArray[np.bool], ends: Numbers) -> Numbers:
    """Number of marked bytes in each line."""
    before = np.searchsorted(np.flatnonzero(is_there), ends)
    return np.diff(before, prepend=0)


def _digits(cell: str, decimal: str) -> tuple[int, int]:
    """Digits of the exponent and of the decimals of a number."""
    mantissa, _, exponent = cell.lower().partition("e")
    return len(exponent.lstrip("+-")), len(mantissa.partition(decimal)[2])
