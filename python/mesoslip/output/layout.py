"""The layout of the output of a run: its groups, and how rows of the kernel become variables.

`describe` returns it; `mesoslip.output.tree` builds the output in memory, and
`mesoslip.output.writing` writes it to a file block by block.

Rows of catalogues have a ``realization_index``, as in CF's indexed ragged arrays, and no variable
of a group has the name of a coordinate of the root.
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
from mesoslip.simulation.audit import failed_checks, largest, share_of_work
from mesoslip.simulation.fronts import FRONT_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mesoslip.simulation.realization import Realization
    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]

# Dimension of the rows of a table in its catalogue.
DIMENSIONS = {
    "slips": "slip",
    "stages": "stage",
    "slip_trace": "sample",
    "avalanches": "avalanche",
    "ruptures": "rupture",
    "fronts": "front",
    "snapshot_events": "snapshot",
    "snapshots": "snapshot",
}

# Values of a variable from rows of a table and the indices of their realizations.
Pick = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Entry:
    """A variable of an output: its form, and its values or the rows that fill it.

    Those with dimensions (realization, time, ...) are padded with NaN where a realization ended
    earlier; others have the rows of all realizations one after another.
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
        """Whether it is compressed: most real numbers would shrink to two thirds only, at half the
        cost of their simulation."""
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
    number = tables.COLUMNS[table].index(name)
    return lambda rows, _: rows[:, number]


def loaded(config: Config, table: str, time: str, force: str) -> dict[str, Pick]:
    """Normal force, and friction coefficient of the force of a column, at the time of another;
    nothing without a load."""
    load = config.pressing
    if not load.is_known:
        return {}
    times, forces = column(table, time), column(table, force)

    def normal(rows: Array, owners: Array) -> Array:
        return load.force_at(times(rows, owners))

    def friction(rows: Array, owners: Array) -> Array:
        load_there = normal(rows, owners)
        # Separated contacts have no coefficient.
        carries = load_there > 0
        quotient = forces(rows, owners) / np.where(carries, load_there, 1.0)
        return np.where(carries, quotient, np.nan)

    return {"normal_force": normal, "friction_coefficient": friction}


class _GroupBuilder:
    """Entries of a group, under construction; those of a catalogue come from one table."""

    def __init__(self, results: Results, group: Group, table: str = "") -> None:
        self.entries: dict[str, Entry] = {}
        self._group, self._table = group, table
        self._is_exact = results.config.contact_kind.is_discrete
        if table:
            self._rows = sum(len(one.rows(table)) for one in results.realizations)
            self.add_column("realization_index", lambda _, owners: owners)

    def add(
        self, name: str, dimensions: tuple[str, ...], *, has_gaps: bool = False, **how: Any
    ) -> None:
        """Add a variable; one with gaps is real, for NaN."""
        meaning = self._group[name]
        is_real = has_gaps or (meaning.is_fractional and not self._is_exact)
        dtype = np.dtype(np.float64 if is_real else meaning.dtype)
        self.entries[name] = Entry(dimensions, meaning, dtype, **how)

    def add_column(self, name: str, source: str | Pick = "", **how: Any) -> None:
        """Add a variable from a column of the table, of the same name by default."""
        pick = column(self._table, source or name) if isinstance(source, str) else source
        self.add(name, (DIMENSIONS[self._table],), table=self._table, pick=pick, **how)

    def catalogue(self, **sizes: int) -> GroupLayout:
        """The layout of the group, with further dimensions."""
        return GroupLayout({DIMENSIONS[self._table]: self._rows, **sizes}, self.entries, {})


def describe(results: Results) -> dict[str, GroupLayout]:
    """The layout of the output of a run, by group; the root is ""."""
    config = results.config
    layout = {"": _root(results), "slips": _slips(results), "energy": _energy(results)}
    layout["stages"] = _table(results, variables.STAGES, "stages", tables.STAGE_COLUMNS)
    if config.slip_interval is not None:
        layout["slip_traces"] = _slip_traces(results)
    if config.slider.block_count:
        layout["blocks"] = _blocks(results)
        layout["ruptures"] = _table(results, variables.RUPTURES, "ruptures", tables.RUPTURE_COLUMNS)
        layout["fronts"] = _table(results, variables.FRONTS, "fronts", FRONT_COLUMNS)
    if config.has_avalanches:
        layout["avalanches"] = _avalanches(results)
    if config.output.snapshots or config.output.snapshot_size:
        layout["snapshots"] = _snapshots(results)
    return layout


