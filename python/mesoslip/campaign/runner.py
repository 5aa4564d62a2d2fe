"""Run a sweep: stored points are read, missing ones computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.campaign.assembly import Assembly
from mesoslip.campaign.plan import Combination, Plan, described
from mesoslip.campaign.point import (
    FORMAT,
    Outcome,
    Task,
    combination_key,
    compute,
    point_name,
)
from mesoslip.errors import MesoslipError
from mesoslip.execution.executors import (
    Executor,
    ExecutorLike,
    ThreadsThenProcesses,
    as_executor,
    completed,
)
from mesoslip.execution.pool import PoolError
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop, StopRequest
from mesoslip.execution.store import Pieces, Store

if TYPE_CHECKING:
    import xarray as xr

# Ending of a sweep that was stopped.
INTERRUPTED = "interrupted"
# Maximum time to wait for a user's measure that ignores a stop [s].
MAX_WAIT = 5.0


@dataclass
class Sweep:
    """Results of a sweep.

    Attributes
    ----------
    dataset
        See `mesoslip.campaign.assembly`.
    failures
        Failed points, and the reasons.
    stored, computed, missing
        Numbers of points that were in the store, that were computed, and that are neither.
    ending
        Why the sweep ended before it was complete; empty if it is complete.
    """

    dataset: xr.Dataset
    failures: dict[str, str] = field(default_factory=dict)
    stored: int = 0
    computed: int = 0
    missing: int = 0
    ending: str = ""

    @property
    def complete(self) -> bool:
        """Whether every point was computed or failed."""
        return self.missing == 0


@dataclass(frozen=True)
class Group:
    """Combinations with the same points, such as those that differ only in their titles.

    Attributes
    ----------
    key
        Hash of everything that determines their measures.
    combinations
        At least one.
    """

    key: str
    combinations: list[Combination]

    def names(self, plan: Plan) -> Iterator[str]:
        """Names of the points of all realizations."""
        return (point_name(self.key, number) for number in range(plan.realizations))


def groups(plan: Plan) -> list[Group]:
    """All combinations of a sweep, in the order of the first of each group.

    Raises
    ------
    ConfigError
        If a combination cannot be run.
    """
    found: dict[str, Group] = {}
    for one in plan.combinations:
        key = combination_key(one.config, plan.measures, plan.sweep.discard)
        found.setdefault(key, Group(key, [])).combinations.append(one)
    return list(found.values())


def output_path(store: Pieces, name: str) -> Path:
    """Path of the output of a point, if it is kept."""
    return store.path / f"{name}.nc"


def stored_measures(store: Pieces, plan: Plan, name: str) -> dict[str, float] | None:
    """Measures of a stored point; None if anything that the sweep needs is missing."""
    if plan.sweep.traces and not output_path(store, name).exists():
        return None
    body = store.read(name)
    try:
        return None if body is None else {key: float(one) for key, one in body["measures"].items()}
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        return None


def stored_body(task: Task, outcome: Outcome, combination: Combination) -> dict[str, Any]:
    """Content of a point in the store."""
    return {
        "format": FORMAT,
        "program": program(),
        "point": dict(combination.values),
        "realization": task.realization,
        # Python reads its own representation of numbers exactly.
        "measures": {name: repr(value) for name, value in outcome.measures.items()},
        "seconds": outcome.seconds,
    }


def task_of(plan: Plan, group: Group, realization: int) -> Task:
    """A point for a worker."""
    return Task(
        point_name(group.key, realization),
        group.combinations[0].config.to_dict(),
        realization,
        tuple((one.name, one.source, one.path) for one in plan.measures),
        plan.sweep.discard,
        plan.sweep.traces,
    )


def run_sweep(
    plan: Plan,
    *,
    store: Store | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> Sweep:
    """Compute the missing points of a sweep, and build its dataset.

    Parameters
    ----------
    plan
        The sweep.
    store
        Where points are stored, and read if they exist; nowhere by default.
    executor
        Where points are computed, or on how many workers; on as many as there are processors by
        default: threads at first, and processes in a sweep that takes long.
    progress
        Called with the fraction of the points that are done.
    stop
        A request to stop soon; Ctrl-C is one too.

    Raises
    ------
    ConfigError
        If a combination cannot be run; nothing is run then.
    FileError
        If the store cannot be read or written; what was written stays.
    """
    run = _Run(plan, store, progress)
    checked = as_executor(executor, ThreadsThenProcesses)
    requested = Stop(stop)
    ending = ""
    try:
        with requested.on_interrupt():
            run.read_store(requested)
            run.compute(checked, requested)
    except PoolError as error:
        ending = str(error)
    return run.result(ending)


class _Run:
    """A running sweep."""

    def __init__(
        self, plan: Plan, store: Store | None, progress: Callable[[float], None] | None
    ) -> None:
        self._plan = plan
        self._store = store
        self._progress = progress
        self._groups = groups(plan)
        self._missing: list[tuple[Group, Sequence[int]]] = []
        # By the names of their tasks.
        self._in_flight: dict[str, Group] = {}
        self._assembly = Assembly(plan)
        self._failures: dict[str, str] = {}
        self._stored = self._computed = self._failed = 0

    def read_store(self, stop: Stop) -> None:
        """Take the points that are in the store, and find out which are missing."""
        store, plan = self._store, self._plan
        if store is None:
            self._missing = [(group, range(plan.realizations)) for group in self._groups]
            return
        there = store.names()
        names: list[str] = []
        for group in self._groups:
            missing = []
            for number, name in enumerate(group.names(plan)):
                if stop.is_set():
                    return
                names.append(name)
                measures = stored_measures(store, plan, name) if name in there else None
                if measures is None:
                    missing.append(number)
                    continue
                for one in group.combinations:
                    self._assembly.put(one, number, measures)
                self._stored += len(group.combinations)
            self._missing.append((group, missing))
        store.write_manifest(self._assembly.manifest(names))

    def compute(self, executor: Executor, stop: Stop) -> None:
        """Compute the points that are missing, and keep each as soon as it is there."""
        self._look()
        work = completed(executor, compute, self._tasks(), stop, max_wait=MAX_WAIT)
        with closing(work):
            for task, future in work:
                try:
                    outcome = future.result()
                except MesoslipError as error:
                    outcome = Outcome({}, failure=str(error))
                except Exception as error:
                    failure = f"its worker failed: {type(error).__name__}: {error}"
                    outcome = Outcome({}, failure=failure)
                self._take(task, self._in_flight.pop(task.name), outcome)
                self._look()

    def _tasks(self) -> Iterator[Task]:
        for group, missing in self._missing:
            for number in missing:
                task = task_of(self._plan, group, number)
                self._in_flight[task.name] = group
                yield task

    def _take(self, task: Task, group: Group, outcome: Outcome) -> None:
        if outcome.failure:
            values = {**group.combinations[0].values, "realization": task.realization}
            self._failures[described(values)] = outcome.failure
            self._failed += len(group.combinations)
            for one in group.combinations:
                self._assembly.fail(one, task.realization)
        elif outcome.is_complete:
            if self._store is not None:
                body = stored_body(task, outcome, group.combinations[0])
                self._store.write(task.name, body, outcome.trace)
            self._computed += len(group.combinations)
            for one in group.combinations:
                self._assembly.put(one, task.realization, outcome.measures)

    @property
    def _done(self) -> int:
        return self._stored + self._computed + self._failed

    def _look(self) -> None:
        if self._progress is not None:
            self._progress(self._done / self._plan.count)

    def result(self, ending: str) -> Sweep:
        """The sweep as it is."""
        missing = self._plan.count - self._done
        if missing and not ending:
            ending = INTERRUPTED
        dataset = self._assembly.dataset(ending, self._failures)
        return Sweep(dataset, self._failures, self._stored, self._computed, missing, ending)
