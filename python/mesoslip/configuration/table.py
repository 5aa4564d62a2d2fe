"""What every table of a configuration file is made of: quantities in SI units, and choices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Annotated, Any, NamedTuple, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import PydanticCustomError, PydanticKnownError

from mesoslip.configuration.units import to_si


def _quantity(unit: str, example: str) -> Any:
    return BeforeValidator(partial(to_si, unit=unit, example=example))


Time = Annotated[float, _quantity("s", "0.5 ms")]
Velocity = Annotated[float, _quantity("m/s", "0.1 um/s")]
Mass = Annotated[float, _quantity("kg", "1.47 g")]
Stiffness = Annotated[float, _quantity("N/m", "97 N/m")]
Rate = Annotated[float, _quantity("1/s", "51.4 1/s")]
Force = Annotated[float, _quantity("N", "18 uN")]
ForceRate = Annotated[float, _quantity("N/s", "1 uN/s")]
Area = Annotated[float, _quantity("m^2", "1e-10 m^2")]
Length = Annotated[float, _quantity("m", "3.5 nm")]
Density = Annotated[float, _quantity("kg/m^3", "956 kg/m^3")]
Pressure = Annotated[float, _quantity("Pa", "70 GPa")]
Number = Annotated[float, _quantity("1", "0.2")]


class Complaint(NamedTuple):
    """What is wrong between the tables of a configuration: at which key, and its value."""

    key: str
    message: str
    value: object = None


Complaints = Iterator[Complaint]


class Table(BaseModel):
    """A table of the file: unknown keys are errors, and nothing changes after checking."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy; with other values, checked like those of any table."""
        if not update:
            return super().model_copy(deep=deep)
        values = {name: getattr(self, name) for name in self.model_fields_set}
        return self.model_validate({**values, **update})


def problem(key: str, message: str) -> PydanticCustomError:
    """What a table's own validator raises: what is wrong with one of its keys."""
    return PydanticCustomError("table", "{message}", {"key": key, "message": message})


def choice(names: Mapping[str, object]) -> Any:
    """Check that a value is one of the names of a mapping, which says what each stands for."""
    *others, last = (f"'{name}'" for name in names)
    expected = f"{', '.join(others)} or {last}"

    def check(value: object) -> object:
        if not isinstance(value, str) or value not in names:
            raise PydanticKnownError("literal_error", {"expected": expected})
        return value

    return BeforeValidator(check)
