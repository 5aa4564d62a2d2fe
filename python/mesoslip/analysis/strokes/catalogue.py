"""The strokes and cycles of an output: as a tree, as tables, and over all cycles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import apparatus_of
from mesoslip.analysis.printed_columns import printed_columns
from mesoslip.analysis.strokes.cycles import Cycle, Overall, cycles_of, overall
from mesoslip.analysis.strokes.measure import MIDDLE, Measured, Stroke, measure_all
from mesoslip.analysis.strokes.record import NOUN, StrokeRecord, record_of
from mesoslip.analysis.strokes.revolutions import found_period, has_rotation, revolutions_of
from mesoslip.array_types import DataTree
from mesoslip.configuration import arguments
from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree
from mesoslip.output.inputs import OutputLike, opened_run_arrays
from mesoslip.output.table_files import PrintedTable, rows_of, write_tables
from mesoslip.output.variables import (
    REALIZATION_INDEX,
    Estimate,
    Group,
    Meaning,
    force_among,
    with_force_unit,
)
from mesoslip.quantities import with_error, with_unit

STROKES = Group(
    realization_index=REALIZATION_INDEX,
    stroke_number=Meaning("1", "number of the stroke, from 1", np.int64),
    start_time=Meaning("s", "time of the reversal before the stroke"),
    end_time=Meaning("s", "time of the reversal after it"),
    direction=Meaning(
        "1", "direction of the motion, or of the force where that is unknown", np.int64
    ),
    length=Meaning("m", "distance between the reversals"),
    velocity=Meaning("m s-1", "mean speed in the middle of the stroke"),
    mean_friction=Estimate("N", "mean force along the motion in the middle of the stroke"),
    mean_friction_coefficient=Estimate("1", "the same over the mean normal force there"),
    max_friction=Meaning("N", "maximum force along the motion"),
    max_friction_position=Meaning("m", "distance from the reversal to this maximum"),
    start_force=Meaning("N", "force at the reversal before the stroke"),
    end_force=Meaning("N", "force at the reversal after it"),
    stiffness=Estimate("N m-1", "stiffness at the reversal before the stroke"),
    slides=Meaning(
        "1", "whether there is sliding friction (1), or the force only grows (0)", np.int64
    ),
)

CYCLES = Group(
    realization_index=REALIZATION_INDEX,
    cycle_number=Meaning("1", "number of the cycle, from 1", np.int64),
    start_time=Meaning("s", "time of the reversal before the cycle"),
    end_time=Meaning("s", "time of the reversal after it"),
    mean_friction=Estimate("N", "half the difference of the mean forces in both directions"),
    mean_friction_coefficient=Estimate("1", "the same over the mean normal force"),
    loop_energy=Estimate("J", "energy dissipated in the cycle, the area of its loop"),
    offset=Estimate("N", "offset of the force, half the sum of the means in both directions"),
    stiffness=Estimate("N m-1", "mean stiffness at both reversals"),
)


# Printed columns: header, and SI unit.
STROKE_HEADS = {
    "stroke_number": ("stroke", "1"),
    "start_time": ("start", "s"),
    "direction": ("direction", "1"),
    "length": ("length", "m"),
    "velocity": ("velocity", "m/s"),
    "mean_friction": ("mean friction", "N"),
    "mean_friction_coefficient": ("coefficient", "1"),
    "max_friction": ("maximum", "N"),
    "max_friction_position": ("at", "m"),
    "stiffness": ("stiffness", "N/m"),
}
CYCLE_HEADS = {
    "cycle_number": ("cycle", "1"),
    "start_time": ("start", "s"),
    "mean_friction": ("mean friction", "N"),
    "mean_friction_coefficient": ("coefficient", "1"),
    "loop_energy": ("loop energy", "J"),
    "offset": ("offset", "N"),
    "stiffness": ("stiffness", "N/m"),
}
# Quantities over all cycles.
OVERALL = ("mean_friction", "mean_friction_coefficient", "loop_energy", "offset", "stiffness")


@dataclass(frozen=True)
class Strokes:
    """The strokes and cycles of an output."""

    columns: Mapping[str, Mapping[str, NDArray[Any]]]
    """Columns in SI, each of shape (rows,), of the groups ``strokes`` and ``cycles``."""
    overall: Mapping[str, Overall]
    """Quantities over all cycles of the first realization."""
    middle: float
    force_unit: str
    source: str
    """The quantity in which strokes were found."""
    notes: Sequence[str]
    """Sentences on the strokes, and the guesses by which they were found."""
    records: Sequence[StrokeRecord] = ()
    strokes: Sequence[Sequence[Stroke]] = ()
    """Records and strokes by realization."""
    min_friction: Measured | None = None
    """Lower limit of the friction of sliding, if the force grows up to the end of strokes."""

    def rows(self, group: str) -> list[dict[str, Any]]:
        """A dictionary for each stroke or cycle; None for unknown values."""
        return rows_of(self.columns[group])

    @property
    def tables(self) -> list[PrintedTable]:
        """Strokes, cycles, and the means over cycles, for print; of a disc a row is a stroke and a
        cycle."""
        noun = self.records[0].noun if self.records else NOUN
        if noun == NOUN:
            each, groups = "cycle", [("Strokes", "strokes", STROKE_HEADS)]
            groups.append(("Cycles", "cycles", CYCLE_HEADS))
        else:
            each, heads = "row", STROKE_HEADS | {"stroke_number": ("row", "1")}
            groups = [(noun.capitalize(), "strokes", heads)]
        tables = [
            printed_columns(title, self.columns[group], heads, self.force_unit)
            for title, group, heads in groups
        ]
        if self.overall:
            rows = []
            for name, one in self.overall.items():
                head, unit = CYCLE_HEADS[name]
                unit = with_force_unit(unit, self.force_unit)
                rows.append(
                    (
                        head,
                        with_error(one.mean, one.error, unit),
                        with_error(one.drift, one.drift_error, unit),
                        str(one.running_in),
                        str(one.cycles),
                    )
                )
            titles = ("", "mean", f"drift per {each}", "running-in", f"{each}s")
            tables.append(PrintedTable(f"Means over {each}s", titles, tuple(rows)))
        return tables

    def write_csv(self, path: Path) -> None:
        """Write strokes and cycles as two tables, with an empty line between them."""
        groups = (("strokes", STROKES), ("cycles", CYCLES))
        write_tables([(self.rows(name), one.units(self.force_unit)) for name, one in groups], path)

    def to_json(self) -> dict[str, Any]:
        """Everything as nested lists and numbers."""
        return {
            "source": self.source,
            "force_unit": self.force_unit,
            "middle": self.middle,
            "notes": self.notes,
            "strokes": self.rows("strokes"),
            "cycles": self.rows("cycles"),
            "overall": {name: asdict(one) for name, one in self.overall.items()},
            "min_friction": self.min_friction
            and {"mean": self.min_friction.value, "error": self.min_friction.error},
        }


def _value(one: Any, name: str) -> float:
    """A value or an error of a stroke or a cycle."""
    value = getattr(one, name.removesuffix("_error"))
    if not isinstance(value, Measured):
        return float(value)
    return value.error if name.endswith("_error") else value.value


def strokes_of(
    tree: Tree,
    middle: float = MIDDLE,
    name: str = "the output",
    realization: int | None = None,
    period: float | Literal["auto"] | None = None,
) -> Strokes:
    """The strokes of all realizations of an output, or of one.

    They are revolutions, if those of a disc are recorded or their period [s] is given.
    """
    guess = ""
    if period == "auto":
        root = tree.to_dataset()
        force = root[force_among(root)].values[realization or 0]
        known = np.isfinite(force)
        period = found_period(root["time"].values[known], force[known])
        if period is None:
            raise FileError(f"{name}: the force does not repeat itself; give a period")
        guess = (
            f"guess: a revolution takes {with_unit(period, 's', 5)}, after which the force repeats"
        )
    unit = apparatus_of(tree, name).force_unit
    chosen = range(tree.sizes.get("realization", 1)) if realization is None else [realization]
    records, found, cycles = [], [], []
    for index in chosen:
        if period is not None or has_rotation(tree):
            record, own, own_cycles = revolutions_of(tree, index, period, name)
        else:
            record = record_of(tree, index, name)
            own = measure_all(record, middle)
            own_cycles = cycles_of(record, own)
        records.append(record)
        found.append(own)
        cycles.append(own_cycles)
    if not any(found):
        raise FileError(f"{name}: has no whole stroke with enough samples in its middle")
    limit = _min_friction(found)
    means = {key: overall([getattr(one, key) for one in cycles[0]]) for key in OVERALL}
    return Strokes(
        {"strokes": _columns(STROKES, found), "cycles": _columns(CYCLES, cycles)},
        {key: one for key, one in means.items() if one is not None},
        middle,
        unit,
        records[0].source,
        (*([guess] if guess else []), *_notes(records[0], found, limit, unit)),
        records,
        found,
        limit,
    )


def _min_friction(strokes: Sequence[Sequence[Stroke]]) -> Measured | None:
    """Half the swing of the force in strokes that do not slide; None without such strokes."""
    swings = [
        abs(one.end_force - one.start_force) for own in strokes for one in own if not one.slides
    ]
    if not swings:
        return None
    error = float(np.std(swings)) / math.sqrt(max(len(swings) - 1, 1))
    return Measured(0.5 * float(np.mean(swings)), 0.5 * error)


def _notes(
    record: StrokeRecord, strokes: Sequence[Sequence[Stroke]], limit: Measured | None, unit: str
) -> Iterator[str]:
    """Sentences on what was found, with guesses."""
    yield (
        f"{record.noun} by the {record.source}: {len(strokes[0])} whole ones; those at either end "
        "of the record are left out"
    )
    yield from record.notes
    count = sum(not one.slides for own in strokes for one in own)
    if limit is not None:
        what = (
            "friction is unknown without a displacement"
            if record.position is None
            else "the mean is that of the middle, with the reversal"
        )
        yield (
            f"in {count} strokes the force grows up to the end, as with partial slip: {what}; that "
            f"of sliding is at least {with_error(limit.value, limit.error, unit)}, half the swing "
            "of the force"
        )


def _columns(
    meanings: Group, per_realization: Sequence[Sequence[Stroke]] | Sequence[Sequence[Cycle]]
) -> dict[str, NDArray[Any]]:
    """The columns of strokes or of cycles, shape (rows,), in SI."""
    rows = [
        {"realization_index": index, "stroke_number": place, "cycle_number": place, "": one}
        for index, own in enumerate(per_realization)
        for place, one in enumerate(own, 1)
    ]
    return {
        name: np.array(
            [row[name] if name in row else _value(row[""], name) for row in rows],
            dtype=meaning.dtype,
        )
        for name, meaning in meanings.items()
    }


def strokes_from(tree: DataTree) -> Strokes:
    """The strokes that `strokes` returned, without means over cycles."""
    columns = {
        group: {str(name): one.values for name, one in tree[group].data_vars.items()}
        for group in ("strokes", "cycles")
    }
    unit = tree["strokes"]["mean_friction"].attrs["units"]
    notes = str(tree.attrs["notes"]).splitlines()
    return Strokes(columns, {}, tree.attrs["middle"], unit, tree.attrs["source"], notes)


def _checked_period(value: object) -> object:
    is_found = isinstance(value, str) and value == "auto"
    return value if is_found else arguments.number(0, is_open=True)(value)


@arguments.checked(middle=arguments.number(0, 1, is_open=True), period=_checked_period)
def strokes(
    output: OutputLike, *, middle: float = MIDDLE, period: float | Literal["auto"] | None = None
) -> DataTree:
    """The strokes of a record that goes back and forth, or the revolutions of a disc.

    Parts of strokes at either end of the record are left out.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.
    middle
        Share of the length of a stroke over which friction is averaged; of the time of a stroke
        where no displacement is known. If the reversal reaches into the middle, it is left out as a
        transient.
    period
        Time of a revolution of a disc [s], or "auto": the time after which the force repeats
        itself. By default, revolutions are those of a recorded column
        of revolutions or of their speed. A row has whole revolutions with at least 20 samples.

    Returns
    -------
    xarray.DataTree
        Group ``strokes``, dimension ``stroke``: times, ``direction`` (+1 or -1), ``length``,
        ``velocity``, ``mean_friction`` along the motion with its standard error, which includes
        the correlation of samples, the coefficient where the normal force is known,
        ``max_friction`` and its distance from the reversal, the forces at the reversals, and the
        ``stiffness`` of the reversal. Group ``cycles``, dimension ``cycle``: ``loop_energy``,
        ``offset`` (half the sum of the mean forces in both directions), and means. SI; of a
        measured friction coefficient forces have the unit 1. Attributes: ``source``, the quantity
        in which strokes were found, and ``notes``.

    Raises
    ------
    FileError
        If the output cannot be read, or does not go back and forth.
    ConfigError
        If the share is not between 0 and 1.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("measured/reciprocating")  # writes the file and a description
    >>> found = mesoslip.strokes(mesoslip.read_trace(path))
    >>> round(float(found["strokes"]["mean_friction_coefficient"].mean()), 2)
    0.46
    """
    import xarray as xr

    with opened_run_arrays(output) as tree:
        found = strokes_of(tree, middle, period=period)
    groups = {
        name: group.dataset((dimension,), found.columns[name], found.force_unit)
        for name, group, dimension in (("strokes", STROKES, "stroke"), ("cycles", CYCLES, "cycle"))
    }
    result = xr.DataTree.from_dict(groups)
    result.attrs |= {"source": found.source, "middle": middle, "notes": "\n".join(found.notes)}
    return result
