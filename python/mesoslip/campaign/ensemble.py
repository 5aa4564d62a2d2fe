"""The realizations of one run on the workers of a cluster."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.campaign.cluster import on_cluster
from mesoslip.campaign.point import program
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError, MesoslipError, RunError
from mesoslip.simulation.realization import Realization, Saved
from mesoslip.simulation.runner import Results
from mesoslip.simulation.stop import StopFlag
from mesoslip.simulation.tables import Rows

if TYPE_CHECKING:
    from distributed import Client

    from mesoslip.simulation.checkpoint import Checkpoint

# The configuration as nested tables, the number of a realization, and what is to compute it.
Task = tuple[dict[str, Any], int, str]


def compute_realization(task: Task) -> tuple[Saved, dict[str, NDArray[np.float64]]]:
    """Run a realization: what came of it, and its tables.

    Raises
    ------
    RunError
        If it fails, or the worker is another program.
    """
    tables, number, wanted = task
    if wanted != program():
        raise RunError(f"the worker has {program()}, and {wanted} is wanted")
    realization = Realization(Config.from_dict(tables), number)
    try:
        while not realization.finished:
            realization.advance()
    finally:
        realization.close()
    return realization.save(), {name: rows.read() for name, rows in realization.waiting}


def run_on_cluster(
    config: Config,
    client: Client,
    *,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Run all realizations of a configuration on a cluster; see `run_realizations`.

    A checkpoint keeps the realizations that are done.

    Raises
    ------
    FileError
        If the checkpoint has realizations that are under way.
    RunError
        If a realization fails, or the scheduler is gone; the checkpoint stays.
    """
    start = time.perf_counter()
    stop = stop or StopFlag()
    realizations = [Realization(config, number) for number in range(config.run.realizations)]
    before = checkpoint.restore(realizations) if checkpoint is not None else 0.0
    if any(one.advances > 0 and not one.finished for one in realizations):
        raise FileError(
            "the checkpoint has realizations that are under way, which go on without --scheduler "
            "only"
        )
    tables = config.to_dict()
    tasks = ((tables, one.number, program()) for one in realizations if not one.finished)
    try:
        for task, result in on_cluster(client, compute_realization, tasks, stop):
            realization = realizations[task[1]]
            if isinstance(result, MesoslipError):
                raise result
            if isinstance(result, Exception):
                name = type(result).__name__
                raise RunError(f"realization {task[1]}: its worker failed: {name}: {result}")
            _take(realization, *result)
            if checkpoint is not None:
                checkpoint.visit(realization)
                checkpoint.look(realizations)
            if progress is not None:
                progress(sum(one.part_done for one in realizations) / len(realizations))
    except KeyboardInterrupt:
        stop.set()
    finally:
        is_complete = all(one.finished for one in realizations)
        if checkpoint is not None and not is_complete:
            checkpoint.write(realizations)
    return Results(config, realizations, is_complete, before + time.perf_counter() - start)


def _take(realization: Realization, saved: Saved, tables: dict[str, NDArray[np.float64]]) -> None:
    """Give a realization what has come of it elsewhere."""
    rows = {}
    for name, values in tables.items():
        rows[name] = Rows(values.shape[1])
        rows[name].add(values)
    realization.restore(saved, rows)