# Variables with another name than their column.
RENAMED = {"block": "block_number"}
# Traces of some sliders only.
SPECIAL_TRACES = ("elastic_force", "base_displacement")


def recorded(config: Config) -> tuple[str, ...]:
    """Names of the traces in an output of a configuration, without the time."""
    common = (name for name in tables.TRACE_COLUMNS if name not in ("time", *SPECIAL_TRACES))
    return (*common, *config.slider.extra_traces)


def _root(results: Results) -> GroupLayout:
    config, realizations = results.config, results.realizations
    group = _GroupBuilder(results, variables.ROOT)
    lengths = [len(one.rows("trace")) for one in realizations]
    sizes = {"realization": len(realizations), "time": max(lengths)}
    each, at_times = ("realization",), ("realization", "time")
    group.add("realization", each, is_coordinate=True, values=[one.number for one in realizations])
    group.add("time", ("time",), is_coordinate=True, table="trace", pick=column("trace", "time"))
    has_gaps = min(lengths) < max(lengths)
    for name in recorded(config):
        pick = column("trace", name)
        group.add(name, at_times, has_gaps=has_gaps, table="trace", pick=pick)
    for name, pick in loaded(config, "trace", "time", "spring_force").items():
        group.add(name, at_times, has_gaps=has_gaps, table="trace", pick=pick)
    layers = config.slider.layers_recorded(config)
    if layers:
        sizes["layer"] = layers
        group.add("layer", ("layer",), is_coordinate=True, values=np.arange(1, layers + 1))
        where = (*at_times, "layer")
        group.add("layer_displacement", where, table="layers", pick=lambda rows, _: rows)
    totals = ["breaks", "energy_residual", "kernel_seconds"]
    if config.contact_kind.force_error_bound > 0:
        totals.append("force_error")
    if config.contact_kind.step_work_bound > 0:
        totals.append("slip_time_error")
    if config.run.force_tolerance is not None:
        totals.append("resolution")
    if config.has_avalanches:
        totals += ["avalanche_count", "avalanche_slip"]
    energies = np.array([one.energy for one in realizations])
    for name in totals:
        values = (
            share_of_work(config, energies, "residual")
            if name == "energy_residual"
            else [getattr(one, name) for one in realizations]
        )
        group.add(name, each, values=values)
    if config.has_avalanches:
        group.add("end_displacement", each, values=[one.displacement for one in realizations])
    return GroupLayout(sizes, group.entries, attributes(results))


def _slips(results: Results) -> GroupLayout:
    group = _GroupBuilder(results, variables.LOADED_SLIPS, "slips")
    before, after = column("slips", "force_before"), column("slips", "force_after")
    for name in variables.SLIPS:
        if name == "force_drop":
            group.add_column(name, lambda rows, owners: before(rows, owners) - after(rows, owners))
        elif name in tables.SLIP_COLUMNS:
            group.add_column(name)
    for name, pick in loaded(results.config, "slips", "start_time", "force_before").items():
        group.add_column(name, pick)
    return group.catalogue()


def _table(results: Results, group: Group, table: str, columns: Sequence[str]) -> GroupLayout:
    made = _GroupBuilder(results, group, table)
    for name in columns:
        made.add_column(RENAMED.get(name, name), name)
    return made.catalogue()


def _slip_traces(results: Results) -> GroupLayout:
    group = _GroupBuilder(results, variables.SLIP_TRACES, "slip_trace")
    group.add_column("slip")
    group.add_column("sample_time", "time", is_coordinate=True)
    for name in recorded(results.config):
        group.add_column(name)
    for name, pick in loaded(results.config, "slip_trace", "time", "spring_force").items():
        group.add_column(name, pick)
    return group.catalogue()


def _blocks(results: Results) -> GroupLayout:
    """The motion of each block at the samples of the trace."""
    slider = results.config.slider
    group = _GroupBuilder(results, variables.BLOCKS)
    numbers = np.arange(1, slider.block_count + 1)
    group.add("block", ("block",), is_coordinate=True, values=numbers)
    places = (numbers - 0.5) * slider.block_spacing
    group.add("position", ("block",), is_coordinate=True, values=places)
    lengths = [len(one.rows("trace")) for one in results.realizations]
    has_gaps = min(lengths) < max(lengths)
    for place, name in enumerate(tables.BLOCK_NUMBERS):
        part = slice(place * slider.block_count, (place + 1) * slider.block_count)

        def pick(rows: Array, _: Array, part: slice = part) -> Array:
            return rows[:, part]

        where = ("realization", "time", "block")
        group.add(name, where, has_gaps=has_gaps, table="blocks", pick=pick)
    load = results.config.pressing
    if load.is_known:
        shares, times = results.config.block_shares / slider.block_count, column("trace", "time")

        def pressed(rows: Array, owners: Array) -> Array:
            return load.force_at(times(rows, owners))[:, None] * shares

        if load.varies:
            group.add("block_normal_force", where, has_gaps=has_gaps, table="trace", pick=pressed)
        else:
            group.add("block_normal_force", ("block",), values=load.max_force * shares)
    return GroupLayout({"block": slider.block_count}, group.entries, {})


