"""The realizations of `mesoslip.simulation.engine` as results of a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.simulation.engine import Realization

PROPERTIES = {"layers": "layer_trace"}


@dataclass(frozen=True)
class ArrayRows:
    """Rows that are in memory."""

    array: NDArray[Any]

    def __len__(self) -> int:
        return len(self.array)

    def blocks(self, most: int) -> Iterator[NDArray[Any]]:
        """The rows one after another, at most so many at a time."""
        for start in range(0, len(self.array), most):
            yield self.array[start : start + most]


class RealizationTables:
    """A realization with its tables."""

    def __init__(self, realization: Realization) -> None:
        self._realization = realization
        self._tables: dict[str, ArrayRows] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._realization, name)

    def rows(self, table: str) -> ArrayRows:
        """A table, see `mesoslip.output.layout.RealizationResults`."""
        if table not in self._tables:
            array = getattr(self._realization, PROPERTIES.get(table, table))
            self._tables[table] = ArrayRows(array)
        return self._tables[table]


@dataclass(frozen=True)
class EngineResults:
    """What came out of a run of the engine."""

    config: Config
    realizations: tuple[RealizationTables, ...]
    complete: bool
    wall_seconds: float
