"""Numbers of a column that stand for missing ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import shown
from mesoslip.measured.columns import Used
from mesoslip.measured.reading.table import Table, listed

# Numbers that stand for missing ones if they are far from all others, and the minimum size of
# numbers that always do.
SENTINELS = (-9999.0, -99999.0, -999.0, -999.25, -9999.25, 9999.0, 99999.0, 999999.0, -99.99)
MIN_ALWAYS = 1e30
# Minimum distance from the range of 80 % of the others, over that range.
SENTINEL_DISTANCE = 1.0
# Percentage of steps between samples that are those of an ordinary signal.
USUAL_STEPS = 99.0


def _continues(values: Array, rows: NDArray[np.intp], usual: float) -> NDArray[np.bool]:
    """Whether rows differ from a neighbour by no more than a usual step."""
    steps = np.abs(np.diff(values, prepend=np.inf, append=np.inf))
    # Equal neighbours may be missing as well.
    steps[steps == 0] = np.inf
    return np.asarray(np.fmin(steps[rows], steps[rows + 1]) <= usual)


def sentinels(
    table: Table, used: Used, given: Sequence[float] | None = None
) -> tuple[NDArray[np.bool], str]:
    """Numbers that stand for missing ones in a column, given or guessed, and a note about them."""
    values = table.values[used.index]
    finite = np.isfinite(values)
    if given is not None:
        found = finite & np.isin(values, given)
        return found, _taken_as_missing(table, used, found)
    found = finite & (np.abs(values) >= MIN_ALWAYS)
    known = finite & np.isin(values, SENTINELS)
    rest = values[finite & ~known & ~found]
    if rest.size and known.any():
        # Percentiles exclude impulses and damaged rows.
        low, high = (float(one) for one in np.percentile(rest, [10, 90]))
        span = SENTINEL_DISTANCE * (high - low)
        far = (values < low - span) | (values > high + span)
        # A sample that continues its neighbours is an ordinary one.
        usual = float(np.percentile(np.abs(np.diff(rest)), USUAL_STEPS)) if rest.size > 1 else 0.0
        known[known] = ~_continues(values, np.flatnonzero(known), usual)
        near = known & ~far & ((values < low) | (values > high))
        found |= known & far
        if near.any() and not found.any():
            return found, (
                f"guess: column {shown(table.headers[used.index])}: {values[near][0]:g} on "
                f"{table.row} {listed(table.lines[near].tolist())} is used as a number "
                "(--missing)"
            )
    note = _taken_as_missing(table, used, found)
    # Larger numbers cannot be samples.
    is_guess = bool((np.abs(values[found]) < MIN_ALWAYS).any())
    return found, f"guess: {note} (--missing)" if is_guess else note


def _taken_as_missing(table: Table, used: Used, found: NDArray[np.bool]) -> str:
    """A note about numbers that stand for missing ones; empty without such numbers."""
    if not found.any():
        return ""
    values = np.unique(table.values[used.index][found])
    shown_values = ", ".join(f"{one:g}" for one in values[:3])
    lines = listed(table.lines[found].tolist())
    return (
        f"column {shown(table.headers[used.index])}: {shown_values} taken as missing in "
        f"{int(found.sum())} {table.row}s: {lines}"
    )
