"""The file of a sweep, its axes and its combinations.

A sweep varies keys of a configuration along axes. The keys of ``[sweep.grid]`` are an axis each,
those of a ``[[sweep.together]]`` table one axis together, those of ``[sweep.latin_hypercube]`` too.
Axes multiply, and each combination is run for a number of realizations. A *point* is one
realization of one combination.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, StrictStr, ValidationError, model_validator

from mesoslip.campaign.chain import (
    DIRECTION,
    chain_problems,
    chained,
    unchained,
    with_directions,
)
from mesoslip.campaign.combination import Axis, Combination, Value, described
from mesoslip.campaign.measures import Measure, find_measures
from mesoslip.configuration.config import Config
from mesoslip.configuration.files import Change, Merged, on_base, override, read_toml
from mesoslip.configuration.keys import KeyKind, key_kind, nearest_keys
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.table import Number, Table, Whole, problem
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, Problem

# Maximum number of wrong combinations that are listed.
MAX_REPORTED = 5
# Maximum number of points of a sweep.
MAX_POINTS = 10_000_000


class Range(Table):
    """Values between two ends."""

    from_: Annotated[Any, Field(alias="from")]
    """First value."""
    to: Any
    """Last value."""
    points: Annotated[Whole, Field(ge=1, le=MAX_POINTS)]
    """Number of values, including both ends."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """Spacing of the values."""


class Extent(Table):
    """Range of a key in a Latin hypercube."""

    from_: Annotated[Any, Field(alias="from")]
    """Minimum."""
    to: Any
    """Maximum."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """Distribution of the values."""


class SweepTable(Table):
    """The keys that a sweep varies, and the measures of each run."""

    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] | None = None
    """Realizations of each combination; by default run.realizations."""
    measures: tuple[StrictStr, ...]
    """Names of measures; your own functions as "file.py:function"."""
    discard: Annotated[Number, Field(ge=0, lt=1)] = 0.5
    """Fraction of each run, from its start, that measures leave out."""
    traces: StrictBool = False
    """Whether the output of each point is kept."""
    continue_: Annotated[StrictStr | None, Field(alias="continue")] = None
    """Key of the grid over whose values each run starts from the end of the last one."""
    order: Literal["listed", "up", "down", "up and down"] | None = None
    """Order of the values of `continue`; as listed by default."""
    grid: dict[str, Any] = Field(default_factory=dict)
    """Lists or ranges of values of keys, each an axis; axes multiply."""
    together: tuple[dict[str, Any], ...] = ()
    """Tables of keys that go together as one axis."""
    latin_hypercube: dict[str, Any] | None = None
    """Ranges of keys, sampled by `points` combinations."""

    @model_validator(mode="after")
    def _something_to_do(self) -> Self:
        if not self.measures:
            raise problem("measures", "must name at least one measure")
        if not (self.grid or self.together or self.latin_hypercube):
            raise problem(
                "grid",
                "nothing is varied; name keys in [sweep.grid], [[sweep.together]] or "
                "[sweep.latin_hypercube]",
            )
        if self.order is not None and self.continue_ is None:
            raise problem("order", "is the order of sweep.continue, which is missing")
        return self


class SweepFile(Table):
    """The tables of a sweep's file besides the configuration."""

    sweep: SweepTable


