"""The configuration of a run: checked, in SI units. All its errors are reported at once."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from pydantic import PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from mesoslip.configuration import checks
from mesoslip.configuration.contacts import contact_kind
from mesoslip.configuration.contacts.base import ContactKind
from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.drive import Drive, DrivePart
from mesoslip.configuration.files import (
    Change,
    Merged,
    base_of,
    check_no_files,
    on_base,
    override,
    parse_toml,
    read_toml,
)
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.run_tables import Curve, Output, Run
from mesoslip.configuration.sliders import Slider
from mesoslip.configuration.table import Complaint, Table, Text
from mesoslip.errors import ConfigError
from mesoslip.quantities import with_unit

# Samples of slips by default: in a period of the ringing on the pinned contacts, in a delay, and in
# all slips of a run together at most as many as in its trace, or this number.
SAMPLES_IN_RINGING = 50
SAMPLES_IN_DELAY = 5
SAMPLES_IN_SLIPS = 20_000


class Config(Table):
    """A whole configuration."""

    title: Text | None = None
    """Title of the run, for pictures and reports."""
    run: Run
    drive: Drive
    slider: Slider
    contacts: Contacts
    interaction: Interaction | None = None
    output: Output = Output()
    curve: Curve = Curve()

    # The tables that the configuration changes, if it is based on others.
    _base: Mapping[str, Any] | None = PrivateAttr(default=None)
    # Keys that were dropped because the new kind of slider does not have them.
    _dropped: tuple[str, ...] = PrivateAttr(default=())

    def __init__(self, **tables: Any) -> None:
        """Check a configuration given as its tables; see `from_dict`.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise ConfigError(problems(error, "configuration", type(self))) from None

    # Validation does not call it, as it does the initializer of any model without this mark.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Check a configuration given as its tables, as pydantic does; see `from_dict`.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise ConfigError(problems(error, "configuration", cls)) from None

    def __eq__(self, other: object) -> bool:
        """Whether another configuration describes the same run, whatever both are based on."""
        return isinstance(other, Config) and self.__dict__ == other.__dict__

    @property
    def base(self) -> Config | None:
        """The configuration that this one changes, if it can be run by itself.

        It is the file named by ``base``; without one, the configuration before changes were made.
        """
        if self._base is None:
            return None
        try:
            return self.model_validate(self._base)
        except ConfigError:
            return None

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
            *self.contact_kind.problems(self),
            *checks.newborn_problems(self),
            *checks.curve_problems(self),
        ]
        # Output intervals are compared with the duration, which a wrong drive does not have.
        return complaints or [*checks.output_problems(self)]

    @property
    def contact_kind(self) -> ContactKind:
        """The kind of contacts."""
        return contact_kind(self.run, self.contacts, self.interaction)

    @property
    def curve_length(self) -> float:
        """Length of the force curve [m]; 20 mean breaking stretches unless given."""
        return self.curve.length or 20 * self.contacts.break_stretch

    @cached_property
    def duration(self) -> float:
        """Duration of the run [s]; infinite if only avalanches end it."""
        if self.run.duration is not None:
            # A cycle or a history ends the run.
            limit = math.inf if self.drive.continues else self.drive.length
            return min(self.run.duration, limit)
        if self.run.drive_displacement is not None:
            return self.drive.time_for(self.run.drive_displacement)
        return self.drive.length

    @property
    def expected_duration(self) -> float:
        """Duration of the run [s], or an estimate of it if only avalanches end it."""
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
        # A break is followed by Nk/K others in the mean, or the slider would not keep up.
        sliding = (self.run.avalanches or 0) * stretch / contacts.count
        sliding *= 1 + contacts.stiffness / stiffness
        return (loading + sliding) / abs(self.drive.velocity or math.nan)

    @property
    def steady_block(self) -> float:
        """Distance that the drive moves in a block of the criterion for a steady state [m].

        By default the one that loads spring and contacts to the static force; 0 without the
        criterion.
        """
        steady = self.run.stops.steady
        if steady is None:
            return 0.0
        loading = self.contacts.break_stretch + self.contacts.static_force / self.spring_stiffness
        return steady.displacement or loading

    @property
    def bond_stiffness(self) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without interaction."""
        return 0.0 if self.interaction is None else self.interaction.bond_stiffness(self.contacts)

    @property
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one driven by a force."""
        return self.slider.spring_stiffness

    @property
    def series_stiffness(self) -> float:
        """K, in series with the spring of a base [N/m]: what decides against K*."""
        return self.slider.series_stiffness

    @property
    def has_avalanches(self) -> bool:
        """Whether avalanches are recorded: a break may trigger others at once."""
        return self.interaction is not None or self.slider.jumps

    @property
    def drive_speed(self) -> float:
        """Speed of the first moving stage of the drive [m/s]; 0 if none moves.

        For a ramp the maximum, for a measured history the mean.
        """
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
        """A message about the part of a finite drive that the run does not reach; None if it
        reaches all of it."""
        length = self.drive.length
        # Allow for rounding in the sum of the stages.
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
        """A message about a last stage that goes on beyond its end; None if none does."""
        length = self.drive.length
        # As with stages whose durations are rounded in the file.
        if not self.drive.parts or not 1.01 * length < self.duration < math.inf:
            return None
        given = "duration" if self.run.duration is not None else "drive_displacement"
        return (
            f"the stages end after {with_unit(length, 's')}: the last one goes on for another "
            f"{with_unit(self.duration - length, 's')}, until run.{given}"
        )

    @property
    def unreachable_stop(self) -> str | None:
        """A message about a displacement that should end the run, but is farther away than the
        drive and the contacts can move the slider; None if it can be reached."""
        target = self.run.stops.displacement
        if target is None or self.drive.force_rate is not None or not self.spring_stiffness:
            return None
        length = math.fsum(part.path_length for part in self.drive_parts)
        # A slip goes beyond the equilibrium of the spring by at most what the spring was stretched.
        beyond = self.contacts.static_force / self.spring_stiffness
        if not length + beyond < abs(target):
            return None
        return (
            f"run.stop.displacement = {with_unit(target, 'm')} is out of reach: the drive moves "
            f"{with_unit(length, 'm')} in the run"
        )

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
        base = base_of(path) or (merged.tables if overrides else None)
        return cls._checked(override(merged, overrides), str(path), base)

    @classmethod
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
    def from_toml(
        cls,
        text: str,
        source: str = "configuration",
        overrides: Iterable[Change] = (),
        base: str | None = None,
    ) -> Config:
        """Check a configuration given as the text of a TOML file, with changes applied.

        Without changes, ``base`` is the text of the configuration that it is based on. Both come
        from an output and name no files; changes may.
        """
        tables, overrides = parse_toml(text, source), tuple(overrides)
        below = None if base is None else parse_toml(base, source)
        for one in (tables, below or {}):
            check_no_files(one, source)
        merged = override(Merged(tables), overrides)
        return cls._checked(merged, source, tables if overrides else below)

    @classmethod
    def _checked(cls, merged: Merged, source: str, base: Mapping[str, Any] | None = None) -> Config:
        try:
            config = super().model_validate(merged.tables)
        except ValidationError as error:
            raise ConfigError(problems(error, source, cls)) from None
        config._base, config._dropped = base, tuple(merged.dropped)
        return config

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

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with other tables if given.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        try:
            return super().model_copy(update=update, deep=deep)
        except ValidationError as error:
            raise ConfigError(problems(error, "configuration", type(self))) from None

    def _repr_html_(self) -> str:
        """A short table of the keys that are set, for notebooks."""
        rows = "".join(
            f"<tr><th>{html.escape(name)}</th>"
            f"<td style='text-align: left'>{html.escape(_summary(table))}</td></tr>"
            for name, table in self.model_dump(exclude_none=True, exclude_unset=True).items()
        )
        return f"<table><caption>mesoslip configuration, in SI units</caption>{rows}</table>"

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables with plain SI numbers."""
        return self.model_dump(exclude_none=True)

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
