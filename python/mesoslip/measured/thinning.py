"""Fewer samples of a long record: a low-pass and every n-th sample, block by block.

The low-pass is a symmetric filter of finite length (Kaiser's window), flat up to a quarter of the
new rate, and below 1e-4 from half of it on, so that nothing is folded into the record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.measured.columns import Assignment
from mesoslip.measured.missing import sentinels
from mesoslip.measured.reading.table import BadCell, Table
from mesoslip.quantities import number

# Half the length of the filter over the number of samples for each that is kept.
HALF_LENGTH = 10
# Maximum number of samples for each that is kept, with a filter of 160 MB.
MAX_EVERY = 10**6
# Shape of Kaiser's window, and the frequency of half amplitude over half of the new rate.
BETA, CUTOFF = 8.0, 0.75
# Minimum interval of a gap over the usual one, and maximum share of gaps.
MIN_GAP, MAX_GAPS = 1.5, 0.01
# Rounding errors of times, over the interval of the samples that are kept.
ROUNDING = 1e-9


def thinned(
    blocks: Iterator[Table],
    rate: float,
    assigned: Callable[[Table], Assignment],
    missing: Sequence[float] | None = None,
) -> Table:
    """The table of all blocks, with samples at about a rate [1/s] if it has a column of times.

    ``assigned`` finds the used columns of a table; ``missing`` are given numbers for missing ones,
    in columns other than the time.
    """
    first = next(blocks)
    used = assigned(first).used
    if "time" not in used:
        # The rate is that of the samples.
        return _joined([first, *blocks])
    time = used["time"]
    known = first.values[time.index]
    known = known[np.isfinite(known)]
    if known.size < 2 or known[-1] <= known[0]:
        raise FileError(f"{first.path}: its times do not increase; --rate thins a regular record")
    interval = float(known[-1] - known[0]) / (known.size - 1)
    every = round(1 / (rate * interval * time.size))
    if every > MAX_EVERY:
        lowest = number(1 / (MAX_EVERY * interval * time.size), 3)
        raise FileError(f"{first.path}: --rate is too low for its samples: at least {lowest} Hz")
    if every < 2:
        recorded = number(1 / (interval * time.size), 5)
        note = f"not thinned: recorded at {recorded} Hz, less than twice --rate"
        return _joined([first, *blocks], note)
    thinner = _Thinner(time.index, every, _usual_step(known))

    def cleaned() -> Iterator[Table]:
        for table in chain([first], blocks):
            for name, one in used.items():
                found, _ = sentinels(table, one, missing if name != "time" else None)
                table.values[one.index, found] = np.nan
            yield table

    parts = [thinner.feed(one) for one in cleaned()]
    parts.append(thinner.finish())
    kept = _joined([one for one in parts if one is not None])
    note = (
        f"thinned: one of every {every} of {thinner.count} {first.row}s, "
        f"{number(1 / (every * interval * time.size), 5)} Hz, after a low-pass that is flat up to "
        f"{number(1 / (4 * every * interval * time.size), 3)} Hz"
    )
    return replace(kept, notes=[*kept.notes, note])


def _usual_step(time: Array) -> float:
    """Interval of samples, or of times that are rounded."""
    steps = np.diff(time)
    return float(np.median(steps[steps > 0]))


def _joined(tables: list[Table], *notes: str) -> Table:
    """All rows of tables."""
    bad: dict[int, list[BadCell]] = {}
    for one in tables:
        for column, cells in one.bad.items():
            bad.setdefault(column, []).extend(cells)
    return replace(
        tables[0],
        values=np.hstack([one.values for one in tables]),
        lines=np.concatenate([one.lines for one in tables]),
        bad=bad,
        notes=[*dict.fromkeys(note for one in tables for note in one.notes), *notes],
    )


@dataclass
class _Thinner:
    """Filters blocks of rows; the stretches between gaps are filtered each by itself."""

    time: int
    """Index of the column of times."""
    every: int
    step: float
    """Usual interval of times."""
    count: int = 0
    gaps: int = 0
    template: Table | None = None
    rest: Array | None = None
    """Rows that a filter still needs, from the start of the next output's samples on."""
    lines: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))

    def __post_init__(self) -> None:
        from scipy.signal import firwin

        self.half = HALF_LENGTH * self.every
        self.taps: Array = firwin(2 * self.half + 1, CUTOFF / self.every, window=("kaiser", BETA))

    def feed(self, table: Table) -> Table | None:
        """The rows kept of a block, as far as those after it are not needed."""
        self.count += table.values.shape[1]
        time = table.values[self.time]
        whole = np.isfinite(time)
        if not whole.all():
            table = replace(table, values=table.values[:, whole], lines=table.lines[whole])
            time = table.values[self.time]
        self.template = table
        # Rounded times have a longer step where they are larger.
        self.step = _usual_step(time) if time.size > 1 and time[-1] > time[0] else self.step
        before = time[:1] if self.rest is None else self.rest[self.time, -1:]
        steps = np.diff(np.concatenate([before, time]))
        cuts = np.flatnonzero((steps > MIN_GAP * self.step) | (steps < 0))
        self.gaps += cuts.size
        if self.gaps > MAX_GAPS * self.count + 1:
            raise FileError(
                f"{table.path}: {table.row} {table.lines[cuts[-1]]}: the times are uneven: --rate "
                "thins a record at one rate"
            )
        found = []
        for start, end in zip([0, *cuts], [*cuts, time.size], strict=True):
            if start in cuts:
                found.append(self._ended())
            found.append(self._added(table.values[:, start:end], table.lines[start:end]))
        return self._table(found)

    def finish(self) -> Table | None:
        """The last rows."""
        return self._table([self._ended()])

    def _table(self, parts: list[tuple[Array, NDArray[np.int_]]]) -> Table | None:
        values, lines = (np.concatenate(one, axis=-1) for one in zip(*parts, strict=True))
        return None if self.template is None else replace(self.template, values=values, lines=lines)

    def _added(self, values: Array, lines: NDArray[np.int_]) -> tuple[Array, NDArray[np.int_]]:
        if not values.shape[1]:
            return values, lines
        if self.rest is None:
            # At the ends the record is continued by its point reflection.
            mirrored = 2 * values[:, :1] - values[:, self.half : 0 : -1]
            values = np.hstack([mirrored, values])
            lines = np.concatenate([np.full(mirrored.shape[1], lines[0]), lines])
        else:
            values = np.hstack([self.rest, values])
            lines = np.concatenate([self.lines, lines])
        return self._filtered(values, lines)

    def _ended(self) -> tuple[Array, NDArray[np.int_]]:
        if self.rest is None:
            return np.empty(
                (0 if self.template is None else len(self.template.headers), 0)
            ), self.lines
        values, lines = self.rest, self.lines
        mirrored = 2 * values[:, -1:] - values[:, -2 : -2 - self.half : -1]
        found = self._filtered(
            np.hstack([values, mirrored]),
            np.concatenate([lines, np.full(mirrored.shape[1], lines[-1])]),
        )
        self.rest, self.lines = None, self.lines[:0]
        return found

    def _filtered(self, values: Array, lines: NDArray[np.int_]) -> tuple[Array, NDArray[np.int_]]:
        """Outputs whose samples are all there; the rest is kept."""
        from scipy.signal import upfirdn

        every, half = self.every, self.half
        count = max(0, (values.shape[1] - 2 * half - 1) // every + 1)
        self.rest, self.lines = values[:, count * every :], lines[count * every :]
        centres = half + every * np.arange(count)
        if not count:
            return values[:, :0], lines[:0]
        found = np.empty((values.shape[0], count))
        for row, column in zip(values, found, strict=True):
            missing = ~np.isfinite(row)
            if missing.all():
                column[:] = np.nan
                continue
            if missing.any():
                known = np.flatnonzero(~missing)
                row = np.interp(np.arange(row.size), known, row[known])
            column[:] = upfirdn(self.taps, row, 1, every)[2 * HALF_LENGTH :][:count]
            if missing.any():
                # A value of which most samples are missing is missing.
                total = np.concatenate([[0], np.cumsum(missing)])
                low, high = centres - every // 2, centres + (every + 1) // 2
                column[2 * (total[high] - total[low]) > every] = np.nan
        # The sum of the filter has rounding errors at a time of 0.
        time = found[self.time]
        time[np.abs(time) < ROUNDING * every * self.step] = 0.0
        return found, lines[centres]
