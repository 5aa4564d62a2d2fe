"""Posteriors of rates and states."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import picture_of


def rates(subjects: Sequence[Subject]) -> Section:
    """Parameters of rate-and-state laws with their intervals, and whether each law describes the
    record."""
    from mesoslip.inference.rate_tree import rate_table, remarks

    blocks: list[Block] = []
    for subject in subjects:
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        table, found = rate_table(subject.tree), remarks(subject.tree)
        blocks.append(Table(table.head, table.rows))
        texts = (*found["assessments"], *found["notes"])
        blocks += [Text(f"{one[0].upper()}{one[1:]}.") for one in texts]
        blocks += [Text(f"Warning: {one}.", warns=True) for one in found["warnings"]]
        caption = "Parameters of the first law, and the record with predicted ones"
        blocks.append(picture_of(subjects, subject, caption))
    return Section("Rates and states", tuple(blocks))
