"""Branches of motions over a parameter as a dataset."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mesoslip.configuration.keys import key_kind
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import BRANCHES

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.cycles.branch import End
    from mesoslip.cycles.cycle import Cycle
    from mesoslip.theory.linear_stability import LinearStability

MOTIONS = ("smooth", "periodic", "irregular")
DIRECTIONS = ("up", "down")


def dataset_of(
    base: Config,
    key: str,
    values: Sequence[float],
    found: Sequence[Sequence[Cycle]],
    sliding: Sequence[LinearStability | None],
    ends: Sequence[End],
) -> xr.Dataset:
    """The branches as a dataset.

    Parameters
    ----------
    base
        The configuration.
    key, values
        The key and its values.
    found
        Settled motions, shape (directions, values).
    sliding
        Steady sliding at each value; None without a theory.
    ends
        Where oscillations end in smooth sliding.
    """
    kind = key_kind(key)
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
        name: BRANCHES.variable(
            name,
            ("direction", key),
            np.array([[value(one) for one in row] for row in found], dtype=BRANCHES[name].dtype),
        )
        for name, value in columns.items()
    }
    data["motion"].attrs["flag_values"] = np.arange(len(MOTIONS), dtype=np.int8)
    for name, numbers in (
        ("steady_force", [math.nan if one is None else one.force for one in sliding]),
        ("growth_rate", [math.nan if one is None else one.growth_rate for one in sliding]),
    ):
        data[name] = BRANCHES.variable(name, (key,), np.array(numbers))
    units = (None if kind is None else kind.cf_units) or "1"
    coordinate = xr.Variable((key,), np.array(values, dtype=float), {"units": units})
    if ends:
        data |= _end_variables(ends, units)
    attrs = program_attributes(base, "branches") | {"continued_key": key}
    return xr.Dataset(
        data,
        coords={key: coordinate, "direction": ("direction", list(DIRECTIONS))},
        attrs=attrs,
    )


def _end_variables(ends: Sequence[End], units: str) -> dict[str, xr.Variable]:
    """Where oscillations end, dimension ``end``; units are those of the key."""
    columns: dict[str, list[float]] = {
        "end_value": [one.value for one in ends],
        "end_beyond": [one.beyond for one in ends],
        "end_amplitude_ratio": [one.amplitude_ratio for one in ends],
        "end_direction": [one.direction for one in ends],
        "end_motion": [MOTIONS.index(one.motion) for one in ends],
    }
    data = {
        name: BRANCHES.variable(name, ("end",), np.array(values, dtype=BRANCHES[name].dtype))
        for name, values in columns.items()
    }
    for name in ("end_value", "end_beyond"):
        data[name].attrs["units"] = units
    for name, words in (("end_direction", DIRECTIONS), ("end_motion", MOTIONS)):
        data[name].attrs["flag_values"] = np.arange(len(words), dtype=np.int8)
    return data
