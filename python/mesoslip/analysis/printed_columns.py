"""Columns of a catalogue as a table for print, numbers with their errors in one unit a column."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.output.table_files import PrintedTable
from mesoslip.output.variables import with_force_unit
from mesoslip.quantities import column

# Significant digits of columns without errors, and of times.
DIGITS, TIME_DIGITS = 4, 7
# Maximum ratio of numbers in a column with the same decimals.
MAX_RANGE = 100.0


def printed_columns(
    title: str,
    columns: Mapping[str, NDArray[Any]],
    heads: Mapping[str, tuple[str, str]],
    force_unit: str,
) -> PrintedTable:
    """A table of the columns with a header and an SI unit; those without numbers are left out.

    The force unit is "1" in records of friction coefficients. The realization is a column where
    there are several.
    """
    cells = []
    if columns["realization_index"].any():
        cells.append(("realization", *map(str, columns["realization_index"].tolist())))
    for name, (head, unit) in heads.items():
        values = columns[name].astype(float)
        if values.size and not np.isfinite(values).any():
            continue
        if columns[name].dtype.kind == "i":
            sign = "+" if name == "direction" else ""
            cells.append((head, *(f"{one:{sign}.0f}" for one in values)))
            continue
        digits = TIME_DIGITS if name == "start_time" else DIGITS
        shown = column(values.tolist(), with_force_unit(unit, force_unit), digits)
        errors = columns.get(f"{name}_error", np.full(values.size, np.nan))
        sizes = np.abs(values[np.isfinite(values) & (values != 0)])
        if f"{name}_error" not in columns and not name.endswith("_time") and sizes.size:
            # Over decades each number has its own digits.
            wide = float(sizes.max()) > MAX_RANGE * float(sizes.min())
            shown = shown._replace(decimals=None if wide else shown.decimals)
        texts = map(shown.text, values.tolist(), errors.tolist())
        cells.append((shown.head(head), *texts))
    names, *rows = zip(*cells, strict=True)
    return PrintedTable(title, names, tuple(rows))
