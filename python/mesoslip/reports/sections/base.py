"""Blocks that several sections have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mesoslip.plots import draw
from mesoslip.plots.views.base import Options
from mesoslip.quantities import column
from mesoslip.reports.content import Picture, Subject, drawn


def named(subjects: Sequence[Subject], subject: Subject, text: str) -> str:
    """A text, with the name of its output if there are several outputs."""
    return text if len(subjects) == 1 else f"{subject.name}: {text}"


def picture_of(
    subjects: Sequence[Subject],
    subject: Subject,
    caption: str,
    view: str | None = None,
    options: Options = draw.NO_OPTIONS,
) -> Picture:
    """A view of an output."""
    return picture_of_all([subject], named(subjects, subject, caption), view, options)


def picture_of_all(
    subjects: Sequence[Subject],
    caption: str,
    view: str | None = None,
    options: Options = draw.NO_OPTIONS,
) -> Picture:
    """A view of outputs over each other."""
    trees, names = [one.tree for one in subjects], [one.name for one in subjects]
    picture = draw.picture(trees, names, view, options)
    return drawn(caption, lambda: picture.whole(None))


def row_in_one_unit(
    name: str, values: Sequence[float | None], unit: str, digits: int = 4
) -> tuple[str, ...]:
    """A row of a table: a quantity with its unit, and its values in that unit."""
    row = column(values, unit, digits)
    return (row.head(name), *(row.text(value) for value in values))


def columns_in_one_unit(
    columns: Iterable[tuple[str, Sequence[float | None], str, int]],
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """The head and the rows of a table, from name, values [SI], unit and digits of its columns."""
    heads, cells = [], []
    for name, values, unit, digits in columns:
        one = column(values, unit, digits)
        heads.append(one.head(name))
        cells.append([one.text(value) for value in values])
    return tuple(heads), tuple(zip(*cells, strict=True))
