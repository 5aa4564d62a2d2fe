"""The result: the regime of a realization, and the statistics that determine it."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from mesoslip.analysis.regime.events import MIN_CYCLES
from mesoslip.output.variables import Group, Meaning
from mesoslip.quantities import percent, with_error, with_unit

SMOOTH, STICK_SLIP, IRREGULAR, TRANSIENT = range(4)
# What forces are divided by: the one of a model, or the maximum of a measured force.
STATIC_FORCE, MAXIMUM_FORCE = "static force", "maximum force"
NAMES = ("smooth", "stick_slip", "irregular", "transient")


def _variable(
    long_name: str,
    units: str = "1",
    *,
    default: float = math.nan,
    dtype: DTypeLike = np.float64,
    **further: str,
) -> Any:
    """A field that is a variable of outputs too."""
    return field(
        default=default, metadata={"meaning": Meaning(units, long_name, dtype, further=further)}
    )


@dataclass(frozen=True)
class RegimeResult:
    """The regime of a realization and the statistics that determine it."""

    regime: int = _variable(
        "regime of the motion", default=TRANSIENT, dtype=np.int8, flag_meanings=" ".join(NAMES)
    )
    relative_amplitude: float = _variable(
        "half the distance of the 5th and 95th percentiles of the force, over the static force"
    )
    smooth_amplitude: float = _variable(
        "upper limit for smooth sliding with N contacts, over the static force"
    )
    cycles: int = _variable(
        "cycles of the motion: from slip to slip, or of the force", default=0, dtype=np.int64
    )
    are_slips: bool = _variable(
        "whether the cycles are those from slip to slip", default=False, dtype=np.int8
    )
    slip_share: float = _variable(
        "falls of the force in slips, without rebounds, over the loading by the drive, K v t"
    )
    period: float = _variable("mean period of the cycles", "s")
    period_variation: float = _variable("coefficient of variation of the periods")
    period_irregularity: float = _variable(
        "smallest variation of the periods, allowing patterns of 2 or 3 cycles"
    )
    fall_variation: float = _variable(
        "coefficient of variation of the falls of the force in a cycle"
    )
    fall_irregularity: float = _variable(
        "smallest variation of the falls, allowing patterns of 2 or 3 cycles"
    )
    peak_spread: float = _variable(
        "standard deviation of the peaks of the force, over the distance of its percentiles"
    )
    peak_irregularity: float = _variable(
        "smallest standard deviation of the peaks over the mean fall, allowing patterns of 2 or 3 "
        "cycles"
    )
    peak_correlation: float = _variable(
        "correlation of each peak with the next one (the return map)"
    )
    amplitude_change: float = _variable(
        "change of the falls over the evaluated window, over their mean"
    )
    amplitude_change_error: float = _variable("standard error of the amplitude change")
    drift: float = _variable(
        "change of the mean force between the halves of the evaluated window, over the static force"
    )
    fast_share: float = _variable("share of the time in which the slider is faster than the drive")
    stick_share: float = _variable(
        "share of the time in which the slider has less than half the drive's velocity"
    )
    slips: int = _variable("slips in the evaluated window", default=0, dtype=np.int64)
    window_start: float = _variable("start of the evaluated window", "s")
    window_end: float = _variable("end of the evaluated window", "s")
    force_scale: str = STATIC_FORCE

    def long_name(self, name: str) -> str:
        """The meaning of a variable, with the force that it is divided by."""
        return REGIME[name].long_name.replace(STATIC_FORCE, self.force_scale)

    @property
    def summary(self) -> str:
        """The regime in words, with the main statistics."""
        name = NAMES[self.regime].replace("_", "-")
        if not math.isfinite(self.relative_amplitude):
            return f"{name}: too few samples to determine a regime"
        text = (
            f"{name}: force amplitude {percent(self.relative_amplitude)} of the {self.force_scale}"
        )
        if self.regime == SMOOTH:
            return text
        if self.cycles < MIN_CYCLES:
            whole = "1 whole cycle" if self.cycles == 1 else f"{self.cycles} whole cycles"
            return (
                f"{text}; {whole} between {with_unit(self.window_start, 's')} "
                f"and {with_unit(self.window_end, 's')}, at least {MIN_CYCLES} are needed: give a "
                "longer duration"
            )
        period = with_error(self.period, self.period * self.period_variation, "s", 3)
        if self.are_slips:
            return f"{text}, a slip every {period} ({self.cycles} times)"
        return f"{text}, {self.cycles} oscillations of {period}"

    @property
    def row(self) -> dict[str, Any]:
        """The values by name, with the types that they have in an output."""
        return {
            name: np.dtype(meaning.dtype).type(getattr(self, name)).item()
            for name, meaning in REGIME.items()
        }


# The variables of outputs.
REGIME = Group({one.name: one.metadata["meaning"] for one in fields(RegimeResult) if one.metadata})


def summary(results: list[RegimeResult]) -> str:
    """The regimes of all realizations on a line."""
    if len(results) == 1:
        return results[0].summary
    counts = Counter(one.regime for one in results)
    names = (f"{counts[one]} {NAMES[one].replace('_', '-')}" for one in sorted(counts))
    return f"{len(results)} realizations: {', '.join(names)}"
