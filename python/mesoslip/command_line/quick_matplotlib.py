"""Import of matplotlib without what commands do not need, a sixth of the time of a picture."""

from __future__ import annotations

import sys
import warnings
from typing import Any

THREE_D = "mpl_toolkits.mplot3d"


def import_matplotlib() -> None:
    """Import matplotlib without lists of properties in its documentation, and 3D axes."""
    if "matplotlib" in sys.modules:
        return
    # Without the matplotlibrc of the current folder.
    from mesoslip import plots  # noqa: F401, I001
    from matplotlib import artist

    module: Any = artist
    list_properties = module.kwdoc
    module.kwdoc = lambda _: ""
    # An entry of None makes an import fail.
    sys.modules[THREE_D] = None  # type: ignore[assignment]
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Unable to import Axes3D")
            import matplotlib.figure  # noqa: F401
    finally:
        module.kwdoc = list_properties
        del sys.modules[THREE_D]
