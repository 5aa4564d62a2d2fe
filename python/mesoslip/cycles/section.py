"""The master equation as a map from one passage of the spring force through a level to the next.

The section is where the rising force passes a high level of its cycle, when most contacts are
pinned and the slider sticks. The run is cut exactly there, so that the map is smooth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.simulation.archive import entries
from mesoslip.simulation.kernel import Kernel, Progress, Words
from mesoslip.simulation.kernel_setup import NEVER, KernelSetup
from mesoslip.simulation.recorded_tables import SLIP_COLUMNS, TRACE_COLUMNS, structured

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Number of samples in a period of the pinned slider's ringing.
SAMPLES_OF_RINGING = 32
# Maximum number of advances after which the trace is searched for a passage once the force has been
# low, minimum number near one, and part of the advances to an extrapolated one before the search.
CHUNK, MIN_CHUNK, APPROACH = 128, 16, 0.8
# Parts of the advances in a passage between which the next one is searched for its end.
SEARCHED = 0.0, 0.8, 0.96, 0.99
# Number of advances between two drains without a search.
MANY = 65536
# Level of the section, and level below which the force must have been, relative to its range.
LEVEL, RESET = 0.8, 0.5
# Range of the level in which it is not chosen again.
MIN_LEVEL, MAX_LEVEL = 0.65, 0.93
# Maximum time to the next passage, in times of loading to the static force plus periods of the
# setup.
MAX_LOADINGS, MAX_PERIODS = 8.0, 30.0
# No bound on the work of a chunk.
ANY_WORK = 1e18
# Tables with rows under a constant drive.
USED_TABLES = ("trace", "slips", "slip_trace", "stages")
# Number of steps of Newton's method for the time of a passage.
NEWTON_STEPS = 6

TIME, DRIVE, DISPLACEMENT, VELOCITY, FORCE = (
    TRACE_COLUMNS.index(name)
    for name in ("time", "drive_displacement", "displacement", "velocity", "spring_force")
)

Trace = NDArray[np.void]


@dataclass(frozen=True)
class Level:
    """A level of the spring force [N], and a level below which it must have been before [N]."""

    force: float
    reset: float

    @classmethod
    def of(cls, force: Array) -> Level:
        """The levels for a force over time."""
        low, high = float(np.min(force)), float(np.max(force))
        return cls(low + LEVEL * (high - low), low + RESET * (high - low))

    def fits(self, force: Array) -> bool:
        """Whether the level is in the upper part of the range of a force, but not at the top."""
        low, high = float(np.min(force)), float(np.max(force))
        return MIN_LEVEL <= (self.force - low) / max(high - low, 1e-300) <= MAX_LEVEL


@dataclass(frozen=True)
class Passage:
    """The motion between two passages through the section: state at the end, start and end [s],
    samples, and slips that ended in between."""

    words: Words
    start_time: float
    time: float
    trace: Trace
    slips: Trace

    @property
    def period(self) -> float:
        """Its duration [s]."""
        return self.time - self.start_time

    @property
    def peak(self) -> float:
        """Maximum of the spring force [N]."""
        return extreme(self.trace, 1)

    @property
    def low(self) -> float:
        """Minimum of the spring force [N]."""
        return extreme(self.trace, -1)

    @property
    def slip_duration(self) -> float:
        """Time in slips [s]."""
        return float(np.sum(self.slips["end_time"] - self.slips["start_time"]))


def extreme(trace: Trace, sign: int) -> float:
    """Maximum (sign 1) or minimum (-1) of the spring force, by cubic interpolation with its rates.

    A parabola through samples would depend on where they lie, by up to 1e-5 of the amplitude: as
    much as the tolerance of a cycle.
    """
    force = sign * trace["spring_force"]
    at, opposite = int(np.argmax(force)), int(np.argmin(force))
    stretch = trace["drive_displacement"] - trace["displacement"]
    if not 0 < at < len(force) - 1 or stretch[at] == stretch[opposite]:
        return sign * float(force[at])
    spring = (force[at] - force[opposite]) / (stretch[at] - stretch[opposite])
    near = trace[at - 1 : at + 2]
    drive_velocity = np.ptp(near["drive_displacement"]) / np.ptp(near["time"])
    rates = spring * (drive_velocity - near["velocity"])
    first = 1 if rates[1] > 0 else 0
    duration = float(near["time"][first + 1] - near["time"][first])
    cubic = Cubic(*force[at - 1 + first :][:2].tolist(), *(duration * rates[first:][:2]).tolist())
    return sign * cubic.maximum()


class Cubic(NamedTuple):
    """A cubic polynomial of 0 to 1, by its values and slopes at both ends."""

    start: float
    end: float
    start_slope: float
    end_slope: float

    def __call__(self, part: float) -> float:
        """Its value."""
        square, cube = self._coefficients
        return self.start + part * (self.start_slope + part * (square + part * cube))

    def slope(self, part: float) -> float:
        """Its slope."""
        square, cube = self._coefficients
        return self.start_slope + part * (2 * square + 3 * part * cube)

    def maximum(self) -> float:
        """Its maximum; at an end unless it rises at the start and falls at the end."""
        if not self.start_slope > 0 > self.end_slope:
            return max(self.start, self.end)
        square, cube = self._coefficients
        root = math.sqrt(square**2 - 3 * cube * self.start_slope)
        return self(self.start_slope / (root - square))

    @property
    def _coefficients(self) -> tuple[float, float]:
        """Its coefficients of the square and the cube."""
        rise = self.end - self.start
        square = 3 * rise - 2 * self.start_slope - self.end_slope
        return square, self.start_slope + self.end_slope - 2 * rise


class Motion:
    """Segments of runs of the master equation under a constant velocity of the drive."""

    def __init__(self, config: Config) -> None:
        self.config = config
        contacts = config.contacts
        self.velocity = config.drive_parts[-1].start_velocity
        spring, mass = config.spring_stiffness, mass_of(config)
        ringing = 2 * math.pi * math.sqrt(mass / (spring + contacts.stiffness))
        self.interval = ringing / SAMPLES_OF_RINGING
        force = contacts.static_force
        self.loading_time = force * (1 / spring + 2 / contacts.stiffness) / abs(self.velocity)
        # Advances before the next passage is searched, the first time as many as until its end.
        self._expected = [int(CHUNK / math.sqrt(config.run.resolution))]
        self.setup_period = 2 * math.pi * math.sqrt(mass / spring)
        # Its contacts are copied, which is faster than making them again.
        template = Kernel()
        kind = config.contact_kind
        template.set_contacts(kind.kernel_kind, kind.kernel_parameters(config), config.run.seed, 0)
        self._setup = KernelSetup(config, template, interval=self.interval)

    def open(self, words: Words | None, end_time: float = NEVER) -> Kernel:
        """A kernel at a state, or at the start, with a drive that ends at a time [s]."""
        kernel = self._setup.open(end_time=end_time)
        if words is None:
            kernel.start(self.config.contacts.initial)
        else:
            kernel.restore(words)
        return kernel

    def advance(self, words: Words | None, duration: float) -> tuple[Words, Trace]:
        """The state after a time [s], and the trace until then."""
        start = 0.0 if words is None else time_of(words)
        kernel = self.open(words, start + duration)
        rows = []
        while not kernel.ask().ending:
            kernel.advance(MANY, ANY_WORK)
            rows.append(_taken(kernel)[0])
        return self._saved(kernel), structured(np.concatenate(rows), TRACE_COLUMNS)

    def _saved(self, kernel: Kernel) -> Words:
        """The state of a kernel, without the ending of its drive, so that it can be continued."""
        words = kernel.save()
        kernel.close()
        next(one for one in entries(words) if one.name == "ending").of(words)[:] = 0
        return words

    def next_passage(self, words: Words, level: Level) -> Passage | None:
        """Advance from a state to the next passage through a level; None if the maximum time is
        reached."""
        kernel = self.open(words)
        start = now = kernel.ask()
        pieces = [_Piece(words, start.time, [], [])]
        limit = start.time + MAX_LOADINGS * self.loading_time + MAX_PERIODS * self.setup_period
        search = _PassageSearch(level)
        chunk, *others = self._expected
        while now.time < limit:
            kernel.advance(chunk, ANY_WORK)
            trace, slips = _taken(kernel)
            pieces[-1].traces.append(trace)
            pieces[-1].slips.append(slips)
            found = search.passage_time(trace)
            if found is not None:
                kernel.close()
                while pieces[-1].time >= found:
                    pieces.pop()
                return self._cut(start, found, pieces)
            before, now = now, kernel.ask()
            if others or search.has_been_low:
                pieces.append(_Piece(kernel.save(), now.time, [], []))
                # The last piece is repeated: near a passage pieces are short.
                chunk = search.advances_left(trace, chunk / (now.time - before.time))
            if others:
                chunk = others.pop(0)
        kernel.close()
        return None

    def _cut(self, start: Progress, time: float, pieces: list[_Piece]) -> Passage:
        """The motion up to a passage at a time [s], for which the last piece is repeated; the next
        passage is expected to take as many advances."""
        last = pieces.pop()
        kernel = self.open(last.words, time)
        while not kernel.ask().ending:
            kernel.advance(MANY, ANY_WORK)
        trace, slips = _taken(kernel)
        traces = [*chain.from_iterable(one.traces for one in pieces), trace]
        catalogues = [*chain.from_iterable(one.slips for one in pieces), slips]
        self._expect(kernel.ask().advances - start.advances)
        return Passage(
            self._saved(kernel),
            start.time,
            time,
            structured(np.concatenate(traces), TRACE_COLUMNS),
            structured(np.concatenate(catalogues), SLIP_COLUMNS),
        )

    def _expect(self, advances: int) -> None:
        """Set the advances before each search for the next passage, the last ones close to it."""
        ends = [int(part * advances) for part in SEARCHED]
        self._expected = [max(1, end - begin) for begin, end in pairwise(ends)]


def _taken(kernel: Kernel) -> tuple[Array, Array]:
    """Drain all tables of a kernel; returns the trace and the slips."""
    taken = kernel.drain(*USED_TABLES)
    return taken["trace"], taken["slips"]


class _Piece(NamedTuple):
    """A part of a motion: the state and the time [s] at its start, samples and slips."""

    words: Words
    time: float
    traces: list[Array]
    slips: list[Array]


class _PassageSearch:
    """Search for the passage of the force in successive samples."""

    def __init__(self, level: Level) -> None:
        self._level = level
        # Whether the force has been below the level from which it may pass.
        self.has_been_low = False
        self._last: Array = np.empty((0, len(TRACE_COLUMNS)))

    def passage_time(self, rows: Array) -> float | None:
        """Time of the passage [s] in further samples; None if they have no passage."""
        rows = np.concatenate([self._last, rows])
        self._last = rows[-1:]
        force = rows[:, FORCE]
        first = 0
        if not self.has_been_low:
            low = np.flatnonzero(force < self._level.reset)
            if not low.size:
                return None
            self.has_been_low, first = True, int(low[0])
        above = np.flatnonzero(force[first:] >= self._level.force)
        if not above.size:
            return None
        at = first + int(above[0])
        return self._between(rows[at - 1], rows[at])

    def advances_left(self, rows: Array, rate: float) -> int:
        """Number of advances before the next search, from the last samples and the advances per
        time [1/s]."""
        if len(rows) < 2:
            return CHUNK
        rise, duration = rows[-1, [FORCE, TIME]] - rows[0, [FORCE, TIME]]
        left = APPROACH * (self._level.force - rows[-1, FORCE]) * duration * rate
        return CHUNK if left >= CHUNK * rise else max(MIN_CHUNK, int(left / rise))

    def _between(self, early: Array, late: Array) -> float:
        """Time of the passage between two samples, by cubic interpolation of the force."""
        duration = late[TIME] - early[TIME]
        force = np.array([early[FORCE], late[FORCE]])
        rise = force[1] - force[0]
        drive = late[DRIVE] - early[DRIVE]
        spring = rise / (drive - (late[DISPLACEMENT] - early[DISPLACEMENT]))
        slope = spring * (drive - duration * np.array([early[VELOCITY], late[VELOCITY]]))
        cubic = Cubic(*force.tolist(), *slope.tolist())
        part = (self._level.force - force[0]) / rise
        for _ in range(NEWTON_STEPS):
            change = cubic.slope(part)
            if change <= 0:
                break
            part = min(1.0, max(0.0, part - (cubic(part) - self._level.force) / change))
        return float(early[TIME] + part * duration)


def mass_of(config: Config) -> float:
    """Mass of a rigid slider [kg]."""
    assert config.slider.oscillator is not None
    return config.slider.oscillator.mass


def time_of(words: Words) -> float:
    """Time of a state [s]."""
    return next(float(one.of(words)[0]) for one in entries(words) if one.name == "time")
