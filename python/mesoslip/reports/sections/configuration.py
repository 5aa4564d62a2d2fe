"""Configurations of outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mesoslip.configuration import differences
from mesoslip.output.kinds import kind_of
from mesoslip.reports.content import Block, Section, Source, Subject, Table, Text
from mesoslip.reports.sections.base import named

# Mark of keys that a fit estimates.
FREE = "free"
FREE_NOTE = (
    "Free keys are estimated by the fit within the range given here; their values in the file are "
    "not used."
)


def configuration(subjects: Sequence[Subject]) -> Section:
    """All keys, those of several outputs side by side; the free keys of a fit are marked."""
    configured = [one for one in subjects if one.has_config]
    blocks: list[Block] = []
    if configured:
        blocks.append(_keys(configured, len(subjects) > 1))
    for subject in configured:
        for key, rows in _lists(subject).items():
            blocks.append(Text(named(subjects, subject, f"{key}:")))
            blocks.append(_list(key, rows))
    for subject in subjects:
        title = named(subjects, subject, "as a file, in SI units")
        blocks.append(Source(title, subject.tree.attrs["configuration"]))
        if subject.tree.attrs.get("trace"):
            title = named(subjects, subject, "description of the measurement")
            blocks.append(Source(title, subject.tree.attrs["trace"]))
    return Section("Configuration", tuple(blocks))


def _keys(subjects: Sequence[Subject], is_named: bool) -> Table:
    """A row for each key, in one unit."""
    tables = [differences.flat(one.config) for one in subjects]
    free = [_free_keys(one) for one in subjects]
    rows, marked = [], []
    for key in dict.fromkeys(key for table in tables for key in table):
        values = [table.get(key) for table in tables]
        if any(_is_list_of_tables(value) for value in values):
            continue
        # The value of a free key is not used: its range is shown.
        parts = [one.get(key, (value,)) for one, value in zip(free, values, strict=True)]
        head, texts = differences.in_one_unit(key, [one for part in parts for one in part])
        each = iter(texts)
        cells = [[next(each) for _ in part] for part in parts]
        rows.append((head, *map(_cell, cells)))
        if any(key in one for one in free):
            marked.append(len(rows) - 1)
    names = [one.name for one in subjects] if is_named else ["value"]
    return Table(("key", *names), tuple(rows), FREE_NOTE if marked else "", tuple(marked))


def _cell(texts: Sequence[str]) -> str:
    """A value, or the ends of the range of a free key."""
    return texts[0] if len(texts) == 1 else f"{FREE}, {' to '.join(texts)}"


def _free_keys(subject: Subject) -> dict[str, tuple[float, float]]:
    """The keys that a fit estimates, with the ends of their ranges in SI."""
    if kind_of(subject.tree) != "fit":
        return {}
    from mesoslip.inference import posterior

    return {one.key: (one.low, one.high) for one in posterior.table(subject.tree)}


def _is_list_of_tables(value: object) -> bool:
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)


def _lists(subject: Subject) -> dict[str, Sequence[Mapping[str, Any]]]:
    """Keys that are lists of tables, such as the stages of the drive."""
    return {
        key: value
        for key, value in differences.flat(subject.config).items()
        if _is_list_of_tables(value)
    }


def _list(key: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """A list of tables as rows, with each column in one unit."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns = [("number", tuple(str(number) for number in range(1, len(rows) + 1)))]
    columns += [
        differences.in_one_unit(f"{key}.{name}", [row.get(name) for row in rows]) for name in names
    ]
    cells = zip(*(texts for _, texts in columns), strict=True)
    return Table(tuple(head.removeprefix(f"{key}.") for head, _ in columns), tuple(cells))
