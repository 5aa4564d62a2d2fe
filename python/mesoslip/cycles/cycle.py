"""Computation of the settled cycle of a configuration by the master equation."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.cycles.cycle_result import Cycle
from mesoslip.cycles.decay import Batch
from mesoslip.cycles.disturbance import Return, after_disturbance
from mesoslip.cycles.section import Level, Motion, time_of
from mesoslip.cycles.settling import (
    MAX_CYCLES,
    TOLERANCE,
    Settled,
    settle,
)
from mesoslip.errors import ConfigError, FileError, Problem, RunError
from mesoslip.output.inputs import ConfigLike, OutputLike, as_config, open_output
from mesoslip.simulation.kernel import Words
from mesoslip.simulation.recorded_tables import TRACE_COLUMNS, structured
from mesoslip.theory.steady_sliding import decay_of_sliding

# Maximum work for the stability of steady sliding, some seconds.
MAX_WORK = 400_000
# Maximum number of disturbances from which a motion goes elsewhere.
MAX_DISTURBANCES = 3
# A duration without bound [s].
LONG = 1e9
# Resolution at which a motion settles first, to a tolerance, and maximum resolution for which it
# does.
COARSE, COARSE_TOLERANCE, MAX_FINE = 1.0, 3e-4, 0.5
# Ratio of successive resolutions between that and the configuration's own, its minimum at the last
# one, and the number of cycles at each: what differs by the resolution settles there at less cost.
REFINEMENT, MIN_REFINEMENT, CYCLES_BETWEEN = 0.5, math.sqrt(2), 3
# Cycles in which a motion settles after that; otherwise it is followed from its own start.
FEW = 40
# Initial states, by name.
STARTS = ("relaxed", "steady", "uniform")


@arguments.checked(
    tolerance=arguments.number(0, 1, is_open=True),
    max_cycles=arguments.whole(1),
    find_multipliers=arguments.flag,
    progress=arguments.function,
)
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

    The master equation is iterated from one passage of the spring force through a section to the
    next.

    Parameters
    ----------
    config
        A TOML file, an output, nested tables, or a `Config`; of either engine, with a rigid
        slider and one constant velocity of the drive. Interaction is left out. Forces and
        velocities of the result are along the drive, whatever its direction.
    start
        The start: "relaxed", "steady", "uniform", another cycle or its output; by default the
        initial state of the configuration.
    tolerance
        Relative error of period and peaks at which a cycle is settled.
    max_cycles
        Number of passages after which a motion that has not settled is compared with itself later.
        It is irregular if its mean amplitude stays the same.
    find_multipliers
        Whether to disturb a cycle that continues from a start, so as to find its multipliers and
        whether it returns. From the start of a run every cycle is disturbed.
    progress
        Called after each passage with its number over the maximum, 0 to 1.

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
        checked = started(checked, start)
        start = None
    words, level = _start_of(start)
    return settled_cycle(
        checked,
        words,
        level,
        tolerance=tolerance,
        max_cycles=max_cycles,
        find_multipliers=find_multipliers,
        begins_coarse=words is None,
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
    begins_coarse: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Cycle:
    """The settled cycle from a state, for a configuration of `master_equation`; see `cycle`.

    From the start of a run it may settle at a coarse resolution first.
    """
    motion = Motion(config)
    is_stable, root = decay_of_sliding(config, MAX_WORK)
    begins_coarse = begins_coarse and config.run.resolution <= MAX_FINE
    done = 0.0

    def report(part: float, *, is_coarse: bool) -> None:
        nonlocal done
        if begins_coarse:
            part = part / 2 + (0 if is_coarse else 0.5)
        if progress is not None and part > done:
            done = part
            progress(part)

    def settled_at(
        motion: Motion,
        words: Words | None,
        level: Level | None,
        batches: Sequence[Batch] = (),
        *,
        is_coarse: bool = False,
        max_passages: int | None = None,
        decay: float | None = None,
    ) -> Settled:
        return settle(
            motion,
            words,
            level,
            batches=batches,
            is_stable=is_stable,
            root=root,
            tolerance=max(tolerance, COARSE_TOLERANCE) if is_coarse else tolerance,
            max_cycles=max_cycles,
            max_passages=max_passages,
            decay=decay,
            progress=partial(report, is_coarse=is_coarse),
        )

    coarse: Settled | None = None
    back: Return | None = None
    settled: Settled | None = None
    start = 0.0 if words is None else time_of(words)
    is_continued, coarse_cycles = words is not None, 0
    if begins_coarse:
        with contextlib.suppress(RunError):
            coarse, back, coarse_cycles = _at_coarse(config, settled_at)
    if coarse is not None:
        few = None if back is None else FEW * coarse.multiple
        settled = settled_at(
            motion,
            coarse.words,
            coarse.level,
            coarse.batches,
            max_passages=few,
            decay=None if back is None else back.decay(coarse.multiple),
        )
        if back is not None and settled.motion != "periodic":
            settled = coarse = back = None
    if settled is None:
        settled = settled_at(motion, words, level)
    cycles = settled.cycles
    if back is None and (find_multipliers or begins_coarse):
        settled, back, cycles = _disturbed(motion, settled, settled_at, 10 * tolerance)
        if back is not None:
            settled = settled.with_decay(back.decay(settled.multiple))
    if settled.motion == "periodic":
        settled = settled.shortest()
    cycle = _cycle_of(config, settled, back if settled.motion == "periodic" else None, is_stable)
    if coarse is not None:
        solver = f"{cycle.solver}, after {coarse_cycles} passages with longer steps"
        cycle = dataclasses.replace(cycle, coarse_cycles=coarse_cycles, solver=solver)
    followed = time_of(settled.words) - start
    return dataclasses.replace(cycle, cycles=cycles, followed=followed, is_continued=is_continued)


def _at_coarse(
    config: Config, settled_at: Callable[..., Settled]
) -> tuple[Settled | None, Return | None, int]:
    """The motion settled at the coarse resolution, the return of a cycle, and the number of
    passages; None where the motion at the configuration's own resolution may be another one.

    Steps that are too long may let an oscillation decay. A cycle to which the motion does not
    return after a disturbance, or at its own resolution does not settle soon, may not be that of
    the start.
    """
    motion = Motion(_with_resolution(config, COARSE))
    settled = settled_at(motion, None, None, is_coarse=True)
    if settled.motion == "irregular":
        return settled, None, settled.cycles
    back = after_disturbance(motion, settled) if settled.motion == "periodic" else None
    if back is None or not back.returns:
        return None, None, 0
    words, between = _refined(config, settled, back.words)
    count = settled.cycles + back.cycles * settled.multiple + between
    return dataclasses.replace(settled, words=words, batches=()), back, count


def _refined(config: Config, settled: Settled, words: Words) -> tuple[Words, int]:
    """A state after some cycles at each resolution between the coarse one and the configuration's
    own, and the number of passages."""
    assert settled.level is not None
    count, resolution = 0, COARSE * REFINEMENT
    while resolution >= MIN_REFINEMENT * config.run.resolution:
        motion = Motion(_with_resolution(config, resolution))
        for _ in range(CYCLES_BETWEEN * settled.multiple):
            passage = motion.next_passage(words, settled.level)
            if passage is None:
                break
            words, count = passage.words, count + 1
        resolution *= REFINEMENT
    return words, count


def _disturbed(
    motion: Motion, settled: Settled, settled_at: Callable[..., Settled], tolerance: float
) -> tuple[Settled, Return | None, int]:
    """The motion that is reached after disturbances of a settled one, its return if it is a cycle,
    and the number of passages."""
    back, cycles = None, settled.cycles
    for _ in range(MAX_DISTURBANCES):
        if settled.motion != "periodic":
            break
        back = after_disturbance(motion, settled)
        cycles += back.cycles * settled.multiple
        if back.returns:
            break
        before, settled = settled, settled_at(motion, back.words, settled.level)
        cycles += settled.cycles
        if settled.is_like(before, tolerance):
            back = back._replace(returns=True)
            break
    return settled, back, cycles


def _with_resolution(config: Config, resolution: float) -> Config:
    """The configuration at another resolution."""
    return config.adapted(lambda one: one.replace({"run.resolution": resolution}))


def _cycle_of(
    config: Config, settled: Settled, back: Return | None, smooth_stable: bool | None
) -> Cycle:
    passages = settled.passages if settled.motion != "smooth" else []
    periodic = settled.motion == "periodic"
    rows = np.array([[one.period, one.peak, one.low] for one in passages]).reshape(-1, 3)
    if settled.motion == "irregular":
        # Without the first quarter, which the start still affects.
        rows = settled.rows[len(settled.rows) // 4 :]
    durations, peaks, lows = rows.T
    period = peak = low = math.nan
    spread = 0.0
    if len(rows):
        period = math.fsum(durations) if periodic else float(np.mean(durations))
        peak = float(np.max(peaks) if periodic else np.mean(peaks))
        low = float(np.min(lows) if periodic else np.mean(lows))
        mean = float(np.mean(peaks - lows))
        spread = max(
            float(np.std(values)) / scale
            for values, scale in (
                (durations, float(np.mean(durations))),
                *((one, mean) for one in (peaks, lows, peaks - lows)),
            )
        )
    slips = sum(len(one.slips) for one in passages)
    slip_time = math.fsum(one.slip_duration for one in passages)
    traces = [structured(np.empty((0, len(TRACE_COLUMNS))), TRACE_COLUMNS)]
    traces = [one.trace for one in passages] or traces
    velocities = (float(np.max(np.abs(one.trace["velocity"]))) for one in passages)
    return Cycle(
        config=config,
        motion=settled.motion,
        period=period,
        multiple=settled.multiple,
        peak_force=peak,
        low_force=low,
        peaks=tuple(peaks.tolist()),
        lows=tuple(lows.tolist()),
        durations=tuple(durations.tolist()),
        amplitude=peak - low if passages else 0.0,
        spread=spread,
        peak_velocity=max(velocities, default=math.nan),
        slips=slips if periodic else round(slips / max(1, len(passages))),
        slip_share=slip_time / math.fsum(one.period for one in passages) if passages else 0.0,
        multipliers=() if back is None else back.multipliers,
        is_stable=None if back is None else back.returns,
        smooth_stable=smooth_stable,
        followed=settled.followed,
        error=settled.error,
        cycles=settled.cycles,
        solver="iteration from section to section",
        state=settled.words,
        section=settled.level,
        _trace=np.concatenate(traces),
    )


def started(config: Config, initial: str) -> Config:
    """The configuration with another initial state of the contacts."""
    return config.adapted(lambda one: one.replace({"contacts.initial": initial}))


def master_equation(config: Config) -> Config:
    """The configuration of the master equation for the cycles of another one.

    The drive moves in the positive direction: a motion under the opposite drive is a mirror image.
    """
    return config.adapted(_master_equation)


def _master_equation(config: Config) -> Config:
    problems = []
    if config.slider.oscillator is None:
        message = "must be rigid: other sliders have no cycles here"
        problems.append(Problem("", "slider.kind", message, config.slider.kind))
    elif len(config.drive_parts) > 1 or not _is_constant(config):
        problems.append(Problem("", "drive", "a cycle needs one constant velocity, not zero"))
    problems += [
        Problem("", key, "has no settled cycle: no two slips are on one place")
        for key in config.contacts.place_keys
    ]
    if config.pressing.varies:
        message = "has no settled cycle: it must be constant, with normal_force alone"
        problems.append(Problem("", "load", message))
    if not config.contacts.reattach:
        problems.append(
            Problem("", "contacts.reattach", "a cycle needs contacts that attach again")
        )
    if problems:
        raise ConfigError(problems)
    tables = config.to_dict()
    tables["run"] = {"engine": "me", "duration": LONG, "resolution": config.run.resolution}
    velocity = config.output.slip_velocity
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