def _avalanches(results: Results) -> GroupLayout:
    config, kind = results.config, results.config.contact_kind
    group = _GroupBuilder(results, variables.AVALANCHES, "avalanches")
    group.add_column("start_time", "time")
    names = ["displacement", "size", "force_before", "force_drop"]
    if config.slider.jumps:
        names.append("slip")
    if kind.on_lattice:
        names += ["area", "width", "height", "generations"]
    for name in names:
        group.add_column(name)
    if kind.on_lattice:
        lattice_rows, columns = kind.dimensions(config.contacts).values()
        width, height = column("avalanches", "width"), column("avalanches", "height")

        def spans(rows: Array, owners: Array) -> Array:
            reached: Array = (width(rows, owners) == columns) | (
                height(rows, owners) == lattice_rows
            )
            return reached

        group.add_column("spans", spans)
    return group.catalogue()


def _snapshots(results: Results) -> GroupLayout:
    """All contacts: dimensions ``snapshot`` and ``contact``; on a lattice ``row``, ``column``."""
    kind, contacts = results.config.contact_kind, results.config.contacts
    group = _GroupBuilder(results, variables.SNAPSHOTS, "snapshot_events")
    group.add_column("snapshot_time", "time", is_coordinate=True)
    group.add_column("displacement")
    group.add_column("avalanche_size", "size")
    places = kind.dimensions(contacts)
    for name, values in kind.positions(contacts).items():
        group.add(name, tuple(places), is_coordinate=True, values=values)
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
        group.add(name, ("snapshot", *places), table="snapshots", pick=in_place(pick))
    return group.catalogue(**places)


def _energy(results: Results) -> GroupLayout:
    """The terms of the energy balance of each realization, from the start of the run [J]."""
    terms = np.array([one.energy for one in results.realizations]).T
    group = _GroupBuilder(results, variables.ENERGY)
    for name, values in zip(tables.ENERGY_COLUMNS, terms, strict=True):
        if name == "step_work" and not results.config.contact_kind.step_work_bound > 0:
            continue
        if name == "separation_loss" and not results.config.pressing.is_known:
            continue
        if name in variables.ENERGY:
            group.add(name, ("realization",), values=values)
    return GroupLayout({}, group.entries, {})


def attributes(results: Results) -> dict[str, Any]:
    """Attributes of an output: configuration, program, and state of the run."""
    config, realizations = results.config, results.realizations
    attributes = program_attributes(config, "run")
    solver_name = config.slider.solver_name(config)
    if solver_name is not None:
        counts = np.sum([one.integrator_counts for one in realizations], axis=0)
        names = ("solver_steps", "solver_evaluations", "solver_failed_steps")
        attributes["solver"] = solver_name
        attributes |= zip(names, counts.tolist(), strict=True)
    attributes["seed"] = config.run.seed
    attributes["complete"] = "true" if results.complete else "false"
    if not results.complete:
        attributes["comment"] = interruption(realizations)
    energies = np.array([one.energy for one in realizations])
    residual = largest(share_of_work(config, energies, "residual"))
    return attributes | {
        "break_count": sum(one.breaks for one in realizations),
        "ending": "; ".join(sorted({one.ending for one in realizations})),
        "advance_count": sum(one.advances for one in realizations),
        "energy_residual": residual,
        "audit": "; ".join(failed_checks(config, realizations)) or "passed",
        "wall_seconds": results.wall_seconds,
    }


def interruption(realizations: Sequence[Realization]) -> str:
    """How far the realizations of an interrupted run are."""
    under_way = [one for one in realizations if not one.finished]
    reached = min((one.time for one in under_way), default=0.0)
    if len(realizations) == 1:
        return f"interrupted; it reached {reached:.6g} s"
    complete = len(realizations) - len(under_way)
    begun = sum(one.advances > 0 for one in under_way)
    text = f"interrupted; {complete} of {len(realizations)} realizations are complete"
    if begun < len(under_way):
        return f"{text}, {begun} under way"
    return f"{text}, all others reached {reached:.6g} s"
