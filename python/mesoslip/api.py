"""What each command does, as a Python function."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

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
    from mesoslip.inference import plan as fit_plans

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
        Address of a Dask scheduler, or its ``--scheduler-file``, whose workers are to run the
        realizations.
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
        Address of a Dask scheduler, or its ``--scheduler-file``, whose workers are to compute the
        points.
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


def read_trace(
    file: PathLike,
    *,
    columns: str | None = None,
    rate: float | None = None,
    largest_gap: float | None = None,
    drive_velocity: float | None = None,
    stiffness: float | None = None,
    config: PathLike | Mapping[str, Any] | Config | None = None,
    noise: float | None = None,
    period: float | None = None,
) -> xr.DataTree:
    """Read a measured trace from a table: an output like that of a run, with the slips found in it.

    Parameters
    ----------
    file
        Columns with units in their headers, such as ``time [s]``, ``force [uN]``,
        ``displacement [nm]``.
    columns
        Headers in the place of those of the file, such as "time [s], force [uN], -".
    rate
        Samples in a second [1/s], if there are no times.
    largest_gap
        Longest time without values [s] that is filled by straight lines; none by default.
    drive_velocity, stiffness
        Velocity of the drive [m/s] and spring constant [N/m], if they are known.
    config
        Configuration of the experiment, which tells drive and spring, and lets every command work
        on the output.
    noise
        Standard deviation of the noise of the force [N]; estimated by default.
    period
        Period of the setup [s]; by default that of the configuration, or estimated.

    Raises
    ------
    FileError
        If the table cannot be read or is wrong; the message tells the line.
    ConfigError
        If the configuration is wrong.
    """
    from mesoslip.measured import trace

    return trace.read_trace(
        Path(file),
        columns=columns,
        rate=rate,
        largest_gap=largest_gap,
        drive_velocity=drive_velocity,
        stiffness=stiffness,
        config=None if config is None else as_config(config),
        noise=noise,
        period=period,
    )


def fit(
    output: PathLike | xr.DataTree,
    config: PathLike | Mapping[str, Any] | fit_plans.Plan,
    *,
    store: PathLike | None = None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
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
        File in which simulations are kept until the fit is done, and from which it goes on when it
        is called again; nowhere by default.
    workers
        Simulations at the same time; as many as there are processors by default. The result does
        not depend on it.
    progress
        Called now and then with the part of the simulations that is done.
    stop
        Set by who wants the fit to stop, which raises
        `mesoslip.inference.simulations.StoppedError`.

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
        plan = Plan.load(config)
    fitted = fits.fit(
        _as_tree(output),
        plan,
        store=None if store is None else Path(store),
        workers=workers,
        progress=progress,
        stop=stop,
    )
    return build_tree(fitted)


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
            return regimes(tree, os.fspath(output))
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
    output: PathLike | xr.DataTree | Sequence[PathLike | xr.DataTree],
) -> Sequence[PathLike | xr.DataTree]:
    """Outputs, of which there may be one."""
    is_one = isinstance(output, str | os.PathLike) or not isinstance(output, Sequence)
    return cast("Sequence[PathLike | xr.DataTree]", [output] if is_one else output)


def _opened(
    outputs: Sequence[PathLike | xr.DataTree], stack: ExitStack
) -> tuple[list[xr.DataTree], list[str]]:
    """Outputs, of which only what is used is read, and what they are called."""
    trees, names = [], []
    for number, one in enumerate(outputs):
        if isinstance(one, str | os.PathLike):
            names.append(str(one))
            trees.append(stack.enter_context(files.opened(Path(one))))
        else:
            names.append(one.attrs.get("title", f"output {number}"))
            trees.append(one)
    return trees, names


def response(
    output: PathLike | xr.DataTree | Sequence[PathLike | xr.DataTree],
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
    output: PathLike | xr.DataTree | Sequence[PathLike | xr.DataTree],
    file: PathLike | None = None,
    *,
    view: str | None = None,
    snapshot: int | None = None,
    realization: int | None = None,
    start: float = -math.inf,
    end: float = math.inf,
    x: str | None = None,
    figure: Figure | SubFigure | None = None,
    ax: Axes | None = None,
) -> Figure | SubFigure:
    """Draw an output of any command, or several of one command over each other.

    Of a run: force, velocity and detached contacts, with the largest slip beside them; of a slider
    without inertia: force and avalanches; of a force curve: the force and its slope; of an onset of
    slip: the drop of the spring force. The title has what the run changes of what it is based on,
    the legend of several outputs how they differ.

    Parameters
    ----------
    output
        The output, or several.
    file
        Where to save the picture; nowhere by default. If its name ends in ``.gif`` it is an
        animation of the lattice: of the avalanche that spreads before a snapshot, or of all
        snapshots.
    view
        Another picture of a run: "avalanches" for their sizes, "lattice" for a snapshot, "layers"
        for the waves in an elastic slider, "response" for steady forces, velocity steps and holds.
    snapshot
        Number of the snapshot; that after the largest avalanche by default.
    realization
        Number of the realization of a run; by default the first one, with others behind it.
    start, end
        Times of a run [s] between which it is drawn.
    x
        What a run is drawn against: "time", "displacement", or "drive" for the displacement of the
        drive; by default the time, of a slider without inertia its displacement.
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
        If an output cannot be read or does not have what is to be drawn, or the picture cannot be
        written.
    ConfigError
        If there is no such view, or nothing to draw it against.
    """
    from mesoslip.plots import avalanches as avalanche_plots
    from mesoslip.plots.draw import draw
    from mesoslip.plots.run import Extent
    from mesoslip.plots.style import save

    outputs = _several(output)
    if not outputs:
        raise FileError("there is no output to draw")
    extent = Extent(realization, start, end, x)
    path = None if file is None else Path(file)
    is_moving = path is not None and path.suffix == ".gif"
    if is_moving and (view not in {None, "lattice"} or len(outputs) > 1):
        what = "of one output" if len(outputs) > 1 else f"not {view!r}"
        raise FileError(f"{path}: only the lattice can be shown in motion, {what}")
    with ExitStack() as stack:
        trees, names = _opened(outputs, stack)
        if path is not None and is_moving:
            return avalanche_plots.animate(trees[0], path, snapshot)
        drawn = draw(trees, names, view, snapshot, extent=extent, figure=figure, axes=ax)
        if path is not None:
            save(drawn, path)
    return drawn


def report(
    output: PathLike | xr.DataTree | Sequence[PathLike | xr.DataTree], file: PathLike
) -> None:
    """Write a page about an output of any command, or about several of one command side by side.

    What differs, pictures, slips or avalanches with their distributions, the balance of energy,
    the configuration, and where it comes from. The page needs nothing else: no network, no scripts.

    Parameters
    ----------
    output
        The output, or several.
    file
        The page (HTML).

    Raises
    ------
    FileError
        If an output cannot be read, outputs are of different commands, or the page cannot be
        written.
    """
    from mesoslip.reports.content import Subject
    from mesoslip.reports.page import write

    with ExitStack() as stack:
        outputs = _several(output)
        trees, names = _opened(outputs, stack)
        stems = [
            Path(name).stem if isinstance(one, str | os.PathLike) else name
            for name, one in zip(names, outputs, strict=True)
        ]
        numbered = [f"{name} ({number})" for number, name in enumerate(names, 1)]
        # The shortest by which they can be told apart.
        short = next(one for one in (stems, names, numbered) if len(set(one)) == len(one))
        write([Subject(*one) for one in zip(short, trees, strict=True)], Path(file))


def example(name: str, file: PathLike | None = None) -> list[Path]:
    """Write a run that comes with the program, and beside it what it is based on.

    See `mesoslip.examples.examples` for those that there are.

    Parameters
    ----------
    name
        Such as "klein".
    file
        Where to write it; a file of that name with the ending ``.toml`` here by default.

    Returns
    -------
    list of pathlib.Path
        The files that were written; what it is based on is not if it is there already.

    Raises
    ------
    ConfigError
        If there is no such run.
    FileError
        If there is a file of the name already, or it cannot be written.
    """
    from mesoslip import examples

    return examples.example(name, Path(file or f"{Path(name).name}{examples.ENDING}"))


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
