"""Response to a drive with stages: steady forces, velocity steps, holds."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.analysis import response as responses
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.errors import FileError
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import named, picture_of


def response(subjects: Sequence[Subject]) -> Section | None:
    """Steady forces, velocity steps, holds and rate-and-state parameters of a drive with stages."""
    experiments = []
    for subject in subjects:
        try:
            experiment = Experiment(subject.tree, subject.name)
        except FileError:
            # The drive is a force, or unknown, or the run ended before its first sample.
            continue
        stages = (
            {one.stage for one in subject.config.drive_parts}
            if subject.has_config
            else experiment.stages
        )
        if len(stages) > 1:
            experiments.append((subject, experiment))
    if not experiments:
        return None
    blocks: list[Block] = []
    for subject, experiment in experiments:
        tree = responses.response_of([experiment])
        blocks.append(Text(named(subjects, subject, responses.force_scale(tree))))
        for one in responses.tables(tree):
            head, rows = one.head, one.rows
            if any(one.notes):
                head = (*head, "note")
                rows = tuple((*row, note) for row, note in zip(rows, one.notes, strict=True))
            blocks.append(Text(f"{one.title}:"))
            blocks.append(Table(head, rows, one.line))
        caption = "Force against the displacement of the load point, and its analysis"
        blocks.append(picture_of(subjects, subject, caption, "response"))
    return Section("Response to the drive", tuple(blocks))
