"""The simulations of a fit, on any executor, each stored when it is finished."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, RunError
from mesoslip.execution.executors import ExecutorLike, as_executor, completed
from mesoslip.execution.pool import Function, Result
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop, StoppedError, StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.prior import Prior
from mesoslip.inference.summaries import Summarizer
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.tables import TRACE_COLUMNS

Array = NDArray[np.float64]

# Maximum number of breaks in a simulation, far more than a trace can have.
MAX_BREAKS = 3e7

# The number of a simulation, and its parameters on the unit cube.
Piece = tuple[int, Array]


@dataclass(frozen=True)
class Simulator:
    """Simulates the experiment, with noise, and reduces the trace to its summaries.

    Attributes
    ----------
    config
        Configuration of the known parameters.
    prior
        Priors of the free parameters.
    summarizer
        Reduces a trace to its summaries.
    noise
        Standard deviation of the noise of the force [N].
    skipped
        Number of samples discarded at the start.
    seed
        Seed of the fit.
    """

    config: Config
    prior: Prior
    summarizer: Summarizer
    noise: float
    skipped: int
    seed: int

    def force(self, piece: Piece, stop: StopRequest) -> Array | None:
        """A noisy trace of the force [N]; None if it cannot be simulated.

        Parameters
        ----------
        piece
            The number of the simulation, which determines its random numbers, and its parameters.
        stop
            A request to stop.

        Raises
        ------
        StoppedError
            If it is stopped.
        """
        number, unit = piece
        words = np.random.SeedSequence((self.seed, number)).generate_state(3, np.uint64)
        changes = self.prior.changes(self.prior.values(unit))
        try:
            config = self.config.replace({**changes, "run.seed": int(words[0] >> np.uint64(2))})
            run = Realization(config, 0, estimates_errors=False)
            while not run.finished and run.breaks < MAX_BREAKS:
                if stop.is_set():
                    raise StoppedError("the fit was stopped")
                run.advance()
        except (ConfigError, RunError):
            return None
        force: Array = run.trace[self.skipped :, TRACE_COLUMNS.index("spring_force")]
        run.close()
        count = len(self.summarizer.time)
        if not run.finished or run.breaks >= MAX_BREAKS or len(force) < count:
            return None
        noise = np.random.default_rng(words[1:]).standard_normal(count)
        return force[:count] + self.noise * noise

    def summaries(self, piece: Piece, stop: StopRequest) -> Array:
        """Summaries of a simulation; all NaN if it cannot be simulated. See `force`."""
        force = self.force(piece, stop)
        if force is None:
            return np.full(len(self.summarizer.names), np.nan)
        return self.summarizer(force)

    def fingerprint(self, observed: Array) -> str:
        """A hash of everything that determines the simulations of a fit."""
        known = (self.config.to_toml(), self.prior, self.noise, self.skipped, self.seed)
        times = self.summarizer.time
        state = np.concatenate([np.nan_to_num(observed), times[[0, -1]], [len(times)]])
        return hashlib.sha256(repr((program(), *known)).encode() + state.tobytes()).hexdigest()


class Simulations:
    """Simulations one after another, each with its number.

    They are determined by the seed and the trace, so that a fit that is started again requests the
    same simulations and finds those in its store.

    Parameters
    ----------
    simulator, observed
        The simulator, and the summaries of the trace.
    expected
        Number of simulations of the whole fit.
    store
        Where they are kept; nowhere by default.
    executor
        Where they are computed; on as many threads as there are processors by default.
    progress
        Called with the fraction of the simulations that is done.
    stop
        A request to stop.

    Attributes
    ----------
    parameters, summaries
        Of all simulations so far, shapes (simulations, parameters), (simulations, summaries).
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

    @property
    def parameters(self) -> Array:
        return np.array(self._parameters).reshape(-1, len(self.simulator.prior))

    @property
    def summaries(self) -> Array:
        return np.array(self._summaries).reshape(-1, len(self.simulator.summarizer.names))

    def __len__(self) -> int:
        return len(self._parameters)

    def add(self, points: Array) -> None:
        """Simulate at points of the unit cube, shape (points, parameters).

        Raises
        ------
        StoppedError
            If the fit is stopped; what was simulated is kept.
        """
        start = len(self)
        found = {}
        for number, point in enumerate(points, start):
            summaries = self._read(number, point)
            if summaries is not None:
                found[number] = summaries
        missing = ((one, points[one - start]) for one in range(start, start + len(points)))
        pieces = [piece for piece in missing if piece[0] not in found]
        for (number, point), future in self._completed(self.simulator.summaries, pieces):
            found[number] = future.result()
            if self._store is not None:
                body = {"parameters": _texts(point), "summaries": _texts(found[number])}
                self._store.write(_name(number), body)
            self._progress(min(0.999, (start + len(found)) / self._expected))
        self._parameters += list(points)
        self._summaries += [found[number] for number in range(start, start + len(points))]

    def forces(self, points: Array) -> Iterator[Array]:
        """Noisy traces at points of the unit cube, with numbers after those of all others.

        Raises
        ------
        StoppedError
            If the fit is stopped.
        """
        pieces = enumerate(points, self._expected + len(self))
        for _, future in self._completed(self.simulator.force, pieces, in_order=True):
            force = future.result()
            if force is not None:
                yield force

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
        """Summaries of a stored simulation; None if it is not there, or of other parameters."""
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
    """Numbers as Python writes them, which are read to the bit."""
    return [repr(float(one)) for one in values]
