"""Fronts of detachment along an interface, found in the ruptures of its blocks as a run goes on.

Ruptures of neighbouring blocks whose slips overlap, each with the quiet time after it, are one
event; between neighbours may be a block that broke in part only. An event is whole if it includes
both ends, otherwise a precursor. Within an event, minima of the rupture time along the row are
nucleations, and each arm from a nucleation to where the rupture stops or meets another is a front.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

FRONT_COLUMNS = (
    *("event", "start_time", "end_time", "start_position", "end_position", "length", "speed"),
    *("force_drop", "kind", "passage", "arrest", "stress_ratio_before"),
)
# Values of the columns kind and arrest.
KINDS = PRECURSOR, WHOLE = "precursor", "whole"
ARRESTS = ARRESTED, MET, AT_END = "arrested", "met_another", "at_an_end"

# Blocks from one rupture to the next in an event, at most.
REACH = 2
# Minimum number of blocks in a front with a speed.
MIN_BLOCKS = 3
# Quiet times after the last slip of an event after which it is over: a slip of a block that lasts
# longer than them is in an event of its own.
CLOSED_AFTER = 100.0
# Ruptures of an event over blocks at which it is cut, as in sliding without end.
MAX_PASSES = 100


class Rupture(NamedTuple):
    """A row of the kernel's table of ruptures, in SI."""

    block: float
    start_time: float
    rupture_time: float
    end_time: float
    force_before: float
    force_after: float
    slip: float
    peak_velocity: float
    breaks: float


@dataclass
class _Event:
    """Ruptures of an event, by block."""

    ruptures: dict[int, list[Rupture]] = field(default_factory=dict)
    end: float = -np.inf
    count: int = 0

    def touches(self, one: Rupture, quiet_time: float) -> bool:
        """Whether a rupture overlaps one of the same or a neighbouring block."""
        block = int(one.block)
        return any(
            one.start_time <= other.end_time + quiet_time
            and other.start_time <= one.end_time + quiet_time
            for beside in range(block - REACH, block + REACH + 1)
            for other in self.ruptures.get(beside, ())
        )

    def add(self, one: Rupture) -> None:
        self.ruptures.setdefault(int(one.block), []).append(one)
        self.end = max(self.end, one.end_time)
        self.count += 1

    def join(self, other: _Event) -> None:
        for one in other:
            self.add(one)

    def __iter__(self) -> Iterator[Rupture]:
        for of_block in self.ruptures.values():
            yield from of_block

    @property
    def start(self) -> float:
        return min(one.start_time for one in self)

    def passes(self) -> Iterator[dict[int, Rupture]]:
        """The first rupture of each block, then the second of those that have one, and so on."""
        ordered = {
            block: sorted(rows, key=lambda one: one.rupture_time)
            for block, rows in self.ruptures.items()
        }
        for number in range(max(map(len, ordered.values()))):
            yield {
                block: ordered[block][number]
                for block in sorted(ordered)
                if len(ordered[block]) > number
            }


class Basin(NamedTuple):
    """Blocks of a row that broke from one nucleation: the first, those of the nucleation, and the
    last, by their place in the row."""

    first: int
    nucleus: int
    last: int


