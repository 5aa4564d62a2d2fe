"""The return of a settled cycle after a disturbance, and its multipliers.

The density of contacts over their stretch is modulated, and the cycle is iterated until period and
peaks return. Single small changes of the state would not do: the map forgets them within a few
cycles, but may first enlarge them, so that eigenvalues of its differences say little.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mesoslip.array_types import Array
from mesoslip.cycles.coordinates import Coordinates
from mesoslip.cycles.section import Motion
from mesoslip.cycles.settling import Settled
from mesoslip.simulation.kernel import Words

# Relative modulation of the density of pinned contacts, and maximum number of cycles after it.
MODULATION, MAX_RETURN = 0.05, 64
# Distance of period and peaks from the cycle, and their change in each of the last two cycles, over
# the maximum distance, below which a motion returns; minimum number of cycles.
RETURNED, MIN_RETURN = 0.1, 5
# Order of the recurrence that gives the angle of the leading multiplier.
ORDER = 2


class Return(NamedTuple):
    """The motion after a disturbance of a cycle."""

    words: Words
    """Its state at the end."""
    returns: bool
    """Whether period and peaks return to those of the cycle."""
    multipliers: tuple[complex, ...]
    cycles: int
    """Number of computed cycles."""

    def decay(self, multiple: int) -> float | None:
        """Factor by which a disturbance of a cycle of some passages decays in one of them; None if
        it is not known."""
        return abs(self.multipliers[0]) ** (1 / multiple) if self.multipliers else None


def after_disturbance(motion: Motion, settled: Settled) -> Return:
    """Disturb a settled cycle, and iterate until it returns."""
    coordinates = Coordinates(motion.config, motion.velocity)
    modulation = coordinates.modulation(settled.words, MODULATION)
    words = coordinates.changed(settled.words, modulation)
    rows = [settled.rows[-settled.multiple :]]
    changes: list[Array] = []
    vector = coordinates.weigh(coordinates.of(words))
    returns = False
    while not returns and len(changes) < MAX_RETURN:
        row = []
        for _ in range(settled.multiple):
            assert settled.level is not None
            passage = motion.next_passage(words, settled.level)
            if passage is None:
                return Return(words, False, multipliers(changes), len(changes))
            words = passage.words
            row.append([passage.period, passage.peak, passage.low])
        rows.append(np.array(row))
        before, vector = vector, coordinates.weigh(coordinates.of(words))
        changes.append(vector - before)
        returns = len(changes) >= MIN_RETURN and _is_back(np.array(rows), settled.error)
    return Return(words, returns, multipliers(changes), len(changes))


def _is_back(rows: Array, error: float) -> bool:
    """Whether cycles return to the first one, shape (cycles, passages, 3); its periods and forces
    have a relative error."""
    start = rows[0]
    amplitude = float(np.mean(start[:, 1] - start[:, 2]))
    rows = rows / np.array([float(np.mean(start[:, 0])), amplitude, amplitude])
    distances = np.max(np.abs(rows[1:] - rows[0]), axis=(1, 2))
    changes = np.max(np.abs(np.diff(rows[1:], axis=0)), axis=(1, 2))
    limit = RETURNED * float(np.max(distances))
    return bool(np.all(changes[-2:] < limit) and distances[-1] < limit + 2 * error)


def multipliers(changes: Sequence[Array]) -> tuple[complex, ...]:
    """The leading factor of successive changes of the state, and its conjugate if it is complex.

    The modulus is the mean one from the maximum change to the last; the angle is that of the
    leading root of the recurrence that fits the changes best.
    """
    sizes = np.array([float(np.linalg.norm(one)) for one in changes])
    top = int(np.argmax(sizes)) if len(sizes) else 0
    if len(sizes) - top <= ORDER or not np.all(sizes > 0):
        return ()
    modulus = (sizes[-1] / sizes[top]) ** (1 / (len(sizes) - 1 - top))
    equations = [
        np.stack(changes[first : first + ORDER + 1], axis=1) / sizes[first]
        for first in range(top, len(changes) - ORDER)
    ]
    *known, last = np.concatenate(equations).T
    factors = np.linalg.lstsq(np.stack(known, axis=1), last, rcond=None)[0]
    root = max(np.roots([1.0, *-factors[::-1]]).tolist(), key=abs)
    leading = complex(modulus * root / abs(root)) if root else complex(modulus)
    return (leading, leading.conjugate()) if leading.imag else (leading,)
