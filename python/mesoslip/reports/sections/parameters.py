"""Posteriors: parameters of fits, and of rates and states, with their uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mesoslip.quantities import column
from mesoslip.reports.content import Block, Section, Subject, Table, Text
from mesoslip.reports.sections.base import picture_of

if TYPE_CHECKING:
    from mesoslip.inference.posterior import Row


HEAD = ("parameter", "median", "50 % interval", "90 % interval", "verdict", "follows from")


def parameters(subjects: Sequence[Subject]) -> Section:
    """Parameters of fits with their intervals, and the warnings of the fits."""
    from mesoslip.inference import posterior

    blocks: list[Block] = []
    for subject in subjects:
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        probability = float(subject.tree.attrs["agreement_probability"])
        note = f"Agreement of the model with the trace: p = {probability:.2g}."
        rows = tuple(_row(one) for one in posterior.table(subject.tree))
        blocks.append(Table(HEAD, rows, note))
        warnings = str(subject.tree.attrs["warnings"]).split("\n")
        blocks += [Text(f"Warning: {one}.", warns=True) for one in warnings if one]
        notes = str(subject.tree.attrs["notes"]).split("\n")
        blocks += [Text(f"{one[0].upper()}{one[1:]}.") for one in notes if one]
        caption = "Parameters, and predicted traces beside the measured one"
        blocks.append(picture_of(subjects, subject, caption))
        if subject.tree.attrs["disagreeing"]:
            caption = "Where the traces disagree with the predictions"
            blocks.append(picture_of(subjects, subject, caption, "misfit"))
    return Section("Parameters", tuple(blocks))


def _row(parameter: Row) -> tuple[str, ...]:
    """A parameter with its unit, its median and intervals in that unit, and its verdict."""
    shown = column(parameter.percentiles, parameter.unit, parameter.digits)
    low, lower, median, upper, high = (shown.text(one) for one in parameter.percentiles)
    intervals = (f"{lower} to {upper}", f"{low} to {high}")
    key = shown.head(parameter.key)
    return (key, median, *intervals, parameter.verdict, parameter.follows_from)


def rates(subjects: Sequence[Subject]) -> Section:
    """Parameters of rate-and-state laws with their intervals, and whether each law describes the
    record."""
    from mesoslip.inference.rate_tree import rate_table, remarks

    blocks: list[Block] = []
    for subject in subjects:
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        table, found = rate_table(subject.tree), remarks(subject.tree)
        blocks.append(Table(table.head, table.rows))
        texts = (*found["assessments"], *found["notes"])
        blocks += [Text(f"{one[0].upper()}{one[1:]}.") for one in texts]
        blocks += [Text(f"Warning: {one}.", warns=True) for one in found["warnings"]]
        caption = "Parameters of the first law, and the record with predicted ones"
        blocks.append(picture_of(subjects, subject, caption))
    return Section("Rates and states", tuple(blocks))
