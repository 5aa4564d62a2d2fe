"""Windows of samples, evaluated all at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.alternating_extremes import Samples
from mesoslip.array_types import Array

Value = TypeVar("Value", bound=np.generic)

# Number of samples that are evaluated at once.
MAX_SAMPLES = 2**18


@dataclass(frozen=True)
class Windows:
    """Windows that begin at samples ``first``; in steps of -1 they extend backwards."""

    first: Samples
    size: Samples
    """Numbers of samples, at least 1."""
    step: int = 1

    def blocks(self) -> Iterator[tuple[slice, Windows]]:
        """Windows in blocks, and which they are: memory does not grow with the trace."""
        ends = np.cumsum(self.size)
        if ends.size and ends[-1] <= MAX_SAMPLES:
            yield slice(None), self
            return
        at = 0
        while at < ends.size:
            limit = ends[at] - self.size[at] + MAX_SAMPLES
            to = max(at + 1, int(np.searchsorted(ends, limit, side="right")))
            some = slice(at, to)
            yield some, Windows(self.first[some], self.size[some], self.step)
            at = to

    @cached_property
    def starts(self) -> Samples:
        """Place of the first sample of each window in ``samples``."""
        return np.asarray(np.cumsum(self.size) - self.size)

    @cached_property
    def samples(self) -> Samples:
        """The samples of all windows, one after the other."""
        samples = self.step * np.arange(self.size.sum())
        samples += self.spread(self.first - self.step * self.starts)
        return samples

    def max_of(self, values: NDArray[Value]) -> NDArray[Value]:
        """The maximum of values of ``samples`` in each window."""
        return np.maximum.reduceat(values, self.starts)

    def mean_of(self, values: Array) -> Array:
        """The mean of values of ``samples`` in each window."""
        return np.asarray(np.add.reduceat(values, self.starts) / self.size)

    def spread(self, values: NDArray[Value]) -> NDArray[Value]:
        """A value for each window as one for each of its samples."""
        if values.size == 1:
            # Without copies, as a single window may be long.
            return np.broadcast_to(values, self.size[0])
        return np.repeat(values, self.size)


class Lines(NamedTuple):
    """Lines through samples of windows, arrays of shape (windows,)."""

    level: Array
    """Values at the times that are asked for."""
    slope: Array
    deviation: Array
    """Standard deviation of the samples about the line."""


def lines_through(time: Array, values: Array, windows: Windows, at: Array) -> Lines:
    """Least squares lines, and their values at a time for each window."""
    found = Lines(*np.empty((3, at.size)))
    for some, block in windows.blocks():
        times, sizes = time[block.samples], values[block.samples]
        middle, mean = block.mean_of(times), block.mean_of(sizes)
        since, above = times - block.spread(middle), sizes - block.spread(mean)
        slope = block.mean_of(since * above) / block.mean_of(since**2)
        left = above - block.spread(slope) * since
        found.level[some] = mean + slope * (at[some] - middle)
        found.slope[some] = slope
        found.deviation[some] = np.sqrt(block.mean_of(left**2))
    return found


def parabolas_through(time: Array, values: Array, windows: Windows, at: Samples) -> Array:
    """Values of least squares parabolas at a sample for each window, of at least 3 samples."""
    found = np.empty(at.size)
    for some, block in windows.blocks():
        here = at[some]
        since = time[block.samples] - block.spread(time[here])
        reach = block.max_of(np.abs(since))
        since /= block.spread(reach)
        above = values[block.samples] - block.spread(values[here])
        powers = [block.mean_of(since**order) for order in range(5)]
        products = [block.mean_of(since**order * above) for order in range(3)]
        matrix = np.stack([np.stack(powers[order : order + 3], -1) for order in range(3)], -2)
        solution = np.linalg.solve(matrix, np.stack(products, -1)[..., np.newaxis])
        found[some] = values[here] + solution[:, 0, 0]
    return found
