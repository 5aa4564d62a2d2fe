"""xarray without the packages of other arrays than NumPy's, for commands that use outputs."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import Any

# Packages that xarray imports, where they are installed, to compare the types of their arrays with
# those of its data. Outputs have NumPy's, and Dask and Pint take longer to import than xarray.
ARRAY_PACKAGES = ("dask", "pint", "cupy", "sparse")


def numpy_only(command: Callable[..., None]) -> Callable[..., None]:
    """A command in whose process xarray knows arrays of NumPy only."""

    @functools.wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        import_xarray()
        command(*arguments, **options)

    return run


def import_xarray() -> None:
    """Import xarray with `ARRAY_PACKAGES` hidden while it looks for them.

    It looks once in a process, at its first index and its first data to load. Others can import the
    packages afterwards.
    """
    if "xarray" in sys.modules:
        return
    imported = {name: sys.modules[name] for name in ARRAY_PACKAGES if name in sys.modules}
    # None there makes an import fail.
    sys.modules.update(dict.fromkeys(ARRAY_PACKAGES))  # type: ignore[arg-type]
    try:
        import xarray as xr

        xr.Dataset(coords={"x": [0.0]}).load()
    finally:
        for name in ARRAY_PACKAGES:
            del sys.modules[name]
        sys.modules.update(imported)
