"""Derived numbers of force curves, onsets of slip and settled cycles.

The theory is imported where it is used: a report of a run has none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mesoslip.reports.content import Section, Subject, Table, Text
from mesoslip.reports.sections.base import named, row_in_one_unit

DIGITS = 5


def curve(subjects: Sequence[Subject]) -> Section:
    """Numbers of force curves."""
    from mesoslip.theory.force_curve_dataset import SUMMARY

    return _numbers("Force curve", subjects, SUMMARY)


def cycle(subjects: Sequence[Subject]) -> Section:
    """Numbers of settled cycles."""
    from mesoslip.cycles.cycle_result import SUMMARY

    return _numbers("Settled motion", subjects, SUMMARY)


def onset(subjects: Sequence[Subject]) -> Section:
    """Numbers of onsets of slip."""
    from mesoslip.theory.slip_onset import SUMMARY

    return _numbers("Onset of slip", subjects, SUMMARY)


def _numbers(
    title: str, subjects: Sequence[Subject], summary: Mapping[str, tuple[str, str]]
) -> Section:
    """Numbers that outputs have as attributes, side by side, with their meanings."""
    rows = []
    for name, (unit, meaning) in summary.items():
        values = [one.tree.attrs.get(name) for one in subjects]
        if any(value is not None for value in values):
            rows.append((*_row(name, values, unit), meaning))
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    table = Table(("quantity", *names, "meaning"), tuple(rows))
    comments = (
        Text(named(subjects, one, f"{one.tree.attrs['comment']}."))
        for one in subjects
        if one.tree.attrs.get("comment")
    )
    return Section(title, (table, *comments))


def _row(name: str, values: Sequence[Any], unit: str) -> tuple[str, ...]:
    """A quantity with its unit, and its values in that unit; words as they are."""
    numbers = [None if one is None or isinstance(one, str) else float(one) for one in values]
    head, *texts = row_in_one_unit(name, numbers, unit, DIGITS)
    shown = [one if isinstance(one, str) else text for one, text in zip(values, texts, strict=True)]
    return (head, *shown)
