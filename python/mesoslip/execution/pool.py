"""Pools that an executor opens: workers that take one piece of work each."""

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

# The function applied to a piece; it returns soon once the stop is set.
Function = Callable[[Piece, Stop], Result]


class PoolError(RunError):
    """No piece can be computed any more."""


class WorkerLostError(RunError):
    """A piece has cost as many workers as it may."""


class Pool(ABC):
    """Workers for pieces of work."""

    @property
    @abstractmethod
    def capacity(self) -> int:
        """Pieces in flight at the same time, enough to keep every worker busy."""

    @abstractmethod
    def submit(self, function: Function[Any, Result], piece: object) -> Future[Result]:
        """Have a piece computed by the next free worker."""

    @abstractmethod
    def check(self) -> None:
        """Make sure, now and then, that there are workers.

        Raises
        ------
        PoolError
            If there will be none any more.
        """

    @abstractmethod
    def close(self, wait: float | None) -> None:
        """Give up what is in flight.

        Parameters
        ----------
        wait
            Longest time to wait for pieces that ignore the stop [s]; as long as it takes if None.
        """


def compute_elsewhere(function: Function[Any, Result], piece: object, wanted: str) -> Result:
    """Compute a piece in another process, which has no stop of its own: it is ended.

    Raises
    ------
    RunError
        If it is another program than the one that is wanted.
    """
    if wanted != program():
        raise RunError(f"the worker has {program()}, and {wanted} is wanted")
    return function(piece, Stop())
