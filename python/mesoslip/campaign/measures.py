"""Measures: the numbers that a sweep keeps of each run.

Adding one is adding a function of a `RunView` with its unit and meaning. Users add functions of the
tree of a run as "file.py:function" in the file of the sweep; the attributes ``units`` and
``long_name`` of a function, if it has them, go into the dataset.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mesoslip.analysis.fronts import FRONT_TYPES, first_front
from mesoslip.analysis.lyapunov import lyapunov
from mesoslip.analysis.regime.outputs import regimes
from mesoslip.analysis.regime.result import NAMES, REGIME
from mesoslip.analysis.return_map import map_exponent as exponent_of_map
from mesoslip.array_types import Array, DataTree
from mesoslip.campaign import predictions
from mesoslip.output.access import config_of
from mesoslip.output.variables import LYAPUNOV


@dataclass(frozen=True)
class RunView:
    """A run of one realization, and the time from which it is measured [s]."""

    tree: DataTree
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
    def front(self) -> dict[str, float]:
        """Columns of the longest front in the first event of the whole run."""
        return first_front(self.tree) if "fronts" in self.tree.children else {}

    @cached_property
    def exponent(self) -> DataTree:
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
        return rows[name].values[wanted].astype(np.float64)


Function = Callable[[RunView], float]


@dataclass(frozen=True)
class Measure:
    """A variable of the dataset of a sweep: its function, and its attributes by CF."""

    name: str
    function: Function
    units: str
    long_name: str
    flags: tuple[str, ...] = ()
    """Meanings of the values 0, 1, 2, ... of a category."""
    source: str = ""
    """Text of the user's file, from which other processes and machines compile the function."""
    path: str = ""
    """Name of the user's file."""
    runs_again: bool = False
    """Whether it is measured in another run of the configuration."""

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


MEASURES: dict[str, Measure] = {}


def measure(
    units: str, long_name: str, flags: tuple[str, ...] = ()
) -> Callable[[Function], Function]:
    """Make a function the measure of its name."""

    def add(function: Function) -> Function:
        name = function.__name__
        MEASURES[name] = Measure(name, function, units, long_name, flags)
        return function

    return add


def _mean(values: Array) -> float:
    return float(np.mean(values)) if values.size else np.nan


def _max(values: Array) -> float:
    return float(np.max(values)) if values.size else np.nan


@measure("N", "mean spring force")
def mean_force(run: RunView) -> float:
    return _mean(run.trace("spring_force"))


@measure("N", "maximum spring force, in the direction of the drive")
def max_force(run: RunView) -> float:
    forces, drive = run.trace("spring_force"), run.trace("drive_displacement")
    if not forces.size:
        return np.nan
    return float(np.min(forces) if drive[-1] < drive[0] else np.max(forces))


@measure("N", "half the range of the spring force")
def force_amplitude(run: RunView) -> float:
    forces = run.trace("spring_force")
    return float(np.ptp(forces) / 2) if forces.size else np.nan


@measure("N", "mean spring force at the start of slips, along their motion")
def mean_peak_force(run: RunView) -> float:
    before = run.catalogue("slips", "force_before")
    return _mean(np.where(run.catalogue("slips", "force_drop") < 0, -before, before))


@measure("N", "mean drop of the force, along the motion")
def mean_force_drop(run: RunView) -> float:
    return _mean(np.abs(run.catalogue("slips", "force_drop")))


@measure("s", "mean time between starts of slips")
def mean_waiting_time(run: RunView) -> float:
    is_back = run.catalogue("slips", "force_drop") < 0
    return _mean(np.diff(run.catalogue("slips", "start_time"))[is_back[1:] == is_back[:-1]])


@measure("s", "mean duration of slips")
def mean_slip_duration(run: RunView) -> float:
    return _mean(run.catalogue("slips", "end_time") - run.catalogue("slips", "start_time"))


@measure("1", "number of slips")
def slip_count(run: RunView) -> float:
    return float(run.catalogue("slips", "start_time").size)


