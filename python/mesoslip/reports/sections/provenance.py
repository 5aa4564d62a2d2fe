"""Origins of outputs."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.reports.content import Section, Subject, Table

# Attributes of an output, and their names on the page.
ATTRIBUTES = {
    "history": "history",
    "program_version": "version",
    "commit": "commit",
    "compiler": "compiler",
    "library_versions": "libraries",
    "seed": "seed",
    "solver": "solver",
    "break_count": "breaks of contacts",
    "advance_count": "steps of the slider",
    "wall_seconds": "computing time (s)",
}


def provenance(subjects: Sequence[Subject]) -> Section:
    """The program, the command and the cost of each output."""
    rows = tuple(
        (name, *(_text(one.tree.attrs.get(attribute)) for one in subjects))
        for attribute, name in ATTRIBUTES.items()
        if any(attribute in one.tree.attrs for one in subjects)
    )
    return Section("Provenance", (Table(("", *(one.name for one in subjects)), rows),))


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
