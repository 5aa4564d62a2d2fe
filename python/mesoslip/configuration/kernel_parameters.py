"""Parameters as kernels take them: names with numbers, words or lists of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

Names = NDArray[np.bytes_]
# Numbers, words, or lists of numbers, by name.
Parameters = dict[str, float | str | tuple[float, ...]]

# Characters of a name, see fortran/numerics/parameters.f90.
NAME_LENGTH = 32


def named(
    parameters: Mapping[str, float | str | tuple[float, ...]],
) -> tuple[Names, NDArray[np.float64], Names]:
    """Parameters as a kernel takes them: names, numbers, and words where there are no numbers.

    The name of a list occurs as often as it has numbers.
    """
    names: list[str] = []
    numbers: list[float] = []
    words: list[str] = []
    for name, value in parameters.items():
        several = value if isinstance(value, tuple) else (value,)
        names += [name] * len(several)
        numbers += [0.0 if isinstance(one, str) else float(one) for one in several]
        words += [one if isinstance(one, str) else "" for one in several]
    # Of arrays of one length f2py refuses all but the first if that is 0.
    return padded(names), np.array(numbers or [0.0]), padded(words or [""])


def padded(words: Iterable[str]) -> Names:
    """Words with blanks behind, as Fortran compares them."""
    return np.array([word.ljust(NAME_LENGTH).encode() for word in words], dtype=f"S{NAME_LENGTH}")
