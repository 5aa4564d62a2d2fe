"""The configuration of a run: checked, in SI units.

Everything that is wrong with a configuration is reported at once.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self, get_args

from pydantic import StrictStr, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from mesoslip.configuration import checks
from mesoslip.configuration.contacts import contact_kind
from mesoslip.configuration.contacts.base import ContactKind
from mesoslip.configuration.contacts.tables import INITIAL_STATES, Contacts, Interaction
from mesoslip.configuration.files import Change, on_base, override, parse_toml, read_toml
from mesoslip.configuration.sliders import SLIDERS, Slider
from mesoslip.configuration.table import Complaint, Table
from mesoslip.configuration.tables import Curve, Drive, Output, Run
from mesoslip.errors import ConfigError, Problem

# Tables and keys that the format knows and this version does not.
NOT_YET_KEYS = {"contacts": ("ageing",)}


class DriveStage(NamedTuple):
    """A stage of the drive as it is run: its duration [s], and its velocity [m/s] or, for a drive
    by force, the rate of the force [N/s]."""

    duration: float
    velocity: float


class Config(Table):
    """A whole configuration."""

    title: StrictStr | None = None
    run: Run
    drive: Drive
    slider: Slider
    contacts: Contacts
    interaction: Interaction | None = None
    output: Output = Output()
    curve: Curve = Curve()

    @model_validator(mode="after")
    def _tables_agree(self) -> Self:
        """Whether all tables together can be run, after each of them was found right."""
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
            *checks.curve_problems(self),
        ]
        # Without a drive there is no length of the run, to which what is recorded is compared.
        return complaints or [*checks.output_problems(self)] or [*checks.memory_problems(self)]

    @cached_property
    def contact_kind(self) -> ContactKind:
        """The kind of contacts."""
        return contact_kind(self.run, self.interaction)

    @property
    def initial_code(self) -> int:
        """The kernel's code of the initial state of the contacts."""
        return INITIAL_STATES[self.contacts.initial]

    @property
    def curve_length(self) -> float:
        """Length of the force curve [m]; twenty mean breaking stretches unless given."""
        return self.curve.length or 20 * self.contacts.break_stretch

    @property
    def duration(self) -> float:
        """Duration of the run [s]; infinite if only avalanches end it."""
        if self.run.duration is not None:
            return self.run.duration
        if self.run.drive_displacement is not None and self.drive.velocity:
            return self.run.drive_displacement / abs(self.drive.velocity)
        if self.drive.stage is not None:
            return math.fsum(stage.duration for stage in self.drive.stage)
        return math.inf

    @property
    def expected_duration(self) -> float:
        """Duration of the run [s], or an estimate of it if only avalanches end it."""
        if math.isfinite(self.duration):
            return self.duration
        contacts = self.contacts
        if self.drive.force_rate is not None:
            return contacts.static_force / abs(self.drive.force_rate)
        stiffness = self.spring_stiffness
        stretch = contacts.break_stretch
        loading = stretch + contacts.static_force / stiffness
        # A break is followed by Nk/K others in the mean, or the slider would not keep up.
        sliding = (self.run.avalanches or 0) * stretch / contacts.count
        sliding *= 1 + contacts.stiffness / stiffness
        return (loading + sliding) / abs(self.drive.velocity or math.nan)

    @property
    def bond_stiffness(self) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without interaction."""
        return 0.0 if self.interaction is None else self.interaction.bond_stiffness(self.contacts)

    @property
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one that is driven by force."""
        return self.slider.spring_stiffness

    @property
    def has_avalanches(self) -> bool:
        """Whether avalanches are recorded: breaks may bring about others at once."""
        return self.interaction is not None or self.slider.jumps

    @property
    def drive_speed(self) -> float:
        """Speed of the first stage of the drive that moves [m/s]; 0 if none does."""
        if self.drive.force_rate is not None:
            return 0.0
        return next((abs(one.velocity) for one in self.drive_stages if one.velocity), 0.0)

    @property
    def drive_stages(self) -> tuple[DriveStage, ...]:
        """Stages of the drive; the last one ends with the run."""
        if self.drive.stage is None:
            rate = self.drive.velocity if self.drive.force_rate is None else self.drive.force_rate
            return (DriveStage(self.duration, rate or 0.0),)
        stages = []
        left = self.duration
        for stage, is_last in zip(
            self.drive.stage, [False] * (len(self.drive.stage) - 1) + [True], strict=True
        ):
            length = left if is_last else min(stage.duration, left)
            stages.append(DriveStage(length, stage.velocity))
            left -= length
            if left <= 0:
                break
        return tuple(stages)

    @property
    def output_interval(self) -> float:
        """Interval of the trace [s]; a ten-thousandth of the run unless given."""
        return self.output.interval or self.expected_duration / 10000

    @classmethod
    def load(cls, path: str | os.PathLike[str], overrides: Iterable[Change] = ()) -> Config:
        """Read a TOML file and what it is based on, lay overrides over it, and check it.

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
        path = Path(path)
        return cls._checked(override(read_toml(path), overrides), str(path))

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
        cls, text: str, source: str = "configuration", overrides: Iterable[Change] = ()
    ) -> Config:
        """Check a configuration given as the text of a TOML file, with changes laid over it."""
        return cls._checked(override(parse_toml(text, source), overrides), source)

    @classmethod
    def _checked(cls, tables: Mapping[str, Any], source: str) -> Config:
        try:
            return cls.model_validate(tables)
        except ValidationError as error:
            raise ConfigError(_problems(error, source)) from None

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables with plain SI numbers."""
        return self.model_dump(exclude_none=True)

    def to_toml(self) -> str:
        """The configuration as the text of a TOML file with plain SI numbers."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())


def _problems(error: ValidationError, source: str) -> list[Problem]:
    """Everything that pydantic found, in our words."""
    problems = []
    for details in error.errors():
        if details["type"] == "tables":
            problems += [Problem(source, *one) for one in details["ctx"]["complaints"]]
        else:
            problems.append(_problem_of(details, source))
    return problems


def _problem_of(details: ErrorDetails, source: str) -> Problem:
    place = list(details["loc"])
    if place[0] == "slider" and len(place) > 1 and place[1] in SLIDERS:
        del place[1]
    context = details.get("ctx", {})
    kind, value, message = details["type"], details["input"], details["msg"]
    table, name = _dotted(place[:-1]), str(place[-1]) if place else ""
    if kind == "table":
        return Problem(source, _dotted([*place, context["key"]]), context["message"])
    if kind == "missing":
        return Problem(source, _dotted(place), "missing; it has no default")
    if kind == "extra_forbidden":
        if name in NOT_YET_KEYS.get(table, ()):
            return Problem(source, _dotted(place), "not available in this version")
        kinds = [kind for kind, model in SLIDERS.items() if name in model.model_fields]
        if table == "slider" and kinds:
            named = " or ".join(f'"{kind}"' for kind in kinds)
            return Problem(source, _dotted(place), f"is for slider.kind = {named} only")
        near = difflib.get_close_matches(name, _known_keys(place[:-1], details), 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        return Problem(source, _dotted(place), f"unknown key{hint}")
    if kind in {"union_tag_invalid", "literal_error"}:
        if kind == "union_tag_invalid":
            place, value = [*place, "kind"], context["tag"]
            expected = context["expected_tags"]
        else:
            expected = context["expected"]
        message = f"must be {expected}"
    elif kind == "value_error":
        message = str(context["error"])
    elif kind in {"model_type", "dict_type", "model_attributes_type", "union_tag_not_found"}:
        message = "must be a table"
    else:
        message = message.replace("Input should", "must").replace("Tuple should", "must")
    return Problem(source, _dotted(place), message, value)


def _dotted(place: Iterable[Any]) -> str:
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.lstrip(".")


def _known_keys(place: list[Any], details: ErrorDetails) -> list[str]:
    """Keys of the table at a place of the file."""
    model: type[Table] = Config
    for name in place:
        if isinstance(name, str):
            inner = list(_tables_in(model.model_fields[name].annotation))
            model = SLIDERS[str(details["loc"][1])] if name == "slider" else inner[0]
    return [*model.model_fields, *(["base"] if model is Config else [])]


def _tables_in(annotation: Any) -> Iterator[type[Table]]:
    """The tables that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from _tables_in(part)
