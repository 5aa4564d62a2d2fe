"""The configuration of a run: checked, in SI units. All its errors are reported at once."""

from __future__ import annotations

import functools
import html
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from mesoslip.configuration import arguments, checks
from mesoslip.configuration.contacts import contact_kind, is_in_both_engines
from mesoslip.configuration.contacts.base import COMMON_KEYS, ContactKind, given_keys
from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.drive import Drive, DrivePart
from mesoslip.configuration.files import (
    Change,
    Merged,
    check_no_files,
    on_base,
    override,
    parse_toml,
    read_toml,
)
from mesoslip.configuration.load import UNLOADED, Load
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.run_tables import Curve, Output, Run
from mesoslip.configuration.sliders import Slider
from mesoslip.configuration.table import Complaint, Table, Text
from mesoslip.errors import ConfigError, Problem
from mesoslip.quantities import with_unit

# Default number of finer samples in a period of the ringing on the pinned contacts, and in a delay.
SAMPLES_IN_RINGING = 50
SAMPLES_IN_DELAY = 5
# Default maximum number of samples in all slips together, unless the trace has more.
SAMPLES_IN_SLIPS = 20_000
# Tables and keys that do not describe contacts; all others have to be answered by their kind.
OTHER_TABLES = frozenset({"title", "run", "drive", "slider", "contacts", "output", "curve"})


@contextmanager
def _problems_of(source: str) -> Iterator[None]:
    """Raise the errors that pydantic finds as a `ConfigError` that names the source."""
    try:
        yield
    except ValidationError as error:
        raise ConfigError(problems(error, source, Config)) from None


