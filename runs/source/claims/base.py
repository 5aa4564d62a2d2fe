"""What a claim of the source is, and what becomes of it: measured quantities and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr


class Verdict(StrEnum):
    """What the runs say of a claim."""

    HOLDS = "holds"
    QUALIFIED = "holds with a qualification"
    FAILS = "fails"


@dataclass(frozen=True)
class Measured:
    """A quantity that was measured, beside what the source says of it."""

    name: str
    values: tuple[float, ...]
    """One for each realization; a single one of what has none."""
    unit: str
    source: str
    """What the source says, as it says it."""

    @property
    def mean(self) -> float:
        return float(np.mean(self.values))

    @property
    def spread(self) -> float | None:
        """Standard deviation over the realizations; None for a single value."""
        return float(np.std(self.values, ddof=1)) if len(self.values) > 1 else None

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.spread is None:
            return f"{self.mean:.4g}{unit}"
        return f"{self.mean:.4g} ± {self.spread:.2g}{unit}"


def measured(name: str, values: ArrayLike, unit: str, source: str) -> Measured:
    """A quantity that was measured, of one value or of one for each realization."""
    return Measured(name, tuple(np.atleast_1d(np.asarray(values, dtype=float))), unit, source)


@dataclass(frozen=True)
class Finding:
    """What was found of a claim."""

    measured: tuple[Measured, ...]
    verdict: Verdict
    reason: str


Judge = Callable[[Sequence["xr.DataTree"]], Finding]


@dataclass(frozen=True)
class Claim:
    """A claim of the source, the runs that can decide it, and how they do."""

    name: str
    statement: str
    criterion: str
    runs: tuple[str, ...]
    """Names of outputs under the folder of outputs, without ``.nc``."""
    judge: Judge


@dataclass(frozen=True)
class Judgement:
    """A claim, and what was found of it."""

    claim: Claim
    finding: Finding


def verdict(holds: bool, qualified: bool = False) -> Verdict:
    """Holds or fails; what holds may do so with a qualification."""
    if not holds:
        return Verdict.FAILS
    return Verdict.QUALIFIED if qualified else Verdict.HOLDS


def variable(tree: xr.DataTree, name: str) -> NDArray[np.float64]:
    """Values of a variable of the root of an output."""
    return np.asarray(tree.to_dataset()[name].values, dtype=float)
