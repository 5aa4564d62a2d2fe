"""From a trace to the posterior of the parameters, from start to end."""

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
from mesoslip.analysis.sampled_slips import FoundSlips, estimated_period, noise_level
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.checks import Agreement, compare, informed_by
from mesoslip.inference.plan import Plan
from mesoslip.inference.rounds import Estimate, close_in
from mesoslip.inference.sampler import check_installed
from mesoslip.inference.simulations import Simulations, Simulator
from mesoslip.inference.summaries import Summarizer

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Least noise, in parts of the greatest force: traces with less get more, measured and simulated
# alike, as no summary is to hang on what no experiment resolves.
LEAST_NOISE = 5e-4
# Traces that the posterior predicts.
PREDICTIONS = 160
# Samples of a predicted trace that are kept.
MOST_SAMPLES = 3000
# Least samples of a trace.
LEAST_SAMPLES = 200
# Differences of what a trace and a configuration say, in parts.
SAME = 0.01


@dataclass(frozen=True)
class Fitted:
    """What a fit gives.

    Attributes
    ----------
    plan
        What was fitted.
    simulator
        How the experiment is simulated.
    time, force
        The trace, as it was used [s], [N].
    observed
        Its summaries.
    estimate
        The posterior.
    agreement
        Whether the model describes the trace.
    information
        What each group of summaries alone tells, see `mesoslip.inference.checks.informed_by`.
    observed_slips
        Slips of the trace.
    predicted
        Summaries of predicted traces.
    predicted_force
        Predicted traces at some of the times, shape (traces, samples) [N].
    predicted_slips
        Their slips.
    stride
        Of the samples that are kept.
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
) -> Fitted:
    """Fit parameters to a trace.

    Parameters
    ----------
    tree
        An output with a trace; its first realization counts.
    plan
        What is free.
    store
        Folder in which simulations are kept, so that a fit that was stopped can be continued.
    executor
        Where simulations are computed, or how many threads compute them; as many as there are
        processors by default. The result does not depend on it.
    progress
        Called now and then with the fraction of the simulations that is done.
    stop
        A request to stop; Ctrl-C is one too.

    Raises
    ------
    FileError, ConfigError
        If the trace cannot be fitted, or the configuration contradicts it.
    RunError
        If no simulation is like the trace, or emcee is not installed.
    mesoslip.execution.stop.StoppedError
        If it was stopped.
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
        estimate = close_in(simulations, observed, plan.simulations, rng)
        chosen = estimate.draws[rng.choice(len(estimate.draws), PREDICTIONS, replace=False)]
        stride = max(1, len(force) // MOST_SAMPLES)
        forces, slips, predicted = [], [], []
        for one in simulations.forces(chosen):
            forces.append(one[::stride].astype(np.float32))
            slips.append(summarizer.slips(one))
            predicted.append(summarizer(one))
    agreement = compare(summarizer.features, estimate.summaries, np.array(predicted), observed)
    information = informed_by(
        summarizer.features, estimate.parameters, estimate.summaries, observed
    )
    return Fitted(
        plan,
        simulator,
        summarizer.time,
        force,
        observed,
        estimate,
        agreement,
        information,
        summarizer.slips(force),
        np.array(predicted),
        np.array(forces),
        tuple(slips),
        stride,
        len(simulations),
    )


def prepare(tree: xr.DataTree, plan: Plan) -> tuple[Simulator, Array]:
    """How to simulate an experiment, and its trace at equal intervals, with noise.

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
    if len(force) - skipped < LEAST_SAMPLES:
        raise FileError(
            f"the trace has {max(len(force) - skipped, 0)} samples"
            + (f" after {plan.after:g} s" if skipped else "")
            + f"; a fit needs at least {LEAST_SAMPLES}"
        )
    if plan.config.drive.parts and plan.config.duration < (len(force) - 1.5) * interval:
        raise FileError(
            f"the trace takes {(len(force) - 1) * interval:g} s, and the run of the configuration "
            f"ends after {plan.config.duration:g} s: give [drive] the stages of the whole trace"
        )
    changes: dict[str, Any] = {
        "run": {"engine": "eq", "realizations": 1},
        "output": {"interval": interval},
    }
    if not plan.config.drive.parts:
        # A little longer, so that rounding does not cost the last sample.
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
    least = LEAST_NOISE * scale
    if noise < least:
        more = np.random.default_rng([plan.seed, 1]).standard_normal(len(force))
        force = force + math.sqrt(least**2 - noise**2) * more
        noise = least
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
    """The period by which slips are found, the same for every trace [s]."""
    known = 2 * plan.config.slider.quiet_time
    estimated = estimated_period(time, force, noise)
    is_known = not {"slider.mass", "slider.stiffness"} & set(plan.prior.keys)
    if known > 0 and (is_known or not math.isfinite(estimated)):
        return known
    return estimated if math.isfinite(estimated) else float(time[-1]) / 100


def _check_known(tree: xr.DataTree, plan: Plan) -> None:
    """Make sure that the trace and the configuration do not contradict each other.

    Raises
    ------
    FileError, ConfigError
        If there is no trace, or they do.
    """
    import tomllib

    if "spring_force" not in tree.data_vars:
        raise FileError("the output has no trace of a spring force")
    told = tomllib.loads(tree.attrs["configuration"])
    free, problems = set(plan.prior.keys), []
    # Of a simulated trace everything is known; it is not to be used.
    for table, name in (("drive", "velocity"), ("slider", "stiffness")):
        measured = told.get(table, {}).get(name)
        given = getattr(getattr(plan.config, table), name, None)
        key = f"{table}.{name}"
        if measured is None or given is None or key in free:
            continue
        if abs(measured - given) > SAME * abs(measured):
            message = f"the trace says {measured:g}; change it, or make it free in [fit.free]"
            problems.append(Problem("configuration", key, message, given))
    if problems:
        raise ConfigError(problems)
