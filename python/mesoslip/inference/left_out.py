"""Summaries that the noise of a trace dominates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mesoslip.inference.experiment import Experiment

Array = NDArray[np.float64]

# Traces with additional noise.
TRIALS = 4
# Maximum change of a summary by as much noise again: of a logarithm of a power, of other
# logarithms, and of forces in standard deviations of the trace. At these, noise makes about half of
# the power.
MAX_POWER_CHANGE = 0.4
MAX_LOG_CHANGE = 0.2
MAX_FORCE_CHANGE = 0.2


def dominated_by_noise(experiment: Experiment, seed: int) -> NDArray[np.bool_]:
    """Whether the noise dominates each summary of a trace.

    As much noise again is added to the trace, and the summary changes by as much as the noise has
    already changed it.

    Parameters
    ----------
    experiment
        The trace and its noise.
    seed
        Seed of the noise.

    Returns
    -------
    numpy.ndarray
        Shape (summaries,).
    """
    summarizer = experiment.summarizer
    observed = summarizer(experiment.force)
    rng = np.random.default_rng([seed, 3])
    noisier = np.array([summarizer(experiment.noisier(rng)) for _ in range(TRIALS)])
    deviation = float(np.std(experiment.force)) / summarizer.scale
    limits = np.array(
        [
            MAX_POWER_CHANGE
            if one.kind == "log power"
            else MAX_FORCE_CHANGE * deviation
            if one.kind == "force"
            else MAX_LOG_CHANGE
            for one in summarizer.features
        ]
    )
    change = np.abs(noisier.mean(axis=0) - observed)
    is_lost = np.isfinite(observed) & ~np.isfinite(noisier).all(axis=0)
    return np.asarray((change > limits) | is_lost)
