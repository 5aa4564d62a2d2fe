"""Velocity, spring, level and load cell of each trace of one interface, known or free."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mesoslip.array_types import Array, DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.prior import FILTER
from mesoslip.quantities import with_unit

# The keys of an apparatus. Other keys of a simulated trace are not compared: a measured trace does
# not have them.
KEYS = ("drive.velocity", "slider.stiffness")
# Maximum relative difference between a trace and its configuration.
MAX_DIFFERENCE = 0.01


@dataclass(frozen=True)
class Apparatus:
    """The apparatus of a trace, in relation to the free keys of a fit."""

    declared: Mapping[str, float]
    """The values of `KEYS` that the trace declares."""
    ratios: Mapping[str, float] = field(default_factory=dict)
    """The value of this trace over that of the fit, of free keys that are not the same."""
    known: frozenset[str] = frozenset()
    """Free keys whose values of this trace are the declared ones, not those of the fit."""

    def values(self, changes: Mapping[str, float]) -> dict[str, float]:
        """The values of the free keys for this trace."""
        return {
            key: value * self.ratios[key] if key in self.ratios else value
            for key, value in changes.items()
            if key not in self.known
        }


def declared_values(tree: DataTree) -> dict[str, float]:
    """The values of `KEYS` that a trace declares, in SI."""
    tables = tomllib.loads(tree.attrs["configuration"])
    found = {}
    for key in KEYS:
        table, name = key.split(".")
        value, kind = tables.get(table, {}).get(name), key_kind(key)
        if value is not None and kind is not None:
            found[key] = to_si(value, kind.unit or "1", "")
    return found


def own_config(declared: Mapping[str, float], plan: Plan) -> Config:
    """The configuration with the apparatus of a trace, which a single trace must not contradict."""
    problems, own = [], {}
    for key, value in declared.items():
        table, name = key.split(".")
        given = getattr(getattr(plan.config, table), name, None)
        if given is None:
            continue
        if plan.has_several:
            own[key] = value
            continue
        is_free = key in plan.prior.keys
        if not is_free and abs(value - given) > MAX_DIFFERENCE * abs(value):
            message = f"is {value:g} in the trace; change it, or make it free in [fit.free]"
            problems.append(Problem("configuration", key, message, given))
    if problems:
        raise ConfigError(problems)
    return plan.config.replace(own) if own else plan.config


def of_several(
    names: Sequence[str], declared: Sequence[Mapping[str, float]], free: Sequence[str]
) -> list[Apparatus]:
    """The apparatus of each trace of a fit.

    A free key is that of the first trace. Where traces declare other values, those of the others
    are in the ratio of the declared ones: one error of calibration is common to all.
    """
    ratios: list[dict[str, float]] = [{} for _ in declared]
    for key in KEYS:
        values = [one.get(key) for one in declared]
        given = [one for one in values if one is not None]
        if key not in free or all(_is_same(one, given[0]) for one in given):
            continue
        if len(given) < len(values):
            missing = names[values.index(None)]
            raise FileError(
                f"{missing}: has no {key}, and the other traces have different ones: give it to "
                f"mesoslip trace, or take {key} out of [fit.free]"
            )
        for one, value in zip(ratios[1:], given[1:], strict=True):
            one[key] = value / given[0]
    return [Apparatus(one, ratio) for one, ratio in zip(declared, ratios, strict=True)]


def of_predicted(
    declared: Mapping[str, float], fitted: Mapping[str, float], free: Sequence[str]
) -> Apparatus:
    """The apparatus of a predicted trace, with the values that the first fitted trace declares."""
    ratios, known = {}, set()
    for key in set(free) & declared.keys():
        if key not in fitted:
            known.add(key)
        elif not _is_same(declared[key], fitted[key]):
            ratios[key] = declared[key] / fitted[key]
    return Apparatus(declared, ratios, frozenset(known))


def sentences(names: Sequence[str], apparatus: Sequence[Apparatus]) -> list[str]:
    """The meaning of free keys that differ between the traces of a fit, a sentence for each."""
    found = []
    for key in KEYS:
        others = [
            f"{one.ratios[key]:.4g} times that in {name}"
            for name, one in zip(names, apparatus, strict=True)
            if key in one.ratios
        ]
        if others:
            found.append(f"{key} is that of {names[0]}, and {', '.join(others)}, as declared")
    return found


def predicted_sentences(one: Apparatus) -> list[str]:
    """The values of free keys in a prediction, a sentence for each."""
    found = []
    for key in KEYS:
        kind = key_kind(key)
        if kind is None or key not in one.declared:
            continue
        declared = with_unit(one.declared[key], kind.unit or "1", 4)
        if key in one.known:
            found.append(f"{key} is the {declared} that the trace declares, not that of the fit")
        elif key in one.ratios:
            found.append(
                f"{key} is {one.ratios[key]:.4g} times that of the fit: the trace declares "
                f"{declared}"
            )
    return found


def _is_same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-9 * abs(other)


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
