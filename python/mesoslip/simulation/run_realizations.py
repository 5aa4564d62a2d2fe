"""All realizations of a run, on any executor, with checkpoints."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.errors import FileError, MesoslipError, NoMemoryError
from mesoslip.execution.executors import Batches, Executor, ExecutorLike, as_executor, completed
from mesoslip.execution.pool import PoolError, WorkerLostError
from mesoslip.execution.stop import Stop, StopRequest
from mesoslip.simulation.realization import Realization, Saved
from mesoslip.simulation.recorded_tables import Rows

if TYPE_CHECKING:
    from mesoslip.simulation.checkpoint import Checkpoint

# Number of realizations above which Python's search for garbage costs as much as short ones.
MANY = 1000
NO_MEMORY = (
    "not enough memory for the record: a larger output.avalanche_size or output.snapshot_size, or "
    "a longer output.interval, needs less"
)


@dataclass
class Results:
    """Results of a run, ``complete`` unless it was stopped."""

    config: Config
    realizations: list[Realization]
    complete: bool
    wall_seconds: float


def run_realizations(
    config: Config,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Run all realizations of a configuration, or continue them from a checkpoint.

    ``progress`` is called with the completed fraction, 0 to 1. ``stop`` or Ctrl-C ends the run
    between two segments. On executors other than threads a checkpoint keeps complete realizations
    only.
    """
    run = _Run(config, as_executor(executor), progress, checkpoint)
    start = time.perf_counter()
    before = checkpoint.restore(run.realizations) if checkpoint is not None else 0.0
    run.check()
    has_failed = False
    requested = Stop(stop)
    with _collection_paused(len(run.realizations) > MANY):
        try:
            with requested.on_interrupt():
                run.compute(requested)
        except (PoolError, WorkerLostError):
            raise
        except NoMemoryError:
            # With more memory it can be resumed.
            has_failed = not any(one.advances and not one.has_failed for one in run.realizations)
            raise
        except MesoslipError:
            has_failed = True
            raise
        finally:
            # A run that did not fail can be resumed, whatever has ended it.
            is_complete = all(one.finished for one in run.realizations)
            if checkpoint is not None and not (has_failed or is_complete):
                checkpoint.write(run.realizations)
    return Results(config, run.realizations, is_complete, before + time.perf_counter() - start)


