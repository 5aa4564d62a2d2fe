"""Quantities with units, through pint; everything inside mesoslip is a plain number in SI."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pint import UnitRegistry


@cache
def registry() -> UnitRegistry:
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
        quantity = registry().Quantity(text)
        if quantity.unitless and unit != "1" and not quantity.check(unit):
            raise ValueError(f"has no unit; {wanted}")
        return float(quantity.to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"has the dimension {error.dim1.strip('()') or 'of'}; {wanted}") from None
    except (pint.UndefinedUnitError, pint.errors.DefinitionSyntaxError) as error:
        raise ValueError(f"is not a quantity ({error}); {wanted}") from None
    except (ArithmeticError, AssertionError, AttributeError, SyntaxError, TypeError) as error:
        raise ValueError(f"is not a quantity; {wanted}") from error


def humanize(value: float, unit: str) -> str:
    """A value in SI with a metric prefix, such as "18 µN"."""
    if unit in {"", "1"} or value == 0 or not math.isfinite(value):
        return f"{value:.6g} {unit if unit != '1' else ''}".strip()
    compact = registry().Quantity(value, unit).to_compact()
    return f"{compact:.6g~P}"
