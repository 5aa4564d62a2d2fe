"""The state of a kernel as named entries, decoded from the words of a checkpoint and encoded again.

``fortran/numerics/archive.f90`` defines the words: for each entry a name of 32 characters, its kind
and two extents, then its values. Sections are entries without values.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import RunError
from mesoslip.simulation.kernel import Words

NAME_WORDS, HEADING_WORDS = 4, 7
KIND_SECTION, KIND_REAL, KIND_INTEGER = 0, 1, 2


class Entry(NamedTuple):
    """Numbers of one name; ``values`` has shape (numbers), a matrix column by column."""

    name: str
    kind: int
    extent: tuple[int, int]
    values: NDArray[Any]


class Archive:
    """A state whose entries can be read and replaced; see `Kernel.save`."""

    def __init__(self, words: Words) -> None:
        self._entries = list(entries(words))
        self._at: dict[tuple[str, str], list[int]] = {}
        section = ""
        for number, one in enumerate(self._entries):
            if one.kind == KIND_SECTION:
                section = one.name
            else:
                self._at.setdefault((section, one.name), []).append(number)

    def _find(self, section: str, name: str) -> list[int]:
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
        found = [self._entries[one].values for one in self._find(section, name)]
        return np.concatenate(found).astype(float)

    def number(self, section: str, name: str) -> float:
        """A number; the total of a compensated sum."""
        return float(np.sum(self.numbers(section, name)))

    def matrix(self, section: str, name: str) -> Array:
        """A matrix with the rows and columns that it has in Fortran."""
        (at,) = self._find(section, name)
        entry = self._entries[at]
        return entry.values.astype(float).reshape(entry.extent, order="F")

    def set_number(self, section: str, name: str, value: float) -> None:
        """Replace a number; the rounding error of a compensated sum becomes 0."""
        first, *rest = self._find(section, name)
        self._replace(first, np.array([value]))
        for one in rest:
            self._replace(one, np.zeros(1))

    def set_matrix(self, section: str, name: str, values: Array) -> None:
        """Replace a matrix by another, whose shape may differ."""
        (at,) = self._find(section, name)
        rows, columns = values.shape
        self._entries[at] = self._entries[at]._replace(extent=(rows, columns))
        self._replace(at, values.ravel(order="F"))

    def _replace(self, at: int, values: Array) -> None:
        entry = self._entries[at]
        self._entries[at] = entry._replace(values=np.asarray(values).astype(entry.values.dtype))

    def words(self) -> Words:
        """The state as words."""
        pieces: list[Words] = []
        for one in self._entries:
            heading = np.empty(HEADING_WORDS, dtype=np.int64)
            name = one.name.ljust(8 * NAME_WORDS).encode()
            heading[:NAME_WORDS] = np.frombuffer(name, dtype=np.int64)
            heading[NAME_WORDS:] = one.kind, *one.extent
            pieces += [heading, one.values.view(np.int64)]
        return np.concatenate(pieces)


def entries(words: Words) -> Iterator[Entry]:
    """The entries of a state in their order; raises a `RunError` if the words are not a state."""
    place = 0
    while place < len(words):
        heading = words[place : place + HEADING_WORDS]
        place += HEADING_WORDS
        kind = int(heading[NAME_WORDS]) if len(heading) == HEADING_WORDS else -1
        if kind not in {KIND_SECTION, KIND_REAL, KIND_INTEGER}:
            raise RunError("these words are not the state of a simulation")
        rows, columns = (int(one) for one in heading[NAME_WORDS + 1 :])
        length = rows * columns if kind != KIND_SECTION else 0
        values = words[place : place + length].copy()
        place += length
        name = heading[:NAME_WORDS].tobytes().decode().strip()
        numbers: NDArray[Any] = values.view(np.float64) if kind == KIND_REAL else values
        yield Entry(name, kind, (rows, columns), numbers)
