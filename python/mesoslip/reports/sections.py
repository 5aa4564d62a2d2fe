"""The sections that the report of each kind of output has.

Adding one is adding a function to a list of `SECTIONS`; another kind of output adds a list, and
what tells it apart to `mesoslip.output.kinds.KINDS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mesoslip.analysis import avalanches as avalanche_catalogue
from mesoslip.analysis import regime
from mesoslip.analysis import response as responses
from mesoslip.analysis import slips as slip_catalogue
from mesoslip.analysis.experiment import Experiment
from mesoslip.configuration import differences
from mesoslip.configuration.config import Config
from mesoslip.configuration.units import from_cf_units
from mesoslip.errors import FileError
from mesoslip.inference import posterior
from mesoslip.output import variables
from mesoslip.output.access import group_of, is_measured
from mesoslip.output.kinds import kind_of
from mesoslip.plots import draw, run
from mesoslip.plots import sweep as sweep_plots
from mesoslip.plots.run import Extent
from mesoslip.plots.style import COLORS
from mesoslip.quantities import scale_for, with_unit
from mesoslip.reports.content import (
    PARTS,
    Block,
    Picture,
    Section,
    Source,
    Subject,
    Table,
    Text,
    Writer,
    drawn,
)
from mesoslip.theory import force_curve, slip_onset

# Rows of a catalogue that a page shows.
MOST_ROWS = 60
# Bins of a histogram.
BINS = 24
# Measures of a sweep that are drawn.
MOST_MAPS = 12
# Values of a swept key that are told one by one.
MOST_VALUES = 10
# What the codes of a sweep mean.
STATUS = ("ok", "failed", "missing")

# What is told of a catalogue of slips, and its unit.
SLIP_COLUMNS = {
    "force_before": ("force before", "N"),
    "force_after": ("force after", "N"),
    "force_drop": ("drop", "N"),
    "peak_velocity": ("peak velocity", "m/s"),
    "contacts_broken": ("breaks", "1"),
    "duration": ("duration", "s"),
    "waiting_time": ("waiting time", "s"),
}

PROVENANCE = {
    "history": "history",
    "program_version": "version",
    "commit": "commit",
    "compiler": "compiler",
    "library_versions": "libraries",
    "seed": "seed",
    "solver": "solver",
    "break_count": "breaks of contacts",
    "advance_count": "steps of the slider",
    "wall_seconds": "computing time, s",
}


def _shown(value: float, unit: str) -> str:
    """A number of a table; numbers of breaks to the last one."""
    return with_unit(value, unit) if unit != "1" else f"{value:.0f}"


def _named(subjects: Sequence[Subject], subject: Subject, text: str) -> str:
    """A text with the name of its output, if there are several."""
    return text if len(subjects) == 1 else f"{subject.name}: {text}"


def changes(subjects: Sequence[Subject]) -> Section | None:
    """What outputs differ in, and what each changes of what it is based on."""
    blocks: list[Block] = []
    for subject in subjects:
        if is_measured(subject.tree):
            blocks += _about_trace(subject)
    if len(subjects) > 1:
        found = differences.differences([one.config for one in subjects])
        if found:
            rows = tuple((one.key, *one.values) for one in found)
            blocks.append(Table(("key", *(one.name for one in subjects)), rows))
        else:
            blocks.append(Text("All outputs are of the same configuration."))
    for subject in subjects:
        base = subject.tree.attrs.get("base_configuration")
        if base is None:
            blocks.append(
                Text(_named(subjects, subject, "The configuration is not based on another one."))
            )
            continue
        base_config = Config.from_toml(base)
        changed = differences.differences([subject.config, base_config])
        of = (
            f"of what it is based on, “{base_config.title}”" if base_config.title else "of its base"
        )
        if not changed:
            blocks.append(Text(_named(subjects, subject, f"Changes nothing {of}.")))
            continue
        rows = tuple((one.key, *one.values) for one in changed)
        blocks.append(Text(_named(subjects, subject, f"Changes {of}:")))
        blocks.append(Table(("key", "here", "base"), rows))
    return Section("What differs" if len(subjects) > 1 else "What it changes", tuple(blocks))


def _about_trace(subject: Subject) -> Iterator[Block]:
    """What was measured, and that its configuration is only what is known of the experiment."""
    attributes = subject.tree.attrs
    samples = subject.tree.sizes["time"]
    noise = with_unit(attributes["noise"], "N", 3)
    yield Text(
        f"{subject.name}: measured ({attributes['measured_file']}, {samples} samples, noise "
        f"{noise}); its configuration is that of the experiment as far as it is known."
    )
    if attributes.get("comment"):
        yield Text(f"{subject.name}: {attributes['comment']}.", warns=True)


def verdict(subjects: Sequence[Subject]) -> Section | None:
    """Which motion each run shows."""
    told = [
        (one, regime.summary(regime.results_of(regime.regimes(one.tree, one.name))))
        for one in subjects
    ]
    blocks = tuple(
        Text(_named(subjects, one, f"{text[:1].upper()}{text[1:]}.")) for one, text in told
    )
    return Section("Regime", blocks)


def sweep(subjects: Sequence[Subject]) -> Section | None:
    """What was swept, what came of it, and what was measured."""
    blocks: list[Block] = []
    for subject in subjects:
        data = subject.tree.to_dataset()
        status = data["status"].values
        counts = {name: int(np.sum(status == code)) for code, name in enumerate(STATUS)}
        told = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        is_whole = counts["ok"] == status.size
        text = _named(subjects, subject, f"{status.size} runs: {told}.")
        blocks.append(Text(text, warns=not is_whole))
        if subject.tree.attrs.get("failures"):
            blocks.append(Source("why runs failed", str(subject.tree.attrs["failures"])))
        keys = [(str(name), data[name].values) for name in data.coords]
        rows = tuple((name, str(values.size), _listed(name, values)) for name, values in keys)
        blocks.append(Table(("key", "values", ""), rows))
        measured = tuple(_measured(data[name]) for name in sweep_plots.measures(data))
        blocks.append(Table(("measure", "least", "mean", "greatest"), measured))
        for title in ("configuration", "sweep"):
            if title in subject.tree.attrs:
                blocks.append(Source(title, str(subject.tree.attrs[title])))
    return Section("Sweep", tuple(blocks))


def _measured(data: xr.DataArray) -> tuple[str, ...]:
    """A row about a measure: its range, or how often there was which choice."""
    values = data.values.astype(float)
    there = values[np.isfinite(values)]
    # As a configuration has it.
    name, unit = str(data.name), from_cf_units(str(data.attrs.get("units", "1")))
    if "flag_meanings" in data.attrs:
        meanings = str(data.attrs["flag_meanings"]).split()
        codes = np.asarray(data.attrs["flag_values"]).tolist()
        counts = [
            f"{count} {meaning.replace('_', '-')}"
            for code, meaning in zip(codes, meanings, strict=True)
            if (count := np.count_nonzero(there == code))
        ]
        return name, "", ", ".join(counts), ""
    if there.size == 0:
        return name, "", "none", ""
    shown = (with_unit(value, unit) for value in (there.min(), there.mean(), there.max()))
    return name, *shown


def _listed(key: str, values: NDArray[Any]) -> str:
    """Values of a swept key: all of few, or the first and the last."""
    texts = [differences.text_of(key, one) for one in values.tolist()]
    return ", ".join(texts) if len(texts) <= MOST_VALUES else f"{texts[0]} … {texts[-1]}"


def maps_of_sweep(subjects: Sequence[Subject]) -> Section | None:
    """A map of each measure of a sweep."""
    blocks: list[Block] = []
    for subject in subjects:
        data = subject.tree.to_dataset()
        for name in sweep_plots.measures(data)[:MOST_MAPS]:
            blocks.append(_picture(subjects, subject, name, name, run.EVERYTHING))
    return Section("Pictures", tuple(blocks))


def pictures(subjects: Sequence[Subject]) -> Section | None:
    """What happened."""
    extent = Extent(parts=PARTS)
    if kind_of(subjects[0].tree) != "run":
        extent = run.EVERYTHING
    shown: list[Block] = []
    if len(subjects) > 1:
        trees, names = [one.tree for one in subjects], [one.name for one in subjects]
        picture = draw.comparison(trees, names, extent=extent)
        shown.append(drawn("All outputs over each other", lambda: picture.whole(None)))
    for subject in subjects:
        shown.append(_picture(subjects, subject, "What happened", None, extent))
        tree = subject.tree
        if "layer_displacement" in tree.data_vars:
            caption = "Waves in the slider during its largest slip"
            shown.append(_picture(subjects, subject, caption, "layers", extent))
        if "snapshots" in tree.children and group_of(tree, "snapshots").sizes["snapshot"]:
            caption = "Contacts on their lattice"
            shown.append(_picture(subjects, subject, caption, "lattice", extent))
    return Section("Pictures", tuple(shown))


def _picture(
    subjects: Sequence[Subject], subject: Subject, caption: str, view: str | None, extent: Extent
) -> Picture:
    picture = draw.picture(subject.tree, view, extent=extent)
    return drawn(_named(subjects, subject, caption), lambda: picture.whole(None))


def slips(subjects: Sequence[Subject]) -> Section | None:
    """The catalogues of slips: statistics, distributions, rows."""
    there = [one for one in subjects if not one.config.slider.jumps]
    if not there:
        return None
    blocks: list[Block] = []
    for subject in there:
        statistics = slip_catalogue.statistics(subject.tree)
        count = int(statistics["slips"]["count"])
        if count == 0:
            blocks.append(Text(_named(subjects, subject, "There is no slip.")))
            continue
        rows = []
        for name, (told, unit) in SLIP_COLUMNS.items():
            if name not in statistics:
                continue
            one = statistics[name]
            kinds = ("mean", "standard_deviation", "minimum", "maximum")
            rows.append((told, *(_shown(one[kind], unit) for kind in kinds)))
        head = (
            f"{count} slip{'s' if count > 1 else ''}",
            "mean",
            "standard deviation",
            "least",
            "greatest",
        )
        note = "The first slip of relaxed contacts is larger than the others, and counts here."
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        blocks.append(Table(head, tuple(rows), note))
    if any(group_of(one.tree, "slips").sizes["slip"] > 1 for one in there):
        blocks.append(drawn("Distributions of the slips", lambda: _histograms(there)))
    if len(subjects) == 1:
        blocks += _slip_rows(there[0])
    return Section("Slips", tuple(blocks))


def _histograms(subjects: Sequence[Subject]) -> Figure:
    """Drops, durations and waiting times of slips, each output in a colour."""
    figure = Figure(figsize=(7.5, 2.5))
    panels = figure.subplots(1, 3)
    columns = ("force_drop", "duration", "waiting_time")
    for axes, name in zip(panels, columns, strict=True):
        told, unit = SLIP_COLUMNS[name]
        all_values = [slip_catalogue.slips(one.tree)[name].values for one in subjects]
        all_values = [values[np.isfinite(values)] for values in all_values]
        scale = scale_for(run.greatest(*all_values), unit)
        together = np.concatenate(all_values) / scale.size
        axes.set_xlabel(scale.label(told))
        if together.size == 0:
            continue
        low, high = together.min(), together.max()
        # Values that are one but for rounding have no distribution.
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            low, high = low - 0.5 * abs(low), high + 0.5 * abs(high) or 1.0
        bins = np.linspace(low, high, BINS + 1)
        for number, (values, subject) in enumerate(zip(all_values, subjects, strict=True)):
            axes.hist(
                values / scale.size,
                bins,
                histtype="step" if len(subjects) > 1 else "stepfilled",
                color=COLORS[number % len(COLORS)] if len(subjects) > 1 else "0.6",
                label=subject.name,
            )
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    panels[0].set_ylabel("slips")
    if len(subjects) > 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def _slip_rows(subject: Subject) -> list[Block]:
    """The first rows of a catalogue of slips."""
    rows = slip_catalogue.rows(subject.tree)
    if not rows:
        return []
    # A measured trace does not tell the breaks.
    columns = {
        name: column
        for name, column in SLIP_COLUMNS.items()
        if any(row[name] is not None for row in rows)
    }
    shown = []
    for row in rows[:MOST_ROWS]:
        values = (
            "" if row[name] is None else _shown(float(row[name]), unit)
            for name, (_, unit) in columns.items()
        )
        start = with_unit(row["start_time"], "s", 7)
        shown.append((str(row["realization_index"]), start, *values))
    head = ("realization", "start", *(told for told, _ in columns.values()))
    note = f"The first {MOST_ROWS} of {len(rows)}." if len(rows) > MOST_ROWS else ""
    return [Table(head, tuple(shown), note)]


def avalanches(subjects: Sequence[Subject]) -> Section | None:
    """Sizes of avalanches: what is known of them, and their distribution."""
    there = [one for one in subjects if "avalanches" in one.tree.children]
    if not there:
        return None
    blocks: list[Block] = []
    for subject in there:
        statistics = avalanche_catalogue.avalanche_summary(subject.tree)
        rows = []
        for name, value in statistics.items():
            unit, meaning = avalanche_catalogue.SUMMARY[name]
            told = "none" if value is None else with_unit(value, unit, 6)
            rows.append((name, told, meaning))
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        warning = avalanche_catalogue.warning(statistics)
        if warning is not None:
            blocks.append(Text(f"Warning: {warning}.", warns=True))
        blocks.append(Table(("", "value", "meaning"), tuple(rows)))
    full = [one for one in there if group_of(one.tree, "avalanches").sizes["avalanche"]]
    if full:
        trees, names = [one.tree for one in full], [one.name for one in full]
        if len(full) == 1:
            picture = draw.picture(trees[0], "avalanches")
        else:
            picture = draw.comparison(trees, names, "avalanches")
        blocks.append(drawn("Distribution of the sizes", lambda: picture.whole(None)))
    return Section("Avalanches", tuple(blocks))


def response(subjects: Sequence[Subject]) -> Section | None:
    """Steady forces, velocity steps, holds and rate-and-state parameters of a drive with stages."""
    there = []
    for subject in subjects:
        if len({one.stage for one in subject.config.drive_parts}) < 2:
            continue
        try:
            there.append((subject, Experiment(subject.tree, subject.name)))
        except FileError:
            # Driven by a force, or ended before its first sample.
            continue
    if not there:
        return None
    blocks: list[Block] = []
    for subject, experiment in there:
        tree = responses.response_of([experiment])
        blocks.append(Text(_named(subjects, subject, responses.force_scale(tree))))
        for one in responses.tables(tree):
            head, rows = one.head, one.rows
            if any(one.notes):
                head = (*head, "note")
                rows = tuple((*row, note) for row, note in zip(rows, one.notes, strict=True))
            blocks.append(Text(f"{one.title}:"))
            blocks.append(Table(head, rows, one.line))
        caption = "The force against the way of the load point, and what is read off it"
        blocks.append(_picture(subjects, subject, caption, "response", run.EVERYTHING))
    return Section("Response to the drive", tuple(blocks))


def energy(subjects: Sequence[Subject]) -> Section | None:
    """The balance of energy, and what the run promised."""
    blocks: list[Block] = []
    # An experiment has no balance.
    for subject in (one for one in subjects if not is_measured(one.tree)):
        audit = subject.tree.attrs.get("audit", "")
        residual = abs(float(subject.tree.attrs.get("energy_residual", np.nan)))
        told = f"The balance closes to {residual:.1g} of the work of the drive; audit: {audit}."
        blocks.append(Text(_named(subjects, subject, told), warns=audit not in {"passed", ""}))
        if subject.tree.attrs.get("complete") == "false":
            blocks.append(
                Text(_named(subjects, subject, subject.tree.attrs["comment"]), warns=True)
            )
        if "energy" not in subject.tree.children:
            continue
        data = group_of(subject.tree, "energy").sum("realization")
        work = abs(data["drive_work"].item())
        rows = []
        for name, meaning in variables.ENERGY.items():
            if name in data:
                value = data[name].item()
                part = f"{100 * value / work:.4g} %" if work > 0 else ""
                rows.append((meaning.long_name, with_unit(value, "J", 6), part))
        head = ("of all realizations", "energy", "part of the work")
        blocks.append(Table(head, tuple(rows)))
    return Section("Energy", tuple(blocks)) if blocks else None


def curve_numbers(subjects: Sequence[Subject]) -> Section | None:
    """What follows from force curves."""
    return _numbers("The force curve", subjects, force_curve.SUMMARY)


def onset_numbers(subjects: Sequence[Subject]) -> Section | None:
    """What follows from onsets of slip."""
    return _numbers("The onset of slip", subjects, slip_onset.SUMMARY)


def _numbers(
    title: str, subjects: Sequence[Subject], summary: dict[str, tuple[str, str]]
) -> Section:
    """Numbers that outputs have as attributes, side by side, and what they say."""
    rows = []
    for name, (unit, meaning) in summary.items():
        values = [one.tree.attrs.get(name) for one in subjects]
        if any(value is not None for value in values):
            told = (
                "none"
                if value is None
                else value
                if isinstance(value, str)
                else with_unit(float(value), unit, 6)
                for value in values
            )
            rows.append((name, *told, meaning))
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    table = Table(("", *names, "meaning"), tuple(rows))
    comments = (
        Text(_named(subjects, one, f"{one.tree.attrs['comment']}."))
        for one in subjects
        if one.tree.attrs.get("comment")
    )
    return Section(title, (table, *comments))


def parameters(subjects: Sequence[Subject]) -> Section | None:
    """What fits found, with its uncertainty, and what they warn of."""
    blocks: list[Block] = []
    head = ("parameter", "value", "50 % interval", "90 % interval", "verdict", "told most by")
    for subject in subjects:
        rows = []
        for row in posterior.table(subject.tree):
            low, lower, middle, upper, high = (
                with_unit(value, row.unit, row.digits) for value in row.percentiles
            )
            intervals = (f"{lower} to {upper}", f"{low} to {high}")
            rows.append((row.key, middle, *intervals, row.verdict, row.informed_by))
        if len(subjects) > 1:
            blocks.append(Text(subject.name))
        probability = float(subject.tree.attrs["agreement_probability"])
        note = f"Agreement of the model with the trace: p = {probability:.2g}."
        blocks.append(Table(head, tuple(rows), note))
        warnings = str(subject.tree.attrs["warnings"]).split("\n")
        blocks += [Text(f"Warning: {one}.", warns=True) for one in warnings if one]
        caption = "Parameters, and what they predict beside the trace"
        blocks.append(_picture(subjects, subject, caption, None, run.EVERYTHING))
    return Section("Parameters", tuple(blocks))


def configuration(subjects: Sequence[Subject]) -> Section | None:
    """All keys, with those of several outputs side by side."""
    tables = [differences.flat(one.config) for one in subjects]
    keys = dict.fromkeys(key for table in tables for key in table)
    rows = tuple(
        (key, *(differences.text_of(key, table.get(key)) for table in tables)) for key in keys
    )
    names = [one.name for one in subjects] if len(subjects) > 1 else ["value"]
    blocks: list[Block] = [Table(("key", *names), rows)]
    for subject in subjects:
        title = _named(subjects, subject, "as a file, in SI units")
        blocks.append(Source(title, subject.tree.attrs["configuration"]))
    return Section("Configuration", tuple(blocks))


def provenance(subjects: Sequence[Subject]) -> Section | None:
    """Where outputs come from."""
    rows = tuple(
        (told, *(_plain(one.tree.attrs.get(name)) for one in subjects))
        for name, told in PROVENANCE.items()
        if any(name in one.tree.attrs for one in subjects)
    )
    return Section("Provenance", (Table(("", *(one.name for one in subjects)), rows),))


def _plain(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


SECTIONS: dict[str, tuple[Writer, ...]] = {
    "run": (
        changes,
        verdict,
        pictures,
        slips,
        avalanches,
        response,
        energy,
        configuration,
        provenance,
    ),
    "sweep": (sweep, maps_of_sweep, provenance),
    "curve": (changes, pictures, curve_numbers, configuration, provenance),
    "onset": (changes, pictures, onset_numbers, configuration, provenance),
    "fit": (parameters, configuration, provenance),
}
