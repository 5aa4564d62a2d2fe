"""Measures: the numbers that a sweep keeps of each run.

Adding one is adding a function of a `RunView` and a line in `MEASURES`. Users add
functions of the tree of a run as "file.py:function" in the file of the sweep; the attributes
``units`` and ``long_name`` of a function, if it has them, go into the dataset.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.lyapunov import lyapunov
from mesoslip.analysis.regime import NAMES, REGIME, regimes
from mesoslip.analysis.return_map import map_exponent
from mesoslip.campaign import predictions
from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.output.access import config_of
from mesoslip.output.variables import LYAPUNOV

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunView:
    """A run of one realization, and the time from which it is measured.

    Attributes
    ----------
    tree
        As `mesoslip.run` returns it.
    start
        Time from which measures count [s].
    """

    tree: xr.DataTree
    start: float

    def trace(self, name: str) -> Array:
        """A trace after the start of the measures."""
        root = self.tree.to_dataset()
        wanted = root["time"].values >= self.start
        values: Array = root[name].values[0, wanted]
        return values[np.isfinite(values)]

    @cached_property
    def regime(self) -> dict[str, float]:
        """The regime and the statistics that determine it."""
        data = regimes(self.tree)
        return {name: float(data[name].values[0]) for name in REGIME}

    @cached_property
    def exponent(self) -> xr.DataTree:
        """Its largest Lyapunov exponent, from twins of another run of the configuration."""
        number = int(self.tree.to_dataset()["realization"].values[0])
        return lyapunov(config_of(self.tree), realization=number, executor=1)

    def total(self, name: str) -> float:
        """A scalar of the whole run."""
        return float(self.tree.to_dataset()[name].values[0])

    def catalogue(self, group: str, name: str) -> Array:
        """A column of a catalogue, of entries that begin after the start of the measures."""
        if group not in self.tree.children:
            return np.empty(0)
        rows = self.tree.children[group].to_dataset()
        wanted = rows["start_time"].values >= self.start
        values: Array = rows[name].values[wanted].astype(np.float64)
        return values


Function = Callable[[RunView], float]


@dataclass(frozen=True)
class Measure:
    """A measure.

    Attributes
    ----------
    name
        Name of its variable in the dataset.
    function
        The function that computes it.
    units, long_name
        Attributes by the CF conventions.
    flags
        Meanings of the values 0, 1, 2, ... if it is a category.
    source
        Text of the user's file; empty for measures of mesoslip. Other processes and machines
        compile the function from it.
    path
        Name of the user's file.
    runs_again
        Whether it is measured in another run of the configuration.
    """

    name: str
    function: Function
    units: str
    long_name: str
    flags: tuple[str, ...] = ()
    source: str = ""
    path: str = ""
    runs_again: bool = False

    @property
    def identity(self) -> str:
        """Its part in the hash under which a point is stored."""
        if not self.source:
            return self.name
        return f"{self.name}:{hashlib.sha256(self.source.encode()).hexdigest()}"

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of its variable."""
        attributes: dict[str, Any] = {"long_name": self.long_name}
        if self.flags:
            attributes["flag_values"] = np.arange(len(self.flags), dtype=np.int8)
            attributes["flag_meanings"] = " ".join(self.flags)
        else:
            attributes["units"] = self.units
        return attributes


def _mean(values: Array) -> float:
    return float(np.mean(values)) if values.size else np.nan


def _mean_force(run: RunView) -> float:
    return _mean(run.trace("spring_force"))


def _max_force(run: RunView) -> float:
    """Extreme force in the direction of the drive, with its sign."""
    forces, drive = run.trace("spring_force"), run.trace("drive_displacement")
    if not forces.size:
        return np.nan
    return float(np.min(forces) if drive[-1] < drive[0] else np.max(forces))


def _force_amplitude(run: RunView) -> float:
    forces = run.trace("spring_force")
    return float(np.ptp(forces) / 2) if forces.size else np.nan


def _mean_waiting_time(run: RunView) -> float:
    starts = run.catalogue("slips", "start_time")
    return _mean(np.diff(starts))


def _mean_slip_duration(run: RunView) -> float:
    return _mean(run.catalogue("slips", "end_time") - run.catalogue("slips", "start_time"))


def _slip_count(run: RunView) -> float:
    return float(run.catalogue("slips", "start_time").size)


def _peak_velocity(run: RunView) -> float:
    velocities = run.catalogue("slips", "peak_velocity")
    return float(np.max(np.abs(velocities))) if velocities.size else np.nan


