"""The plan of a fit: the table [fit] of a configuration file."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import check_changes
from mesoslip.configuration.files import Change, Merged, on_base, override, read_toml, undotted
from mesoslip.configuration.keys import key_kind, nearest_keys
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, Problem
from mesoslip.inference.prior import (
    FILTER,
    LEVEL,
    WANDER,
    FreeParameter,
    Prior,
    level_name,
    level_parameter,
)

KEYS = (
    *("free", "noise", "after", "simulations", "predictions", "seed", "simulated_contacts"),
    *("wander", "level", "filter", "shared_track"),
)
RANGE_KEYS = ("from", "to", "prior")
# Range of the amplitude of a slow variation of the strength, relative to the maximum force.
WANDER_RANGE = (2e-3, 0.5)
# What a level multiplies: the forces of all contacts, or the force that is recorded; and default
# standard deviation of its logarithm, and the maximum one.
LEVELS = ("contacts", "record")
LEVEL_WIDTH, MAX_LEVEL_WIDTH = 0.2, 1.0
# Tables that do not describe the experiment.
NOT_FITTED = ("run.", "output.", "curve.")
PRIORS = ("uniform", "logarithmic")
MIN_SIMULATIONS = 300
# Number of predicted traces of a fit, a smaller one if most simulations have fewer contacts than
# these, and minimum: fewer cannot reject a model.
PREDICTIONS, FEW_PREDICTIONS, MIN_PREDICTIONS = 160, 100, 50
MIN_CONTACTS = 100
# Kinds of sliders with a mass, and with a spring.
HAS_MASS = ("rigid", "layered")
HAS_SPRING = ("rigid", "layered", "quasistatic")
# Range of a mass that is not given, around that of the period of the slips.
MASS_FACTOR = 4.0


@dataclass(frozen=True)
class Plan:
    config: Config
    """The known parameters; its values of the free keys are not used."""
    prior: Prior
    """The free parameters."""
    noise: float | None = None
    """Standard deviation of the noise of the force [N]; estimated by default."""
    after: float = 0.0
    """Time from which the trace is used [s]; at 0 the first loading and slip are used too."""
    after_distance: float = 0.0
    """Displacement of the drive from which the trace is used instead [m], if it is above 0."""
    simulations: int = 1600
    """Number of simulations."""
    seed: int = 1
    """Seed of all random numbers of the fit."""
    simulated_contacts: int = 4000
    """Number of contacts in most simulations, if the interface has at least twice as many."""
    has_several: bool = False
    """Whether several traces are fitted, each with its own drive and spring."""
    assumed: tuple[str, ...] = ()
    """Assumptions beyond the configuration, a sentence each."""
    level_width: float = 0.0
    """Standard deviation of the logarithm of the level of each trace; 0 without levels."""
    level_of: str = LEVELS[0]
    """What a level multiplies, one of `LEVELS`."""
    filter_time: float = 0.0
    """Time constant of the load cell [s], if it is known; 0 without a filter."""
    predictions: int | None = None
    """Number of predicted traces, if it is given."""
    shares_track: bool = False
    """Whether all traces have the same track, from its start on."""

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        overrides: Iterable[Change] = (),
        known: Known | None = None,
    ) -> Plan:
        """Read a configuration file with a table [fit], completed by the apparatus of the
        traces."""
        path, overrides = Path(path), list(overrides)
        merged = read_toml(path)
        tables = override(_nested(merged), overrides).tables
        plan = cls._checked(tables, str(path), known, merged.base)
        setters = {one.key: "the table [fit.free]" for one in plan.prior.free}
        check_changes(overrides, setters, str(path))
        return plan

    @classmethod
    def from_dict(
        cls,
        tables: Mapping[str, Any],
        source: str = "configuration",
        known: Known | None = None,
    ) -> Plan:
        """The plan in nested tables; see `load`."""
        merged = on_base(tables, source, Path())
        return cls._checked(merged.tables, source, known, merged.base)

    @classmethod
    def _checked(
        cls,
        tables: Mapping[str, Any],
        source: str,
        known: Known | None,
        base: Mapping[str, Any] | None = None,
    ) -> Plan:
        tables = {
            name: dict(one) if isinstance(one, Mapping) else one for name, one in tables.items()
        }
        table = tables.pop("fit", None)
        if table is None:
            Config.from_dict(tables, source)
            raise ConfigError(
                [Problem(source, "fit", "missing; name the free keys in a table [fit.free]")]
            )
        if not isinstance(table, Mapping):
            raise ConfigError([Problem(source, "fit", "must be a table", table)])
        reader = _Reader(source)
        for key in table:
            if key not in KEYS:
                reader.unknown(f"fit.{key}", key, KEYS)
        free = list(reader.free(table.get("free")))
        assumed: list[str] = []
        if known is not None:
            assumed = known.complete(tables, free)
        for one in free:
            _place(tables, one)
        if base is not None and base.get("title") == tables.get("title"):
            # A title of the base is not that of the traces.
            tables.pop("title", None)
        config = Config.from_dict(tables, source)
        for one in free:
            reader.check_range(one, config)
        if reader.flag(table, "wander"):
            free.append(FreeParameter(WANDER, *WANDER_RANGE, is_logarithmic=True))
        filter_time = reader.filter(table, free)
        level_width, level_of = reader.level(table)
        after = reader.after(table)
        shares_track = reader.flag(table, "shared_track")
        if shares_track and not config.contacts.place_keys:
            reader.wrong("fit.shared_track", "there is no [contacts.track]", value=True)
        plan = cls(
            config,
            Prior(tuple(free)),
            reader.quantity(table, "noise", "N", "0.1 uN"),
            *after,
            reader.whole(table, "simulations", cls.simulations, MIN_SIMULATIONS),
            reader.whole(table, "seed", cls.seed, 0),
            reader.whole(table, "simulated_contacts", cls.simulated_contacts, MIN_CONTACTS),
            assumed=tuple(assumed),
            level_width=level_width,
            level_of=level_of,
            filter_time=filter_time,
            predictions=(
                reader.whole(table, "predictions", PREDICTIONS, MIN_PREDICTIONS)
                if "predictions" in table
                else None
            ),
            shares_track=shares_track,
        )
        if reader.problems:
            raise ConfigError(reader.problems)
        return plan

    def of_traces(self, count: int) -> Plan:
        """The plan for a number of traces, with a level of each."""
        free = self.prior.free
        if self.level_width and not any(one.key.startswith(LEVEL) for one in free):
            names = [level_name(number, count) for number in range(count)]
            free += tuple(level_parameter(self.level_width, one) for one in names)
        return replace(self, prior=Prior(free), has_several=count > 1)

    @property
    def prediction_count(self) -> int:
        """Number of predicted traces."""
        return self.predictions or (FEW_PREDICTIONS if self.coarse_count else PREDICTIONS)

    @property
    def coarse_count(self) -> int | None:
        """Number of contacts of most simulations; None if all have that of the interface."""
        contacts = self.config.contacts
        if "contacts.count" in self.prior.keys or self.config.contact_kind.on_lattice:
            return None
        return self.simulated_contacts if contacts.count >= 2 * self.simulated_contacts else None


def _nested(merged: Merged) -> Merged:
    """Tables with free keys as nested ones, as changes of them are."""
    table = merged.tables.get("fit")
    if not isinstance(table, Mapping) or not isinstance(table.get("free"), Mapping):
        return merged
    free = undotted(table["free"])
    return replace(merged, tables={**merged.tables, "fit": {**table, "free": free}})


def _place(tables: dict[str, Any], one: FreeParameter) -> None:
    """Give a free key a value in its range, where it has none."""
    *outer, last = one.key.split(".")
    table: Any = tables
    for name in outer:
        inner = table.get(name, {})
        if not isinstance(inner, Mapping):
            return
        table[name] = dict(inner)
        table = table[name]
    excluded = {"damping": "damping_ratio", "damping_ratio": "damping"}.get(last)
    if last not in table and excluded not in table:
        middle = math.sqrt(one.low * one.high) if one.is_logarithmic else (one.low + one.high) / 2
        table[last] = round(middle) if one.is_whole else middle


@dataclass(frozen=True)
class Known:
    """Properties of the apparatus according to the traces, in SI; NaN if unknown."""

    velocity: float
    stiffness: float
    period: float
    """Period of the setup as estimated from the slips; infinite if unknown."""
    duration: float

    def complete(self, tables: dict[str, Any], free: list[FreeParameter]) -> list[str]:
        """Add missing keys of the apparatus to a configuration, or a free mass around that of the
        slips' period; returns the assumptions."""
        names = {one.key for one in free}
        drive = tables.setdefault("drive", {})
        slider = tables.setdefault("slider", {})
        tables.setdefault("run", {})
        if not drive and math.isfinite(self.velocity):
            drive["velocity"] = self.velocity
        if "velocity" in drive and not {"duration", "drive_displacement"} & set(tables["run"]):
            tables["run"] = {**tables["run"], "duration": self.duration}
        kind = slider.get("kind", "rigid")
        if (
            "stiffness" not in slider
            and "slider.stiffness" not in names
            and kind in HAS_SPRING
            and math.isfinite(self.stiffness)
        ):
            slider["stiffness"] = self.stiffness
        if "mass" in slider or "slider.mass" in names or kind not in HAS_MASS:
            return []
        try:
            stiffness = to_si(slider.get("stiffness", self.stiffness), "N/m", "97 N/m")
        except ValueError:
            # The stiffness is reported with the other errors of the configuration.
            return []
        if not math.isfinite(self.period * stiffness):
            return []
        mass = stiffness * (self.period / (2 * math.pi)) ** 2
        free.append(
            FreeParameter("slider.mass", mass / MASS_FACTOR, mass * MASS_FACTOR, True, "kg")
        )
        return [
            f"the mass is not given: slider.mass is fitted between {mass / MASS_FACTOR:.2g} and "
            f"{mass * MASS_FACTOR:.2g} kg, from the duration of the slips"
        ]


