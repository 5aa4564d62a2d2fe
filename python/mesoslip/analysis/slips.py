"""The catalogue of slips of an output, and its statistics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import Apparatus, apparatus_of
from mesoslip.analysis.stick_phases import stick_phases
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.table_files import write_table

if TYPE_CHECKING:
    import xarray as xr

COLUMNS = (
    "realization_index",
    "start_time",
    "end_time",
    "force_before",
    "force_after",
    "force_drop",
    "peak_velocity",
    "contacts_broken",
    "duration",
    "waiting_time",
    "stick_duration",
    "loading_rate",
    "loading_stiffness",
    "creep_displacement",
    "creep_share",
    "peak_fall_rate",
)


# Attributes of columns that the group of an output does not have, and units of those that do not
# hang on that of the force.
MEANINGS = {
    "duration": "duration of the slip",
    "waiting_time": "time since the start of the slip before",
    "stick_duration": "time since the end of the slip before",
    "loading_rate": "rate of the force while the slider sticks",
    "loading_stiffness": "growth of the force over the displacement of the drive",
    "creep_displacement": "displacement of the slider between the slips",
    "creep_share": "its share of the displacement of the drive",
    "peak_fall_rate": "maximum rate at which the force fell in the slip",
}
UNITS = {
    "duration": "s",
    "waiting_time": "s",
    "stick_duration": "s",
    "creep_displacement": "m",
    "creep_share": "1",
}
# Those of them that need the trace.
STICK_COLUMNS = tuple(MEANINGS)[2:]


# Units of forces where the trace is a friction coefficient.
COEFFICIENT_UNITS = {"N": "1", "N/s": "1/s", "N/m": "1/m"}


def as_recorded(head: str, unit: str, force_unit: str) -> tuple[str, str]:
    """Head and unit of a column of forces, for friction coefficients if the trace has these.

    Parameters
    ----------
    head, unit
        Those for forces in newtons.
    force_unit
        Unit of the trace, "N" or "1".
    """
    if force_unit != "1":
        return head, unit
    return head.replace("force", "friction"), COEFFICIENT_UNITS.get(unit, unit)


class Column(NamedTuple):
    """A column of a catalogue: values of shape (slips,) in SI, their unit, and what they are."""

    values: NDArray[Any]
    unit: str
    meaning: str


@dataclass(frozen=True)
class Catalogue:
    """The catalogue of slips of an output.

    Attributes
    ----------
    columns
        The columns `COLUMNS` by name, see `slips`.
    force_unit
        Unit of the force, "N", or "1" of a friction coefficient.
    """

    columns: Mapping[str, Column]
    force_unit: str

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each slip; None for unknown values."""
        columns = [self.columns[name].values.tolist() for name in COLUMNS]
        return [
            {
                name: None if value != value else value
                for name, value in zip(COLUMNS, row, strict=True)
            }
            for row in zip(*columns, strict=True)
        ]

    @property
    def statistics(self) -> dict[str, dict[str, float]]:
        """Number of slips; mean, standard deviation, minimum and maximum of each column, in SI.

        The first slip of a run counts too.
        """
        count = float(len(self.columns["start_time"].values))
        result: dict[str, dict[str, float]] = {"slips": {"count": count}}
        for name in COLUMNS[3:]:
            values = self.columns[name].values
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
        """Write the catalogue as a table with the units in its header.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        write_table(self.rows, {name: self.columns[name].unit for name in COLUMNS}, path)


def catalogue_of(tree: Tree) -> Catalogue:
    """The catalogue of slips of an output of a run or a measured trace."""
    data = group_of(tree, "slips")
    start, owners = data["start_time"].values, data["realization_index"].values
    waiting = np.diff(start, prepend=np.nan)
    if start.size:
        waiting[np.diff(owners, prepend=-1) != 0] = np.nan
    apparatus = apparatus_of(tree)
    unit = apparatus.force_unit
    units = dict.fromkeys(("force_before", "force_after", "force_drop"), unit) | {
        "loading_rate": _over(unit, "s"),
        "loading_stiffness": _over(unit, "m"),
        "peak_fall_rate": _over(unit, "s"),
    }
    duration = data["end_time"].values - start
    added = dict(
        zip(MEANINGS, (duration, waiting, *_stick_columns(tree, data, apparatus)), strict=True)
    )
    columns = {}
    for name in COLUMNS:
        if name in added:
            given = units.get(name, UNITS.get(name, "1"))
            columns[name] = Column(added[name], given, MEANINGS[name])
        else:
            attributes = data[name].attrs
            given = units.get(name, attributes.get("units", "1"))
            columns[name] = Column(data[name].values, given, attributes.get("long_name", name))
    return Catalogue(columns, unit)


def catalogue_from(data: xr.Dataset) -> Catalogue:
    """The catalogue that `slips` returned."""
    columns = {
        name: Column(
            data[name].values,
            data[name].attrs.get("units", "1"),
            data[name].attrs.get("long_name", name),
        )
        for name in COLUMNS
    }
    return Catalogue(columns, columns["force_drop"].unit)


def slips(output: OutputLike) -> xr.Dataset:
    """The catalogue of slips of an output, dimension ``slip``, in SI.

    Returns
    -------
    xarray.Dataset
        The group ``slips`` of the output with the coordinate ``realization_index``, the
        ``duration``, and the ``waiting_time`` since the start of the slip before, NaN for the first
        slip of a realization. The stick phase before a slip (`mesoslip.analysis.stick_phases`) has
        a ``stick_duration``, ``loading_rate``, ``loading_stiffness``, ``creep_displacement`` and
        ``creep_share``; ``peak_fall_rate`` is the maximum rate at which the force fell. Forces of a
        measured friction coefficient have the unit 1.

    Raises
    ------
    FileError
        If the output cannot be read, or is not of a run.
    """
    import xarray as xr

    tree = as_run(output)
    columns = catalogue_of(tree).columns
    found = group_of(tree, "slips").set_coords("realization_index")
    found = found.assign(
        {
            name: xr.Variable("slip", values, {"units": unit, "long_name": meaning})
            for name, (values, unit, meaning) in columns.items()
            if name in MEANINGS
        }
    )
    for name in ("force_before", "force_after", "force_drop"):
        found[name].attrs["units"] = columns[name].unit
    return found


def _over(unit: str, base: str) -> str:
    """A unit over another, as CF writes them."""
    return f"{base}-1" if unit == "1" else f"{unit} {base}-1"


def _stick_columns(
    tree: Tree, data: xr.Dataset | Arrays, apparatus: Apparatus
) -> Iterable[NDArray[np.float64]]:
    """Columns of the stick phases, and the peak rate of fall, in the order of `COLUMNS`."""
    root = tree.to_dataset()
    owners = data["realization_index"].values
    time = root["time"].values
    # The catalogue of an elastic slider is that of its mean force.
    name = "elastic_force" if "elastic_force" in root else apparatus.force_name
    columns = {one: np.full(len(owners), np.nan) for one in STICK_COLUMNS}
    is_good = np.ones(len(time), dtype=bool)
    if "noise" in tree.children:
        is_good = ~np.isin(time, group_of(tree, "noise")["impulse_time"].values)
    for owner in np.unique(owners):
        mine = owners == owner
        traces = {
            one: root[one].values[owner].astype(float)
            for one in (name, "drive_displacement")
            if one in root
        }
        known = is_good & np.isfinite(traces[name])
        drive = traces.get("drive_displacement")
        if drive is not None and not np.isfinite(drive[known]).all():
            drive = None
        ends = ("start_time", "end_time", "force_before", "force_after")
        phases = stick_phases(
            time[known],
            traces[name][known],
            *(data[one].values[mine] for one in ends),
            drive=None if drive is None else drive[known],
            stiffness=apparatus.stiffness,
        )
        for one in columns:
            if one != "peak_fall_rate":
                columns[one][mine] = getattr(phases, one)
    if "peak_fall_rate" in data:
        columns["peak_fall_rate"] = data["peak_fall_rate"].values
    elif math.isfinite(apparatus.stiffness) and math.isfinite(apparatus.velocity):
        speed = np.abs(data["peak_velocity"].values)
        columns["peak_fall_rate"] = apparatus.stiffness * (speed - abs(apparatus.velocity))
    return columns.values()


def counts(tree: Tree) -> dict[str, Any] | None:
    """Numbers of slips of a measured trace by minimum fall; None for runs.

    ``used`` is the minimum fall of the catalogue, ``plateau`` the range in which the number hardly
    changes and at whose start it lies, or None.
    """
    if "slip_counts" not in tree.children:
        return None
    data = group_of(tree, "slip_counts")
    plateau = data.attrs.get("plateau")
    return {
        "min_fall": data["min_fall"].values.tolist(),
        "slip_count": data["slip_count"].values.tolist(),
        "used": float(data.attrs["used"]),
        "plateau": None if plateau is None else [float(one) for one in plateau],
    }
