"""Outputs as Zarr stores, by xarray, with the layout of netCDF files."""

from __future__ import annotations

from pathlib import Path

from mesoslip.array_types import DataTree
from mesoslip.errors import FileError
from mesoslip.output.targets import private_folder

# Version of the format; version 3 has no text of fixed length.
FORMAT = 2
# File of a group, by which a store is recognized.
MARK = ".zgroup"


def write_zarr(tree: DataTree, path: Path) -> None:
    """Write an output as a Zarr store, which replaces an earlier one when it is whole."""
    try:
        import zarr  # noqa: F401
    except ImportError:
        raise FileError(
            f"{path}: Zarr needs a package that is not installed: python -m pip install "
            "'mesoslip[zarr]', or python -m pip install zarr"
        ) from None
    if path.is_symlink() or (path.exists() and not (path / MARK).is_file()):
        raise FileError(f"{path}: cannot be written: exists, and is not a Zarr store")
    plain = tree.copy()
    for group in plain.subtree:
        for name in group.variables:
            # Compression is Zarr's own.
            group[str(name)].encoding = {}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with private_folder(path.parent) as folder:
            plain.to_zarr(folder.path / path.name, zarr_format=FORMAT, consolidated=True)
            if path.exists():
                folder.set_aside(path.name)
            folder.release(path.name)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error
