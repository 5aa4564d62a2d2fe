"""Functions that need several rooms of the package: runs, sweeps, fits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import RunError
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.output.inputs import OutputLike, as_config, as_run
from mesoslip.output.tree import build_tree
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.runner import Results, run_realizations

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.campaign.plan import Plan
    from mesoslip.campaign.runner import Sweep
    from mesoslip.execution.store import Store
    from mesoslip.inference import plan as fit_plans

# What ends a sweep that somebody has stopped.
INTERRUPTED = "interrupted"


def run(
    config: PathLike | Mapping[str, Any] | Config,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
) -> xr.DataTree:
    """Simulate.

    Parameters
    ----------
    config
        A TOML file, an output to run again, nested tables, or a `Config`.
    executor
        Where realizations are computed: `Threads`, `Processes` or `Dask`, or a number of threads;
        by default as many as there are processors. The result does not depend on it.
    progress
        Called now and then with the fraction of the work that is done, 0 to 1.

    Returns
    -------
    xarray.DataTree
        The same as in an output file. After Ctrl-C its attribute ``complete`` is "false", and what
        was not come to is NaN.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.
    RunError
        If the run fails.
    """
    results = simulate(as_config(config), executor=executor, progress=progress)
    return build_tree(results)


def simulate(
    config: Config,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Simulate; what came out as tables, to build a tree of or to write to a file.

    See `run`, and `mesoslip.simulation.runner.run_realizations`.
    """
    return run_realizations(
        config, executor=executor, progress=progress, stop=stop, checkpoint=checkpoint
    )


def sweep(
    plan: PathLike | Mapping[str, Any] | Plan,
    *,
    store: PathLike | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Run a configuration over a range of parameters, and measure each run.

    Parameters
    ----------
    plan
        The file of a sweep, nested tables, or a `mesoslip.campaign.plan.Plan`.
    store
        Folder where each point is kept as soon as it is done, and read from when the sweep is
        called again; nowhere by default.
    executor
        Where points are computed: `Threads`, `Processes` or `Dask`, or a number of workers, by
        default as many as there are processors: threads at first, and processes in a sweep that
        takes long. The result does not depend on it.
    progress
        Called now and then with the fraction of the points that are done, 0 to 1.

    Returns
    -------
    xarray.Dataset
        Dimensions: each swept key, and ``realization``; variables: ``status`` (0 ok, 1 failed, 2
        missing) and the measures. Its attribute ``failures`` tells why points failed.

    Raises
    ------
    FileError, ConfigError
        If the sweep cannot be read or is wrong, or a combination cannot be run.
    RunError
        If the scheduler is gone, or workers cannot be started, before every point was computed.
    """
    from mesoslip.execution.store import Store

    checked = as_plan(plan)
    kept = None if store is None else Store(as_path(store), "points")
    with kept or nullcontext():
        done = run_plan(checked, store=kept, executor=executor, progress=progress)
    if done.missing and done.ending != INTERRUPTED:
        raise RunError(done.ending)
    return done.dataset


def as_plan(plan: PathLike | Mapping[str, Any] | Plan, overrides: Iterable[str] = ()) -> Plan:
    """A sweep from its file or from nested tables.

    Raises
    ------
    FileError
        If a file cannot be read.
    ConfigError
        If the sweep is wrong.
    """
    from mesoslip.campaign.plan import Plan

    if isinstance(plan, Plan):
        return plan
    if isinstance(plan, Mapping):
        return Plan.from_dict(plan)
    return Plan.load(as_path(plan), overrides)


def run_plan(
    plan: Plan,
    *,
    store: Store | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> Sweep:
    """Compute the missing points of a sweep; see `mesoslip.campaign.runner.run_sweep`."""
    from mesoslip.campaign.runner import run_sweep

    return run_sweep(plan, store=store, executor=executor, progress=progress, stop=stop)


def fit(
    output: OutputLike,
    config: PathLike | Mapping[str, Any] | fit_plans.Plan,
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
        Output with the trace, measured (see `read_trace`) or simulated; its first realization.
    config
        What is known, and in a table ``[fit.free]`` what is not: a TOML file, nested tables, or a
        `mesoslip.inference.plan.Plan`.
    store
        Folder where each simulation is kept as soon as it is done, and read from when the fit is
        called again; nowhere by default.
    executor
        Where simulations are computed: `Threads`, `Processes` or `Dask`, or a number of threads; by
        default as many as there are processors. The result does not depend on it.
    progress
        Called now and then with the fraction of the simulations that is done.
    stop
        A request to stop, which raises `mesoslip.execution.stop.StoppedError`; Ctrl-C is one too.

    Returns
    -------
    xarray.DataTree
        The posterior, see `mesoslip.inference.posterior.build_tree`: groups ``posterior``,
        ``prior``, ``observed_data``, ``posterior_predictive`` as ArviZ has them, and more.

    Raises
    ------
    FileError, ConfigError
        If the trace cannot be fitted, or the configuration is wrong or contradicts it.
    RunError
        If no simulation is like the trace.
    """
    from mesoslip.inference import fit as fits
    from mesoslip.inference.plan import Plan
    from mesoslip.inference.posterior import build_tree

    if isinstance(config, Plan):
        plan = config
    elif isinstance(config, Mapping):
        plan = Plan.from_dict(config)
    else:
        plan = Plan.load(as_path(config))
    fitted = fits.fit(
        as_run(output),
        plan,
        store=None if store is None else as_path(store),
        executor=executor,
        progress=progress,
        stop=stop,
    )
    return build_tree(fitted)
