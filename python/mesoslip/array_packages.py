"""Import of xarray without packages of other arrays than NumPy's, which are slower to import."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

# Packages that xarray imports, where they are installed, to recognize their arrays and to find the
# locks of a scheduler. Outputs have NumPy's arrays.
ARRAY_PACKAGES = ("dask", "pint", "cupy", "sparse")


# "xarray" once it was imported while the packages were hidden.
_imported_hidden: set[str] = set()


@contextmanager
def hidden() -> Iterator[None]:
    """Hide the packages that are not imported yet, as if they were not installed.

    Where another program has imported xarray before, it may count on them: nothing is hidden.
    """
    if "xarray" not in sys.modules:
        _imported_hidden.add("xarray")
    elif "xarray" not in _imported_hidden:
        yield
        return
    absent = [name for name in ARRAY_PACKAGES if name not in sys.modules]
    # An entry of None makes an import fail.
    sys.modules.update(dict.fromkeys(absent))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


def import_xarray() -> None:
    """Import xarray, and hide the packages while it looks for them.

    It does so once in a process, at its first index and the first data that it loads. Afterwards
    the packages can be imported as usual.
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
