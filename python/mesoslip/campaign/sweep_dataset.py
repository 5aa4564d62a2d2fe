"""The dataset of a sweep: swept keys as coordinates, measures as variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Dataset
from mesoslip.configuration.keys import key_kind
from mesoslip.execution.program import program
from mesoslip.output.provenance import program_attributes

if TYPE_CHECKING:
    from mesoslip.campaign.sweep_plan import Plan

STATUS = ("ok", "failed", "missing")
OK, FAILED, MISSING = range(3)
# Failures that are listed in the dataset.
MAX_FAILURES = 100


class SweepDataset:
    """The dataset of a sweep, filled point by point."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        shape = (*plan.shape, plan.realizations)
        self._status: NDArray[np.int8] = np.full(shape, MISSING, dtype=np.int8)
        self._values = {one.name: np.full(shape, np.nan) for one in plan.measures}

    def put(self, combination: int, realization: int, measures: Mapping[str, float]) -> None:
        """Store the measures of a point."""
        where = (*self._plan.index(combination), realization)
        self._status[where] = OK
        for name, values in self._values.items():
            values[where] = measures[name]

    def fail(self, combination: int, realization: int) -> None:
        """Mark a point that failed."""
        self._status[(*self._plan.index(combination), realization)] = FAILED

    def dataset(self, ending: str, failures: Mapping[str, str]) -> Dataset:
        """The dataset as it is now: ``status`` and the measures, NaN where points are missing.

        It has a dimension for each swept key, named like it, with its values in SI; one for keys
        that go together, named like the first of them; ``sample`` for a Latin hypercube; and
        ``realization``.
        """
        import xarray as xr

        plan = self._plan
        dimensions = (*(axis.dimension for axis in plan.axes), "realization")
        coordinates: dict[str, Any] = {}
        for axis in plan.axes:
            if axis.dimension not in axis.keys:
                numbers = np.arange(len(axis.rows))
                attributes = {"units": "1", "long_name": "number of the sample"}
                coordinates[axis.dimension] = (axis.dimension, numbers, attributes)
            for key, column in zip(axis.keys, zip(*axis.rows, strict=True), strict=True):
                coordinates[key] = (axis.dimension, np.array(column), _attributes(key))
        numbers = np.arange(plan.realizations)
        attributes = {"units": "1", "long_name": "number of the realization"}
        coordinates["realization"] = ("realization", numbers, attributes)
        flags = {
            "long_name": "status of the point",
            "flag_values": np.arange(len(STATUS), dtype=np.int8),
            "flag_meanings": " ".join(STATUS),
        }
        variables: dict[str, Any] = {"status": xr.Variable(dimensions, self._status, flags)}
        for one in plan.measures:
            # Flags are numbers with NaN in memory, and small integers in a file.
            encoding = {"dtype": "int8", "_FillValue": -1} if one.flags else {"_FillValue": np.nan}
            variables[one.name] = xr.Variable(
                dimensions, self._values[one.name], one.attributes, encoding
            )
        return xr.Dataset(variables, coordinates, self._attributes(ending, failures))

    def _attributes(self, ending: str, failures: Mapping[str, str]) -> dict[str, Any]:
        import tomli_w

        plan = self._plan
        reported = [f"{point}: {reason}" for point, reason in list(failures.items())[:MAX_FAILURES]]
        return program_attributes(plan.config(0), "sweep") | {
            "configuration": tomli_w.dumps(plan.tables),
            **({"continued_key": plan.sweep.continue_} if plan.sweep.continue_ else {}),
            "sweep": tomli_w.dumps(plan.sweep.model_dump(exclude_none=True, by_alias=True)),
            "complete": "false" if np.any(self._status == MISSING) else "true",
            **({"comment": ending} if ending else {}),
            "failures": "\n".join(reported),
        }

    def manifest(self, names: Sequence[str]) -> dict[str, Any]:
        """The names of the points of the sweep, and what they are of, for the store."""
        plan = self._plan
        return {
            "program": program(),
            "axes": {axis.dimension: [list(row) for row in axis.rows] for axis in plan.axes},
            "realizations": plan.realizations,
            "measures": [one.name for one in plan.measures],
            "points": names,
        }


def _attributes(key: str) -> dict[str, str]:
    kind = key_kind(key)
    units = None if kind is None else kind.cf_units
    long_name = key.replace(".", " ").replace("_", " ")
    return {"long_name": long_name} | ({} if units is None else {"units": units})
