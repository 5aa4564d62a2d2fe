"""Checks of the arguments of public functions: one message for each wrong one, with its name."""

from __future__ import annotations

import functools
import inspect
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ParamSpec, TypeVar

from mesoslip.errors import ConfigError, Problem

P = ParamSpec("P")
T = TypeVar("T")

# The checked value; a ValueError says what would be right.
Check = Callable[[Any], Any]


def checked(**checks: Check) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Check arguments by name before a function is called, except those with their default."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)
        first = min(map(list(signature.parameters).index, checks))

        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            if len(args) <= first and not kwargs:
                return function(*args, **kwargs)
            bound = signature.bind(*args, **kwargs)
            problems = []
            for name, check in checks.items():
                value = bound.arguments.get(name, signature.parameters[name].default)
                if value is signature.parameters[name].default:
                    continue
                try:
                    bound.arguments[name] = check(value)
                except ValueError as error:
                    problems.append(Problem("", name, str(error), value))
            if problems:
                raise ConfigError(problems)
            return function(*bound.args, **bound.kwargs)

        return call

    return decorate


def number(
    low: float = -math.inf, high: float = math.inf, *, is_open: bool = False
) -> Callable[[Any], float]:
    """A finite number in a range, whose lower end may not belong to it."""
    wanted = "must be a finite number"
    if low > -math.inf:
        wanted += f" {'above' if is_open else 'of at least'} {low:g}"
    if high < math.inf:
        wanted += f" and at most {high:g}"

    def check(value: Any) -> float:
        try:
            if isinstance(value, str | bytes | bool):
                raise TypeError
            found = float(value)
        except (OverflowError, TypeError, ValueError):
            raise ValueError(wanted) from None
        if not (math.isfinite(found) and low <= found <= high) or (is_open and found == low):
            raise ValueError(wanted)
        return found

    return check


def whole(low: int, *, bits: int = 31) -> Callable[[Any], int]:
    """A whole number of at least a bound, below a power of two."""

    def check(value: Any) -> int:
        try:
            if isinstance(value, bool):
                raise TypeError
            found = operator.index(value)
        except TypeError:
            found = low - 1
        if not low <= found < 2**bits:
            raise ValueError(f"must be a whole number of at least {low}, below 2^{bits}")
        return found

    return check


def instance(kind: type[T] | tuple[type[T], ...], wanted: str) -> Callable[[Any], T]:
    """An object of a type; ``wanted`` names it in the message."""

    def check(value: Any) -> T:
        if not isinstance(value, kind):
            raise ValueError(f"must be {wanted}")
        return value

    return check


def check_choice(key: str, value: str | None, choices: Iterable[str]) -> None:
    """Check that a value is None or one of some choices."""
    if value is not None and not (isinstance(value, str) and value in choices):
        raise ConfigError.of(key, f"must be one of {', '.join(choices)}", value)


def function(value: Any) -> Any:
    if not callable(value) or isinstance(value, type):
        raise ValueError("must be a function")
    return value


def numbers(value: Any) -> tuple[float, ...]:
    """Several finite numbers."""
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        return tuple(map(number(), value))
    except (TypeError, ValueError):
        raise ValueError("must be several finite numbers") from None


def array(value: Any, kinds: str = "fiu") -> Any:
    """Real numbers of any shape."""
    import numpy as np

    try:
        found = np.asarray(value)
        if found.dtype.kind not in kinds:
            raise TypeError
        return found.astype(complex if "c" in kinds else float)
    except (OverflowError, TypeError, ValueError):
        raise ValueError("must be a number, or an array of numbers") from None


def finite_array(value: Any) -> Any:
    """Finite numbers of any shape."""
    import numpy as np

    found = array(value)
    if not np.isfinite(found).all():
        raise ValueError("must be a finite number, or an array of finite numbers")
    return found


def rates(value: Any, kinds: str = "fiuc") -> Any:
    """Finite rates of any shape, other than 0."""
    import numpy as np

    found = array(value, kinds)
    if not (np.isfinite(found) & (found != 0)).all():
        raise ValueError("must be finite numbers other than 0")
    return found


frequencies = functools.partial(rates, kinds="fiu")


def flag(value: Any) -> bool:
    """True or False, also as 1 or 0."""
    try:
        # NumPy's are no integers.
        return {0: False, 1: True}[operator.index(getattr(value, "tolist", lambda: value)())]
    except (KeyError, TypeError):
        raise ValueError("must be True or False") from None


text = instance(str, "a text")
table = instance(Mapping, "nested tables")


def texts(value: Any) -> tuple[str, ...]:
    """A text, or several."""
    found = (value,) if isinstance(value, str) else value
    if not isinstance(found, Iterable) or not all(isinstance(one, str) for one in found):
        raise ValueError("must be a text, or several")
    return tuple(found)


def changes(value: Any) -> tuple[Any, ...]:
    wanted = 'must be changes such as "contacts.delay=1ms", or tables, in a list'
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        raise ValueError(wanted)
    found = tuple(value)
    if not all(isinstance(one, str | Mapping) for one in found):
        raise ValueError(wanted)
    return found
