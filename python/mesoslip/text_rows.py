"""Tables in the text of a program, for rows that are too long for a line of code each."""

from __future__ import annotations

from collections.abc import Iterator


def rows_of_text(text: str) -> Iterator[list[str]]:
    """The cells of rows of a text, between ``|``; indented lines continue the row above."""
    for row in text.strip().replace("\n    ", " ").splitlines():
        yield [cell.strip() for cell in row.split("|")]


def named_meanings(rows: str) -> dict[str, tuple[str, str]]:
    """Units and meanings of quantities by name, from rows of a text."""
    return {name: (unit, meaning) for name, unit, meaning in rows_of_text(rows)}
