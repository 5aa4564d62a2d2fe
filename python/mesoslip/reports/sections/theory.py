"""Derived numbers of force curves and of onsets of slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mesoslip.quantities import UNKNOWN, column
from mesoslip.reports.content import Section, Subject, Table, Text
from mesoslip.reports.sections.base import named
from mesoslip.theory import force_curve, slip_onset

DIGITS = 5


def curve(subjects: Sequence[Subject]) -> Section:
    """Numbers of force curves."""
    return _numbers("Force curve", subjects, force_curve.SUMMARY)


def onset(subjects: Sequence[Subject]) -> Section:
    """Numbers of onsets of slip."""
    return _numbers("Onset of slip", subjects, slip_onset.SUMMARY)


def _numbers(
    title: str, subjects: Sequence[Subject], summary: Mapping[str, tuple[str, str]]
) -> Section:
    """Numbers that outputs have as attributes, side by side, with their meanings."""
    rows = []
    for name, (unit, meaning) in summary.items():
        values = [one.tree.attrs.get(name) for one in subjects]
        if any(value is not None for value in values):
            rows.append((name, *_texts(values, unit), meaning))
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    table = Table(("quantity", *names, "meaning"), tuple(rows))
    comments = (
        Text(named(subjects, one, f"{one.tree.attrs['comment']}."))
        for one in subjects
        if one.tree.attrs.get("comment")
    )
    return Section(title, (table, *comments))


def _texts(values: Sequence[Any], unit: str) -> list[str]:
    """Values of a quantity, all in one unit; words as they are."""
    numbers = [float(one) for one in values if one is not None and not isinstance(one, str)]
    shown = column(numbers, unit, DIGITS)

    def text(value: Any) -> str:
        if value is None:
            return UNKNOWN
        if isinstance(value, str):
            return value
        return f"{shown.text(float(value))} {shown.scale.name}".rstrip()

    return [text(value) for value in values]
