"""The configuration of a run: checked, in SI units.

Everything that is wrong with a configuration is reported at once.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import StrictStr, ValidationError
from pydantic_core import ErrorDetails

from mesoslip.configuration.checks import cross_checks
from mesoslip.configuration.files import override, parse_toml, read_toml
from mesoslip.configuration.tables import (
    SLIDERS,
    Base,
    Cantilever,
    Contacts,
    Curve,
    Drive,
    Interaction,
    Output,
    QuasistaticSlider,
    RigidSlider,
    Run,
    Slider,
    Solver,
    Stage,
    Table,
    Threshold,
)
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

    @property
    def curve_length(self) -> float:
        """Length of the force curve [m]; twenty mean breaking stretches unless given."""
        return self.curve.length or 20 * self.contacts.static_force / self.contacts.stiffness

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
        stretch = contacts.static_force / contacts.stiffness
        loading = stretch + contacts.static_force / stiffness
        # A break is followed by Nk/K others in the mean, or the slider would not keep up.
        sliding = (self.run.avalanches or 0) * stretch / contacts.count
        sliding *= 1 + contacts.stiffness / stiffness
        return (loading + sliding) / abs(self.drive.velocity or math.nan)

    @property
    def bond_stiffness(self) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without interaction."""
        contacts = self.contacts
        if self.interaction is None or contacts.area is None:
            return 0.0
        spacing = math.sqrt(contacts.area / contacts.count)
        return 3 * self.interaction.strength * contacts.contact_static_force / spacing

    @property
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one that is driven by force."""
        return getattr(self.slider, "stiffness", math.inf) or 0.0

    @property
    def has_avalanches(self) -> bool:
        """Whether avalanches are recorded: breaks may bring about others at once."""
        return self.interaction is not None or isinstance(self.slider, QuasistaticSlider)

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
    def load(cls, path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Config:
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
        return cls.from_dict(override(read_toml(path, ()), overrides), source=str(path))

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], source: str = "configuration") -> Config:
        """Check a configuration given as nested tables.

        Raises
        ------
        ConfigError
            If anything in it is wrong.
        """
        try:
            config = cls.model_validate(tables)
        except ValidationError as error:
            raise ConfigError(_problems(error, source)) from None
        problems = [Problem(source, *problem) for problem in cross_checks(config)]
        if problems:
            raise ConfigError(problems)
        return config

    @classmethod
    def from_toml(
        cls, text: str, source: str = "configuration", overrides: Iterable[str] = ()
    ) -> Config:
        """Check a configuration given as the text of a TOML file, with changes laid over it."""
        return cls.from_dict(override(parse_toml(text, source), overrides), source)

    def to_dict(self) -> dict[str, Any]:
        """The configuration as nested tables with plain SI numbers."""
        return self.model_dump(exclude_none=True)

    def to_toml(self) -> str:
        """The configuration as the text of a TOML file with plain SI numbers."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())


def _problems(error: ValidationError, source: str) -> list[Problem]:
    """Everything that pydantic found, in our words."""
    return [_problem_of(details, source) for details in error.errors()]


def _problem_of(details: ErrorDetails, source: str) -> Problem:
    place = [part for part in details["loc"] if part not in SLIDERS]
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
    model: Any = Config
    tables: dict[str, Any] = {
        "run": Run,
        "drive": Drive,
        "slider": next(
            (kind for name, kind in SLIDERS.items() if name in details["loc"]), RigidSlider
        ),
        "base": Base,
        "solver": Solver,
        "cantilever": Cantilever,
        "contacts": Contacts,
        "interaction": Interaction,
        "output": Output,
        "curve": Curve,
        "threshold": Threshold,
        "stage": Stage,
    }
    for part in place:
        model = tables.get(part, model)
    return [*model.model_fields, *(["base"] if model is Config else [])]
