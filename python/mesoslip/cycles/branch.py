"""Branches of a motion over a parameter: each value starts from the state of the one before.

Values go up and down again. Where cycles and smooth sliding are both possible, the two directions
differ: hysteresis. Where an oscillation ends between two values, the end is found by bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.cycles.coordinates import SLIDER, Coordinates
from mesoslip.cycles.cycle import MAX_WORK, Cycle, master_equation, settled_cycle
from mesoslip.cycles.section import Level, Motion
from mesoslip.cycles.settling import TOLERANCE
from mesoslip.errors import ConfigError, Problem
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.kernel import Words
from mesoslip.simulation.start import put_on_spring
from mesoslip.theory.steady_sliding import steady_sliding

if TYPE_CHECKING:
    import xarray as xr

# Keys in which a motion can go on from a state of another value.
CONTINUED = (
    "drive.velocity",
    "slider.mass",
    "slider.stiffness",
    "slider.damping",
    "slider.damping_ratio",
    "contacts.delay",
    "contacts.drag_rate",
    "contacts.back_force_ratio",
    "contacts.threshold.relative_width",
    "contacts.ageing.*",
    "contacts.thermal.*",
)
# Maximum number of passages at one value, fewer than without a state close by.
MAX_CYCLES = 32
# Part by which the contacts over their stretch are modulated where smooth sliding is unstable, so
# that its growth starts from more than rounding.
MODULATION = 0.02
# Relative distance of the values between which an oscillation ends.
END_TOLERANCE = 0.01


@dataclass(frozen=True)
class End:
    """Where an oscillation ends in smooth sliding as it is followed over a parameter.

    Attributes
    ----------
    direction
        0 if the values go up, 1 if they go down.
    value, beyond
        The last value with the oscillation, and the first one without.
    motion
        "periodic" or "irregular", at the last value.
    amplitude_ratio
        Amplitude there over the static force F_s.
    """

    direction: int
    value: float
    beyond: float
    motion: str
    amplitude_ratio: float


def branches(
    config: ConfigLike,
    key: str,
    values: Sequence[float],
    *,
    tolerance: float = TOLERANCE,
    max_cycles: int = MAX_CYCLES,
    find_multipliers: bool = False,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Follow the settled motion over a parameter, up and down again.

    Parameters
    ----------
    config
        As `mesoslip.cycle` takes it; its initial state is that of the first value.
    key
        Dotted key, one of `CONTINUED`.
    values
        Values in SI, ascending.
    tolerance, max_cycles, find_multipliers
        As for `mesoslip.cycle`, at each value.
    progress
        Called with the part that is done, 0 to 1.

    Returns
    -------
    xarray.Dataset
        Of dimensions ``direction`` ("up", "down") and the key: amplitude, period, peaks, kind of
        motion, multipliers; over the key alone: steady force and growth rate of smooth sliding.
        Of dimension ``end``, if an oscillation ends in smooth sliding: the values around that
        within 1 %, the direction, and the amplitude just before.

    Raises
    ------
    FileError, ConfigError
        If the configuration is wrong, or cannot be continued in the key.
    RunError
        If a run fails.
    """
    from mesoslip.cycles.branch_dataset import dataset_of

    base = master_equation(as_config(config))
    _check(key, values)
    configs = [base.replace({key: float(value)}) for value in values]
    found: list[list[Cycle]] = []
    last: Cycle | None = None
    done = 0
    for order in (1, -1):
        branch = []
        for one in configs[::order]:
            last = _next(one, last, tolerance, max_cycles, find_multipliers=find_multipliers)
            branch.append(last)
            done += 1
            if progress is not None:
                progress(done / (2 * len(configs)))
        found.append(branch[::order])
    ends = []
    for direction, order in enumerate((1, -1)):
        along = list(zip(values[::order], found[direction][::order], strict=True))
        for (value, before), (beyond, after) in pairwise(along):
            if before.exists and not after.exists:
                end = _end_between(base, key, value, beyond, before, tolerance, max_cycles)
                ends.append(End(direction, *end))
    sliding = [steady_sliding(one, MAX_WORK) for one in configs]
    return dataset_of(base, key, values, found, sliding, ends)


def _end_between(
    base: Config,
    key: str,
    value: float,
    beyond: float,
    last: Cycle,
    tolerance: float,
    max_cycles: int,
) -> tuple[float, float, str, float]:
    """Last value with an oscillation, first one without, the motion and its amplitude over F_s."""
    while abs(beyond - value) > END_TOLERANCE * max(abs(beyond), abs(value)):
        middle = (value + beyond) / 2
        config = base.replace({key: middle})
        found = _next(config, last, tolerance, max_cycles, find_multipliers=False)
        if found.exists:
            value, last = middle, found
        else:
            beyond = middle
    return value, beyond, last.motion, last.amplitude_ratio


def _check(key: str, values: Sequence[float]) -> None:
    if not any(fnmatchcase(key, one) for one in CONTINUED) or key_kind(key) is None:
        known = ", ".join(CONTINUED)
        raise ConfigError([Problem("", "key", f"must be one of {known}", key)])
    if len(values) < 2 or not np.all(np.diff(values) > 0):
        raise ConfigError([Problem("", key, "needs at least two values, ascending")])


def _next(
    config: Config,
    last: Cycle | None,
    tolerance: float,
    max_cycles: int,
    *,
    find_multipliers: bool,
) -> Cycle:
    """The settled motion of the next value, from that of the last one."""
    words: Words | None = None
    level: Level | None = None
    if last is not None:
        sliding = steady_sliding(config, MAX_WORK)
        grows = last.motion == "smooth" and sliding is not None and not sliding.is_stable
        part = MODULATION if grows else 0.0
        words = adapted(last.state, last.config, config, modulation=part)
        if last.motion == "periodic":
            level = last.section
    return settled_cycle(
        config,
        words,
        level,
        tolerance=tolerance,
        max_cycles=max_cycles,
        find_multipliers=find_multipliers,
    )


def adapted(words: Words, before: Config, config: Config, *, modulation: float = 0.0) -> Words:
    """A state of another configuration as one of this: velocities and forces, but that of the
    damper, stay as they are.

    Parameters
    ----------
    words
        State of a rigid slider on populations.
    before, config
        The configuration it is of, and the one it is to be of, of which keys of `CONTINUED` may be
        others.
    modulation
        Part by which the density of contacts over their stretch is modulated.
    """
    motion = Motion(config)
    archive = Archive(words)
    put_on_spring(archive, SLIDER, before, config)
    time = archive.number(SLIDER, "time")
    drive = archive.number(SLIDER, "drive value") + archive.number(SLIDER, "drive rate") * (
        time - archive.number(SLIDER, "drive time")
    )
    for name, value in (
        ("drive time", time),
        ("drive value", drive),
        ("drive rate", motion.velocity),
        ("impulse", 0.0),
    ):
        archive.set_number(SLIDER, name, value)
    samples = math.floor(time / motion.interval) + 1
    archive.set_number("trace", "samples", samples)
    archive.set_number("trace", "next_time", samples * motion.interval)
    coordinates = Coordinates(config, motion.velocity)
    state = archive.words()
    return coordinates.changed(state, coordinates.modulation(state, modulation))
