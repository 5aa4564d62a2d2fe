"""Where outputs come from: changes, configurations, the method, the program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mesoslip.configuration import differences
from mesoslip.configuration.config import Config
from mesoslip.output.access import is_measured
from mesoslip.output.kinds import kind_of
from mesoslip.quantities import with_unit
from mesoslip.reports.content import Block, Section, Source, Subject, Table, Text
from mesoslip.reports.method_paragraphs import computed_method, measured_method
from mesoslip.reports.references import PROGRAM, REFERENCES, numbered, program
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


def methods(subjects: Sequence[Subject]) -> Section:
    """A paragraph for a paper: model, parameters, program and version, with references."""
    texts = [_method(subjects[0])]
    texts += [_other(one, subjects[0]) for one in subjects[1:]]
    blocks: list[Block] = []
    keys: list[str] = []
    for text in dict.fromkeys(texts):
        shown, keys = numbered(text, keys)
        blocks.append(Text(shown))
    attributes = subjects[0].tree.attrs
    own = program(
        str(attributes.get("program_version", "")),
        str(attributes.get("commit", "")),
        str(attributes.get("date_created", ""))[:4],
    )
    cited = {key: own if key == PROGRAM else REFERENCES[key] for key in keys}
    blocks += [Text(f"[{place}] {one.line}") for place, one in enumerate(cited.values(), 1)]
    entries = (one.bibtex(key) for key, one in cited.items())
    blocks.append(Source("references in BibTeX", "\n\n".join(entries)))
    return Section("Methods", tuple(blocks))


def _method(subject: Subject) -> str:
    if is_measured(subject.tree) or not subject.has_config:
        return measured_method(subject.tree)
    return computed_method(subject.tree, subject.config)


def _other(subject: Subject, first: Subject) -> str:
    """The method of another output, as differences from the first if both were computed."""
    if any(is_measured(one.tree) or not one.has_config for one in (subject, first)):
        return _method(subject)
    found = differences.differences([subject.config, first.config])
    texts = [f"{one.key} = {one.values[0]}" for one in found if one.key != "title"]
    if not texts:
        return f"The output {subject.name} has the same configuration."
    return f"The output {subject.name} differs in {', '.join(texts)}."


# Attributes of an output, and their names on the page.
ATTRIBUTES = {
    "history": "history",
    "program_version": "version",
    "commit": "commit",
    "compiler": "compiler",
    "library_versions": "libraries",
    "seed": "seed",
    "solver": "solver",
    "break_count": "breaks of contacts",
    "advance_count": "steps of the slider",
    "wall_seconds": "computing time (s)",
}


def provenance(subjects: Sequence[Subject]) -> Section:
    """The program, the command and the cost of each output."""
    rows = tuple(
        (name, *(_text(one.tree.attrs.get(attribute)) for one in subjects))
        for attribute, name in ATTRIBUTES.items()
        if any(attribute in one.tree.attrs for one in subjects)
    )
    return Section("Provenance", (Table(("", *(one.name for one in subjects)), rows),))


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
