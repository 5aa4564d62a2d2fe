"""Files that are parts of one test: one table, and times that go on from part to part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.measured.reading.table import BadCell, Table

DAY = 86_400.0


def joined(tables: Sequence[Table]) -> Table:
    """The rows of all parts, which must have the same columns."""
    first, *others = tables
    if not others:
        return first
    for one in others:
        if (one.headers, one.units) != (first.headers, first.units):
            raise FileError(
                f"{one.path}: has the columns {_names(one)}, and {first.path} has {_names(first)}: "
                "parts of one test have the same columns in the same units"
            )
    bad: dict[int, list[BadCell]] = {}
    for table in tables:
        for column, cells in table.bad.items():
            where = f" (of {table.path.name})"
            named = [one._replace(hint=one.hint + where) for one in cells]
            bad.setdefault(column, []).extend(named)
    return replace(
        first,
        values=np.hstack([one.values for one in tables]),
        lines=np.concatenate([one.lines for one in tables]),
        bad=bad,
        notes=[_of_part(one.path.name, note) for one in tables for note in one.notes],
    )


def continued(time: Array, tables: Sequence[Table], column: int) -> tuple[Array, list[str]]:
    """Times of all rows of parts, and notes on parts whose clock starts again.

    Time stamps of the column of the time are seconds from the first part; those without dates are
    of the day of the part before, or the next one. Other times follow the end of the part before by
    a usual interval.
    """
    time, notes, start = time.copy() if len(tables) > 1 else time, [], 0
    for before, table in pairwise(tables):
        start += before.values.shape[1]
        earlier, rest = time[:start], time[start:]
        clocks = [one.clocks[column] for one in (before, table) if column in one.clocks]
        are_dated = [one.chosen is not None and not one.chosen.is_open for one in clocks]
        begun = clocks[1].start - clocks[0].start if len(clocks) == 2 else math.nan
        if are_dated == [True, True]:
            rest += begun
            continue
        known = rest[np.isfinite(rest)]
        if not known.size or not np.isfinite(earlier).any():
            continue
        if [one.chosen for one in clocks] == [None, None]:
            days = math.ceil((float(np.nanmax(earlier)) - begun - known[0]) / DAY)
            rest += begun + DAY * max(0, days)
            notes.append(
                f"guess: {table.path.name} was recorded within a day after {before.path.name}, as "
                "its time stamps have no dates"
            )
            continue
        if known[0] > np.nanmax(earlier):
            continue
        steps = np.diff(known)
        rest += np.nanmax(earlier) - known[0] + float(np.median(steps[steps > 0]))
        notes.append(
            f"guess: the clock of {table.path.name} starts again: its times follow those of "
            f"{before.path.name}"
        )
    return time, notes


def _of_part(name: str, note: str) -> str:
    """A note of a part with its name; a guess begins as one."""
    rest = note.removeprefix("guess: ")
    return f"{'guess: ' if rest != note else ''}{name}: {rest}"


def _names(table: Table) -> str:
    pairs = zip(table.headers, table.units, strict=True)
    return ", ".join(f"'{name}{f' [{unit}]' if unit else ''}'" for name, unit in pairs)