class _Reader:
    """Reads the table, and collects all errors in it."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.problems: list[Problem] = []

    def wrong(self, key: str, message: str, value: object = None) -> None:
        self.problems.append(Problem(self.source, key, message, value))

    def unknown(self, key: str, name: str, known: Iterable[str]) -> None:
        near = difflib.get_close_matches(name, known, 1)
        self.wrong(key, f"unknown key; did you mean {near[0]!r}?" if near else "unknown key")

    def quantity(
        self, table: Mapping[str, Any], name: str, unit: str, example: str
    ) -> float | None:
        """A quantity that is not negative, if it is given."""
        if name not in table:
            return None
        value = self._si(f"fit.{name}", table[name], unit, example)
        if value is not None and value < 0:
            self.wrong(f"fit.{name}", "must not be negative", table[name])
        return value

    def whole(self, table: Mapping[str, Any], name: str, default: int, minimum: int) -> int:
        value = table.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value < 2**31:
            self.wrong(f"fit.{name}", f"must be a whole number of at least {minimum}", value)
            return default
        return value

    def after(self, table: Mapping[str, Any]) -> tuple[float, float]:
        """The time or the displacement of the drive from which traces are used."""
        value = table.get("after")
        if isinstance(value, str):
            try:
                length = to_si(value, "m", "50 um")
            except ValueError:
                pass
            else:
                self.quantity({"after": length}, "after", "m", "50 um")
                return 0.0, length
        return self.quantity(table, "after", "s", "2 s' or '50 um") or 0.0, 0.0

    def filter(self, table: Mapping[str, Any], free: list[FreeParameter]) -> float:
        """The time constant of the load cell, if it is known; a free one becomes a parameter."""
        given = table.get("filter")
        if not isinstance(given, Mapping):
            return self.quantity(table, "filter", "s", "2 ms") or 0.0
        found = self._range(FILTER, FILTER, given, "s")
        if found is not None and found.low < 0:
            self.wrong(f"{FILTER}.from", "must not be negative", given["from"])
        if found is not None:
            free.append(found)
        return 0.0

    def level(self, table: Mapping[str, Any]) -> tuple[float, str]:
        """Width of the prior of the levels, and what they multiply."""
        given = table.get("level", False)
        if not isinstance(given, Mapping):
            return LEVEL_WIDTH if self.flag(table, "level") else 0.0, LEVELS[0]
        for name in given:
            if name not in {"width", "of"}:
                self.unknown(f"{LEVEL}.{name}", name, ("width", "of"))
        width = given.get("width", LEVEL_WIDTH)
        is_number = isinstance(width, int | float) and not isinstance(width, bool)
        if not is_number or not 0 < width <= MAX_LEVEL_WIDTH:
            message = f"must be a number above 0, at most {MAX_LEVEL_WIDTH:g}"
            self.wrong(f"{LEVEL}.width", message, width)
            width = LEVEL_WIDTH
        what = given.get("of", LEVELS[0])
        if what not in LEVELS:
            self.wrong(f"{LEVEL}.of", "must be 'contacts' or 'record'", what)
        return width, what

    def _si(self, key: str, value: object, unit: str, example: str) -> float | None:
        try:
            return to_si(value, unit, example)
        except ValueError as error:
            self.wrong(key, str(error), value)
            return None

    def flag(self, table: Mapping[str, Any], name: str) -> bool:
        value = table.get(name, False)
        if not isinstance(value, bool):
            self.wrong(f"fit.{name}", "must be true or false", value)
            return False
        return value

    def free(self, table: object) -> Iterable[FreeParameter]:
        if not isinstance(table, Mapping) or not table:
            self.wrong(
                "fit.free",
                'must be a table of free keys, such as "contacts.delay" = '
                '{ from = "0.01 ms", to = "10 ms", prior = "logarithmic" }',
            )
            return
        for key, ranges in _flat(table):
            full_key = f"fit.free.{key}"
            kind = key_kind(key)
            takes_number = kind is not None and kind.cf_units is not None and kind.is_single
            if kind is None or not takes_number or key.startswith(NOT_FITTED):
                near = [one for one in nearest_keys(key) if one != key]
                hint = f"; did you mean {near[0]!r}?" if near else ""
                self.wrong(full_key, f"is no key that can be fitted{hint}")
                continue
            one = self._range(full_key, key, ranges, kind.unit or "1", is_whole=kind.is_whole)
            if one is not None:
                yield one

    def _range(
        self, full_key: str, key: str, ranges: object, unit: str, *, is_whole: bool = False
    ) -> FreeParameter | None:
        if not isinstance(ranges, Mapping):
            self.wrong(full_key, 'must be a table such as { from = "5 uN", to = "100 uN" }', ranges)
            return None
        for name in ranges:
            if name not in RANGE_KEYS:
                self.unknown(f"{full_key}.{name}", name, RANGE_KEYS)
        ends = []
        for name in ("from", "to"):
            if name not in ranges:
                self.wrong(f"{full_key}.{name}", "missing; it has no default")
                return None
            ends.append(self._si(f"{full_key}.{name}", ranges[name], unit, f"1 {unit}".strip(" 1")))
        low, high = ends
        if low is None or high is None:
            return None
        prior = ranges.get("prior", PRIORS[0])
        if prior not in PRIORS:
            self.wrong(f"{full_key}.prior", "must be 'uniform' or 'logarithmic'", prior)
            return None
        if not low < high:
            self.wrong(f"{full_key}.to", "must be greater than 'from'", ranges["to"])
            return None
        if prior == "logarithmic" and low <= 0:
            self.wrong(
                f"{full_key}.from",
                "must be greater than 0 with a logarithmic prior",
                ranges["from"],
            )
            return None
        return FreeParameter(key, low, high, prior == "logarithmic", unit, is_whole)

    def check_range(self, one: FreeParameter, config: Config) -> None:
        """Check that both ends of a range are valid."""
        full_key = f"fit.free.{one.key}"
        for name, value in (("from", one.low), ("to", one.high)):
            try:
                config.replace({one.key: int(value) if one.is_whole else value})
            except ConfigError as error:
                first = error.problems[0]
                self.wrong(
                    f"{full_key}.{name}", f"cannot be run: {first.key}: {first.message}", value
                )


def _flat(table: Mapping[str, Any], outer: str = "") -> Iterable[tuple[str, Any]]:
    """The entries of a table of dotted or nested keys, by dotted key."""
    for key, value in table.items():
        name = f"{outer}{key}"
        is_range = not isinstance(value, Mapping) or any(one in value for one in RANGE_KEYS)
        if is_range or not value:
            yield name, value
        else:
            yield from _flat(value, f"{name}.")
