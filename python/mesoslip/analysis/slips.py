"""The catalogue of slips of an output, and its statistics."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.output.access import group_of
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.targets import written_whole

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
)


def slips(output: OutputLike) -> xr.Dataset:
    """The catalogue of slips of an output, dimension ``slip``, in SI.

    Returns
    -------
    xarray.Dataset
        The group ``slips`` of the output with the coordinate ``realization_index``, the
        ``duration``, and the ``waiting_time`` since the start of the slip before, NaN for the first
        slip of a realization.

    Raises
    ------
    FileError
        If the output cannot be read, or is not of a run.
    """
    import xarray as xr

    data = group_of(as_run(output), "slips").set_coords("realization_index")
    duration = data["end_time"] - data["start_time"]
    waiting = np.diff(data["start_time"].values, prepend=np.nan)
    if data.sizes["slip"]:
        waiting[np.diff(data["realization_index"].values, prepend=-1) != 0] = np.nan
    return data.assign(
        duration=duration.assign_attrs(units="s", long_name="duration of the slip"),
        waiting_time=xr.Variable(
            "slip", waiting, {"units": "s", "long_name": "time since the start of the slip before"}
        ),
    )


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


def write_table(rows: Iterable[Mapping[str, Any]], units: Mapping[str, str], path: Path) -> None:
    """Write a table as comma-separated values.

    Parameters
    ----------
    rows
        A dictionary for each row.
    units
        Unit of each column, for the header.
    path
        The file.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    with written_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(units))
        writer.writerow({name: f"{name} [{unit}]" for name, unit in units.items()})
        writer.writerows(rows)
