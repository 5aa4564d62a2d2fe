"""A sweep from its plan to its dataset: what is stored is taken, what is missing is computed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mesoslip.campaign.assembly import Assembly
from mesoslip.campaign.execution import Executor, on_this_machine
from mesoslip.campaign.plan import Combination, Plan, described
from mesoslip.campaign.point import Task, point_name, program
from mesoslip.campaign.store import Points, Store, Stored
from mesoslip.errors import RunError
from mesoslip.simulation.stop import StopFlag

if TYPE_CHECKING:
    import xarray as xr


@dataclass
class Sweep:
    """What came out of a sweep.

    Attributes
    ----------
    dataset
        See `mesoslip.campaign.assembly`.
    failures
        Which points failed, and why.
    taken, computed, missing
        Points that were there, that were computed, and that are neither.
    ending
        What ended the sweep before it was complete; empty if nothing did.
    """

    dataset: xr.Dataset
    failures: dict[str, str] = field(default_factory=dict)
    taken: int = 0
    computed: int = 0
    missing: int = 0
    ending: str = ""

    @property
    def complete(self) -> bool:
        """Whether every point was computed or failed."""
        return self.missing == 0


@dataclass(frozen=True)
class Place:
    """A point of a sweep: its combination, realization, and name in the store."""

    combination: Combination
    realization: int
    name: str

    def __str__(self) -> str:
        return described({**self.combination.values, "realization": self.realization})


def places(plan: Plan) -> Iterator[Place]:
    """All points of a sweep: the realizations of the first combination, of the second, ..."""
    for one in plan.combinations:
        for realization in range(plan.realizations):
            name = point_name(one.config, realization, plan.measures, plan.sweep.discard)
            yield Place(one, realization, name)


def taken_from(store: Points, plan: Plan, place: Place) -> Stored | None:
    """A point of a store; None if not all that is wanted of it is there."""
    if plan.sweep.traces and not store.trace_path(place.name).exists():
        return None
    return store.read(place.name)


def task_of(plan: Plan, place: Place) -> Task:
    """What a worker needs to know of a point."""
    return Task(
        place.name,
        place.combination.config.to_dict(),
        place.realization,
        tuple((one.name, one.source, one.path) for one in plan.measures),
        plan.sweep.discard,
        plan.sweep.traces,
        program(),
    )


def run_sweep(
    plan: Plan,
    *,
    store: Store | None = None,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
) -> Sweep:
    """Compute what is missing of a sweep, and put everything together.

    Parameters
    ----------
    plan
        The sweep.
    store
        Where points are taken from and kept; nowhere by default.
    executor
        Where points are computed; on as many workers as there are processors by default.
    progress
        Called with the part of the points that are there.
    stop
        Set by who wants the sweep to stop soon; Ctrl-C does the same.

    Raises
    ------
    ConfigError
        If a combination cannot be run; nothing is run then.
    FileError
        If the store cannot be read or written; what was written stays.
    """
    executor = executor or on_this_machine(os.cpu_count() or 1)
    stop = stop or StopFlag()
    assembly = Assembly(plan)
    # Points of one name, as of runs that differ by their titles, are one.
    waiting: dict[str, list[Place]] = {}
    taken = computed = failed = 0
    there = set() if store is None else store.names()
    for place in places(plan):
        stored = None
        if store is not None and place.name in there and place.name not in waiting:
            stored = taken_from(store, plan, place)
        if stored is None:
            waiting.setdefault(place.name, []).append(place)
        else:
            assembly.put(place.combination, place.realization, stored.measures)
            taken += 1
    if store is not None:
        store.write_manifest(assembly.manifest(places(plan)))
    failures: dict[str, str] = {}
    ending = ""

    def tell() -> None:
        if progress is not None:
            progress((taken + computed + failed) / plan.count)

    tell()
    with ExitStack() as stack:
        finished = executor((task_of(plan, alike[0]) for alike in waiting.values()), stop)
        stack.callback(getattr(finished, "close", lambda: None))
        try:
            for task, outcome in finished:
                alike = waiting[task.name]
                if outcome.failure:
                    failures[str(alike[0])] = outcome.failure
                    failed += len(alike)
                    for place in alike:
                        assembly.fail(place.combination, place.realization)
                elif outcome.is_complete:
                    if store is not None:
                        store.write(task, outcome, alike[0].combination.values)
                    computed += len(alike)
                    for place in alike:
                        assembly.put(place.combination, place.realization, outcome.measures)
                tell()
        except KeyboardInterrupt:
            stop.set()
        except RunError as error:
            ending = str(error)
    missing = plan.count - taken - computed - failed
    if missing and not ending:
        ending = "interrupted"
    return Sweep(assembly.dataset(ending, failures), failures, taken, computed, missing, ending)
