"""The catalogue of slips of an output, its statistics, and its tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import Apparatus, apparatus_of
from mesoslip.analysis.stick_phases import stick_phases
from mesoslip.array_types import Dataset
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.table_files import PrintedTable, rows_of, write_table
from mesoslip.output.variables import with_force_unit
from mesoslip.quantities import Column as PrintedColumn
from mesoslip.quantities import column, number

# Columns that are not in the group of an output: CF units for a force in newtons, and meaning.
ADDED = {
    "duration": ("s", "duration of the slip"),
    "waiting_time": ("s", "time since the start of the slip before"),
    "stick_duration": ("s", "time since the end of the slip before"),
    "loading_rate": ("N s-1", "rate of the force while the slider sticks"),
    "loading_stiffness": ("N m-1", "growth of the force over the displacement of the drive"),
    "creep_displacement": ("m", "displacement of the slider from its rest to the slip"),
    "creep_share": ("1", "its share of the displacement of the drive in that time"),
    "peak_fall_rate": ("N s-1", "maximum rate at which the force fell in the slip"),
}
# Those that need the trace.
STICK_COLUMNS = tuple(ADDED)[2:]
COLUMNS = (
    "realization_index",
    "start_time",
    "end_time",
    "force_before",
    "force_after",
    "force_drop",
    "peak_velocity",
    "contacts_broken",
    *ADDED,
)
# Those of a run with a normal load.
LOAD_COLUMNS = ("normal_force", "friction_coefficient")
# Printed columns: header, and SI unit.
HEADS = {
    "start_time": ("start", "s"),
    "duration": ("duration", "s"),
    "force_before": ("force before", "N"),
    "force_after": ("force after", "N"),
    "force_drop": ("force drop", "N"),
    "peak_velocity": ("peak velocity", "m/s"),
    "contacts_broken": ("breaks", "1"),
    "normal_force": ("normal force", "N"),
    "friction_coefficient": ("coefficient", "1"),
    "waiting_time": ("waiting time", "s"),
    "stick_duration": ("stick duration", "s"),
    "loading_rate": ("loading rate", "N/s"),
    "loading_stiffness": ("loading stiffness", "N/m"),
    "creep_displacement": ("creep before", "m"),
    "creep_share": ("creep share", "1"),
    "peak_fall_rate": ("peak fall rate", "N/s"),
}
# Printed columns that have statistics only.
STATISTICS_ONLY = {*STICK_COLUMNS} - {"creep_share"}
# Columns with the sign of the motion in a slip.
SIGNED = {
    *("force_before", "force_after", "force_drop", "peak_velocity", "friction_coefficient"),
    "loading_rate",
}
# Significant digits of the largest number of a column, and of standard deviations.
DIGITS, DEVIATION_DIGITS = 5, 2


def as_recorded(head: str, unit: str, force_unit: str) -> tuple[str, str]:
    """Head and unit of a column of forces, or of friction coefficients if the force unit is "1"."""
    head = head.replace("force", "friction") if force_unit == "1" else head
    return head, with_force_unit(unit, force_unit)


class Column(NamedTuple):
    """A column of a catalogue: values of shape (slips,) in SI, CF units, and meaning."""

    values: NDArray[Any]
    unit: str
    meaning: str


@dataclass(frozen=True)
class Catalogue:
    """The columns `COLUMNS` of the slips of an output, and with a normal load `LOAD_COLUMNS`; the
    force unit is "N" or "1"."""

    columns: Mapping[str, Column]
    force_unit: str

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each slip; None for unknown values."""
        return rows_of({name: one.values for name, one in self.columns.items()})

    @property
    def goes_back(self) -> bool:
        """Whether there are slips against the positive direction."""
        return bool(np.any(self.columns["force_drop"].values < 0))

    def along_motion(self, name: str) -> NDArray[Any]:
        """The values of a column, positive along the motion in each slip."""
        values, drops = self.columns[name].values, self.columns["force_drop"].values
        return np.where(drops < 0, -values, values) if name in SIGNED else values

    @property
    def statistics(self) -> dict[str, dict[str, float]]:
        """Number of slips, with the first; mean, standard deviation, minimum and maximum of each
        column along the motion, in SI."""
        count = float(len(self.columns["start_time"].values))
        result: dict[str, dict[str, float]] = {"slips": {"count": count}}
        for name in (*COLUMNS[3:], *LOAD_COLUMNS):
            if name not in self.columns:
                continue
            values = self.along_motion(name)
            values = values[np.isfinite(values)]
            if values.size:
                result[name] = {
                    "mean": float(np.mean(values)),
                    "standard_deviation": float(np.std(values)),
                    "minimum": float(np.min(values)),
                    "maximum": float(np.max(values)),
                }
        return result

    def write_csv(self, path: Path) -> None:
        """Write the catalogue as a table with the units in its header."""
        write_table(self.rows, {name: one.unit for name, one in self.columns.items()}, path)

    @property
    def tables(self) -> list[PrintedTable]:
        """The slips for print."""
        return [self.printed()]

    def printed(self) -> PrintedTable:
        """The slips as a table for print, a row for each, each column in one unit."""
        rows = self.rows
        columns = [
            (shown.head(head), *(shown.text(row[name]) for row in rows))
            for name, head, shown in self._printed_columns()
            if name not in STATISTICS_ONLY
        ]
        if any(row["realization_index"] for row in rows):
            columns.insert(0, ("realization", *(str(row["realization_index"]) for row in rows)))
        head, *cells = zip(*columns, strict=True)
        return PrintedTable("Slips", head, tuple(cells))

    def printed_statistics(self) -> PrintedTable:
        """Mean, standard deviation and range of each column as a table for print."""
        statistics = self.statistics
        rows = tuple(
            (shown.head(head), *_statistics(statistics[name], shown.scale.size))
            for name, head, shown in self._printed_columns()
            if name in statistics
        )
        head = ("", "mean", "standard deviation", "minimum", "maximum")
        return PrintedTable("Statistics of slips", head, rows)

    def _printed_columns(self) -> Iterator[tuple[str, str, PrintedColumn]]:
        """Name, header and number format of each column that has a known value."""
        rows = self.rows
        for name, heading in HEADS.items():
            if name not in self.columns:
                continue
            values = [row[name] for row in rows]
            if rows and all(one is None for one in values):
                continue
            head, unit = as_recorded(*heading, self.force_unit)
            yield name, head, column(values, unit, DIGITS)


