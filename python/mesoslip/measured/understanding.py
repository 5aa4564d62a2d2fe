"""The interpretation of a file of a measurement, before anything is computed from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from mesoslip.analysis.noise import TraceNoise, estimate_noise
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, Problem
from mesoslip.measured.description import (
    Experiment,
    TraceDescription,
    config_of_file,
    describe,
    option_name,
)
from mesoslip.measured.measured_record import Record, read_record, resolve
from mesoslip.measured.sampling import MAX_RATES
from mesoslip.output.inputs import ConfigLike, distinct
from mesoslip.quantities import with_unit


@dataclass(frozen=True)
class Understood:
    """The interpretation of a file, before anything is computed from it."""

    record: Record
    experiment: Experiment
    """The description, with the columns that were found in the file."""
    config: Config | None
    """Configuration of a model."""
    stiffness: float | None
    """Spring constant, in the unit of the force over metre."""
    paths: list[Path]

    @cached_property
    def noise(self) -> TraceNoise | float:
        """The noise of the force: estimated, or its given standard deviation."""
        given = self.experiment.trace.si("noise")
        if given is not None:
            return given
        time, hum = self.record.time, self.experiment.trace.si("hum")
        highest = 0.5 / float(np.median(np.diff(time))) if time.size > 1 else math.inf
        if hum is not None and hum >= highest:
            message = f"must be below half of the sampling rate, {with_unit(highest, 'Hz', 4)}"
            raise ConfigError.of("hum", message, hum)
        return estimate_noise(time, self.record.force, hum=hum)

    @property
    def report(self) -> list[str]:
        """Lines about the interpretation and the noise."""
        return [*self.record.report, *self._noise_lines(math.inf)]

    @property
    def summary(self) -> list[str]:
        """The same, short where samples are uneven."""
        return [*self.record.summary, *self._noise_lines(MAX_RATES)]

    def _noise_lines(self, max_rates: float) -> list[str]:
        """Lines about the noise, with that at each rate up to a maximum number of rates."""
        if not isinstance(self.noise, TraceNoise):
            return []
        unit = "1" if self.record.is_friction else "N"
        return [f"noise: {one}" for one in self.noise.sentences(unit, max_rates)]


def understand(
    file: PathLike | Sequence[PathLike],
    /,
    *,
    config: ConfigLike | None = None,
    **options: str | float | None,
) -> Understood:
    """Read the file of a measurement, with keys of the table [trace]; see `read_trace`."""
    files = [file] if isinstance(file, str | Path) or not isinstance(file, Sequence) else file
    if not files:
        raise ConfigError.of("file", "expected at least one file of a measurement", [])
    experiment, paths, beside = describe([as_path(one) for one in files], options)
    model = beside if config is None else config_of_file(config)
    trace = experiment.trace
    if model is not None:
        given = [name for name in ("velocity", "stiffness") if options.get(name) is not None]
        if given:
            message = "is given in the configuration; change it there"
            raise ConfigError([Problem("", option_name(name), message) for name in given])
    record = read_record(distinct(paths), trace)
    stiffness = _stiffness(record, trace) if model is None else model.spring_stiffness
    _check_units(record, trace, model)
    resolved = experiment.model_copy(update={"trace": resolve(trace, record)})
    return Understood(record, resolved, model, stiffness, paths)


def _stiffness(record: Record, trace: TraceDescription) -> float | None:
    """The spring constant in the unit of the force over metre."""
    stiffness, normal = trace.si("stiffness"), record.mean_normal_force
    if stiffness is None or not trace.is_in("stiffness", "N/m" if record.is_friction else "1/m"):
        return stiffness
    if record.is_friction:
        message = (
            "is for forces, and the file has friction coefficients: give the normal force too, or "
            "the stiffness over the normal force, such as '1.6e-3 1/um'"
        )
        raise ConfigError.of("--stiffness", message, trace.stiffness)
    if normal is None:
        message = "is for friction coefficients, and the file has forces: expected '1002 N/m'"
        raise ConfigError.of("--stiffness", message, trace.stiffness)
    return stiffness * normal


def _check_units(record: Record, trace: TraceDescription, model: Config | None) -> None:
    """Check that noise, minimum fall and model suit a force or a friction coefficient."""
    for name in ("noise", "min_fall"):
        if record.is_friction and trace.is_in(name, "N"):
            message = "the file has friction coefficients: expected a number such as 0.001"
            raise ConfigError.of(option_name(name), message, getattr(trace, name))
    if record.is_friction and model is not None:
        message = "is for forces, and the file has friction coefficients: give --normal-force too"
        raise ConfigError.of("--config", message)
