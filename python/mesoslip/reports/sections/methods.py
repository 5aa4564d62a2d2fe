"""The method as a paragraph to paste, with its references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from mesoslip.configuration import differences
from mesoslip.configuration.config import Config
from mesoslip.output.access import is_measured
from mesoslip.output.kinds import kind_of
from mesoslip.reports.content import Block, Section, Source, Subject, Text
from mesoslip.reports.methods import (
    branches_method,
    curve_method,
    cycle_method,
    fit_method,
    lyapunov_method,
    measured_method,
    onset_method,
    run_method,
    steady_method,
    sweep_method,
)
from mesoslip.reports.references import PROGRAM, REFERENCES, numbered, program

if TYPE_CHECKING:
    import xarray as xr

# How the method of each kind of output is described.
METHODS: dict[str, Callable[[xr.DataTree, Config], str]] = {
    "run": run_method,
    "sweep": sweep_method,
    "cycle": cycle_method,
    "branches": branches_method,
    "curve": curve_method,
    "steady": steady_method,
    "onset": onset_method,
    "lyapunov": lyapunov_method,
    "fit": fit_method,
}


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
    return METHODS[kind_of(subject.tree)](subject.tree, subject.config)


def _other(subject: Subject, first: Subject) -> str:
    """The method of a further output, as differences from the first if both were computed."""
    if any(is_measured(one.tree) or not one.has_config for one in (subject, first)):
        return _method(subject)
    found = differences.differences([subject.config, first.config])
    texts = [f"{one.key} = {one.values[0]}" for one in found if one.key != "title"]
    if not texts:
        return f"The output {subject.name} has the same configuration."
    return f"The output {subject.name} differs in {', '.join(texts)}."
