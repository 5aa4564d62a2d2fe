"""Outputs written to files: netCDF-4 with the layout that `mesoslip.run` returns in memory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np

from mesoslip import array_packages
from mesoslip.configuration.config import Config
from mesoslip.output import filling, layout
from mesoslip.output.chunks import COMPRESSION_LEVEL, write_chunks
from mesoslip.output.hdf5 import LOCK
from mesoslip.output.layout import Entry, GroupLayout
from mesoslip.output.targets import written_whole

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.simulation.run_realizations import Results

# Variables with fewer values are not worth compressing.
MIN_COMPRESSED = 1000

COMPRESSION: dict[str, Any] = {"zlib": True, "complevel": COMPRESSION_LEVEL, "shuffle": True}


def write(tree: xr.DataTree, path: Path) -> None:
    """Write a tree as an output; its name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    encoding = {group.path: _encoding(group.to_dataset(inherit=False)) for group in tree.subtree}
    # xarray asks Dask for the locks of its scheduler, of which there is none unless it is imported.
    with written_whole(path) as part, LOCK, array_packages.hidden():
        tree.to_netcdf(part, engine="netcdf4", encoding=encoding)


def _encoding(data: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Compression of large variables, and missing values of what is no coordinate, as in CF."""
    encoding: dict[str, dict[str, Any]] = {}
    for name, one in data.variables.items():
        is_large = one.size > MIN_COMPRESSED and one.encoding.get("zlib", True)
        if name in data.coords:
            encoding[str(name)] = {**(COMPRESSION if is_large else {}), "_FillValue": None}
        elif is_large:
            encoding[str(name)] = {**COMPRESSION, **_fill_value(one)}
    return encoding


def _fill_value(variable: xr.Variable) -> dict[str, Any]:
    """Encoding of missing values, where it is known."""
    return {key: variable.encoding[key] for key in ("_FillValue",) if key in variable.encoding}


def write_results(results: Results, path: Path, *, threads: int = 1) -> None:
    """Write the results of a run, of which only blocks are held in memory.

    The file is that of `write` and `mesoslip.output.tree.build_tree`.

    Parameters
    ----------
    results
        The results.
    path
        The file.
    threads
        Threads that arrange and compress values.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    groups = layout.describe(results)
    with written_whole(path) as part, LOCK:
        with netCDF4.Dataset(part, "w", format="NETCDF4") as file:
            for name, form in groups.items():
                place = file.createGroup(name) if name else file
                _create_group(place, form, groups[""], results.config)
        write_chunks(part, filling.blocks(results, groups), threads)


def _create_group(
    place: netCDF4.Dataset, form: GroupLayout, root: GroupLayout, config: Config
) -> None:
    """Make the dimensions, variables and attributes of a group, and write what is no table."""
    place.setncatts(form.attributes)
    for name, size in form.sizes.items():
        place.createDimension(name, size)
    sizes = {**root.sizes, **form.sizes}
    for name, entry in form.entries.items():
        storage = _storage(entry, [sizes[one] for one in entry.dimensions], config)
        variable = place.createVariable(
            name, entry.dtype, entry.dimensions, fill_value=entry.fill_value, **storage
        )
        variable.set_auto_maskandscale(False)
        variable.setncatts(entry.meaning.attributes)
        auxiliary = form.auxiliary_coordinates(name)
        if auxiliary:
            variable.coordinates = " ".join(auxiliary)
        if not entry.table and np.size(entry.values):
            variable[...] = np.asarray(entry.values, dtype=entry.dtype)


def _storage(entry: Entry, shape: list[int], config: Config) -> dict[str, Any]:
    """Chunks of a variable that hold a block of rows, and compression where it pays."""
    if math.prod(shape) <= MIN_COMPRESSED or not entry.table:
        return {}
    # One realization at a time.
    chunks = [1, *shape[1:]] if entry.is_padded else list(shape)
    along = 1 if entry.is_padded else 0
    chunks[along] = min(shape[along], filling.block_rows(config, entry.table))
    return {"chunksizes": chunks, **(COMPRESSION if entry.shrinks else {})}
