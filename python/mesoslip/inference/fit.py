"""Fits of a trace: from the trace to the posterior of the parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.even_traces import even_trace, first_velocity
from mesoslip.analysis.noise import noise_level
from mesoslip.analysis.sampled_slips import FoundSlips, estimated_period
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.checks import Agreement, compare, information
from mesoslip.inference.plan import Plan
from mesoslip.inference.rounds import Estimate, estimate_posterior
from mesoslip.inference.sampler import check_installed
from mesoslip.inference.simulations import Simulations, Simulator
from mesoslip.inference.summaries import Summarizer

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Minimum noise over the maximum force. It is added to measured and simulated traces with less, as
# experiments resolve no smaller differences.
MIN_NOISE = 5e-4
# Number of predicted traces.
PREDICTIONS = 160
# Maximum number of stored samples of a predicted trace.
MAX_SAMPLES = 3000
# Minimum number of samples of a trace.
MIN_SAMPLES = 200
# Maximum relative difference between a trace and its configuration.
MAX_DIFFERENCE = 0.01


@dataclass(frozen=True)
class FitResult:
    """The result of a fit.

    Attributes
    ----------
    plan
        The plan of the fit.
    simulator
        The simulator of the experiment.
    time, force
        The trace as used in the fit [s], [N].
    observed
        Summaries of the trace.
    estimate
        The posterior.
    agreement
        Comparison of the trace with predictions.
    information
        Information of each group of summaries, see `mesoslip.inference.checks.information`.
    observed_slips
        Slips of the trace.
    predicted
        Summaries of predicted traces.
    predicted_force
        Predicted traces, every `stride`-th sample, shape (traces, samples) [N].
    predicted_slips
        Slips of the predicted traces.
    stride
        Distance of the stored samples.
    simulations
        Number of simulations.
    """

    plan: Plan
    simulator: Simulator
    time: Array
    force: Array
    observed: Array
    estimate: Estimate
    agreement: Agreement
    information: dict[str, Array]
    observed_slips: FoundSlips
    predicted: Array
    predicted_force: Array
    predicted_slips: tuple[FoundSlips, ...]
    stride: int
    simulations: int


def fit(
    tree: xr.DataTree,
    plan: Plan,
    *,
    store: Path | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> FitResult:
    """Fit parameters to a trace.

    Parameters
    ----------
    tree
        An output with a trace; its first realization is fitted.
    plan
        The free parameters, and the known ones.
    store
        Folder for finished simulations, so that a stopped fit can be continued; none by default.
    executor
        Executor of the simulations, or a number of threads; by default one per processor. The
        result does not depend on it.
    progress
        Called with the fraction of finished simulations.
    stop
        A request to stop; Ctrl-C stops too.

    Raises
    ------
    FileError, ConfigError
        If the trace cannot be fitted, or the configuration contradicts it.
    RunError
        If too few simulations resemble the trace, or emcee is not installed.
    mesoslip.execution.stop.StoppedError
        If the fit is stopped.
    """
    check_installed()
    simulator, force = prepare(tree, plan)
    summarizer = simulator.summarizer
    observed = summarizer(force)
    rng = np.random.default_rng(plan.seed)
    with ExitStack() as stack:
        kept = None
        if store is not None:
            kept = stack.enter_context(Store(store, "simulations", simulator.fingerprint(observed)))
        simulations = Simulations(
            simulator,
            expected=plan.simulations + PREDICTIONS,
            store=kept,
            executor=executor,
            progress=progress,
            stop=stop,
        )
        estimate = estimate_posterior(simulations, observed, plan.simulations, rng)
        chosen = estimate.draws[rng.choice(len(estimate.draws), PREDICTIONS, replace=False)]
        stride = max(1, len(force) // MAX_SAMPLES)
        forces, slips, predicted = [], [], []
        for one in simulations.forces(chosen):
            forces.append(one[::stride].astype(np.float32))
            slips.append(summarizer.slips(one))
            predicted.append(summarizer(one))
    agreement = compare(summarizer.features, estimate.summaries, np.array(predicted), observed)
    informed = information(summarizer.features, estimate.parameters, estimate.summaries, observed)
    return FitResult(
        plan,
        simulator,
        summarizer.time,
        force,
        observed,
        estimate,
        agreement,
        informed,
        summarizer.slips(force),
        np.array(predicted),
        np.array(forces),
        tuple(slips),
        stride,
        len(simulations),
    )


def prepare(tree: xr.DataTree, plan: Plan) -> tuple[Simulator, Array]:
    """The simulator of an experiment, and its trace at equal intervals, with noise.

    Raises
    ------
    FileError, ConfigError
        See `fit`.
    """
    _check_known(tree, plan)
    time, force = even_trace(tree)
    time = time - time[0]
    interval = float(np.median(np.diff(time)))
    skipped = round(plan.after / interval)
    if len(force) - skipped < MIN_SAMPLES:
        raise FileError(
            f"the trace has {max(len(force) - skipped, 0)} samples"
            + (f" after {plan.after:g} s" if skipped else "")
            + f"; a fit needs at least {MIN_SAMPLES}"
        )
    if plan.config.drive.parts and plan.config.duration < (len(force) - 1.5) * interval:
        raise FileError(
            f"the trace has a duration of {(len(force) - 1) * interval:g} s, the stages of [drive] "
            f"only {plan.config.duration:g} s: give stages for the whole trace"
        )
    changes: dict[str, Any] = {
        "run": {"engine": "eq", "realizations": 1},
        "output": {"interval": interval},
    }
    if not plan.config.drive.parts:
        # Longer by half an interval, so that rounding does not lose the last sample.
        changes["run"]["duration"] = (len(force) - 0.5) * interval
    tables = plan.config.to_dict()
    tables["output"] = {}
    config = type(plan.config).from_dict(tables).replace(changes)
    whole, force = force, force[skipped:]
    noise = plan.noise
    if noise is None:
        noise = float(tree.attrs.get("noise", noise_level(force)))
    scale = float(np.max(np.abs(force)))
    if scale == 0:
        raise FileError("the force of the trace is 0 throughout")
    min_noise = MIN_NOISE * scale
    if noise < min_noise:
        added = np.random.default_rng([plan.seed, 1]).standard_normal(len(force))
        force = force + math.sqrt(min_noise**2 - noise**2) * added
        noise = min_noise
    velocity = first_velocity(config) or 1.0
    summarizer = Summarizer(
        time[: len(force)],
        noise,
        _period(plan, time[: len(whole)], whole, noise),
        scale,
        math.copysign(1.0, velocity),
        skipped == 0,
    )
    return Simulator(config, plan.prior, summarizer, noise, skipped, plan.seed), force


def _period(plan: Plan, time: Array, force: Array, noise: float) -> float:
    """The period of the setup for finding slips, the same for every trace [s]."""
    known = 2 * plan.config.slider.quiet_time
    estimated = estimated_period(time, force, noise)
    is_known = not {"slider.mass", "slider.stiffness"} & set(plan.prior.keys)
    if known > 0 and (is_known or not math.isfinite(estimated)):
        return known
    return estimated if math.isfinite(estimated) else float(time[-1]) / 100


def _check_known(tree: xr.DataTree, plan: Plan) -> None:
    """Check that the trace and the configuration do not contradict each other.

    Raises
    ------
    FileError, ConfigError
        If there is no trace, or a contradiction.
    """
    import tomllib

    if "spring_force" not in tree.data_vars:
        raise FileError("the output has no trace of the spring force")
    traced = tomllib.loads(tree.attrs["configuration"])
    free, problems = set(plan.prior.keys), []
    # Further keys of a simulated trace are not compared: an experiment has none.
    for table, name in (("drive", "velocity"), ("slider", "stiffness")):
        measured = traced.get(table, {}).get(name)
        given = getattr(getattr(plan.config, table), name, None)
        key = f"{table}.{name}"
        if measured is None or given is None or key in free:
            continue
        if abs(measured - given) > MAX_DIFFERENCE * abs(measured):
            message = f"is {measured:g} in the trace; change it, or make it free in [fit.free]"
            problems.append(Problem("configuration", key, message, given))
    if problems:
        raise ConfigError(problems)
