"""Iteration of a motion of the master equation to its settled cycle.

The map from section to section is iterated. Where it converges, it usually does so within about ten
cycles, as contacts forget their history within a few lives.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array
from mesoslip.cycles.decay import Amplitudes, Batch
from mesoslip.cycles.section import Level, Motion, Passage, Trace, time_of
from mesoslip.simulation.kernel import Words

# Maximum number of passages in a settled cycle.
MAX_MULTIPLE = 4
# Relative error of period and peaks at which a cycle is settled, and maximum number of cycles.
TOLERANCE, MAX_CYCLES = 1e-5, 80
# Number of last cycles, and their changes over the tolerance up to which one is settled: two
# changes may be small by accident.
LAST_CYCLES, MAX_CHANGE = 3, 10.0
# Relative spread of period and peaks over a number of last passages below which a motion that has
# not settled is periodic: steps of the solver, or a fine structure, may keep it from settling.
MAX_SPREAD, SPREAD_PASSAGES = 2e-3, 24
# Passages in a later batch over those in the first one.
BATCH_PART = 0.5
# Ratio of successive changes below which they shrink; median of the changes in the last third of a
# batch over that in the first third, below which its motion settles, and below which it may not
# have reached its limit yet.
SHRINKING, SETTLING, SLOWLY = 0.98, 0.5, 0.9
# Ratios up to which spreads and changes of cycles of different lengths count as equal; the shorter
# cycle is then chosen. A true cycle of several passages has much smaller ones than a shorter cycle.
EQUAL_SPREAD, EQUAL_CHANGE = 3.0, 10.0
# Passages of a motion whose changes still shrink, over the maximum number of those of others.
SLOW_PASSAGES = 3
# Range of the distance to the limit over the last change, where the decay is known.
MIN_DISTANCE, MAX_DECAY = 0.5, 0.97
# Amplitude over F_s below which sliding is smooth.
MIN_AMPLITUDE = 1e-3
# Time before the first section, in times of loading plus periods of the setup.
LOADINGS, PERIODS = 2.0, 10.0
# Maximum number of such times without an oscillation.
MAX_WINDOWS = 40
# Maximum difference of equal cycles over the sum of their errors.
SAME_ERRORS = 3.0
# Final amplitude over the present one below which an oscillation decays to smooth sliding.
DECAYED = 0.1


@dataclass
class Settled:
    """The settled state of a motion: "periodic", "smooth", or "irregular" if it did not settle."""

    motion: str
    multiple: int
    """Number of passages in a settled cycle."""
    passages: list[Passage]
    """The last passages in their order; those of one cycle, if it is periodic."""
    level: Level | None
    words: Words
    followed: float
    """Simulated time [s]."""
    cycles: int
    """Number of computed passages."""
    error: float
    """Estimated relative error of period and peaks."""
    rows: Array
    """Duration [s], maximum and minimum of the spring force [N] of all passages of this section,
    shape (passages, 3)."""
    batches: Sequence[Batch] = ()
    """Mean amplitudes of earlier passages, if it did not settle in them."""

    def is_like(self, other: Settled, tolerance: float) -> bool:
        """Whether both are one cycle, within their errors and a tolerance."""
        if not self.motion == other.motion == "periodic" or self.multiple != other.multiple:
            return False
        periods, peaks, lows = np.transpose(
            [_extremes(one.rows[-one.multiple :]) for one in (self, other)]
        )
        amplitude = float(peaks[0] - lows[0])
        changes = [np.ptp(periods) / periods[0], *(np.ptp([peaks, lows], axis=1) / amplitude)]
        limit = max(tolerance, SAME_ERRORS * (self.error + other.error))
        return float(max(changes)) < limit

    def with_decay(self, decay: float | None) -> Settled:
        """The cycle with an error that agrees with the decay of a disturbance in a passage."""
        if decay is None or len(self.rows) < 2 * self.multiple + 1:
            return self
        last, before = _last_changes(self.rows, self.multiple)
        error = _distance(last, before, decay**self.multiple)
        return dataclasses.replace(self, error=max(self.error, error))

    def shortest(self) -> Settled:
        """The cycle with the fewest passages that differ by no more than a fine structure."""
        period, peak, low = self.rows[-1]
        scale = np.array([period, peak - low, peak - low])
        for part in (one for one in range(1, self.multiple) if self.multiple % one == 0):
            changes = (self.rows[part:] - self.rows[:-part])[-self.multiple :] / scale
            change = float(np.max(np.abs(changes)))
            if change < MAX_SPREAD:
                passages, error = self.passages[-part:], max(self.error, change)
                return dataclasses.replace(self, multiple=part, passages=passages, error=error)
        return self


def _changes(rows: Array, multiple: int, min_amplitude: float = 0.0) -> Array:
    """Relative changes of period, peak and low over cycles of some passages, shape (n, 3)."""
    changes: Array = rows[multiple:] - rows[:-multiple]
    amplitude = max(float(rows[-1, 1] - rows[-1, 2]), min_amplitude)
    changes /= np.array([float(rows[-1, 0]), amplitude, amplitude])
    return changes


def _last_changes(rows: Array, multiple: int, min_amplitude: float = 0.0) -> tuple[float, float]:
    """The largest change over the last cycle of some passages, and over the one before."""
    sizes = np.max(np.abs(_changes(rows, multiple, min_amplitude)), axis=1)
    last = float(np.max(sizes[-multiple:]))
    return last, float(np.max(sizes[: len(sizes) - multiple][-multiple:], initial=0.0))


def _distance(last: float, before: float, decay: float | None) -> float:
    """Distance of a cycle to its limit by its last two changes, and the decay in a cycle.

    The ratio of changes may be small by accident: where the decay is known, none is taken to be
    smaller than the remainder of the one before.
    """
    if decay is None:
        factor = min(0.99, last / before) if before > 0 else 0.9
        return max(1.0, factor / (1 - factor)) * last
    factor = min(MAX_DECAY, decay)
    return max(last, factor * before) * max(MIN_DISTANCE, factor / (1 - factor))


def _extremes(rows: Array) -> Array:
    """Period, maximum and minimum of a cycle."""
    return np.array([np.sum(rows[:, 0]), np.max(rows[:, 1]), np.min(rows[:, 2])])


def settle(
    motion: Motion,
    words: Words | None = None,
    level: Level | None = None,
    *,
    batches: Sequence[Batch] = (),
    is_stable: bool | None = None,
    root: complex | None = None,
    tolerance: float = TOLERANCE,
    max_cycles: int = MAX_CYCLES,
    max_passages: int | None = None,
    decay: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Settled:
    """Iterate a motion to its settled state, from a state with a section that may fit, or from the
    start of a run.

    Stability of smooth sliding and leading root [1/s] may be unknown. The tolerance is the relative
    error of period and peaks. After ``max_cycles`` passages a motion that has not settled is
    compared with itself later, and with the batches of a motion that led to the state and did not
    settle at a coarse resolution. ``progress`` is called with the passages over that number.
    With ``max_passages`` a motion that needs more is irregular, three times as many where its
    changes still shrink. The factor by which a disturbance decays in a passage may be known.
    """
    start = 0.0 if words is None else time_of(words)
    run = _Settling(motion, is_stable, root, tolerance, start, max_passages, decay)
    run.continue_after(batches, max_cycles)
    if words is None or level is None:
        words, trace = motion.advance(words, run.window)
        level = run.level_of(trace)
    for _ in range(MAX_WINDOWS):
        if level is None:
            if is_stable:
                return run.result("smooth", words)
            words, trace = motion.advance(words, run.window)
            level = run.level_of(trace)
            continue
        words, level, verdict = run.iterate(words, level, max_cycles, progress)
        if verdict:
            return run.result(verdict, words)
    return run.result("smooth" if level is None else "irregular", words)


class _Settling:
    """The passages so far of a motion that is iterated."""

    def __init__(
        self,
        motion: Motion,
        is_stable: bool | None,
        root: complex | None,
        tolerance: float,
        start: float,
        max_passages: int | None = None,
        decay: float | None = None,
    ) -> None:
        self._motion, self._is_stable, self._tolerance = motion, is_stable, tolerance
        self._start, self._max_passages, self._decay = start, max_passages, decay
        self._amplitudes = Amplitudes(motion.velocity, is_stable, root)
        self._force = motion.config.contacts.static_force
        self.window = LOADINGS * motion.loading_time + PERIODS * motion.setup_period
        self._count = 0
        self._limit = 0
        self._level: Level | None = None
        self._restart()

    def continue_after(self, batches: Sequence[Batch], max_cycles: int) -> None:
        """Compare the passages with batches of earlier ones that did not settle."""
        if batches:
            self._amplitudes.continue_after(batches)
            self._set_limit(max_cycles)

    def _set_limit(self, max_cycles: int) -> None:
        """Set the end of a batch that is not the first one."""
        self._limit = self._count + max(SPREAD_PASSAGES, int(BATCH_PART * max_cycles))

    def _restart(self) -> None:
        """Forget earlier passages, as the section or the state has been replaced."""
        self._rows: list[Array] = []
        self._amplitudes.restart()
        self._recent: list[Passage] = []

    def level_of(self, trace: Trace) -> Level | None:
        """The section for the later half of a trace; None without an oscillation."""
        force = trace["spring_force"][len(trace) // 2 :]
        if float(np.ptp(force)) < MIN_AMPLITUDE * self._force:
            return None
        return Level.of(force)

    def iterate(
        self,
        words: Words,
        level: Level,
        max_cycles: int,
        progress: Callable[[float], None] | None,
    ) -> tuple[Words, Level | None, str]:
        """Iterate with one section; returns the state, the next section, and the motion, empty if
        it is not known."""
        self._restart()
        self._level = level
        self._limit = self._limit or self._max_passages or max_cycles
        while self._count < self._limit or self._settles_slowly():
            passage = self._motion.next_passage(words, level)
            self._count += 1
            if progress is not None:
                progress(min(1.0, self._count / max_cycles))
            if passage is None:
                words, trace = self._motion.advance(words, self.window)
                return words, self.level_of(trace), ""
            words = passage.words
            self._take(passage)
            if self._decays():
                return words, None, "smooth"
            force = passage.trace["spring_force"]
            if len(self._rows) <= 2 and not level.fits(force):
                if float(np.ptp(force)) < MIN_AMPLITUDE * self._force:
                    return words, None, ""
                return words, Level.of(force), ""
            multiple, error = self._multiple()
            if error < self._tolerance and self._is_settled(multiple):
                force = self._force_of(multiple)
                if not level.fits(force):
                    return words, Level.of(force), ""
                return words, level, "periodic"
        if self._max_passages:
            stays = self._spread()[1] < MAX_SPREAD and self._trend() < 1 / SLOWLY
            return words, level, "periodic" if stays else "irregular"
        self._amplitudes.end_batch()
        if self._amplitudes.fall_between_batches():
            return words, None, "smooth"
        if self._amplitudes.are_all or (self._amplitudes.stay() and not self._may_settle()):
            return words, level, "periodic" if self._spread()[1] < MAX_SPREAD else "irregular"
        self._set_limit(max_cycles)
        pause = self._amplitudes.pause(self._motion.loading_time)
        words, trace = self._motion.advance(words, pause)
        return words, self.level_of(trace), ""

    def _is_settled(self, multiple: int) -> bool:
        """Whether the changes of the last cycles of some passages are small."""
        if len(self._rows) <= LAST_CYCLES * multiple:
            return False
        changes = self._differences(multiple)[-LAST_CYCLES * multiple :]
        return float(np.max(np.abs(changes))) < MAX_CHANGE * self._tolerance

    def _may_settle(self) -> bool:
        """Whether passages are few, or changes over a cycle of some still become smaller."""
        if len(self._rows) < SPREAD_PASSAGES:
            return True
        for multiple in range(1, MAX_MULTIPLE + 1):
            sizes = np.max(np.abs(self._differences(multiple)), axis=1)
            early, _, late = (float(np.median(one)) for one in np.array_split(sizes, 3))
            if late < SETTLING * early:
                return True
        return False

    def _settles_slowly(self) -> bool:
        """Whether the changes over a cycle still shrink, of a motion with a maximum of passages."""
        if self._count >= SLOW_PASSAGES * (self._max_passages or 0) or len(self._rows) < 6:
            return False
        return self._trend() < SLOWLY

    def _trend(self) -> float:
        """The changes over a cycle in the last third of the passages, over those in the middle."""
        sizes = np.max(np.abs(self._differences(self._multiple()[0])), axis=1)
        _, middle, late = (float(np.median(one)) for one in np.array_split(sizes, 3))
        return late / max(middle, 1e-300)

    def _spread(self) -> tuple[int, float]:
        """Number of passages in a cycle with the smallest relative spread, and that spread."""
        last = np.array(self._rows[-SPREAD_PASSAGES:])
        found = [(1, math.inf)]
        if len(last) == SPREAD_PASSAGES:
            amplitude = float(np.mean(last[:, 1] - last[:, 2]))
            last /= np.array([float(np.mean(last[:, 0])), amplitude, amplitude])
            for multiple in range(1, MAX_MULTIPLE + 1):
                spread = max(
                    float(np.std(last[one::multiple], axis=0).max()) for one in range(multiple)
                )
                found.append((multiple, spread))
        best = min(spread for _, spread in found)
        return next(one for one in found if one[1] <= EQUAL_SPREAD * best)

    def _remaining(self, multiple: int) -> float:
        """Distance to the limit of changes over a cycle that shrink slowly; 0 if they do not."""
        sizes = np.max(np.abs(self._differences(multiple)), axis=1)
        early, _, late = (float(np.median(one)) for one in np.array_split(sizes, 3))
        if not late < SLOWLY * early:
            return 0.0
        factor = math.pow(late / early, 3 * multiple / (2 * len(sizes)))
        return late * factor / (1 - factor)

    def _take(self, passage: Passage) -> None:
        self._recent = [*self._recent[1 - 2 * MAX_MULTIPLE :], passage]
        self._rows.append(np.array([passage.period, passage.peak, passage.low]))
        self._amplitudes.take(passage)

    def _force_of(self, multiple: int) -> Array:
        force: Array = np.concatenate(
            [one.trace["spring_force"] for one in self._recent[-multiple:]]
        )
        return force

    def _differences(self, multiple: int) -> Array:
        """See `_changes`."""
        return _changes(np.array(self._rows), multiple, 1e-9 * self._force)

    def _multiple(self) -> tuple[int, float]:
        """Number of passages in a cycle, and the estimated relative error of its period and peaks.

        The passages of a cycle of several stay different from each other.
        """
        found: list[tuple[float, int]] = []
        is_shrinking, first = False, math.inf
        for multiple in range(1, MAX_MULTIPLE + 1):
            if len(self._rows) < 2 * multiple + 1 or (multiple > 1 and is_shrinking):
                break
            last, before = _last_changes(np.array(self._rows), multiple, 1e-9 * self._force)
            is_shrinking = is_shrinking or last < SHRINKING * before
            first = last if multiple == 1 else first
            if multiple == 1 or first > EQUAL_CHANGE * last:
                decay = None if self._decay is None else self._decay**multiple
                found.append((_distance(last, before, decay), multiple))
        if not found:
            return 1, math.inf
        settled = [one for one in found if one[0] < self._tolerance]
        error, multiple = min(settled, key=lambda one: one[1]) if settled else min(found)
        return multiple, error

    def _decays(self) -> bool:
        """Whether the amplitude decays to zero, by linear theory or its geometric series."""
        rows = np.array(self._rows)
        if len(rows) < 6 or self._is_stable is False:
            return False
        if self._amplitudes.decay_linearly():
            return True
        sizes = rows[-5:, 1] - rows[-5:, 2]
        if sizes[-1] < MIN_AMPLITUDE * self._force:
            return bool(np.all(np.diff(sizes) < 0))
        ratios = sizes[1:] / sizes[:-1]
        falls = np.diff(sizes)
        if not (np.all(ratios < 1) and np.ptp(ratios) < 0.02 * (1 - np.mean(ratios))):
            return False
        factor = falls[1:] / falls[:-1]
        limit = sizes[-1] + falls[-1] * float(np.mean(factor)) / (1 - float(np.mean(factor)))
        return bool(np.all(factor < 1) and limit < DECAYED * sizes[-1])

    def result(self, motion: str, words: Words) -> Settled:
        multiple, error = self._multiple()
        if motion != "periodic":
            multiple = 1
        elif error > self._tolerance:
            multiple, error = self._spread()
            error = max(error, self._remaining(multiple))
        passages = self._recent[-multiple:] if motion == "periodic" else self._recent
        return Settled(
            motion,
            multiple,
            passages,
            self._level,
            words,
            time_of(words) - self._start,
            self._count,
            error if motion == "periodic" else math.nan,
            np.array(self._rows).reshape(-1, 3),
            self._amplitudes.batches,
        )
