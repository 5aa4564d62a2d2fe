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
        results, motion = regimes.judge(subject.tree, subject.name)
        text = (
            regimes.summary(results) if motion is None else f"in the last stage the slider {motion}"
        )
        blocks.append(Text(named(subjects, subject, f"{text[:1].upper()}{text[1:]}.")))
    return Section("Regime", tuple(blocks))
