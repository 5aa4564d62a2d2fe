"""The result: the regime of a realization, and the statistics that determine it."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.analysis.cycles import MIN_CYCLES
from mesoslip.output.variables import Group, Meaning
from mesoslip.quantities import percent, with_error, with_unit

if TYPE_CHECKING:
    import xarray as xr

SMOOTH, STICK_SLIP, IRREGULAR, TRANSIENT = range(4)
NAMES = ("smooth", "stick_slip", "irregular", "transient")

REGIME = Group(
    regime=Meaning(
        "1",
        "regime of the motion",
        np.int8,
        further={"flag_meanings": " ".join(NAMES)},
    ),
    relative_amplitude=Meaning(
        "1",
        "half the distance of the 5th and 95th percentiles of the force, over the static force",
    ),
    smooth_amplitude=Meaning(
        "1", "upper limit for smooth sliding with N contacts, over the static force"
    ),
    cycles=Meaning("1", "cycles of the motion: from slip to slip, or of the force", np.int64),
    are_slips=Meaning("1", "whether the cycles are those from slip to slip", np.int8),
    slip_share=Meaning("1", "force drops of the slips over the loading by the drive, K v t"),
    period=Meaning("s", "mean period of the cycles"),
    period_variation=Meaning("1", "coefficient of variation of the periods"),
    period_irregularity=Meaning(
        "1", "smallest variation of the periods, allowing patterns of 2 or 3 cycles"
    ),
    fall_variation=Meaning("1", "coefficient of variation of the falls of the force in a cycle"),
    fall_irregularity=Meaning(
        "1", "smallest variation of the falls, allowing patterns of 2 or 3 cycles"
    ),
    peak_spread=Meaning(
        "1", "standard deviation of the peaks of the force, over the distance of its percentiles"
    ),
    peak_irregularity=Meaning(
        "1",
        "smallest standard deviation of the peaks over the mean fall, allowing patterns of 2 or 3 "
        "cycles",
    ),
    peak_correlation=Meaning("1", "correlation of each peak with the next one (the return map)"),
    amplitude_change=Meaning("1", "change of the falls over the evaluated window, over their mean"),
    amplitude_change_error=Meaning("1", "standard error of the amplitude change"),
    drift=Meaning(
        "1",
        "change of the mean force between the halves of the evaluated window, over the static "
        "force",
    ),
    fast_share=Meaning("1", "share of the time in which the slider is faster than the drive"),
    stick_share=Meaning(
        "1", "share of the time in which the slider has less than half the drive's velocity"
    ),
    slips=Meaning("1", "slips in the evaluated window", np.int64),
    window_start=Meaning("s", "start of the evaluated window"),
    window_end=Meaning("s", "end of the evaluated window"),
)


@dataclass(frozen=True)
class RegimeResult:
    """The regime of a realization and the statistics that determine it, see `REGIME`."""

    regime: int = TRANSIENT
    relative_amplitude: float = math.nan
    smooth_amplitude: float = math.nan
    cycles: int = 0
    are_slips: bool = False
    slip_share: float = math.nan
    period: float = math.nan
    period_variation: float = math.nan
    period_irregularity: float = math.nan
    fall_variation: float = math.nan
    fall_irregularity: float = math.nan
    peak_spread: float = math.nan
    peak_irregularity: float = math.nan
    peak_correlation: float = math.nan
    amplitude_change: float = math.nan
    amplitude_change_error: float = math.nan
    drift: float = math.nan
    fast_share: float = math.nan
    stick_share: float = math.nan
    slips: int = 0
    window_start: float = math.nan
    window_end: float = math.nan

    @property
    def summary(self) -> str:
        """The regime in words, with the main statistics."""
        name = NAMES[self.regime].replace("_", "-")
        if not math.isfinite(self.relative_amplitude):
            return f"{name}: too few samples to determine a regime"
        text = f"{name}: force amplitude {percent(self.relative_amplitude)} of the static force"
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


def results_of(data: xr.Dataset) -> list[RegimeResult]:
    """The results in a dataset of `regimes`, one for each realization."""
    columns = {name: data[name].values.tolist() for name in REGIME}
    return [
        RegimeResult(**dict(zip(columns, row, strict=True)))
        for row in zip(*columns.values(), strict=True)
    ]


def summary(results: list[RegimeResult]) -> str:
    """The regimes of all realizations on a line."""
    if len(results) == 1:
        return results[0].summary
    counts = Counter(one.regime for one in results)
    names = (f"{counts[one]} {NAMES[one].replace('_', '-')}" for one in sorted(counts))
    return f"{len(results)} realizations: {', '.join(names)}"
