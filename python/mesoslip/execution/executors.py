"""Executors, which compute pieces of work; the results do not depend on the executor."""

from __future__ import annotations

import itertools
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
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Union

from mesoslip.errors import ConfigError
from mesoslip.execution.cluster import GONE, ClusterPool, connected
from mesoslip.execution.local import LocalPool
from mesoslip.execution.pool import Function, Piece, Pool, PoolError, Result
from mesoslip.execution.stop import Stop, StopRequest

if TYPE_CHECKING:
    from distributed import Client

# Time between two checks of progress, signals and workers [s].
POLL_SECONDS = 0.1
# Time of a batch of short pieces [s], in which handing it over costs little.
BATCH_SECONDS = 0.05


class Executor(ABC):
    """Computes pieces of work; one that shares memory computes them in this process."""

    shares_memory = False

    @abstractmethod
    def open(self, stop: Stop) -> AbstractContextManager[Pool]:
        """Workers for the duration of the context; pieces in this process check the stop."""


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
        Number of pieces at the same time; by default the number of processors.
    """

    shares_memory = True
    thread_seconds = math.inf


class Processes(_Local):
    """Processes of this machine. One that is killed is replaced, and its piece computed again.

    Parameters
    ----------
    workers
        Number of pieces at the same time; by default the number of processors.
    """

    thread_seconds = 0.0


class ThreadsThenProcesses(_Local):
    """Threads, which start at once, and processes for pieces that start after ten seconds."""

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

    def __post_init__(self) -> None:
        if not isinstance(self.cluster, str | os.PathLike) and not hasattr(
            self.cluster, "get_executor"
        ):
            message = "must be a distributed.Client, an address, or a scheduler file"
            raise ConfigError.of("cluster", message, self.cluster)

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
    """An executor: itself, or the default one with a number of workers."""
    return executor if isinstance(executor, Executor) else default(executor)


def checked_workers(workers: Any) -> int:
    """A number of workers of at least 1, by default the number of processors."""
    if workers is None:
        return os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, Integral) or workers < 1:
        message = (
            "must be a whole number of workers of at least 1, or an executor such as "
            "mesoslip.Threads(4); the default is one thread for each processor"
        )
        raise ConfigError.of("executor", message, workers)
    return int(workers)


def completed(
    executor: Executor,
    function: Function[Piece, Result],
    pieces: Iterable[Piece],
    stop: StopRequest,
    *,
    in_order: bool = False,
    poll: Callable[[], None] = lambda: None,
    max_wait: float | None = None,
) -> Generator[tuple[Piece, Future[Result]]]:
    """Compute pieces of work; yield each with a completed future, as soon as it is available.

    The function is called with a piece and a stop, after which it should return soon; both are
    pickled unless the executor shares memory. Pieces are taken from the iterable as workers need
    them. ``poll`` is called about ten times a second. If the iteration ends early, the generator
    must be closed, which waits at most ``max_wait`` [s] for pieces on threads; None is no limit.
    Raises a `PoolError` if there are no workers and none can be started.
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
                    poll()
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


class Batches(Generic[Piece]):
    """Pieces in batches that take about `BATCH_SECONDS`, so that short ones cost little more than
    their own work; a piece that takes longer is a batch of its own."""

    def __init__(self, pieces: Iterable[Piece]) -> None:
        self._pieces = iter(pieces)
        self._size = 1

    def __iter__(self) -> Iterator[tuple[Piece, ...]]:
        while batch := tuple(itertools.islice(self._pieces, self._size)):
            yield batch

    def finished(self, count: int, seconds: float) -> None:
        """Learn from a batch of some pieces that took a time [s]."""
        wanted = count * BATCH_SECONDS / max(seconds, 1e-9)
        self._size = max(1, min(2 * self._size, int(wanted)))


def _first_done(running: Iterable[Future[Any]]) -> Iterator[Future[Any]]:
    """The completed futures before the first one that is not."""
    for future in running:
        if not future.done():
            return
        yield future


def _checked(future: Future[Result], pool: Pool) -> Future[Result]:
    """A completed future; raises a `PoolError` if it failed because its pool has ended."""
    if future.cancelled():
        pool.check()
        raise PoolError(GONE)
    error = future.exception()
    if isinstance(error, PoolError):
        raise error
    return future
