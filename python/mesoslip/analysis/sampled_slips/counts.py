"""How the number of slips depends on the minimum fall, and the plateau of that number."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips.search import SlipSearch

Array = NDArray[np.float64]

# Ratio of thresholds for which slips are counted.
THRESHOLD_RATIO = 1.25
# A plateau: maximum change of the count, and minimum ratio of its thresholds.
MAX_CHANGE, MIN_PLATEAU = 0.1, 1.5
# Minimum number of slips at the plateau, over that of all that stands out of the noise.
MIN_KEPT = 0.5


@dataclass(frozen=True)
class SlipCounts:
    """How the number of slips depends on the minimum fall.

    Attributes
    ----------
    threshold
        Minimum falls, in the unit of the force, shape (thresholds,).
    count
        Number of slips, shape (thresholds,).
    plateau
        First and last minimum fall of the range in which the number hardly changes and from which
        the minimum fall is taken; None if there is no such range.
    """

    threshold: Array = field(default_factory=lambda: np.empty(0))
    count: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=int))
    plateau: tuple[float, float] | None = None


def count_slips(search: SlipSearch) -> SlipCounts:
    """Slips by threshold, and the plateau of their number.

    From what stands out of the white noise on: what seems to be correlated noise may be the trace.
    """
    trace = search.trace
    deepest = float(trace.extremes.fall_sizes[-1])
    steps = max(1, math.ceil(math.log(deepest / trace.white_floor) / math.log(THRESHOLD_RATIO)))
    thresholds: Array = trace.white_floor * THRESHOLD_RATIO ** np.arange(steps, dtype=np.float64)
    counts = np.array([len(search.slips(float(one))[0]) for one in thresholds])
    for first, count in enumerate(counts):
        same = np.abs(counts[first:] - count) <= max(1.0, MAX_CHANGE * count)
        last = first + (int(np.argmin(same)) if not same.all() else len(same)) - 1
        # A few deep falls, as at the start of a run, are no plateau.
        if count < MIN_KEPT * counts[0]:
            break
        if thresholds[last] >= MIN_PLATEAU * thresholds[first]:
            return SlipCounts(
                thresholds, counts, (float(thresholds[first]), float(thresholds[last]))
            )
    return SlipCounts(thresholds, counts)
