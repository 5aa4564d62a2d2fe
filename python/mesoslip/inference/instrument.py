"""What differs between records of one interface: the level of the forces, and the load cell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mesoslip.array_types import Array
from mesoslip.configuration.config import Config
from mesoslip.inference.prior import FILTER

# Keys of the contacts that are proportional to their number.
EXTENSIVE = ("static_force", "stiffness", "area", "drag")


@dataclass(frozen=True)
class Instrument:
    """The level of a trace, and the load cell that recorded it."""

    level: str
    """Name of the level among the parameters of a fit."""
    level_of: str = "contacts"
    """What the level multiplies: the forces of all ``contacts``, or the force that is a
    ``record``."""
    filter_time: float = 0.0
    """Time constant of the load cell [s], if it is not a parameter; 0 without a filter."""

    def levelled(self, config: Config, parameters: Mapping[str, float]) -> Config:
        """A configuration with forces, stiffness and drag of all contacts multiplied by the level
        of this trace."""
        level = parameters.get(self.level, 1.0)
        if level == 1.0 or self.level_of != "contacts":
            return config
        values = {name: getattr(config.contacts, name) for name in EXTENSIVE}
        return config.replace(
            {f"contacts.{name}": level * one for name, one in values.items() if one}
        )

    def read(self, force: Array, interval: float, parameters: Mapping[str, float]) -> Array:
        """The force [N] as the load cell reads it, at samples of an interval [s]."""
        if self.level_of == "record":
            force = parameters.get(self.level, 1.0) * force
        time = parameters.get(FILTER, self.filter_time)
        return low_pass(force, interval / time) if time > 0 else force


def low_pass(force: Array, step: float) -> Array:
    """A force behind a low-pass filter of first order, exact between samples, by the interval over
    its time constant."""
    from scipy.signal import lfilter

    kept = math.exp(-step)
    part = -math.expm1(-step) / step
    filtered: Array = lfilter([1 - part, part - kept], [1.0, -kept], force, zi=[part * force[0]])[0]
    return filtered
