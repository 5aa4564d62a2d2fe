"""Posterior checks: agreement of model and trace, and information on each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.inference.likelihood import project
from mesoslip.inference.prior import Prior
from mesoslip.inference.summaries import Feature

Array = NDArray[np.float64]

# Probability below which the model is rejected.
REJECTED = 0.02
# Fractions of predicted traces with a summary above, or below, which a trace without it, or with
# it, disagrees.
NEARLY_ALL, HARDLY_ANY = 0.95, 0.05
# Maximum deviation, in spreads, and regularization of a covariance, in mean variances.
MAX_DEVIATION = 30.0
RIDGE = 1e-3
# Standard deviation of the prior on the unit cube.
PRIOR_DEVIATION = 12**-0.5
# Shrinkage below which a parameter is not determined, and from which it is determined.
UNDETERMINED, DETERMINED = 0.25, 0.75
# Correlation above which two parameters are only determined together.
MAX_CORRELATION = 0.9
# Width of the margin at the ends of a range, and maximum fraction of the draws in it.
MARGIN, MAX_IN_MARGIN = 0.02, 0.1
# Maximum R-hat of converged chains.
MAX_R_HAT = 1.05
# Maximum number of disagreements in a warning.
MAX_NAMED = 3


@dataclass(frozen=True)
class Disagreement:
    """A summary in which the trace disagrees with the predictions.

    Attributes
    ----------
    feature
        The summary.
    score
        Deviation of the trace from the median prediction, in spreads of the predictions; infinite
        if the summary is defined only for one of them.
    """

    feature: Feature
    score: float

    def __str__(self) -> str:
        if np.isfinite(self.score):
            return f"{self.feature.name} ({self.feature.meaning}) is off by {self.score:+.1f} sigma"
        if self.score > 0:
            return f"{self.feature.name} is defined for the trace, but for hardly any prediction"
        return f"{self.feature.name} is defined for nearly all predictions, but not for the trace"


@dataclass(frozen=True)
class Agreement:
    """Comparison of the trace with predictions.

    Attributes
    ----------
    probability
        Fraction of predicted traces that deviate from the others at least as much as the trace.
    scores
        Deviation of each summary from the median prediction, in spreads of the predictions; NaN
        if they cannot be compared.
    worst
        The summary with the largest deviation of each of the groups that disagree most.
    """

    probability: float
    scores: Array
    worst: tuple[Disagreement, ...]

    @property
    def is_rejected(self) -> bool:
        """Whether the model is rejected."""
        return self.probability < REJECTED


def compare(
    features: Sequence[Feature], simulated: Array, predicted: Array, observed: Array
) -> Agreement:
    """Compare a trace with predictions of the posterior.

    The distance of each group of summaries is Mahalanobis', with the covariance of simulations near
    the posterior, so that unusual combinations of summaries disagree too. Distances are ranked
    among those of the predictions, without assuming a distribution. The group with the largest
    disagreement counts, compared with the largest one of each prediction.

    Parameters
    ----------
    features
        The summaries.
    simulated
        Summaries of simulations near the posterior, shape (simulations, summaries).
    predicted
        Summaries of traces predicted by the posterior, shape (traces, summaries).
    observed
        Summaries of the trace.
    """
    defined = np.isfinite(predicted).mean(axis=0)
    is_observed = np.isfinite(observed)
    missing = (defined >= NEARLY_ALL) & ~is_observed
    extra = (defined <= HARDLY_ANY) & is_observed
    scores = np.full(len(features), np.nan)
    compared = is_observed & (defined >= NEARLY_ALL)
    centre = np.full(len(features), np.nan)
    spread = np.full(len(features), np.nan)
    centre[compared] = np.nanmedian(predicted[:, compared], axis=0)
    low, high = np.nanpercentile(predicted[:, compared], [16, 84], axis=0)
    spread[compared] = (high - low) / 2
    compared &= spread > 1e-9 * (1 + np.abs(centre))
    scores[compared] = (observed - centre)[compared] / spread[compared]
    names = np.array([one.group for one in features])
    groups = [one for one in dict.fromkeys(names) if np.any(compared & (names == one))]
    own, trace = np.zeros((len(predicted), len(groups))), np.zeros(len(groups))
    for index, group in enumerate(groups):
        inside = compared & (names == group)
        reference, others, mine = (
            np.clip(
                np.nan_to_num((one[..., inside] - centre[inside]) / spread[inside]),
                -MAX_DEVIATION,
                MAX_DEVIATION,
            )
            for one in (simulated, predicted, observed)
        )
        covariance = np.cov(reference.T).reshape(len(mine), -1)
        # Regularized, for summaries that hardly vary in simulations.
        covariance += RIDGE * np.mean(np.diag(covariance)) * np.eye(len(mine))
        inverse = np.linalg.inv(covariance)
        own[:, index] = np.einsum("ij,jk,ik->i", others, inverse, others)
        trace[index] = mine @ inverse @ mine
    # For each prediction and group, the fraction of predictions at the same distance or more.
    count = len(predicted)
    ranks = (count - np.argsort(np.argsort(own, axis=0), axis=0)) / count
    parts = (1 + np.sum(own >= trace, axis=0)) / (1 + count)
    min_ranks = ranks.min(axis=1, initial=1.0)
    probability = (1 + np.sum(min_ranks <= parts.min(initial=1.0))) / (1 + count)
    found = []
    for index in np.argsort(parts):
        inside = np.where(compared & (names == groups[index]), np.abs(scores), -1.0)
        largest = int(np.argmax(inside))
        found.append(Disagreement(features[largest], float(scores[largest])))
    scores[missing], scores[extra] = -np.inf, np.inf
    for index in np.flatnonzero(missing | extra)[::-1]:
        one = Disagreement(features[index], float(scores[index]))
        found = [one, *(other for other in found if other.feature.group != one.feature.group)]
        probability = 1 / (1 + count)
    return Agreement(float(probability), scores, tuple(found[:MAX_NAMED]))


def shrinkage(draws: Array) -> Array:
    """Shrinkage from prior to posterior, 1 - (standard deviation)/(that of the prior), from 0 to 1.

    Parameters
    ----------
    draws
        On the unit cube, shape (draws, parameters).
    """
    return np.asarray(np.clip(1 - draws.std(axis=0) / PRIOR_DEVIATION, 0, 1))


def information(
    features: Sequence[Feature],
    parameters: Array,
    summaries: Array,
    observed: Array,
) -> dict[str, Array]:
    """Information of each group of summaries alone on each parameter.

    Parameters
    ----------
    features
        The summaries.
    parameters, summaries
        Of simulations near the posterior.
    observed
        Summaries of the trace.

    Returns
    -------
    dict
        For each group, the fraction of the variance of each parameter over the simulations that the
        group predicts, 0 to 1.
    """
    result = {}
    for group in dict.fromkeys(one.group for one in features):
        inside = np.array([one.group == group for one in features])
        masked = np.where(inside, observed, np.nan)
        if not np.isfinite(masked).any():
            continue
        statistics = project(summaries, parameters, masked)[1]
        left = np.var(statistics - parameters, axis=0) / np.var(parameters, axis=0)
        result[group] = np.clip(1 - left, 0, 1)
    return result


def warnings(prior: Prior, draws: Array, agreement: Agreement, r_hat: Array) -> Iterator[str]:
    """Warnings on the parameters of a fit."""
    if agreement.is_rejected:
        reasons = "; ".join(str(one) for one in agreement.worst)
        yield (
            "no parameters in the ranges describe the trace "
            f"(p = {agreement.probability:.2g}): {reasons}"
        )
    shrunk = shrinkage(draws)
    for one, part in zip(prior.free, shrunk, strict=True):
        if part < UNDETERMINED:
            yield f"{one.key} is not determined by this trace: its posterior is close to its prior"
    for index, one in enumerate(prior.free):
        if shrunk[index] < UNDETERMINED:
            continue
        for name, part in (
            ("from", np.mean(draws[:, index] < MARGIN)),
            ("to", np.mean(draws[:, index] > 1 - MARGIN)),
        ):
            if part > MAX_IN_MARGIN:
                yield f"{one.key} lies at the end of its range: widen fit.free.{one.key}.{name}"
    correlation = np.corrcoef(draws.T).reshape(len(prior), -1)
    for first in range(len(prior)):
        for second in range(first + 1, len(prior)):
            value = correlation[first, second]
            if abs(value) > MAX_CORRELATION:
                yield (
                    f"{prior.free[first].key} and {prior.free[second].key} are only determined "
                    f"together (correlation {value:+.2f})"
                )
    if np.max(r_hat) > MAX_R_HAT:
        yield f"the chains do not agree (R-hat {np.max(r_hat):.2f}): increase fit.simulations"
