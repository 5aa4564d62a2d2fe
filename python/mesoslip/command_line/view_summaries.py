"""What views show, for help; read from their files, since importing them takes a second."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import NamedTuple

from mesoslip.output.kinds import KINDS

FOLDER = Path(__file__).parents[1] / "plots" / "views"
# How a view begins in its file.
START = "\nVIEW = View("


class Summary(NamedTuple):
    """Name, kind and summary of a view."""

    name: str
    kind: str
    summary: str


def summaries() -> list[Summary]:
    """Those of all views, in the order of their files."""
    found = []
    for path in sorted(FOLDER.glob("*.py")):
        _, start, rest = path.read_text(encoding="utf-8").partition(START)
        if start:
            call = ast.parse(start + rest).body[0].value  # type: ignore[attr-defined]
            values = {one.arg: one.value for one in call.keywords}
            found.append(Summary(*(ast.literal_eval(values[one]) for one in Summary._fields)))
    return found


def summary_of_views() -> str:
    """The views of each kind of output that has several, with what they show."""
    kinds, views = [], summaries()
    for kind, (description, _) in KINDS.items():
        # The default view first.
        names = {one.name for one in views if one.kind == kind}
        texts = [
            f"{name} ({'; '.join(one.summary for one in views if one.name == name)})"
            for name in sorted(names, key=lambda name: (name != kind, name))
        ]
        if kind == "sweep":
            kinds.append(f"Of {description}: the name of a measure.")
        elif len(names) > 1:
            kinds.append(f"Of {description}: {', '.join(texts)}.")
    return " ".join(kinds)
