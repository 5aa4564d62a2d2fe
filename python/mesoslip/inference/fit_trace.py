"""`fit`: parameters of the model from a trace, from its file to the posterior as a tree."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from mesoslip.analysis.even_traces import even_trace
from mesoslip.analysis.noise import noise_level
from mesoslip.analysis.sampled_slips import estimated_period
from mesoslip.array_types import DataTree
from mesoslip.configuration import arguments
from mesoslip.configuration.files import Change
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.units import to_si
from mesoslip.errors import FileError
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.inference import fit as fits
from mesoslip.inference.fit_plan import Known, Plan
from mesoslip.inference.posterior import build_tree
from mesoslip.inference.traced_experiment import MIN_SAMPLES
from mesoslip.output.inputs import OutputLike, as_run, distinct, several, trace_name


@arguments.checked(progress=arguments.function)
def fit(
    output: OutputLike | Sequence[OutputLike],
    config: PathLike | Mapping[str, Any] | Plan,
    *,
    store: PathLike | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> DataTree:
    """Fit parameters of the model to a trace, or several of one interface, with their uncertainty.

    Parameters
    ----------
    output
        Output with the trace, measured (see `read_trace`) or simulated, or several outputs; of each
        the first realization is fitted. Of several traces each has its own drive and spring, as far
        as they are known, and all have the free parameters in common; a free stiffness or velocity
        is that of the first trace, and of the others in the ratio of the declared ones.
    config
        The known parameters, and the free ones in a table ``[fit.free]``: a TOML file, nested
        tables, or a `mesoslip.inference.fit_plan.Plan`. Velocity of the drive, stiffness of the
        spring and duration are those of the trace where the configuration has none. A mass that is
        not given is fitted.
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
        If a trace cannot be fitted, or the configuration is wrong or contradicts the trace.
    RunError
        If no simulation resembles the trace.

    Examples
    --------
    >>> import mesoslip
    >>> written = mesoslip.example("fit/experiment") + mesoslip.example("fit/fit")
    >>> trace = mesoslip.read_trace("experiment.csv", rate=1e3, velocity=1e-7)
    >>> posterior = mesoslip.fit(trace, "fit.toml")  # doctest: +SKIP
    """
    outputs = distinct(several(output))
    if not outputs:
        raise FileError("there is no trace to fit")
    trees = [as_run(one) for one in outputs]
    fitted = fits.fit(
        trees,
        trace_names(outputs, trees),
        as_plan(config, trees),
        store=None if store is None else as_path(store),
        executor=executor,
        progress=progress,
        stop=stop,
    )
    return build_tree(fitted)


def trace_names(outputs: Sequence[OutputLike], trees: Sequence[DataTree]) -> list[str]:
    """Unique names of traces: those of their files, with numbers if necessary."""
    names = [trace_name(one, tree) for one, tree in zip(outputs, trees, strict=True)]
    if len(set(names)) == len(names):
        return names
    return [f"{name} ({number})" for number, name in enumerate(names, 1)]


def as_plan(
    config: PathLike | Mapping[str, Any] | Plan,
    trees: Sequence[DataTree],
    changes: Iterable[Change] = (),
) -> Plan:
    """The plan of a fit from its file or from nested tables, completed from the traces."""
    if isinstance(config, Plan):
        plan = config
    elif isinstance(config, Mapping):
        plan = Plan.from_dict(config, known=known_of(trees))
    else:
        plan = Plan.load(as_path(config), changes, known_of(trees))
    return plan.of_traces(len(trees))


def known_of(trees: Sequence[DataTree]) -> Known:
    """Properties of the apparatus according to the first trace."""
    tree = trees[0]
    traced = tomllib.loads(tree.attrs["configuration"])
    time = tree.to_dataset()["time"].values
    period = math.inf
    if "spring_force" in tree.data_vars:
        force = even_trace(tree)
        if len(force[0]) > MIN_SAMPLES:
            period = estimated_period(*force, noise_level(force[1]))
    return Known(
        _number(traced, "drive", "velocity", "m/s"),
        _number(traced, "slider", "stiffness", "N/m"),
        period,
        float(time[-1] - time[0]),
    )


def _number(tables: dict[str, Any], table: str, name: str, unit: str) -> float:
    """A quantity of a configuration in SI; NaN if it is missing."""
    value = tables.get(table, {}).get(name)
    return math.nan if value is None else to_si(value, unit, f"1 {unit}")
