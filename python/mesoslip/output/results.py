"""The results of a run, as outputs take them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from mesoslip.configuration.config import Config

Array = NDArray[Any]


class Rows(Protocol):
    """A table of rows that need not be in memory as a whole."""

    def __len__(self) -> int: ...

    def blocks(self, max_rows: int) -> Iterator[Array]:
        """The rows in blocks of at most ``max_rows``, shape (rows, ...)."""
        ...


class RealizationResults(Protocol):
    """The results of a realization.

    Tables, with the columns of `mesoslip.simulation.recorded_tables`: "trace", "slip_trace" (with
    the number of the slip as its last column), "slips", "stages", "layers", "avalanches",
    "snapshot_events", and "snapshots" with rows of shape (contacts, 3): stretch (NaN if detached),
    load, generation.
    """

    @property
    def number(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def ending(self) -> str: ...
    @property
    def breaks(self) -> float: ...
    @property
    def advances(self) -> int: ...
    @property
    def kernel_seconds(self) -> float: ...
    @property
    def avalanche_count(self) -> int: ...
    @property
    def avalanche_slip(self) -> float: ...
    @property
    def displacement(self) -> float: ...
    @property
    def energy(self) -> Array: ...
    @property
    def energy_residual(self) -> float: ...
    @property
    def step_work(self) -> float: ...
    @property
    def force_error(self) -> float: ...
    @property
    def integrator_counts(self) -> Array: ...

    def rows(self, table: str) -> Rows:
        """A table."""
        ...


class RunResults(Protocol):
    """The results of a run."""

    @property
    def config(self) -> Config: ...
    @property
    def complete(self) -> bool: ...
    @property
    def wall_seconds(self) -> float: ...
    @property
    def realizations(self) -> Sequence[RealizationResults]: ...
