"""Measured histories: a quantity at given times, from a file or from lists."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import model_validator

from mesoslip.configuration.columns import Quantity, cells_of, find_columns, values_of
from mesoslip.configuration.reading import text_of
from mesoslip.configuration.table import MeasuredTime, Table, Text, problem
from mesoslip.errors import FileError

# Maximum number of parts of a drive or a load.
MAX_PARTS = 1_000_000


class History(Table):
    """A quantity at given times, with straight lines between them, either from a file or from
    lists. Outputs keep the points, not the name of the file."""

    what: ClassVar[str]
    """What has this history, as in messages."""
    quantity: ClassVar[Quantity]
    """The quantity, whose name is its key and its column in the file."""

    file: Text | None = None
    """A CSV file with the columns time and the quantity, relative to the configuration."""
    time: tuple[MeasuredTime, ...] | None = None
    """Times of the points, instead of a file."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, values: Any) -> Any:
        if not isinstance(values, Mapping) or not isinstance(values.get("file"), str):
            return values
        name = cls.quantity.name
        if values.keys() & {"time", name}:
            raise problem("file", f"give either a file, or time and {name}")
        try:
            points = _points(Path(values["file"]), cls.quantity, cls.what)
        except FileError as error:
            raise problem("file", str(error)) from None
        return {**{key: one for key, one in values.items() if key != "file"}, **points}

    @model_validator(mode="after")
    def _has_points(self) -> Self:
        name = self.quantity.name
        values = getattr(self, name)
        if self.time is None or values is None:
            raise problem("file", f"missing; give a file, or time and {name}")
        if len(self.time) != len(values):
            raise problem(name, "must have as many values as time")
        if len(self.time) < 2:
            raise problem("time", "must have at least two values")
        if len(self.time) > MAX_PARTS:
            raise problem("time", f"has more than {MAX_PARTS} values")
        for before, after in itertools.pairwise(self.time):
            if not after > before:
                raise problem("time", f"must increase; {after:g} s comes after {before:g} s")
        return self

    def lines(self) -> Iterator[tuple[float, float, float]]:
        """Duration [s] of each straight line, and the quantity at its start and end."""
        points = zip(self.time or (), getattr(self, self.quantity.name) or (), strict=True)
        for (time, value), (next_time, next_value) in itertools.pairwise(points):
            yield next_time - time, value, next_value


def _points(path: Path, quantity: Quantity, what: str) -> dict[str, list[float]]:
    """Times and values of a file, in SI units; the first column must be the time."""
    cells = cells_of(text_of(path, f"a history of {what}"), str(path))
    columns = {"time": Quantity("time", "s", "time [s]"), quantity.name: quantity}
    header = ",".join(one.header for one in columns.values())
    wanted = f"the header must name the columns with units, such as {header}"
    places = find_columns(cells.first, columns, str(path)) if cells.has_header else {}
    for name in columns:
        if name not in places:
            raise FileError(f"{path}: there is no column {name}; {wanted}")
    if places["time"].column != 0:
        raise FileError(f"{path}: the first column must be the time")
    if len(cells.lines) < 2:
        raise FileError(f"{path}: must have at least two rows of numbers")
    points = values_of(cells, cells.first, places)
    times = itertools.pairwise(points["time"])
    for (line, _), (before, after) in zip(cells.lines[1:], times, strict=True):
        if not after > before:
            raise FileError(f"{path}: line {line}: the time must increase from row to row")
    return points
