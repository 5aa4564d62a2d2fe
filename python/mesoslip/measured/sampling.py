"""Samples at any times: their order, rates and gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.measured.reading.table import listed
from mesoslip.quantities import number, with_unit

Numbers = NDArray[np.int_]

# Minimum interval of a gap, over the usual one around it.
MIN_GAP = 1.5
# Number of intervals on each side in the median that is the usual interval.
AROUND = 15
# Maximum ratio of intervals at one rate.
SAME_RATE = 1.3
# Minimum number of samples at one rate.
MIN_SAMPLES = 20
# Maximum number of steps back of times.
MAX_STEPS_BACK = 1000
# Maximum number of blocks among which a late block belongs.
MAX_CROSSED = 2
# Minimum share and number of samples with the time of the one before, if times are rounded.
MIN_ROUNDED = 0.1
MIN_ROUNDED_COUNT = 10
# Minimum share of rows of a block, among those up to the latest time before it, that repeat earlier
# ones.
MIN_REPEATED = 0.5
SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")
# Maximum number of rates that a summary names one by one.
MAX_RATES = 3
# Maximum number of rows and gaps in a note.
NAMED = 5


@dataclass(frozen=True)
class Order:
    """Indices of the used samples in the order of their times [s], and notes about them."""

    rows: Numbers
    time: Array
    notes: list[str]


def in_order(
    path: Path, time: Array, values: Sequence[Array], lines: Numbers, part: int | None, row: str
) -> Order:
    """Put samples into the order of their times [s].

    Rows that were written twice, with the same values of all quantities, are used once; blocks that
    were written late are put where they belong; single rows whose time is out of order are left
    out. A clock that starts again makes parts, of which one is used: the given part, from 1, or the
    longest. In messages, ``row`` is the word for a line.
    """
    notes: list[str] = []
    rows = np.arange(len(time))
    if not (np.diff(time) <= 0).any():
        _check_part(path, part, 1)
        return Order(rows, time, notes)
    falling = np.diff(time) < 0
    if falling.sum() > max(MAX_STEPS_BACK, 0.2 * len(time)) or falling.all():
        at = int(np.flatnonzero(falling)[0]) + 1
        raise FileError(
            f"{path}: {row} {lines[at]}: the time {time[at]:g} s does not come after "
            f"{time[at - 1]:g} s, and so in {int(falling.sum())} of {len(time)} {row}s: is it the "
            "column of the time?"
        )
    rows = _without_odd(time, rows, lines, notes, row)
    rows = _without_repeated(time, values, rows, lines, notes, row)
    rows = _one_part(path, time, rows, lines, notes, part, row)
    return _without_equal(time, rows, lines, notes, row)


def _without_odd(time: Array, rows: Numbers, lines: Numbers, notes: list[str], row: str) -> Numbers:
    """Leave out single rows whose time does not fit between those of its neighbours."""
    steps = np.diff(time[rows])
    back = np.flatnonzero(steps < 0) + 1
    odd = []
    for at in back:
        # Without the row before, or without this one, times increase.
        if 1 < at and time[rows[at]] > time[rows[at - 2]]:
            odd.append(at - 1)
        elif at + 1 < len(rows) and time[rows[at + 1]] > time[rows[at - 1]]:
            odd.append(at)
    if not odd:
        return rows
    chosen = np.unique(odd)
    named = lines[rows[chosen]].tolist()
    notes.append(f"{row} {listed(named, NAMED)}: the time is out of order, left out")
    return np.delete(rows, chosen)


def _without_repeated(
    time: Array,
    values: Sequence[Array],
    rows: Numbers,
    lines: Numbers,
    notes: list[str],
    row: str,
) -> Numbers:
    """Leave out rows that repeat earlier ones in time and values, if most of a block that goes back
    in time do."""
    every = np.ascontiguousarray(np.vstack([time, *values])[:, rows].T) + 0.0
    # Missing numbers are equal to each other.
    every[np.isnan(every)] = np.inf
    view = every.view([("", every.dtype)] * every.shape[1]).ravel()
    _, first, which = np.unique(view, return_index=True, return_inverse=True)
    if len(first) == len(rows):
        return rows
    times, earlier = time[rows], first[which.ravel()]
    block = np.cumsum(np.diff(times, prepend=times[0]) < 0)
    is_other = block[earlier] != block
    latest = np.maximum.accumulate(times)
    starts = np.searchsorted(block, np.arange(block[-1] + 1))
    crosses = times <= latest[np.maximum(starts - 1, 0)][block]
    share = np.bincount(block, is_other) / np.maximum(np.bincount(block, crosses), 1)
    is_again = (earlier != np.arange(len(rows))) & ~(is_other & (share < MIN_REPEATED)[block])
    kept: NDArray[np.bool] = ~is_again
    if kept.all():
        return rows
    again = lines[rows[~kept]]
    notes.append(
        f"{len(again)} {row}{'s' if len(again) > 1 else ''} written twice, used once: {row} "
        f"{listed(again.tolist(), NAMED)}"
    )
    return rows[kept]


def _check_part(path: Path, part: int | None, count: int) -> None:
    if part is not None and part > count:
        parts = "1 part" if count == 1 else f"{count} parts"
        raise FileError(f"{path}: has {parts}; there is no part {part}")


def _one_part(
    path: Path,
    time: Array,
    rows: Numbers,
    lines: Numbers,
    notes: list[str],
    part: int | None,
    row: str,
) -> Numbers:
    """Put blocks in order, and choose a part if the clock starts again."""
    # Rows in pieces of times that do not decrease.
    runs = np.split(rows, np.flatnonzero(np.diff(time[rows]) < 0) + 1)
    parts: list[list[Numbers]] = [[runs[0]]]
    for run in runs[1:]:
        if _fits(time, parts[-1], run):
            parts[-1].append(run)
        else:
            parts.append([run])
    late = sum(len(one) - 1 for one in parts)
    if late:
        notes.append(f"times step back {late} times to blocks written late, put in order")
    joined = [np.concatenate(one) for one in parts]
    whole = [one[np.argsort(time[one], kind="stable")] for one in joined]
    _check_part(path, part, len(whole))
    chosen = part - 1 if part is not None else int(np.argmax([len(one) for one in whole]))
    if len(whole) > 1:
        shown = "; ".join(
            f"{position} {row}s {lines[one].min()} to {lines[one].max()}"
            for position, one in enumerate(whole[:NAMED], 1)
        )
        guess = "guess: " if part is None else ""
        notes.append(
            f"{guess}the clock starts again: {len(whole)} parts ({shown}); part {chosen + 1} is "
            "used, another one with --part"
        )
    return whole[chosen]


def _fits(time: Array, runs: Sequence[Numbers], run: Numbers) -> bool:
    """Whether a run lies between blocks of others, or before or after them."""
    others = np.sort(np.concatenate([time[one] for one in runs]))
    first, after = (np.searchsorted(others, time[run], side) for side in SIDES)
    if (first != after).any() or np.count_nonzero(np.diff(first)) > MAX_CROSSED:
        return False
    # A clock that starts again begins before everything else.
    return bool(time[run[0]] > others[0])


def _without_equal(time: Array, rows: Numbers, lines: Numbers, notes: list[str], row: str) -> Order:
    """Handle samples with equal times: rounded times are spread evenly, others are used once."""
    times = time[rows]
    same = np.concatenate([[False], np.diff(times) == 0])
    count = int(same.sum())
    if not count:
        return Order(rows, times, notes)
    if count < max(MIN_ROUNDED_COUNT, MIN_ROUNDED * len(rows)):
        named = lines[rows[same]].tolist()
        notes.append(
            f"{count} sample{'s' if count > 1 else ''} with the time of the one before and other "
            f"values, left out: {row} {listed(named, NAMED)}"
        )
        return Order(rows[~same], times[~same], notes)
    starts = np.flatnonzero(~same)
    lengths = np.diff(np.append(starts, len(rows)))
    steps = np.diff(times[starts])
    step = float(np.median(steps)) if steps.size else 0.0
    if step <= 0:
        return Order(rows[~same], times[~same], notes)
    ends = np.append(np.minimum(steps, step), step)
    within = np.arange(len(rows)) - np.repeat(starts, lengths)
    spread = np.repeat(times[starts], lengths) + within / np.repeat(lengths, lengths) * np.repeat(
        ends, lengths
    )
    notes.append(
        f"guess: times are rounded to {with_unit(step, 's', 3)}, with up to {lengths.max()} "
        "samples to each; they are spread evenly"
    )
    return Order(rows, spread, notes)


def sampling_summary(time: Array) -> list[str]:
    """The report, or one line with the range of the rates, their median and the number of gaps if
    there are many."""
    steps = np.diff(time)
    usual = _usual(steps)
    stretches = _stretches(usual)
    if len(stretches) <= MAX_RATES:
        return sampling_report(time)
    gaps = np.count_nonzero(steps > MIN_GAP * usual)
    low, middle, high = (number(1 / one, 3) for one in np.quantile(usual, [1, 0.5, 0]))
    return [
        f"samples: {len(time)} from {time[0]:.10g} s to {time[-1]:.10g} s, unevenly, at {low} to "
        f"{high} Hz (median {middle}), {gaps} gaps; nothing is filled in"
    ]


def sampling_report(time: Array) -> list[str]:
    """Lines about sampling rates, each with its interval of time, and about gaps."""
    steps = np.diff(time)
    usual = _usual(steps)
    is_gap = steps > MIN_GAP * usual
    lines = []
    for first, last in _stretches(usual):
        inside = steps[first:last][~is_gap[first:last]]
        interval = float(np.median(inside if inside.size else steps[first:last]))
        spread = float(np.percentile(np.abs(inside / interval - 1), 95)) if inside.size else 0.0
        about = "about " if spread > 0.05 else ""
        lines.append(
            f"samples: {about}{number(1 / interval, 5)} Hz from {time[first]:.10g} s to "
            f"{time[last]:.10g} s ({last - first + 1})"
        )
    gaps = np.flatnonzero(is_gap)
    if gaps.size:
        shown = ", ".join(
            f"{with_unit(steps[at], 's', 3)} after {time[at]:.10g} s" for at in gaps[:NAMED]
        )
        more = f" and {gaps.size - NAMED} more" if gaps.size > NAMED else ""
        lines.append(f"gaps: {shown}{more}; nothing is filled in")
    return lines


def _usual(steps: Array) -> Array:
    """The median of the intervals around each one."""
    low, high = float(steps.min()), float(steps.max())
    if high < MIN_GAP * low:
        # One rate, without gaps.
        return np.broadcast_to(np.median(steps), steps.shape)
    from scipy.ndimage import median_filter

    size = min(2 * AROUND + 1, len(steps) - (1 - len(steps) % 2))
    usual: Array = median_filter(steps, max(size, 1), mode="nearest")
    return usual


def _stretches(usual: Array) -> list[tuple[int, int]]:
    """First and last sample of each stretch of one rate; short ones belong to the one before."""
    levels = np.round(np.log(usual) / np.log(SAME_RATE))
    edges = [0, *(np.flatnonzero(np.abs(np.diff(levels)) > 1) + 1).tolist(), len(usual)]
    found: list[tuple[int, int]] = []
    for first, last in pairwise(edges):
        short = last - first < MIN_SAMPLES and len(usual) >= 2 * MIN_SAMPLES
        if found and short:
            found[-1] = (found[-1][0], last)
        else:
            found.append((first, last))
    return found
