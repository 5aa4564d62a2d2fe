"""The summaries of a trace: their names, groups, units, and words for a disagreement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np

from mesoslip.text_rows import rows_of_text

# Points of the waveform of a slip, in periods of the setup since the force fell by half.
WAVEFORM = np.arange(-10, 51) / 20
# Times of the comparison with linear loading, over the time of the first peak.
LAGS = (0.8, 0.9, 0.95, 0.97, 0.985)
# Times of the comparison of later loadings with a straight line, over the time between slips.
CREEP_LAGS = (0.7, 0.85, 0.95)
# Quantiles of the force [%].
QUANTILES = (1, 5, 25, 50, 75, 95, 99)
# Frequency bands of the spectrum.
BANDS = 12

# Meaning of the number of a summary, from which its quantity follows: see `Feature.quantity`.
Kind = Literal[
    "force", "log force", "log power", "log rate", "log time", "log count", "log ratio", "ratio"
]
UNITS: dict[Kind, str] = {
    "force": "N",
    "log force": "N",
    "log power": "N",
    "log rate": "N/s",
    "log time": "s",
    "log count": "1",
    "log ratio": "1",
    "ratio": "1",
}


@dataclass(frozen=True)
class Feature:
    name: str
    """Name, unique in a fit."""
    group: str
    """Group of summaries that are compared together."""
    meaning: str
    """Meaning of the number."""
    kind: Kind = "ratio"
    """Kind of the number, by which `quantity` converts it."""
    label: str = ""
    """Name of the quantity."""
    high: str = ""
    """Sentence for a model in which it is larger than in the trace; may be empty."""
    low: str = ""
    """Sentence for a model in which it is smaller."""
    factor: float = 1.0
    """Factor of the quantity, such as the scale of the forces [N]."""
    trace: int = 0
    """Number of the trace."""

    @property
    def unit(self) -> str:
        """SI unit of the quantity."""
        return UNITS[self.kind]

    def quantity(self, value: float) -> float:
        """The quantity in SI behind the number of the summary."""
        if self.kind == "log power":
            value /= 2
        size = math.exp(min(value, 700.0)) if self.kind.startswith("log") else value
        return size * self.factor

    @property
    def is_mentioned(self) -> bool:
        """Whether a sentence describes a disagreement in it."""
        return bool(self.high)


# Features, a row each: name, group, kind, label, what the model does where it is too high and too
# low, and the meaning if that is not the label. Indented lines continue the row above.
WHOLE = """
slip_count | slips | log count | number of slips
    | slips are too frequent | slips are too rare
mean_force | force | force | mean force
    | the mean force is too high | the mean force is too low | mean force after the first slip
force_deviation | force | log force | standard deviation of the force
    | the force varies too much | the force varies too little
"""
QUANTILE = """
force_quantile_{one} | force | force | {one} % quantile of the force
    | the {part} forces are too high | the {part} forces are too low
"""
SPECTRUM = "spectrum_{one} | ringing | log power | | | | logarithm of the power in band {one}"
START = """
loading_slope | first loading | log rate | slope of the first loading
    | the first loading is too steep | the first loading is too slow
    | logarithm of the slope of the loading
loading_start | first loading | force | first force | | | force at which the loading starts
first_peak | first peak | force | force at the first peak
    | the first peak is too high | the first peak is too low
first_peak_time | first peak | log time | time of the first peak
    | the first peak is too late | the first peak is too early
"""
SOFTENING = """
softening_{one:g} | first peak | ratio | force above linear loading, over the peak
    | the force rises too straight to the first peak
    | the force bends too early before the first peak | force relative to linear loading
"""
FIRST_SLIP = """
first_drop | first slip | log force | first force drop
    | the first slip is too deep | the first slip is too shallow
first_rate | first slip | log rate | maximum rate of the first slip
    | the first slip is too fast | the first slip is too slow
"""
FIRST_WAVEFORM = "first_waveform_{one:+.2f} | first slip | force | force along the first slip"
# Quantities of slips: name, kind, label, two sentences of their mean, and meaning.
SLIPS = """
peak | force | force at the start of slips
    | slips start at too high a force | slips start at too low a force
    | force at the start of slips
