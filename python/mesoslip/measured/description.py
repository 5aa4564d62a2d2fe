"""The description of a measured trace: the table [trace] of a file such as EXPERIMENT.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from mesoslip.configuration.config import Config
from mesoslip.configuration.files import read_toml
from mesoslip.configuration.messages import problems
from mesoslip.configuration.table import Table, Text, Whole, problem
from mesoslip.configuration.units import is_number, number_of, text_to_si, to_si
from mesoslip.errors import ConfigError, Problem, shown
from mesoslip.measured.reading.stamps import Order

# In place of numbers that stand for missing ones.
NO_NUMBER = "none"
# Maximum size of a quantity in SI, so that derived quantities do not overflow.
MAX_SIZE = 1e30


def _checked_quantity(
    value: object, units: tuple[str, ...], example: str, minimum: float | None, is_open: bool
) -> str:
    """A quantity as text with its unit, checked for its dimension."""
    if isinstance(value, str):
        # A plain number is in SI.
        with suppress(ValueError):
            value = number_of(value.strip())
    errors = []
    for unit in units:
        try:
            number = to_si(value, unit, example)
        except ValueError as error:
            errors.append(error)
            continue
        if minimum is not None and (number < minimum or (is_open and number == minimum)):
            raise ValueError(f"must be {'greater than' if is_open else 'at least'} {minimum:g}")
        if number != 0 and not 1 / MAX_SIZE <= abs(number) <= MAX_SIZE:
            raise ValueError(f"must be between {1 / MAX_SIZE:g} and {MAX_SIZE:g} {unit} in size")
        # A plain number for a force or a coefficient has the unit of the record.
        named = "" if len(units) > 1 else f" {unit}"
        return value if isinstance(value, str) else f"{number!r}{named}"
    raise errors[0]


def _quantity(*units: str, example: str, minimum: float | None = None, is_open: bool = True) -> Any:
    """A quantity in one of several SI units, kept as it was written."""
    function = partial(
        _checked_quantity, units=units, example=example, minimum=minimum, is_open=is_open
    )
    return BeforeValidator(function)


# SI units of the quantities of a description, by key.
UNITS = {
    "radius": ("m",),
    "viscosity": ("Pa*s",),
    "rate": ("1/s",),
    "start": ("s",),
    "end": ("s",),
    "normal_force": ("N",),
    "normal_stress": ("Pa",),
    "area": ("m^2",),
    "stiffness": ("N/m", "1/m"),
    "velocity": ("m/s",),
    "hum": ("1/s",),
    "noise": ("N", "1"),
    "period": ("s",),
    "min_fall": ("N", "1"),
}
Radius = Annotated[str, _quantity(*UNITS["radius"], example="30 mm", minimum=0)]
Viscosity = Annotated[str, _quantity(*UNITS["viscosity"], example="90 mPa*s", minimum=0)]
Rate = Annotated[str, _quantity(*UNITS["rate"], example="1 kHz", minimum=0)]
Time = Annotated[str, _quantity(*UNITS["start"], example="100 s")]
NormalForce = Annotated[str, _quantity(*UNITS["normal_force"], example="301 mN", minimum=0)]
NormalStress = Annotated[str, _quantity(*UNITS["normal_stress"], example="20 MPa", minimum=0)]
Area = Annotated[str, _quantity(*UNITS["area"], example="25 cm^2", minimum=0)]
Stiffness = Annotated[str, _quantity(*UNITS["stiffness"], example="1002 N/m", minimum=0)]
Velocity = Annotated[str, _quantity(*UNITS["velocity"], example="42 um/s")]
Frequency = Annotated[str, _quantity(*UNITS["hum"], example="50 Hz", minimum=0)]
Noise = Annotated[str, _quantity(*UNITS["noise"], example="0.1 uN", minimum=0, is_open=False)]
Fall = Annotated[str, _quantity(*UNITS["min_fall"], example="6 mN", minimum=0)]
Period = Annotated[str, _quantity(*UNITS["period"], example="25 ms", minimum=0)]


def _column(value: object) -> object:
    """A column given by its name or number alone."""
    if isinstance(value, bool) or not isinstance(value, str | int):
        return value
    return {"column": value}


def _name_or_number(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise ValueError("must be the name of a column, or its number from 1")
    if isinstance(value, int) and value < 1:
        raise ValueError("columns are numbered from 1")
    return str(value) if isinstance(value, int) else value


def _number_as_text(value: object) -> object:
    """A number as it would be written, such as "1"."""
    return value if isinstance(value, bool) or not isinstance(value, int | float) else repr(value)


def _missing_numbers(value: object) -> object:
    """Numbers between commas, or "none"."""
    text = _number_as_text(value)
    if isinstance(text, str) and text != NO_NUMBER:
        for one in text.split(","):
            try:
                number_of(one.strip())
            except ValueError:
                raise ValueError(f"must be numbers between commas, or {NO_NUMBER!r}") from None
    return text


class Column(Table):
    """A column of the file, and how its numbers become a quantity: (number - offset) x factor."""

    column: Annotated[Text, BeforeValidator(_name_or_number)]
    """Name of the column in the file's header, with or without its unit; or its number from 1."""
    unit: Text | None = None
    """Unit of the column, if its header has none or a wrong one."""
    factor: Annotated[Text, BeforeValidator(_number_as_text)] | None = None
    """Quantity for one unit of the column, such as "12.4 mN/V", "9.80665e-3 N" or "1"."""
    offset: Annotated[Text, BeforeValidator(_number_as_text)] | None = None
    """Number to subtract, in the unit of the column, such as "0.3 V"."""


