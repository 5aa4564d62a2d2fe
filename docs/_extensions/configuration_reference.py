"""The reference of the configuration, made from the tables that check it."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from functools import partial
from typing import Any, Literal, get_args, get_origin

import annotated_types
from mesoslip.campaign.sweep_table import SweepTable
from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import meanings
from mesoslip.configuration.messages import tables_in
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.table import Table
from pydantic import BeforeValidator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticKnownError

INTRODUCTION = """\
# Configuration

A run is described by a TOML file. Quantities are strings of a number and a unit (`"97 N/m"`,
`"0.5 ms"`), or plain numbers in the unit of this page. A unit of another dimension and an unknown
key are errors. With `base = "klein.toml"` at its top a file changes another one in the same
folder. On the command line `--set contacts.delay=1ms` changes one key.

This page is generated from the tables that check configurations.
"""


def configuration_page() -> str:
    """All tables with their keys, in the order of a file."""
    parts = [INTRODUCTION]
    for title, table in _tables():
        parts += [f"## {title}", "", _summary(table), "", *_rows(table, title), ""]
    return "\n".join(parts)


def _tables() -> Iterator[tuple[str, type[Table]]]:
    """Each table with its name in a file, those of a kind of slider one after another."""
    yield "Top-level keys", Config
    for name, field in Config.fields().items():
        if name == "slider":
            for kind, table in SLIDERS.items():
                yield f'[slider] with kind = "{kind}"', table
            for table in SLIDERS.values():
                yield from _inner("slider", table)
            continue
        for table in tables_in(field.annotation):
            yield f"[{name}]", table
            yield from _inner(name, table)
    yield "[sweep]", SweepTable


def _inner(outer: str, table: type[Table]) -> Iterator[tuple[str, type[Table]]]:
    for name, field in table.fields().items():
        for inner in tables_in(field.annotation):
            place = f"{outer}.{name}"
            yield f"[[{place}]]" if get_origin(_bare(field)) is tuple else f"[{place}]", inner
            yield from _inner(place, inner)


def _bare(field: FieldInfo) -> Any:
    """The annotation of a field without "or none"."""
    given = [part for part in get_args(field.annotation) if part is not type(None)]
    is_optional = type(None) in get_args(field.annotation)
    return given[0] if is_optional and len(given) == 1 else field.annotation


def _summary(table: type[Table]) -> str:
    return inspect.cleandoc(table.__doc__ or "").split("\n\n")[0].replace("``", "`")


def _rows(table: type[Table], title: str) -> Iterator[str]:
    documented = _documented(table)
    yield "| key | unit | default | allowed values | meaning |"
    yield "|---|---|---|---|---|"
    for name, field in table.model_fields.items():
        is_of_tables = next(tables_in(field.annotation), None) is not None
        if title == "Top-level keys" and is_of_tables:
            continue
        cells = (
            f"`{field.alias or name}`",
            _unit(field),
            _default(field),
            _table_or_tables(field) if is_of_tables else _allowed(field),
            documented[name],
        )
        yield "| " + " | ".join(cells) + " |"


def _documented(table: type[Table]) -> dict[str, str]:
    """The meanings of the keys of a table; a `LookupError` if a key has none."""
    found = meanings(table)
    missing = table.model_fields.keys() - found.keys() - _tables_of_config(table)
    if missing:
        raise LookupError(f"{table.__name__}: no text below {', '.join(sorted(missing))}")
    return found


def _tables_of_config(table: type[Table]) -> set[str]:
    """The tables of a whole configuration, each of which says what it is."""
    if table is not Config:
        return set()
    return {name for name, field in table.model_fields.items() if list(tables_in(field.annotation))}


def _metadata(annotation: Any) -> Iterator[Any]:
    """What annotations of a type say, the outermost last."""
    for part in get_args(annotation):
        if part is not ... and not isinstance(part, str):
            yield from _metadata(part)
    yield from getattr(annotation, "__metadata__", ())


def _table_or_tables(field: FieldInfo) -> str:
    return "tables" if get_origin(_bare(field)) is tuple else "a table"


def _all_metadata(field: FieldInfo) -> list[Any]:
    metadata: list[Any] = []
    for one in (*_metadata(field.annotation), *field.metadata):
        metadata += getattr(one, "metadata", [one])
    return metadata


def _validators(field: FieldInfo) -> Iterator[Any]:
    for one in _all_metadata(field):
        if isinstance(one, BeforeValidator):
            yield one.func


def _unit(field: FieldInfo) -> str:
    for function in _validators(field):
        if isinstance(function, partial) and "unit" in function.keywords:
            unit = str(function.keywords["unit"])
            return "" if unit == "1" else unit
    return ""


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "needed"
    default = field.get_default(call_default_factory=True)
    if default is None or default == () or default == {} or isinstance(default, Table):
        return ""
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    return f'`"{default}"`' if isinstance(default, str) else f"`{default:g}`"


def _allowed(field: FieldInfo) -> str:
    """The values that a key allows."""
    bare = _bare(field)
    chosen = _choices(field, bare)
    if chosen:
        return ", ".join(f'`"{one}"`' for one in chosen)
    text = _limits(field)
    if bool in _types(bare):
        return "true, false"
    if get_origin(bare) is dict or bare is Any:
        return "a table" if get_origin(bare) is dict else "a value of the key"
    is_list = get_origin(bare) is tuple
    if is_list and get_origin(get_args(bare)[0]) is dict:
        return "tables"
    if str in _types(bare):
        return "strings" if is_list else "a string"
    if int in _types(bare):
        text = f"whole, {text}" if text else "whole"
    if is_list:
        return f"a list, each {text}" if text else "a list"
    return text or "any"


def _types(annotation: Any) -> set[Any]:
    parts = get_args(annotation)
    return {annotation}.union(
        *(_types(one) for one in parts if isinstance(one, type) or get_args(one))
    )


def _choices(field: FieldInfo, bare: Any) -> tuple[str, ...]:
    if get_origin(bare) is Literal:
        return tuple(get_args(bare))
    for function in _validators(field):
        if inspect.isfunction(function) and function.__closure__:
            try:
                function("no choice")
            except PydanticKnownError as error:
                expected = str((error.context or {})["expected"])
                return tuple(expected.replace(" or ", ", ").replace("'", "").split(", "))
            except (TypeError, ValueError):
                continue
    return ()


def _limits(field: FieldInfo) -> str:
    """The bounds that a key has of its own; those of its unit are those of nature."""
    shown = []
    for one in _all_metadata(field):
        for kind, name, sign in (
            (annotated_types.Gt, "gt", ">"),
            (annotated_types.Ge, "ge", "≥"),
            (annotated_types.Lt, "lt", "<"),
            (annotated_types.Le, "le", "≤"),
        ):
            # What is beyond what anybody asks for is only there to keep integers whole.
            if isinstance(one, kind) and getattr(one, name) < 2**31:
                shown.append(f"{sign} {getattr(one, name):g}")
    return ", ".join(shown)
