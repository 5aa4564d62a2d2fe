"""All realizations of a run, on any executor, with checkpoints on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.errors import FileError, MesoslipError, RunError
from mesoslip.execution.executors import Executor, ExecutorLike, as_executor, completed
from mesoslip.execution.pool import PoolError, WorkerLostError
from mesoslip.execution.stop import Stop, StopRequest
from mesoslip.simulation.realization import Realization, Saved
from mesoslip.simulation.recorded_tables import Rows

if TYPE_CHECKING:
    from mesoslip.simulation.checkpoint import Checkpoint

NO_MEMORY = (
    "not enough memory for what is recorded: a larger output.avalanche_size or "
    "output.snapshot_size, or a longer output.interval, takes less"
)

# A realization on its way to another process: the configuration as nested tables, and its number.
Remote = tuple[dict[str, Any], int]


@dataclass
class Results:
    """Results of a run."""

    config: Config
    realizations: list[Realization]
    complete: bool
    """Whether every realization came to its end; false if the run was stopped."""
    wall_seconds: float


def run_realizations(
    config: Config,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Run all realizations of a configuration.

    Parameters
    ----------
    config
        The configuration.
    executor
        Where realizations are computed, or how many threads compute them; on as many threads as
        there are processors by default.
    progress
        Called now and then, from this thread, with the fraction of the work that is done.
    stop
        A request to stop between two segments; Ctrl-C is one too.
    checkpoint
        Where checkpoints are kept, and what an earlier run has left there; none by default. On
        other executors than threads it keeps the realizations that are complete.

    Raises
    ------
    ConfigError
        If the number of workers is not positive.
    FileError
        If the checkpoint cannot be resumed.
    RunError
        If a realization fails, or no worker is left; the checkpoint stays.
    """
    run = _Run(config, as_executor(executor), progress, checkpoint)
    start = time.perf_counter()
    before = checkpoint.restore(run.realizations) if checkpoint is not None else 0.0
    run.check()
    has_failed = False
    requested = Stop(stop)
    try:
        with requested.on_interrupt():
            run.compute(requested)
    except (PoolError, WorkerLostError):
        raise
    except MesoslipError:
        has_failed = True
        raise
    finally:
        # Whatever ends the run: it can be resumed, unless it failed.
        is_complete = all(one.finished for one in run.realizations)
        if checkpoint is not None and not (has_failed or is_complete):
            checkpoint.write(run.realizations)
    return Results(config, run.realizations, is_complete, before + time.perf_counter() - start)


class _Run:
    """Realizations under way."""

    def __init__(
        self,
        config: Config,
        executor: Executor,
        progress: Callable[[float], None] | None,
        checkpoint: Checkpoint | None,
    ) -> None:
        self.realizations = [
            Realization(config, number) for number in range(config.run.realizations)
        ]
        self._config = config
        self._executor = executor
        self._progress = progress
        self._checkpoint = checkpoint
        self._under_way: set[Realization] = set()

    def check(self) -> None:
        """Make sure that realizations that are under way can go on.

        Raises
        ------
        FileError
            If they cannot.
        """
        under_way = any(one.advances > 0 and not one.finished for one in self.realizations)
        if under_way and not self._executor.shares_memory:
            raise FileError(
                "the checkpoint has realizations that are under way, which only threads resume: "
                "without --scheduler"
            )

    def compute(self, stop: Stop) -> None:
        """Advance all realizations to their ends, or until the stop."""
        waiting = [one for one in self.realizations if not one.finished]
        self._done = len(self.realizations) - len(waiting)
        if self._executor.shares_memory:
            self._compute_here(waiting, stop)
        else:
            self._compute_elsewhere(waiting, stop)

    def _compute_here(self, waiting: Sequence[Realization], stop: Stop) -> None:
        work = completed(self._executor, self._advance, waiting, stop, look=self._look)
        with closing(work):
            for realization, future in work:
                try:
                    future.result()
                except MemoryError:
                    raise RunError(NO_MEMORY) from None
                self._done += realization.finished
                self._under_way.discard(realization)
                self._look()

    def _advance(self, realization: Realization, stop: Stop) -> None:
        """Advance a realization to its end; called on threads."""
        self._under_way.add(realization)
        while not (realization.finished or stop.is_set()):
            realization.advance()
            if self._checkpoint is not None:
                self._checkpoint.visit(realization)
        if realization.finished:
            realization.close()

    def _compute_elsewhere(self, waiting: Sequence[Realization], stop: Stop) -> None:
        tables = self._config.to_dict()
        pieces = ((tables, one.number) for one in waiting)
        work = completed(self._executor, compute_realization, pieces, stop)
        with closing(work):
            for (_, number), future in work:
                try:
                    saved, rows = future.result()
                except MesoslipError:
                    raise
                except Exception as error:
                    raise WorkerLostError(
                        f"realization {number}: its worker failed: {type(error).__name__}: {error}"
                    ) from None
                _restore(self.realizations[number], saved, rows)
                self._done += 1
                if self._checkpoint is not None:
                    self._checkpoint.visit(self.realizations[number])
                self._look()

    def _look(self) -> None:
        if self._progress is not None:
            part = sum(one.part_done for one in list(self._under_way))
            self._progress(min(1.0, (self._done + part) / len(self.realizations)))
        if self._checkpoint is not None:
            self._checkpoint.look(self.realizations)


def compute_realization(
    piece: Remote, stop: StopRequest
) -> tuple[Saved, dict[str, NDArray[np.float64]]]:
    """Run a realization in another process: its state at the end, and its tables.

    Raises
    ------
    RunError
        If it fails.
    """
    tables, number = piece
    realization = Realization(Config.from_dict(tables), number)
    try:
        while not (realization.finished or stop.is_set()):
            realization.advance()
    finally:
        realization.close()
    return realization.save(), {name: rows.read() for name, rows in realization.waiting}


def _restore(
    realization: Realization, saved: Saved, tables: dict[str, NDArray[np.float64]]
) -> None:
    """Set a realization to its state at the end of a run in another process."""
    rows = {}
    for name, values in tables.items():
        rows[name] = Rows(values.shape[1])
        rows[name].add(values)
    realization.restore(saved, rows)
