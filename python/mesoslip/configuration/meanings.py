"""The meanings of keys: the texts below the fields of their tables."""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache
from itertools import pairwise

from mesoslip.configuration.keys import tables_of
from mesoslip.configuration.table import Table


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
