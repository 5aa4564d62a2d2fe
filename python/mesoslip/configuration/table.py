"""The base of all tables of a configuration file, and types of keys: quantities, choices, texts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial
from numbers import Integral
from typing import Annotated, Any, NamedTuple, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    StrictInt,
    StrictStr,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, PydanticKnownError

from mesoslip.configuration.units import to_si

# Maximum number of times of a range.
MAX_POINTS = 100_000


def _within(value: object, unit: str, example: str, minimum: float, maximum: float) -> float:
    """A quantity in an SI unit: 0, or a size within bounds."""
    number = to_si(value, unit, example)
    if number != 0 and not minimum <= abs(number) <= maximum:
        in_unit = "" if unit == "1" else f" {unit}"
        raise ValueError(f"must be between {minimum:g} and {maximum:g}{in_unit} in size")
    return number


def _quantity(unit: str, example: str, minimum: float, maximum: float) -> Any:
    """A quantity whose size is bounded, so that derived quantities do not overflow."""
    return BeforeValidator(
        partial(_within, unit=unit, example=example, minimum=minimum, maximum=maximum)
    )


def with_ranges(values: object) -> object:
    """A list of times [s], with equidistant times for each ``{ from, to, points }``."""
    if not isinstance(values, list | tuple):
        return values
    return [time for one in values for time in _times(one)]


def _times(value: object) -> list[object]:
    if not isinstance(value, Mapping):
        return [value]
    wanted = 'expected { from = "1.9 s", to = "1.93 s", points = 30 }'
    if set(value) != {"from", "to", "points"}:
        raise ValueError(f"a range has other keys; {wanted}")
    first, last = (to_si(value[key], "s", "0.5 ms") for key in ("from", "to"))
    points = _whole(value["points"])
    if not isinstance(points, int) or isinstance(points, bool) or not 2 <= points <= MAX_POINTS:
        raise ValueError(f"a range has from 2 to {MAX_POINTS} points; {wanted}")
    if not first < last:
        raise ValueError(f"a range ends after it begins; {wanted}")
    step = (last - first) / (points - 1)
    return [*(first + number * step for number in range(points - 1)), last]


def _whole(value: object) -> object:
    """Whole numbers of other libraries, and those written like 1e4, as Python's own."""
    if isinstance(value, Integral) and not isinstance(value, int):
        return int(value)
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _writable(text: str) -> str:
    """A text that can be written to files, unlike some arguments of a command line."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ValueError("has characters that UTF-8 cannot encode") from error
    if "\0" in text:
        raise ValueError("has a null character")
    return text


# From less than an atom's vibration to the age of the Earth.
Time = Annotated[float, _quantity("s", "0.5 ms", 1e-18, 1e18)]
# Up to the speed of light.
Velocity = Annotated[float, _quantity("m/s", "0.1 um/s", 1e-20, 3e8)]
Mass = Annotated[float, _quantity("kg", "1.47 g", 1e-27, 1e24)]
Stiffness = Annotated[float, _quantity("N/m", "97 N/m", 1e-18, 1e18)]
Rate = Annotated[float, _quantity("1/s", "51.4 1/s", 1e-18, 1e24)]
Drag = Annotated[float, _quantity("N s/m", "0.1 N s/m", 1e-24, 1e18)]
Force = Annotated[float, _quantity("N", "18 uN", 1e-18, 1e18)]
SignedForce = Annotated[float, _quantity("N", "10 uN", 0.0, 1e18)]
ForceRate = Annotated[float, _quantity("N/s", "1 uN/s", 1e-24, 1e18)]
# From an atom's nucleus to the Earth.
Area = Annotated[float, _quantity("m^2", "1e-10 m^2", 1e-24, 1e15)]
Length = Annotated[float, _quantity("m", "3.5 nm", 1e-18, 1e9)]
# Measured values may be arbitrarily near to zero.
MeasuredTime = Annotated[float, _quantity("s", "0.5 ms", 0.0, 1e18)]
MeasuredLength = Annotated[float, _quantity("m", "3.5 nm", 0.0, 1e9)]
Density = Annotated[float, _quantity("kg/m^3", "956 kg/m^3", 1e-12, 1e18)]
Pressure = Annotated[float, _quantity("Pa", "70 GPa", 1e-9, 1e18)]
Temperature = Annotated[float, _quantity("K", "300 K", 1e-12, 1e9)]
Angle = Annotated[float, _quantity("rad", "1.57 rad", 0.0, 1e6)]
Number = Annotated[float, _quantity("1", "0.2", 1e-300, 1e12)]
Text = Annotated[StrictStr, AfterValidator(_writable)]
Whole = Annotated[StrictInt, BeforeValidator(_whole)]


class Complaint(NamedTuple):
    """An error between the tables of a configuration: its key, the message, and the value."""

    key: str
    message: str
    value: object = None


Complaints = Iterator[Complaint]


class Table(BaseModel):
    """An immutable table of the file; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @property
    def acts(self) -> bool:
        """Whether the table changes what is computed."""
        return True

    @classmethod
    def fields(cls) -> dict[str, FieldInfo]:
        """The fields by their keys in a file."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}

    @model_validator(mode="before")
    @classmethod
    def _without_none(cls, values: Any) -> Any:
        """Drop known keys whose value is None."""
        if not isinstance(values, Mapping):
            return values
        return {
            key: value
            for key, value in values.items()
            if value is not None or key not in cls.fields()
        }

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy; updated values are checked."""
        if not update:
            return super().model_copy(deep=deep)
        names = {name: field.alias or name for name, field in type(self).model_fields.items()}
        values = {names[name]: getattr(self, name) for name in self.model_fields_set}
        return self.model_validate({**values, **update})


def problem(key: str, message: str) -> PydanticCustomError:
    """The error that a validator of a table raises about one of its keys."""
    return PydanticCustomError("table", "{message}", {"key": key, "message": message})


def choice(names: Collection[str]) -> Any:
    """Check that a value is one of the names."""
    *others, last = (f"'{name}'" for name in names)
    expected = f"{', '.join(others)} or {last}"

    def check(value: object) -> object:
        if not isinstance(value, str) or value not in names:
            raise PydanticKnownError("literal_error", {"expected": expected})
        return value

    return BeforeValidator(check)
