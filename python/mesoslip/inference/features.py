"""The summaries of a trace: their names, groups, units, and words for a disagreement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

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


def _feature(name: str, group: str, kind: Kind, label: str, high: str, low: str) -> Feature:
    """A summary that is a quantity or its logarithm."""
    meaning = f"logarithm of the {label}" if kind.startswith("log") else label
    return Feature(name, group, meaning, kind, label, high, low)


def features(scale: float, *, has_start: bool) -> Iterator[Feature]:
    """The summaries of a trace in their order, with the unit of forces [N]; ``has_start`` if it
    begins with the first loading of a run."""
    for one in (*_whole(), *(_start() if has_start else ()), *_slips(), *_loading()):
        scaled = one.kind in {"force", "log force", "log rate", "log power"}
        yield replace(one, factor=scale) if scaled else one


def _whole() -> Iterator[Feature]:
    yield _feature(
        "slip_count",
        "slips",
        "log count",
        "number of slips",
        "slips are too frequent",
        "slips are too rare",
    )
    yield Feature(
        "mean_force",
        "force",
        "mean force after the first slip",
        "force",
        "mean force",
        "the mean force is too high",
        "the mean force is too low",
    )
    yield _feature(
        "force_deviation",
        "force",
        "log force",
        "standard deviation of the force",
        "the force varies too much",
        "the force varies too little",
    )
    for one in QUANTILES:
        yield _feature(
            f"force_quantile_{one}",
            "force",
            "force",
            f"{one} % quantile of the force",
            _level(one, "high"),
            _level(one, "low"),
        )
    for one in range(BANDS):
        yield Feature(
            f"spectrum_{one}",
            "ringing",
            f"logarithm of the power in band {one}",
            "log power",
        )


def _level(percent: int, direction: str) -> str:
    """The sentence for a quantile of the force."""
    part = "low" if percent < 25 else "high" if percent > 75 else "middle"
    return f"the {part} forces are too {direction}"


def _start() -> Iterator[Feature]:
    yield Feature(
        "loading_slope",
        "first loading",
        "logarithm of the slope of the loading",
        "log rate",
        "slope of the first loading",
        "the first loading is too steep",
        "the first loading is too slow",
    )
    yield Feature(
        "loading_start",
        "first loading",
        "force at which the loading starts",
        "force",
        "first force",
    )
    yield _feature(
        "first_peak",
        "first peak",
        "force",
        "force at the first peak",
        "the first peak is too high",
        "the first peak is too low",
    )
    yield _feature(
        "first_peak_time",
        "first peak",
        "log time",
        "time of the first peak",
        "the first peak is too late",
        "the first peak is too early",
    )
    for one in LAGS:
        yield Feature(
            f"softening_{one:g}",
            "first peak",
            "force relative to linear loading",
            "ratio",
            "force above linear loading, over the peak",
            "the force rises too straight to the first peak",
            "the force bends too early before the first peak",
        )
    yield _feature(
        "first_drop",
        "first slip",
        "log force",
        "first force drop",
        "the first slip is too deep",
        "the first slip is too shallow",
    )
    yield _feature(
        "first_rate",
        "first slip",
        "log rate",
        "maximum rate of the first slip",
        "the first slip is too fast",
        "the first slip is too slow",
    )
    for at in WAVEFORM:
        yield Feature(
            f"first_waveform_{at:+.2f}",
            "first slip",
            "force along the first slip",
            "force",
            "force along the first slip",
        )


# Quantities of slips: name, meaning, kind, label, and sentences of the mean.
SLIPS: tuple[tuple[str, str, Kind, str, str, str], ...] = (
    (
        "peak",
        "force at the start of slips",
        "force",
        "force at the start of slips",
        "slips start at too high a force",
        "slips start at too low a force",
    ),
    (
        "bottom",
        "force at the end of slips",
        "force",
        "force at the end of slips",
        "slips end at too high a force",
        "slips end at too low a force",
    ),
    (
        "drop",
        "logarithm of force drops",
        "log force",
        "force drop",
        "slips are too deep",
        "slips are too shallow",
    ),
    (
        "duration",
        "logarithm of durations",
        "log time",
        "duration of slips",
        "slips take too long",
        "slips are too short",
    ),
    (
        "rate",
        "logarithm of the maximum rate of fall",
        "log rate",
        "maximum rate of fall",
        "slips are too fast",
        "slips are too slow",
    ),
    (
        "waiting_time",
        "logarithm of waiting times",
        "log time",
        "waiting time",
        "slips are too rare",
        "slips are too frequent",
    ),
)


def _slips() -> Iterator[Feature]:
    for name, meaning, kind, label, high, low in SLIPS:
        for part in ("mean", "median"):
            yield Feature(
                f"{part}_{name}", "slips", f"{part} of the {meaning}", kind, label, high, low
            )
        spread: Kind = "log force" if kind == "force" else "log ratio"
        relative = "" if kind == "force" else " (relative)"
        yield Feature(
            f"spread_{name}",
            "slips",
            f"logarithm of the spread of the {meaning}",
            spread,
            f"standard deviation of the {label}{relative}",
            "slips are too irregular",
            "slips are too regular",
        )
    yield Feature(
        "wander",
        "slips",
        "logarithm of the spread of the force at the start of slips over that from slip to slip",
        "log ratio",
        "variation of the force at the start of slips over that from slip to slip",
        "the force at the start of slips wanders too much",
        "the force at the start of slips wanders too little",
    )
    yield _feature(
        "return_map",
        "slips",
        "ratio",
        "correlation of each force drop with the next",
        "each slip resembles the next too much",
        "deep and shallow slips alternate too much",
    )
    for at in WAVEFORM:
        yield _feature(
            f"waveform_{at:+.2f}",
            "shape of slips",
            "force",
            "mean force along slips",
            "the force along slips is too high",
            "the force along slips is too low",
        )


def _loading() -> Iterator[Feature]:
    yield _feature(
        "stick_slope",
        "loading between slips",
        "log rate",
        "slope of the loading between slips",
        "the loading between slips is too steep",
        "the loading between slips is too slow",
    )
    for one in CREEP_LAGS:
        yield Feature(
            f"creep_{one:g}",
            "loading between slips",
            f"force at {one:g} of the time between slips, below linear loading, over the drop",
            "ratio",
            f"force below linear loading at {100 * one:.0f} % of the time between slips, over the "
            "drop",
            "the block creeps too much before slips",
            "creep before slips is missing",
        )
