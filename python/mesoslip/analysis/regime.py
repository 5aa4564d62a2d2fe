"""Which motion an output shows: smooth sliding, stick-slip, irregular, or not settled yet.

It is judged by the spring force in the second half of the last stage of the drive that moves: the
first half is taken as the way to it. All rules and their thresholds are here; ``docs/regimes.md``
explains them, and says what they were checked with.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.output.access import config_of, group_of
from mesoslip.output.inputs import OutputLike, opened_run
from mesoslip.output.results import RunResults
from mesoslip.output.variables import Group, Meaning
from mesoslip.quantities import percent
from mesoslip.simulation.tables import SLIP_COLUMNS, TRACE_COLUMNS

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

SMOOTH, STICK_SLIP, IRREGULAR, TRANSIENT = range(4)
NAMES = ("smooth", "stick_slip", "irregular", "transient")

# Amplitude of smooth sliding: part of the mean force, and part of the static force times N^(-1/2),
# which is the noise of N contacts that slide steadily, 0.6 N^(-1/2), and a margin.
SMOOTH_AMPLITUDE = 0.02
NOISE_AMPLITUDE = 0.8
# Percentiles of the force that its amplitude is half the distance of.
LOW, HIGH = 5.0, 95.0
# A mean force below this part of the static one is no scale of amplitudes.
LEAST_MEAN = 0.05
# The force has turned when it has gone back by this part of the distance of the percentiles; how
# far it goes beyond them, as in the rebound of a slip, counts up to this part of it.
TURNING = 0.5
BEYOND = 0.1
# Fewer cycles than these do not show a regime, and fewer than those no trend.
LEAST_CYCLES = 3
LEAST_TREND_CYCLES = 6
# Variation of periods, and of the falls of the force in a cycle, from which motion is irregular.
IRREGULAR_PERIODS = 0.3
IRREGULAR_FALLS = 0.35
# Variations below which an oscillation as small as the noise is none of it.
REGULAR_PERIODS = 0.15
REGULAR_FALLS = 0.2
# Cycles that may make up a pattern that repeats itself, and how often it must to be seen.
LONGEST_PATTERN = 3
LEAST_PATTERNS = 4
# Motion is not settled if its amplitude changes by more than this part of it, beyond doubt:
# by as many standard errors; or if one half of what is judged is smooth and the other one exceeds
# the amplitude of smooth sliding by this factor.
SETTLED_CHANGE = 0.4
DOUBT = 4.0
BEYOND_SMOOTH = 1.5
# Velocity over that of the drive below which the slider is said to stick: pinned it still moves
# with K/(K + Nk) of the drive's.
STICKING = 0.5
# Samples of a trace that are looked at; longer traces are thinned out.
MOST_SAMPLES = 400_000

REGIME = Group(
    regime=Meaning(
        "1",
        "regime of the motion",
        np.int8,
        further={"flag_meanings": " ".join(NAMES)},
    ),
    relative_amplitude=Meaning(
        "1", "half the distance of the 5th and 95th percentiles of the spring force over its mean"
    ),
    smooth_amplitude=Meaning("1", "the largest one of smooth sliding with so many contacts"),
    cycles=Meaning("1", "cycles of the spring force", np.int64),
    period=Meaning("s", "mean period of the cycles"),
    period_variation=Meaning("1", "coefficient of variation of the periods"),
    period_irregularity=Meaning(
        "1", "the same, or of patterns of 2 or 3 cycles, whichever is least"
    ),
    fall_variation=Meaning("1", "coefficient of variation of the falls of the force in a cycle"),
    fall_irregularity=Meaning("1", "the same, or of patterns of 2 or 3 cycles, whichever is least"),
    peak_spread=Meaning(
        "1", "standard deviation of the peaks of the force over the distance of its percentiles"
    ),
    peak_correlation=Meaning("1", "correlation of each peak with the next one (the return map)"),
    amplitude_change=Meaning("1", "change of the falls in what is judged over their mean"),
    amplitude_change_error=Meaning("1", "standard error of that change"),
    drift=Meaning("1", "change of the mean force from one half of what is judged to the other"),
    fast_share=Meaning("1", "share of the time in which the slider is faster than the drive"),
    stick_share=Meaning(
        "1", "share of the time in which the slider has less than half the drive's velocity"
    ),
    slips=Meaning("1", "slips in what is judged", np.int64),
    judged_start=Meaning("s", "start of what is judged"),
    judged_end=Meaning("s", "end of what is judged"),
)


@dataclass(frozen=True)
class Judgement:
    """The regime of a realization, and the numbers by which it was judged, as in `REGIME`."""

    regime: int = TRANSIENT
    relative_amplitude: float = math.nan
    smooth_amplitude: float = math.nan
    cycles: int = 0
    period: float = math.nan
    period_variation: float = math.nan
    period_irregularity: float = math.nan
    fall_variation: float = math.nan
    fall_irregularity: float = math.nan
    peak_spread: float = math.nan
    peak_correlation: float = math.nan
    amplitude_change: float = math.nan
    amplitude_change_error: float = math.nan
    drift: float = math.nan
    fast_share: float = math.nan
    stick_share: float = math.nan
    slips: int = 0
    judged_start: float = math.nan
    judged_end: float = math.nan

    @property
    def told(self) -> str:
        """The regime in words, with what tells most."""
        name = NAMES[self.regime].replace("_", "-")
        if not math.isfinite(self.relative_amplitude):
            return f"{name}: the run is too short to say"
        told = f"{name}: force amplitude {percent(self.relative_amplitude)} of the mean"
        if self.regime == SMOOTH:
            return told
        if self.cycles < LEAST_CYCLES:
            return (
                f"{told}; it has {self.cycles} whole cycles in the {self.judged_end:.4g} s of the "
                f"run and needs {LEAST_CYCLES} after the start has died away: give it longer"
            )
        told += f", {self.cycles} cycles of {self.period:.3g} s"
        return f"{told} varying by {percent(self.period_variation)}"


@dataclass(frozen=True)
class _Stage:
    """The last stage of the drive that moves: when it is, and at which velocity."""

    start: float
    end: float
    velocity: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2

    @property
    def direction(self) -> float:
        return math.copysign(1.0, self.velocity)


def regimes(tree: xr.DataTree, name: str = "the output") -> xr.Dataset:
    """The regime of each realization of an output, and the numbers by which it is judged.

    Parameters
    ----------
    tree
        Output of a run, or a measured trace with the configuration of the experiment.
    name
        What to call it in messages.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``, variables `REGIME`: ``regime`` is 0 smooth, 1 stick-slip, 2
        irregular, 3 transient, with CF's flag attributes.

    Raises
    ------
    FileError
        If it has no configuration of a run.
    """
    import xarray as xr

    root, slips = tree.to_dataset(), group_of(tree, "slips")
    config = config_of(tree, name)
    time = root["time"].values
    owner = slips["realization_index"].values
    starts, drops = slips["start_time"].values, slips["force_drop"].values
    judged = []
    for place in range(root.sizes["realization"]):
        one = root.isel(realization=place)
        # What an interrupted run did not come to is missing.
        reached = int(np.sum(np.isfinite(one["spring_force"].values)))
        stage = _stage(config, float(time[reached - 1]) if reached else 0.0)
        first = int(np.searchsorted(time[:reached], stage.middle))
        last = int(np.searchsorted(time[:reached], stage.end, side="right"))
        inside = slice(first, last, _step(last - first))
        mine = owner == place
        judged.append(
            judge(
                config,
                time[inside],
                one["spring_force"][inside].values,
                one["velocity"][inside].values,
                starts[mine],
                drops[mine],
            )
        )
    variables = {
        name: REGIME.variable(
            name,
            ("realization",),
            np.array([getattr(one, name) for one in judged], dtype=meaning.dtype),
        )
        for name, meaning in REGIME.items()
    }
    variables["regime"].attrs["flag_values"] = np.arange(len(NAMES), dtype=np.int8)
    return xr.Dataset(variables, {"realization": root["realization"]})


def regime(output: OutputLike) -> xr.Dataset:
    """The regime of each realization of an output: smooth, stick-slip, irregular, or transient.

    Parameters
    ----------
    output
        Output of a run, or a measured trace with the configuration of the experiment.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``; ``regime`` is 0 smooth, 1 stick-slip, 2 irregular, 3 transient,
        beside the numbers that decide it.

    Raises
    ------
    FileError
        If the output cannot be read, or has no configuration of a run.
    """
    with opened_run(output) as (tree, name):
        return regimes(tree, name)


def regimes_of_results(results: RunResults) -> Iterator[Judgement]:
    """The regimes of the realizations of a run, of which only what is judged is held in memory."""
    place = {name: number for number, name in enumerate(TRACE_COLUMNS)}
    wanted = [place[name] for name in ("time", "spring_force", "velocity")]
    slip_place = {name: number for number, name in enumerate(SLIP_COLUMNS)}
    for one in results.realizations:
        rows = one.rows("trace")
        stage = _stage(results.config, one.time)
        step = _step(len(rows))
        blocks, start = [np.empty((0, len(wanted)))], 0
        for block in rows.blocks(MOST_SAMPLES):
            chosen = block[-start % step :: step][:, wanted]
            inside = (chosen[:, 0] >= stage.middle) & (chosen[:, 0] <= stage.end)
            blocks.append(chosen[inside])
            start += len(block)
        time, force, velocity = np.concatenate(blocks).T
        slips = np.concatenate(
            [np.empty((0, len(SLIP_COLUMNS))), *one.rows("slips").blocks(MOST_SAMPLES)]
        )
        drops = slips[:, slip_place["force_before"]] - slips[:, slip_place["force_after"]]
        yield judge(
            results.config, time, force, velocity, slips[:, slip_place["start_time"]], drops
        )


def judgements(data: xr.Dataset) -> list[Judgement]:
    """The rows of what `regimes` gives."""
    columns = {name: data[name].values.tolist() for name in REGIME}
    return [
        Judgement(**dict(zip(columns, row, strict=True)))
        for row in zip(*columns.values(), strict=True)
    ]


def told(judged: list[Judgement]) -> str:
    """The regimes of all realizations on a line."""
    if len(judged) == 1:
        return judged[0].told
    counts = Counter(one.regime for one in judged)
    return ", ".join(f"{counts[one]} {NAMES[one].replace('_', '-')}" for one in sorted(counts))


def judge(
    config: Config, time: Array, force: Array, velocity: Array, starts: Array, drops: Array
) -> Judgement:
    """The regime of a motion.

    Parameters
    ----------
    config
        What was run.
    time, force, velocity
        What is judged of a trace: time [s], spring force [N], velocity of the slider [m/s].
    starts, drops
        Of the slips of the realization, when they start [s] and the drops of the force [N].
    """
    if len(time) < 2 * LEAST_CYCLES:
        return Judgement()
    stage = _stage(config, float(time[-1]))
    force, velocity = stage.direction * force, stage.direction * velocity
    static = config.contacts.static_force
    is_inside = (starts >= time[0]) & (starts <= time[-1])
    starts, drops = starts[is_inside], np.abs(drops[is_inside])
    mean = float(np.mean(force))
    scale = max(abs(mean), LEAST_MEAN * static)
    smooth = SMOOTH_AMPLITUDE * scale
    if config.contact_kind.is_discrete:
        smooth += NOISE_AMPLITUDE * static / math.sqrt(config.contacts.count)
    low, high = np.percentile(force, [LOW, HIGH])
    amplitude = float(high - low) / 2
    half = len(force) // 2
    halves = [_amplitude(force[:half]), _amplitude(force[half:])]
    beyond = BEYOND * (high - low)
    cycles = _cycles(
        time, force, np.clip(force, low - beyond, high + beyond), TURNING * (high - low)
    )
    is_large = drops >= TURNING * (high - low)
    slips = _Cycles(np.diff(starts[is_large]), drops[is_large], cycles.peaks)
    # The catalogue of slips takes a slip and its rebounds together, and has no swinging without
    # slips; a trace with few samples may miss what it has. Who finds the more regular motion sees
    # it rightly, unless that is by leaving out most of it.
    has_most = len(slips.periods) >= max(LEAST_CYCLES, len(cycles.periods) / LONGEST_PATTERN)
    if has_most and not _irregularity(slips.periods) >= _irregularity(cycles.periods):
        cycles = slips
    change, error = _trend(cycles.falls)
    moved = abs(stage.velocity) * (time[-1] - time[0])
    numbers = {
        "relative_amplitude": amplitude / scale,
        "smooth_amplitude": smooth / scale,
        "cycles": len(cycles.periods),
        "period": _defined(np.mean, cycles.periods),
        "period_variation": _variation(cycles.periods),
        "period_irregularity": _irregularity(cycles.periods),
        "fall_variation": _variation(cycles.falls),
        "fall_irregularity": _irregularity(cycles.falls),
        "peak_spread": _defined(np.std, cycles.peaks, 2) / (2 * amplitude or math.nan),
        "peak_correlation": _correlation(cycles.peaks),
        "amplitude_change": change,
        "amplitude_change_error": error,
        "drift": float(np.mean(force[half:]) - np.mean(force[:half])) / scale,
        "fast_share": float(np.mean(velocity > abs(stage.velocity))),
        "stick_share": float(np.mean(velocity < STICKING * abs(stage.velocity))),
        "slips": len(starts),
        "judged_start": float(time[0]),
        "judged_end": float(time[-1]),
    }
    if config.drive.force_rate is not None:
        # There is no drive to be faster than.
        numbers |= {"fast_share": math.nan, "stick_share": math.nan}
        moved = math.inf
    is_renewed = moved >= config.contacts.break_stretch
    judged = Judgement(**numbers)  # type: ignore[arg-type]
    regime = _regime(judged, [one / scale for one in halves], is_renewed=is_renewed)
    # A slider that goes where the drive goes neither sticks nor slips.
    if math.isinf(config.spring_stiffness) and regime in {STICK_SLIP, IRREGULAR}:
        regime = SMOOTH
    values = {one.name: getattr(judged, one.name) for one in fields(judged)}
    return Judgement(**{**values, "regime": regime})


def _regime(judged: Judgement, halves: list[float], *, is_renewed: bool) -> int:
    """The rules: which regime the numbers are of; ``halves`` are amplitudes over the mean."""
    smooth = judged.smooth_amplitude
    if min(halves) <= smooth and max(halves) > BEYOND_SMOOTH * smooth:
        return TRANSIENT
    is_regular = (
        judged.cycles >= LEAST_CYCLES
        and judged.period_irregularity < REGULAR_PERIODS
        and judged.fall_irregularity < REGULAR_FALLS
    )
    if judged.relative_amplitude <= (SMOOTH_AMPLITUDE if is_regular else smooth):
        return SMOOTH if is_renewed else TRANSIENT
    if judged.cycles < LEAST_CYCLES:
        return TRANSIENT
    is_certain = abs(judged.amplitude_change) > DOUBT * judged.amplitude_change_error
    if is_certain and abs(judged.amplitude_change) > SETTLED_CHANGE:
        return TRANSIENT
    if judged.period_irregularity > IRREGULAR_PERIODS or judged.fall_irregularity > IRREGULAR_FALLS:
        return IRREGULAR
    return STICK_SLIP


def _stage(config: Config, reached: float) -> _Stage:
    """The last stage that moves, of those that a run came to."""
    begin, found = 0.0, _Stage(0.0, reached, 0.0)
    for part in config.drive_parts:
        if begin >= reached:
            break
        end = min(begin + part.duration, reached)
        velocity = part.end_velocity or part.start_velocity
        if velocity != 0:
            found = _Stage(begin, end, velocity)
        begin = end
    return found


def _step(count: int) -> int:
    return max(1, -(-count // MOST_SAMPLES))


def _amplitude(force: Array) -> float:
    low, high = np.percentile(force, [LOW, HIGH])
    return float(high - low) / 2


@dataclass(frozen=True)
class _Cycles:
    """Cycles of the force: their periods [s], falls after their peaks [N], and peaks [N]."""

    periods: Array
    falls: Array
    peaks: Array


def _cycles(time: Array, force: Array, clipped: Array, turning: float) -> _Cycles:
    """Cycles of a force, which has turned when it has gone back by a height, as it is clipped."""
    # Only where the force turns at all can it turn by so much.
    rises = np.diff(force) > 0
    extremes = np.flatnonzero(rises[1:] != rises[:-1]) + 1
    peaks: list[int] = []
    lows: list[int] = []
    best, is_rising = 0, None
    values = clipped.tolist()
    highest = lowest = 0
    for place in [*extremes.tolist(), len(values) - 1]:
        value = values[place]
        if is_rising is None:
            highest = place if value > values[highest] else highest
            lowest = place if value < values[lowest] else lowest
            if values[highest] - values[lowest] > turning:
                is_rising, best = highest > lowest, place
        elif is_rising:
            if value >= values[best]:
                best = place
            elif value < values[best] - turning:
                peaks.append(best)
                is_rising, best = False, place
        elif value <= values[best]:
            best = place
        elif value > values[best] + turning:
            # A low before the first peak is the end of a cycle that is not seen.
            if peaks:
                lows.append(best)
            is_rising, best = True, place
    count = min(len(peaks), len(lows))
    falls: Array = clipped[peaks[:count]] - clipped[lows[:count]]
    return _Cycles(np.diff(time[peaks]), falls, force[peaks])


def _defined(function: Callable[[Array], np.floating], values: Array, least: int = 1) -> float:
    return float(function(values)) if len(values) >= least else math.nan


def _variation(values: Array) -> float:
    """Coefficient of variation; NaN of fewer than two."""
    return _defined(np.std, values, 2) / _defined(np.mean, values, 2)


def _irregularity(values: Array) -> float:
    """Coefficient of variation, or of sums of successive values, whichever is least.

    Sums of m independent values vary by m^(1/2) times as much as one of them, and are measured by
    that: so what alternates is regular, and what is random is no more so in sums.
    """
    mean = _defined(np.mean, values, 2)
    found = [_variation(values)]
    for length in range(2, LONGEST_PATTERN + 1):
        sums = np.convolve(values, np.ones(length), "valid") if len(values) else values
        if len(values) >= LEAST_PATTERNS * length:
            found.append(float(np.std(sums)) / (math.sqrt(length) * mean))
    return min(found)


def _correlation(values: Array) -> float:
    """Correlation of each value with the next one; NaN if they are too few, or do not vary."""
    before, after = values[:-1], values[1:]
    if len(before) < LEAST_CYCLES or np.std(before) == 0 or np.std(after) == 0:
        return math.nan
    return float(np.corrcoef(before, after)[0, 1])


def _trend(values: Array) -> tuple[float, float]:
    """Change of values from their first to their last over their mean, and its standard error."""
    count = len(values)
    if count < LEAST_TREND_CYCLES:
        return math.nan, math.nan
    place = np.linspace(-0.5, 0.5, count)
    mean = float(np.mean(values))
    change = float(place @ values / (place @ place))
    rest = values - mean - change * place
    error = math.sqrt(float(rest @ rest) / ((count - 2) * float(place @ place)))
    return change / mean, error / mean