class Config(Table):
    """A whole configuration: frozen tables of keys, as attributes, with quantities in SI.

    `load`, `from_dict` and `from_toml` read and check it; `replace` changes keys.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> config = mesoslip.Config.load(path, ["contacts.delay=1ms"])
    >>> stiffer = config.replace("slider.stiffness=200 N/m", contacts={"count": 500})
    >>> stiffer.contacts.delay, stiffer.spring_stiffness  # SI
    (0.001, 200.0)
    >>> mesoslip.Config.from_dict(stiffer.to_dict()) == stiffer
    True
    """

    title: Text | None = None
    """Title of the run, for pictures and reports."""
    run: Run
    drive: Drive
    slider: Slider
    contacts: Contacts
    interaction: Interaction | None = None
    # The method of that name reads a file.
    normal_load: Annotated[Load | None, Field(alias="load")] = None
    output: Output = Output()
    curve: Curve = Curve()

    # The tables that the configuration changes, if it is based on others.
    _base: Mapping[str, Any] | None = PrivateAttr(default=None)
    # Keys that were dropped because the new kind of slider does not have them.
    _dropped: tuple[str, ...] = PrivateAttr(default=())

    def __init__(self, **tables: Any) -> None:
        """Check a configuration given as its tables; see `from_dict`."""
        with _problems_of("configuration"):
            super().__init__(**tables)

    # Without this mark of pydantic, validation would call the initializer.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Check a configuration given as its tables, as pydantic does; see `from_dict`."""
        with _problems_of("configuration"):
            return super().model_validate(obj, **options)

    def __eq__(self, other: object) -> bool:
        """Whether both describe the same run; their bases are not compared."""
        # Cached properties are in the dictionaries of both too.
        return isinstance(other, Config) and self._tables == other._tables

    @property
    def base(self) -> Config | None:
        """The configuration that this one changes, if it is a valid one by itself.

        It is the file named by ``base``; without one, the configuration before the changes.
        """
        if self._base is None:
            return None
        try:
            return self.model_validate(self._base)
        except ConfigError:
            return None

    @arguments.checked(change=arguments.function)
    def adapted(self, change: Callable[[Config], Config]) -> Config:
        """The configuration after a change by the program, which its base has too.

        So both differ in what the user has changed.
        """
        made, base = change(self), self.base
        made._base = None
        if base is not None:
            # The base by itself may not allow the change.
            with suppress(ConfigError):
                made._base = change(base).to_dict()
        return made

    @property
    def dropped(self) -> tuple[str, ...]:
        """Dotted keys that a change of the kind of slider has dropped."""
        return self._dropped

    @model_validator(mode="after")
    def _tables_agree(self) -> Self:
        """Check the tables together, after each of them alone."""
        complaints = self._complaints()
        if complaints:
            raise PydanticCustomError(
                "tables",
                "{message}",
                {
                    "message": "; ".join(f"{one.key}: {one.message}" for one in complaints),
                    "complaints": complaints,
                },
            )
        return self

    def _complaints(self) -> list[Complaint]:
        complaints = [
            *checks.drive_problems(self),
            *self.slider.problems(self),
            *self.pressing.block_problems(
                self.contact_kind.site_count(self.contacts), self.slider.block_count
            ),
            *self.contact_kind.problems(self, self.given_contact_keys),
            *checks.curve_problems(self),
        ]
        # Intervals are compared with the duration, which needs a valid drive.
        return complaints or [*checks.output_problems(self)]

    @cached_property
    def given_contact_keys(self) -> frozenset[str]:
        """Keys of [contacts] that differ from their defaults, and tables that act on contacts."""
        return given_keys(
            self.contacts,
            {key: one for key, one in self._tables.items() if key not in OTHER_TABLES},
        )

    @property
    def contact_features(self) -> dict[str, Any]:
        """Values of the given keys and tables that not all kinds of contacts answer, by key."""
        keys = sorted(self.given_contact_keys - COMMON_KEYS)
        paths = ((key, key.split(".")) for key in keys)
        return {
            key: functools.reduce(getattr, path[1:], self._tables[path[0]]) for key, path in paths
        }

    @property
    def _tables(self) -> dict[str, Any]:
        """Values of all fields by their keys."""
        fields = type(self).model_fields.items()
        return {field.alias or name: getattr(self, name) for name, field in fields}

    @cached_property
    def contact_kind(self) -> ContactKind:
        return contact_kind(
            self.run.engine, self.given_contact_keys, self.interaction, self.pressing
        )

    @property
    def has_master_equation(self) -> bool:
        """Whether the same contacts can be followed one by one and for N → ∞."""
        return is_in_both_engines(self.given_contact_keys)

    @property
    def curve_length(self) -> float:
        """Length of the force curve [m]; 20 mean breaking stretches unless given."""
        return self.curve.length or 20 * self.contacts.break_stretch

    @cached_property
    def duration(self) -> float:
        """Duration of the run [s]; infinite if only avalanches end it."""
        if self.run.duration is not None:
            # The end of a cycle or a history ends the run.
            limit = math.inf if self.drive.continues else self.drive.length
            return min(self.run.duration, limit)
        if self.run.drive_displacement is not None:
            return self.drive.time_for(self.run.drive_displacement)
        return self.drive.length

    @property
    def expected_duration(self) -> float:
        """Duration of the run [s], estimated if only avalanches end it."""
        if math.isfinite(self.duration):
            return self.duration
        contacts = self.contacts
        if self.drive.force_rate is not None:
            return contacts.static_force / abs(self.drive.force_rate)
        if self.drive.is_force:
            return math.inf
        stiffness = self.spring_stiffness
        stretch = contacts.break_stretch
        loading = stretch + contacts.static_force / stiffness
        # An avalanche has 1 + Nk/K breaks on average, so that the slider keeps up with the drive.
        sliding = (self.run.avalanches or 0) * stretch / contacts.count
        sliding *= 1 + contacts.stiffness / stiffness
        return (loading + sliding) / abs(self.drive.velocity or math.nan)

    @property
    def steady_block(self) -> float:
        """Distance of the drive in a block of the criterion for a steady state [m], by default that
        which loads spring and contacts to the static force; 0 without the criterion."""
        steady = self.run.stops.steady
        if steady is None:
            return 0.0
        loading = self.contacts.break_stretch + self.contacts.static_force / self.spring_stiffness
        return steady.displacement or loading

    @property
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one driven by a force."""
        return self.slider.spring_stiffness

    @property
    def series_stiffness(self) -> float:
        """K in series with the spring of a base [N/m], to be compared with K*."""
        return self.slider.series_stiffness

    @property
    def has_avalanches(self) -> bool:
        """Whether avalanches are recorded: a break may trigger others at once."""
        return self.contact_kind.on_lattice or self.slider.jumps

    @property
    def drive_speed(self) -> float:
        """Speed of the first stage in which the drive moves [m/s], 0 if there is none; the maximum
        of a ramp, the mean of a measured history."""
        if self.drive.is_force:
            return 0.0
        if self.drive.history is not None:
            return math.fsum(part.path_length for part in self.drive_parts) / self.duration
        return next((part.max_speed for part in self.drive_parts if part.path_length > 0), 0.0)

    @cached_property
    def drive_parts(self) -> tuple[DrivePart, ...]:
        """Parts of the drive until the end of the run."""
        return self.drive.until(self.duration)

    @property
    def unreached_drive(self) -> str | None:
        """A message if the run ends before the end of a finite drive; otherwise None."""
        length = self.drive.length
        # The sum of the stages has rounding errors.
        if not self.duration < (1 - 1e-9) * length < math.inf:
            return None
        stages, reached = self.drive.parts[-1].stage + 1, self.drive_parts[-1].stage + 1
        given = "duration" if self.run.duration is not None else "drive_displacement"
        where = f", in stage {reached} of {stages}" if stages > 1 else ""
        return (
            f"run.{given} ends the run after {with_unit(self.duration, 's')} of a drive of "
            f"{with_unit(length, 's')}{where}"
        )

    @property
    def continued_drive(self) -> str | None:
        """A message if the last stage continues beyond its end; otherwise None."""
        length = self.drive.length
        # Durations of stages may be rounded in the file.
        if not self.drive.parts or not 1.01 * length < self.duration < math.inf:
            return None
        given = "duration" if self.run.duration is not None else "drive_displacement"
        return (
            f"the stages end after {with_unit(length, 's')}: the last one continues for another "
            f"{with_unit(self.duration - length, 's')}, until run.{given}"
        )

    @property
    def pressing(self) -> Load:
        """The normal load, also where none is given."""
        return self.normal_load or UNLOADED

    @cached_property
    def block_shares(self) -> NDArray[np.float64]:
        """Contacts, strength and normal force of each block of the slider over their mean."""
        sites, blocks = self.contact_kind.site_count(self.contacts), self.slider.block_count
        return self.pressing.block_counts(sites, blocks) / (sites / max(blocks, 1))

    @property
    def block_strengths(self) -> NDArray[np.float64]:
        """Static force of each block at the reference load [N]."""
        return self.contacts.static_force / max(self.slider.block_count, 1) * self.block_shares

    @property
    def notes(self) -> list[str]:
        """Messages about a load that ends before the run, or separates all contacts, and about a
        slider whose keys may not be meant so."""
        return [*self.pressing.notes(self.duration), *self.slider.notes(self)]

    @property
    def unreachable_stop(self) -> str | None:
        """A message if drive and contacts cannot move the slider to the displacement that should
        end the run; otherwise None."""
        target = self.run.stops.displacement
        if target is None or self.drive.force_rate is not None or not self.spring_stiffness:
            return None
        reached = self._drive_reach(math.copysign(1, target))
        # A slip overshoots the equilibrium of the spring by at most the stretch of the spring.
        overshoot = self.contacts.static_force / self.spring_stiffness
        if not reached + overshoot < abs(target):
            return None
        moves = f"moves {with_unit(reached, 'm')}" if reached else "does not move"
        return (
            f"run.stop.displacement = {with_unit(target, 'm')} is out of reach: the drive {moves} "
            "in this direction in the run"
        )

    def _drive_reach(self, direction: float) -> float:
        """Largest displacement of the drive in a direction, 1 or -1 [m]."""
        reach = place = 0.0
        for part in self.drive_parts:
            farthest, end = part.displacements(direction)
            reach, place = max(reach, place + farthest), place + end
        return reach

    @property
    def output_interval(self) -> float:
        """Interval of the trace [s]; a ten-thousandth of the run unless given."""
        return self.output.interval or self.expected_duration / 10000

    @property
    def slip_interval(self) -> float | None:
        """Interval of the finer traces of slips [s]; None if there are none."""
        given, interval = self.output.slip_interval, self.output_interval
        if self.slider.slip_velocity(self) == 0 or given == 0:
            return None
        if given is not None:
            return given
        fine = self.slider.ringing_period(self) / SAMPLES_IN_RINGING
        if self.contacts.delay > 0:
            fine = min(fine, self.contacts.delay / SAMPLES_IN_DELAY)
        samples = max(self.expected_duration / interval, SAMPLES_IN_SLIPS)
        fine = max(fine, self.slider.time_in_slips(self) / samples)
        return fine if fine < interval else None

    @classmethod
    @arguments.checked(overrides=arguments.changes)
    def load(cls, path: PathLike, overrides: Iterable[Change] = ()) -> Config:
        """Read a TOML file and its base, apply changes, and check the result.

        Parameters
        ----------
        path
            The file.
        overrides
            Changes such as "contacts.delay=1ms".

        Raises
        ------
        FileError
            If a file cannot be read.
        ConfigError
            If anything in it is wrong.
        """
        path, overrides = as_path(path), tuple(overrides)
        merged = read_toml(path)
        base = merged.base or (merged.tables if overrides else None)
        return cls._checked(override(merged, overrides), str(path), base)

    @classmethod
    @arguments.checked(tables=arguments.table, source=arguments.text)
    def from_dict(cls, tables: Mapping[str, Any], source: str = "configuration") -> Config:
        """Check a configuration given as nested tables; their ``base`` may name a file under them.

        Raises
        ------
        FileError
            If the file cannot be read.
        ConfigError
            If anything in it is wrong.
        """
        return cls._checked(on_base(tables, source, Path()), source)

    @classmethod
    @arguments.checked(
        text=arguments.text,
        source=arguments.text,
        overrides=arguments.changes,
        base=arguments.text,
    )
    def from_toml(
        cls,
        text: str,
        source: str = "configuration",
        overrides: Iterable[Change] = (),
        base: str | None = None,
    ) -> Config:
        """Check a configuration given as the text of a TOML file, with changes applied.

        ``base`` is the text of the configuration that it is based on, if there are no changes.
        Both are of an output and must not name files; changes may.
        """
        if text.endswith(".toml") and "\n" not in text:
            message = "is the name of a file, which Config.load reads, not a text in TOML"
            raise ConfigError([Problem(source, "", message)])
        tables, overrides = parse_toml(text, source), tuple(overrides)
        below = None if base is None else parse_toml(base, source)
        for one in (tables, below or {}):
            check_no_files(one, source)
        merged = override(Merged(tables), overrides)
        return cls._checked(merged, source, tables if overrides else below)

    @classmethod
    def _checked(cls, merged: Merged, source: str, base: Mapping[str, Any] | None = None) -> Config:
        with _problems_of(source):
            config = super().model_validate(merged.tables)
        config._base, config._dropped = base, tuple(merged.dropped)
        return config

    @arguments.checked(changes=arguments.changes)
    def replace(self, *changes: Change, **tables: Any) -> Config:
        """A configuration with changes, checked like any other.

        Parameters
        ----------
        changes
            Texts such as "contacts.delay=1ms", or tables such as {"contacts.delay": 1e-3}.
        tables
            Keys of tables, such as ``contacts={"delay": "1 ms"}``; other keys stay.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        old = self.to_dict()
        return self._checked(override(Merged(old), (*changes, tables)), "configuration", old)

    @property
    def own_title(self) -> str | None:
        """The title, unless it is that of the base."""
        return self.title if self.base is None or self.base.title != self.title else None

    @arguments.checked(update=arguments.table, deep=arguments.flag)
    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with other tables if given, which are checked."""
        with _problems_of("configuration"):
            return super().model_copy(update=update, deep=deep)

    def __str__(self) -> str:
        return self.to_toml()

    def _repr_html_(self) -> str:
        """A short table of the given keys, for notebooks."""
        rows = "".join(
            f"<tr><th>{html.escape(name)}</th>"
            f"<td style='text-align: left'>{html.escape(_summary(table))}</td></tr>"
            for name, table in self.model_dump(
                exclude_none=True, exclude_unset=True, by_alias=True
            ).items()
        )
        return f"<table><caption>mesoslip configuration, in SI units</caption>{rows}</table>"

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables with plain SI numbers."""
        return self.model_dump(exclude_none=True, by_alias=True)

    def to_toml(self) -> str:
        """The configuration as the text of a TOML file with plain SI numbers."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())


def _summary(table: object) -> str:
    """A table, or a list of them, on one line."""
    if isinstance(table, dict):
        inner = (f"{key} = {_summary(value)}" for key, value in table.items())
        return ", ".join(inner)
    if isinstance(table, list | tuple):
        shown = [f"({_summary(one)})" for one in table[:4]]
        return ", ".join(shown) + (f", ... ({len(table)} in total)" if len(table) > 4 else "")
    return f"{table:g}" if isinstance(table, float) else str(table)
