"""Dotted keys of a configuration: the kind of their values, their units, and their meanings."""

from __future__ import annotations

import ast
import difflib
import inspect
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from typing import Any, get_args, get_origin

from pydantic import BeforeValidator

from mesoslip.configuration.config import Config
from mesoslip.configuration.messages import all_keys, tables_in
from mesoslip.configuration.table import Table
from mesoslip.configuration.units import cf_units


@dataclass(frozen=True)
class KeyKind:
    """The kind of value of a key, with an example; ``unit`` is None for whole numbers and names,
    lists and tables are not single."""

    unit: str | None
    example: str
    is_whole: bool
    is_single: bool

    @property
    def cf_units(self) -> str | None:
        """The unit as CF writes it, such as "N m-1"; None for names."""
        if self.unit is None:
            return "1" if self.is_whole else None
        return cf_units(self.unit)


def tables_of(key: str) -> list[type[Table]]:
    """The tables that have a dotted key, such as those of several kinds of sliders."""
    *outer, last = key.split(".")
    tables: list[type[Table]] = [Config]
    for name in outer:
        tables = [
            inner
            for table in tables
            if name in table.fields()
            for inner in tables_in(table.fields()[name].annotation)
        ]
    return [table for table in tables if last in table.fields()]


@cache
def key_kind(key: str) -> KeyKind | None:
    """The kind of value of a dotted key such as "contacts.delay"; None if there is no such key."""
    last = key.rpartition(".")[2]
    fields = [table.fields()[last] for table in tables_of(key)]
    if not fields:
        return None
    parts = [
        part for field in fields for part in (*field.metadata, *_parts(field.annotation), field)
    ]
    quantities = [
        part.func.keywords
        for part in parts
        if isinstance(part, BeforeValidator)
        and isinstance(part.func, partial)
        and "unit" in part.func.keywords
    ]
    several = any(
        get_origin(part) is tuple or (isinstance(part, type) and issubclass(part, Table))
        for part in parts
    )
    return KeyKind(
        unit=quantities[0]["unit"] if quantities else None,
        example=quantities[0]["example"] if quantities else "",
        is_whole=int in parts,
        is_single=not several,
    )


def _parts(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _parts(part)


def nearest_keys(key: str) -> list[str]:
    """Known keys similar to a wrong one."""
    known = list(dict.fromkeys(all_keys(Config)))
    name = key.rpartition(".")[2]
    elsewhere = [one for one in known if one.rpartition(".")[2] == name]
    return elsewhere or difflib.get_close_matches(key, known, 1)


@cache
def meanings(table: type[Table]) -> dict[str, str]:
    """The meanings of the keys of a table, by the names of their fields."""
    found: dict[str, str] = {}
    for one in reversed(table.__mro__):
        if not issubclass(one, Table) or one is Table:
            continue
        tree = ast.parse(inspect.getsource(sys.modules[one.__module__]))
        body = next(
            node.body
            for node in tree.body
            if isinstance(node, ast.ClassDef) and node.name == one.__name__
        )
        for field, text in pairwise(body):
            if not (isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr)):
                continue
            if isinstance(text.value, ast.Constant) and isinstance(field.target, ast.Name):
                found[field.target.id] = inspect.cleandoc(str(text.value.value)).replace("\n", " ")
    return found


def meaning(key: str) -> str:
    """The meaning of a dotted key in the first table that has it; empty for a whole table."""
    *_, name = key.split(".")
    texts = (meanings(table).get(name, "") for table in tables_of(key))
    return next(texts, "").replace("`", "")
