"""What each command does, as a Python function."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.analysis import slips as catalogue
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, Problem, RunError
from mesoslip.output import files, layout
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.runner import Results, checked_workers, run_realizations
from mesoslip.simulation.stop import StopFlag
from mesoslip.theory.derived import Derived, derived_quantities

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from mesoslip.campaign.claims import Judgement
    from mesoslip.campaign.plan import Plan
    from mesoslip.campaign.runner import Sweep
    from mesoslip.campaign.store import Store

PathLike = str | os.PathLike[str]

# What ends a sweep that somebody has stopped.
INTERRUPTED = "interrupted"


def as_config(
    config: PathLike | Mapping[str, Any] | Config, overrides: Iterable[str] = ()
) -> Config:
    """A configuration from a TOML file, from an output of an earlier run, or from nested tables.

    Raises
    ------
    FileError
        If a file cannot be read.
    ConfigError
        If the configuration is wrong.
    """
    if isinstance(config, Config):
        return config
    if isinstance(config, Mapping):
        return Config.from_dict(config)
    path = Path(config)
    if path.suffix == ".nc":
        return files.configuration(path, overrides)
    return Config.load(path, overrides)


def run(
    config: PathLike | Mapping[str, Any] | Config,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> xr.DataTree:
    """Simulate.

    Parameters
    ----------
    config
        A TOML file, an output to run again, nested tables, or a `Config`.
    workers
        Realizations at the same time; as many as there are processors by default. The result does
        not depend on it.
    scheduler
        Address of a Dask scheduler, whose workers are to run the realizations.
    progress
        Called now and then with the part of the work that is done, 0 to 1.

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
    results = simulate(as_config(config), workers=workers, scheduler=scheduler, progress=progress)
    return layout.build_tree(results)


