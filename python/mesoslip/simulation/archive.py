"""The state of a kernel as named entries: places in the words of a checkpoint.

``fortran/numerics/archive.f90`` defines the words: for each entry a name of 32 characters, its kind
and two extents, then its values. Sections are entries without values.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import RunError
from mesoslip.simulation.kernel import Words

HEADING, HEADING_WORDS = struct.Struct("=32s3q"), 7
KIND_SECTION, KIND_REAL, KIND_INTEGER = 0, 1, 2


class Entry(NamedTuple):
    """Numbers of one name, a matrix column by column."""

    name: str
    kind: int
    extent: tuple[int, int]
    start: int
    """Place of the first one in the words."""

    def of(self, words: Words) -> NDArray[Any]:
        """A view of the numbers, shape (numbers)."""
        values = words[self.start : self.start + self.extent[0] * self.extent[1]]
        return values.view(np.float64) if self.kind == KIND_REAL else values


class Archive:
    """A state whose entries can be read and replaced; see `Kernel.save`."""

    def __init__(self, words: Words) -> None:
        self._words = words.copy()
        self._at: dict[tuple[str, str], list[Entry]] = {}
        section = ""
        for one in entries(words):
            if one.kind == KIND_SECTION:
                section = one.name
            else:
                self._at.setdefault((section, one.name), []).append(one)

    def _find(self, section: str, name: str) -> list[Entry]:
        try:
            return self._at[section, name]
        except KeyError:
            raise RunError(f"the state has no '{name}' of '{section}'") from None

    def section_with(self, name: str) -> str:
        """The first section that has an entry of that name."""
        for section, one in self._at:
            if one == name:
                return section
        raise RunError(f"the state has no '{name}'")

    def numbers(self, section: str, name: str) -> Array:
        """All numbers of a name, shape (numbers); a compensated sum has two."""
        found = [one.of(self._words) for one in self._find(section, name)]
        return np.concatenate(found).astype(float)

    def number(self, section: str, name: str) -> float:
        """A number; the total of a compensated sum."""
        return float(np.sum(self.numbers(section, name)))

    def matrix(self, section: str, name: str) -> Array:
        """A matrix with the rows and columns that it has in Fortran."""
        (entry,) = self._find(section, name)
        return entry.of(self._words).astype(float).reshape(entry.extent, order="F")

    def set_number(self, section: str, name: str, value: float) -> None:
        """Replace a number; the rounding error of a compensated sum becomes 0."""
        first, *rest = self._find(section, name)
        first.of(self._words)[:] = value
        for one in rest:
            one.of(self._words)[:] = 0

    def set_matrix(self, section: str, name: str, values: Array) -> None:
        """Replace a matrix by another of the same shape."""
        (entry,) = self._find(section, name)
        entry.of(self._words)[:] = values.ravel(order="F")

    def words(self) -> Words:
        """The state as words."""
        return self._words.copy()


def entries(words: Words) -> Iterator[Entry]:
    """The entries of a state in their order; raises a `RunError` if the words are not a state."""
    buffer, place = np.ascontiguousarray(words).view(np.uint8).data, 0
    while place < len(words):
        is_whole = len(words) - place >= HEADING_WORDS
        name, kind, *extent = HEADING.unpack_from(buffer, 8 * place) if is_whole else (b"", -1)
        if kind not in {KIND_SECTION, KIND_REAL, KIND_INTEGER}:
            raise RunError("these words are not the state of a simulation")
        place += HEADING_WORDS
        rows, columns = extent
        yield Entry(name.decode().strip(), kind, (rows, columns), place)
        place += rows * columns if kind != KIND_SECTION else 0
