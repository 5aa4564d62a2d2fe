"""Steady sliding over velocity: F(v), dF/d ln v, and the springs with which it is stable.

For contacts that age or break by thermal activation, whose force depends on how fast they slide.
"""

from __future__ import annotations

import itertools
import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mesoslip.array_types import Array
from mesoslip.errors import ConfigError
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import STEADY
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.linear_stability import LinearStability
from mesoslip.theory.steady_sliding import sliding_of

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Decades of velocities on either side, and velocities of each.
DECADES, VELOCITIES_A_DECADE = 3, 2
# Relative error of a velocity at which sliding loses stability.
TOLERANCE = 0.01


class SteadyCurve:
    """Steady sliding at velocities around that of the drive; a ConfigError without a theory."""

    def __init__(self, config: Config) -> None:
        self.config = config
        centre = _centre(config)
        count = 2 * DECADES * VELOCITIES_A_DECADE + 1
        self.velocity: Array = centre * np.logspace(-DECADES, DECADES, count)
        self._sliding = [sliding_of(config, float(one)) for one in self.velocity]

    @cached_property
    def force(self) -> Array:
        """F(v) [N]."""
        return np.array([one.force for one in self._sliding])

    @cached_property
    def slope(self) -> Array:
        """dF/d ln v [N]."""
        return np.array([one.velocity * one.slope for one in self._sliding])

    @cached_property
    def critical_stiffness(self) -> Array:
        """Stiffness above which sliding is linearly stable [N/m]; 0 if it is with any spring, NaN
        if none is known, as for layers on a base or with a delay of the contacts."""
        return np.array([_critical(one) for one in self._sliding])

    @cached_property
    def boundaries(self) -> tuple[float, ...]:
        """Velocities at which sliding gains or loses stability with the configured spring [m/s]."""
        spring = self.config.spring_stiffness
        if not 0 < spring < math.inf or np.any(np.isnan(self.critical_stiffness)):
            return ()
        found = []
        unstable = self.critical_stiffness > spring
        for at in np.flatnonzero(np.diff(unstable)):
            low, high = np.log(self.velocity[at : at + 2])
            while high - low > TOLERANCE:
                middle = (low + high) / 2
                is_unstable = _critical(sliding_of(self.config, math.exp(middle))) > spring
                low, high = (middle, high) if is_unstable == unstable[at] else (low, middle)
            found.append(math.exp((low + high) / 2))
        return tuple(found)

    @property
    def verdict(self) -> str:
        """Velocities of stable and unstable sliding with the configured spring."""
        from mesoslip.quantities import with_unit

        spring = self.config.spring_stiffness
        if not 0 < spring < math.inf:
            return "without a spring there is no stability to state"
        if np.any(np.isnan(self.critical_stiffness)):
            return (
                "no critical stiffness is known for layers on a base, or with a delay of contacts"
            )
        ends = [self.velocity[0], *self.boundaries, self.velocity[-1]]
        is_unstable = bool(self.critical_stiffness[0] > spring)
        parts = []
        for low, high in itertools.pairwise(ends):
            state = "unstable" if is_unstable else "stable"
            parts.append(f"{state} from {with_unit(low, 'm/s', 3)} to {with_unit(high, 'm/s', 3)}")
            is_unstable = not is_unstable
        return f"steady sliding with K = {with_unit(spring, 'N/m', 3)} is linearly " + ", ".join(
            parts
        )

    def to_tree(self) -> xr.DataTree:
        """The curve in the layout of an output file, over ``velocity``."""
        columns = {
            "steady_force": self.force,
            "steady_slope": self.slope,
            "critical_stiffness": self.critical_stiffness,
        }
        dimension = ("velocity",)
        data = xr.Dataset(
            {name: STEADY.variable(name, dimension, values) for name, values in columns.items()},
            coords={"velocity": STEADY.variable("velocity", dimension, self.velocity)},
            attrs=program_attributes(self.config, "steady")
            | {"comment": self.verdict}
            | ({"boundaries": list(self.boundaries)} if self.boundaries else {}),
        )
        return xr.DataTree(data)


def _centre(config: Config) -> float:
    """Velocity of the drive, or of steady creep under its force [m/s]."""
    if config.drive_speed > 0:
        return config.drive_speed
    if config.drive.is_force:
        velocity = contact_theory(config).creep_velocity(config.drive.first_force)
        if math.isfinite(velocity):
            return velocity
    raise ConfigError.of("drive.velocity", "steady sliding needs a velocity")


def _critical(sliding: LinearStability) -> float:
    if not sliding.has_critical_stiffness:
        return math.nan
    found = sliding.critical_stiffness
    return 0.0 if found is None else found[0]
