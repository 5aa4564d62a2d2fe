"""Sweeps: swept keys, states of the runs, measures and their maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import DataArray
from mesoslip.configuration import differences
from mesoslip.configuration.units import from_cf_units
from mesoslip.plots.views.sweep import measures
from mesoslip.reports.content import Block, Section, Source, Subject, Table, Text
from mesoslip.reports.sections.base import named, picture_of, row_in_one_unit

# Maximum number of measures with a picture.
MAX_MAPS = 12
# Maximum number of values of a swept key for which all are listed.
MAX_VALUES = 10


def sweep(subjects: Sequence[Subject]) -> Section:
    """The swept keys, the states of the runs, and the ranges of the measures."""
    blocks: list[Block] = []
    for subject in subjects:
        data = subject.tree.to_dataset()
        status, names = data["status"].values, data["status"].attrs["flag_meanings"].split()
        counts = {name: int(np.sum(status == code)) for code, name in enumerate(names)}
        states = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        text = named(subjects, subject, f"{status.size} runs: {states}.")
        blocks.append(Text(text, warns=counts["ok"] < status.size))
        if subject.tree.attrs.get("failures"):
            blocks.append(Source("errors of failed runs", str(subject.tree.attrs["failures"])))
        keys = [(str(name), data[name].values) for name in data.coords]
        rows = tuple(_listed(name, values) for name, values in keys)
        blocks.append(Table(("key", "number of values", "values"), rows))
        ranges = tuple(_range(data[name]) for name in measures(data))
        blocks.append(Table(("measure", "minimum", "mean", "maximum"), ranges))
        for title in ("configuration", "sweep"):
            if title in subject.tree.attrs:
                blocks.append(Source(title, str(subject.tree.attrs[title])))
    return Section("Sweep", tuple(blocks))


def _range(data: DataArray) -> tuple[str, ...]:
    """The range of a measure; of a choice, how often each value occurred."""
    values = data.values.astype(float)
    values = values[np.isfinite(values)]
    name = str(data.name)
    if "flag_meanings" in data.attrs:
        meanings = str(data.attrs["flag_meanings"]).split()
        codes = np.asarray(data.attrs["flag_values"]).tolist()
        counts = [
            f"{count} {meaning.replace('_', '-')}"
            for code, meaning in zip(codes, meanings, strict=True)
            if (count := np.count_nonzero(values == code))
        ]
        return name, "", ", ".join(counts), ""
    if values.size == 0:
        return name, "", "none", ""
    unit = from_cf_units(str(data.attrs.get("units", "1")))
    return row_in_one_unit(name, [values.min(), values.mean(), values.max()], unit)


def _listed(key: str, values: NDArray[Any]) -> tuple[str, ...]:
    """A swept key, the number of its values, and these, or the first and the last of many."""
    head, texts = differences.in_one_unit(key, values.tolist())
    listed = ", ".join(texts) if len(texts) <= MAX_VALUES else f"{texts[0]} … {texts[-1]}"
    return head, str(values.size), listed


def maps(subjects: Sequence[Subject]) -> Section:
    """A picture of each measure."""
    blocks: list[Block] = []
    for subject in subjects:
        for name in measures(subject.tree.to_dataset())[:MAX_MAPS]:
            blocks.append(picture_of(subjects, subject, name, name))
    return Section("Pictures", tuple(blocks))