class Plan:
    """A sweep, checked: its axes, and a configuration for each combination.

    Attributes
    ----------
    tables
        The configuration that is varied, as tables.
    sweep
        The table ``[sweep]``.
    axes
        In the order of the dimensions of the dataset.
    realizations
        Number of realizations of each combination.
    measures
        The measures of each point.
    """

    def __init__(self, tables: Mapping[str, Any], source: str, folder: Path) -> None:
        tables = dict(tables)
        if "sweep" not in tables:
            message = "missing; this table names the keys to vary and the measures"
            raise ConfigError([Problem(source, "sweep", message)])
        try:
            self.sweep = SweepFile.model_validate({"sweep": tables.pop("sweep")}).sweep
        except ValidationError as error:
            raise ConfigError(problems(error, source, SweepFile)) from None
        self.tables: dict[str, Any] = tables
        self._source = source
        found: list[Problem] = []
        self.axes = tuple(_axes(self.sweep, source, found))
        found += _repeated(self.axes, source)
        if found:
            raise ConfigError(found)
        self.measures: tuple[Measure, ...] = find_measures(self.sweep.measures, source, folder)
        if self.sweep.continue_ is not None:
            found += chain_problems(self.sweep, self.axes, self.measures, source)
            if found:
                raise ConfigError(found)
            self.axes = with_directions(self.axes, self.sweep)
        run = tables.get("run")
        of_run = run.get("realizations", 1) if isinstance(run, Mapping) else 1
        self.realizations: int = self.sweep.realizations or of_run
        count = math.prod(self.shape)
        if not isinstance(self.realizations, int) or count * self.realizations > MAX_POINTS:
            message = f"asks for more than {MAX_POINTS} points"
            raise ConfigError([Problem(source, "sweep", message)])

    @classmethod
    def load(cls, path: PathLike, overrides: Iterable[Change] = ()) -> Plan:
        """Read the file of a sweep and its base, apply changes, and check the result.

        Raises
        ------
        FileError
            If a file cannot be read.
        ConfigError
            If anything in it is wrong.
        """
        path = Path(path)
        return cls(override(read_toml(path), overrides).tables, str(path), path.parent)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], source: str = "sweep") -> Plan:
        """Check a sweep given as nested tables; their ``base`` and measures may name files."""
        return cls(on_base(tables, source, Path()).tables, source, Path())

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""
        return tuple(len(axis.rows) for axis in self.axes)

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """All combinations, in the order of the dataset.

        Raises
        ------
        ConfigError
            If some of them are wrong; it says which, and why.
        """
        combinations, found, wrong = [], list[Problem](), 0
        for index in itertools.product(*map(range, self.shape)):
            values = {
                key: value
                for axis, number in zip(self.axes, index, strict=True)
                for key, value in zip(axis.keys, axis.rows[number], strict=True)
            }
            changes = {**values, "run.realizations": 1}
            changes.pop(DIRECTION, None)
            try:
                config = Config.from_dict(
                    override(Merged(self.tables), [changes]).tables, self._source
                )
            except ConfigError as error:
                wrong += 1
                if wrong <= MAX_REPORTED:
                    source = f"{self._source}: point {described(values)}"
                    found += [
                        Problem(source, one.key, one.message, one.value) for one in error.problems
                    ]
                continue
            combinations.append(Combination(index, values, config))
        if wrong > MAX_REPORTED:
            message = f"{wrong} of {math.prod(self.shape)} combinations are wrong"
            found.append(Problem(self._source, "sweep", message))
        if self.sweep.continue_ is not None and not found:
            found += unchained(combinations, self.sweep.continue_, self._source)
        if found:
            raise ConfigError(found)
        return tuple(combinations)

    @cached_property
    def chains(self) -> tuple[tuple[Combination, ...], ...]:
        """The combinations in chains: each but the first of a chain goes on from the end of the run
        before it. Without `sweep.continue` each is a chain of its own."""
        if self.sweep.continue_ is None:
            return tuple((one,) for one in self.combinations)
        return chained(self.combinations, self.axes, self.sweep)

    @property
    def count(self) -> int:
        """Number of points: realizations of all combinations."""
        return math.prod(self.shape) * self.realizations


def as_plan(plan: PathLike | Mapping[str, Any] | Plan) -> Plan:
    """A sweep from its file or from nested tables.

    Raises
    ------
    FileError
        If a file cannot be read.
    ConfigError
        If the sweep is wrong.
    """
    if isinstance(plan, Plan):
        return plan
    if isinstance(plan, Mapping):
        return Plan.from_dict(plan)
    return Plan.load(as_path(plan))


