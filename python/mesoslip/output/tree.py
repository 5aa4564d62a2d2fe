"""The output of a run in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.output.filling import fill
from mesoslip.output.layout import describe

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.simulation.run_realizations import Results

Array = NDArray[Any]


def build_tree(results: Results) -> xr.DataTree:
    """The results of a run in memory, with the layout of an output file.

    Returns
    -------
    xarray.DataTree
        Root: the trace, dimensions (realization, time), and numbers for each realization. Groups:
        ``slips`` (slip), ``slip_traces`` (sample), ``avalanches`` (avalanche), ``snapshots``
        (snapshot, row, column), ``energy`` (realization). The trace of an
        interrupted run ends with NaN.
    """
    import xarray as xr

    layout = describe(results)
    sizes = layout[""].sizes
    arrays: dict[str, dict[str, Array]] = {}
    for group, form in layout.items():
        all_sizes = {**sizes, **form.sizes}
        arrays[group] = {
            name: np.full([all_sizes[one] for one in entry.dimensions], np.nan, dtype=entry.dtype)
            if entry.dtype.kind == "f"
            else np.zeros([all_sizes[one] for one in entry.dimensions], dtype=entry.dtype)
            for name, entry in form.entries.items()
        }
    fill(results, layout, arrays)
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