ColumnField = Annotated[Column | None, BeforeValidator(_column)]


class Columns(Table):
    """The columns of the file by what they hold; others are not used."""

    time: ColumnField = None
    """Time."""
    force: ColumnField = None
    """Force of the spring, along the interface."""
    shear_stress: ColumnField = None
    """Shear stress, a force with `trace.area`."""
    friction: ColumnField = None
    """Friction coefficient."""
    normal_force: ColumnField = None
    """Normal force."""
    normal_stress: ColumnField = None
    """Normal stress, a force with `trace.area`."""
    load_point: ColumnField = None
    """Displacement of the drive (load point)."""
    displacement: ColumnField = None
    """Displacement of the slider."""
    revolutions: ColumnField = None
    """Number of revolutions of a disc."""
    rotation_speed: ColumnField = None
    """Speed of its rotation, in revolutions per time."""
    acoustic_emission: ColumnField = None
    """A second channel, such as acoustic emission or its trigger; a voltage, or plain numbers."""
    torque: ColumnField = None
    """Torque of the friction, a force with the radius."""
    radius: ColumnField = None
    """Radius of the track on a disc, or of a journal."""
    sliding_speed: ColumnField = None
    """Speed of sliding; without it that of the rotation at the radius."""
    viscosity: ColumnField = None
    """Viscosity of the lubricant, for Stribeck's curve."""


class TraceDescription(Table):
    """Properties of a measurement that its file does not contain, as they were written; `si` has
    them in SI."""

    file: Text | Annotated[list[Text], Field(min_length=1)]
    """The file of the measurement, relative to the file of this table; or a list of the parts of a
    test, in their order."""
    columns: Columns = Columns()
    """Columns of the file by what they hold; by default found from its header."""
    headers: Text | None = None
    """Headers instead of those of the file, such as "time [s], force [uN], -"."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign; by default found from the numbers, if they allow one only."""
    dates: Order | None = None
    """Order of day, month and year in dates such as 04/03/2026; by default the one in which times
    increase."""
    missing: Annotated[Text, BeforeValidator(_missing_numbers)] | None = None
    """Numbers that stand for missing ones, such as "-99, 0", or "none", in columns other than the
    time; by default numbers such as -9999 that lie far from all others."""
    sheet: Text | None = None
    """Sheet of a workbook (.xlsx); by default the one with the most numbers."""
    rate: Rate | None = None
    """Sampling rate of a file without times; of one with times the rate to which it is thinned."""
    part: Annotated[Whole, Field(ge=1)] | None = None
    """Which part of a file whose clock starts again, from 1; by default the longest."""
    start: Time | None = None
    """Time of the file from which samples are used."""
    end: Time | None = None
    """Time of the file until which samples are used."""
    normal_force: NormalForce | None = None
    """Normal force, if it was not recorded; friction coefficients become forces with it."""
    normal_stress: NormalStress | None = None
    """Normal stress, if it was not recorded; with `area` a normal force."""
    area: Area | None = None
    """Nominal area, by which stresses become forces."""
    radius: Radius | None = None
    """Radius of the track on a disc, by which torques become forces and rotations speeds."""
    viscosity: Viscosity | None = None
    """Viscosity of a lubricant, for Stribeck curves."""
    stiffness: Stiffness | None = None
    """Spring constant; for friction coefficients over displacement, such as "1.6e-3 1/um"."""
    motion: Literal["strokes", "one-way"] | None = None
    """Whether the drive goes back and forth; by default from the load point or the force."""
    force_direction: Literal["along", "against"] | None = None
    """Whether the force in strokes is along the motion, or against it as that of the drive on the
    sensor; by default such that loops lose energy."""
    velocity: Velocity | None = None
    """Velocity of the drive, where no load point or no times were recorded."""
    hum: Frequency | None = None
    """Frequency of a hum that is removed."""
    trend: Literal["none", "linear"] | None = None
    """Trend of the friction with displacement, removed for rates and states."""
    noise: Noise | None = None
    """Standard deviation of the noise; estimated by default."""
    min_fall: Fall | None = None
    """Minimum fall of a slip; by default from the noise and the number of slips."""
    period: Period | None = None
    """Period of the setup, 2 pi (M/K)^1/2."""

    @model_validator(mode="after")
    def _keys_agree(self) -> Self:
        if self.headers is not None and self.columns.model_fields_set:
            raise problem("headers", "give either this or trace.columns")
        if self.normal_force is not None and self.normal_stress is not None:
            raise problem("normal_stress", "give either this or trace.normal_force")
        start, end = self.si("start"), self.si("end")
        if start is not None and end is not None and start >= end:
            raise problem("end", "must be after the start")
        return self

    def si(self, name: str) -> float | None:
        """A quantity in SI; None if it is not given. Stiffnesses are in N/m or 1/m."""
        text = getattr(self, name)
        if text is None:
            return None
        for unit in UNITS[name]:
            try:
                return text_to_si(text, unit, "")
            except ValueError:
                continue
        raise AssertionError(name)

    @property
    def missing_numbers(self) -> list[float] | None:
        """Numbers that stand for missing ones; None if they are not given."""
        if self.missing is None:
            return None
        texts = [] if self.missing == NO_NUMBER else self.missing.split(",")
        return [number_of(one.strip()) for one in texts]

    def is_in(self, name: str, unit: str) -> bool:
        """Whether a quantity is given with a unit of the dimension of an SI unit."""
        text = getattr(self, name)
        if text is None or is_number(text):
            return False
        try:
            to_si(text, unit, "")
        except ValueError:
            return False
        return True

    def to_toml(self) -> str:
        """The table as TOML, with its name."""
        import tomli_w

        return tomli_w.dumps({"trace": self.model_dump(exclude_none=True, exclude_defaults=True)})


