"""Catalogues of avalanches: statistics of the sizes, and their distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mesoslip.analysis import avalanches as catalogue
from mesoslip.output.access import group_of
from mesoslip.plots import draw
from mesoslip.quantities import column
from mesoslip.reports.content import Block, Section, Subject, Table, Text, drawn

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
        trees, names = [one.tree for one in full], [one.name for one in full]
        if len(full) == 1:
            picture = draw.picture(trees[0], "avalanches")
        else:
            picture = draw.comparison(trees, names, "avalanches")
        blocks.append(drawn("Distribution of the sizes", lambda: picture.whole(None)))
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
