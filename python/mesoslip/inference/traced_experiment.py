"""A measured trace, its apparatus, and simulations with the same sampling and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import first_velocity
from mesoslip.analysis.even_traces import INTERVAL_TOLERANCE
from mesoslip.analysis.sampled_slips import estimated_period
from mesoslip.analysis.strokes.segments import Piece, monotone_pieces
from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, RunError
from mesoslip.execution.stop import StoppedError, StopRequest
from mesoslip.inference.apparatus import Apparatus, Instrument, declared_values, own_config
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.noise import Noise, cleaned
from mesoslip.inference.prior import WANDER, level_name
from mesoslip.inference.run_in import run_in_samples
from mesoslip.inference.summaries import Summarizer
from mesoslip.inference.wander import measured_length, wandering
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import TRACE_COLUMNS

# Seeds of random numbers.
Words = NDArray[np.unsignedinteger[Any]]

# Minimum noise over the maximum force. Noise is added to traces with less, as experiments do not
# resolve smaller differences.
MIN_NOISE = 5e-4
# Minimum number of samples of a trace.
MIN_SAMPLES = 200
# Minimum number of samples in a period of the setup after averaging.
SAMPLES_PER_PERIOD = 24
# Minimum initial force, over the maximum force, of a trace that does not begin with the first
# loading.
LOADED = 0.1
# Maximum number of breaks in a simulation, far more than a trace can have.
MAX_BREAKS = 3e7


@dataclass(frozen=True)
class Sampling:
    """Sampling of a trace, from the start of the drive."""

    times: Array
    """Times of the samples [s], increasing from 0."""
    start: float = 0.0
    """Time from which samples are used [s]."""
    block: int = 1
    """Number of samples in a mean."""

    @cached_property
    def interval(self) -> float:
        """Median distance of samples [s]."""
        return float(np.median(np.diff(self.times)))

    @cached_property
    def is_even(self) -> bool:
        """Whether samples have equal distances."""
        steps = np.diff(self.times)
        return bool(np.all(np.abs(steps - self.interval) <= INTERVAL_TOLERANCE * self.interval))

    @cached_property
    def _even(self) -> Array:
        """Times at equal distances [s]."""
        if self.is_even:
            return self.times
        count = math.floor(self.times[-1] / self.interval) + 1
        return np.asarray(self.interval * np.arange(count))

    @cached_property
    def _skipped(self) -> int:
        return round(self.start / self.interval)

    @cached_property
    def time(self) -> Array:
        """Times of the used samples, from the first one [s]."""
        even = self._even[self._skipped :]
        count = len(even) // self.block
        return np.asarray(even[: count * self.block : self.block] - even[0]) if count else even[:0]

    def reduced(self, force: Array) -> Array:
        """Means of samples from the start on, at equal distances by linear interpolation."""
        if not self.is_even:
            force = np.interp(self._even, self.times, force)
        kept = force[self._skipped :]
        count = len(kept) // self.block
        if self.block == 1:
            return kept
        mean: Array = kept[: count * self.block].reshape(count, self.block).mean(axis=1)
        return mean

    def sampled(self, force: Array) -> Array:
        """Samples at the times of this sampling, from a simulated trace at equal distances."""
        if self.is_even:
            return force[: len(self.times)]
        return np.interp(self.times, self.interval * np.arange(len(force)), force)

    @property
    def simulated_count(self) -> int:
        """Number of samples of a simulated trace."""
        return len(self.times) if self.is_even else math.ceil(self.times[-1] / self.interval) + 1


@dataclass(frozen=True)
class Experiment:
    """An apparatus with a measured trace."""

    name: str
    config: Config
    """The known parameters of this apparatus."""
    sampling: Sampling
    noise: Noise
    summarizer: Summarizer
    wander_length: float
    """Correlation length of the strength along the track [m]."""
    force: Array
    """The measured force [N], corrected and reduced by the sampling."""
    apparatus: Apparatus
    instrument: Instrument
    corrections: tuple[str, ...] = ()
    """Corrections of the trace, a sentence each."""
    needs_run_in: bool = False
    """Whether the trace begins in the middle of an experiment, so that a simulation runs in first.
    """

    def simulated(
        self,
        changes: dict[str, Any],
        nuisances: dict[str, float],
        words: Words,
        stop: StopRequest,
    ) -> Array | None:
        """A noisy trace of the force [N] as `force`, by values of free keys, ``nuisances``, and
        three ``words`` for the random numbers."""
        count = self.sampling.simulated_count
        try:
            own = self.apparatus.values(changes)
            config = self.config.replace({**own, "run.seed": int(words[0]) >> 2})
            config = self.instrument.levelled(config, nuisances)
            start = self._run_in(config) if self.needs_run_in else 0
            if start:
                # Half an interval more, so that the last sample is not lost by rounding.
                duration = (start + count - 0.5) * self.sampling.interval
                config = config.replace({"run.duration": duration})
            run = Realization(config, 0, estimates_errors=False)
            while not run.finished and run.breaks < MAX_BREAKS:
                if stop.is_set():
                    raise StoppedError("the fit was stopped")
                run.advance()
        except (ConfigError, RunError):
            return None
        trace: Array = run.trace[:]
        run.close()
        if not run.finished or run.breaks >= MAX_BREAKS:
            return None
        if len(trace) < start + count:
            return None
        exact = trace[:, TRACE_COLUMNS.index("spring_force")]
        read = self.instrument.read(exact, self.sampling.interval, nuisances)
        force = self.sampling.sampled(read[start:])
        rng = np.random.default_rng(words[1:])
        noisy = self.noise.added(force, self.sampling.interval, rng)
        if WANDER in nuisances:
            drive = trace[start:, TRACE_COLUMNS.index("drive_displacement")]
            drive = self.sampling.sampled(drive)
            noisy = noisy + nuisances[WANDER] * self.summarizer.scale * wandering(
                drive, self.wander_length, rng, starts_at_zero=self.summarizer.has_start
            )
        return self.sampling.reduced(noisy)

    def _run_in(self, config: Config) -> int:
        count, interval = self.sampling.simulated_count, self.sampling.interval
        return run_in_samples(config, self.summarizer.scale, interval, count)

    @property
    def run_in(self) -> float:
        """Time that a simulation of the known parameters starts before the trace [s]."""
        return self._run_in(self.config) * self.sampling.interval if self.needs_run_in else 0.0

    def noisier(self, rng: np.random.Generator) -> Array:
        """The measured trace with doubled noise [N]."""
        extra = self.noise.added(np.zeros(len(self.sampling.times)), self.sampling.interval, rng)
        return self.force + self.sampling.reduced(extra)


def prepare(tree: DataTree, plan: Plan, name: str = "", number: int = 0) -> Experiment:
    """An experiment from the first realization of an output, by number of the trace in the fit."""
    if "spring_force" not in tree.data_vars:
        if "friction_coefficient" in tree.data_vars:
            raise FileError(
                f"{_named(name)}has friction coefficients, and a fit needs forces: repeat mesoslip "
                "trace with the normal force (--normal-force)"
            )
        raise FileError(f"{_named(name)}the output has no trace of the spring force")
    declared = declared_values(tree)
    known = own_config(declared, plan)
    velocity = first_velocity(known) or 1.0
    root = tree.to_dataset()
    time = root["time"].values.astype(float)
    force = np.atleast_2d(root["spring_force"].values)[0].astype(float)
    is_known = np.isfinite(force)
    time, force = time[is_known], force[is_known]
    if len(time) < 2:
        raise FileError(f"{_named(name)}the trace has {len(time)} samples")
    after = plan.after
    if plan.after_distance > 0:
        if not first_velocity(known):
            raise FileError(
                f"{_named(name)}fit.after is a displacement, and the trace has no velocity of the "
                "drive: give a time"
            )
        after = plan.after_distance / abs(velocity)
    sampling = Sampling(time - time[0], after)
    interval = sampling.interval
    count = len(sampling.time)
    if count < MIN_SAMPLES:
        raise FileError(
            f"{_named(name)}the trace has {count} samples"
            + (f" after {after:g} s" if after else "")
            + f"; a fit needs at least {MIN_SAMPLES}"
        )
    scale = float(np.max(np.abs(force)))
    if scale == 0:
        raise FileError(f"{_named(name)}the force of the trace is 0 throughout")
    is_measured = tree.attrs.get("origin") == "measured"
    force, noise, corrections = cleaned(
        sampling.times, force, deviation=plan.noise, is_measured=is_measured
    )
    scale = float(np.max(np.abs(force)))
    noise, more = noise.with_at_least(MIN_NOISE * scale)
    if more > 0:
        words = [plan.seed, 1, number] if number else [plan.seed, 1]
        force = force + more * np.random.default_rng(words).standard_normal(len(force))
    is_midway = is_measured and not after and _is_loaded(force, math.copysign(scale, velocity))
    if is_midway and plan.shares_track:
        raise FileError(
            f"{_named(name)}the trace begins in the middle of an experiment, at an unknown place "
            "on the track: leave out fit.shared_track"
        )
    config = _configured(known, sampling, name)
    whole = Sampling(sampling.times)
    period = _period(plan, config, whole.time, whole.reduced(force), noise.deviation)
    block = max(1, math.floor(period / interval / SAMPLES_PER_PERIOD))
    block = min(block, max(1, count // MIN_SAMPLES))
    sampling = replace(sampling, block=block)
    reduced = sampling.reduced(force)
    summarizer = Summarizer(
        sampling.time,
        noise.averaged(block, interval),
        period,
        scale,
        math.copysign(1.0, velocity),
        after < interval / 2 and not is_midway,
        _pieces(root, is_known, sampling),
    )
    directions = {one for part in config.drive_parts for one in part.directions}
    if summarizer.pieces is not None and len(directions) < 2:
        raise FileError(
            f"{_named(name)}the load point of the trace goes back and forth, and the drive of the "
            "configuration does not: give [drive.cycle], or its times and displacements as "
            "[drive.history]"
        )
    length = math.nan
    if WANDER in plan.prior.keys:
        length = measured_length(summarizer, reduced, abs(velocity))
    return Experiment(
        name,
        config,
        sampling,
        noise,
        summarizer,
        length,
        reduced,
        Apparatus(declared),
        Instrument(
            level_name(number, count=2 if plan.has_several else 1),
            plan.level_of,
            plan.filter_time,
        ),
        corrections,
        is_midway and not known.drive.parts,
    )


def _pieces(
    root: Dataset, is_known: NDArray[np.bool_], sampling: Sampling
) -> tuple[Piece, ...] | None:
    """Pieces of a recorded drive that goes back and forth, as samples of the reduced trace."""
    if "drive_displacement" not in root:
        return None
    drive = np.atleast_2d(root["drive_displacement"].values)[0].astype(float)[is_known]
    return monotone_pieces(sampling.reduced(drive))


def _is_loaded(force: Array, scale: float) -> bool:
    """Whether a trace begins under force, not with the first loading of the interface."""
    first = force[: max(3, len(force) // 1000)]
    return float(np.median(first)) / scale > LOADED


def _named(name: str) -> str:
    return f"{name}: " if name else ""


def _configured(config: Config, sampling: Sampling, name: str) -> Config:
    """The configuration with the sampling of a trace, which must not exceed the drive."""
    count, interval = sampling.simulated_count, sampling.interval
    if config.drive.parts and config.duration < (count - 1.5) * interval:
        raise FileError(
            f"{_named(name)}the trace has a duration of {(count - 1) * interval:g} s, the stages "
            f"of [drive] only {config.duration:g} s: give stages for the whole trace"
        )
    changes: dict[str, Any] = {
        "run": {"engine": "eq", "realizations": 1},
        "output": {"interval": interval, "slip_interval": 0.0},
    }
    if not config.drive.parts:
        # Half an interval more, so that the last sample is not lost by rounding.
        changes["run"]["duration"] = (count - 0.5) * interval
    tables = config.to_dict()
    tables["output"] = {}
    return type(config).from_dict(tables).replace(changes)


def _period(plan: Plan, config: Config, time: Array, force: Array, noise: float) -> float:
    """The period of the setup for finding slips, the same for every trace [s]."""
    known = 2 * config.slider.quiet_time
    estimated = estimated_period(time, force, noise)
    is_known = not {"slider.mass", "slider.stiffness"} & set(plan.prior.keys)
    if known > 0 and (is_known or not math.isfinite(estimated)):
        return known
    return estimated if math.isfinite(estimated) else float(time[-1]) / 100