class Experiment(Table):
    """A file with a table [trace], and tables of a model that it may have beside it."""

    title: Text | None = None
    """Title of the experiment."""
    trace: TraceDescription
    """The measurement."""


# Tables of such a file that are not part of the model.
OTHER_TABLES = ("fit", "trace")


def describe(
    files: Sequence[Path], options: Mapping[str, Any]
) -> tuple[Experiment, list[Path], Config | None]:
    """The description of a measurement, its files, and the configuration of a model, if any, from
    options and the table [trace] of a TOML file."""
    file = files[0]
    changes = {name: value for name, value in options.items() if value is not None}
    toml = next((one for one in files if one.suffix.lower() == ".toml"), None)
    if toml is None:
        names = [one.name for one in files]
        tables = {"trace": {"file": names if len(files) > 1 else names[0], **changes}}
        try:
            return _checked(tables, ""), list(files), None
        except ConfigError as error:
            raise ConfigError(
                [replace(one, key=option_name(one.key)) for one in error.problems]
            ) from None
    if len(files) > 1:
        message = "is a description, and describes its own files; give it alone, or --batch"
        raise ConfigError([Problem(str(toml), "", message)])
    tables = read_toml(file).tables
    table = tables.get("trace")
    if not isinstance(table, Mapping):
        message = "missing; it names the file of the measurement" if table is None else "no table"
        raise ConfigError([Problem(str(file), "trace", message)])
    experiment = _checked({"title": tables.get("title"), "trace": {**table, **changes}}, str(file))
    parts = experiment.trace.file
    paths = [file.parent / one for one in ([parts] if isinstance(parts, str) else parts)]
    return experiment, paths, model_of(tables, str(file))


def option_name(key: str) -> str:
    """The option of a command for a key of the table."""
    name = key.removeprefix("trace.")
    return "--columns" if name == "headers" else f"--{name.replace('_', '-')}"


def _checked(tables: Mapping[str, Any], source: str) -> Experiment:
    try:
        return Experiment.model_validate(tables)
    except ValidationError as error:
        raise ConfigError(problems(error, source, Experiment)) from None


def model_of(tables: Mapping[str, Any], source: str) -> Config | None:
    """The configuration of the model among the tables of a file, if any."""
    rest = {name: table for name, table in tables.items() if name not in OTHER_TABLES}
    if not rest.keys() - {"title"}:
        return None
    return Config.from_dict(rest, source)


def config_of_file(config: object) -> Config:
    """The configuration of an experiment, from a file that may have [fit] and [trace] too."""
    from mesoslip.output.inputs import as_config

    if isinstance(config, Mapping):
        return _model({**config}, "configuration")
    if isinstance(config, str | Path) and Path(config).suffix != ".nc":
        return _model(read_toml(Path(config)).tables, str(config))
    return as_config(config)  # type: ignore[arg-type]


def _model(tables: Mapping[str, Any], source: str) -> Config:
    config = model_of(tables, source)
    if config is None:
        raise ConfigError([Problem(source, "", f"has no model; {shown('[trace]')} alone is FILE")])
    return config
