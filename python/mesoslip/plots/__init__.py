"""Pictures of outputs."""

import os.path
from typing import Any

RC_FILE = "matplotlibrc"


def _load_matplotlib() -> None:
    """Load matplotlib without the file matplotlibrc of the current folder, which may be anyone's
    and wrong."""
    exists = os.path.exists

    def exists_elsewhere(path: Any) -> bool:
        return path != RC_FILE and exists(path)

    os.path.exists = exists_elsewhere
    try:
        import matplotlib as mpl  # noqa: F401
    finally:
        os.path.exists = exists


_load_matplotlib()
