"""Branches of motions over a parameter: each value starts from the state of the value before.

Values go up and down again. Where cycles and smooth sliding are both possible, the two directions
differ (hysteresis). The end of an oscillation between two values is found by bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.cycles.coordinates import SLIDER, Coordinates
from mesoslip.cycles.cycle import MAX_WORK, master_equation, settled_cycle
from mesoslip.cycles.cycle_result import Cycle
from mesoslip.cycles.section import Level, Motion
from mesoslip.cycles.settling import TOLERANCE
from mesoslip.errors import ConfigError
from mesoslip.output import variables
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.provenance import program_attributes
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.kernel import Words
from mesoslip.simulation.start import drive_displacement, put_on_spring
from mesoslip.theory.steady_sliding import steady_sliding

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.theory.linear_stability import LinearStability

# Keys for which a motion can continue from a state at another value.
CONTINUED = (
    "drive.velocity",
    "slider.mass",
    "slider.stiffness",
    "slider.damping",
    "slider.damping_ratio",
    "contacts.delay",
    "contacts.drag",
    "contacts.drag_rate",
    "contacts.back_force_ratio",
    "contacts.threshold.relative_width",
    "contacts.ageing.*",
    "contacts.thermal.*",
)
# Maximum number of passages at one value, fewer than without a state near the settled one.
MAX_CYCLES = 32
# Relative modulation of the contacts over their stretch where smooth sliding is unstable, so that
# growth does not start from rounding errors.
MODULATION = 0.02
# Relative distance of the two values around the end of an oscillation.
END_TOLERANCE = 0.01

MOTIONS = variables.MOTIONS.split()
DIRECTIONS = ("up", "down")


class End(NamedTuple):
    """The end of an oscillation in smooth sliding, as the parameter goes up (0) or down (1): the
    last value with the oscillation, the first one without, motion and amplitude at the last one."""

    direction: int
    value: float
    beyond: float
    motion: str
    amplitude_ratio: float


@arguments.checked(
    key=arguments.text,
    values=arguments.numbers,
    tolerance=arguments.number(0, 1, is_open=True),
    max_cycles=arguments.whole(1),
    find_multipliers=arguments.flag,
    progress=arguments.function,
)
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
    """Compute the settled motion over a parameter, up and down again.

    Parameters
    ----------
    config
        As for `mesoslip.cycle`; its initial state is that of the first value.
    key
        Dotted key, one of `CONTINUED`.
    values
        Values in SI, ascending.
    tolerance, max_cycles, find_multipliers
        As for `mesoslip.cycle`, at each value.
    progress
        Called with the completed part, 0 to 1.

    Returns
    -------
    xarray.Dataset
        With dimensions ``direction`` ("up", "down") and the key: amplitude, period, peaks, motion,
        multipliers. With the dimension of the key: steady force and growth rate of smooth sliding.
        With dimension ``end``, if an oscillation ends in smooth sliding: the values around the end
        (within 1 %), the direction, and the motion and its amplitude before the end.

    Raises
    ------
    FileError, ConfigError
        If the configuration is wrong, or cannot be continued in the key.
    RunError
        If a run fails.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> config = mesoslip.Config.load(path, ["contacts.delay=2ms", "slider.damping_ratio=1"])
    >>> config = config.replace("contacts.threshold.relative_width=0.1", "run.resolution=1")
    >>> found = mesoslip.branches(config, "drive.velocity", [3e-6, 40e-6], find_multipliers=False)
    >>> dict(found["amplitude"].sizes)
    {'direction': 2, 'drive.velocity': 2}
    """
    base = master_equation(as_config(config))
    _check(key, values)
    configs = [base.replace({key: float(value)}) for value in values]
    found: list[list[Cycle]] = []
    ends: list[End] = []
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
        for (value, before), (beyond, after) in pairwise(zip(values[::order], branch, strict=True)):
            if before.exists and not after.exists:
                end = _end_between(base, key, value, beyond, before, tolerance, max_cycles)
                ends.append(end)
    sliding = [steady_sliding(one, MAX_WORK) for one in configs]
    return _dataset(base, key, values, found, sliding, ends)


def _end_between(
    base: Config,
    key: str,
    value: float,
    beyond: float,
    last: Cycle,
    tolerance: float,
    max_cycles: int,
) -> End:
    """The end of an oscillation between two values, by bisection."""
    while abs(beyond - value) > END_TOLERANCE * max(abs(beyond), abs(value)):
        middle = (value + beyond) / 2
        config = base.replace({key: middle})
        found = _next(config, last, tolerance, max_cycles, find_multipliers=False)
        if found.exists:
            value, last = middle, found
        else:
            beyond = middle
    return End(int(beyond < value), value, beyond, last.motion, last.amplitude_ratio)


def _check(key: str, values: Sequence[float]) -> None:
    if not any(fnmatchcase(key, one) for one in CONTINUED) or key_kind(key) is None:
        known = ", ".join(CONTINUED)
        raise ConfigError.of("key", f"must be one of {known}", key)
    if len(values) < 2 or not np.all(np.diff(values) > 0):
        raise ConfigError.of(key, "needs at least two values, ascending")


def _next(
    config: Config,
    last: Cycle | None,
    tolerance: float,
    max_cycles: int,
    *,
    find_multipliers: bool,
) -> Cycle:
    """The settled motion at the next value, from that at the last one."""
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
    """A state of a rigid slider on populations, adapted to a configuration with other values of the
    keys in `CONTINUED`; velocities and forces, except the damper's, stay the same.

    The density of contacts over their stretch may be modulated by a small part.
    """
    motion = Motion(config)
    archive = Archive(words)
    put_on_spring(archive, SLIDER, before, config)
    time = archive.number(SLIDER, "time")
    for name, value in (
        ("drive value", drive_displacement(archive, SLIDER)),
        ("drive time", time),
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


def _dataset(
    base: Config,
    key: str,
    values: Sequence[float],
    found: Sequence[Sequence[Cycle]],
    sliding: Sequence[LinearStability | None],
    ends: Sequence[End],
) -> xr.Dataset:
    """The branches as a dataset; ``found`` has shape (directions, values), and steady sliding is
    None without a theory."""
    import xarray as xr

    kind = key_kind(key)
    units = (None if kind is None else kind.cf_units) or "1"
    columns: dict[str, Callable[[Cycle], float]] = {
        "amplitude": lambda one: one.amplitude,
        "amplitude_ratio": lambda one: one.amplitude_ratio,
        "spread": lambda one: one.spread,
        "period": lambda one: one.period,
        "peak_force": lambda one: one.peak_force,
        "low_force": lambda one: one.low_force,
        "multiplier": lambda one: abs(one.multipliers[0]) if one.multipliers else math.nan,
        "motion": lambda one: MOTIONS.index(one.motion),
        "multiple": lambda one: one.multiple,
    }
    data = {
        name: _variable(name, ("direction", key), [[value(one) for one in row] for row in found])
        for name, value in columns.items()
    }
    forces = [math.nan if one is None else one.force for one in sliding]
    data["steady_force"] = _variable("steady_force", (key,), forces)
    rates = [math.nan if one is None else one.growth_rate for one in sliding]
    data["growth_rate"] = _variable("growth_rate", (key,), rates)
    if ends:
        end_columns: dict[str, list[float]] = {
            "end_value": [one.value for one in ends],
            "end_beyond": [one.beyond for one in ends],
            "end_amplitude_ratio": [one.amplitude_ratio for one in ends],
            "end_direction": [one.direction for one in ends],
            "end_motion": [MOTIONS.index(one.motion) for one in ends],
        }
        data |= {name: _variable(name, ("end",), column) for name, column in end_columns.items()}
        for name in ("end_value", "end_beyond"):
            data[name].attrs["units"] = units
    coordinates = {
        key: xr.Variable((key,), np.array(values, dtype=float), {"units": units}),
        "direction": ("direction", list(DIRECTIONS)),
    }
    attributes = program_attributes(base, "branches") | {"continued_key": key}
    return xr.Dataset(data, coordinates, attributes)


def _variable(name: str, dimensions: tuple[str, ...], values: Any) -> xr.Variable:
    """A variable of `BRANCHES`."""
    dtype = variables.BRANCHES[name].dtype
    return variables.BRANCHES.variable(name, dimensions, np.array(values, dtype=dtype))
