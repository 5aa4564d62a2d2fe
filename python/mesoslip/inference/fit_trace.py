"""`fit`: parameters of the model from a trace, from its file to the posterior as a tree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.inference import fit as fits
from mesoslip.inference.plan import Plan
from mesoslip.inference.posterior import build_tree
from mesoslip.output.inputs import OutputLike, as_run

if TYPE_CHECKING:
    import xarray as xr


def fit(
    output: OutputLike,
    config: PathLike | Mapping[str, Any] | Plan,
    *,
    store: PathLike | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> xr.DataTree:
    """Fit parameters of the model to a trace, with their uncertainty.

    Parameters
    ----------
    output
        Output with the trace, measured (see `read_trace`) or simulated; the first realization is
        fitted.
    config
        The known parameters, and the free ones in a table ``[fit.free]``: a TOML file, nested
        tables, or a `mesoslip.inference.plan.Plan`.
    store
        Folder in which each finished simulation is stored, and from which it is read when the fit
        is called again; by default simulations are not stored.
    executor
        Where simulations are computed: `Threads`, `Processes` or `Dask`, or a number of threads, by
        default the number of processors. The result does not depend on it.
    progress
        Called repeatedly with the fraction of finished simulations, 0 to 1.
    stop
        A request to stop, after which `mesoslip.execution.stop.StoppedError` is raised; Ctrl-C is
        one too.

    Returns
    -------
    xarray.DataTree
        The posterior, see `mesoslip.inference.posterior.build_tree`: groups ``posterior``,
        ``prior``, ``observed_data``, ``posterior_predictive`` as ArviZ has them, and more.

    Raises
    ------
    FileError, ConfigError
        If the trace cannot be fitted, or the configuration is wrong or contradicts the trace.
    RunError
        If no simulation resembles the trace.
    """
    fitted = fits.fit(
        as_run(output),
        _as_plan(config),
        store=None if store is None else as_path(store),
        executor=executor,
        progress=progress,
        stop=stop,
    )
    return build_tree(fitted)


def _as_plan(config: PathLike | Mapping[str, Any] | Plan) -> Plan:
    """A fit from its file or from nested tables.

    Raises
    ------
    FileError
        If a file cannot be read.
    ConfigError
        If it is wrong.
    """
    if isinstance(config, Plan):
        return config
    if isinstance(config, Mapping):
        return Plan.from_dict(config)
    return Plan.load(as_path(config))
