"""Strokes of records that go back and forth."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.analysis.strokes import has_rotation, output_pieces, strokes_of
from mesoslip.errors import FileError
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import named, picture_of

# Maximum number of rows of a table on a page.
MAX_ROWS = 20


def strokes(subjects: Sequence[Subject]) -> Section | None:
    """Friction, loops, offset and stiffness of strokes and cycles."""
    blocks: list[Block] = []
    for subject in subjects:
        try:
            if output_pieces(subject.tree)[0] is None and not has_rotation(subject.tree):
                continue
            found = strokes_of(subject.tree, name=subject.name)
        except FileError:
            # A record without a whole stroke, or without samples.
            continue
        blocks += [
            Text(named(subjects, subject, f"{one[:1].upper()}{one[1:]}.")) for one in found.notes
        ]
        for table in reversed(found.tables):
            rows = table.rows[:MAX_ROWS]
            note = (
                f"The first {MAX_ROWS} of {len(table.rows)}." if len(table.rows) > MAX_ROWS else ""
            )
            blocks += [Text(f"{table.title}:"), Table(table.head, rows, note)]
        caption = "Loops, mean friction of each stroke, and friction over position and stroke"
        blocks.append(picture_of(subjects, subject, caption, "strokes"))
    return Section("Strokes", tuple(blocks)) if blocks else None
