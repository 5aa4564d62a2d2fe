"""Fits of traces: from traces to the posterior of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.array_types import Array, DataTree
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.execution.store import Store
from mesoslip.inference.apparatus import of_several
from mesoslip.inference.checks import Agreement, compare, information
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.rounds import Estimate, estimate_posterior
from mesoslip.inference.sampler import check_installed
from mesoslip.inference.simulations import Simulations, Simulator
from mesoslip.inference.traced_experiment import Experiment
from mesoslip.inference.traced_experiment import prepare as prepare_experiment

# Maximum number of stored samples of a predicted trace.
MAX_SAMPLES = 3000
# Number of traces with additional noise.
TRIALS = 4
# Maximum change of a summary by doubled noise: of a logarithm of a power, of other logarithms, and
# of forces in standard deviations of the trace. At these, noise makes about half of the power.
MAX_POWER_CHANGE = 0.4
MAX_LOG_CHANGE = 0.2
MAX_FORCE_CHANGE = 0.2


@dataclass(frozen=True)
class Prediction:
    """Predictions of one trace by a posterior."""

    experiment: Experiment
    observed_slips: FoundSlips
    force: Array
    """Predicted traces [N], every `stride`-th sample, shape (traces, samples)."""
    slips: tuple[FoundSlips, ...]
    """Slips of the predicted traces."""
    stride: int


@dataclass(frozen=True)
class FitResult:
    plan: Plan
    simulator: Simulator
    observed: Array
    """Summaries of the traces."""
    left_out: NDArray[np.bool_]
    """Whether each summary is left out, as noise dominates it."""
    estimate: Estimate
    agreement: Agreement
    information: dict[str, Array]
    """Information of each group of summaries, see `mesoslip.inference.checks.information`."""
    predicted: Array
    """Summaries of predicted traces, shape (traces, summaries)."""
    predictions: tuple[Prediction, ...]
    """Predictions of each trace."""
    simulations: int
    """Number of simulations."""


def fit(
    trees: Sequence[DataTree],
    names: Sequence[str],
    plan: Plan,
    *,
    store: Path | None = None,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> FitResult:
    """Fit parameters to outputs with a trace each; see `mesoslip.fit`."""
    check_installed()
    plan = plan.of_traces(len(trees))
    simulator = prepare(trees, names, plan)
    observed, left_out = usable_summaries(simulator)
    used = np.where(left_out, np.nan, observed)
    rng = np.random.default_rng(plan.seed)
    count = plan.prediction_count
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


def prepare(trees: Sequence[DataTree], names: Sequence[str], plan: Plan) -> Simulator:
    """The simulator of experiments, with their traces."""
    plan = plan.of_traces(len(trees))
    several = len(trees) > 1
    experiments = [
        prepare_experiment(tree, plan, name if several else "", number)
        for number, (tree, name) in enumerate(zip(trees, names, strict=True))
    ]
    if several:
        # One interface has one correlation length of its strength: the longest is measured best.
        length = float(np.max([one.wander_length for one in experiments]))
        declared = [one.apparatus.declared for one in experiments]
        own = of_several([one.name for one in experiments], declared, plan.prior.keys)
        experiments = [
            replace(one, wander_length=length, apparatus=apparatus)
            for one, apparatus in zip(experiments, own, strict=True)
        ]
    return Simulator(
        tuple(experiments), plan.prior, plan.seed, plan.coarse_count, plan.shares_track
    )


def usable_summaries(simulator: Simulator) -> tuple[Array, NDArray[np.bool_]]:
    """Summaries of the traces, and whether each is left out, as noise dominates it."""
    left_out = [_dominated_by_noise(one, simulator.seed) for one in simulator.experiments]
    return simulator.observed, np.concatenate(left_out)


def _dominated_by_noise(experiment: Experiment, seed: int) -> NDArray[np.bool_]:
    """Whether the noise dominates each summary: doubled, it changes the summary as much as it has
    changed it already."""
    summarizer = experiment.summarizer
    observed = summarizer(experiment.force)
    rng = np.random.default_rng([seed, 3])
    noisier = np.array([summarizer(experiment.noisier(rng)) for _ in range(TRIALS)])
    deviation = float(np.std(experiment.force)) / summarizer.scale
    special = {"log power": MAX_POWER_CHANGE, "force": MAX_FORCE_CHANGE * deviation}
    limits = np.array([special.get(one.kind, MAX_LOG_CHANGE) for one in summarizer.features])
    change = np.abs(noisier.mean(axis=0) - observed)
    is_lost = np.isfinite(observed) & ~np.isfinite(noisier).all(axis=0)
    return np.asarray((change > limits) | is_lost)


def predict_traces(simulations: Simulations, points: Array) -> tuple[Array, tuple[Prediction, ...]]:
    """Summaries of predicted traces at points of the unit cube, shape (traces, summaries), and
    predictions of each trace."""
    simulator = simulations.simulator
    experiments = simulator.experiments
    strides = [max(1, len(one.force) // MAX_SAMPLES) for one in experiments]
    forces: list[list[Array]] = [[] for _ in experiments]
    slips: list[list[FoundSlips]] = [[] for _ in experiments]
    predicted = []
    for traces in simulations.forces(points):
        found = simulator.slips(traces)
        predicted.append(simulator.summarized(traces, found))
        for number, force in enumerate(traces):
            forces[number].append(force[:: strides[number]].astype(np.float32))
            slips[number].append(found[number])
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
