"""The regime of motion in an output: smooth, stick-slip, irregular or transient.

It is determined from the spring force in the evaluated window: the second half of the last stage in
which the drive moves; the first half counts as transient. All rules and thresholds are here;
``docs/regimes.md`` explains them and reports their validation.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import Apparatus, apparatus_of
from mesoslip.analysis.cycles import (
    MAX_PATTERN,
    MIN_CYCLES,
    Cycles,
    correlation,
    defined,
    find_cycles,
    irregularity,
    trend,
    variation,
)
from mesoslip.analysis.even_traces import INTERVAL_TOLERANCE
from mesoslip.analysis.noise import noise_level, without_impulses
from mesoslip.configuration.config import Config
from mesoslip.output.access import group_of
from mesoslip.output.inputs import OutputLike, opened_run
from mesoslip.output.results import RunResults
from mesoslip.output.variables import Group, Meaning
from mesoslip.quantities import percent, with_unit
from mesoslip.simulation.tables import SLIP_COLUMNS, TRACE_COLUMNS

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

SMOOTH, STICK_SLIP, IRREGULAR, TRANSIENT = range(4)
NAMES = ("smooth", "stick_slip", "irregular", "transient")

# Maximum amplitude of smooth sliding: a fraction of the mean force, plus a multiple of the static
# force times N^(-1/2), the noise of N contacts in steady sliding (0.6 N^(-1/2)) with a margin.
SMOOTH_AMPLITUDE = 0.02
NOISE_AMPLITUDE = 0.8
# The same for the noise of a measured trace, over its standard deviation: the percentiles of normal
# noise lie at 1.64 of it.
MEASURED_NOISE_AMPLITUDE = 2.2
# Percentiles of the force; the amplitude is half their distance.
LOW, HIGH = 5.0, 95.0
# Minimum mean force that amplitudes are divided by, over the static force.
MIN_MEAN = 0.05
# Reversal of the force that ends a cycle, over the distance of the percentiles, and the maximum
# excursion beyond the percentiles that counts, such as the rebound of a slip.
TURNING = 0.5
MAX_EXCURSION = 0.1
# Maximum variation of periods, and of the falls of the force in a cycle, of stick-slip.
IRREGULAR_PERIODS = 0.3
IRREGULAR_FALLS = 0.35
# Maximum variations of an oscillation that is not noise, though as small.
REGULAR_PERIODS = 0.15
REGULAR_FALLS = 0.2
# A motion is transient if its amplitude changes by more than this fraction, and by as many standard
# errors; or if one half of the window is smooth and the amplitude of the other exceeds the limit of
# smooth sliding by this factor.
MAX_CHANGE = 0.4
SIGNIFICANCE = 4.0
SMOOTH_FACTOR = 1.5
# Maximum velocity of a sticking slider over that of the drive: pinned contacts let it move at
# K/(K + Nk) of the drive's velocity.
STICKING = 0.5
# Maximum number of evaluated samples; longer traces are thinned out.
MAX_SAMPLES = 400_000

REGIME = Group(
    regime=Meaning(
        "1",
        "regime of the motion",
        np.int8,
        further={"flag_meanings": " ".join(NAMES)},
    ),
    relative_amplitude=Meaning(
        "1", "half the distance of the 5th and 95th percentiles of the spring force, over its mean"
    ),
    smooth_amplitude=Meaning("1", "upper limit for smooth sliding with N contacts"),
    cycles=Meaning("1", "cycles of the spring force", np.int64),
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
    peak_correlation=Meaning("1", "correlation of each peak with the next one (the return map)"),
    amplitude_change=Meaning("1", "change of the falls over the evaluated window, over their mean"),
    amplitude_change_error=Meaning("1", "standard error of the amplitude change"),
    drift=Meaning(
        "1", "change of the mean force between the halves of the evaluated window, over the mean"
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
    window_start: float = math.nan
    window_end: float = math.nan

    @property
    def summary(self) -> str:
        """The regime in words, with the main statistics."""
        name = NAMES[self.regime].replace("_", "-")
        if not math.isfinite(self.relative_amplitude):
            return f"{name}: too few samples to determine a regime"
        text = f"{name}: force amplitude {percent(self.relative_amplitude)} of the mean"
        if self.regime == SMOOTH:
            return text
        if self.cycles < MIN_CYCLES:
            return (
                f"{text}; {self.cycles} whole cycles between {with_unit(self.window_start, 's')} "
                f"and {with_unit(self.window_end, 's')}, at least {MIN_CYCLES} are needed: give a "
                "longer duration"
            )
        text += f", {self.cycles} cycles of {with_unit(self.period, 's', 3)}"
        return f"{text} varying by {percent(self.period_variation)}"


@dataclass(frozen=True)
class _Stage:
    """The last stage in which the drive moves: its times [s] and velocity [m/s]."""

    start: float
    end: float
    velocity: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2

    @property
    def direction(self) -> float:
        return -1.0 if self.velocity < 0 else 1.0


@dataclass(frozen=True)
class Scales:
    """What a motion is compared with.

    Attributes
    ----------
    stage
        The evaluated stage of the drive.
    static_force
        Static force, in the unit of the force.
    noise_amplitude
        Amplitude that noise gives to smooth sliding, in the unit of the force.
    renewal_displacement
        Displacement of the drive in which all contacts break [m]; 0 if unknown.
    is_rigid
        Whether the slider moves as the drive, so that it neither sticks nor slips.
    has_velocity
        Whether the drive has a velocity with which that of the slider can be compared.
    is_measured
        Whether noise and drift may hide cycles and velocities: then slips are the cycles.
    """

    stage: _Stage
    static_force: float
    noise_amplitude: float
    renewal_displacement: float
    is_rigid: bool
    has_velocity: bool
    is_measured: bool = False

    @classmethod
    def of_config(cls, config: Config, reached: float) -> Scales:
        """Those of a configuration.

        Parameters
        ----------
        config
            The configuration.
        reached
            Time that the run reached [s].
        """
        static = config.contacts.static_force
        noise = 0.0
        if config.contact_kind.is_discrete:
            noise = NOISE_AMPLITUDE * static / math.sqrt(config.contacts.count)
        return cls(
            _stage(config, reached),
            static,
            noise,
            config.contacts.break_stretch,
            math.isinf(config.spring_stiffness),
            config.drive.force_rate is None,
        )

    @classmethod
    def of_measurement(
        cls, apparatus: Apparatus, stage: _Stage, force: Array, noise: float
    ) -> Scales:
        """Those of a measured trace without a configuration.

        The static force is the maximum of the force; which displacement renews the contacts is
        unknown.

        Parameters
        ----------
        apparatus
            The apparatus.
        stage
            The evaluated stage.
        force
            The evaluated force.
        noise
            Standard deviation of the noise of the force.
        """
        return cls(
            stage,
            float(np.max(np.abs(force), initial=0.0)),
            MEASURED_NOISE_AMPLITUDE * noise,
            0.0,
            math.isinf(apparatus.stiffness),
            math.isfinite(stage.velocity),
            is_measured=True,
        )


def regimes(tree: xr.DataTree, name: str = "the output") -> xr.Dataset:
    """The regime of each realization of an output, and the statistics that determine it.

    Parameters
    ----------
    tree
        Output of a run, or a measured trace.
    name
        Name in messages.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``, variables `REGIME`: ``regime`` is 0 smooth, 1 stick-slip, 2
        irregular, 3 transient, with CF's flag attributes.

    Raises
    ------
    FileError
        If it has no force, or it is a run without its configuration.
    """
    import xarray as xr

    root = tree.to_dataset()
    apparatus = apparatus_of(tree, name)
    owner, starts, drops = _slips(tree)
    results = []
    for number in range(root.sizes["realization"]):
        mine = owner == number
        window = _window(root.isel(realization=number), apparatus, tree)
        results.append(classify(*window, starts[mine], drops[mine]))
    variables = {
        name: REGIME.variable(
            name,
            ("realization",),
            np.array([getattr(one, name) for one in results], dtype=meaning.dtype),
        )
        for name, meaning in REGIME.items()
    }
    variables["regime"].attrs["flag_values"] = np.arange(len(NAMES), dtype=np.int8)
    return xr.Dataset(variables, {"realization": root["realization"]})


def _slips(tree: xr.DataTree) -> tuple[Array, Array, Array]:
    """Realization, start [s] and force drop of each slip; none without a catalogue."""
    if "slips" not in tree.children:
        return np.empty(0), np.empty(0), np.empty(0)
    data = group_of(tree, "slips")
    return (
        data["realization_index"].values,
        data["start_time"].values,
        data["force_drop"].values,
    )


def _window(
    one: xr.Dataset, apparatus: Apparatus, tree: xr.DataTree
) -> tuple[Scales, Array, Array, Array]:
    """What a realization is compared with; time, force and velocity in its evaluated window."""
    time, force = one["time"].values, one[apparatus.force_name].values
    # Samples after the end of an interrupted run are missing.
    reached = int(np.sum(np.isfinite(force)))
    last_time = float(time[reached - 1]) if reached else 0.0
    config = apparatus.config
    stage = _stage(config, last_time) if config else _measured_stage(tree, apparatus, last_time)
    first = int(np.searchsorted(time[:reached], stage.middle))
    last = int(np.searchsorted(time[:reached], stage.end, side="right"))
    inside = slice(first, last, _step(last - first))
    velocity = np.full(len(time[inside]), np.nan)
    if "velocity" in one:
        velocity = one["velocity"][inside].values
    time, force = time[inside], force[inside]
    if config is not None:
        return Scales.of_config(config, last_time), time, force, velocity
    if "noise" in tree.children:
        impulses = group_of(tree, "noise")["impulse_time"].values
        force = without_impulses(time, force, impulses)
    time, force, velocity = _even(time, force, velocity)
    scales = Scales.of_measurement(apparatus, stage, force, noise_level(force))
    return scales, time, force, velocity


def _even(time: Array, *values: Array) -> tuple[Array, ...]:
    """Times and values at equal intervals: several sampling rates would weight the statistics."""
    if len(time) < 2 * MIN_CYCLES:
        return time, *values
    steps = np.diff(time)
    count = min(MAX_SAMPLES, 1 + round((time[-1] - time[0]) / float(np.median(steps))))
    if np.ptp(steps) <= INTERVAL_TOLERANCE * steps.max():
        return time, *values
    even = np.linspace(time[0], time[-1], count)
    return even, *(np.interp(even, time, one) for one in values)


def regime(output: OutputLike) -> xr.Dataset:
    """The regime of each realization of an output: smooth, stick-slip, irregular, or transient.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``; ``regime`` is 0 smooth, 1 stick-slip, 2 irregular, 3 transient.
        The other variables are the statistics that determine it.

    Raises
    ------
    FileError
        If the output cannot be read, or is neither of a run nor a measured trace.
    """
    with opened_run(output) as (tree, name):
        return regimes(tree, name)


def regimes_of_results(results: RunResults) -> Iterator[RegimeResult]:
    """The regimes of the realizations of a run; only the evaluated samples are held in memory."""
    index = {name: number for number, name in enumerate(TRACE_COLUMNS)}
    wanted = [index[name] for name in ("time", "spring_force", "velocity")]
    slip_index = {name: number for number, name in enumerate(SLIP_COLUMNS)}
    for one in results.realizations:
        rows = one.rows("trace")
        scales = Scales.of_config(results.config, one.time)
        stage = scales.stage
        step = _step(len(rows))
        blocks, start = [np.empty((0, len(wanted)))], 0
        for block in rows.blocks(MAX_SAMPLES):
            chosen = block[-start % step :: step][:, wanted]
            inside = (chosen[:, 0] >= stage.middle) & (chosen[:, 0] <= stage.end)
            blocks.append(chosen[inside])
            start += len(block)
        time, force, velocity = np.concatenate(blocks).T
        slips = np.concatenate(
            [np.empty((0, len(SLIP_COLUMNS))), *one.rows("slips").blocks(MAX_SAMPLES)]
        )
        drops = slips[:, slip_index["force_before"]] - slips[:, slip_index["force_after"]]
        yield classify(scales, time, force, velocity, slips[:, slip_index["start_time"]], drops)


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
    return ", ".join(f"{counts[one]} {NAMES[one].replace('_', '-')}" for one in sorted(counts))


def classify(
    scales: Scales, time: Array, force: Array, velocity: Array, starts: Array, drops: Array
) -> RegimeResult:
    """The regime of a motion.

    Parameters
    ----------
    scales
        What it is compared with.
    time, force, velocity
        The evaluated window of the trace: time [s], force, velocity of the slider [m/s], NaN if it
        is unknown.
    starts, drops
        Starts [s] of the slips of the realization, and their force drops.
    """
    if len(time) < 2 * MIN_CYCLES:
        return RegimeResult()
    stage = scales.stage
    force, velocity = stage.direction * force, stage.direction * velocity
    is_inside = (starts >= time[0]) & (starts <= time[-1])
    starts, drops = starts[is_inside], np.abs(drops[is_inside])
    mean = float(np.mean(force))
    scale = max(abs(mean), MIN_MEAN * scales.static_force)
    smooth = SMOOTH_AMPLITUDE * scale + scales.noise_amplitude
    low, high = np.percentile(force, [LOW, HIGH])
    amplitude = float(high - low) / 2
    half = len(force) // 2
    halves = [_amplitude(force[:half]), _amplitude(force[half:])]
    excursion = MAX_EXCURSION * (high - low)
    cycles = find_cycles(
        time, force, np.clip(force, low - excursion, high + excursion), TURNING * (high - low)
    )
    min_drop = TURNING * (high - low)
    if scales.is_measured and drops.size:
        # The strength may vary along the track by more than slips are deep.
        min_drop = min(min_drop, TURNING * float(np.median(drops)))
    is_large = drops >= min_drop
    slips = Cycles(np.diff(starts[is_large]), drops[is_large], cycles.peaks)
    # In the catalogue a slip and its rebounds are one, but oscillations without slips are missing;
    # a trace with few samples may miss slips. The more regular of the two descriptions counts,
    # unless it leaves out most cycles.
    has_most = len(slips.periods) >= max(MIN_CYCLES, len(cycles.periods) / MAX_PATTERN)
    is_regular = not irregularity(slips.periods) >= irregularity(cycles.periods)
    if (has_most and is_regular) or (scales.is_measured and len(slips.periods) >= MIN_CYCLES):
        cycles = slips
    change, error = trend(cycles.falls)
    moved = abs(stage.velocity) * (time[-1] - time[0])
    numbers = {
        "relative_amplitude": amplitude / scale,
        "smooth_amplitude": smooth / scale,
        "cycles": len(cycles.periods),
        "period": defined(np.mean, cycles.periods),
        "period_variation": variation(cycles.periods),
        "period_irregularity": irregularity(cycles.periods),
        "fall_variation": variation(cycles.falls),
        "fall_irregularity": irregularity(cycles.falls),
        "peak_spread": defined(np.std, cycles.peaks, 2) / (2 * amplitude or math.nan),
        "peak_correlation": correlation(cycles.peaks),
        "amplitude_change": change,
        "amplitude_change_error": error,
        "drift": float(np.mean(force[half:]) - np.mean(force[:half])) / scale,
        "fast_share": math.nan,
        "stick_share": math.nan,
        "slips": len(starts),
        "window_start": float(time[0]),
        "window_end": float(time[-1]),
    }
    if not scales.has_velocity:
        moved = math.inf
    elif np.isfinite(velocity).all() and not (
        scales.is_measured and _scatter(velocity) > STICKING * abs(stage.velocity)
    ):
        numbers |= {
            "fast_share": float(np.mean(velocity > abs(stage.velocity))),
            "stick_share": float(np.mean(velocity < STICKING * abs(stage.velocity))),
        }
    is_renewed = moved >= scales.renewal_displacement
    result = RegimeResult(**numbers)  # type: ignore[arg-type]
    regime = _regime(result, [one / scale for one in halves], is_renewed=is_renewed)
    # A prescribed slider neither sticks nor slips.
    if scales.is_rigid and regime in {STICK_SLIP, IRREGULAR}:
        regime = SMOOTH
    return replace(result, regime=regime)


def _regime(found: RegimeResult, halves: list[float], *, is_renewed: bool) -> int:
    """The rules; ``halves`` are the amplitudes in the halves of the window, over the mean force."""
    smooth = found.smooth_amplitude
    if min(halves) <= smooth and max(halves) > SMOOTH_FACTOR * smooth:
        return TRANSIENT
    is_regular = (
        found.cycles >= MIN_CYCLES
        and found.period_irregularity < REGULAR_PERIODS
        and found.fall_irregularity < REGULAR_FALLS
    )
    if found.relative_amplitude <= (SMOOTH_AMPLITUDE if is_regular else smooth):
        return SMOOTH if is_renewed else TRANSIENT
    if found.cycles < MIN_CYCLES:
        return TRANSIENT
    is_certain = abs(found.amplitude_change) > SIGNIFICANCE * found.amplitude_change_error
    if is_certain and abs(found.amplitude_change) > MAX_CHANGE:
        return TRANSIENT
    if found.period_irregularity > IRREGULAR_PERIODS or found.fall_irregularity > IRREGULAR_FALLS:
        return IRREGULAR
    return STICK_SLIP


def _stage(config: Config, reached: float) -> _Stage:
    """The last stage with a moving drive that the run reached."""
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


def _measured_stage(tree: xr.DataTree, apparatus: Apparatus, reached: float) -> _Stage:
    """The last stage of a measured trace in which the drive moves; the whole trace without one."""
    start = float(tree.to_dataset()["time"].values[0])
    found = _Stage(start, reached, apparatus.velocity)
    if "stages" not in tree.children:
        return found
    data = group_of(tree, "stages")
    columns = ("stage_start_time", "stage_end_time", "drive_start_velocity", "drive_end_velocity")
    for begin, end, first, last in zip(*(data[name].values for name in columns), strict=True):
        if begin < reached and (last or first):
            found = _Stage(float(begin), min(float(end), reached), float(last or first))
    return found


def _step(count: int) -> int:
    return max(1, -(-count // MAX_SAMPLES))


def _scatter(values: Array) -> float:
    """Median distance from the median, which slips do not change."""
    return float(np.median(np.abs(values - np.median(values))))


def _amplitude(force: Array) -> float:
    low, high = np.percentile(force, [LOW, HIGH])
    return float(high - low) / 2
