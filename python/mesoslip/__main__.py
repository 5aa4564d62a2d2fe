"""The program: ``mesoslip`` and ``python -m mesoslip`` are the command line."""

import sys

from mesoslip.command_line.main import main


def start() -> None:
    """Run the command line in a process of its own, and exit."""
    # xarray imports Dask only to ask of each array whether it is one of Dask's. None are, but with
    # the workers of a cluster. What is None here cannot be imported.
    if not any(one.startswith("--scheduler") for one in sys.argv):
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]
    main()


if __name__ == "__main__":
    start()
