"""Parameters for the kernels: names with numbers, words or lists of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Names = NDArray[np.bytes_]
Parameters = dict[str, float | str | tuple[float, ...]]

# Number of characters of a name, see fortran/numerics/parameters.f90.
NAME_LENGTH = 32


class Named(NamedTuple):
    """Arrays of names, numbers and words; a word has the number 0, and a number an empty word."""

    names: Names
    numbers: NDArray[np.float64]
    words: Names


def named(parameters: Mapping[str, float | str | tuple[float, ...]] | Named) -> Named:
    """Parameters as arrays; the name of a list is repeated for each of its numbers."""
    if isinstance(parameters, Named):
        return parameters
    names: list[str] = []
    numbers: list[float] = []
    words: list[str] = []
    for name, value in parameters.items():
        several = value if isinstance(value, tuple) else (value,)
        names += [name] * len(several)
        numbers += [0.0 if isinstance(one, str) else float(one) for one in several]
        words += [one if isinstance(one, str) else "" for one in several]
    # f2py refuses arrays that share a length if that is 0.
    return Named(padded(names), np.array(numbers or [0.0]), padded(words or [""]))


def padded(words: Iterable[str]) -> Names:
    """Words padded with blanks, for Fortran."""
    return np.array([word.ljust(NAME_LENGTH).encode() for word in words], dtype=f"S{NAME_LENGTH}")
