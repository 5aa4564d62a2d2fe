"""Whether an oscillation of the master equation decays or keeps its amplitude.

A decay may take hundreds of periods. Near smooth sliding its rate is that of the leading root of
linear theory; otherwise only longer times show it. So passages are computed in batches, with pauses
that double from one batch to the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.array_types import Array

if TYPE_CHECKING:
    from mesoslip.cycles.section import Passage

# First pause over the time of loading, and maximum number of batches.
BATCH_LOADINGS, MAX_BATCHES = 5.0, 7
# Maximum relative difference of equal means, in addition to a number of standard errors.
EQUAL_MEANS, STANDARD_ERRORS = 0.03, 3.0
# Number of batches compared if smooth sliding is linearly unstable, and otherwise.
MIN_BATCHES_UNSTABLE, MIN_BATCHES_STABLE = 2, 3
# Number of passages in which a decay by linear theory is sought.
MIN_LINEAR, MAX_LINEAR = 6, 24
# Maximum deviation of the velocity from the drive's, over it, so that the slider does not stop;
# maximum relative deviations of period and rate from those of the leading root.
MAX_SWING, PERIOD_MARGIN, RATE_MARGIN = 0.6, 0.05, 0.25
# Maximum deviation of the rate due to steps of the solver, over the frequency; minimum part of the
# variation of the logarithm of the amplitude that the decay explains.
STEP_MARGIN, MIN_EXPLAINED = 1e-4, 0.95


class Batch(NamedTuple):
    """Time [s], mean amplitude and its standard error [N] in the later half of a batch, and whether
    the oscillation is that of linear theory."""

    time: float
    mean: float
    error: float
    is_linear: bool


class Amplitudes:
    """Amplitudes of the passages so far, compared with linear theory.

    The velocity is the drive's [m/s]; stability and leading root [1/s] of smooth sliding may be
    unknown.
    """

    def __init__(self, velocity: float, is_stable: bool | None, root: complex | None) -> None:
        self._velocity = velocity
        self._root = root if root is not None and root.real < 0 < root.imag else None
        self._needed = MIN_BATCHES_UNSTABLE if is_stable is False else MIN_BATCHES_STABLE
        self.batches: list[Batch] = []
        self._rows: list[tuple[float, float, bool]] = []
        self._first = 0

    def continue_after(self, batches: Sequence[Batch]) -> None:
        """Begin after batches of another motion; at least one more is needed."""
        self.batches = list(batches[1 - self._needed :])

    def restart(self) -> None:
        """Begin another series of passages, as the section or the state has been replaced."""
        self._first = len(self._rows)

    def take(self, passage: Passage) -> None:
        """Record a passage."""
        velocity = passage.trace["velocity"] / self._velocity
        is_linear = self._root is not None and (
            float(np.max(np.abs(velocity - 1))) < MAX_SWING
            and abs(passage.period * self._root.imag / (2 * math.pi) - 1) < PERIOD_MARGIN
        )
        self._rows.append((passage.time, passage.peak - passage.low, is_linear))

    def decay_linearly(self) -> bool:
        """Whether the last passages decay as in linear theory, and the slider does not stop.

        The rate then differs from the root's by a term of the square of the amplitude, less than
        the margin. So it stays negative as the amplitude falls: there is no smaller cycle.
        """
        times, sizes, is_linear = self._columns(self._rows[self._first :][-MAX_LINEAR:])
        count = len(times) if np.all(is_linear) else int(np.argmin(is_linear[::-1]))
        if count < MIN_LINEAR:
            return False
        times, logarithms = times[-count:], np.log(sizes[-count:])
        slope, offset = np.polyfit(times - times[0], logarithms, 1)
        rest = float(np.var(logarithms - slope * (times - times[0]) - offset))
        is_exponential = rest <= (1 - MIN_EXPLAINED) * float(np.var(logarithms))
        return is_exponential and self._is_rate(float(slope))

    def end_batch(self) -> None:
        """Make a batch of the passages since the last one."""
        times, sizes, is_linear = self._columns(self._rows[len(self._rows) // 2 :])
        error = float(np.std(sizes)) / math.sqrt(len(sizes))
        self.batches.append(
            Batch(float(np.mean(times)), float(np.mean(sizes)), error, bool(np.all(is_linear[1:])))
        )
        self._rows, self._first = [], 0

    def fall_between_batches(self) -> bool:
        """Whether the amplitude falls from the last batch to this one as in linear theory."""
        if len(self.batches) < 2 or not all(one.is_linear for one in self.batches[-2:]):
            return False
        early, late = self.batches[-2:]
        fall = math.log(late.mean / early.mean)
        error = math.hypot(early.error / early.mean, late.error / late.mean)
        return -fall > STANDARD_ERRORS * error and self._is_rate(fall / (late.time - early.time))

    @property
    def are_all(self) -> bool:
        """Whether there are no further batches."""
        return len(self.batches) >= MAX_BATCHES

    def stay(self) -> bool:
        """Whether the mean amplitude stays the same."""
        last, *before = self.batches[: -self._needed - 1 : -1]
        return len(before) == self._needed - 1 and all(
            abs(one.mean - last.mean)
            < EQUAL_MEANS * last.mean + STANDARD_ERRORS * math.hypot(last.error, one.error)
            for one in before
        )

    def pause(self, loading_time: float) -> float:
        """Time until the next batch [s]."""
        return BATCH_LOADINGS * loading_time * 2.0 ** (len(self.batches) - 1)

    def _is_rate(self, rate: float) -> bool:
        if self._root is None or rate >= 0:
            return False
        margin = RATE_MARGIN * abs(self._root.real) + STEP_MARGIN * self._root.imag
        return abs(rate - self._root.real) < margin

    @staticmethod
    def _columns(rows: list[tuple[float, float, bool]]) -> tuple[Array, Array, np.ndarray]:
        times, sizes, is_linear = np.array(rows).reshape(-1, 3).T
        return times, sizes, is_linear.astype(bool)
