"""The measures of a sweep by name, with those that are functions of users' files."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from functools import cache
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from mesoslip.array_types import DataTree
from mesoslip.campaign.measures import MEASURES, Measure, RunView
from mesoslip.errors import ConfigError, Problem, RunError

# Names that the dataset of a sweep uses itself.
RESERVED = {"status", "realization", "sample", "direction"}


def find_measures(names: Sequence[str], source: str, folder: Path) -> tuple[Measure, ...]:
    """The measures of names in a file, some of which may be "file.py:function" in a folder; a
    `ConfigError` has all errors."""
    found: list[Problem] = []
    measures: dict[str, Measure] = {}
    for number, name in enumerate(names):
        key = f"sweep.measures[{number}]"
        try:
            measure = _of_user(name, folder) if ":" in name else MEASURES.get(name)
        except RunError as error:
            found.append(Problem(source, key, str(error), name))
            continue
        if measure is None:
            near = difflib.get_close_matches(name, MEASURES, 1)
            meant = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(MEASURES)}."
            message = f"unknown measure; {meant} For a function of yours write 'file.py:function'"
            found.append(Problem(source, key, message, name))
        elif measure.name in measures:
            found.append(Problem(source, key, "is named twice", name))
        elif measure.name in RESERVED:
            found.append(Problem(source, key, "is a name that the dataset uses itself", name))
        else:
            measures[measure.name] = measure
    if found:
        raise ConfigError(found)
    return tuple(measures.values())


def _of_user(name: str, folder: Path) -> Measure:
    file, _, entry = name.rpartition(":")
    path = folder / file
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RunError(f"{path} cannot be read: {reason}") from None
    return measure_of(entry, source, str(path))


def measure_of(name: str, source: str = "", path: str = "") -> Measure:
    """A measure from its name, and the text and path of a user's file."""
    if not source:
        return MEASURES[name]
    function = _user_function(source, path, name)
    document = (function.__doc__ or name).strip().splitlines()
    return Measure(
        name,
        lambda run: function(run.tree),
        str(getattr(function, "units", "1")),
        str(getattr(function, "long_name", document[0] if document else name)),
        source=source,
        path=path,
    )


@cache
def _user_function(source: str, path: str, entry: str) -> Callable[[DataTree], Any]:
    """A function of a user's file, which is run once in each process; a `RunError` says what is
    wrong with it."""
    names: dict[str, Any] = {"__name__": Path(path).stem, "__file__": path}
    try:
        exec(compile(source, path, "exec"), names)
    except (Exception, SystemExit) as error:
        raise RunError(f"{path}{_line(error, path)}: {type(error).__name__}: {error}") from None
    function = names.get(entry)
    if not callable(function):
        there = [name for name, one in names.items() if callable(one) and not name.startswith("_")]
        near = difflib.get_close_matches(entry, there, 1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise RunError(f"{path} has no function {entry!r}{meant}")
    return function  # type: ignore[no-any-return]


def _line(error: BaseException, path: str) -> str:
    """Line of a user's file that an error comes from, as part of a message."""
    line = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == path:
            line = trace.tb_lineno
        trace = trace.tb_next
    return "" if line is None else f", line {line}"


def measured(run: RunView, measure: Measure) -> float:
    """A measure of a run; a `RunError` if a user's function raises or returns no number."""
    try:
        value = measure.function(run)
        value = value.item() if isinstance(value, np.ndarray | np.generic) else value
        value = (
            value.values.item() if hasattr(value, "values") and hasattr(value, "dims") else value
        )
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:
        where = f" ({measure.path}{_line(error, measure.path)})" if measure.path else ""
        raise RunError(f"measure {measure.name}{where}: {type(error).__name__}: {error}") from error
    if not isinstance(value, Real):
        raise RunError(f"measure {measure.name}: returned {value!r:.60}, not a number")
    return float(value)
