"""Derived numbers of force curves, onsets of slip, settled cycles and Lyapunov exponents.

The theory is imported where it is used: a report of a run has none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mesoslip.reports.content import Section, Subject, Table, Text
from mesoslip.reports.sections.base import named, row_in_one_unit

DIGITS = 5


def curve(subjects: Sequence[Subject]) -> Section:
    """Numbers of force curves."""
    from mesoslip.theory.curve import SUMMARY

    return _numbers("Force curve", subjects, SUMMARY)


def cycle(subjects: Sequence[Subject]) -> Section:
    """Numbers of settled cycles."""
    from mesoslip.cycles.cycle_result import SUMMARY

    return _numbers("Settled motion", subjects, SUMMARY)


def onset(subjects: Sequence[Subject]) -> Section:
    """Numbers of onsets of slip."""
    from mesoslip.theory.slip_onset import SUMMARY

    return _numbers("Onset of slip", subjects, SUMMARY)


def lyapunov(subjects: Sequence[Subject]) -> Section:
    """Largest Lyapunov exponents, and the range of distances that was fitted."""
    from mesoslip.analysis.lyapunov import SUMMARY, summary

    table = _table(subjects, SUMMARY, lambda tree, name: float(tree[name]), 4)
    texts = (Text(named(subjects, one, f"{summary(one.tree)}.")) for one in subjects)
    return Section("Largest Lyapunov exponent", (table, *texts))


def _numbers(
    title: str, subjects: Sequence[Subject], summary: Mapping[str, tuple[str, str]]
) -> Section:
    """Attributes of outputs that have units and meanings in a summary, and their comments."""
    table = _table(subjects, summary, lambda tree, name: tree.attrs.get(name), DIGITS)
    comments = (
        Text(named(subjects, one, f"{one.tree.attrs['comment']}."))
        for one in subjects
        if one.tree.attrs.get("comment")
    )
    return Section(title, (table, *comments))


def _table(
    subjects: Sequence[Subject],
    summary: Mapping[str, tuple[str, str]],
    value_of: Callable[[Any, str], Any],
    digits: int,
) -> Table:
    """Quantities of outputs side by side, each in one unit, with their meanings; words are kept."""
    rows = []
    for name, (unit, meaning) in summary.items():
        values = [value_of(one.tree, name) for one in subjects]
        if all(value is None for value in values):
            continue
        numbers = [None if one is None or isinstance(one, str) else float(one) for one in values]
        head, *texts = row_in_one_unit(name, numbers, unit, digits)
        shown = [
            one if isinstance(one, str) else text for one, text in zip(values, texts, strict=True)
        ]
        rows.append((head, *shown, meaning))
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    return Table(("quantity", *names, "meaning"), tuple(rows))
