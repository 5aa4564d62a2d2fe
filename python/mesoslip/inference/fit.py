"""Fits of traces: from traces to the posterior of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.checks import Agreement, compare, information
from mesoslip.inference.experiment import Experiment
from mesoslip.inference.experiment import prepare as prepare_experiment
from mesoslip.inference.left_out import dominated_by_noise
from mesoslip.inference.plan import Plan
from mesoslip.inference.rounds import Estimate, estimate_posterior
from mesoslip.inference.sampler import check_installed
from mesoslip.inference.simulations import Simulations, Simulator

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Number of predicted traces, also where most simulations have fewer contacts than these.
PREDICTIONS = 160
FEW_PREDICTIONS = 100
# Maximum number of stored samples of a predicted trace.
MAX_SAMPLES = 3000


@dataclass(frozen=True)
class Prediction:
    """Predictions of one trace by a posterior.

    Attributes
    ----------
    experiment
        The trace.
    observed_slips
        Its slips.
    force
        Predicted traces, every `stride`-th sample, shape (traces, samples) [N].
    slips
        Slips of the predicted traces.
    stride
        Distance of the stored samples.
    """

    experiment: Experiment
    observed_slips: FoundSlips
    force: Array
    slips: tuple[FoundSlips, ...]
    stride: int


@dataclass(frozen=True)
class FitResult:
    """The result of a fit.

    Attributes
    ----------
    plan
        The plan of the fit.
    simulator
        The simulator of the experiments.
    observed
        Summaries of the traces.
    left_out
        Whether each summary is left out, as noise dominates it.
    estimate
        The posterior.
    agreement
        Comparison of the traces with predictions.
    information
        Information of each group of summaries, see `mesoslip.inference.checks.information`.
    predicted
        Summaries of predicted traces, shape (traces, summaries).
    predictions
        Predictions of each trace.
    simulations
        Number of simulations.
    """

    plan: Plan
    simulator: Simulator
    observed: Array
    left_out: NDArray[np.bool_]
    estimate: Estimate
    agreement: Agreement
    information: dict[str, Array]
    predicted: Array
    predictions: tuple[Prediction, ...]
    simulations: int


def fit(
    trees: Sequence[xr.DataTree],
    names: Sequence[str],
    plan: Plan,
    *,
    store: Path | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> FitResult:
    """Fit parameters to traces of one interface.

    Parameters
    ----------
    trees
        Outputs with a trace each; of each the first realization is fitted.
    names
        Their names.
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
        If a trace cannot be fitted, or the configuration contradicts it.
    RunError
        If too few simulations resemble the traces, or emcee is not installed.
    mesoslip.execution.stop.StoppedError
        If the fit is stopped.
    """
    check_installed()
    simulator = prepare(trees, names, plan)
    observed, left_out = usable_summaries(simulator)
    used = np.where(left_out, np.nan, observed)
    rng = np.random.default_rng(plan.seed)
    count = FEW_PREDICTIONS if simulator.coarse_count else PREDICTIONS
    with ExitStack() as stack:
        kept = None
        if store is not None:
            kept = stack.enter_context(Store(store, "simulations", simulator.fingerprint(observed)))
        simulations = Simulations(
            simulator,
            expected=plan.simulations + count,
            store=kept,
            executor=executor,
            progress=progress,
            stop=stop,
        )
        estimate = estimate_posterior(simulations, used, plan.simulations, rng)
        chosen = estimate.draws[rng.choice(len(estimate.draws), count, replace=False)]
        predicted, predictions = predict_traces(simulations, chosen)
    agreement = compare(
        simulator.features, estimate.summaries, np.where(left_out, np.nan, predicted), used
    )
    informed = information(simulator.features, estimate.parameters, estimate.summaries, used)
    return FitResult(
        plan,
        simulator,
        observed,
        left_out,
        estimate,
        agreement,
        informed,
        predicted,
        predictions,
        len(simulations),
    )


def prepare(trees: Sequence[xr.DataTree], names: Sequence[str], plan: Plan) -> Simulator:
    """The simulator of experiments, with their traces.

    Raises
    ------
    FileError, ConfigError
        See `fit`.
    """
    several = len(trees) > 1
    experiments = [
        prepare_experiment(tree, plan, name if several else "", number)
        for number, (tree, name) in enumerate(zip(trees, names, strict=True))
    ]
    if several:
        # One interface has one correlation length of its strength: the longest is seen best.
        length = float(np.max([one.wander_length for one in experiments]))
        experiments = [replace(one, wander_length=length) for one in experiments]
    return Simulator(tuple(experiments), plan.prior, plan.seed, plan.coarse_count)


def usable_summaries(simulator: Simulator) -> tuple[Array, NDArray[np.bool_]]:
    """Summaries of the traces, and whether each is left out, as noise dominates it."""
    left_out = [dominated_by_noise(one, simulator.seed) for one in simulator.experiments]
    return simulator.observed, np.concatenate(left_out)


def predict_traces(simulations: Simulations, points: Array) -> tuple[Array, tuple[Prediction, ...]]:
    """Predicted traces at points of the unit cube.

    Returns
    -------
    summaries, predictions
        Summaries of the predicted traces, shape (traces, summaries), and the traces.
    """
    simulator = simulations.simulator
    experiments = simulator.experiments
    strides = [max(1, len(one.force) // MAX_SAMPLES) for one in experiments]
    forces: list[list[Array]] = [[] for _ in experiments]
    slips: list[list[FoundSlips]] = [[] for _ in experiments]
    predicted = []
    for traces in simulations.forces(points):
        predicted.append(simulator.summarized(traces))
        for number, force in enumerate(traces):
            forces[number].append(force[:: strides[number]].astype(np.float32))
            slips[number].append(experiments[number].summarizer.slips(force))
    return np.array(predicted), tuple(
        Prediction(
            one,
            one.summarizer.slips(one.force),
            np.array(forces[number]),
            tuple(slips[number]),
            strides[number],
        )
        for number, one in enumerate(experiments)
    )
