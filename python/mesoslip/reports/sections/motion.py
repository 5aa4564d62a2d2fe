"""The motion of runs and traces: regimes, responses to the drive, energy balances."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.regime.outputs import judge
from mesoslip.analysis.regime.result import summary
from mesoslip.analysis.response.dataset import response_of
from mesoslip.analysis.response.tables import force_scale, tables
from mesoslip.errors import FileError
from mesoslip.output import variables
from mesoslip.output.access import group_of, is_measured
from mesoslip.quantities import UNKNOWN, number
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import columns_in_one_unit, named, picture_of


def regime(subjects: Sequence[Subject]) -> Section:
    """The regime of the motion of each run."""
    blocks = []
    for subject in subjects:
        results, motion = judge(subject.tree, subject.name)
        text = summary(results) if motion is None else f"in the last stage the slider {motion}"
        blocks.append(Text(named(subjects, subject, f"{text[:1].upper()}{text[1:]}.")))
    return Section("Regime", tuple(blocks))


DIGITS = 5


def energy(subjects: Sequence[Subject]) -> Section | None:
    """The energy balance of each run, its audit, and whether the run is complete."""
    blocks: list[Block] = []
    # A measured trace has no balance.
    for subject in (one for one in subjects if not is_measured(one.tree)):
        attributes = subject.tree.attrs
        audit = attributes.get("audit", "")
        residual = abs(float(attributes.get("energy_residual", math.nan)))
        text = f"Residual of the balance: {residual:.1g} of the drive's work. Audit: {audit}."
        blocks.append(Text(named(subjects, subject, text), warns=audit not in {"passed", ""}))
        if attributes.get("complete") == "false":
            blocks.append(Text(named(subjects, subject, attributes["comment"]), warns=True))
        if "energy" in subject.tree.children:
            blocks.append(_balance(subject))
    return Section("Energy", tuple(blocks)) if blocks else None


def _balance(subject: Subject) -> Table:
    """Energies, and their fractions of the work of the drive."""
    data = group_of(subject.tree, "energy")
    work = abs(float(data["drive_work"].values.sum()))
    energies = {
        meaning.long_name: float(data[name].values.sum())
        for name, meaning in variables.ENERGY.items()
        if name in data
    }
    (head,), cells = columns_in_one_unit([("energy", list(energies.values()), "J", DIGITS)])
    rows = tuple(
        (name, text, number(100 * value / work, DIGITS) if work > 0 else UNKNOWN)
        for (name, value), (text,) in zip(energies.items(), cells, strict=True)
    )
    return Table(("sum over realizations", head, "part of the drive's work (%)"), rows)


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
        tree = response_of([experiment])
        blocks.append(Text(named(subjects, subject, force_scale(tree))))
        for one in tables(tree):
            head, rows = one.head, one.rows
            if any(one.notes):
                head = (*head, "note")
                rows = tuple((*row, note) for row, note in zip(rows, one.notes, strict=True))
            blocks.append(Text(f"{one.title}:"))
            blocks.append(Table(head, rows, one.line))
        caption = "Force against the displacement of the load point, and its analysis"
        blocks.append(picture_of(subjects, subject, caption, "response"))
    return Section("Response to the drive", tuple(blocks))
