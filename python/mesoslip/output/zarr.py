"""Outputs as Zarr, by xarray: the layout of the netCDF file, for storage in pieces."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from mesoslip.errors import FileError

if TYPE_CHECKING:
    import xarray as xr

# Version of the format: 3 has no text of fixed length.
FORMAT = 2
# File of a group, by which an earlier store is known.
MARK = ".zgroup"


def write_zarr(tree: xr.DataTree, path: Path) -> None:
    """Write an output as a Zarr store, a folder that appears when it is whole.

    Parameters
    ----------
    tree
        The output, in memory. ``xarray.open_datatree(path, engine="zarr")`` reads it again.
    path
        The folder; an earlier store there is replaced.

    Raises
    ------
    FileError
        If zarr is not installed, something else is at the path, or the store cannot be written.
    """
    try:
        import zarr  # noqa: F401
    except ImportError:
        raise FileError(
            f"{path}: Zarr needs a package that is not installed: python -m pip install "
            "'mesoslip[zarr]', or python -m pip install zarr"
        ) from None
    if path.exists() and not (path / MARK).is_file():
        raise FileError(f"{path}: cannot be written: is there, and is no Zarr store")
    plain = tree.copy()
    for group in plain.subtree:
        for name in group.variables:
            # Compression is Zarr's own.
            group[str(name)].encoding = {}
    part = path.with_name(f".{uuid4().hex}.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        plain.to_zarr(part, zarr_format=FORMAT, consolidated=True)
        if path.exists():
            shutil.rmtree(path)
        part.replace(path)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            shutil.rmtree(part)