@measure("m s-1", "maximum speed in slips")
def peak_velocity(run: RunView) -> float:
    return _max(np.abs(run.catalogue("slips", "peak_velocity")))


@measure("1", "fraction of time with a slider velocity between 1/2 and 2 times that of the drive")
def smooth_time_share(run: RunView) -> float:
    displacement, drive = (
        np.diff(run.trace(name)) for name in ("displacement", "drive_displacement")
    )
    moves = drive != 0
    if not np.any(moves):
        return np.nan
    ratio = displacement[moves] / drive[moves]
    return float(np.mean((ratio > 0.5) & (ratio < 2.0)))


@measure("1", "standard deviation of the spring force at the starts of slips, over its mean")
def peak_variation(run: RunView) -> float:
    peaks = run.catalogue("slips", "force_before")
    return float(np.std(peaks) / abs(np.mean(peaks))) if peaks.size > 1 else np.nan


@measure("1", "mean logarithm of the slope of the return map of peaks")
def map_exponent(run: RunView) -> float:
    return exponent_of_map(run.catalogue("slips", "force_before"))


def _lyapunov(name: str) -> Measure:
    units, long_name = LYAPUNOV[name].units, LYAPUNOV[name].long_name
    return Measure(name, lambda run: float(run.exponent[name]), units, long_name, runs_again=True)


def _regime(name: str) -> Measure:
    """A statistic of the regime, in the evaluated window of the regime."""
    units, long_name = REGIME[name].units, REGIME[name].long_name
    flags = NAMES if name == "regime" else ()
    return Measure(name, lambda run: run.regime[name], units, long_name, flags)


MEASURES |= {name: _lyapunov(name) for name in ("lyapunov_exponent", "lyapunov_error")}


@measure("1", "breaks of contacts in the whole run")
def breaks(run: RunView) -> float:
    return run.total("breaks")


@measure("1", "residual of the energy balance of the whole run, relative to the work of the drive")
def energy_residual(run: RunView) -> float:
    return run.total("energy_residual")


@measure("1", "number of avalanches")
def avalanche_count(run: RunView) -> float:
    return float(run.catalogue("avalanches", "size").size)


@measure("1", "mean size of avalanches")
def mean_avalanche_size(run: RunView) -> float:
    return _mean(run.catalogue("avalanches", "size"))


@measure("1", "size of the largest avalanche")
def max_avalanche_size(run: RunView) -> float:
    return _max(run.catalogue("avalanches", "size"))


@measure("1", "type of the longest front in the first event of the whole run", FRONT_TYPES)
def front_type(run: RunView) -> float:
    return run.front.get("front_type", np.nan)


@measure("1", "speed of the longest front in the first event of the whole run, over that of sound")
def front_speed_ratio(run: RunView) -> float:
    return run.front.get("speed_ratio", np.nan)


@measure("1", "stress over strength ahead of the first front from the edge, in static balance")
def front_prestress(run: RunView) -> float:
    return predictions.front_prestress(run.tree)


@measure("1", "speed of a steady front under that prestress, over that of sound, by theory")
def steady_front_speed_ratio(run: RunView) -> float:
    return predictions.steady_front_speed_ratio(run.tree)


@measure("s-1", "growth rate of small perturbations of steady sliding with delay, by linear theory")
def growth_rate(run: RunView) -> float:
    return predictions.growth_rate(run.tree)


@measure(
    "1", "whether steady sliding is stable, including perturbations that desynchronize contacts"
)
def stable_dephased(run: RunView) -> float:
    return predictions.stable_dephased(run.tree)


@measure("1", "K* of the master equation over the stiffness of the spring")
def critical_stiffness_ratio(run: RunView) -> float:
    return predictions.critical_stiffness_ratio(run.tree)


@measure("1", "mean time between slips times the damping rate of the setup, tau_ss eta_S")
def waiting_over_damping(run: RunView) -> float:
    return predictions.waiting_over_damping(run.tree)


MEASURES |= {name: _regime(name) for name in REGIME}
