"""Differences of outputs, and changes of each from its base."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mesoslip.configuration import differences
from mesoslip.configuration.config import Config
from mesoslip.output.access import is_measured
from mesoslip.quantities import with_unit
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import named


def changes(subjects: Sequence[Subject]) -> Section:
    """Differences of several outputs, and the changes of each from its base."""
    blocks: list[Block] = []
    for subject in subjects:
        if is_measured(subject.tree):
            blocks += _measured(subject)
    if len(subjects) > 1 and all(one.has_config for one in subjects):
        blocks.append(_differences(subjects))
    for subject in subjects:
        if subject.has_config:
            blocks += _from_base(subjects, subject)
    title = "Differences" if len(subjects) > 1 else "Changes from the base"
    return Section(title, tuple(blocks))


def _measured(subject: Subject) -> Iterator[Block]:
    """The origin of a measured trace."""
    attributes = subject.tree.attrs
    samples = subject.tree.sizes["time"]
    unit = "N" if "spring_force" in subject.tree.data_vars else "1"
    noise = with_unit(attributes["noise"], unit, 3)
    yield Text(
        f"{subject.name}: measured ({attributes['measured_file']}, {samples} samples, noise "
        f"{noise}); its configuration has the known parameters of the experiment."
    )
    if attributes.get("comment"):
        yield Text(f"{subject.name}: {attributes['comment']}.", warns=True)


def _differences(subjects: Sequence[Subject]) -> Block:
    """The keys in which outputs differ."""
    found = differences.differences([one.config for one in subjects])
    if not found:
        return Text("Differences: none.")
    rows = _rows([one.config for one in subjects], [one.key for one in found])
    return Table(("key", *(one.name for one in subjects)), rows)


def _rows(configs: Sequence[Config], keys: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Values of keys in configurations side by side, a row for each key."""
    tables = [differences.flat(one) for one in configs]
    found = [differences.in_one_unit(key, [one.get(key) for one in tables]) for key in keys]
    return tuple((head, *texts) for head, texts in found)


def _from_base(subjects: Sequence[Subject], subject: Subject) -> Iterator[Block]:
    """The keys that an output changes from its base."""
    base = subject.tree.attrs.get("base_configuration")
    config = None if base is None else Config.from_toml(base)
    both = [] if config is None else [subject.config, config]
    changed = [one.key for one in differences.differences(both)]
    title = f", “{config.title}”" if config is not None and config.title else ""
    text = f"Changes from the base{title}:"
    if not changed:
        yield Text(named(subjects, subject, f"{text} none."))
        return
    yield Text(named(subjects, subject, text))
    yield Table(("key", "value", "value in the base"), _rows(both, changed))
