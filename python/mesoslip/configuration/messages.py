"""Errors of a configuration, as messages that name keys of the file."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.table import Table
from mesoslip.errors import Problem

# Maximum number of errors of a configuration that are described.
MAX_PROBLEMS = 50


def problems(error: ValidationError, source: str, whole: type[Table]) -> list[Problem]:
    """The errors that pydantic found in a configuration, whose outermost table is ``whole``."""
    found = []
    for details in error.errors(include_url=False)[:MAX_PROBLEMS]:
        if details["type"] == "tables":
            found += [Problem(source, *one) for one in details["ctx"]["complaints"]]
        else:
            found.append(_problem(details, source, whole))
    if error.error_count() > MAX_PROBLEMS:
        found.append(Problem(source, "", f"{error.error_count() - MAX_PROBLEMS} more errors"))
    return found


def _problem(details: ErrorDetails, source: str, whole: type[Table]) -> Problem:
    path, slider = list(details["loc"]), ""
    if path[:1] == ["slider"] and len(path) > 1 and path[1] in SLIDERS:
        slider = str(path.pop(1))
    context = details.get("ctx", {})
    kind, value, message = details["type"], details["input"], details["msg"]
    if kind == "table":
        return Problem(source, _dotted([*path, context["key"]]), context["message"])
    if kind == "missing":
        return Problem(source, _dotted(path), "missing; it has no default")
    if kind == "extra_forbidden":
        return Problem(source, _dotted(path), _unknown_key(path, slider, whole))
    if kind in {"union_tag_invalid", "literal_error"}:
        if kind == "union_tag_invalid":
            path, value = [*path, "kind"], context["tag"]
            expected = context["expected_tags"]
        else:
            expected = context["expected"]
        message = f"must be {expected}"
    elif kind == "value_error":
        message = str(context["error"])
    elif kind in {"model_type", "dict_type", "model_attributes_type", "union_tag_not_found"}:
        message = "must be a table"
    else:
        message = message.replace("Input should", "must").replace("a valid tuple", "a list")
    return Problem(source, _dotted(path), message, value)


def _dotted(path: Iterable[Any]) -> str:
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.lstrip(".")


def _unknown_key(path: list[Any], slider: str, whole: type[Table]) -> str:
    """The message about a key that its table does not have."""
    table, name = _dotted(path[:-1]), str(path[-1])
    if (table, name) == ("", "base"):
        return "names the base of a file, and cannot be changed"
    if (table, name) == ("", "sweep"):
        return "describes many runs; the command for it is mesoslip sweep"
    kinds = [kind for kind, model in SLIDERS.items() if name in model.model_fields]
    if table == "slider" and kinds:
        named = " or ".join(f'"{kind}"' for kind in kinds)
        return f"is for slider.kind = {named} only"
    keys = _table_at(path[:-1], slider, whole).fields()
    near = difflib.get_close_matches(name, [*keys, *([] if table else ["base"])], 1)
    # The same name in another table is more likely than a similar name.
    elsewhere = sorted({key for key in _all_keys(whole) if key.rpartition(".")[2] == name})
    meant = " or ".join(repr(key) for key in elsewhere or near)
    return f"unknown key; did you mean {meant}?" if meant else "unknown key"


def _table_at(path: list[Any], slider: str, whole: type[Table]) -> type[Table]:
    """The table at a path of keys."""
    table = whole
    for name in path:
        if isinstance(name, str):
            inner = tables_in(table.fields()[name].annotation)
            table = SLIDERS[slider] if name == "slider" else next(inner)
    return table


@cache
def _all_keys(table: type[Table]) -> tuple[str, ...]:
    return tuple(all_keys(table))


def all_keys(table: type[Table], outer: str = "") -> Iterator[str]:
    """Dotted names of all keys."""
    for name, field in table.fields().items():
        yield outer + name
        for inner in tables_in(field.annotation):
            yield from all_keys(inner, f"{outer}{name}.")


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from tables_in(part)
