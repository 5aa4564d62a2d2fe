"""Pools of workers, each of which computes one piece of work at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from mesoslip.errors import RunError
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop

Piece = TypeVar("Piece")
Result = TypeVar("Result")

# The function applied to a piece; it returns soon after the stop is set.
Function = Callable[[Piece, Stop], Result]


class PoolError(RunError):
    """The pool cannot compute further pieces."""


class WorkerLostError(RunError):
    """The workers of a piece died, in all attempts."""


class Pool(ABC):
    """Workers for pieces of work."""

    @property
    @abstractmethod
    def capacity(self) -> int:
        """Number of pieces in flight that keeps every worker busy."""

    @abstractmethod
    def submit(self, function: Function[Any, Result], piece: object) -> Future[Result]:
        """Compute a piece with the next free worker."""

    @abstractmethod
    def check(self) -> None:
        """Raise a `PoolError` if there are no workers any more; called from time to time."""

    @abstractmethod
    def close(self, wait: float | None) -> None:
        """Abandon pieces in flight, waiting at most ``wait`` [s] for those that ignore the stop."""


def compute_elsewhere(function: Function[Any, Result], piece: object, wanted: str) -> Result:
    """Compute a piece in another process of the wanted program, which is ended to stop it."""
    if wanted != program():
        raise RunError(f"the worker has {program()}, not {wanted}")
    return function(piece, Stop())
