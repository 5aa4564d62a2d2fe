"""Regimes of runs."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.analysis import regime as regimes
from mesoslip.reports.content import Section, Subject, Text
from mesoslip.reports.sections.base import named


def regime(subjects: Sequence[Subject]) -> Section:
    """The regime of the motion of each run."""
    blocks = []
    for subject in subjects:
        found = regimes.regimes(subject.tree, subject.name)
        text = (
            f"in the last stage the slider {found.attrs['motion']}"
            if "motion" in found.attrs
            else regimes.summary(regimes.results_of(found))
        )
        blocks.append(Text(named(subjects, subject, f"{text[:1].upper()}{text[1:]}.")))
    return Section("Regime", tuple(blocks))
