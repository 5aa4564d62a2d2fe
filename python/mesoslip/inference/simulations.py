"""The simulations of a fit: on all cores, kept as they come, taken up again after a stop."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, RunError
from mesoslip.inference.prior import Prior
from mesoslip.inference.summaries import Summarizer
from mesoslip.output.targets import written_whole
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.stop import StopFlag

Array = NDArray[np.float64]

# Breaks after which a simulation is given up: far more than the trace can be of.
MOST_BREAKS = 3e7
# Simulations between two times that they are written to their file.
KEPT_EVERY = 64


class StoppedError(Exception):
    """Somebody has stopped the fit."""


@dataclass(frozen=True)
class Simulator:
    """Simulates the experiment with parameters, noise and all, and sums the trace up.

    Attributes
    ----------
    config
        What is known.
    prior
        What is not.
    summarizer
        How a trace is summed up.
    noise
        Standard deviation of the noise of the force [N].
    skipped
        Samples at the start that do not count.
    seed
        Seed of the fit.
    """

    config: Config
    prior: Prior
    summarizer: Summarizer
    noise: float
    skipped: int
    seed: int

    def force(self, number: int, unit: Array) -> Array | None:
        """A noisy trace of the force [N]; None if it cannot be simulated.

        Parameters
        ----------
        number
            Of the simulation, which gives it its own random numbers.
        unit
            Parameters on the unit cube.
        """
        words = np.random.SeedSequence((self.seed, number)).generate_state(3, np.uint64)
        changes = self.prior.changes(self.prior.values(unit))
        try:
            config = self.config.replace({**changes, "run.seed": int(words[0] >> np.uint64(2))})
            run = Realization(config, 0)
            while not run.finished and run.breaks < MOST_BREAKS:
                run.advance()
        except (ConfigError, RunError):
            return None
        force: Array = run.trace[self.skipped :, 4]
        run.close()
        if not run.finished or run.breaks >= MOST_BREAKS:
            return None
        count = len(self.summarizer.time)
        if len(force) < count:
            return None
        noise = np.random.default_rng(words[1:]).standard_normal(count)
        return force[:count] + self.noise * noise

    def __call__(self, number: int, unit: Array) -> Array:
        """Summaries of a simulation; all NaN if it cannot be simulated."""
        force = self.force(number, unit)
        if force is None:
            return np.full(len(self.summarizer.names), np.nan)
        return self.summarizer(force)

    def fingerprint(self, observed: Array) -> str:
        """What tells this fit from others."""
        told = repr((self.config.to_toml(), self.prior, self.noise, self.skipped, self.seed))
        times = self.summarizer.time
        state = np.concatenate([np.nan_to_num(observed), times[[0, -1]], [len(times)]])
        return hashlib.sha256(told.encode() + state.tobytes()).hexdigest()


class Simulations:
    """Simulations one after another, each with its number.

    They follow from the seed and the trace alone, so a fit that is begun again comes to ask for the
    same ones, and takes those that it finds in its file.

    Attributes
    ----------
    parameters, summaries
        Of all simulations so far, shapes (simulations, parameters), (simulations, summaries).
    """

    def __init__(
        self,
        simulator: Simulator,
        observed: Array,
        *,
        expected: int,
        store: Path | None = None,
        workers: int | None = None,
        progress: Callable[[float], None] | None = None,
        stop: StopFlag | None = None,
    ) -> None:
        self.simulator = simulator
        self._fingerprint = simulator.fingerprint(observed)
        self._workers = workers or os.cpu_count() or 1
        self._expected = expected
        self._store = store
        self._progress = progress or (lambda _: None)
        self._stop = stop or StopFlag()
        names = len(simulator.summarizer.names)
        self._kept: dict[int, tuple[Array, Array]] = {}
        self._parameters: list[Array] = []
        self._summaries: list[Array] = []
        self._shape = (len(simulator.prior), names)
        if store is not None and store.exists():
            self._kept = self._read(store)

    @property
    def parameters(self) -> Array:
        return np.array(self._parameters).reshape(-1, self._shape[0])

    @property
    def summaries(self) -> Array:
        return np.array(self._summaries).reshape(-1, self._shape[1])

    def __len__(self) -> int:
        return len(self._parameters)

    def add(self, points: Array) -> None:
        """Simulate at points of the unit cube, shape (points, parameters).

        Raises
        ------
        StoppedError
            If somebody has stopped the fit; what was simulated is kept.
        """
        start = len(self)
        missing = [
            number
            for number, point in enumerate(points, start)
            if number not in self._kept or not np.array_equal(self._kept[number][0], point)
        ]
        fresh = 0

        def simulate(number: int) -> tuple[int, Array]:
            if self._stop.is_set():
                raise StoppedError
            return number, self.simulator(number, points[number - start])

        with ThreadPoolExecutor(self._workers) as pool:
            pending = [pool.submit(simulate, number) for number in missing]
            try:
                for future in as_completed(pending):
                    number, summary = future.result()
                    self._kept[number] = (points[number - start], summary)
                    fresh += 1
                    if fresh % KEPT_EVERY == 0:
                        self._write()
                    done = start + len(points) - len(missing) + fresh
                    self._progress(min(0.999, done / self._expected))
            except (StoppedError, KeyboardInterrupt):
                self._stop.set()
                for future in pending:
                    future.cancel()
                self._write()
                raise StoppedError from None
        for number, point in enumerate(points, start):
            self._parameters.append(point)
            self._summaries.append(self._kept[number][1])
        self._write()

    def forces(self, points: Array) -> Iterator[Array]:
        """Noisy traces at points of the unit cube, with numbers after those of all others."""
        start = self._expected + len(self)

        def simulate(place: int) -> Array | None:
            if self._stop.is_set():
                raise StoppedError
            return self.simulator.force(start + place, points[place])

        with ThreadPoolExecutor(self._workers) as pool:
            for force in pool.map(simulate, range(len(points))):
                if force is not None:
                    yield force

    def _write(self) -> None:
        if self._store is None or not self._kept:
            return
        numbers = np.array(sorted(self._kept))
        with written_whole(self._store) as part, part.open("wb") as file:
            np.savez(
                file,
                fingerprint=np.array(self._fingerprint),
                numbers=numbers,
                parameters=np.array([self._kept[one][0] for one in numbers]),
                summaries=np.array([self._kept[one][1] for one in numbers]),
            )

    def _read(self, store: Path) -> dict[int, tuple[Array, Array]]:
        try:
            with store.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                fingerprint = str(file["fingerprint"])
                rows = zip(file["numbers"], file["parameters"], file["summaries"], strict=True)
                kept = {int(number): (point, summary) for number, point, summary in rows}
        except Exception as error:
            raise FileError(f"{store}: is damaged; remove it, and the fit starts anew") from error
        if fingerprint != self._fingerprint:
            raise FileError(
                f"{store}: is of another fit, trace or version; remove it, and the fit starts anew"
            )
        return kept
