"""The output of a run in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import DataTree
from mesoslip.output.filling import blocks
from mesoslip.output.layout import describe

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]


def build_tree(results: Results) -> DataTree:
    """The results of a run in memory, with the layout of an output file."""
    import xarray as xr

    layout = describe(results)
    arrays: dict[str, dict[str, Array]] = {}
    for group, form in layout.items():
        sizes = {**layout[""].sizes, **form.sizes}
        arrays[group] = {}
        for name, entry in form.entries.items():
            # Samples after the end of an interrupted run stay NaN.
            empty = np.nan if entry.dtype.kind == "f" else 0
            values = np.full([sizes[one] for one in entry.dimensions], empty, dtype=entry.dtype)
            if not entry.table and np.size(entry.values):
                values[...] = np.asarray(entry.values, dtype=entry.dtype)
            arrays[group][name] = values
    for block in blocks(results, layout):
        for name, where, values in block.values():
            arrays[block.group][name][where] = values
    datasets = {}
    for group, form in layout.items():
        made = {
            name: xr.Variable(entry.dimensions, arrays[group][name], entry.meaning.attributes)
            for name, entry in form.entries.items()
        }
        for name, entry in form.entries.items():
            made[name].encoding = {"_FillValue": entry.fill_value}
            if not entry.shrinks:
                made[name].encoding["zlib"] = False
        coordinates = {name: made[name] for name in made if form.entries[name].is_coordinate}
        others = {name: made[name] for name in made if name not in coordinates}
        datasets["/" + group] = xr.Dataset(others, coordinates, form.attributes)
    return xr.DataTree.from_dict(datasets)
