"""Quantities with units, converted to plain numbers in SI.

A quantity is one number and one unit, read by strict patterns. SI units are converted here,
exactly; other units by pint, which is slow to load.
"""

from __future__ import annotations

import decimal
import math
import re
from decimal import Decimal
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

from mesoslip.errors import shown

if TYPE_CHECKING:
    from pint import UnitRegistry

NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|nan|inf)")
# A number with commas that may group its digits.
GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
RECIPROCAL = re.compile(r"1\s*/")
# A name, and an exponent as in m^2, m**2, m2, or s-1.
FACTOR = re.compile(
    r"\s*(?P<name>[A-Za-zµμÅ°%]+(?:_[A-Za-z]+)*)(?:(?:\^|\*\*)?(?P<exponent>[+-]?[1-9])(?![0-9]))?\s*"
)
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")

PREFIXES = {"": 0, "a": -18, "f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3}
PREFIXES |= {"c": -2, "d": -1, "k": 3, "M": 6, "G": 9, "T": 12}

# Maximum number of characters of a quantity.
MAX_LENGTH = 200

# More digits than any conversion needs; extreme exponents become 0 or infinity.
EXACT = decimal.Context(prec=60, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN, traps=[])


class Unit(NamedTuple):
    """A unit: its size in SI, and its powers of metre, kilogram, second and kelvin."""

    factor: Decimal
    dimension: tuple[float, ...]


# Units that take any prefix.
SI = {
    "m": Unit(Decimal(1), (1, 0, 0, 0)),
    "g": Unit(Decimal("1e-3"), (0, 1, 0, 0)),
    "s": Unit(Decimal(1), (0, 0, 1, 0)),
    "N": Unit(Decimal(1), (1, 1, -2, 0)),
    "Pa": Unit(Decimal(1), (-1, 1, -2, 0)),
    "J": Unit(Decimal(1), (2, 1, -2, 0)),
    "W": Unit(Decimal(1), (2, 1, -3, 0)),
    "Hz": Unit(Decimal(1), (0, 0, -1, 0)),
    "K": Unit(Decimal(1), (0, 0, 0, 1)),
}
NONE = Unit(Decimal(1), (0, 0, 0, 0))
# Bases of the dimensions, by pint's names.
DIMENSIONS = ("[length]", "[mass]", "[time]", "[temperature]")


def number_of(text: str, decimal: str = ".") -> float:
    """A text as a number: digits 0 to 9, with a decimal point or the given decimal sign."""
    plain = text.replace(",", ".") if decimal == "," and text.count(",") <= 1 else text
    # Python would accept digits of all scripts, and underscores between them.
    if plain.isascii() and "_" not in plain and not (decimal == "," and "." in text):
        try:
            return float(plain)
        except ValueError:
            pass
    raise ValueError(f"{shown(text)}, is not a number{_with_comma(text, decimal)}")


def is_number(text: str) -> bool:
    """Whether a text is a number, without a unit."""
    try:
        number_of(text)
    except ValueError:
        return False
    return True


def _with_comma(text: str, decimal: str) -> str:
    """A hint for a number with a comma."""
    if decimal == "," and "." in text:
        return ": other numbers here have a decimal comma"
    pointed, joined = text.replace(",", "."), text.replace(",", "")
    if "," not in text or not joined.isascii() or not NUMBER.fullmatch(joined):
        return ""
    if not GROUPED.fullmatch(text):
        return f"; write {pointed} if its comma is a decimal one" if text.count(",") == 1 else ""
    if text.count(",") > 1:
        return f"; write {joined} if its commas group digits"
    return f"; write {pointed} if its comma is a decimal one, {joined} if it groups digits"


def to_si(value: object, unit: str, example: str) -> float:
    """A number in an SI unit, or a string with one number and one unit, as a plain number; the
    `ValueError` for others has the example."""
    wanted = f"expected a quantity such as {example!r}, or a number in {unit}"
    if isinstance(value, bool) or not isinstance(value, Real | str):
        raise ValueError(wanted)
    if isinstance(value, str):
        value = _parse(value, unit, wanted)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"must be finite; {wanted}")
    return number


def text_to_si(text: str, unit: str, example: str) -> float:
    """A quantity that was typed, as `to_si`: one without a unit is a number in SI."""
    return to_si(float(text) if is_number(text) else text, unit, example)


