"""Units as people write them in headers."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import NamedTuple

from mesoslip.configuration.units import NUMBER, to_si

# Words for units, in lower case, and the program's names.
WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s",
    "msec": "ms", "msecs": "ms", "millisec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "microsec": "us", "microsecond": "us", "microseconds": "us",
    "min": "min", "mins": "min", "minute": "min", "minutes": "min",
    "h": "h", "hr": "h", "hrs": "h", "hour": "h", "hours": "h",
    "micron": "um", "microns": "um", "micrometer": "um", "micrometers": "um",
    "micrometre": "um", "micrometres": "um", "mic": "um", "mum": "um",
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "inch": "inch", "inches": "inch",
    "newton": "N", "newtons": "N", "kilonewton": "kN", "kilonewtons": "kN",
    "kgf": "kgf", "kp": "kgf", "kg-f": "kgf", "kg-force": "kgf", "kg": "kg", "gf": "gf",
    "gram-force": "gf", "g-force": "gf", "gram": "g", "grams": "g", "gramm": "g", "g": "g",
    "lbf": "lbf", "lbs": "lbf", "lb": "lbf", "mg": "mg", "t": "t",
    "pascal": "Pa", "pascals": "Pa", "bar": "bar", "bars": "bar", "psi": "psi", "atm": "atm",
    "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV",
    "hertz": "Hz", "percent": "%", "%": "%", "rpm": "rpm",
    "1/min": "rpm", "min-1": "rpm", "u/min": "rpm", "rev/min": "rpm", "r/min": "rpm",
    "rev": "rev", "rad": "rad", "radian": "rad", "radians": "rad",
    "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg",
    "rad/s": "rad/s", "rad s-1": "rad/s", "deg/s": "deg/s", "rev/s": "Hz", "rps": "Hz",
}  # fmt: skip
# Symbols, whose case matters, except those without another meaning.
SYMBOL = re.compile(r"(?P<prefix>[fpnumckMG]?)(?P<unit>m|s|N|Pa|V|Hz)")
# A unit of a torque: "Nm", "mN m", "N·mm".
TORQUE = re.compile(r"(?P<force>[numk]?N)[\s.·⋅*-]?(?P<length>[umc]?m)")
# Factors of units such as "um/s", "N/mm^2".
POWER = re.compile(r"(?P<name>[A-Za-z]+)(?:\^|\*\*)?(?P<power>-?[1-9])?")
CASELESS = {"mpa": "MPa", "kpa": "kPa", "gpa": "GPa", "pa": "Pa", "n": "N", "kn": "kN"} | {
    "mv": "mV", "v": "V", "hz": "Hz", "khz": "kHz", "s": "s", "ms": "ms", "us": "us",
    "um": "um", "nm": "nm", "cm": "cm", "mm": "mm", "m": "m", "un": "uN",
}  # fmt: skip
# Units of plain numbers.
NONE = {"", "1", "-", "none", "dimensionless", "unitless", "a.u."}

# Units with their size in SI.
GRAVITY = 9.80665
SIZES = {
    "kgf": (GRAVITY, "N"),
    "gf": (1e-3 * GRAVITY, "N"),
    "lbf": (4.4482216152605, "N"),
    "psi": (6894.757293168361, "Pa"),
    "bar": (1e5, "Pa"),
    "atm": (101325.0, "Pa"),
    "inch": (0.0254, "m"),
    "min": (60.0, "s"),
    "h": (3600.0, "s"),
    "%": (0.01, "1"),
    "rpm": (1 / 60, "1/s"),
    "rad/s": (1 / math.tau, "1/s"),
    "deg/s": (1 / 360, "1/s"),
    "rev": (1.0, "rev"),
    "rad": (1 / math.tau, "rev"),
    "deg": (1 / 360, "rev"),
    "V": (1.0, "V"),
    "mV": (1e-3, "V"),
    "uV": (1e-6, "V"),
}
# Masses as units of forces, a guess that is reported [N].
WEIGHTS = {"kg": GRAVITY, "g": 1e-3 * GRAVITY, "mg": 1e-6 * GRAVITY, "t": 1e3 * GRAVITY}
# A micro sign, also if it was read in another encoding, or lost.
MICRO = re.compile(r"Âµ|Î¼|µ|μ|\ufffd(?=m\b|s\b|N\b)|\?(?=m\b|s\b|N\b)|\\mu\s*|&micro;")
BRACKETED = re.compile(r"\[(.*)\]|\((.*)\)|\{(.*)\}|<(.*)>")
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


class Size(NamedTuple):
    """A unit of a quantity: its size in the SI unit, and a note if that is a guess."""

    size: float
    note: str = ""


def plain(text: str) -> str:
    """A unit with u for µ and digits for superscripts."""
    return MICRO.sub("u", text).translate(SUPERSCRIPTS).strip()


@cache
def unit_named(text: str) -> str | None:
    """The program's name of a unit, "1" for plain numbers; None if the text is not a unit."""
    text = plain(text)
    bracketed = BRACKETED.fullmatch(text)
    text = (bracketed[bracketed.lastindex or 1] if bracketed else text).strip(" .")
    if text.lower() in NONE:
        return "1"
    return _factor(text) or _quotient(text)


def _factor(text: str) -> str | None:
    if SYMBOL.fullmatch(text):
        return text
    torque = TORQUE.fullmatch(text)
    if torque:
        return f"{torque['force']}*{torque['length']}"
    return WORDS.get(text.lower()) or CASELESS.get(text.lower())


def _quotient(text: str) -> str | None:
    """A unit such as "um/s", "N/mm^2", "mm s-1"."""
    parts = re.split(r"\s*[/*·]\s*|\s+", text)
    if len(parts) < 2 and not re.search(r"[2-4]$", text):
        return None
    found = text
    for part in parts:
        match = POWER.fullmatch(part)
        name = None if match is None else _factor(match["name"])
        if match is None or name is None or name in {"kg", "t"}:
            return None if part != "1" else found
        found = re.sub(rf"\b{re.escape(match['name'])}(?![A-Za-z])", name, found)
    return found


def is_unit(text: str) -> bool:
    """Whether a text is a unit other than that of plain numbers."""
    return unit_named(text) not in {None, "1"}


@cache
def size_of(text: str, unit: str) -> Size | None:
    """Size of a unit in an SI unit, or in volts; None for another dimension, a ValueError for no
    unit."""
    name = unit_named(text)
    if name is None:
        # Rare units, such as furlongs, are known to pint.
        return _by_pint(plain(text), unit)
    if name in SIZES:
        size, dimension = SIZES[name]
        return Size(size) if dimension == unit else None
    if name in WEIGHTS and unit == "N":
        return Size(WEIGHTS[name], f"{name} taken as a weight, {WEIGHTS[name]:g} N each")
    if name == "1":
        return Size(1.0) if unit in {"1", "rev"} else None
    return _by_pint(name, unit)


def _by_pint(text: str, unit: str) -> Size | None:
    if NUMBER.match(text):
        raise ValueError("is not a unit")
    if unit == "V":
        return None
    try:
        return Size(to_si(f"1 {text}", unit, ""))
    except ValueError as error:
        if "not known" in str(error) or "one number" in str(error):
            raise ValueError("is not a unit") from None
        return None
