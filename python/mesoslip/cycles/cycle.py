"""The settled cycle of the master equation of a configuration."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.configuration.config import Config
from mesoslip.cycles.section import Level, Motion, Passage, Trace
from mesoslip.cycles.settling import (
    MAX_CYCLES,
    MAX_SPREAD,
    MIN_AMPLITUDE,
    TOLERANCE,
    Settled,
    multipliers,
    settle,
    variation_after,
)
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.inputs import ConfigLike, OutputLike, as_config, open_output
from mesoslip.quantities import with_unit
from mesoslip.simulation.kernel import Array, Words
from mesoslip.theory.steady_sliding import steady_sliding

if TYPE_CHECKING:
    import xarray as xr

# Maximum work for the stability of steady sliding, some seconds.
MAX_WORK = 400_000
# Change of the state for multipliers, over N; steps, and error of the modulus of the leading one.
CHANGE, MAX_STEPS, MULTIPLIER_ERROR = 3e-3, 6, 0.02
# Modulation of the density of contacts after which a cycle comes back, and cycles until then.
MODULATION, CYCLES_AFTER = 0.01, 20
# Passages of an oscillation that is worth a word, though it ends in smooth sliding.
MANY_CYCLES = 40
# A duration without bound [s].
LONG = 1e9
# States to start from, by name.
STARTS = ("relaxed", "steady", "uniform")

# Units and meanings of what is printed.
SUMMARY = {
    "period": ("s", "period"),
    "peak_force": ("N", "maximum of the spring force"),
    "low_force": ("N", "minimum of the spring force"),
    "amplitude": ("N", "maximum less minimum"),
    "amplitude_ratio": ("", "amplitude over the static force"),
    "spread": ("", "variation of the amplitude between passages"),
    "slip_share": ("", "part of the time in slips"),
    "peak_velocity": ("m/s", "maximum of the velocity"),
    "multiplier": ("", "factor of small changes from cycle to cycle, the leading modulus"),
    "is_stable": ("", "whether period and peaks come back after a small change"),
    "smooth_stable": ("", "whether smooth sliding is linearly stable"),
}


@dataclass(frozen=True)
class Cycle:
    """The motion that a configuration settles to, by the master equation.

    Attributes
    ----------
    config
        The configuration, of engine "me".
    motion
        "periodic"; "smooth" sliding; or "irregular", if it does not settle.
    period
        Period [s], over all slips of a cycle; the mean time between slips of an irregular motion;
        NaN for smooth sliding.
    multiple
        Passages of the force through the section in a cycle: 2 after a period doubling.
    peak_force, low_force
        Maximum and minimum of the spring force [N]; means of those between passages, of an
        irregular motion.
    peaks, lows, durations
        Of each passage the maximum and the minimum of the spring force [N] and its duration [s].
    amplitude
        Maximum less minimum of the spring force [N]; 0 for smooth sliding.
    spread
        Standard deviation of the amplitudes of the passages over their mean.
    peak_velocity
        Maximum of the velocity of the slider [m/s].
    slips
        Slips in a cycle, by the criteria of the catalogue of a run.
    slip_share
        Part of the time that is spent in slips.
    multipliers
        Leading multipliers of the cycle, by modulus: factors by which small changes of the state
        grow from cycle to cycle. Empty if they were not computed.
    variation
        Relative variation of period and peaks after a small change, where the leading multiplier is
        1 or more; otherwise NaN.
    smooth_stable
        Whether smooth sliding is linearly stable; None without a theory.
    followed
        Time for which the motion was followed [s].
    error
        Estimated relative error of period and peaks by the iteration, or their variation if that is
        larger; NaN if not periodic.
    cycles
        Passages that were computed, with those for the multipliers.
    solver
        How the cycle was found.
    """

    config: Config
    motion: str
    period: float
    multiple: int
    peak_force: float
    low_force: float
    peaks: tuple[float, ...]
    lows: tuple[float, ...]
    durations: tuple[float, ...]
    amplitude: float
    spread: float
    peak_velocity: float
    slips: int
    slip_share: float
    multipliers: tuple[complex, ...]
    variation: float
    smooth_stable: bool | None
    followed: float
    error: float
    cycles: int
    solver: str
    _trace: Trace = field(repr=False)
    _words: Words = field(repr=False)
    _level: Level | None = field(repr=False)

    @property
    def amplitude_ratio(self) -> float:
        """Amplitude over the static force F_s."""
        return self.amplitude / self.config.contacts.static_force

    @property
    def exists(self) -> bool:
        """Whether the motion oscillates."""
        return self.motion != "smooth"

    @property
    def is_stable(self) -> bool | None:
        """Whether period and peaks come back after a small change; None if it is not known, as
        without multipliers.

        Changes may grow in the fine structure of the distributions alone: the leading multiplier is
        above 1, and period and peaks stay as they are.
        """
        if not self.multipliers:
            return None
        return abs(self.multipliers[0]) < 1 or self.variation < MAX_SPREAD

    @property
    def state(self) -> Words:
        """The state at the section, or at the end, as a checkpoint keeps it."""
        return self._words

    @property
    def section(self) -> Level | None:
        """The level of the spring force that the cycle was cut at; None if there is none."""
        return self._level

    def trace(self) -> xr.Dataset:
        """Samples of one cycle over the time from the section: forces, velocity, detached contacts;
        of an irregular motion the last passages."""
        from mesoslip.cycles.dataset import trace_of

        return trace_of(self._trace)

    def to_tree(self) -> xr.DataTree:
        """The cycle in the layout of an output file."""
        from mesoslip.cycles.dataset import tree_of

        return tree_of(self)

    def summary(self) -> dict[str, Any]:
        """Numbers of the cycle in SI, for print."""
        leading = self.multipliers[0] if self.multipliers else complex(math.nan, math.nan)
        force = self.config.contacts.static_force
        return {
            "motion": self.motion,
            "period": self.period,
            "multiple": self.multiple,
            "peak_force": self.peak_force,
            "low_force": self.low_force,
            "amplitude": self.amplitude,
            "amplitude_ratio": self.amplitude / force,
            "spread": self.spread,
            "slips": self.slips,
            "slip_share": self.slip_share,
            "peak_velocity": self.peak_velocity,
            "multiplier": abs(leading),
            "multiplier_real": leading.real,
            "multiplier_imaginary": leading.imag,
            "is_stable": self.is_stable,
            "smooth_stable": self.smooth_stable,
            "followed": self.followed,
            "error": self.error,
            "cycles": self.cycles,
            "solver": self.solver,
        }

    @property
    def verdict(self) -> str:
        """Which motions are possible, in words."""
        smooth = {
            True: "smooth sliding is linearly stable",
            False: "smooth sliding is linearly unstable",
            None: "linear theory does not say whether smooth sliding is stable",
        }[self.smooth_stable]
        if self.motion == "smooth":
            if self.smooth_stable is False:
                limit = f"{100 * MIN_AMPLITUDE:g} % of F_s"
                return f"from this start no oscillation above {limit} is found; {smooth}"
            before = ""
            if self.cycles > MANY_CYCLES:
                duration = with_unit(self.followed, "s", 2)
                before = f" after oscillations of {self.cycles} passages or more in {duration}"
            return f"from this start the motion settles to smooth sliding{before}; {smooth}"
        percent = f"{100 * self.amplitude_ratio:.3g} % of F_s"
        if self.motion == "irregular":
            duration = with_unit(self.followed, "s", 2)
            large = f"an irregular motion, of {percent} in the mean, was followed for {duration}"
        elif self.multiple > 1:
            large = f"a cycle of {self.multiple} passages goes on, of {percent}"
        else:
            large = f"a cycle goes on, of {percent}"
        if self.is_stable and abs(self.multipliers[0]) >= 1:
            large += (
                "; small changes grow in the fine structure of distributions alone: period and "
                f"peaks vary by {100 * self.variation:.1g} %"
            )
        both = "; both motions are possible" if self.smooth_stable else ""
        if both and self.motion == "irregular":
            both += ", the irregular one perhaps for a time only"
        return f"from this start {large}; {smooth}{both}"


def cycle(
    config: ConfigLike,
    *,
    start: str | OutputLike | Cycle | None = None,
    tolerance: float = TOLERANCE,
    max_cycles: int = MAX_CYCLES,
    find_multipliers: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Cycle:
    """Compute the settled cycle of a configuration by the master equation, N → ∞.

    The master equation is iterated from passage to passage of the spring force through a section.

    Parameters
    ----------
    config
        A TOML file, an output, nested tables, or a `Config`; of either engine, with a rigid
        slider and one constant velocity of the drive. Interaction is left out. Forces and
        velocities of the result are along the drive, whatever its direction.
    start
        Where to start: "relaxed", "steady", "uniform", another cycle or its output; by default the
        initial state of the configuration.
    tolerance
        Relative error of period and peaks at which a cycle is settled.
    max_cycles
        Number of passages before one that does not settle is compared with itself some time later.
        It is irregular if its mean amplitude stays.
    find_multipliers
        Whether to compute the leading multipliers too.
    progress
        Called after each passage with the part of the maximum that is done, 0 to 1.

    Raises
    ------
    FileError, ConfigError
        If the configuration or the start cannot be read or is wrong, or has no cycle.
    RunError
        If the run fails.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")
    >>> config = mesoslip.Config.load(path, ["contacts.delay=2ms", "slider.damping_ratio=1"])
    >>> config = config.replace("contacts.threshold.relative_width=0.1", "drive.velocity=3um/s")
    >>> found = mesoslip.cycle(config)
    >>> found.motion, found.smooth_stable
    ('periodic', False)
    """
    checked = master_equation(as_config(config))
    if isinstance(start, str) and start in STARTS:
        checked = checked.replace({"contacts.initial": start})
        start = None
    words, level = _start_of(start)
    return settled_cycle(
        checked,
        words,
        level,
        tolerance=tolerance,
        max_cycles=max_cycles,
        find_multipliers=find_multipliers,
        progress=progress,
    )


def settled_cycle(
    config: Config,
    words: Words | None = None,
    level: Level | None = None,
    *,
    tolerance: float = TOLERANCE,
    max_cycles: int = MAX_CYCLES,
    find_multipliers: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Cycle:
    """The settled cycle from a state; see `cycle`. The configuration is one for it already."""
    motion = Motion(config)
    sliding = steady_sliding(config, MAX_WORK)
    is_stable = None if sliding is None else sliding.is_stable
    settled = settle(
        motion,
        words,
        level,
        is_stable=is_stable,
        root=None if sliding is None else sliding.leading_root,
        tolerance=tolerance,
        max_cycles=max_cycles,
        progress=progress,
    )
    found: tuple[complex, ...] = ()
    steps, variation = 0, math.nan
    if find_multipliers and settled.motion == "periodic":
        leading, steps = multipliers(
            motion, settled, max_steps=MAX_STEPS, size=CHANGE, tolerance=MULTIPLIER_ERROR
        )
        found = tuple(leading)
        if found and abs(found[0]) >= 1:
            variation = variation_after(motion, settled, MODULATION, CYCLES_AFTER)
            steps += CYCLES_AFTER
    return _cycle_of(config, settled, found, is_stable, steps, variation)


def _cycle_of(
    config: Config,
    settled: Settled,
    found: tuple[complex, ...],
    is_stable: bool | None,
    steps: int,
    variation: float,
) -> Cycle:
    passages = settled.passages if settled.motion != "smooth" else []
    periodic = settled.motion == "periodic"
    rows = np.array([[one.period, one.peak, one.low] for one in passages]).reshape(-1, 3)
    if settled.motion == "irregular":
        # Without the first quarter, which the start still affects.
        rows = settled.rows[len(settled.rows) // 4 :]
    durations, peaks, lows = rows.T
    total = math.fsum(one.period for one in passages)
    count = settled.multiple if periodic else max(1, len(passages))
    peak, low = math.nan, math.nan
    if len(rows):
        peak = float(np.max(peaks) if periodic else np.mean(peaks))
        low = float(np.min(lows) if periodic else np.mean(lows))
    slips = sum(len(one.slips) for one in passages)
    return Cycle(
        config=config,
        motion=settled.motion,
        period=_period(durations, is_sum=periodic),
        multiple=settled.multiple,
        peak_force=peak,
        low_force=low,
        peaks=tuple(peaks.tolist()),
        lows=tuple(lows.tolist()),
        durations=tuple(durations.tolist()),
        amplitude=peak - low if passages else 0.0,
        spread=_spread(peaks - lows),
        peak_velocity=max((_fastest(one) for one in passages), default=math.nan),
        slips=slips if periodic else round(slips / count),
        slip_share=math.fsum(one.slip_duration for one in passages) / total if passages else 0.0,
        multipliers=found,
        variation=variation,
        smooth_stable=is_stable,
        followed=settled.followed,
        error=max(settled.error, variation) if variation < MAX_SPREAD else settled.error,
        cycles=settled.cycles + steps * settled.multiple,
        solver="iteration from section to section"
        + (f", {settled.extrapolations} extrapolations" if settled.extrapolations else ""),
        _trace=np.concatenate([one.trace for one in passages]) if passages else _no_trace(),
        _words=settled.words,
        _level=settled.level,
    )


def _period(durations: Array, *, is_sum: bool) -> float:
    if not durations.size:
        return math.nan
    return math.fsum(durations) if is_sum else float(np.mean(durations))


def _spread(amplitudes: Array) -> float:
    if not amplitudes.size:
        return 0.0
    return float(np.std(amplitudes) / np.mean(amplitudes))


def _fastest(passage: Passage) -> float:
    return float(np.max(np.abs(passage.trace["velocity"])))


def _no_trace() -> Trace:
    from mesoslip.simulation.recorded_tables import TRACE_COLUMNS, structured

    return structured(np.empty((0, len(TRACE_COLUMNS))), TRACE_COLUMNS)


def master_equation(config: Config) -> Config:
    """The configuration of the master equation for cycles of another one.

    The drive has the positive direction: the motion of the other one is its mirror image.

    Raises
    ------
    ConfigError
        If it has no cycle: another slider, no constant velocity, contacts that do not attach again.
    """
    problems = []
    if config.slider.oscillator is None:
        message = "has no cycles here: the slider must be rigid"
        problems.append(Problem("", "slider.kind", message, config.slider.kind))
    elif len(config.drive_parts) > 1 or not _is_constant(config):
        problems.append(Problem("", "drive", "a cycle needs one constant velocity, not zero"))
    if not config.contacts.reattach:
        problems.append(
            Problem("", "contacts.reattach", "a cycle needs contacts that attach again")
        )
    if problems:
        raise ConfigError(problems)
    tables = config.to_dict()
    run = tables.get("run", {})
    kept = {name: run[name] for name in ("resolution",) if name in run}
    tables["run"] = {"engine": "me", "duration": LONG, **kept}
    velocity = tables.get("output", {}).get("slip_velocity")
    tables["output"] = {} if velocity is None else {"slip_velocity": velocity}
    tables.pop("interaction", None)
    if config.drive_parts[-1].start_velocity < 0:
        tables["drive"] = {"velocity": -config.drive_parts[-1].start_velocity}
    return Config.from_dict(tables)


def _is_constant(config: Config) -> bool:
    part = config.drive_parts[-1]
    return part.start_velocity == part.end_velocity != 0


def _start_of(start: OutputLike | Cycle | None) -> tuple[Words | None, Level | None]:
    """State and section of a start."""
    import xarray as xr

    if start is None:
        return None, None
    if isinstance(start, Cycle):
        return start.state, start.section
    tree = open_output(start) if isinstance(start, str | os.PathLike) else start
    if not isinstance(tree, xr.DataTree) or "state" not in tree.children:
        raise FileError("the start is not an output of `mesoslip cycle`")
    words = np.asarray(tree["state"].to_dataset()["words"].values, dtype=np.int64)
    level = None
    if "section_force" in tree.attrs:
        level = Level(float(tree.attrs["section_force"]), float(tree.attrs["section_reset"]))
    return words, level
