"""Configurations of outputs."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.configuration import differences
from mesoslip.reports.content import Block, Section, Source, Subject, Table
from mesoslip.reports.sections.base import named


def configuration(subjects: Sequence[Subject]) -> Section:
    """All keys, with those of several outputs side by side."""
    tables = [differences.flat(one.config) for one in subjects]
    keys = dict.fromkeys(key for table in tables for key in table)
    rows = tuple(
        (key, *(differences.text_of(key, table.get(key)) for table in tables)) for key in keys
    )
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    blocks: list[Block] = [Table(("key", *names), rows)]
    for subject in subjects:
        title = named(subjects, subject, "as a file, in SI units")
        blocks.append(Source(title, subject.tree.attrs["configuration"]))
    return Section("Configuration", tuple(blocks))
