"""The axes of a sweep, from the table ``[sweep]``.

The keys of ``[sweep.grid]`` are an axis each, those of a ``[[sweep.together]]`` table one axis
together, those of ``[sweep.latin_hypercube]`` too.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from mesoslip.campaign.combination import Axis, Value, described
from mesoslip.campaign.sweep_table import Extent, Range, SweepTable
from mesoslip.configuration.keys import KeyKind, key_kind, nearest_keys
from mesoslip.configuration.messages import problems
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, Problem

# Maximum number of axes: NumPy's arrays may have 32 dimensions.
MAX_AXES = 31

Wanted = TypeVar("Wanted", Range, Extent)


def axes_of(sweep: SweepTable, source: str) -> tuple[Axis, ...]:
    """The axes of a sweep, in the order of the dimensions of its dataset.

    Raises a `ConfigError` with all errors, also for what is varied or given twice.
    """
    reader = _Reader(source)
    axes = tuple(reader.axes(sweep))
    for key, count in Counter(key for axis in axes for key in axis.keys).items():
        if count > 1:
            reader.refuse("sweep", f"{key} is varied twice")
    for axis in axes:
        for row, count in Counter(axis.rows).items():
            if count > 1:
                values = described(dict(zip(axis.keys, row, strict=True)))
                reader.refuse("sweep", f"{values} is given {count} times")
    if len(axes) > MAX_AXES:
        message = (
            f"has {len(axes)} axes, and arrays have at most {MAX_AXES} besides the realizations; "
            "[[sweep.together]] varies several keys along one"
        )
        reader.refuse("sweep", message)
    if reader.problems:
        raise ConfigError(reader.problems)
    return axes


class _Reader:
    """Reads values of swept keys, and collects errors: a method that finds one returns nothing."""

    def __init__(self, source: str) -> None:
        self._source = source
        self.problems: list[Problem] = []

    def refuse(self, place: str, message: str, value: object = None) -> None:
        """Add an error of a key of the file."""
        self.problems.append(Problem(self._source, place, message, value))

    def axes(self, sweep: SweepTable) -> Iterator[Axis]:
        """The axes whose values are right."""
        for key, given in sweep.grid.items():
            values = self._values(key, given, f'sweep.grid."{key}"')
            if values:
                yield Axis(key, (key,), tuple((value,) for value in values))
        for number, group in enumerate(sweep.together):
            yield from self._together(group, f"sweep.together[{number}]")
        if sweep.latin_hypercube is not None:
            yield from self._latin_hypercube(sweep.latin_hypercube, "sweep.latin_hypercube")

    def _together(self, group: Mapping[str, Any], table: str) -> Iterator[Axis]:
        columns = {
            key: self._values(key, given, f'{table}."{key}"') for key, given in group.items()
        }
        lengths = {key: len(values) for key, values in columns.items() if values}
        if not columns:
            self.refuse(table, "names no keys")
        elif len(set(lengths.values())) > 1:
            listed = ", ".join(f"{key} has {length}" for key, length in lengths.items())
            self.refuse(table, f"keys that vary together need lists of one length: {listed}")
        elif len(lengths) == len(columns):
            rows = tuple(zip(*columns.values(), strict=True))
            yield Axis(next(iter(columns)), tuple(columns), rows)

    def _latin_hypercube(self, given: Mapping[str, Any], table: str) -> Iterator[Axis]:
        before = len(self.problems)
        numbers: dict[str, int] = {}
        for key, default, minimum in (("points", 0, 1), ("seed", 1, 0)):
            number = given.get(key, default)
            if isinstance(number, bool) or not isinstance(number, int) or number < minimum:
                message = f"must be a whole number of at least {minimum}"
                self.refuse(f"{table}.{key}", message, given.get(key))
            else:
                numbers[key] = number
        keys = [key for key in given if key not in {"points", "seed"}]
        if not keys:
            self.refuse(table, "names no keys to vary")
        ranges: list[tuple[KeyKind, tuple[float, float], str]] = []
        for key in keys:
            place = f'{table}."{key}"'
            kind = self._kind(key, place)
            wanted = None if kind is None else self._validated(Extent, given[key], place)
            ends = None if kind is None or wanted is None else self._ends(kind, wanted, place)
            if kind is not None and wanted is not None and ends is not None:
                ranges.append((kind, ends, wanted.spacing))
        if len(self.problems) > before:
            return
        from scipy.stats import qmc

        rng = np.random.default_rng(numbers["seed"])
        parts = qmc.LatinHypercube(len(ranges), rng=rng).random(numbers["points"])
        columns = [_spread(*one, part) for one, part in zip(ranges, parts.T, strict=True)]
        yield Axis("sample", tuple(keys), tuple(zip(*columns, strict=True)))

    def _kind(self, key: str, place: str) -> KeyKind | None:
        """The kind of value of a key, if it can be varied."""
        kind = key_kind(key)
        if kind is None:
            near = nearest_keys(key)
            meant = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            self.refuse(place, f"unknown key{meant}")
        elif key == "run.realizations":
            self.refuse(place, "cannot be varied; set sweep.realizations")
        elif not kind.is_single:
            self.refuse(place, "is a list or a table; only keys with one value can be varied")
        else:
            return kind
        return None

    def _values(self, key: str, given: object, place: str) -> tuple[Value, ...]:
        """The values of a key in SI, from a list or a range."""
        kind = self._kind(key, place)
        if kind is None:
            return ()
        if isinstance(given, Mapping):
            return self._range(kind, given, place)
        if not isinstance(given, list | tuple) or not given:
            message = (
                "must be a list of values, or a range such as "
                '{ from = "50 N/m", to = "400 N/m", points = 8, spacing = "logarithmic" }'
            )
            self.refuse(place, message, given)
            return ()
        values = [self._value(kind, one, f"{place}[{number}]") for number, one in enumerate(given)]
        known = tuple(one for one in values if one is not None)
        return known if len(known) == len(values) else ()

    def _value(self, kind: KeyKind, given: Any, place: str) -> Value | None:
        """A value of a key in SI."""
        if kind.unit is not None:
            try:
                return to_si(given, kind.unit, kind.example)
            except ValueError as error:
                self.refuse(place, str(error), given)
                return None
        if not isinstance(given, str | int | float) or (
            kind.is_whole and (isinstance(given, bool) or not isinstance(given, int))
        ):
            wanted = "a whole number" if kind.is_whole else "one value"
            self.refuse(place, f"must be {wanted}", given)
            return None
        return given

    def _range(self, kind: KeyKind, given: Mapping[str, Any], place: str) -> tuple[Value, ...]:
        wanted = self._validated(Range, given, place)
        ends = None if wanted is None else self._ends(kind, wanted, place)
        if wanted is None or ends is None:
            return ()
        fractions: Iterable[float | Fraction] = np.linspace(0, 1, wanted.points)
        if kind.is_whole:
            last = max(1, wanted.points - 1)
            fractions = [Fraction(number, last) for number in range(wanted.points)]
        return _spread(kind, ends, wanted.spacing, fractions)

    def _validated(self, table: type[Wanted], given: object, place: str) -> Wanted | None:
        try:
            return table.model_validate(given)
        except ValidationError as error:
            for one in problems(error, self._source, table):
                key, message = (text.replace("from_", "from") for text in (one.key, one.message))
                self.refuse(f"{place}.{key}", message, one.value)
            return None

    def _ends(
        self, kind: KeyKind, wanted: Range | Extent, place: str
    ) -> tuple[float, float] | None:
        """Both ends of a range, in SI."""
        if kind.unit is None and not kind.is_whole:
            self.refuse(place, "is a name, which has no range; give a list")
            return None
        first = self._value(kind, wanted.from_, f"{place}.from")
        last = self._value(kind, wanted.to, f"{place}.to")
        if first is None or last is None:
            return None
        assert not isinstance(first, str)
        assert not isinstance(last, str)
        if wanted.spacing == "logarithmic" and not (min(first, last) > 0 or max(first, last) < 0):
            self.refuse(place, "a logarithmic range needs both ends positive, or both negative")
            return None
        if first == last and getattr(wanted, "points", 2) > 1:
            self.refuse(place, "both ends are the same")
            return None
        return first, last


def _spread(
    kind: KeyKind, ends: tuple[float, float], spacing: str, fractions: Iterable[float | Fraction]
) -> tuple[Value, ...]:
    """Values at fractions of a range with exact ends; doubles have too few digits for large whole
    numbers."""
    first, last = ends
    values: list[Value] = []
    for fraction in fractions:
        value: float | Fraction
        if fraction in {0, 1}:
            value = last if fraction else first
        elif spacing == "logarithmic":
            value = _between(first, last, float(fraction))
        elif kind.is_whole:
            value = first + (last - first) * Fraction(fraction)
        else:
            value = first + (last - first) * float(fraction)
        values.append(round(value) if kind.is_whole else float(value))
    return tuple(values)


def _between(first: float, last: float, part: float) -> float:
    """The value at a fraction of a logarithmic range."""
    ratio = last / first
    if 0 < ratio < math.inf:
        return float(first * ratio**part)
    size = (1 - part) * math.log(abs(first)) + part * math.log(abs(last))
    return math.copysign(math.exp(size), first)
