"""Tables of slips, avalanches, responses, strokes, plateaus and fronts as files."""

from __future__ import annotations

import xarray as xr

from mesoslip.analysis import avalanches, fronts, plateaus, response, slips, strokes
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.table_files import is_printed, write_printed


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
    """
    path = as_path(file)
    for_print = is_printed(path)
    if isinstance(data, xr.DataTree) and "steady" in data.children:
        if for_print:
            write_printed(response.tables(data), path)
        else:
            response.write_csv(data, path)
    elif isinstance(data, xr.DataTree) and "cycles" in data.children:
        found = strokes.strokes_from(data)
        if for_print:
            write_printed(found.tables, path)
        else:
            found.write_csv(path)
    elif isinstance(data, xr.Dataset) and "plateau" in data.dims:
        levels = plateaus.plateaus_from(data)
        if for_print:
            write_printed(levels.tables, path)
        else:
            levels.write_csv(path)
    elif isinstance(data, xr.DataTree) and "fronts" in data.children:
        catalogue_of_fronts = fronts.fronts_from(data)
        if for_print:
            write_printed(catalogue_of_fronts.tables, path)
        else:
            catalogue_of_fronts.write_csv(path)
    elif isinstance(data, xr.Dataset) and "slip" in data.dims:
        catalogue = slips.catalogue_from(data)
        if for_print:
            write_printed([catalogue.printed()], path)
        else:
            catalogue.write_csv(path)
    elif isinstance(data, xr.Dataset) and "avalanche" in data.dims:
        if for_print:
            write_printed([avalanches.printed(data)], path)
        else:
            avalanches.write_csv(data, path)
    else:
        raise FileError(
            f"{path}: is for what mesoslip.slips, avalanches, response, strokes, plateaus or "
            "fronts returns"
        )
