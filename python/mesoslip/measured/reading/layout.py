"""The layout of a text: its delimiter, decimal sign, header, and line of units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from mesoslip.errors import FileError, shown
from mesoslip.measured.headers import BRACKETS, read_header
from mesoslip.measured.reading.cells import (
    COMMENT,
    DELIMITERS,
    is_missing,
    is_number,
    may_group,
    split,
)
from mesoslip.measured.reading.stamps import STAMP_FORM
from mesoslip.measured.units import is_unit

# Number of lines from which the layout is found.
SAMPLE = 200
# Score of a header with the same delimiter.
HEADER_SCORE = 0.2
# Maximum number of lines from the header to the numbers.
MAX_HEADER_LINES = 200
# Minimum share of the lines, and of the cells, that fit a layout.
MIN_SCORE = 0.3
# A name with a unit in brackets, as one cell among blanks.
WORD = re.compile(r"[^\s\[({]+(?:\s*[\[({][^\])}]*[\])}])?|[\[({][^\])}]*[\])}]")
# Units of quantities that are not used, in lower case.
OTHER_UNITS = {"°c", "degc", "deg c", "c", "k", "°f", "%rh", "% rh", "a", "ma", "w", "db", "ohm"}
MARKERS = "#%/!*;'\" \t"


@dataclass(frozen=True)
class Layout:
    """The layout of a table in a text."""

    delimiter: str
    """Separator of cells; a space stands for any number of blanks."""
    decimal: str
    """Decimal sign."""
    count: int
    """Number of cells in a row."""
    first: int
    """Index of the first line below the header."""
    headers: tuple[str, ...] | None
    units: tuple[str, ...] | None
    """Cells of a line of units below the header."""


@dataclass(frozen=True)
class _Guess:
    """A delimiter and a decimal sign, and how well they fit a sample of lines."""

    score: float
    count: int
    delimiter: str
    decimal: str
    is_numeric: tuple[bool, ...]
    """Whether each column has numbers."""


def find_layout(
    path: Path, lines: Sequence[str], decimal: str | None, *, has_headers: bool = False
) -> Layout:
    """Find the layout of a text; see `mesoslip.measured.reading.file.read_file`."""
    number = next((one for one, line in enumerate(lines) if line.strip()), None)
    if number is None:
        raise FileError(f"{path}: is empty; expected columns with units, such as 'time [s]'")
    guess = _best_guess(lines, decimal)
    if guess is None:
        raise FileError(
            f"{path}: line {number + 1}: {shown(lines[number].strip())}: no columns of numbers "
            "begin here or below"
        )
    data = _first_row(lines, guess)
    found = _header(lines, data, guess)
    if found is None and not has_headers:
        _refuse_header(path, lines, data, guess)
    # Without a header, lines above the numbers are left out with a note, except damaged rows.
    first, headers, units = found or (0, None, None)
    return Layout(guess.delimiter, guess.decimal, guess.count, first, headers, units)


def _refuse_header(path: Path, lines: Sequence[str], data: int, guess: _Guess) -> None:
    """Refuse a text without a header, or with one that does not fit its numbers."""
    above = next((one for one in range(data - 1, -1, -1) if lines[one].strip()), None)
    right = "give headers with --columns, such as 'time [s], force [uN], -'"
    if above is None:
        raise FileError(
            f"{path}: line {data + 1}: has no header such as 'time [s], force [uN]' for its "
            f"{guess.count} columns; {right}"
        )
    text = lines[above].strip()
    hint = ""
    if guess.delimiter == "," and guess.count % 2 == 0 and text.count(",") + 1 == guess.count // 2:
        hint = "; if the numbers have decimal commas, another delimiter is needed in the file"
    raise FileError(
        f"{path}: line {above + 1}: {shown(text)} is no header of the {guess.count} columns that "
        f"begin on line {data + 1}; {right}{hint}"
    )


def _sampled(lines: Sequence[str]) -> list[str]:
    """Lines from all parts of a text except its beginning, without comments and empty lines."""
    start = min(len(lines) // 5, MAX_HEADER_LINES)
    picked = np.unique(np.linspace(start, len(lines) - 1, SAMPLE).astype(int))
    chosen = [lines[one] for one in picked]
    return [line for line in chosen if line.strip() and not COMMENT.match(line)] or [
        line for line in lines if line.strip()
    ]


def _best_guess(lines: Sequence[str], decimal: str | None) -> _Guess | None:
    sample = _sampled(lines)
    guesses = [
        guess
        for delimiter in DELIMITERS
        for sign in (".", ",")
        if (delimiter, sign) != (",", ",") and sign == (decimal or sign)
        for guess in _guess(sample, delimiter, sign)
    ]
    # Quoted numbers may have decimal commas in a file with commas between cells.
    if decimal != "." and any('"' in line for line in sample):
        guesses += _guess(sample, ",", ",")
    guesses = [one for one in guesses if one.score >= MIN_SCORE]
    return max(
        guesses,
        key=lambda one: (round(one.score, 2) + HEADER_SCORE * _fits_header(lines, one), one.count),
        default=None,
    )


def _fits_header(lines: Sequence[str], guess: _Guess) -> bool:
    """Whether a line above the numbers has as many cells with the same delimiter."""
    if guess.delimiter == " ":
        return False
    data = _first_row(lines, guess)
    above = [one for one in lines[max(0, data - MAX_HEADER_LINES) : data] if one.strip()][-3:]
    for line in above:
        try:
            cells = split(line.strip(MARKERS.replace("\t", "")), guess.delimiter)
        except ValueError:
            continue
        if 1 < len(cells) == guess.count and not any(is_number(one, ".") for one in cells):
            return True
    return False


def _guess(sample: Sequence[str], delimiter: str, decimal: str) -> Iterator[_Guess]:
    """How well a delimiter and a decimal sign fit, unless there are no numbers."""
    rows = []
    for line in sample:
        try:
            rows.append(split(line, delimiter))
        except ValueError:
            continue
    counts = Counter(len(row) for row in rows)
    if not counts:
        return
    count, times = counts.most_common(1)[0]
    fitting = [row for row in rows if len(row) == count]
    numbers = np.array([[is_number(cell, decimal) for cell in row] for row in fitting])
    missing = np.array([[is_missing(cell) for cell in row] for row in fitting])
    if not numbers.any():
        return
    fits = numbers | missing
    # A column may have words, such as states of a machine.
    is_numeric = fits.mean(axis=0) > 0.5
    is_numeric &= numbers.any(axis=0) | ~missing.all(axis=0)
    score = times / len(sample) * float(fits.mean())
    yield _Guess(score, count, delimiter, decimal, tuple(bool(one) for one in is_numeric))


def _is_row(line: str, guess: _Guess) -> bool:
    """Whether a line is a row of numbers."""
    try:
        cells = split(line, guess.delimiter)
    except ValueError:
        return False
    numbers = [is_number(cell, guess.decimal) for cell in cells]
    return (
        len(cells) == guess.count
        and any(numbers)
        and all(
            number or is_missing(cell) or not numeric
            for number, cell, numeric in zip(numbers, cells, guess.is_numeric, strict=True)
        )
    )


def _first_row(lines: Sequence[str], guess: _Guess) -> int:
    """Index of the first row of numbers."""
    return next((one for one, line in enumerate(lines) if _is_row(line, guess)), len(lines))


def _header(
    lines: Sequence[str], data: int, guess: _Guess
) -> tuple[int, tuple[str, ...], tuple[str, ...] | None] | None:
    """The index of the line below the header, the header nearest to the numbers, and its units."""
    above = [
        one
        for one in range(data - 1, max(-1, data - 1 - MAX_HEADER_LINES), -1)
        if lines[one].strip()
    ]
    for position, one in enumerate(above):
        cells = header_cells(lines[one], guess.delimiter, guess.decimal, guess.count)
        if cells is None:
            continue
        if _are_units(cells):
            for other in above[position + 1 : position + 3]:
                names = header_cells(lines[other], guess.delimiter, guess.decimal, guess.count)
                if names is not None and not _are_units(names):
                    return one + 1, names, cells
        return one + 1, cells, _labelled_units(lines, above, guess)
    return None


def _labelled_units(
    lines: Sequence[str], above: Sequence[int], guess: _Guess
) -> tuple[str, ...] | None:
    """Units of the columns but the first from the preamble of LabVIEW, if it has them."""
    line = next((lines[one] for one in above if lines[one].startswith("Y_Unit_Label")), None)
    cells = [] if line is None else split(line, guess.delimiter)
    return ("", *cells[1 : guess.count]) if len(cells) >= guess.count else None


def _are_units(cells: Sequence[str]) -> bool:
    """Whether cells are units, perhaps of quantities that are not used, or empty."""
    bare = [cell.strip("[](){}<> ") for cell in cells]
    return any(is_unit(cell) for cell in bare) and all(
        is_unit(cell)
        or is_missing(cell)
        or cell.lower() in OTHER_UNITS
        or STAMP_FORM.fullmatch(cell)
        for cell in bare
    )


def header_cells(line: str, delimiter: str, decimal: str, count: int) -> tuple[str, ...] | None:
    """Cells of a line, or comment, as a header of a number of columns; None if it is not one."""
    bare = line.lstrip(MARKERS) if COMMENT.match(line) else line.lstrip(" ")
    for cells in _splittings(bare, delimiter):
        # LabVIEW has a column of comments, of which most rows have none.
        if len(cells) == count + 1 and cells[-1].lower() in {"", "comment"}:
            cells = cells[:-1]
        # The mark of a comment may have the place of the unit of the first column.
        if len(cells) == count - 1 and COMMENT.match(line) and _are_units(cells):
            cells = ["", *cells]
        if len(cells) != count or not any(cells):
            continue
        # Units may have a 1.
        numbers = [cell for cell in cells if is_number(cell, decimal)]
        if len(numbers) == len(cells) or any(cell != "1" for cell in numbers):
            continue
        return tuple(cells)
    return None


def _splittings(line: str, delimiter: str) -> Iterator[list[str]]:
    """Divisions of a header into cells; a single one if it has a delimiter."""
    if delimiter.strip(" ") and delimiter in line:
        with suppress(ValueError):
            yield split(line, delimiter)
        return
    line = line.strip()
    wide = [cell.strip(" ,;") for cell in re.split(r"\s{2,}|\t", line)]
    words = [cell.strip(" ,;") for cell in WORD.findall(line)]
    if len(wide) > 1:
        yield wide
        # There may be one blank or more between names of one word.
        if all(read_header(one).quantity or BRACKETS.search(one) for one in words):
            yield words
        return
    for other in DELIMITERS[:-1]:
        if other in line:
            yield [cell.strip(" \"'") for cell in line.split(other)]
            return
    yield words
    yield line.split()


def check_decimal_comma(path: Path, lines: Sequence[str], layout: Layout) -> None:
    """Check that commas in numbers are decimal: at least one of them cannot group digits."""
    example = None
    for number, line in enumerate(islice(lines, layout.first, None), layout.first + 1):
        if "," not in line:
            continue
        try:
            cells = split(line, layout.delimiter)
        except ValueError:
            continue
        for column, cell in enumerate(cells):
            if "," in cell and is_number(cell, ","):
                if not may_group(cell):
                    return
                example = example or (number, column, cell)
    if example is None:
        return
    number, column, cell = example
    name = layout.headers[column] if layout.headers else f"column {column + 1}"
    raise FileError(
        f"{path}: line {number}: {name}: {cell!r} may be {cell.replace(',', '.')} or "
        f"{cell.replace(',', '')}; give --decimal ',' (or decimal = \",\" in [trace]) if its comma "
        "is a decimal one; otherwise take the commas out of the file"
    )
