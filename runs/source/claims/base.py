"""Claims of the source, and their judgements: measured quantities and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from mesoslip.quantities import with_error
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr


class Verdict(StrEnum):
    """The verdict on a claim."""

    HOLDS = "holds"
    QUALIFIED = "holds with a qualification"
    FAILS = "fails"


@dataclass(frozen=True)
class Measured:
    """A measured quantity in SI, beside the source's statement about it."""

    name: str
    values: tuple[float, ...]
    """One for each realization, or a single one."""
    unit: str
    source: str
    """The source's statement."""

    @property
    def mean(self) -> float:
        return float(np.mean(self.values))

    @property
    def spread(self) -> float | None:
        """Standard deviation over the realizations; None for a single value."""
        return float(np.std(self.values, ddof=1)) if len(self.values) > 1 else None

    def __str__(self) -> str:
        return with_error(self.mean, 0.0 if self.spread is None else self.spread, self.unit)


def measured(name: str, values: ArrayLike, unit: str, source: str) -> Measured:
    """A measured quantity, with one value or one for each realization, in SI."""
    return Measured(name, tuple(np.atleast_1d(np.asarray(values, dtype=float))), unit, source)


@dataclass(frozen=True)
class Finding:
    """The measured quantities of a claim, and the verdict."""

    measured: tuple[Measured, ...]
    verdict: Verdict
    reason: str


Judge = Callable[[Sequence["xr.DataTree"]], Finding]


@dataclass(frozen=True)
class Claim:
    """A claim of the source, the criterion, and the runs that decide it."""

    name: str
    statement: str
    criterion: str
    runs: tuple[str, ...]
    """Names of outputs under the folder of outputs, without ``.nc``."""
    judge: Judge


CLAIMS: dict[str, Claim] = {}


def claim(
    name: str, statement: str, criterion: str, runs: tuple[str, ...]
) -> Callable[[Judge], Judge]:
    """Make a function of the outputs of runs the judge of a claim."""

    def add(judge: Judge) -> Judge:
        CLAIMS[name] = Claim(name, statement, criterion, runs, judge)
        return judge

    return add


@dataclass(frozen=True)
class Judgement:
    """A claim and its finding."""

    claim: Claim
    finding: Finding


def verdict(holds: bool, qualified: bool = False) -> Verdict:
    """The verdict on a claim that holds or not, and on its qualification."""
    if not holds:
        return Verdict.FAILS
    return Verdict.QUALIFIED if qualified else Verdict.HOLDS


def variable(tree: xr.DataTree, name: str) -> NDArray[np.float64]:
    """Values of a variable of the root of an output."""
    return np.asarray(tree.to_dataset()[name].values, dtype=float)
