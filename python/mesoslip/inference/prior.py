"""Priors of a fit: the free keys of a configuration and their ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from mesoslip.array_types import Array

# Name of the amplitude of a slow variation of the strength along the track, relative to the maximum
# force (`mesoslip.inference.wander`), and of the time constant of the load cell [s].
WANDER, FILTER = "fit.wander", "fit.filter"
# Name of the level of a trace, a factor on its forces; of several traces with a number.
LEVEL = "fit.level"
# End of the range of a normal prior, in standard deviations.
NORMAL_RANGE = 3.0
TAIL = NormalDist().cdf(-NORMAL_RANGE)


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
    width: float = 0.0
    """Standard deviation of the logarithm of a factor, normal within its range; 0 for others."""

    @property
    def is_nuisance(self) -> bool:
        """Whether the key is not part of a configuration."""
        return self.key.startswith("fit.")

    def value(self, quantile: Array) -> Array:
        """The parameter in SI at quantiles of its prior."""
        if self.width:
            from scipy.special import ndtri

            return np.asarray(np.exp(self.width * ndtri(TAIL + (1 - 2 * TAIL) * quantile)))
        if self.is_logarithmic:
            value = self.low * (self.high / self.low) ** quantile
        else:
            value = self.low + (self.high - self.low) * quantile
        return np.round(value) if self.is_whole else value

    def quantile(self, value: Array) -> Array:
        """Quantiles of the prior at values in SI."""
        if self.width:
            from scipy.special import ndtr

            return np.asarray((ndtr(np.log(value) / self.width) - TAIL) / (1 - 2 * TAIL))
        if self.is_logarithmic:
            return np.asarray(np.log(value / self.low) / np.log(self.high / self.low))
        return np.asarray((value - self.low) / (self.high - self.low))


def level_parameter(width: float, name: str) -> FreeParameter:
    """The level of a trace, by the standard deviation of its logarithm."""
    end = math.exp(NORMAL_RANGE * width)
    return FreeParameter(name, 1 / end, end, is_logarithmic=True, width=width)


def level_name(number: int, count: int) -> str:
    """Name of the level of a trace, by its number from 0 and the number of traces."""
    return f"{LEVEL}.{number + 1}" if count > 1 else LEVEL


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
        columns = np.moveaxis(np.asarray(unit), -1, 0)
        return np.stack(
            [one.value(column) for one, column in zip(self.free, columns, strict=True)], axis=-1
        )

    def unit(self, values: Array) -> Array:
        """Points of the unit cube for parameters in SI, shape (..., parameters)."""
        columns = np.moveaxis(np.asarray(values), -1, 0)
        return np.stack(
            [one.quantile(column) for one, column in zip(self.free, columns, strict=True)], axis=-1
        )

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
