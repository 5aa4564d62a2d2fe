"""A table of numbers as in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.measured.reading.stamps import Clock, Order


class BadCell(NamedTuple):
    """A cell that is not a number: its line, its text, and the reason or the fix."""

    line: int
    text: str
    hint: str = ""


@dataclass(frozen=True)
class Table:
    """Columns of numbers."""

    path: Path
    headers: tuple[str, ...]
    units: tuple[str, ...]
    """Units from a line of their own or from attributes; may be empty, as headers may."""
    values: Array
    """Numbers, shape (columns, rows); NaN for missing ones and for cells that are not numbers."""
    lines: NDArray[np.int_]
    """Line of each row, from 1; number of the row in a file that is not text."""
    bad: dict[int, list[BadCell]]
    """Cells that are not numbers, by column."""
    is_text: bool
    notes: Sequence[str]
    """Lines about the file."""
    dates: Order | None = None
    """Order of the dates in its time stamps."""
    clocks: Mapping[int, Clock] = field(default_factory=dict)
    """Those of columns of time stamps."""

    @property
    def row(self) -> str:
        """The word for a row in messages."""
        return "line" if self.is_text else "row"


def listed(numbers: Sequence[object], most: int = 5) -> str:
    """The first of some numbers: "3, 7, 12 and 5 more"."""
    shown = ", ".join(str(one) for one in numbers[:most])
    return shown if len(numbers) <= most else f"{shown} and {len(numbers) - most} more"