def _statistics(values: Mapping[str, float], unit: float) -> tuple[str, ...]:
    """Numbers with the decimals that their standard deviation deserves."""
    names = ("mean", "standard_deviation", "minimum", "maximum")
    mean, deviation, low, high = (values[name] / unit for name in names)
    if not low < high:
        return (number(mean, DIGITS), "-", "-", "-")
    decimals = max(0, DEVIATION_DIGITS - 1 - math.floor(math.log10(deviation)))
    return tuple(f"{one:.{decimals}f}" for one in (mean, deviation, low, high))


def catalogue_of(tree: Tree, realization: int | None = None) -> Catalogue:
    """The slips of an output of a run or a measured trace, or of one realization, without reading
    the traces of others."""
    data = group_of(tree, "slips")
    if realization is not None:
        rows = data["realization_index"].values
        start, end = np.searchsorted(rows, (realization, realization + 1))
        data = data.isel(slip=slice(int(start), int(end)))
    start, owners = data["start_time"].values, data["realization_index"].values
    apparatus = apparatus_of(tree)
    added = {
        "duration": data["end_time"].values - start,
        "waiting_time": np.diff(start, prepend=np.nan),
        **_stick_columns(tree, data, apparatus),
    }
    # Between slips in opposite directions the drive turns, and the slider does not only stick.
    is_back = data["force_drop"].values < 0
    is_first = (np.diff(owners, prepend=-1) != 0) | np.diff(is_back, prepend=False)
    for name in ("waiting_time", *STICK_COLUMNS[:-1]):
        added[name][is_first] = np.nan
    columns = {
        name: Column(added[name], *ADDED[name]) if name in added else _column(data, name)
        for name in _columns_of(data)
    }
    unit = apparatus.force_unit
    return Catalogue(
        {name: one._replace(unit=with_force_unit(one.unit, unit)) for name, one in columns.items()},
        unit,
    )


def catalogue_from(data: Dataset) -> Catalogue:
    """The catalogue that `slips` returned."""
    columns = {name: _column(data, name) for name in _columns_of(data)}
    return Catalogue(columns, columns["force_drop"].unit)


def _columns_of(data: Dataset | Arrays) -> tuple[str, ...]:
    return (*COLUMNS, *(name for name in LOAD_COLUMNS if name in data))


def _column(data: Dataset | Arrays, name: str) -> Column:
    attributes = data[name].attrs
    return Column(
        data[name].values, attributes.get("units", "1"), attributes.get("long_name", name)
    )