def _axes(sweep: SweepTable, source: str, found: list[Problem]) -> Iterator[Axis]:
    """The axes of a sweep; their errors are added to a list."""
    for key, given in sweep.grid.items():
        place = f'sweep.grid."{key}"'
        values = _values(key, given, place, source, found)
        if values:
            yield Axis(key, (key,), tuple((value,) for value in values))
    for number, group in enumerate(sweep.together):
        name = f"sweep.together[{number}]"
        columns = {
            key: _values(key, given, f'{name}."{key}"', source, found)
            for key, given in group.items()
        }
        lengths = {key: len(values) for key, values in columns.items() if values}
        if not columns:
            found.append(Problem(source, name, "names no keys"))
        elif len(set(lengths.values())) > 1:
            lengths_text = ", ".join(f"{key} has {length}" for key, length in lengths.items())
            found.append(
                Problem(
                    source,
                    name,
                    f"keys that vary together need lists of one length: {lengths_text}",
                )
            )
        elif len(lengths) == len(columns):
            yield Axis(
                next(iter(columns)), tuple(columns), tuple(zip(*columns.values(), strict=True))
            )
    if sweep.latin_hypercube is not None:
        yield from _latin_hypercube(sweep.latin_hypercube, source, found)


def _kind(key: str, place: str, source: str, found: list[Problem]) -> KeyKind | None:
    """The kind of value of a swept key; None, and a problem, if it cannot be swept."""
    kind = key_kind(key)
    if kind is None:
        near = nearest_keys(key)
        meant = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
        found.append(Problem(source, place, f"unknown key{meant}"))
        return None
    if key == "run.realizations":
        found.append(Problem(source, place, "cannot be varied; set sweep.realizations"))
        return None
    if not kind.is_single:
        message = "is a list or a table; only keys with one value can be varied"
        found.append(Problem(source, place, message))
        return None
    return kind


def _values(
    key: str, given: object, place: str, source: str, found: list[Problem]
) -> tuple[Value, ...]:
    """Values of a key in SI; none, and a problem, if they are wrong."""
    kind = _kind(key, place, source, found)
    if kind is None:
        return ()
    if isinstance(given, Mapping):
        return _range(kind, given, place, source, found)
    if not isinstance(given, list | tuple) or not given:
        message = (
            "must be a list of values, or a range such as "
            '{ from = "50 N/m", to = "400 N/m", points = 8, spacing = "logarithmic" }'
        )
        found.append(Problem(source, place, message, given))
        return ()
    before = len(found)
    values = [
        _value(kind, one, f"{place}[{number}]", source, found) for number, one in enumerate(given)
    ]
    return () if len(found) > before else tuple(values)


def _value(kind: KeyKind, given: Any, place: str, source: str, found: list[Problem]) -> Value:
    """A value of a key in SI."""
    if kind.unit is not None:
        try:
            return to_si(given, kind.unit, kind.example)
        except ValueError as error:
            found.append(Problem(source, place, str(error), given))
            return math.nan
    if not isinstance(given, str | int | float) or (
        kind.is_whole and (isinstance(given, bool) or not isinstance(given, int))
    ):
        wanted = "a whole number" if kind.is_whole else "one value"
        found.append(Problem(source, place, f"must be {wanted}", given))
        return math.nan
    return given


def _range(
    kind: KeyKind, given: Mapping[str, Any], place: str, source: str, found: list[Problem]
) -> tuple[Value, ...]:
    """The values of a range."""
    try:
        wanted = Range.model_validate(given)
    except ValidationError as error:
        found += _inner_problems(error, source, place, Range)
        return ()
    ends = _ends(kind, wanted, place, source, found)
    if ends is None:
        return ()
    fractions: Iterable[float | Fraction] = np.linspace(0, 1, wanted.points)
    if kind.is_whole:
        fractions = [Fraction(number, max(1, wanted.points - 1)) for number in range(wanted.points)]
    return _spread(kind, ends, wanted.spacing, fractions)


def _inner_problems(
    error: ValidationError, source: str, place: str, table: type[Table]
) -> Iterator[Problem]:
    for one in problems(error, source, table):
        key = one.key.replace("from_", "from")
        yield Problem(source, f"{place}.{key}", one.message.replace("from_", "from"), one.value)


