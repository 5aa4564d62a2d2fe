"""Tables of slips, avalanches, responses, strokes, plateaus and fronts as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from mesoslip.analysis import avalanches, fronts, slips
from mesoslip.analysis.plateaus.catalogue import plateaus_from
from mesoslip.analysis.response import dataset, tables
from mesoslip.analysis.strokes.catalogue import strokes_from
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.table_files import PrintedTable, is_printed, write_printed


class _Writers(NamedTuple):
    """The tables of a catalogue for print, and its file of comma-separated values."""

    tables: Callable[[], Sequence[PrintedTable]]
    write_csv: Callable[[Path], None]


def _own(make: Callable[[Any], Any], data: Any) -> _Writers:
    """Those of a catalogue that has them itself."""
    found = make(data)
    return _Writers(lambda: found.tables, found.write_csv)


def _of_response(data: Any) -> _Writers:
    return _Writers(partial(tables.tables, data), partial(dataset.write_csv, data))


def _of_avalanches(data: Any) -> _Writers:
    return _Writers(lambda: [avalanches.printed(data)], partial(avalanches.write_csv, data))


# By a group or a dimension that only these data have.
BY_GROUP: dict[str, Callable[[Any], _Writers]] = {
    "steady": _of_response,
    "cycles": partial(_own, strokes_from),
    "fronts": partial(_own, fronts.fronts_from),
}
BY_DIMENSION: dict[str, Callable[[Any], _Writers]] = {
    "plateau": partial(_own, plateaus_from),
    "slip": partial(_own, slips.catalogue_from),
    "avalanche": _of_avalanches,
}


def write_table(data: xr.Dataset | xr.DataTree, file: PathLike) -> None:
    """Write what `slips`, `avalanches`, `response`, `strokes`, `plateaus` or `fronts` returned.

    Parameters
    ----------
    data
        The catalogue, the response, the strokes, the plateaus, or the fronts.
    file
        The file: ``.tex`` for LaTeX with booktabs, ``.md`` for Markdown, each column in one unit;
        otherwise comma-separated values in SI units.

    Raises
    ------
    FileError
        If the data are of another kind, or the file cannot be written.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200", "run.duration=4 s"]))
    >>> mesoslip.write_table(mesoslip.slips(tree), "slips.csv")
    """
    path = as_path(file)
    known = BY_GROUP if isinstance(data, xr.DataTree) else BY_DIMENSION
    names = data.children if isinstance(data, xr.DataTree) else getattr(data, "dims", ())
    for name, writers_of in known.items():
        if name in names:
            writers = writers_of(data)
            if is_printed(path):
                write_printed(writers.tables(), path)
            else:
                writers.write_csv(path)
            return
    raise FileError(
        f"{path}: is for what mesoslip.slips, avalanches, response, strokes, plateaus or fronts "
        "returns"
    )
