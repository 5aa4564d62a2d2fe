"""Known properties of the apparatus behind an output: its force, spring, period and drive.

The output of a run has its whole configuration. A measured trace may have only a friction
coefficient and the displacement of a load point.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesoslip.configuration.config import Config
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, FileError
from mesoslip.output.access import group_of, is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import FORCES, force_among, has_force

# Units of the stiffness by the unit of the force, with examples.
STIFFNESSES = {"N": ("N/m", "97 N/m"), "1": ("1/m", "1.6e-3 1/um")}


@dataclass(frozen=True)
class Apparatus:
    """Known properties of an apparatus."""

    force_name: str
    """Variable of the output with the force."""
    force_unit: str
    stiffness: float
    """Unit of the force per metre; infinite for a prescribed slider, NaN if unknown."""
    period: float
    """Period of the setup [s]; NaN if it is unknown or the slider has no inertia."""
    velocity: float
    """First nonzero velocity of the drive [m/s], or rate of its force [N/s]; NaN if unknown, 0
    without a drive."""
    config: Config | None
    """Configuration of a run or of the whole experiment; None if unknown."""

    @property
    def direction(self) -> float:
        """Sign of the velocity of the drive, +1 if it is unknown or 0."""
        return -1.0 if self.velocity < 0 else 1.0


def apparatus_of(tree: Tree, name: str = "the output") -> Apparatus:
    """Properties of the apparatus according to an output; ``name`` is that in messages."""
    if not has_force(tree.data_vars):
        raise FileError(f"{name}: is neither the output of a run nor a measured trace")
    force = force_among(tree.data_vars)
    unit = FORCES[force]
    config = _config(tree, name)
    if config is not None:
        quiet = config.slider.quiet_time
        return Apparatus(
            force,
            unit,
            config.spring_stiffness,
            2 * quiet if quiet > 0 else math.nan,
            first_velocity(config),
            config,
        )
    known = tomllib.loads(tree.attrs.get("configuration", ""))
    stiffness = _known(known, ("slider", "stiffness"), *STIFFNESSES[unit])
    velocity = _known(known, ("drive", "velocity"), "m/s", "42 um/s")
    if math.isnan(velocity):
        velocity = _driven_velocity(tree)
    given = tree.attrs.get("setup_period_origin") == "given"
    period = float(tree.attrs["setup_period"]) if given else math.nan
    return Apparatus(force, unit, stiffness, period, velocity, None)


def first_velocity(config: Config) -> float:
    """The first nonzero velocity of the drive [m/s], or rate of its force [N/s]; 0 for none."""
    parts = config.drive_parts
    velocities = (one for part in parts for one in (part.start_velocity, part.end_velocity))
    return next((one for one in velocities if one), 0.0)


def _config(tree: Tree, name: str) -> Config | None:
    """The whole configuration; None for a measured trace with a part of it."""
    try:
        return Config.from_toml(tree.attrs["configuration"])
    except (ConfigError, KeyError):
        if is_measured(tree):
            return None
        raise FileError(f"{name}: has no configuration of a run") from None


def _known(tables: dict[str, Any], key: tuple[str, str], unit: str, example: str) -> float:
    """The value of a key in SI; NaN without it."""
    value = tables.get(key[0], {}).get(key[1])
    if value is None:
        return math.nan
    return float(value) if isinstance(value, int | float) else to_si(value, unit, example)


def _driven_velocity(tree: Tree) -> float:
    """First nonzero velocity of the recorded stages, or mean velocity of the load point [m/s]."""
    if "stages" in tree.children:
        data = group_of(tree, "stages")
        both = [data[f"drive_{one}_velocity"].values for one in ("start", "end")]
        moving = np.stack(both, axis=1).ravel()
        moving = moving[np.isfinite(moving) & (moving != 0)]
        return float(moving[0]) if moving.size else 0.0
    if "drive_displacement" in tree.data_vars:
        root = tree.to_dataset()
        drive, time = np.atleast_2d(root["drive_displacement"].values)[0], root["time"].values
        known = np.flatnonzero(np.isfinite(drive))
        if known.size > 1:
            first, last = known[0], known[-1]
            return float((drive[last] - drive[first]) / (time[last] - time[first]))
    return math.nan
