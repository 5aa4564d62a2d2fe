"""States of realizations as a few arrays, of which a file may have 10⁵."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.simulation.realization import SAVED_ATTRIBUTES, Realization, Saved
from mesoslip.simulation.recorded_tables import ENERGY_COLUMNS, TABLES

Arrays = dict[str, NDArray[Any]]

NUMBERS = "realizations"
# Scalars of a state that are lists of numbers: their lengths and types.
LISTS = {"integrator_counts": (3, np.int64), "energy": (len(ENERGY_COLUMNS), np.float64)}


def to_arrays(running: Mapping[int, Saved], over: Collection[Realization]) -> Arrays:
    """States of realizations, and realizations that are over, as arrays by name."""
    saved = running.values()
    arrays = {NUMBERS: np.array([*running, *(one.number for one in over)], dtype=np.int64)}
    for name in SAVED_ATTRIBUTES:
        values = [one.scalars[name] for one in saved]
        arrays[f"scalars.{name}"] = np.array([*values, *(getattr(one, name) for one in over)])
    for name, (length, dtype) in LISTS.items():
        # The energy is not known before the end.
        lists = [one.scalars[name] or [np.nan] * length for one in saved]
        rows = [np.array(lists, dtype=dtype).ravel(), *(getattr(one, name) for one in over)]
        arrays[f"scalars.{name}"] = np.concatenate(rows).reshape(-1, length)
    counts = [*(one.counts for one in saved), *(one.counts for one in over)]
    for table in TABLES:
        arrays[f"counts.{table}"] = np.array([one.get(table, 0) for one in counts], dtype=np.int64)
    fronts = [one.scalars.get("fronts") for one in saved] + [one.save_fronts() for one in over]
    if any(fronts):
        arrays["scalars.fronts"] = np.array([json.dumps(one) for one in fronts])
    for number, one in running.items():
        if one.words is not None:
            arrays[f"words.{number}"] = one.words
    return arrays


def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> dict[int, Saved]:
    """States by number of their realization; a `LookupError` or `ValueError` without some."""
    names = [*SAVED_ATTRIBUTES, *LISTS]
    columns = [arrays[f"scalars.{name}"].tolist() for name in names]
    fronts = arrays.get("scalars.fronts")
    counts = zip(*(arrays[f"counts.{table}"].tolist() for table in TABLES), strict=True)
    states = {}
    for place, (number, values, rows) in enumerate(
        zip(arrays[NUMBERS].tolist(), zip(*columns, strict=True), counts, strict=True)
    ):
        scalars = dict(zip(names, values, strict=True))
        if not scalars["ending"]:
            scalars["energy"] = None
        if fronts is not None:
            scalars["fronts"] = json.loads(str(fronts[place]))
        found = {table: count for table, count in zip(TABLES, rows, strict=True) if count}
        states[number] = Saved(scalars, found, arrays.get(f"words.{number}"))
    return states
