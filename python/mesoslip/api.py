"""`run`: simulate a configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mesoslip.array_types import DataTree
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike
from mesoslip.execution.executors import ExecutorLike
from mesoslip.output.inputs import as_config
from mesoslip.output.tree import build_tree
from mesoslip.simulation.run_realizations import run_realizations


@arguments.checked(progress=arguments.function)
def run(
    config: PathLike | Mapping[str, Any] | Config,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
) -> DataTree:
    """Simulate a configuration.

    Parameters
    ----------
    config
        A TOML file, an output to run again, nested tables, or a `Config`.
    executor
        Computes the realizations: `Threads`, `Processes` or `Dask`, or a number of threads, by
        default the number of processors. The result does not depend on it.
    progress
        Called repeatedly with the completed fraction of the work, 0 to 1.

    Returns
    -------
    xarray.DataTree
        Equal to an output file. The root has the trace, with dimensions (realization, time), and
        numbers for each realization; groups are ``slips``, ``stages``, ``energy``, and where there
        are any ``slip_traces``, ``avalanches`` and ``snapshots``. After Ctrl-C the attribute
        ``complete`` is "false", and samples that were not computed are NaN.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.
    RunError
        If the run fails.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200"]))
    >>> tree["spring_force"].dims, tree["spring_force"].attrs["units"]
    (('realization', 'time'), 'N')
    >>> tree["slips"]["force_drop"].dims
    ('slip',)
    """
    checked = as_config(config)
    results = run_realizations(checked, executor=executor, progress=progress)
    return build_tree(results)
