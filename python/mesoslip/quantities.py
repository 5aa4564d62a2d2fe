"""Numbers in print: in a suitable unit, with as many digits as they deserve."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

# Powers of ten and their letters, in steps of a thousand.
LETTERS = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
# Units of long times [s], and the time from which each is used.
LONG_TIMES = (
    (3 * 365.25 * 86400.0, 365.25 * 86400.0, "a"),
    (3 * 86400.0, 86400.0, "d"),
    (3 * 3600.0, 3600.0, "h"),
    (600.0, 60.0, "min"),
)
# Units whose first factor takes a prefix.
PREFIXED = {"m", "s", "N", "Pa", "J", "m/s", "N/m", "N/s"}
# Power of the smallest prefix of velocities: nobody reads attometres per second.
MIN_VELOCITY_POWER = -12

# Range of sizes of numbers without an exponent.
MAX_PLAIN = 1e6
MIN_PLAIN = 1e-4
# Significant digits of an error.
ERROR_DIGITS = 2
# Minimum error that is written, over its value.
MIN_ERROR = 1e-12
# Smallest probability that is written: noise and model are known no better.
MIN_PROBABILITY = 1e-3
# Maximum ratio of numbers in a column with the same decimals.
MAX_RANGE = 1e3

# Printed for unknown numbers.
UNKNOWN = "-"


class Scale(NamedTuple):
    """A unit for print: its name, and its size in SI."""

    name: str
    size: float

    def label(self, what: str) -> str:
        """The label, with the unit in parentheses if it has one."""
        return f"{what} ({self.name})" if self.name else what


def scale_for(max_size: float, unit: str) -> Scale:
    """The unit for quantities up to a size in the SI unit, which is "1" for plain numbers.

    It has a prefix of the SI, such as "µN"; long times are in minutes to years ("a").
    """
    if unit == "1":
        return Scale("", 1.0)
    max_size = abs(max_size)
    if unit == "kg":
        letter, size = _prefix(1e3 * max_size)
        return Scale(f"{letter}g", 1e-3 * size) if size < 1e3 else Scale("kg", 1.0)
    if unit == "s":
        for start, size, name in LONG_TIMES:
            if start <= max_size < math.inf:
                return Scale(name, size)
        max_size = min(max_size, 999.0)
    if unit not in PREFIXED:
        return Scale(unit, 1.0)
    letter, size = _prefix(max_size, MIN_VELOCITY_POWER if unit == "m/s" else min(LETTERS))
    return Scale(letter + unit, size)


def _prefix(size: float, min_power: int = min(LETTERS)) -> tuple[str, float]:
    """The prefix for which a number is between 1 and 1000, if there is one, and its size."""
    if not 0 < size < math.inf:
        return "", 1.0
    # With a margin, so that a number just below 1000 is not printed as 1000.
    power = 3 * math.floor(math.log10(size * (1 + 1e-9)) / 3)
    power = min(max(power, min_power), max(LETTERS))
    return LETTERS[power], 10.0**power


def number(value: float, digits: int = 4) -> str:
    """A number with significant digits; whole numbers are written in full, and NaN as a dash.

    >>> number(0.0123456), number(110695.13), number(12345), number(3.2e-7)
    ('0.01235', '110700', '12345', '3.2e-7')
    """
    if math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return f"{value:g}"
    # A float, without the sign of -0.
    value = float(value) + 0.0
    if value.is_integer() and abs(value) < MAX_PLAIN:
        return f"{value:.0f}"
    rounded = float(f"{value:.{digits}g}")
    if MIN_PLAIN <= abs(rounded) < MAX_PLAIN:
        decimals = max(0, digits - 1 - _power(rounded))
        text = f"{rounded:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if decimals else text
    return _without_zeros(f"{value:.{digits}g}")


def _power(value: float) -> int:
    """Power of ten of the first digit of a number that is not 0."""
    return int(f"{value:e}".partition("e")[2])


def _without_zeros(text: str) -> str:
    """A number without leading zeros and plus sign in its exponent: 3.2e-7 for 3.2e-07."""
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if mark else text


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """A number in SI in a suitable unit, such as "18 µN"."""
    scale = scale_for(value, unit)
    if scale.name in {name for *_, name in LONG_TIMES}:
        size = value / scale.size
        # 4000 s are not written as 66.67 min.
        if float(f"{size:.{digits}g}") != size:
            return f"{number(value, digits)} s"
    return f"{number(value / scale.size, digits)} {scale.name}".rstrip()


def with_error(value: float, error: float, unit: str = "1", digits: int = 4) -> str:
    """A number in SI with its error, in a suitable unit, with digits according to the error.

    An error of 0 or NaN is not written; the number then has the given significant digits.

    >>> with_error(0.542043, 0.00025), with_error(1.8e-5, 4e-8, "N"), with_error(0.0038, 0.0072)
    ('0.54204 ± 0.00025', '18.000 ± 0.040 µN', '0.0038 ± 0.0072')
    """
    if math.isnan(value):
        return UNKNOWN
    if not _is_known(error, value):
        return with_unit(value, unit, digits)
    scale = scale_for(max(abs(value), abs(error)), unit)
    if scale.name in {name for *_, name in LONG_TIMES}:
        scale = Scale("s", 1.0)
    text = _with_error(value / scale.size, abs(error) / scale.size)
    return f"{text} {scale.name}".rstrip()


def _is_known(error: float | None, value: float) -> bool:
    """Whether an error is known, finite, and not negligible."""
    return error is not None and MIN_ERROR * abs(value) < abs(error) < math.inf


def _with_error(value: float, error: float) -> str:
    """A number and its error, in the unit for print."""
    max_size = max(abs(value), error)
    if not MIN_PLAIN <= max_size < 100 * MAX_PLAIN:
        power = _power(max_size)
        return f"({_with_error(value / 10.0**power, error / 10.0**power)})e{power}"
    # Decimals of the rounded error: 0.0996 is 0.10.
    decimals = ERROR_DIGITS - 1 - _power(float(f"{error:.{ERROR_DIGITS - 1}e}"))
    shown = max(decimals, 0)
    return f"{round(value, decimals) + 0.0:.{shown}f} ± {round(error, decimals):.{shown}f}"


class Column(NamedTuple):
    """The format of numbers in a column: one unit, and one number of decimals.

    Without decimals, as the numbers are of too different sizes, each has the significant digits.
    """

    scale: Scale
    decimals: int | None
    digits: int

    def head(self, name: str) -> str:
        """The header: the quantity and its unit."""
        return self.scale.label(name)

    def text(self, value: float | None, error: float | None = None) -> str:
        """A cell for a number in SI, with its error if it is known."""
        if value is None or math.isnan(value):
            return UNKNOWN
        size = value / self.scale.size
        if error is not None and _is_known(error, value):
            return _with_error(size, abs(error) / self.scale.size)
        if self.decimals is None or math.isinf(size):
            return number(size, self.digits)
        return f"{size:.{self.decimals}f}"


def column(values: Iterable[float | None], unit: str, digits: int = 4) -> Column:
    """The format of a column of numbers in SI; the largest has the given significant digits."""
    sizes = [abs(one) for one in values if one is not None and math.isfinite(one) and one != 0]
    max_size = max(sizes, default=0.0)
    # Times in columns are at most in seconds.
    scale = scale_for(min(max_size, 599.0) if unit == "s" else max_size, unit)
    shown = [one / scale.size for one in sizes]
    if all(one.is_integer() for one in shown):
        return Column(scale, 0 if max(shown, default=0.0) < MAX_PLAIN else None, digits)
    largest = max(shown)
    if largest > MAX_RANGE * min(shown) or not MIN_PLAIN <= largest < MAX_PLAIN:
        return Column(scale, None, digits)
    return Column(scale, max(0, digits - 1 - _power(largest)), digits)


def probability(value: float) -> str:
    """A probability with two digits, or a bound for one below 0.001."""
    return f"< {MIN_PROBABILITY:g}" if value < MIN_PROBABILITY else number(value, 2)


def percent(part: float) -> str:
    """A part as a text such as "2.1 %" or "174 %"."""
    size = 100 * part
    # From 99.5 % on, the format with two digits would have an exponent.
    return f"{size:.0f} %" if abs(size) >= 99.5 else f"{size:.2g} %"
