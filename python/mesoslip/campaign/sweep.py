"""`sweep`: a configuration over a range of parameters, from its file to its dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from mesoslip.campaign.plan import Plan, as_plan
from mesoslip.campaign.runner import INTERRUPTED, run_sweep
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import RunError
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.store import Store

if TYPE_CHECKING:
    import xarray as xr


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
        Folder in which each finished point is stored, and from which it is read when the sweep is
        called again; by default points are not stored.
    executor
        Where points are computed: `Threads`, `Processes` or `Dask`, or a number of workers. By
        default as many workers as processors: threads at first, and processes if the sweep takes
        long. The result does not depend on it.
    progress
        Called repeatedly with the fraction of finished points, 0 to 1.

    Returns
    -------
    xarray.Dataset
        Dimensions: each swept key, and ``realization``; variables: ``status`` (0 ok, 1 failed, 2
        missing) and the measures. Its attribute ``failures`` says why points failed.

    Raises
    ------
    FileError, ConfigError
        If the sweep cannot be read, or it or one of its combinations is wrong.
    RunError
        If the scheduler is lost, or workers cannot be started.
    """
    checked = as_plan(plan)
    kept = None if store is None else Store(as_path(store), "points")
    with kept or nullcontext():
        done = run_sweep(checked, store=kept, executor=executor, progress=progress)
    if done.missing and done.ending != INTERRUPTED:
        raise RunError(done.ending)
    return done.dataset
