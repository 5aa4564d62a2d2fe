"""Quantities with units, through pint; everything inside mesoslip is a plain number in SI."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pint import UnitRegistry


@cache
def registry() -> UnitRegistry[float]:
    """The unit registry; made at first use, as that takes a while."""
    import pint

    return pint.UnitRegistry(cache_folder=":auto:")


def to_si(value: object, unit: str, example: str) -> float:
    """A quantity as a plain number in an SI unit.

    Parameters
    ----------
    value
        A number, taken to be in ``unit``, or a string with a number and a unit.
    unit
        The SI unit, such as "N/m".
    example
        What a good value looks like, for the message.

    Raises
    ------
    ValueError
        If the value is not a finite quantity of the unit's dimension.
    """
    wanted = f"expected a quantity such as {example!r}, or a number in {unit}"
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(wanted)
    if isinstance(value, str):
        value = _parse(value, unit, wanted)
    if not math.isfinite(value):
        raise ValueError(f"must be finite; {wanted}")
    return float(value)


@cache
def _parse(text: str, unit: str, wanted: str) -> float:
    import pint

    try:
        quantity: Any = registry().Quantity(text)
    # What the parser raises for text that is no quantity is not specified.
    except Exception as error:
        raise ValueError(f"is not a quantity; {wanted}") from error
    try:
        return float(quantity.to(unit).magnitude)
    except pint.DimensionalityError:
        given = "no unit" if quantity.unitless else f"the unit {quantity.units}"
        raise ValueError(f"has {given}; {wanted}") from None
    except (OverflowError, TypeError, pint.OffsetUnitCalculusError):
        raise ValueError(f"is not a quantity; {wanted}") from None