class FrontFinder:
    """Finds the fronts of one realization, from the number and distance [m] of its blocks.

    Nucleations that differ by less than the time of sound over a block [s] are one, and a slip is
    over after the quiet time without fast motion [s]. The strength is that of blocks, numbered from
    1, at times [s].
    """

    def __init__(
        self,
        blocks: int,
        spacing: float,
        block_time: float,
        quiet_time: float,
        strength: Callable[[NDArray[np.integer[Any]], Array], Array],
    ) -> None:
        self._blocks, self._spacing = blocks, spacing
        self._block_time, self._quiet_time = block_time, quiet_time
        self._strength = strength
        self._events: list[_Event] = []
        self._clock = 0.0
        self._count = 0

    def save(self) -> dict[str, Any]:
        """Its part of a checkpoint."""
        pending = [list(one) for event in self._events for one in event]
        return {"pending": pending, "clock": self._clock, "count": self._count}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue from a checkpoint."""
        self._count, self._clock = saved["count"], saved["clock"]
        for row in saved["pending"]:
            self._add(Rupture(*row))

    def add(self, rows: Array, *, is_last: bool = False) -> Array:
        """Fronts of the events that are over after rows of ruptures, shape (fronts, columns); with
        the last rows all are."""
        found: list[list[float]] = []
        for row in rows.tolist():
            one = Rupture(*row)
            self._add(one)
            self._clock = max(self._clock, one.end_time)
            found += self._over(self._clock - CLOSED_AFTER * self._quiet_time)
        if is_last:
            found += self._over(np.inf)
        return np.array(found).reshape(-1, len(FRONT_COLUMNS))

    def _add(self, one: Rupture) -> None:
        """Add a rupture to the event that it belongs to, and join those that it connects."""
        touched = [event for event in self._events if event.touches(one, self._quiet_time)]
        event = touched[0] if touched else _Event()
        if not touched:
            self._events.append(event)
        event.add(one)
        for other in touched[1:]:
            event.join(other)
            self._events.remove(other)

    def _over(self, limit: float) -> list[list[float]]:
        """Rows of the fronts of events that end before a time, which are removed."""
        most = MAX_PASSES * self._blocks
        over = [one for one in self._events if one.end < limit or one.count >= most]
        if not over:
            return []
        self._events = [one for one in self._events if one not in over]
        rows = []
        for event in sorted(over, key=lambda one: one.start):
            rows += sorted(self._fronts(event), key=lambda row: row[1])
            self._count += 1
        return rows

    def _fronts(self, event: _Event) -> Iterator[list[float]]:
        is_whole = {1, self._blocks} <= event.ruptures.keys()
        for passage, ruptures in enumerate(event.passes()):
            numbers = np.array(list(ruptures))
            for piece in np.split(numbers, np.flatnonzero(np.diff(numbers) > REACH) + 1):
                rows = [ruptures[block] for block in piece.tolist()]
                times = np.array([one.rupture_time for one in rows])
                for basin in basins(times, self._block_time):
                    for row in self._arms(rows, basin, piece):
                        yield [self._count, *row[:-2], is_whole, passage, *row[-2:]]

    def _arms(
        self, rows: Sequence[Rupture], basin: Basin, piece: NDArray[np.integer[Any]]
    ) -> Iterator[tuple[float, ...]]:
        """Columns of the fronts of a nucleation, but for event, kind and passage; ``piece`` has the
        numbers of the blocks."""
        sides = [
            (direction, end)
            for direction, end in ((-1, basin.first), (1, basin.last))
            if end != basin.nucleus
        ]
        for direction, end in sides or [(1, basin.nucleus)]:
            own = [rows[place] for place in _between(basin.nucleus, end)]
            numbers = piece[_between(basin.nucleus, end)]
            centers = (numbers.astype(float) - 0.5) * self._spacing
            # Two arms share the block of their nucleation; a single one has all of it.
            half = direction * 0.5 * self._spacing
            start = centers[0] - (half if len(sides) < 2 else 0.0)
            stop = centers[-1] + half
            times = np.array([one.rupture_time for one in own])
            starts = np.array([one.start_time for one in own])
            before = np.array([one.force_before for one in own])
            after = np.array([one.force_after for one in own])
            beyond = end + direction
            if piece[end] == (1 if direction < 0 else self._blocks):
                arrest = AT_END
            else:
                arrest = MET if 0 <= beyond < len(rows) else ARRESTED
            yield (
                float(times.min()),
                float(times.max()),
                float(start),
                float(stop),
                float(abs(stop - start)),
                front_speed(times, centers),
                float(np.sum(before - after)),
                float(ARRESTS.index(arrest)),
                float(np.mean(np.abs(before) / self._strength(numbers, starts))),
            )


def _between(start: int, end: int) -> list[int]:
    """Whole numbers from a start to an end, which may be lower."""
    step = 1 if end >= start else -1
    return list(range(start, end + step, step))


def basins(times: Array, resolution: float) -> list[Basin]:
    """Parts of a row that broke from one nucleation each, in their order.

    A nucleation is a minimum of the times [s]. One that is less than ``resolution`` [s] below the
    lower one of the maxima beside it belongs to the part beyond that maximum. A maximum belongs to
    the side that reached it first.
    """
    # The nucleus of each place, -1 before; places are reached as they broke.
    nuclei = np.full(times.size + 2, -1)
    for place in np.argsort(times, kind="stable").tolist():
        left, right = int(nuclei[place]), int(nuclei[place + 2])
        own = place
        if left >= 0 and right >= 0:
            early, late = sorted((left, right), key=lambda one: (times[one], one))
            own = left if times[place - 1] <= times[place + 1] else right
            if times[place] - times[late] < resolution:
                nuclei[nuclei == late] = own = early
        elif left >= 0 or right >= 0:
            own = max(left, right)
        nuclei[place + 1] = own
    found = nuclei[1:-1]
    starts = np.flatnonzero(np.diff(found, prepend=-1))
    ends = np.append(starts[1:], times.size) - 1
    return [
        Basin(first, int(found[first]), last)
        for first, last in zip(starts.tolist(), ends.tolist(), strict=True)
    ]


def front_speed(times: Array, positions: Array) -> float:
    """The robust slope of position over time [m/s]: the inverse of the median of all slopes of
    time over position; NaN of less than three blocks, and where blocks broke at one time.

    Single blocks that broke early or late have no effect, as the slopes of most pairs are those of
    the front.
    """
    if times.size < MIN_BLOCKS:
        return float("nan")
    first, second = np.triu_indices(times.size, 1)
    slowness = np.median((times[second] - times[first]) / (positions[second] - positions[first]))
    return float(1 / slowness) if slowness != 0 else float("nan")