def slips(output: OutputLike) -> Dataset:
    """The catalogue of slips of an output, dimension ``slip``, in SI.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.

    Returns
    -------
    xarray.Dataset
        The group ``slips`` of the output with the coordinate ``realization_index``, the
        ``duration``, and the ``waiting_time`` since the start of the slip before, NaN for the first
        slip of a realization or after a reversal. The stick phase before a slip
        (`mesoslip.analysis.stick_phases`) has a ``stick_duration``, ``loading_rate``,
        ``loading_stiffness``, ``creep_displacement`` and ``creep_share``; ``peak_fall_rate`` is the
        maximum rate at which the force fell. Forces of a measured friction coefficient have the
        unit 1.

    Raises
    ------
    FileError
        If the output cannot be read, or is not of a run.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> slips = mesoslip.slips(mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200"])))
    >>> slips["force_drop"].attrs["units"], bool(slips["waiting_time"].isnull()[0])
    ('N', True)
    >>> float(slips["duration"][0]) < 0.02  # s
    True
    """
    import xarray as xr

    tree = as_run(output)
    columns = catalogue_of(tree).columns
    found = group_of(tree, "slips").set_coords("realization_index")
    found = found.assign(
        {
            name: xr.Variable("slip", values, {"units": unit, "long_name": meaning})
            for name, (values, unit, meaning) in columns.items()
            if name in ADDED
        }
    )
    for name in ("force_before", "force_after", "force_drop"):
        found[name].attrs["units"] = columns[name].unit
    return found


def _stick_columns(
    tree: Tree, data: Dataset | Arrays, apparatus: Apparatus
) -> dict[str, NDArray[np.float64]]:
    """The columns `STICK_COLUMNS`, NaN where they are unknown."""
    root = tree.to_dataset()
    owners = data["realization_index"].values
    time = root["time"].values
    # The catalogue of an elastic slider is that of its mean force.
    name = "elastic_force" if "elastic_force" in root else apparatus.force_name
    columns = {one: np.full(len(owners), np.nan) for one in STICK_COLUMNS}
    is_good = np.ones(len(time), dtype=bool)
    if "noise" in tree.children:
        is_good = ~np.isin(time, group_of(tree, "noise")["impulse_time"].values)
    for owner in np.unique(owners).tolist():
        mine = owners == owner
        force = root.variables[name].isel(realization=owner).values.astype(float)
        known = is_good & np.isfinite(force)
        drive = None
        if "drive_displacement" in root:
            drive = root.variables["drive_displacement"].isel(realization=owner).values
            drive = drive.astype(float)[known]
            drive = drive if np.isfinite(drive).all() else None
        ends = ("start_time", "end_time", "force_before")
        phases = stick_phases(
            time[known],
            force[known],
            *(data[one].values[mine] for one in ends),
            drive=drive,
            stiffness=apparatus.stiffness,
        )
        for one in STICK_COLUMNS[:-1]:
            columns[one][mine] = getattr(phases, one)
    if "peak_fall_rate" in data:
        columns["peak_fall_rate"] = data["peak_fall_rate"].values
    elif math.isfinite(apparatus.stiffness) and math.isfinite(apparatus.velocity):
        speed = np.abs(data["peak_velocity"].values)
        columns["peak_fall_rate"] = apparatus.stiffness * (speed - abs(apparatus.velocity))
    return columns


def counts(tree: Tree) -> dict[str, Any] | None:
    """Numbers of slips of a measured trace by minimum fall; None for runs.

    ``used`` is the minimum fall of the catalogue. ``mirrored_count`` is what noise makes.
    ``plateau`` is the range, from the automatic minimum on, in which the number hardly changes, or
    None.
    """
    if "slip_counts" not in tree.children:
        return None
    data = group_of(tree, "slip_counts")
    plateau = data.attrs.get("plateau")
    names = ("min_fall", "slip_count", "mirrored_count")
    return {
        **{name: data[name].values.tolist() for name in names if name in data},
        "used": float(data.attrs["used"]),
        "plateau": None if plateau is None else [float(one) for one in plateau],
    }


def printed_counts(found: dict[str, Any], unit: str) -> PrintedTable:
    """The numbers of slips by minimum fall as a table for print; the unit is that of the force."""
    # Steps of a factor, over several decades.
    falls = column(found["min_fall"], unit)
    mirrored = found.get("mirrored_count", [0] * len(found["min_fall"]))
    rows = zip(found["min_fall"], found["slip_count"], mirrored, strict=True)
    return PrintedTable(
        "Slips by minimum fall",
        (falls.head("minimum fall"), "slips", "mirrored", ""),
        tuple(
            (
                number(fall / falls.scale.size, 3),
                str(slips),
                str(noise),
                "used" if fall == found["used"] else "",
            )
            for fall, slips, noise in rows
        ),
    )
