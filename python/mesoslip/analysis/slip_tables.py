"""Catalogues of slips as tables for print, each column in one unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from mesoslip.analysis.slips import Catalogue, as_recorded
from mesoslip.output.table_files import PrintedTable
from mesoslip.quantities import Column, column, number

# Columns of the catalogue of slips: header, and unit in SI.
HEADS = {
    "start_time": ("start", "s"),
    "duration": ("duration", "s"),
    "force_before": ("force before", "N"),
    "force_after": ("force after", "N"),
    "force_drop": ("force drop", "N"),
    "peak_velocity": ("peak velocity", "m/s"),
    "contacts_broken": ("breaks", "1"),
    "waiting_time": ("waiting time", "s"),
    "stick_duration": ("stick duration", "s"),
    "loading_rate": ("loading rate", "N/s"),
    "loading_stiffness": ("loading stiffness", "N/m"),
    "creep_displacement": ("creep before", "m"),
    "creep_share": ("creep share", "1"),
    "peak_fall_rate": ("peak fall rate", "N/s"),
}
# Columns that stand in the statistics only.
STATISTICS_ONLY = {
    "stick_duration",
    "loading_rate",
    "loading_stiffness",
    "creep_displacement",
    "peak_fall_rate",
}
# Significant digits of the largest number of a column, and of standard deviations.
DIGITS, DEVIATION_DIGITS = 5, 2


def printed(catalogue: Catalogue) -> PrintedTable:
    """The slips, a row for each."""
    rows = catalogue.rows
    columns = [
        (shown.head(head), *(shown.text(row[name]) for row in rows))
        for name, head, shown in _columns(catalogue)
        if name not in STATISTICS_ONLY
    ]
    if any(row["realization_index"] for row in rows):
        columns.insert(0, ("realization", *(str(row["realization_index"]) for row in rows)))
    head, *cells = zip(*columns, strict=True)
    return PrintedTable("Slips", head, tuple(cells))


def printed_statistics(catalogue: Catalogue) -> PrintedTable:
    """Mean, standard deviation and range of each column."""
    statistics = catalogue.statistics
    rows = tuple(
        (shown.head(head), *_statistics(statistics[name], shown.scale.size))
        for name, head, shown in _columns(catalogue)
        if name in statistics
    )
    head = ("", "mean", "standard deviation", "minimum", "maximum")
    return PrintedTable("Statistics of slips", head, rows)


def _columns(catalogue: Catalogue) -> Iterator[tuple[str, str, Column]]:
    """Names, headers, and how numbers are written; columns without a known value are left out."""
    rows = catalogue.rows
    for name in HEADS:
        values = [row[name] for row in rows]
        if rows and all(one is None for one in values):
            continue
        head, unit = as_recorded(*HEADS[name], catalogue.force_unit)
        yield name, head, column(values, unit, DIGITS)


def _statistics(values: Mapping[str, float], unit: float) -> tuple[str, ...]:
    """Numbers with the decimals that their standard deviation deserves."""
    names = ("mean", "standard_deviation", "minimum", "maximum")
    mean, deviation, low, high = (values[name] / unit for name in names)
    if not low < high:
        return (number(mean, DIGITS), "-", "-", "-")
    decimals = max(0, DEVIATION_DIGITS - 1 - math.floor(math.log10(deviation)))
    return tuple(f"{one:.{decimals}f}" for one in (mean, deviation, low, high))
