"""All realizations of a run, side by side on threads, with checkpoints on the way."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING

from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.stop import StopFlag

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.checkpoint import Checkpoint

TOO_MUCH = (
    "not enough memory for what is recorded: a larger output.avalanche_size or "
    "output.snapshot_size, or a longer output.interval, takes less"
)


# How often the main thread looks at what the others do [s].
LOOK_SECONDS = 0.1


@dataclass
class Results:
    """What came out of a run."""

    config: Config
    realizations: list[Realization]
    complete: bool
    """Whether every realization came to its end; not so when it was stopped."""
    wall_seconds: float


def run_realizations(
    config: Config,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Run all realizations of a configuration on threads.

    Parameters
    ----------
    config
        What to run.
    workers
        Realizations that run at the same time, at least 1; as many as there are processors by
        default.
    progress
        Called now and then, from this thread, with the part of the work that is done.
    stop
        Set by who wants the run to stop soon, between two segments; Ctrl-C does the same.
    checkpoint
        Where to keep checkpoints, and what a run before has kept there; none by default.

    Raises
    ------
    ConfigError
        If the number of workers is none.
    RunError
        If a realization fails; the checkpoint stays.
    """
    workers = checked_workers(workers)
    start = time.perf_counter()
    stop = stop or StopFlag()
    realizations = [Realization(config, number) for number in range(config.run.realizations)]
    before = checkpoint.restore(realizations) if checkpoint is not None else 0.0

    def finish(realization: Realization) -> None:
        while not (realization.finished or stop.is_set()):
            realization.advance()
            if checkpoint is not None:
                checkpoint.visit(realization)
        if realization.finished:
            realization.close()

    def look(done: set[Future[None]]) -> None:
        for future in done:
            try:
                future.result()
            except MemoryError:
                raise RunError(TOO_MUCH) from None
        if progress is not None:
            progress(sum(one.part_done for one in realizations) / len(realizations))
        if checkpoint is not None:
            checkpoint.look(realizations)

    has_failed = False
    with ThreadPoolExecutor(min(workers, len(realizations))) as pool:
        pending: set[Future[None]] = set()
        try:
            pending = {pool.submit(finish, one) for one in realizations if not one.finished}
            while pending:
                done, pending = wait(pending, LOOK_SECONDS, return_when="FIRST_EXCEPTION")
                look(done)
        except KeyboardInterrupt:
            pass
        except RunError:
            has_failed = True
            raise
        finally:
            stop.set()
            for future in pending:
                future.cancel()
            wait(pending)
            # Whatever ends the run: what there is can be taken up, unless it cannot go on.
            is_complete = all(one.finished for one in realizations)
            if checkpoint is not None and not (has_failed or is_complete):
                checkpoint.write(realizations)
    return Results(config, realizations, is_complete, before + time.perf_counter() - start)


def checked_workers(workers: int | None) -> int:
    """The number of workers, as a number of Python's own.

    Raises
    ------
    ConfigError
        If it is no whole number of at least 1.
    """
    if workers is None:
        return os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, Integral) or workers < 1:
        message = "must be a whole number of at least 1; as many as processors without it"
        raise ConfigError([Problem("", "workers", message, workers)])
    return int(workers)
