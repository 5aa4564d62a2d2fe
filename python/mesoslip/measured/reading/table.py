"""A table of numbers as a file has it, before anything is known of its columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BadCell(NamedTuple):
    """A cell that is not a number: its line, its text, and why or what would be right."""

    line: int
    text: str
    hint: str = ""


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Attributes
    ----------
    path
        The file.
    headers
        Headers of the columns; empty texts without one.
    units
        Units from a line of their own or from attributes; empty texts without one.
    values
        Numbers, shape (columns, rows); NaN where one is missing or is not a number.
    lines
        Number of the line of each row, from 1; in files that are not text its number.
    bad
        Cells that are not numbers, by column.
    has_header
        Whether the file has headers.
    is_text
        Whether it is a text file.
    notes
        Lines about what was found and what was left out.
    """

    path: Path
    headers: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    lines: NDArray[np.int_]
    bad: dict[int, list[BadCell]]
    has_header: bool
    is_text: bool
    notes: Sequence[str] = field(default=())

    @property
    def row(self) -> str:
        """The word for a row in messages."""
        return "line" if self.is_text else "row"


def listed(numbers: Sequence[object], most: int = 5) -> str:
    """The first of some numbers: "3, 7, 12 and 5 more"."""
    shown = ", ".join(str(one) for one in numbers[:most])
    return shown if len(numbers) <= most else f"{shown} and {len(numbers) - most} more"
