"""The layout of the output of a run: its groups, and how rows of the kernel become variables.

`describe` has the contents of an output; `mesoslip.output.tree` builds it in memory, and
`mesoslip.output.writing` writes it to a file block by block.

Rows of catalogues name their realization by a ``realization_index``, as CF's indexed ragged arrays
do, and no variable of a group has the name of a coordinate of the root.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.config import Config
from mesoslip.output import variables
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import Group, Meaning
from mesoslip.simulation import recorded_tables as tables
from mesoslip.simulation.audit import failed_checks

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]

# Values of a variable from rows of a table and the indices of their realizations.
Pick = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Entry:
    """A variable of an output: its form, and the values or the rows that fill it.

    Those with dimensions (realization, time, ...) are filled realization by realization, and NaN
    where one ended earlier; others take the rows of all realizations one after another.
    """

    dimensions: tuple[str, ...]
    meaning: Meaning
    dtype: np.dtype[Any]
    is_coordinate: bool = False
    values: Any = None
    table: str = ""
    pick: Pick | None = None

    @property
    def is_padded(self) -> bool:
        return self.dimensions[:2] == ("realization", "time")

    @property
    def fill_value(self) -> float | None:
        """The value for missing data; CF has none for coordinates."""
        return np.nan if self.dtype.kind == "f" and not self.is_coordinate else None

    @property
    def shrinks(self) -> bool:
        """Whether compression pays.

        Real numbers with full mantissas shrink to two thirds, at half the cost of their simulation.
        """
        return self.dtype.kind != "f" or self.meaning.is_regular


@dataclass(frozen=True)
class GroupLayout:
    """A group of an output: the sizes of its own dimensions, its variables, its attributes."""

    sizes: Mapping[str, int]
    entries: Mapping[str, Entry]
    attributes: Mapping[str, Any]

    def auxiliary_coordinates(self, name: str) -> list[str]:
        """Coordinates of a variable that are not those of its dimensions."""
        return [
            other
            for other, entry in self.entries.items()
            if entry.is_coordinate
            and not self.entries[name].is_coordinate
            and entry.dimensions != (other,)
            and set(entry.dimensions) <= set(self.entries[name].dimensions)
        ]


def column(table: str, name: str) -> Pick:
    """A column of a table."""
    number = tables.COLUMNS[table].index(name)
    return lambda rows, _: rows[:, number]


@dataclass
class _Form:
    """Entries of a group, under construction."""

    group: Group
    is_exact: bool
    entries: dict[str, Entry]

    def add(
        self, name: str, dimensions: tuple[str, ...], *, can_lack: bool = False, **how: Any
    ) -> None:
        meaning = self.group[name]
        is_real = can_lack or (meaning.is_fractional and not self.is_exact)
        dtype = np.dtype(np.float64 if is_real else meaning.dtype)
        self.entries[name] = Entry(dimensions, meaning, dtype, **how)


def describe(results: Results) -> dict[str, GroupLayout]:
    """The layout of the output of a run, by group; the root is ""."""
    config = results.config
    layout = {"": _root(results), "slips": _slips(results), "energy": _energy(results)}
    layout["stages"] = _stages(results)
    if config.slip_interval is not None:
        layout["slip_traces"] = _slip_traces(results)
    if config.has_avalanches:
        layout["avalanches"] = _avalanches(results)
    if config.output.snapshots or config.output.snapshot_size:
        layout["snapshots"] = _snapshots(results)
    return layout


# Traces that only some sliders have.
SPECIAL_TRACES = ("elastic_force", "base_displacement")


def recorded(config: Config) -> tuple[str, ...]:
    """Names of the traces that an output of a configuration has, without the time."""
    common = (name for name in tables.TRACE_COLUMNS if name not in ("time", *SPECIAL_TRACES))
    return (*common, *config.slider.extra_traces)


def _count(results: Results, table: str) -> int:
    return sum(len(one.rows(table)) for one in results.realizations)


def _root(results: Results) -> GroupLayout:
    config, realizations = results.config, results.realizations
    writer = _Form(variables.ROOT, config.contact_kind.is_discrete, {})
    lengths = [len(one.rows("trace")) for one in realizations]
    sizes = {"realization": len(realizations), "time": max(lengths)}
    each, at_times = ("realization",), ("realization", "time")
    writer.add("realization", each, is_coordinate=True, values=[one.number for one in realizations])
    writer.add("time", ("time",), is_coordinate=True, table="trace", pick=column("trace", "time"))
    can_lack = min(lengths) < max(lengths)
    for name in recorded(config):
        pick = column("trace", name)
        writer.add(name, at_times, can_lack=can_lack, table="trace", pick=pick)
    layers = config.slider.layers_recorded(config)
    if layers:
        sizes["layer"] = layers
        numbers = np.arange(1, sizes["layer"] + 1)
        writer.add("layer", ("layer",), is_coordinate=True, values=numbers)
        where = (*at_times, "layer")
        writer.add("layer_displacement", where, table="layers", pick=lambda rows, _: rows)
    totals = ["breaks", "energy_residual", "kernel_seconds"]
    if config.contact_kind.force_error_bound > 0:
        totals.append("force_error")
    if config.contact_kind.step_work_bound > 0:
        totals.append("slip_time_error")
    if config.has_avalanches:
        totals += ["avalanche_count", "avalanche_slip"]
    for name in totals:
        writer.add(name, each, values=[getattr(one, name) for one in realizations])
    if config.has_avalanches:
        writer.add("end_displacement", each, values=[one.displacement for one in realizations])
    return GroupLayout(sizes, writer.entries, attributes(results))


def _catalogue(results: Results, group: Group, table: str) -> _Form:
    """The start of a group of rows of all realizations."""
    dimension = DIMENSIONS[table]
    writer = _Form(group, results.config.contact_kind.is_discrete, {})
    writer.add("realization_index", (dimension,), table=table, pick=lambda _, owners: owners)
    return writer


# Dimension of the rows of a table in the group of its catalogue.
DIMENSIONS = {
    "slips": "slip",
    "stages": "stage",
    "slip_trace": "sample",
    "avalanches": "avalanche",
    "snapshot_events": "snapshot",
    "snapshots": "snapshot",
}


def _slips(results: Results) -> GroupLayout:
    writer = _catalogue(results, variables.SLIPS, "slips")
    picks = {name: column("slips", name) for name in tables.SLIP_COLUMNS}
    before, after = picks["force_before"], picks["force_after"]
    picks["force_drop"] = lambda rows, owners: before(rows, owners) - after(rows, owners)
    for name in variables.SLIPS:
        if name in picks:
            writer.add(name, ("slip",), table="slips", pick=picks[name])
    return GroupLayout({"slip": _count(results, "slips")}, writer.entries, {})


def _stages(results: Results) -> GroupLayout:
    writer = _catalogue(results, variables.STAGES, "stages")
    for name in tables.STAGE_COLUMNS:
        writer.add(name, ("stage",), table="stages", pick=column("stages", name))
    return GroupLayout({"stage": _count(results, "stages")}, writer.entries, {})


def _slip_traces(results: Results) -> GroupLayout:
    writer = _catalogue(results, variables.SLIP_TRACES, "slip_trace")
    how: dict[str, Any] = {"table": "slip_trace"}
    writer.add("slip", ("sample",), pick=column("slip_trace", "slip"), **how)
    writer.add(
        "sample_time", ("sample",), is_coordinate=True, pick=column("slip_trace", "time"), **how
    )
    for name in recorded(results.config):
        writer.add(name, ("sample",), pick=column("slip_trace", name), **how)
    return GroupLayout({"sample": _count(results, "slip_trace")}, writer.entries, {})


def _avalanches(results: Results) -> GroupLayout:
    config, kind = results.config, results.config.contact_kind
    writer = _catalogue(results, variables.AVALANCHES, "avalanches")
    picks = {name: column("avalanches", name) for name in tables.AVALANCHE_COLUMNS}
    picks["start_time"] = picks["time"]
    names = ["start_time", "displacement", "size", "force_before", "force_drop"]
    if config.slider.jumps:
        names.append("slip")
    if kind.on_lattice:
        names += ["area", "width", "height", "generations"]
    for name in names:
        writer.add(name, ("avalanche",), table="avalanches", pick=picks[name])
    if kind.on_lattice:
        lattice_rows, columns = kind.dimensions(config.contacts).values()

        def spans(rows: Array, owners: Array) -> Array:
            width, height = picks["width"](rows, owners), picks["height"](rows, owners)
            reached: Array = (width == columns) | (height == lattice_rows)
            return reached

        writer.add("spans", ("avalanche",), table="avalanches", pick=spans)
    return GroupLayout({"avalanche": _count(results, "avalanches")}, writer.entries, {})


def _snapshots(results: Results) -> GroupLayout:
    """All contacts: dimensions ``snapshot`` and ``contact``; on a lattice ``row``, ``column``."""
    kind, contacts = results.config.contact_kind, results.config.contacts
    writer = _catalogue(results, variables.SNAPSHOTS, "snapshot_events")
    how: dict[str, Any] = {"table": "snapshot_events"}
    writer.add(
        "snapshot_time",
        ("snapshot",),
        is_coordinate=True,
        pick=column("snapshot_events", "time"),
        **how,
    )
    writer.add("displacement", ("snapshot",), pick=column("snapshot_events", "displacement"), **how)
    writer.add("avalanche_size", ("snapshot",), pick=column("snapshot_events", "size"), **how)
    places = kind.dimensions(contacts)
    for name, values in kind.positions(contacts).items():
        writer.add(name, tuple(places), is_coordinate=True, values=values)
    stretch, load, generation = (
        tables.SNAPSHOT_NUMBERS.index(name) for name in ("stretch", "load", "generation")
    )
    picks: dict[str, Pick] = {
        "stretch": lambda rows, _: rows[..., stretch],
        "load": lambda rows, _: np.where(np.isfinite(rows[..., stretch]), rows[..., load], np.nan),
        "pinned": lambda rows, _: np.isfinite(rows[..., stretch]),
    }
    if kind.on_lattice:
        picks["generation"] = lambda rows, _: rows[..., generation]

    def in_place(pick: Pick) -> Pick:
        return lambda rows, owners: pick(rows, owners).reshape(-1, *places.values())

    for name, pick in picks.items():
        writer.add(name, ("snapshot", *places), table="snapshots", pick=in_place(pick))
    sizes = {"snapshot": _count(results, "snapshots"), **places}
    return GroupLayout(sizes, writer.entries, {})


def _energy(results: Results) -> GroupLayout:
    """The terms of the energy balance of each realization, from the start of the run [J]."""
    terms = np.array([one.energy for one in results.realizations]).T
    writer = _Form(variables.ENERGY, results.config.contact_kind.is_discrete, {})
    for name, values in zip(tables.ENERGY_COLUMNS, terms, strict=True):
        if name == "step_work" and not results.config.contact_kind.step_work_bound > 0:
            continue
        if name in variables.ENERGY:
            writer.add(name, ("realization",), values=values)
    return GroupLayout({}, writer.entries, {})


def _comment(results: Results, reached: float) -> dict[str, str]:
    """How far an interrupted run came; CF wants no empty comment of others."""
    if results.complete:
        return {}
    each = "it" if len(results.realizations) == 1 else "every realization"
    return {"comment": f"interrupted; {each} came to {reached:.6g} s"}


def attributes(results: Results) -> dict[str, Any]:
    """Attributes of an output: configuration, program, and state of the run."""
    config, realizations = results.config, results.realizations
    reached = min(one.time for one in realizations)
    residual: float = max((one.energy_residual for one in realizations), key=abs)
    solver = {}
    solver_name = config.slider.solver_name(config)
    if solver_name is not None:
        counts = np.sum([one.integrator_counts for one in realizations], axis=0)
        solver = {
            "solver": solver_name,
            "solver_steps": int(counts[0]),
            "solver_evaluations": int(counts[1]),
            "solver_failed_steps": int(counts[2]),
        }
    return (
        program_attributes(config, "run")
        | solver
        | {
            "seed": config.run.seed,
            "complete": "true" if results.complete else "false",
            **_comment(results, reached),
            "break_count": sum(one.breaks for one in realizations),
            "ending": "; ".join(sorted({one.ending for one in realizations})),
            "advance_count": sum(one.advances for one in realizations),
            "energy_residual": residual,
            "audit": "; ".join(failed_checks(config, realizations)) or "passed",
            "wall_seconds": results.wall_seconds,
        }
    )