def _parse(text: str, unit: str, wanted: str) -> float:
    """A string as a number in SI."""
    text = text.strip()
    number = NUMBER.match(text)
    after = "" if number is None else text[number.end() :]
    name = after.strip()
    is_reciprocal = RECIPROCAL.match(name) and after != name
    if (
        number is None
        or len(text) > MAX_LENGTH
        or (name and not (is_reciprocal or FACTOR.match(name)))
    ):
        raise ValueError(f"is not one number and one unit{_comma_in(text)}; {wanted}")
    given = _unit(name)
    if given is None:
        raise ValueError(f"has the unit {name!r}, which is not known; {wanted}")
    if given.dimension != _known(unit).dimension:
        raise ValueError(f"has {f'the unit {name}' if name else 'no unit'}; {wanted}")
    return float(EXACT.multiply(EXACT.create_decimal(number[0]), given.factor))


def _comma_in(text: str) -> str:
    """A hint for a quantity with a comma in its number."""
    meaning = _with_comma(text.partition(" ")[0], ".")
    return f" ({meaning.removeprefix('; ')})" if meaning else ""


def _known(unit: str) -> Unit:
    found = _unit("" if unit == "1" else unit)
    assert found is not None
    return found


@cache
def _unit(text: str) -> Unit | None:
    """The unit of a product of factors, as in "1/s", "N/m", "kg m^-3"; None if it is not a unit."""
    unit = NONE
    if text == "":
        return unit
    rest = text.translate(SUPERSCRIPTS)
    sign = 1
    if RECIPROCAL.match(rest):
        rest, sign = rest.partition("/")[2], -1
    while True:
        match = FACTOR.match(rest)
        factor = None if match is None else _named(match["name"])
        if match is None or factor is None:
            return None
        power = sign * int(match["exponent"] or 1)
        dimensions = zip(unit.dimension, factor.dimension, strict=True)
        unit = Unit(
            EXACT.multiply(unit.factor, EXACT.power(factor.factor, power)),
            tuple(product + power * one for product, one in dimensions),
        )
        rest = rest[match.end() :]
        if not rest:
            return unit
        sign = -1 if rest[0] == "/" else 1
        rest = rest[1:] if rest[0] in "/*·" else rest


def _named(name: str) -> Unit | None:
    for symbol, unit in SI.items():
        prefix = name.removesuffix(symbol)
        if prefix != name and prefix in PREFIXES:
            return Unit(unit.factor.scaleb(PREFIXES[prefix]), unit.dimension)
    return _named_by_pint(name)


@cache
def registry() -> UnitRegistry[float]:
    """pint's units; creating them is slow, so they are created at first use."""
    import pint

    return pint.UnitRegistry(cache_folder=None)


def _named_by_pint(name: str) -> Unit | None:
    """A unit outside the SI, by its name."""
    import pint

    try:
        zero, one = (registry().Quantity(count, name).to_base_units() for count in (0.0, 1.0))
    # A number, such as "nan", raises ValueError.
    except (pint.PintError, ValueError):
        return None
    # Degrees Celsius have an offset, and decibels are logarithmic.
    if zero.magnitude != 0:
        return None
    powers: dict[str, Any] = dict(one.dimensionality)
    dimension = tuple(float(powers.pop(base, 0)) for base in DIMENSIONS)
    # No key of a configuration has other dimensions: NaN differs from all powers.
    return Unit(Decimal(one.magnitude), (math.nan,) * len(DIMENSIONS) if powers else dimension)


def cf_units(unit: str) -> str:
    """A unit in the notation of CF: "N m-1" for "N/m"."""
    above, _, below = unit.replace("^", "").partition("/")
    parts = [part for part in (above,) if part != "1"]
    if below:
        name = below.rstrip("0123456789")
        parts.append(f"{name}-{below[len(name) :] or '1'}")
    return " ".join(parts) or "1"


def from_cf_units(units: str) -> str:
    """A unit of CF in the notation of configurations: "N/m" for "N m-1"."""
    above: list[str] = []
    below: list[str] = []
    for part in units.split():
        name = part.rstrip("-0123456789")
        power = part[len(name) :]
        size = power.lstrip("-")
        factor = name if size in {"", "1"} else f"{name}^{size}"
        (below if power.startswith("-") else above).append(factor)
    return "/".join([" ".join(above) or "1", *below])
