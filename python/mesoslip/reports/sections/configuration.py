"""Configurations of outputs."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.configuration import differences
from mesoslip.quantities import with_unit
from mesoslip.reports.content import Block, Section, Source, Subject, Table
from mesoslip.reports.sections.base import named


def configuration(subjects: Sequence[Subject]) -> Section:
    """All keys, with those of several outputs side by side."""
    configured = [one for one in subjects if one.has_config]
    blocks: list[Block] = []
    if configured:
        tables = [differences.flat(one.config) for one in configured]
        free = [_free_keys(one) for one in configured]
        keys = dict.fromkeys(key for table in tables for key in table)
        rows = tuple(
            (
                key,
                *(
                    ranges.get(key, differences.text_of(key, table.get(key)))
                    for table, ranges in zip(tables, free, strict=True)
                ),
            )
            for key in keys
        )
        names = [one.name for one in configured] if len(subjects) > 1 else ["value"]
        blocks.append(Table(("key", *names), rows))
    for subject in subjects:
        title = named(subjects, subject, "as a file, in SI units")
        blocks.append(Source(title, subject.tree.attrs["configuration"]))
        if subject.tree.attrs.get("trace"):
            title = named(subjects, subject, "description of the measurement")
            blocks.append(Source(title, subject.tree.attrs["trace"]))
    return Section("Configuration", tuple(blocks))


def _free_keys(subject: Subject) -> dict[str, str]:
    """The free keys of a fit, whose values in the configuration are not used, with their ranges."""
    if "posterior" not in subject.tree.children:
        return {}
    data = subject.tree["parameters"].to_dataset()
    found = {}
    for index, key in enumerate(data["parameter"].values.tolist()):
        one = data.isel(parameter=index)
        unit = str(one["units"].item())
        low, high = (with_unit(one[end].item(), unit) for end in ("low", "high"))
        found[key] = f"free, {low} to {high}"
    return found