def _peak_variation(run: RunView) -> float:
    """Coefficient of variation of the force at the starts of slips."""
    peaks = run.catalogue("slips", "force_before")
    return float(np.std(peaks) / abs(np.mean(peaks))) if peaks.size > 1 else np.nan


def _map_exponent(run: RunView) -> float:
    return map_exponent(run.catalogue("slips", "force_before"))


def _lyapunov(name: str) -> Function:
    """The largest Lyapunov exponent or its error."""
    return lambda run: float(run.exponent[name])


def _smooth_time_share(run: RunView) -> float:
    """Fraction of steps in which the slider moves between 1/2 and 2 times as far as the drive."""
    displacement, drive = (
        np.diff(run.trace(name)) for name in ("displacement", "drive_displacement")
    )
    moves = drive != 0
    if not np.any(moves):
        return np.nan
    ratio = displacement[moves] / drive[moves]
    return float(np.mean((ratio > 0.5) & (ratio < 2.0)))


def _breaks(run: RunView) -> float:
    return run.total("breaks")


def _energy_residual(run: RunView) -> float:
    return run.total("energy_residual")


def _avalanche_count(run: RunView) -> float:
    return float(run.catalogue("avalanches", "size").size)


def _mean_avalanche_size(run: RunView) -> float:
    return _mean(run.catalogue("avalanches", "size"))


def _max_avalanche_size(run: RunView) -> float:
    sizes = run.catalogue("avalanches", "size")
    return float(np.max(sizes)) if sizes.size else np.nan


def _mean_slip(name: str) -> Function:
    """The mean of a column of the catalogue of slips."""
    return lambda run: _mean(run.catalogue("slips", name))


def _regime(name: str) -> Function:
    """A statistic of the regime, in the evaluated window of the regime."""
    return lambda run: run.regime[name]


def _predicted(function: Callable[[xr.DataTree], float]) -> Function:
    """A theoretical prediction for the configuration of a run."""
    return lambda run: function(run.tree)


MEASURES: dict[str, Measure] = {
    one.name: one
    for one in (
        Measure("mean_force", _mean_force, "N", "mean spring force"),
        Measure(
            "max_force", _max_force, "N", "maximum spring force, in the direction of the drive"
        ),
        Measure("force_amplitude", _force_amplitude, "N", "half the range of the spring force"),
        Measure(
            "mean_peak_force",
            _mean_slip("force_before"),
            "N",
            "mean spring force at the start of slips",
        ),
        Measure("mean_force_drop", _mean_slip("force_drop"), "N", "mean drop of the force"),
        Measure("mean_waiting_time", _mean_waiting_time, "s", "mean time between starts of slips"),
        Measure("mean_slip_duration", _mean_slip_duration, "s", "mean duration of slips"),
        Measure("slip_count", _slip_count, "1", "number of slips"),
        Measure("peak_velocity", _peak_velocity, "m s-1", "maximum speed in slips"),
        Measure(
            "smooth_time_share",
            _smooth_time_share,
            "1",
            "fraction of time with a slider velocity between 1/2 and 2 times that of the drive",
        ),
        Measure(
            "peak_variation",
            _peak_variation,
            "1",
            "standard deviation of the spring force at the starts of slips, over its mean",
        ),
        Measure(
            "map_exponent",
            _map_exponent,
            "1",
            "mean logarithm of the slope of the return map of peaks",
        ),
        *(
            Measure(
                name,
                _lyapunov(name),
                LYAPUNOV[name].units,
                LYAPUNOV[name].long_name,
                runs_again=True,
            )
            for name in ("lyapunov_exponent", "lyapunov_error")
        ),
        Measure("breaks", _breaks, "1", "breaks of contacts in the whole run"),
        Measure(
            "energy_residual",
            _energy_residual,
            "1",
            "residual of the energy balance of the whole run, relative to the work of the drive",
        ),
        Measure("avalanche_count", _avalanche_count, "1", "number of avalanches"),
        Measure("mean_avalanche_size", _mean_avalanche_size, "1", "mean size of avalanches"),
        Measure("max_avalanche_size", _max_avalanche_size, "1", "size of the largest avalanche"),
        Measure(
            "growth_rate",
            _predicted(predictions.growth_rate),
            "s-1",
            "growth rate of small perturbations of steady sliding with delay, by linear theory",
        ),
        Measure(
            "stable_out_of_step",
            _predicted(predictions.stable_out_of_step),
            "1",
            "whether steady sliding is stable, including perturbations that desynchronize contacts",
        ),
        Measure(
            "critical_stiffness_ratio",
            _predicted(predictions.critical_stiffness_ratio),
            "1",
            "K* of the master equation over the stiffness of the spring",
        ),
        Measure(
            "waiting_over_damping",
            _predicted(predictions.waiting_over_damping),
            "1",
            "mean time between slips times the damping rate of the setup, tau_ss eta_S",
        ),
        *(
            Measure(
                name,
                _regime(name),
                meaning.units,
                meaning.long_name,
                flags=NAMES if name == "regime" else (),
            )
            for name, meaning in REGIME.items()
        ),
    )
}


