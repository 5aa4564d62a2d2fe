"""Priors of a fit: the free keys of a configuration and their ranges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Name of the amplitude of a slow variation of the strength along the track, relative to the maximum
# force (`mesoslip.inference.wander`).
WANDER = "fit.wander"


@dataclass(frozen=True)
class FreeParameter:
    """A free parameter: a dotted key of a configuration, and its range in SI."""

    key: str
    low: float
    high: float
    is_logarithmic: bool = False
    """Whether the prior is uniform in the logarithm."""
    unit: str = "1"
    is_whole: bool = False
    """Whether the parameter is a whole number."""
    is_nuisance: bool = False
    """Whether the key is not part of a configuration."""


@dataclass(frozen=True)
class Prior:
    """Independent priors of the free parameters, uniform on the unit cube of their quantiles."""

    free: tuple[FreeParameter, ...]

    def __len__(self) -> int:
        return len(self.free)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(one.key for one in self.free)

    def values(self, unit: Array) -> Array:
        """Parameters in SI at points of the unit cube, shape (..., parameters)."""
        columns = []
        for one, quantile in zip(self.free, np.moveaxis(np.asarray(unit), -1, 0), strict=True):
            if one.is_logarithmic:
                value = one.low * (one.high / one.low) ** quantile
            else:
                value = one.low + (one.high - one.low) * quantile
            columns.append(np.round(value) if one.is_whole else value)
        return np.stack(columns, axis=-1)

    def unit(self, values: Array) -> Array:
        """Points of the unit cube for parameters in SI, shape (..., parameters)."""
        columns = []
        for one, value in zip(self.free, np.moveaxis(np.asarray(values), -1, 0), strict=True):
            if one.is_logarithmic:
                columns.append(np.log(value / one.low) / np.log(one.high / one.low))
            else:
                columns.append((value - one.low) / (one.high - one.low))
        return np.stack(columns, axis=-1)

    def changes(self, values: Array) -> dict[str, Any]:
        """Changes of the configuration that set the parameters."""
        return {
            one.key: int(value) if one.is_whole else float(value)
            for one, value in zip(self.free, values, strict=True)
            if not one.is_nuisance
        }

    def nuisances(self, values: Array) -> dict[str, float]:
        """Values of the parameters that are not keys of the configuration."""
        return {
            one.key: float(value)
            for one, value in zip(self.free, values, strict=True)
            if one.is_nuisance
        }
