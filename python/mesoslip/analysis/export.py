"""Outputs in the formats of other programs, chosen by the ending of the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from mesoslip.analysis.quakeml import write_quakeml
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.inputs import OutputLike, as_output
from mesoslip.output.zarr import write_zarr

if TYPE_CHECKING:
    import xarray as xr

FORMATS: dict[str, Callable[[xr.DataTree, Path], None]] = {
    ".zarr": write_zarr,
    ".xml": write_quakeml,
}


def export(output: OutputLike, file: PathLike) -> None:
    """Write an output in the format of another program, by the ending of the file.

    Parameters
    ----------
    output
        An output of any command for Zarr; of a run, or a measured trace, for QuakeML.
    file
        ``.zarr``: the whole output as a Zarr store, a folder, which xarray reads; needs zarr.
        ``.xml``: the slips as events of QuakeML, which ObsPy reads; needs ObsPy.

    Raises
    ------
    FileError
        If the output cannot be read, the package of the format is not installed, or the file
        cannot be written.
    """
    path = as_path(file)
    write = FORMATS.get(path.suffix.lower())
    if write is None:
        raise FileError(
            f"{path}: the ending of its name is not that of a format: .zarr (Zarr) or .xml "
            "(slips as QuakeML)"
        )
    write(as_output(output), path)
