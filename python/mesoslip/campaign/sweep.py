"""Sweeps: stored points are read, missing ones computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from typing import Any

from mesoslip.array_types import Dataset
from mesoslip.campaign.combination import Value, described
from mesoslip.campaign.point import FORMAT, Outcome, Task, chain_keys, compute, point_name
from mesoslip.campaign.sweep_dataset import SweepDataset
from mesoslip.campaign.sweep_plan import Plan, as_plan
from mesoslip.configuration import arguments
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import MesoslipError, RunError
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

# Ending of a sweep that was stopped.
INTERRUPTED = "interrupted"
# Maximum time to wait for a user's measure that ignores a stop [s].
MAX_WAIT = 5.0


@dataclass(frozen=True)
class Sweep:
    """The dataset of a sweep, its failures by point, numbers of stored, computed and missing
    points, and why it ended early."""

    dataset: Dataset
    failures: dict[str, str]
    stored: int
    computed: int
    missing: int
    ending: str

    @property
    def complete(self) -> bool:
        """Whether every point was computed or failed."""
        return self.missing == 0


@dataclass(frozen=True, slots=True)
class Group:
    """Chains of combinations with the same points, such as those that differ only in their titles.

    Combinations are numbers in the plan. Each one of a chain has a key, a hash of everything that
    determines its measures.
    """

    keys: tuple[str, ...]
    chains: list[tuple[int, ...]]

    def names(self, realization: int) -> tuple[str, ...]:
        """Names of the points of a realization, in the order of the runs."""
        return tuple(point_name(key, realization) for key in self.keys)


def groups(plan: Plan) -> list[Group]:
    """All chains of a sweep, in the order of the first of each group."""
    found: dict[tuple[str, ...], Group] = {}
    for chain in plan.chains():
        keys = chain_keys(plan.keys[one] for one in chain)
        found.setdefault(keys, Group(keys, [])).chains.append(chain)
    return list(found.values())


def stored_measures(store: Pieces, plan: Plan, name: str) -> dict[str, float] | None:
    """Measures of a stored point; None if one, or the output that is to be kept, is missing."""
    if plan.sweep.traces and not (store.path / f"{name}.nc").exists():
        return None
    body = store.read(name)
    try:
        return None if body is None else {key: float(one) for key, one in body["measures"].items()}
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        return None


def stored_body(realization: int, outcome: Outcome, values: Mapping[str, Value]) -> dict[str, Any]:
    """Content of a point in the store."""
    return {
        "format": FORMAT,
        "program": program(),
        "point": dict(values),
        "realization": realization,
        # Python reads its own representation of numbers exactly.
        "measures": {name: repr(value) for name, value in outcome.measures.items()},
        "seconds": outcome.seconds,
    }


def task_of(plan: Plan, group: Group, realization: int) -> Task:
    """The points of a chain for a worker."""
    return Task(
        group.names(realization),
        tuple(plan.config(one).to_dict() for one in group.chains[0]),
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

    Without a store points are not stored. A stop, or Ctrl-C, ends the sweep soon. If a combination
    cannot be run, a `ConfigError` is raised before any run; what was stored stays in any case.
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
    """A sweep under way."""

    def __init__(
        self, plan: Plan, store: Store | None, progress: Callable[[float], None] | None
    ) -> None:
        self._plan = plan
        self._store = store
        self._progress = progress
        self._groups = groups(plan)
        # Chains with missing points: the number of the realization, and which points are missing.
        self._missing: list[tuple[Group, int, Sequence[int]]] = []
        # By the names of the last points of their tasks.
        self._in_flight: dict[str, tuple[Group, Sequence[int]]] = {}
        self._dataset = SweepDataset(plan)
        self._failures: dict[str, str] = {}
        self._stored = self._computed = self._failed = 0

    def read_store(self, stop: Stop) -> None:
        """Take the points that are in the store, and list those that are missing."""
        store, plan = self._store, self._plan
        there = set() if store is None else store.names()
        names: list[str] = []
        for group in self._groups:
            for number in range(plan.realizations):
                missing = []
                for at, name in enumerate(group.names(number)):
                    if stop.is_set():
                        return
                    names.append(name)
                    measures = None
                    if store is not None and name in there:
                        measures = stored_measures(store, plan, name)
                    if measures is None:
                        missing.append(at)
                    else:
                        self._stored += self._put(group, at, number, measures)
                if missing:
                    self._missing.append((group, number, missing))
        if store is not None:
            store.write_manifest(self._dataset.manifest(names))

    def _put(self, group: Group, at: int, realization: int, measures: dict[str, float]) -> int:
        """Put the measures of a point of each chain into the dataset, and count the chains."""
        for chain in group.chains:
            self._dataset.put(chain[at], realization, measures)
        return len(group.chains)

    def compute(self, executor: Executor, stop: Stop) -> None:
        """Compute the points that are missing, and keep those of each chain as it is finished."""
        self._report()
        work = completed(executor, compute, self._tasks(), stop, max_wait=MAX_WAIT)
        with closing(work):
            for task, future in work:
                try:
                    outcomes = future.result()
                except MesoslipError as error:
                    outcomes = (Outcome({}, failure=str(error)),) * len(task.names)
                except Exception as error:
                    failure = f"its worker failed: {type(error).__name__}: {error}"
                    outcomes = (Outcome({}, failure=failure),) * len(task.names)
                group, missing = self._in_flight.pop(task.names[-1])
                for at, outcome in enumerate(outcomes):
                    if at in missing:
                        self._take(task, group, at, outcome)
                self._report()

    def _tasks(self) -> Iterator[Task]:
        for group, number, missing in self._missing:
            task = task_of(self._plan, group, number)
            self._in_flight[task.names[-1]] = group, missing
            yield task

    def _take(self, task: Task, group: Group, at: int, outcome: Outcome) -> None:
        """Keep a point of a chain."""
        values = self._plan.values(group.chains[0][at])
        if outcome.failure:
            point = described({**values, "realization": task.realization})
            self._failures[point] = outcome.failure
            self._failed += len(group.chains)
            for chain in group.chains:
                self._dataset.fail(chain[at], task.realization)
            return
        if self._store is not None:
            body = stored_body(task.realization, outcome, values)
            self._store.write(task.names[at], body, outcome.trace)
        self._computed += self._put(group, at, task.realization, outcome.measures)

    @property
    def _done(self) -> int:
        return self._stored + self._computed + self._failed

    def _report(self) -> None:
        if self._progress is not None:
            self._progress(self._done / self._plan.count)

    def result(self, ending: str) -> Sweep:
        """The sweep as it is now."""
        missing = self._plan.count - self._done
        if missing and not ending:
            ending = INTERRUPTED
        dataset = self._dataset.dataset(ending, self._failures)
        return Sweep(dataset, self._failures, self._stored, self._computed, missing, ending)


@arguments.checked(progress=arguments.function)
def sweep(
    plan: PathLike | Mapping[str, Any] | Plan,
    *,
    store: PathLike | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
) -> Dataset:
    """Run a configuration over a range of parameters, and measure each run.

    Parameters
    ----------
    plan
        The file of a sweep, nested tables, or a `mesoslip.campaign.sweep_plan.Plan`.
    store
        Folder in which each finished point is stored, and from which it is read when the sweep is
        called again; by default points are not stored.
    executor
        Where points are computed: `Threads`, `Processes` or `Dask`, or a number of workers. By
        default as many workers as processors: threads at first, and processes if the sweep takes
        long. The result does not depend on it.
    progress
        Called repeatedly with the fraction of finished points, 0 to 1.

    Returns
    -------
    xarray.Dataset
        Dimensions: each swept key, and ``realization``; variables: ``status`` (0 ok, 1 failed, 2
        missing) and the measures. Its attribute ``failures`` says why points failed.

    Raises
    ------
    FileError, ConfigError
        If the sweep cannot be read, or it or one of its combinations is wrong.
    RunError
        If the scheduler is lost, or workers cannot be started.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> grid = {"slider.stiffness": ["100 N/m", "400 N/m"]}
    >>> plan = {"base": "klein.toml", "contacts": {"count": 200}, "run": {"duration": "3 s"}}
    >>> data = mesoslip.sweep({**plan, "sweep": {"measures": ["mean_force"], "grid": grid}})
    >>> dict(data["mean_force"].sizes)
    {'slider.stiffness': 2, 'realization': 1}
    """
    checked = as_plan(plan)
    kept = None if store is None else Store(as_path(store), "points")
    with kept or nullcontext():
        done = run_sweep(checked, store=kept, executor=executor, progress=progress)
    if done.missing and done.ending != INTERRUPTED:
        raise RunError(done.ending)
    return done.dataset
