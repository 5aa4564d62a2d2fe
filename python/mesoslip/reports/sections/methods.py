"""The method as a paragraph to paste, with its references."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.configuration import differences
from mesoslip.output.access import is_measured
from mesoslip.reports.content import Block, Section, Source, Subject, Text
from mesoslip.reports.method_paragraphs import computed_method, measured_method
from mesoslip.reports.references import PROGRAM, REFERENCES, numbered, program


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
