"""Lyapunov exponents."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.analysis.lyapunov import SUMMARY, summary
from mesoslip.reports.content import Section, Subject, Table, Text
from mesoslip.reports.sections.base import named, row_in_one_unit

DIGITS = 4


def lyapunov(subjects: Sequence[Subject]) -> Section:
    """Largest exponents and the range of distances that was fitted."""
    rows = [
        (*row_in_one_unit(name, [float(one.tree[name]) for one in subjects], unit, DIGITS), meaning)
        for name, (unit, meaning) in SUMMARY.items()
    ]
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    table = Table(("quantity", *names, "meaning"), tuple(rows))
    texts = (Text(named(subjects, one, f"{summary(one.tree)}.")) for one in subjects)
    return Section("Largest Lyapunov exponent", (table, *texts))