class _Run:
    """The realizations of a run, and where they are computed."""

    def __init__(
        self,
        config: Config,
        executor: Executor,
        progress: Callable[[float], None] | None,
        checkpoint: Checkpoint | None,
    ) -> None:
        self.realizations = Realization.all_of(config)
        self._config = config
        self._executor = executor
        self._progress = progress
        self._checkpoint = checkpoint
        self._under_way: set[Realization] = set()

    def check(self) -> None:
        """Refuse to continue realizations that are under way on other executors than threads."""
        under_way = any(one.advances > 0 and not one.finished for one in self.realizations)
        if under_way and not self._executor.shares_memory:
            raise FileError(
                "the checkpoint has realizations that are under way; only threads can resume them: "
                "run it without --scheduler"
            )

    def compute(self, stop: Stop) -> None:
        """Advance all realizations to their ends, unless stopped."""
        waiting = [one for one in self.realizations if not one.finished]
        self._done = len(self.realizations) - len(waiting)
        if self._executor.shares_memory:
            self._compute_here(waiting, stop)
        else:
            self._compute_elsewhere(waiting, stop)

    def _compute_here(self, waiting: Sequence[Realization], stop: Stop) -> None:
        batches = Batches(waiting)
        work = completed(self._executor, self._advance_all, batches, stop, poll=self._update)
        with closing(work):
            for batch, future in work:
                try:
                    seconds = future.result()
                except MemoryError:
                    raise NoMemoryError(NO_MEMORY) from None
                batches.finished(len(batch), seconds)
                self._done += sum(one.finished for one in batch)
                self._under_way.difference_update(batch)
                self._update()

    def _advance_all(self, batch: Sequence[Realization], stop: Stop) -> float:
        """Advance realizations to their ends, on a thread; returns the time that it took [s]."""
        start = time.perf_counter()
        run_in_turn(batch, stop, lambda one: self._advance(one, stop), self._visit)
        return time.perf_counter() - start

    def _visit(self, realizations: Sequence[Realization]) -> None:
        """Keep realizations that came to their ends."""
        if self._checkpoint is not None:
            self._checkpoint.visit(*realizations)

    def _advance(self, realization: Realization, stop: Stop) -> None:
        self._under_way.add(realization)
        while not (realization.finished or stop.is_set()):
            realization.advance()
            if self._checkpoint is not None:
                self._checkpoint.visit(realization)
        if realization.finished:
            realization.close()

    def _compute_elsewhere(self, waiting: Sequence[Realization], stop: Stop) -> None:
        tables = self._config.to_dict()
        batches = Batches(one.number for one in waiting)
        pieces = ((tables, numbers) for numbers in batches)
        work = completed(self._executor, compute_realizations, pieces, stop)
        with closing(work):
            for (_, numbers), future in work:
                try:
                    seconds, results = future.result()
                except MesoslipError:
                    raise
                except Exception as error:
                    named = f"realization {numbers[0]}"
                    if len(numbers) > 1:
                        named = f"realizations {numbers[0]} to {numbers[-1]}"
                    raise WorkerLostError(
                        f"{named}: the worker failed: {type(error).__name__}: {error}"
                    ) from None
                batches.finished(len(numbers), seconds)
                for number, (saved, rows) in zip(numbers, results, strict=True):
                    _restore(self.realizations[number], saved, rows)
                    self._done += 1
                    if self._checkpoint is not None:
                        self._checkpoint.visit(self.realizations[number])
                self._update()

    def _update(self) -> None:
        if self._progress is not None:
            part = sum(one.part_done for one in list(self._under_way))
            self._progress(min(1.0, (self._done + part) / len(self.realizations)))
        if self._checkpoint is not None:
            self._checkpoint.update(self.realizations)


@contextmanager
def _collection_paused(is_wanted: bool) -> Iterator[None]:
    """Without searches for cyclic garbage, of which realizations make none: each would look through
    all of them."""
    pauses = is_wanted and gc.isenabled()
    try:
        if pauses:
            gc.disable()
        yield
    finally:
        if pauses:
            gc.enable()


def compute_realizations(
    piece: tuple[dict[str, Any], Sequence[int]], stop: StopRequest
) -> tuple[float, list[tuple[Saved, dict[str, NDArray[np.float64]]]]]:
    """Run realizations, by nested tables and their numbers, in another process: its time [s]; state
    and tables of each."""
    tables, numbers = piece
    start = time.perf_counter()
    realizations = Realization.all_of(Config.from_dict(tables), numbers)

    def advance(realization: Realization) -> None:
        try:
            while not (realization.finished or stop.is_set()):
                realization.advance()
        finally:
            realization.close()

    run_in_turn(realizations, stop, advance)
    results = [
        (one.save(), {name: rows.read() for name, rows in one.waiting}) for one in realizations
    ]
    return time.perf_counter() - start, results


def run_in_turn(
    realizations: Sequence[Realization],
    stop: StopRequest,
    advance: Callable[[Realization], None],
    visit: Callable[[Sequence[Realization]], None] = lambda _: None,
) -> None:
    """Run realizations one after another with ``advance``, short ones many at a time, and ``visit``
    those that have run together."""
    remaining = realizations
    while remaining and not stop.is_set():
        done = Realization.run_together(remaining) if len(realizations) > 1 else 0
        visit(remaining[:done])
        if done == 0:
            advance(remaining[0])
            done = 1
        remaining = remaining[done:]


def _restore(
    realization: Realization, saved: Saved, tables: dict[str, NDArray[np.float64]]
) -> None:
    """Restore a realization from its state at the end of a run in another process."""
    rows = {}
    for name, values in tables.items():
        rows[name] = Rows(values.shape[1])
        rows[name].add(values)
    realization.restore(saved, rows)