def find_measures(names: Sequence[str], source: str, folder: Path) -> tuple[Measure, ...]:
    """The measures of the given names.

    Parameters
    ----------
    names
        Names of `MEASURES`, or "file.py:function".
    source
        Where the names are from, for messages.
    folder
        Folder to which names of files are relative.

    Raises
    ------
    ConfigError
        If there is no such measure, a file cannot be read or raises, or two have the same name.
    """
    found: list[Problem] = []
    measures: dict[str, Measure] = {}
    for number, name in enumerate(names):
        key = f"sweep.measures[{number}]"
        try:
            measure = _of_user(name, folder) if ":" in name else MEASURES.get(name)
        except RunError as error:
            found.append(Problem(source, key, str(error), name))
            continue
        if measure is None:
            near = difflib.get_close_matches(name, MEASURES, 1)
            meant = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(MEASURES)}"
            message = f"unknown measure; {meant} For a function of yours write 'file.py:function'"
            found.append(Problem(source, key, message, name))
        elif measure.name in measures:
            found.append(Problem(source, key, "is named twice", name))
        elif measure.name in {"status", "realization", "sample", "direction"}:
            found.append(Problem(source, key, "is a name that the dataset uses itself", name))
        else:
            measures[measure.name] = measure
    if found:
        raise ConfigError(found)
    return tuple(measures.values())


def _of_user(name: str, folder: Path) -> Measure:
    """A function of a user's file."""
    file, _, entry = name.rpartition(":")
    path = folder / file
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RunError(f"{path} cannot be read: {reason}") from None
    return measure_of(entry, source, str(path))


def measure_of(name: str, source: str = "", path: str = "") -> Measure:
    """A measure from its name, and the text and path of a user's file.

    Raises
    ------
    RunError
        If the file raises or has no such function.
    """
    if not source:
        return MEASURES[name]
    function = _user_function(source, path, name)
    document = (function.__doc__ or name).strip().splitlines()
    return Measure(
        name,
        lambda run: function(run.tree),
        str(getattr(function, "units", "1")),
        str(getattr(function, "long_name", document[0] if document else name)),
        source=source,
        path=path,
    )


@cache
def _user_function(source: str, path: str, entry: str) -> Callable[[xr.DataTree], Any]:
    """A function of a user's file, which is run once in each process.

    Raises
    ------
    RunError
        If the file raises or has no such function.
    """
    names: dict[str, Any] = {"__name__": Path(path).stem, "__file__": path}
    try:
        exec(compile(source, path, "exec"), names)
    except (Exception, SystemExit) as error:
        raise RunError(f"{path}{_line(error, path)}: {type(error).__name__}: {error}") from None
    function = names.get(entry)
    if not callable(function):
        there = [name for name, one in names.items() if callable(one) and not name.startswith("_")]
        near = difflib.get_close_matches(entry, there, 1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise RunError(f"{path} has no function {entry!r}{meant}")
    return function  # type: ignore[no-any-return]


def _line(error: BaseException, path: str) -> str:
    """Line of a user's file that an error comes from, as part of a message."""
    line = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == path:
            line = trace.tb_lineno
        trace = trace.tb_next
    return "" if line is None else f", line {line}"


def measured(run: RunView, measure: Measure) -> float:
    """A measure of a run.

    Raises
    ------
    RunError
        If a user's function raises or gives no number.
    """
    try:
        value = measure.function(run)
        value = value.item() if isinstance(value, np.ndarray | np.generic) else value
        value = (
            value.values.item() if hasattr(value, "values") and hasattr(value, "dims") else value
        )
    except MemoryError:
        raise
    except Exception as error:
        where = f" ({measure.path}{_line(error, measure.path)})" if measure.path else ""
        raise RunError(f"measure {measure.name}{where}: {type(error).__name__}: {error}") from error
    if not isinstance(value, Real):
        raise RunError(f"measure {measure.name}: returned {value!r:.60}, not a number")
    return float(value)
