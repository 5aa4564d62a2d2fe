"""States of realizations as a few arrays, of which a file may have 10⁵."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.simulation.realization import SAVED_ATTRIBUTES, Saved
from mesoslip.simulation.recorded_tables import ENERGY_COLUMNS, TABLES

Arrays = dict[str, NDArray[Any]]

NUMBERS = "realizations"
# Scalars of a state that are lists of numbers, and their lengths.
LISTS = {"integrator_counts": 3, "energy": len(ENERGY_COLUMNS)}


def to_arrays(states: Mapping[int, Saved]) -> Arrays:
    """States by number of their realization as arrays by name."""
    values = list(states.values())
    arrays = {NUMBERS: np.array(list(states), dtype=np.int64)}
    for name in SAVED_ATTRIBUTES:
        arrays[f"scalars.{name}"] = np.array([one.scalars[name] for one in values])
    for name, length in LISTS.items():
        # The energy is not known before the end.
        lists = [one.scalars[name] or [np.nan] * length for one in values]
        arrays[f"scalars.{name}"] = np.array(lists).reshape(-1, length)
    if values and "fronts" in values[0].scalars:
        texts = [json.dumps(one.scalars["fronts"]) for one in values]
        arrays["scalars.fronts"] = np.array(texts)
    for table in TABLES:
        counts = [one.counts.get(table, 0) for one in values]
        arrays[f"counts.{table}"] = np.array(counts, dtype=np.int64)
    for number, one in states.items():
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
