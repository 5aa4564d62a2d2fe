"""Catalogues of slips, strokes and avalanches: statistics, distributions, rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mesoslip.analysis import avalanches as sizes
from mesoslip.analysis.slips import (
    HEADS,
    Catalogue,
    as_recorded,
    catalogue_of,
    counts,
    printed_counts,
)
from mesoslip.analysis.strokes.catalogue import strokes_of
from mesoslip.analysis.strokes.revolutions import has_rotation
from mesoslip.analysis.strokes.segments import output_pieces
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.plots.extent import max_size
from mesoslip.plots.style import curve_color
from mesoslip.quantities import column, scale_for
from mesoslip.reports.content import Block, Section, Subject, Table, Text, drawn
from mesoslip.reports.sections.base import (
    columns_in_one_unit,
    named,
    picture_of,
    picture_of_all,
    row_in_one_unit,
)

# Maximum number of rows of a catalogue on a page.
MAX_SLIPS = 60
# Bins of a histogram.
BINS = 24

# Columns on a page, but for the start.
COLUMNS = (
    *("force_before", "force_after", "force_drop", "peak_velocity", "contacts_broken"),
    *("duration", "waiting_time", "loading_stiffness", "creep_share"),
)
# Columns of which there are histograms.
DISTRIBUTIONS = ("force_drop", "duration", "waiting_time")
COUNTS_NOTE = (
    "Number of slips by minimum fall. Mirrored: steep falls of the trace mirrored in its loading, "
    "as many as noise makes."
)
STATISTICS = ("mean", "standard_deviation", "minimum", "maximum")


def slips(subjects: Sequence[Subject]) -> Section | None:
    """The catalogues of slips of runs with inertia."""
    with_slips = [
        one
        for one in subjects
        if "slips" in one.tree.children and not (one.has_config and one.config.slider.jumps)
    ]
    if not with_slips:
        return None
    blocks: list[Block] = []
    found = [catalogue_of(one.tree) for one in with_slips]
    for subject, catalogue in zip(with_slips, found, strict=True):
        blocks += _statistics(subjects, subject, catalogue)
        by_fall = counts(subject.tree)
        if by_fall is not None and any(by_fall["slip_count"]):
            table = printed_counts(by_fall, catalogue.force_unit)
            blocks.append(Table(table.head, table.rows, COUNTS_NOTE))
    if any(group_of(one.tree, "slips").sizes["slip"] > 1 for one in with_slips):
        blocks.append(drawn("Distributions of the slips", lambda: _histograms(with_slips, found)))
    if len(subjects) == 1:
        blocks += _first_rows(found[0])
    return Section("Slips", tuple(blocks))


def _statistics(subjects: Sequence[Subject], subject: Subject, catalogue: Catalogue) -> list[Block]:
    """Statistics of each column of a catalogue."""
    statistics = catalogue.statistics
    count = int(statistics["slips"]["count"])
    if count == 0:
        return [Text(named(subjects, subject, "There is no slip."))]
    rows = tuple(
        row_in_one_unit(header, [statistics[name][one] for one in STATISTICS], unit)
        for name, (header, unit) in _columns(catalogue).items()
        if name in statistics
    )
    shown = (one.replace("_", " ") for one in STATISTICS)
    head = (f"{count} slip{'s' if count > 1 else ''}", *shown)
    note = "Statistics include the first slip, which is larger if all contacts were relaxed."
    if catalogue.goes_back:
        note += " They are along the motion of each slip; slips backwards have negative forces."
    name: list[Block] = [Text(subject.name)] if len(subjects) > 1 else []
    return [*name, Table(head, rows, note)]


def _columns(catalogue: Catalogue) -> dict[str, tuple[str, str]]:
    """Header and unit of each column of an output."""
    return {name: as_recorded(*HEADS[name], catalogue.force_unit) for name in COLUMNS}


def _first_rows(catalogue: Catalogue) -> list[Block]:
    rows = catalogue.rows
    if not rows:
        return []
    shown = rows[:MAX_SLIPS]
    columns = [("start", [row["start_time"] for row in shown], "s", 7)]
    owners = [float(row["realization_index"]) for row in shown]
    if any(row["realization_index"] for row in rows):
        columns.insert(0, ("realization", owners, "1", 4))
    # A measured trace has no breaks.
    columns += [
        (header, [row[name] for row in shown], unit, 4)
        for name, (header, unit) in _columns(catalogue).items()
        if any(row[name] is not None for row in shown)
    ]
    note = f"The first {MAX_SLIPS} of {len(rows)} slips." if len(rows) > MAX_SLIPS else ""
    return [Table(*columns_in_one_unit(columns), note)]


def _histograms(subjects: Sequence[Subject], catalogues: Sequence[Catalogue]) -> Figure:
    """Force drops, durations and waiting times of slips, each output in a colour."""
    figure = Figure(figsize=(7.5, 2.5))
    panels = figure.subplots(1, len(DISTRIBUTIONS))
    for axes, name in zip(panels, DISTRIBUTIONS, strict=True):
        header, unit = _columns(catalogues[0])[name]
        all_values = [one.along_motion(name) for one in catalogues]
        all_values = [values[np.isfinite(values)] for values in all_values]
        scale = scale_for(max_size(*all_values), unit)
        together = np.concatenate(all_values) / scale.size
        axes.set_xlabel(scale.label(header))
        if together.size == 0:
            continue
        low, high = together.min(), together.max()
        # Values that differ by rounding have no distribution.
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            low, high = low - 0.5 * abs(low), high + 0.5 * abs(high) or 1.0
        bins = np.linspace(low, high, BINS + 1)
        for number, (values, subject) in enumerate(zip(all_values, subjects, strict=True)):
            axes.hist(
                values / scale.size,
                bins,
                histtype="step" if len(subjects) > 1 else "stepfilled",
                color=curve_color(number) if len(subjects) > 1 else "0.6",
                label=subject.name,
            )
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    panels[0].set_ylabel("number of slips")
    if len(subjects) > 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


# Maximum number of strokes or cycles on a page.
MAX_STROKES = 20


def strokes(subjects: Sequence[Subject]) -> Section | None:
    """Friction, loops, offset and stiffness of strokes and cycles."""
    blocks: list[Block] = []
    for subject in subjects:
        try:
            if output_pieces(subject.tree)[0] is None and not has_rotation(subject.tree):
                continue
            found = strokes_of(subject.tree, name=subject.name)
        except FileError:
            # A record without a whole stroke, or without samples.
            continue
        blocks += [
            Text(named(subjects, subject, f"{one[:1].upper()}{one[1:]}.")) for one in found.notes
        ]
        for table in reversed(found.tables):
            rows = table.rows[:MAX_STROKES]
            note = (
                f"The first {MAX_STROKES} of {len(table.rows)}."
                if len(table.rows) > MAX_STROKES
                else ""
            )
            blocks += [Text(f"{table.title}:"), Table(table.head, rows, note)]
        caption = "Loops, mean friction of each stroke, and friction over position and stroke"
        blocks.append(picture_of(subjects, subject, caption, "strokes"))
    return Section("Strokes", tuple(blocks)) if blocks else None


DIGITS = 5


def avalanches(subjects: Sequence[Subject]) -> Section | None:
    """The sizes of avalanches: statistics and distribution."""
    with_avalanches = [one for one in subjects if "avalanches" in one.tree.children]
    if not with_avalanches:
        return None
    blocks: list[Block] = []
    for subject in with_avalanches:
        statistics = sizes.avalanche_summary(subject.tree)
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        warning = sizes.warning(statistics)
        if warning is not None:
            blocks.append(Text(f"Warning: {warning}.", warns=True))
        blocks.append(Table(("quantity", "value", "meaning"), _quantities(statistics)))
    full = [one for one in with_avalanches if group_of(one.tree, "avalanches").sizes["avalanche"]]
    if full:
        blocks.append(picture_of_all(full, "Distribution of the sizes", "avalanches"))
    return Section("Avalanches", tuple(blocks))


def _quantities(statistics: Mapping[str, float | None]) -> tuple[tuple[str, ...], ...]:
    """Name, value with its error, and meaning of each quantity."""
    errors = {f"{name}_error" for name in statistics} & set(statistics)
    rows = []
    for name, value in statistics.items():
        if name in errors:
            continue
        unit, meaning = sizes.SUMMARY[name]
        shown = column([value], unit, DIGITS)
        text = shown.text(value, statistics.get(f"{name}_error"))
        rows.append((shown.head(name), text, meaning))
    return tuple(rows)
