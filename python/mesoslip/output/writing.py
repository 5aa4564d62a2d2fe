"""Files of outputs: netCDF-4 with the layout that `mesoslip.run` returns in memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np

from mesoslip import array_packages
from mesoslip.array_types import Dataset, DataTree
from mesoslip.configuration.config import Config
from mesoslip.output import filling, layout
from mesoslip.output.chunks import COMPRESSION_LEVEL, write_chunks
from mesoslip.output.hdf5 import LOCK
from mesoslip.output.layout import Entry, GroupLayout
from mesoslip.output.targets import written_whole

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results

# Number of values above which a variable is compressed.
MIN_COMPRESSED = 1000

COMPRESSION: dict[str, Any] = {"zlib": True, "complevel": COMPRESSION_LEVEL, "shuffle": True}


def write(tree: DataTree, path: Path) -> None:
    """Write a tree as an output; its name appears only when it is whole."""
    encoding = {group.path: _encoding(group.to_dataset(inherit=False)) for group in tree.subtree}
    # xarray would import Dask to look for locks of its scheduler.
    with written_whole(path, is_output=True) as part, LOCK, array_packages.hidden():
        tree.to_netcdf(part, engine="netcdf4", encoding=encoding)


def _encoding(data: Dataset) -> dict[str, dict[str, Any]]:
    """Compression of large variables, and missing values; CF has none for coordinates."""
    encoding: dict[str, dict[str, Any]] = {}
    for name, one in data.variables.items():
        is_large = one.size > MIN_COMPRESSED and one.encoding.get("zlib", True)
        if name in data.coords:
            encoding[str(name)] = {**(COMPRESSION if is_large else {}), "_FillValue": None}
        elif is_large:
            known = {key: value for key, value in one.encoding.items() if key == "_FillValue"}
            encoding[str(name)] = {**COMPRESSION, **known}
    return encoding


def write_results(
    results: Results,
    path: Path,
    *,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the results of a run block by block, compressed on threads; the file equals that of
    `write` for the tree of `mesoslip.output.tree.build_tree`."""
    groups = layout.describe(results)
    with written_whole(path, is_output=True) as part, LOCK:
        with netCDF4.Dataset(part, "w", format="NETCDF4") as file:
            for name, form in groups.items():
                place = file.createGroup(name) if name else file
                _create_group(place, form, groups[""], results.config)
        blocks = filling.blocks(results, groups)
        if progress is not None:
            blocks = filling.reported(blocks, filling.row_count(results, groups), progress)
        write_chunks(part, blocks, threads)


def _create_group(
    place: netCDF4.Dataset, form: GroupLayout, root: GroupLayout, config: Config
) -> None:
    """Make the dimensions, variables and attributes of a group, and write all but tables."""
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
    """Chunks of a variable, each of one block of rows, and compression."""
    if math.prod(shape) <= MIN_COMPRESSED or not entry.table:
        return {}
    if entry.is_padded:
        chunks = (*filling.chunk_shape(config, entry.table, shape[1]), *shape[2:])
        chunks = (min(chunks[0], shape[0]), *chunks[1:])
    else:
        chunks = (min(shape[0], filling.block_rows(config, entry.table)), *shape[1:])
    return {"chunksizes": chunks, **(COMPRESSION if entry.shrinks else {})}
