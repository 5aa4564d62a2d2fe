"""The simulations of a fit, on any executor, each stored when it is finished."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.array_types import Array
from mesoslip.execution.executors import ExecutorLike, as_executor, completed
from mesoslip.execution.pool import Function, Result
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop, StoppedError, StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.features import Feature
from mesoslip.inference.prior import Prior
from mesoslip.inference.traced_experiment import Experiment

# The number of a simulation, its parameters on the unit cube, and whether it has few contacts.
Piece = tuple[int, Array, bool]


@dataclass(frozen=True)
class Simulator:
    """Simulates experiments with one interface, with noise, and reduces them to summaries."""

    experiments: tuple[Experiment, ...]
    prior: Prior
    seed: int
    coarse_count: int | None = None
    """Number of contacts in most simulations; None if all have that of the interface."""
    shares_track: bool = False
    """Whether all experiments have the same track."""

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """The summaries of all traces."""
        if len(self.experiments) == 1:
            return self.experiments[0].summarizer.features
        return tuple(
            replace(
                one,
                name=f"{number + 1}.{one.name}",
                group=f"{one.group} of {experiment.name}",
                trace=number,
            )
            for number, experiment in enumerate(self.experiments)
            for one in experiment.summarizer.features
        )

    @property
    def observed(self) -> Array:
        """Summaries of the measured traces."""
        return np.concatenate([one.summarizer(one.force) for one in self.experiments])

    def forces(self, piece: Piece, stop: StopRequest) -> list[Array] | None:
        """Noisy traces of the force [N] by the number of the simulation, one an experiment; None if
        they cannot be simulated."""
        number, unit, is_coarse = piece
        values = self.prior.values(unit)
        changes, nuisances = self.prior.changes(values), self.prior.nuisances(values)
        if is_coarse:
            changes["contacts.count"] = self.coarse_count
        found = []
        for index, one in enumerate(self.experiments):
            seeds = (self.seed, number, index) if index else (self.seed, number)
            words = np.random.SeedSequence(seeds).generate_state(3, np.uint64)
            if index == 0:
                first = words[0]
            elif self.shares_track:
                words[0] = first
            force = one.simulated(changes, nuisances, words, stop)
            if force is None:
                return None
            found.append(force)
        return found

    def summaries(self, piece: Piece, stop: StopRequest) -> Array:
        """Summaries of a simulation; all NaN if it cannot be simulated. See `forces`."""
        forces = self.forces(piece, stop)
        if forces is None:
            return np.full(len(self.features), np.nan)
        return self.summarized(forces, self.slips(forces))

    def slips(self, forces: Sequence[Array]) -> list[FoundSlips]:
        """Slips of traces [N], one an experiment."""
        pairs = zip(self.experiments, forces, strict=True)
        return [one.summarizer.slips(force) for one, force in pairs]

    def summarized(self, forces: Sequence[Array], slips: Sequence[FoundSlips]) -> Array:
        """Summaries of traces [N], one an experiment, with their slips."""
        every = zip(self.experiments, forces, slips, strict=True)
        return np.concatenate([one.summarizer(force, found) for one, force, found in every])

    def fingerprint(self, observed: Array) -> str:
        """A hash of everything that determines the simulations of a fit."""
        known: list[object] = [self.prior, self.seed, self.coarse_count, self.shares_track]
        state = [np.nan_to_num(observed)]
        for one in self.experiments:
            known += [one.config.to_toml(), one.noise, one.wander_length, one.summarizer.period]
            sampling = one.sampling
            known += [sampling.start, sampling.block, one.apparatus, one.instrument]
            known.append(one.needs_run_in)
            state += [sampling.times, one.force]
        text = repr((program(), *known)).encode()
        return hashlib.sha256(text + np.concatenate(state).tobytes()).hexdigest()


class Simulations:
    """The simulations of a fit so far, each with its number, of an expected total.

    They are determined by the seed and the trace, so that a fit that is started again requests the
    same simulations and finds those in its store.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        expected: int,
        store: Store | None = None,
        executor: ExecutorLike = None,
        progress: Callable[[float], None] | None = None,
        stop: StopRequest | None = None,
    ) -> None:
        self.simulator = simulator
        self._executor = as_executor(executor)
        self._expected = expected
        self._store = store
        self._stored = set() if store is None else store.names()
        self._progress = progress or (lambda _: None)
        self._stop = Stop(stop)
        self._parameters: list[Array] = []
        self._summaries: list[Array] = []
        self._is_coarse: list[bool] = []

    @property
    def has_coarse(self) -> bool:
        """Whether simulations may have few contacts."""
        return self.simulator.coarse_count is not None

    @property
    def is_coarse(self) -> NDArray[np.bool_]:
        """Whether each simulation has few contacts."""
        return np.array(self._is_coarse, dtype=bool)

    @property
    def parameters(self) -> Array:
        """Shape (simulations, parameters)."""
        return np.array(self._parameters).reshape(-1, len(self.simulator.prior))

    @property
    def summaries(self) -> Array:
        """Shape (simulations, summaries)."""
        return np.array(self._summaries).reshape(-1, len(self.simulator.features))

    def __len__(self) -> int:
        return len(self._parameters)

    def add(self, points: Array, *, exact: bool = False) -> None:
        """Simulate at points of the unit cube, shape (points, parameters), with all contacts if
        ``exact``; a stop keeps finished ones."""
        start, is_coarse = len(self), self.has_coarse and not exact
        found = {}
        for number, point in enumerate(points, start):
            summaries = self._read(number, point)
            if summaries is not None:
                found[number] = summaries
        pieces = [
            (one, points[one - start], is_coarse)
            for one in range(start, start + len(points))
            if one not in found
        ]
        for (number, point, _), future in self._completed(self.simulator.summaries, pieces):
            found[number] = future.result()
            if self._store is not None:
                body = {"parameters": _texts(point), "summaries": _texts(found[number])}
                self._store.write(_name(number), body)
            self._progress(min(0.999, (start + len(found)) / self._expected))
        self._parameters += list(points)
        self._summaries += [found[number] for number in range(start, start + len(points))]
        self._is_coarse += [is_coarse] * len(points)

    def forces(self, points: Array) -> Iterator[list[Array]]:
        """Noisy traces at points of the unit cube with all contacts, numbered beyond all others."""
        first = self._expected + len(self)
        pieces = [(number, point, False) for number, point in enumerate(points, first)]
        work = self._completed(self.simulator.forces, pieces, in_order=True)
        for done, (_, future) in enumerate(work, 1):
            forces = future.result()
            self._progress(min(1.0, (len(self) + done) / self._expected))
            if forces is not None:
                yield forces

    def _completed(
        self,
        function: Function[Piece, Result],
        pieces: Iterable[Piece],
        *,
        in_order: bool = False,
    ) -> Iterator[tuple[Piece, Future[Result]]]:
        work = completed(self._executor, function, pieces, self._stop, in_order=in_order)
        with closing(work), self._stop.on_interrupt():
            yield from work
        if self._stop.is_set():
            raise StoppedError("the fit was stopped")

    def _read(self, number: int, point: Array) -> Array | None:
        """Summaries of a stored simulation; None if it is missing or has other parameters."""
        name = _name(number)
        body = self._store.read(name) if self._store is not None and name in self._stored else None
        try:
            if body is None or [float(one) for one in body["parameters"]] != point.tolist():
                return None
            return np.array([float(one) for one in body["summaries"]])
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return None


def _name(number: int) -> str:
    """The name under which a simulation is stored."""
    return f"{number:08d}"


def _texts(values: Array) -> list[str]:
    """Numbers as texts, from which they are read to the bit."""
    return [repr(float(one)) for one in values]
