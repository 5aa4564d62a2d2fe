"""One run of a configuration with its own random numbers, advanced in segments.

Its results do not depend on where segments end, on other runs, or on being saved and resumed.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Self

import numpy as np

from mesoslip.array_types import Array
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.errors import RunError
from mesoslip.simulation.audit import COARSENING, StepErrors, share_of_work, step_errors
from mesoslip.simulation.fronts import FrontFinder
from mesoslip.simulation.kernel import Completed, Kernel, Progress, Words
from mesoslip.simulation.kernel_setup import KernelSetup, tables_of
from mesoslip.simulation.memory import check_memory
from mesoslip.simulation.recorded_tables import CONTACT_COLUMNS, ENERGY_COLUMNS, Recorded, Rows
from mesoslip.simulation.start import START, End, follow

# Reasons why a run is over, by the kernel's names.
ENDINGS = {
    "": "",
    "drive": "end of the drive",
    "avalanches": "number of avalanches reached",
    "broken": "all contacts are broken",
    "slides": "contacts break under the force without end; breaks of this slide are in no "
    "avalanche",
    "slips": "number of slips reached",
    "displacement": "displacement of the slider reached",
    "steady": "steady state reached",
}

# Terms of the energy balance before the first advance.
NO_ENERGY = np.full(len(ENERGY_COLUMNS), np.nan)
NO_ENERGY.flags.writeable = False

# Wall time of a segment, after which progress and signals are checked [s]; work of the first one,
# of which populations with many heights take 60 µs each; work of short realizations.
SEGMENT_SECONDS = 0.25
FIRST_WORK = 2_000.0
SHORT_WORK = 100_000.0
# Work of estimating the errors over the whole work.
COARSE_PART = 0.25
# Maximum number of runs until the error of the force is tolerated; error over the tolerance that
# the next resolution aims at; minimum ratio of resolutions.
MAX_ATTEMPTS = 3
AIMED_PART = 0.7
MIN_RATIO = 0.1
# No bound on the advances or the work of a segment.
ANY_NUMBER = 2**62
# Maximum number of advances at a time in `Realization.advance_to`.
MAX_ADVANCES = 100_000

# Attributes of a realization that a checkpoint keeps as they are.
SAVED_ATTRIBUTES = (
    *("time", "ending", "breaks", "detached", "advances", "kernel_seconds", "avalanche_count"),
    *("avalanche_slip", "displacement", "force_error", "slip_time_error", "resolution"),
)


@dataclass(frozen=True)
class Saved:
    """A realization in a checkpoint: attributes, number of rows by table, and the state of the
    kernel, None if the run is over."""

    scalars: dict[str, Any]
    counts: dict[str, int]
    words: Words | None


class Realization(Recorded):
    """One run of a configuration, advanced step by step; `mesoslip.Realization` is this class with
    tables that have units, and describes its parameters and attributes."""

    # A run may have 10⁵ of them.
    __slots__ = (
        *("config", "number", *SAVED_ATTRIBUTES, "integrator_counts", "_parameters", "_coarse"),
        *(
            "_lacks_errors",
            "_has_steps",
            "_attempt",
            "_attempts_left",
            "_is_discrete",
            "_after",
            "_has_failed",
            "_start",
            "_energy",
            "_recorded",
            "_fronts",
        ),
        *("_setup", "_kernel", "_words", "_work", "_lock"),
    )

    @arguments.checked(
        config=arguments.instance(Config, "a Config"),
        number=arguments.whole(0),
        estimates_errors=arguments.flag,
        resolution=arguments.number(0, is_open=True),
        after=arguments.instance(End, "the end of another realization"),
    )
    def __init__(
        self,
        config: Config,
        number: int = 0,
        *,
        estimates_errors: bool = True,
        resolution: float | None = None,
        after: End | None = None,
    ) -> None:
        check_memory(config)
        super().__init__()
        self.config = config
        self.number = number
        self.time = 0.0
        self.ending = ""
        self.breaks: float = 0.0
        self.detached = 0.0
        self.advances = 0
        self.kernel_seconds = 0.0
        self.avalanche_count = 0
        self.avalanche_slip = 0.0
        self.displacement = 0.0
        self.force_error = 0.0
        self.slip_time_error = 0.0
        self.integrator_counts = np.zeros(3, dtype=np.int64)
        contacts = config.contact_kind
        self._parameters = contacts.kernel_parameters(config)
        self._coarse: Realization | None = None
        self._lacks_errors = False
        self.resolution = config.run.resolution if resolution is None else resolution
        parameters = contacts.parameters_with(config, self.resolution)
        self._has_steps = parameters is not None
        self._attempt: Realization | None = None
        self._attempts_left = 0
        self._is_discrete = contacts.is_discrete
        if parameters is not None:
            self._parameters = parameters
            self._lacks_errors = estimates_errors and after is None
            self.force_error = self.slip_time_error = math.nan
            if self._lacks_errors and resolution is None and config.run.force_tolerance is not None:
                self._attempts_left = MAX_ATTEMPTS
        self._after = after
        self._has_failed = False
        self._start = START
        self._energy: Array | None = None
        self._recorded = tables_of(config)
        self._fronts = front_finder(config)
        self._setup: KernelSetup | None = None
        self._kernel: Kernel | None = None
        self._words: Words | None = None
        self._work = FIRST_WORK
        self._lock = threading.Lock()

    @classmethod
    @arguments.checked(config=arguments.instance(Config, "a Config"))
    def all_of(cls, config: Config, numbers: Iterable[int] | None = None) -> list[Realization]:
        """All realizations of a configuration, or some of them, which share what they have in
        common."""
        numbers = range(config.run.realizations) if numbers is None else numbers
        first = cls(config)
        first._setup = first._start.setup(config, first._parameters)
        return [first._sibling(number) for number in numbers]

    def _sibling(self, number: int) -> Realization:
        """Another realization, of which neither has started."""
        other = object.__new__(type(self))
        for name in Realization.__slots__:
            setattr(other, name, getattr(self, name))
        other.number = number
        other._tables = {}
        other._lock = threading.Lock()
        if self._fronts is not None:
            other._fronts = front_finder(self.config)
        return other

    def _open(self) -> Kernel:
        """The kernel with its parts, started or restored."""
        if self._kernel is not None:
            return self._kernel
        if self._after is not None:
            kernel, self._start = follow(self.config, self._parameters, self.number, self._after)
            self._after = None
        else:
            if self._setup is None:
                self._setup = self._start.setup(self.config, self._parameters)
            kernel = self._setup.open(self.number)
            if self._words is not None:
                kernel.restore(self._words)
                self._words = None
            else:
                kernel.start(self.config.contacts.initial)
        self._kernel = kernel
        return kernel

    @arguments.checked(advances=arguments.whole(1, bits=63), work=arguments.number(0, is_open=True))
    def advance(self, advances: int | None = None, *, work: float | None = None) -> None:
        """Advance by one segment: a number of advances, an amount of work, or about 0.25 s.

        The unit of work is an advance of a rigid slider or the break of a contact.

        Raises
        ------
        RunError
            If the kernel fails.
        """
        if self.finished:
            return
        if self._attempts_left > 0:
            self._advance_attempt(advances, work)
            return
        if self.ending:
            self._estimate_errors(advances, work)
            return
        start = time.perf_counter()
        try:
            kernel = self._open()
            if advances is None and work is None:
                kernel.advance(ANY_NUMBER, self._work)
            else:
                kernel.advance(advances or ANY_NUMBER, work or float(ANY_NUMBER))
            self._take(kernel)
        except (RunError, MemoryError) as error:
            self._has_failed = True
            if isinstance(error, MemoryError):
                raise
            raise type(error)(f"realization {self.number}: {error}") from None
        seconds = time.perf_counter() - start
        self.kernel_seconds += seconds
        if advances is None and work is None:
            self._work *= min(2.0, max(0.1, SEGMENT_SECONDS / max(seconds, 1e-9)))

    def _advance_attempt(self, advances: int | None, work: float | None) -> None:
        """Advance a whole run with some resolution by one segment. At its end this one becomes it,
        unless its error is above the tolerance and says a smaller resolution for another."""
        if self._attempt is None:
            self._attempt = Realization(self.config, self.number, resolution=self.resolution)
        attempt, before = self._attempt, self._attempt.kernel_seconds
        attempt.advance(advances, work=work)
        self.kernel_seconds += attempt.kernel_seconds - before
        if not attempt.finished:
            return
        self._attempts_left -= 1
        self._attempt = None
        tolerance = (self.config.run.force_tolerance or 0.0) * self.config.contacts.static_force
        if self._attempts_left == 0 or attempt.force_error <= tolerance:
            self._become(attempt)
            return
        attempt.close()
        # The error is proportional to the square of the resolution.
        ratio = math.sqrt(AIMED_PART * tolerance / attempt.force_error)
        self.resolution *= max(MIN_RATIO, ratio)

    def _become(self, other: Realization) -> None:
        """Be another realization of the same configuration and number, which is finished."""
        seconds = self.kernel_seconds
        with self._lock:
            for name in Realization.__slots__:
                if name != "_lock":
                    setattr(self, name, getattr(other, name))
            self._tables = other._tables
        self.kernel_seconds = seconds

    def _estimate_errors(self, advances: int | None, work: float | None) -> None:
        """Advance the run with longer steps by one segment; at its end the errors are known."""
        if self._coarse is None:
            self._coarse = Realization(
                self.config,
                self.number,
                estimates_errors=False,
                resolution=COARSENING * self.resolution,
            )
        coarse, before = self._coarse, self._coarse.kernel_seconds
        try:
            coarse.advance(advances, work=work)
            self.kernel_seconds += coarse.kernel_seconds - before
            if not coarse.finished:
                return
            errors = step_errors(self.trace, self.slips, coarse.trace, coarse.slips)
        except RunError:
            # Twice the step was too long, so the errors have no estimate.
            errors = StepErrors(math.inf, math.inf)
        self.force_error, self.slip_time_error = errors
        self._lacks_errors = False
        coarse.close()
        self._coarse = None

    @arguments.checked(time=arguments.number())
    def advance_to(self, time: float) -> None:
        """Advance until a time [s] is reached, or the run is over.

        The run stops at an event at or after the time, as a rule less than an interval of the trace
        later.

        Raises
        ------
        RunError
            If the kernel fails.
        """
        before, advances = self.time, 1
        # Longest duration of an advance: those in a slip are much shorter than those before it.
        longest = self.config.output_interval
        while not self.finished and self.time < time:
            self.advance(advances)
            longest = max(longest, (self.time - before) / advances)
            before = self.time
            # Half of what certainly does not pass the end.
            wanted = 0.5 * (time - self.time) / longest
            advances = int(min(max(1.0, wanted), 2.0 * advances, MAX_ADVANCES))

    @property
    def end(self) -> End:
        """The end of the run, which another one can continue.

        Raises
        ------
        RunError
            If the run is not over, or was closed.
        """
        if self._kernel is None or not self.ending:
            raise RunError(f"realization {self.number}: the run is not at its end")
        return End(self.config, self._kernel.save())

    @arguments.checked(distance=arguments.number())
    def twin(self, distance: float) -> Realization:
        """Another realization that continues from here with the same random numbers.

        Its record starts here, and its errors are not estimated.

        Parameters
        ----------
        distance
            Displacement of its drive ahead of this one's [m]; for sliders with inertia on a spring
            (`rigid`, `layered`).

        Raises
        ------
        RunError
            If the run is over.
        """
        if self.ending:
            raise RunError(f"realization {self.number}: the run is over, so it has no twin")
        saved = self.save()
        other = type(self)(self.config, self.number, estimates_errors=False)
        other._start = self._start
        other.restore(saved, {name: Rows(rows.columns) for name, rows in self.waiting})
        other._open().displace_drive(distance)
        return other

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take(self, kernel: Kernel) -> None:
        """Take the recorded rows and the progress of the kernel."""
        progress = kernel.ask()
        energy = kernel.energy() if progress.ending else None
        self._adopt(progress, energy, kernel.drain(*self._recorded))

    def _adopt(self, progress: Progress, energy: Array | None, tables: dict[str, Array]) -> None:
        """Take recorded rows, the progress, and at the end the terms of the energy balance."""
        progress = self._start.progress_since(progress)
        with self._lock:
            for table, rows in tables.items():
                values = self._start.rows_since(table, rows)
                self._add(table, values)
                if table == "ruptures" and self._fronts is not None:
                    is_last = bool(progress.ending)
                    self._add("fronts", self._fronts.add(values, is_last=is_last))
            self.time = progress.time
            self.breaks = progress.breaks
            if self._is_discrete:
                self.breaks = int(progress.breaks)
            self.detached = progress.detached
            self.advances = progress.advances
            self.avalanche_count = progress.avalanches
            self.avalanche_slip = progress.avalanche_slip
            self.displacement = progress.displacement
            if not self._has_steps:
                self.force_error = progress.force_error
            self.integrator_counts = progress.integrator_counts
            self.ending = ENDINGS[progress.ending]
            self._energy = None if energy is None else self._start.energy_since(energy)

    @staticmethod
    def run_together(realizations: Sequence[Realization]) -> int:
        """Run realizations of `all_of`, each from start to end, in one call of the kernel, up to
        one that has started, is long, records much or fails; returns how many have run."""
        first = realizations[0]
        realizations = list(takewhile(lambda one: one._is_new, realizations))
        if not realizations or first._setup is None or first._lacks_errors or first._fronts:
            return 0
        start = time.perf_counter()
        kernel = first._setup.open(first.number)
        try:
            completed: list[Completed] = kernel.run_realizations(
                [one.number for one in realizations],
                first.config.contacts.initial,
                first._recorded,
                SHORT_WORK,
            )
        finally:
            kernel.close()
        seconds = (time.perf_counter() - start) / max(1, len(completed))
        for one, result in zip(realizations, completed, strict=False):
            one._adopt(*result)
            one.kernel_seconds = seconds
        return len(completed)

    def _add(self, table: str, values: Array) -> None:
        if len(values):
            rows = self._tables.get(table)
            if rows is None:
                rows = self._tables[table] = Rows(values.shape[1])
            rows.add(values)

    def close(self) -> None:
        """Free the memory of the kernel, when the run is not continued."""
        if self._kernel is not None:
            self._kernel.close()
            self._kernel = None
        for other in (self._coarse, self._attempt):
            if other is not None:
                other.close()
        self._coarse = self._attempt = None

    @property
    def _is_new(self) -> bool:
        return self._kernel is None and self._words is None and self.advances == 0

    @property
    def is_open(self) -> bool:
        """Whether it has a kernel, which a thread may use."""
        return self._kernel is not None

    @property
    def has_failed(self) -> bool:
        """Whether an advance failed, after which its state is not that of a run."""
        return self._has_failed

    @property
    def finished(self) -> bool:
        """Whether the run is over, and its errors, if they are to be estimated, are known."""
        return bool(self.ending) and not self._lacks_errors

    @property
    def part_done(self) -> float:
        """Completed part of the run, 0 to 1."""
        if self.finished:
            return 1.0
        if self._attempts_left > 0:
            part = self._attempt.part_done if self._attempt is not None else 0.0
            return (MAX_ATTEMPTS - self._attempts_left + part) / MAX_ATTEMPTS
        part = 1.0 if self.ending else self._part_of_run()
        if self._lacks_errors:
            coarse = self._coarse.part_done if self._coarse is not None else 0.0
            part = (1.0 - COARSE_PART) * part + COARSE_PART * coarse
        return part

    def _part_of_run(self) -> float:
        wanted = self.config.run.avalanches
        by_avalanches = self.avalanche_count / wanted if wanted else 0.0
        end = self.config.run.stops.displacement
        by_displacement = self.displacement / end if end else 0.0
        return min(1.0, max(by_avalanches, by_displacement, self.time / self.config.duration))

    @property
    def energy(self) -> Array:
        """Terms of the energy balance so far, in the order of `ENERGY_COLUMNS` [J]."""
        if self._energy is not None:
            return self._energy
        if self._kernel is None:
            return NO_ENERGY
        return self._start.energy_since(self._kernel.energy())

    @property
    def energy_residual(self) -> float:
        """Residual of the energy balance, relative to the work of the drive, forth and back, or the
        largest term."""
        return float(share_of_work(self.config, self.energy, "residual"))

    @property
    def step_work(self) -> float:
        """Work on the contact force in steps beyond that on the contacts, relative to the work of
        the drive; 0 where contacts are kept one by one."""
        return float(share_of_work(self.config, self.energy, "step_work"))

    @property
    def contacts(self) -> dict[str, Array]:
        """Origin [m], stiffness [N/m] (0 if detached), breaking stretch [m] and number of renewals
        of each of the N contacts; under a load, of each site.

        Raises
        ------
        RunError
            If the run is over and was closed.
        """
        if self.ending and self._kernel is None:
            raise RunError(
                f"realization {self.number}: the run is over; its contacts are no longer in memory"
            )
        sites = self.config.contact_kind.site_count(self.config.contacts)
        return dict(zip(CONTACT_COLUMNS, self._open().contacts(sites), strict=True))

    @property
    def energy_terms(self) -> dict[str, float]:
        """Terms of the energy balance so far by name [J]; NaN before the first advance."""
        return dict(zip(ENERGY_COLUMNS, self.energy.tolist(), strict=True))

    def save(self) -> Saved:
        """Its part of a checkpoint, between two segments."""
        words = None
        if not self.ending and (self._kernel is not None or self._words is not None):
            words = self._words if self._kernel is None else self._kernel.save()
        scalars = {name: getattr(self, name) for name in SAVED_ATTRIBUTES} | {
            "integrator_counts": self.integrator_counts.tolist(),
            "energy": None if self._energy is None else self._energy.tolist(),
        }
        fronts = self.save_fronts()
        if fronts is not None:
            scalars["fronts"] = fronts
        return Saved(scalars, self.counts, words)

    def save_fronts(self) -> dict[str, Any] | None:
        """What a checkpoint keeps of fronts that are not over; None for sliders without any."""
        return None if self._fronts is None else self._fronts.save()

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows by table."""
        return {table: len(rows) for table, rows in self._tables.items()}

    @arguments.checked(saved=arguments.instance(Saved, "what save returns"), tables=arguments.table)
    def restore(self, saved: Saved, tables: dict[str, Rows]) -> None:
        """Continue from a checkpoint, with the rows that were recorded until then."""
        for name in SAVED_ATTRIBUTES:
            setattr(self, name, saved.scalars[name])
        energy = saved.scalars["energy"]
        self._energy = None if energy is None else np.array(energy)
        self.integrator_counts = np.array(saved.scalars["integrator_counts"], dtype=np.int64)
        self._lacks_errors = self._lacks_errors and math.isnan(self.force_error)
        self._words = saved.words
        self._tables = tables
        if self._fronts is not None:
            self._fronts.restore(saved.scalars["fronts"])


def front_finder(config: Config) -> FrontFinder | None:
    """What finds fronts of a slider of blocks; None for others."""
    slider, load = config.slider, config.pressing
    if not slider.block_count:
        return None
    strengths = config.block_strengths / load.normal_force
    return FrontFinder(
        slider.block_count,
        slider.block_spacing,
        slider.block_time,
        slider.quiet_time,
        lambda blocks, times: strengths[blocks - 1] * load.force_at(times),
    )
