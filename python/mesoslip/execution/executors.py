"""Executors: where pieces of work are computed. The results do not depend on it."""

from __future__ import annotations

import math
import os
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from numbers import Integral
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, ClassVar, Union

from mesoslip.errors import ConfigError, Problem
from mesoslip.execution.cluster import GONE, ClusterPool, connected
from mesoslip.execution.local import LocalPool
from mesoslip.execution.pool import Function, Piece, Pool, PoolError, Result
from mesoslip.execution.stop import Stop, StopRequest

if TYPE_CHECKING:
    from distributed import Client

# How often progress, signals and workers are looked at [s].
POLL_SECONDS = 0.1


class Executor(ABC):
    """Where pieces of work are computed.

    Attributes
    ----------
    shares_memory
        Whether pieces are computed in this process, and may change what it holds.
    """

    shares_memory = False

    @abstractmethod
    def open(self, stop: Stop) -> AbstractContextManager[Pool]:
        """Workers, for as long as the context lasts.

        Parameters
        ----------
        stop
            Flag that pieces on threads of this process check.

        Raises
        ------
        FileError
            If there is no cluster.
        """


@dataclass(frozen=True)
class _Local(Executor):
    workers: int | None = None

    # Time after which new pieces go to processes [s].
    thread_seconds: ClassVar[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "workers", checked_workers(self.workers))

    def open(self, stop: Stop) -> AbstractContextManager[Pool]:
        return nullcontext(LocalPool(checked_workers(self.workers), stop, self.thread_seconds))


class Threads(_Local):
    """Threads of this process.

    Parameters
    ----------
    workers
        Pieces at the same time; as many as there are processors by default.
    """

    shares_memory = True
    thread_seconds = math.inf


class Processes(_Local):
    """Processes of this machine. One that is killed is replaced, and its piece computed again.

    Parameters
    ----------
    workers
        Pieces at the same time; as many as there are processors by default.
    """

    thread_seconds = 0.0


class ThreadsThenProcesses(_Local):
    """Threads, which start at once, and processes for what has not begun after ten seconds.

    Parameters
    ----------
    workers
        Pieces at the same time; as many as there are processors by default.
    """

    thread_seconds = 10.0


@dataclass(frozen=True)
class Dask(Executor):
    """The workers of a Dask cluster, with the same version and commit of mesoslip.

    Parameters
    ----------
    cluster
        A `distributed.Client`, the address of a scheduler, or its ``--scheduler-file``.
    """

    cluster: str | os.PathLike[str] | Client

    @contextmanager
    def open(self, stop: Stop) -> Iterator[Pool]:  # noqa: ARG002
        if isinstance(self.cluster, str | os.PathLike):
            with connected(os.fspath(self.cluster)) as client:
                yield ClusterPool(client)
        else:
            yield ClusterPool(self.cluster)


# The choice of a user: an executor, a number of workers, or nothing.
ExecutorLike = Union[Executor, int, None]  # noqa: UP007


def as_executor(executor: ExecutorLike, default: type[_Local] = Threads) -> Executor:
    """An executor: itself, or the default one with a number of workers.

    Raises
    ------
    ConfigError
        If it is neither an executor nor a number of at least 1.
    """
    return executor if isinstance(executor, Executor) else default(executor)


def checked_workers(workers: Any) -> int:
    """A number of workers, as an integer of Python's own.

    Raises
    ------
    ConfigError
        If it is not a whole number of at least 1.
    """
    if workers is None:
        return os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, Integral) or workers < 1:
        message = (
            "must be a whole number of workers of at least 1, or an executor such as "
            "mesoslip.Threads(4); as many threads as processors without it"
        )
        raise ConfigError([Problem("", "executor", message, workers)])
    return int(workers)


def completed(
    executor: Executor,
    function: Function[Piece, Result],
    pieces: Iterable[Piece],
    stop: StopRequest,
    *,
    in_order: bool = False,
    look: Callable[[], None] = lambda: None,
    max_wait: float | None = None,
) -> Generator[tuple[Piece, Future[Result]]]:
    """Compute pieces of work, and yield each with its result as soon as it is there.

    Only so many are in flight as keep the workers busy, so a long iterable need not fit into
    memory. To be closed by whoever ends the iteration early: that waits for pieces on threads.

    Parameters
    ----------
    executor
        Where pieces are computed.
    function
        Called with each piece and a stop, after which it should return soon. It and the pieces must
        be such that they can be pickled, unless the executor shares memory.
    pieces
        The pieces.
    stop
        Ends the iteration soon; what is in flight is given up.
    in_order
        Whether to yield pieces in their order.
    look
        Called about ten times a second.
    max_wait
        Longest time to wait at the end for pieces that ignore the stop [s]; as long as it takes if
        None.

    Yields
    ------
    tuple
        The piece; and a future that is done, whose result raises what the function raised.

    Raises
    ------
    PoolError
        If no workers are left, and none can be started.
    """
    inner = Stop(stop)
    waiting = iter(pieces)
    done: SimpleQueue[Future[Result]] = SimpleQueue()
    # In the order of submission.
    running: dict[Future[Result], Piece] = {}
    ready: deque[Future[Result]] = deque()
    with executor.open(inner) as pool:
        last = time.monotonic()
        try:
            while not stop.is_set():
                while len(running) < pool.capacity:
                    try:
                        piece = next(waiting)
                    except StopIteration:
                        break
                    future = pool.submit(function, piece)
                    running[future] = piece
                    future.add_done_callback(done.put)
                if not running:
                    return
                if time.monotonic() - last > POLL_SECONDS:
                    pool.check()
                    look()
                    last = time.monotonic()
                try:
                    future = done.get(timeout=POLL_SECONDS)
                except Empty:
                    continue
                if not in_order:
                    ready.append(future)
                else:
                    ready.extend(_first_done(running))
                while ready and not stop.is_set():
                    future = ready.popleft()
                    yield running.pop(future), _checked(future, pool)
        finally:
            inner.set()
            for future in running:
                future.cancel()
            pool.close(max_wait)


def _first_done(running: Iterable[Future[Any]]) -> Iterator[Future[Any]]:
    """Those that are done before the first that is not."""
    for future in running:
        if not future.done():
            return
        yield future


def _checked(future: Future[Result], pool: Pool) -> Future[Result]:
    """A future that is done, unless its pool is not there any more.

    Raises
    ------
    PoolError
        If it is not.
    """
    if future.cancelled():
        pool.check()
        raise PoolError(GONE)
    error = future.exception()
    if isinstance(error, PoolError):
        raise error
    return future