def simulate(
    config: Config,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Simulate; what came out as tables, to build a tree of or to write to a file.

    See `run`, and `mesoslip.simulation.runner.run_realizations`.
    """
    if scheduler is not None:
        from mesoslip.campaign.cluster import connected
        from mesoslip.campaign.ensemble import run_on_cluster

        with connected(scheduler) as client:
            return run_on_cluster(
                config, client, progress=progress, stop=stop, checkpoint=checkpoint
            )
    return run_realizations(
        config, workers=workers, progress=progress, stop=stop, checkpoint=checkpoint
    )


def sweep(
    plan: PathLike | Mapping[str, Any] | Plan,
    *,
    store: PathLike | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    pool: str = "both",
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Run a configuration over a range of parameters, and measure each run.

    Parameters
    ----------
    plan
        The file of a sweep, nested tables, or a `mesoslip.campaign.plan.Plan`.
    store
        Folder where each point is kept as soon as it is done, and taken from when the sweep is
        called again; nowhere by default.
    workers
        Points at the same time; as many as there are processors by default. The result does not
        depend on it.
    scheduler
        Address of a Dask scheduler, whose workers are to compute the points.
    pool
        What points are computed on: "threads", "processes", or "both", that is threads first and
        processes in a sweep that takes long.
    progress
        Called now and then with the part of the points that are there, 0 to 1.

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
    from mesoslip.campaign.store import Store

    checked = as_plan(plan)
    kept = None if store is None else Store(Path(store))
    with kept or nullcontext():
        done = run_plan(
            checked,
            store=kept,
            workers=workers,
            scheduler=scheduler,
            pool=pool,
            progress=progress,
        )
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
    return Plan.load(plan, overrides)


def run_plan(
    plan: Plan,
    *,
    store: Store | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    pool: str = "both",
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
) -> Sweep:
    """Compute what is missing of a sweep; see `sweep` and `mesoslip.campaign.runner.run_sweep`."""
    from mesoslip.campaign import cluster, execution, runner

    count = checked_workers(workers)
    if pool not in execution.POOLS:
        raise ConfigError(
            [Problem("", "pool", f"must be one of {', '.join(execution.POOLS)}", pool)]
        )
    # Before a cluster is asked.
    _ = plan.combinations
    if scheduler is None:
        executor = execution.on_this_machine(count, pool)
        return runner.run_sweep(plan, store=store, executor=executor, progress=progress, stop=stop)
    with cluster.connected(scheduler) as client:
        executor = cluster.on_dask(client)
        return runner.run_sweep(plan, store=store, executor=executor, progress=progress, stop=stop)


def info(config: PathLike | Mapping[str, Any] | Config) -> dict[str, Derived]:
    """Derived quantities of a configuration by name, see `mesoslip.theory.derived`."""
    return derived_quantities(as_config(config))


def curve(config: PathLike | Mapping[str, Any] | Config) -> xr.DataTree:
    """The force curve of the master equation, and its instability.

    Returns
    -------
    xarray.DataTree
        See `mesoslip.ForceCurve.to_tree`; attributes such as ``K_star``, ``X_c``, ``D0`` in SI.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.
    """
    from mesoslip.theory.force_curve import ForceCurve

    return ForceCurve(as_config(config)).to_tree()


def onset(config: PathLike | Mapping[str, Any] | Config) -> xr.DataTree:
    """The onset of slip by Eqs. S46 and S47, see `mesoslip.theory.slip_onset.onset_of_slip`.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong, or its slider has no onset of slip.
    RunError
        If an integration fails.
    """
    from mesoslip.theory.slip_onset import onset_of_slip

    return onset_of_slip(as_config(config))


def read(path: PathLike) -> xr.DataTree:
    """Read an output into memory.

    Raises
    ------
    FileError
        If there is no such file, or it is no output of mesoslip, or it is damaged.
    """
    return files.read(Path(path))


def _as_tree(output: PathLike | xr.DataTree) -> xr.DataTree:
    return files.read_run(Path(output)) if isinstance(output, str | os.PathLike) else output


def group(output: PathLike | xr.DataTree, name: str) -> xr.Dataset:
    """A group of an output alone, such as "slip_traces".

    Without the coordinates of the root that it does not use, so that its ``to_dataframe`` has a row
    for each of its rows, not for each pair of them and a time of the trace.

    Raises
    ------
    FileError
        If the output cannot be read or has no such group.
    """
    tree = files.read(Path(output)) if isinstance(output, str | os.PathLike) else output
    if name not in tree.children:
        there = ", ".join(tree.children) or "none"
        raise FileError(f"the output has no group {name!r}; it has {there}")
    return layout.group_of(tree, name)


def slips(output: PathLike | xr.DataTree) -> xr.Dataset:
    """The catalogue of slips of an output, dimension ``slip``."""
    return catalogue.slips(_as_tree(output))


def regime(output: PathLike | xr.DataTree) -> xr.Dataset:
    """Which motion each realization of an output shows: smooth, stick-slip, irregular, transient.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``; ``regime`` is 0 smooth, 1 stick-slip, 2 irregular, 3 transient,
        beside the numbers by which it is judged, see `mesoslip.analysis.regime`.

    Raises
    ------
    FileError
        If the output cannot be read or is not of a run.
    """
    from mesoslip.analysis.regime import regimes

    if isinstance(output, str | os.PathLike):
        with files.opened_run(Path(output)) as tree:
            return regimes(tree)
    return regimes(output)


def avalanches(
    output: PathLike | xr.DataTree, *, after: float = 0.0, force_above: float | None = None
) -> xr.Dataset:
    """The catalogue of avalanches of an output, dimension ``avalanche``.

    See `mesoslip.avalanche_summary` for their statistics, and for fits and histograms of sizes
    `mesoslip.analysis.avalanche_statistics`.

    Parameters
    ----------
    output
        Output of a run.
    after
        Only those that start after this time [s].
    force_above
        Only those before the greatest contact force, at more than this part of it.

    Raises
    ------
    FileError
        If the output cannot be read or has no avalanches.
    """
    from mesoslip.analysis import avalanches as avalanche_catalogue

    return avalanche_catalogue.avalanches(_as_tree(output), after=after, force_above=force_above)


def avalanche_summary(
    output: PathLike | xr.DataTree,
    *,
    after: float = 0.0,
    force_above: float | None = None,
    smallest: int | None = None,
) -> dict[str, float | None]:
    """Statistics of the avalanches of an output, in SI, by the names that ``mesoslip avalanches``
    explains.

    Parameters
    ----------
    output, after, force_above
        See `avalanches`.
    smallest
        Least size that a power law is fitted to; chosen by default.
    """
    from mesoslip.analysis import avalanches as avalanche_catalogue

    return avalanche_catalogue.statistics(
        _as_tree(output), after=after, force_above=force_above, smallest=smallest
    )


def _several(
    output: PathLike | xr.DataTree | Iterable[PathLike | xr.DataTree],
) -> list[PathLike | xr.DataTree]:
    import xarray as xr

    if isinstance(output, str | os.PathLike | xr.DataTree):
        return [output]
    return list(output)


def response(
    output: PathLike | xr.DataTree | Iterable[PathLike | xr.DataTree],
    *,
    normal_force: float | None = None,
    fit: bool = True,
    free_stiffness: bool = False,
) -> xr.DataTree:
    """What those who measure friction read off an output, or several: see ``docs/response.md``.

    Parameters
    ----------
    output
        Output of a run, or several of them.
    normal_force
        If it is given [N], forces are told over it too, as coefficients of friction; else over the
        static force.
    fit
        Whether rate-and-state parameters are fitted, which takes some seconds.
    free_stiffness
        Whether the stiffness is fitted along with them, and not that of the run.

    Returns
    -------
    xarray.DataTree
        Groups ``steady``: the mean force of each stage at one velocity, with its error; ``steps``:
        direct and evolving change and relaxation displacement of each velocity step; ``holds``:
        relaxation, restart peak and healing of each hold; ``rate_and_state``: a, b, D_c of each
        law, and whether it describes the output. Variables have units and long names.

    Raises
    ------
    FileError
        If an output cannot be read, is none of a run, or is driven by a force.
    """
    from mesoslip.analysis import response as responses
    from mesoslip.analysis.experiment import Experiment

    experiments = [
        Experiment(
            _as_tree(one),
            os.fspath(one) if isinstance(one, str | os.PathLike) else f"output {number}",
        )
        for number, one in enumerate(_several(output))
    ]
    return responses.response(
        experiments, normal_force=normal_force, with_fit=fit, free_stiffness=free_stiffness
    )


def plot(
    output: PathLike | xr.DataTree,
    file: PathLike | None = None,
    *,
    view: str | None = None,
    snapshot: int | None = None,
    figure: Figure | SubFigure | None = None,
    ax: Axes | None = None,
) -> Figure | SubFigure:
    """Draw an output of any command.

    Of a run: spring force with one slip in an inset, velocity, detached contacts; of a slider
    without inertia: force and avalanches; of a force curve: the force and its slope; of an onset of
    slip: the drop of the spring force.

    Parameters
    ----------
    output
        The output.
    file
        Where to save the picture; nowhere by default. If its name ends in ``.gif`` it is an
        animation of the lattice: of the avalanche that spreads before a snapshot, or of all
        snapshots.
    view
        Another picture of a run: "avalanches" for their sizes, "lattice" for a snapshot, "response"
        for steady forces, velocity steps and holds.
    snapshot
        Number of the snapshot; that after the largest avalanche by default.
    figure
        Figure, or part of one, to draw into; a new one by default.
    ax
        Axes for the panel that tells most, and for nothing else.

    Returns
    -------
    matplotlib.figure.Figure
        What was drawn, or drawn into.

    Raises
    ------
    FileError
        If the output cannot be read or does not have what is to be drawn, or the picture cannot be
        written.
    ConfigError
        If there is no such view.
    """
    from mesoslip.plots import avalanches as avalanche_plots
    from mesoslip.plots.draw import draw
    from mesoslip.plots.style import save

    if isinstance(output, str | os.PathLike):
        with files.opened(Path(output)) as tree:
            return plot(tree, file, view=view, snapshot=snapshot, figure=figure, ax=ax)
    path = None if file is None else Path(file)
    if path is not None and path.suffix == ".gif":
        if view not in {None, "lattice"}:
            raise FileError(f"{path}: only the lattice can be shown in motion, not {view!r}")
        return avalanche_plots.animate(output, path, snapshot)
    drawn = draw(output, view, snapshot, figure=figure, axes=ax)
    if path is not None:
        save(drawn, path)
    return drawn


def figures(
    names: Iterable[str] = (), *, outputs: PathLike = "out", folder: PathLike = "out/figures"
) -> list[Path]:
    """Draw figures of the source, all by default, from the outputs of their runs.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    FileError
        If an output is missing or a figure cannot be written.
    ConfigError
        If there is no figure of a name.
    """
    from mesoslip.plots import source_figures

    return source_figures.draw(names, Path(outputs), Path(folder))


def claims(names: Iterable[str] = (), *, outputs: PathLike = "out") -> list[Judgement]:
    """Judge claims of the source, all by default, from the outputs of their runs.

    Returns
    -------
    list of mesoslip.campaign.claims.Judgement
        Each with its claim, what was measured, and the verdict.

    Raises
    ------
    FileError
        If an output is missing.
    ConfigError
        If there is no claim of a name.
    """
    from mesoslip.campaign.claims import judge

    return judge(names, Path(outputs))
