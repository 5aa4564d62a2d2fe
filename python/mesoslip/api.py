"""What each command does, as a Python function."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.analysis import slips as catalogue
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.output import files, layout
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.runner import Results, run_realizations
from mesoslip.simulation.stop import StopFlag
from mesoslip.theory.derived import Derived, derived_quantities

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from mesoslip.inference.plan import Plan

PathLike = str | os.PathLike[str]


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
    return layout.build_tree(simulate(as_config(config), workers=workers, progress=progress))


def simulate(
    config: Config,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    stop: StopFlag | None = None,
    checkpoint: Checkpoint | None = None,
) -> Results:
    """Simulate; what came out as tables, to build a tree of or to write to a file.

    See `run`, and `mesoslip.simulation.runner.run_realizations`.
    """
    return run_realizations(
        config, workers=workers, progress=progress, stop=stop, checkpoint=checkpoint
    )


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
    config: PathLike | Mapping[str, Any] | Plan,
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
        Another picture of a run: "avalanches" for their sizes, "lattice" for a snapshot.
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