def _ends(
    kind: KeyKind, wanted: Range | Extent, place: str, source: str, found: list[Problem]
) -> tuple[float, float] | None:
    """Both ends of a range, in SI; None, and a problem, if they are wrong."""
    if kind.unit is None and not kind.is_whole:
        found.append(Problem(source, place, "is a name, which has no range; give a list"))
        return None
    before = len(found)
    first, last = (
        _value(kind, end, f"{place}.{name}", source, found)
        for name, end in (("from", wanted.from_), ("to", wanted.to))
    )
    if len(found) > before:
        return None
    assert not isinstance(first, str)
    assert not isinstance(last, str)
    if wanted.spacing == "logarithmic" and not (min(first, last) > 0 or max(first, last) < 0):
        message = "a logarithmic range needs both ends positive, or both negative"
        found.append(Problem(source, place, message))
        return None
    if first == last and getattr(wanted, "points", 2) > 1:
        found.append(Problem(source, place, "both ends are the same"))
        return None
    return first, last


def _between(first: float, last: float, part: float) -> float:
    """A value of a logarithmic range, at a fraction of it."""
    ratio = last / first
    if 0 < ratio < math.inf:
        return float(first * ratio**part)
    size = (1 - part) * math.log(abs(first)) + part * math.log(abs(last))
    return math.copysign(math.exp(size), first)


def _spread(
    kind: KeyKind, ends: tuple[float, float], spacing: str, fractions: Iterable[float | Fraction]
) -> tuple[Value, ...]:
    """Values at fractions of a range, whose ends are kept exactly.

    Whole numbers are not rounded to doubles.
    """
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


def _latin_hypercube(given: Mapping[str, Any], source: str, found: list[Problem]) -> Iterator[Axis]:
    """The axis of a Latin hypercube."""
    name = "sweep.latin_hypercube"
    numbers: dict[str, int] = {}
    for key, default, minimum in (("points", 0, 1), ("seed", 1, 0)):
        number = given.get(key, default)
        if isinstance(number, bool) or not isinstance(number, int) or number < minimum:
            message = f"must be a whole number of at least {minimum}"
            found.append(Problem(source, f"{name}.{key}", message, given.get(key)))
        else:
            numbers[key] = number
    before = len(found)
    extents: dict[str, tuple[KeyKind, tuple[float, float], str]] = {}
    for key, extent in given.items():
        if key in {"points", "seed"}:
            continue
        place = f'{name}."{key}"'
        kind = _kind(key, place, source, found)
        if kind is None:
            continue
        try:
            wanted = Extent.model_validate(extent)
        except ValidationError as error:
            found += _inner_problems(error, source, place, Extent)
            continue
        ends = _ends(kind, wanted, place, source, found)
        if ends is not None:
            extents[key] = kind, ends, wanted.spacing
    if not extents and len(found) == before:
        found.append(Problem(source, name, "names no keys to vary"))
    if len(found) > before or len(numbers) < 2:
        return
    from scipy.stats import qmc

    parts = qmc.LatinHypercube(len(extents), rng=np.random.default_rng(numbers["seed"])).random(
        numbers["points"]
    )
    columns = [
        _spread(kind, ends, spacing, part)
        for (kind, ends, spacing), part in zip(extents.values(), parts.T, strict=True)
    ]
    yield Axis("sample", tuple(extents), tuple(zip(*columns, strict=True)))


def _repeated(axes: Sequence[Axis], source: str) -> Iterator[Problem]:
    """Keys that are varied twice, and values that are given twice."""
    for key, count in Counter(key for axis in axes for key in axis.keys).items():
        if count > 1:
            yield Problem(source, "sweep", f"{key} is varied twice")
    for axis in axes:
        for row, count in Counter(axis.rows).items():
            if count > 1:
                values = described(dict(zip(axis.keys, row, strict=True)))
                yield Problem(source, "sweep", f"{values} is given {count} times")