bottom | force | force at the end of slips
    | slips end at too high a force | slips end at too low a force | force at the end of slips
drop | log force | force drop | slips are too deep | slips are too shallow
    | logarithm of force drops
duration | log time | duration of slips | slips take too long | slips are too short
    | logarithm of durations
rate | log rate | maximum rate of fall | slips are too fast | slips are too slow
    | logarithm of the maximum rate of fall
waiting_time | log time | waiting time | slips are too rare | slips are too frequent
    | logarithm of waiting times
"""
BETWEEN_SLIPS = """
wander | slips | log ratio
    | variation of the force at the start of slips over that from slip to slip
    | the force at the start of slips wanders too much
    | the force at the start of slips wanders too little
    | logarithm of the spread of the force at the start of slips over that from slip to slip
return_map | slips | ratio | correlation of each force drop with the next
    | each slip resembles the next too much | deep and shallow slips alternate too much
"""
SHAPE = """
waveform_{one:+.2f} | shape of slips | force | mean force along slips
    | the force along slips is too high | the force along slips is too low
"""
LOADING = """
stick_slope | loading between slips | log rate | slope of the loading between slips
    | the loading between slips is too steep | the loading between slips is too slow
"""
CREEP = """
creep_{one:g} | loading between slips | ratio
    | force below linear loading at {percent:.0f} % of the time between slips, over the drop
    | the block creeps too much before slips | creep before slips is missing
    | force at {one:g} of the time between slips, below linear loading, over the drop
"""


def features(scale: float, *, has_start: bool) -> Iterator[Feature]:
    """The summaries of a trace in their order, with the unit of forces [N]; ``has_start`` if it
    begins with the first loading of a run."""
    for one in (*_whole(), *(_start() if has_start else ()), *_slips(), *_loading()):
        scaled = one.kind in {"force", "log force", "log rate", "log power"}
        yield replace(one, factor=scale) if scaled else one


def _features(text: str, **values: Any) -> Iterator[Feature]:
    """The features of a table, with values in their places."""
    for name, group, kind, label, *others in rows_of_text(text.format(**values)):
        high, low, meaning = (*others, "", "", "")[:3]
        usual = f"logarithm of the {label}" if kind.startswith("log") else label
        yield Feature(name, group, meaning or usual, cast(Kind, kind), label, high, low)


def _whole() -> Iterator[Feature]:
    yield from _features(WHOLE)
    for one in QUANTILES:
        part = "low" if one < 25 else "high" if one > 75 else "middle"
        yield from _features(QUANTILE, one=one, part=part)
    for one in range(BANDS):
        yield from _features(SPECTRUM, one=one)


def _start() -> Iterator[Feature]:
    """Of the first loading and the first slip of a run."""
    yield from _features(START)
    for one in LAGS:
        yield from _features(SOFTENING, one=one)
    yield from _features(FIRST_SLIP)
    for at in WAVEFORM:
        yield from _features(FIRST_WAVEFORM, one=at)


def _slips() -> Iterator[Feature]:
    """Of slips, from one to the next, and of their shape."""
    for name, kind, label, high, low, meaning in rows_of_text(SLIPS):
        for part in ("mean", "median"):
            text = f"{part} of the {meaning}"
            yield Feature(f"{part}_{name}", "slips", text, cast(Kind, kind), label, high, low)
        is_force = kind == "force"
        yield Feature(
            f"spread_{name}",
            "slips",
            f"logarithm of the spread of the {meaning}",
            "log force" if is_force else "log ratio",
            f"standard deviation of the {label}{'' if is_force else ' (relative)'}",
            "slips are too irregular",
            "slips are too regular",
        )
    yield from _features(BETWEEN_SLIPS)
    for at in WAVEFORM:
        yield from _features(SHAPE, one=at)


def _loading() -> Iterator[Feature]:
    """Of the loading between slips."""
    yield from _features(LOADING)
    for one in CREEP_LAGS:
        yield from _features(CREEP, one=one, percent=100 * one)
