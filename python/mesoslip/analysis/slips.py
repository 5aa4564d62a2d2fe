"""The catalogue of slips of an output, and its statistics."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import Apparatus, apparatus_of
from mesoslip.analysis.stick_phases import stick_phases
from mesoslip.output.access import group_of
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.tables import write_table

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


# Further columns of the catalogue, and units of those that do not hang on that of the force.
MEANINGS = {
    "stick_duration": "time since the end of the slip before",
    "loading_rate": "rate of the force while the slider sticks",
    "loading_stiffness": "growth of the force over the displacement of the drive",
    "creep_displacement": "displacement of the slider between the slips",
    "creep_share": "its share of the displacement of the drive",
    "peak_fall_rate": "maximum rate at which the force fell in the slip",
}
UNITS = {"stick_duration": "s", "creep_displacement": "m", "creep_share": "1"}


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
    data = group_of(tree, "slips").set_coords("realization_index")
    duration = data["end_time"] - data["start_time"]
    waiting = np.diff(data["start_time"].values, prepend=np.nan)
    if data.sizes["slip"]:
        waiting[np.diff(data["realization_index"].values, prepend=-1) != 0] = np.nan
    apparatus = apparatus_of(tree)
    unit = apparatus.force_unit
    units = {
        "loading_rate": _over(unit, "s"),
        "loading_stiffness": _over(unit, "m"),
        "peak_fall_rate": _over(unit, "s"),
    }
    further: dict[str, Any] = {
        name: xr.Variable(
            "slip", values, {"units": units.get(name, UNITS.get(name)), "long_name": meaning}
        )
        for (name, meaning), values in zip(
            MEANINGS.items(), _stick_columns(tree, data, apparatus), strict=True
        )
    }
    found = data.assign(
        duration=duration.assign_attrs(units="s", long_name="duration of the slip"),
        waiting_time=xr.Variable(
            "slip", waiting, {"units": "s", "long_name": "time since the start of the slip before"}
        ),
        **further,
    )
    for name in ("force_before", "force_after", "force_drop"):
        found[name].attrs["units"] = unit
    return found


def _over(unit: str, base: str) -> str:
    """A unit over another, as CF writes them."""
    return f"{base}-1" if unit == "1" else f"{unit} {base}-1"


def _stick_columns(
    tree: xr.DataTree, data: xr.Dataset, apparatus: Apparatus
) -> Iterable[NDArray[np.float64]]:
    """Columns of the stick phases, and the peak rate of fall, in the order of `MEANINGS`."""
    root = tree.to_dataset()
    owners = data["realization_index"].values
    time = root["time"].values
    # The catalogue of an elastic slider is that of its mean force.
    name = "elastic_force" if "elastic_force" in root else apparatus.force_name
    columns = {one: np.full(len(owners), np.nan) for one in MEANINGS}
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


def statistics(tree: xr.DataTree) -> dict[str, dict[str, float]]:
    """Number of slips; mean, standard deviation, minimum and maximum of each column, in SI.

    The first slip of a run counts too.
    """
    data = slips(tree)
    result: dict[str, dict[str, float]] = {"slips": {"count": float(data.sizes["slip"])}}
    for name in COLUMNS[3:]:
        values = data[name].values[np.isfinite(data[name].values)]
        if values.size:
            result[name] = {
                "mean": float(np.mean(values)),
                "standard_deviation": float(np.std(values)),
                "minimum": float(np.min(values)),
                "maximum": float(np.max(values)),
            }
    return result


def rows(tree: xr.DataTree) -> list[dict[str, Any]]:
    """The catalogue, a dictionary for each slip; None for unknown values."""
    data = slips(tree)
    columns = [data[name].values.tolist() for name in COLUMNS]
    return [
        {name: None if value != value else value for name, value in zip(COLUMNS, row, strict=True)}
        for row in zip(*columns, strict=True)
    ]


def counts(tree: xr.DataTree) -> dict[str, Any] | None:
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


def write_csv(tree: xr.DataTree, path: Path) -> None:
    """Write the catalogue as a table with the units in its header.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    data = slips(tree)
    units = {name: data[name].attrs.get("units", "1") for name in COLUMNS}
    write_table(rows(tree), units, path)
