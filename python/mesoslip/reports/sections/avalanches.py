"""Catalogues of avalanches: statistics of the sizes, and their distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mesoslip.analysis import avalanches as catalogue
from mesoslip.output.access import group_of
from mesoslip.quantities import column
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import picture_of_all

DIGITS = 5


def avalanches(subjects: Sequence[Subject]) -> Section | None:
    """The sizes of avalanches: statistics and distribution."""
    with_avalanches = [one for one in subjects if "avalanches" in one.tree.children]
    if not with_avalanches:
        return None
    blocks: list[Block] = []
    for subject in with_avalanches:
        statistics = catalogue.avalanche_summary(subject.tree)
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        warning = catalogue.warning(statistics)
        if warning is not None:
            blocks.append(Text(f"Warning: {warning}.", warns=True))
        blocks.append(Table(("quantity", "value", "meaning"), _rows(statistics)))
    full = [one for one in with_avalanches if group_of(one.tree, "avalanches").sizes["avalanche"]]
    if full:
        blocks.append(picture_of_all(full, "Distribution of the sizes", "avalanches"))
    return Section("Avalanches", tuple(blocks))


def _rows(statistics: Mapping[str, float | None]) -> tuple[tuple[str, ...], ...]:
    """Name, value with its error, and meaning of each quantity."""
    errors = {f"{name}_error" for name in statistics} & set(statistics)
    rows = []
    for name, value in statistics.items():
        if name in errors:
            continue
        unit, meaning = catalogue.SUMMARY[name]
        shown = column([value], unit, DIGITS)
        text = shown.text(value, statistics.get(f"{name}_error"))
        rows.append((shown.head(name), text, meaning))
    return tuple(rows)
