"""xarray without the packages of other arrays than NumPy's, which take longer to import than it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

# Packages that xarray imports, where they are installed, to compare the types of their arrays with
# those of its data, and to find the locks that a scheduler needs. Outputs have NumPy's arrays.
ARRAY_PACKAGES = ("dask", "pint", "cupy", "sparse")


@contextmanager
def hidden() -> Iterator[None]:
    """While the context lasts, those that are not yet imported seem not to be installed."""
    absent = [name for name in ARRAY_PACKAGES if name not in sys.modules]
    # None there makes an import fail.
    sys.modules.update(dict.fromkeys(absent))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


def import_xarray() -> None:
    """Import xarray with all of them hidden while it looks for them, unless it is imported.

    It looks once in a process, at its first index and its first data to load. Others can import the
    packages afterwards.
    """
    if "xarray" in sys.modules:
        return
    imported = {name: sys.modules.pop(name) for name in ARRAY_PACKAGES if name in sys.modules}
    try:
        with hidden():
            import xarray as xr

            xr.Dataset(coords={"x": [0.0]}).load()
    finally:
        sys.modules.update(imported)
