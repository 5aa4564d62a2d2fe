"""Whether the model describes the trace, and what the trace says of each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.inference.likelihood import project
from mesoslip.inference.prior import Prior
from mesoslip.inference.summaries import Feature

Array = NDArray[np.float64]

# Probability below which the model is said not to describe the trace.
REJECTED = 0.02
# Parts of predicted traces that have, or have not, a summary for the trace to be unlike them.
NEARLY_ALL, HARDLY_ANY = 0.95, 0.05
# Spreads beyond which a deviation is cut off, and what is added to a covariance, in parts of the
# mean variance.
LARGEST_DEVIATION = 30.0
RIDGE = 1e-3
# Standard deviation of the prior on the unit cube.
PRIOR_DEVIATION = 12**-0.5
# Shrinkage from prior to posterior below which a parameter is not determined, and from which it is.
UNDETERMINED, DETERMINED = 0.25, 0.75
# Correlation from which two parameters are only determined together.
TOGETHER = 0.9
# Part of the draws in an outer part of the range that tells that the range is too narrow.
EDGE, AT_EDGE = 0.02, 0.1
# Summaries that are named.
NAMED = 3


@dataclass(frozen=True)
class Disagreement:
    """A summary in which the trace is unlike what the model predicts.

    Attributes
    ----------
    feature
        The summary.
    score
        Deviation of the trace from the median prediction, in spreads of the predictions; infinite
        if only one of them has it.
    """

    feature: Feature
    score: float

    def __str__(self) -> str:
        if np.isfinite(self.score):
            return f"{self.feature.name} ({self.feature.meaning}) is off by {self.score:+.1f} sigma"
        if self.score > 0:
            return f"the trace has {self.feature.name}, and hardly any prediction has"
        return f"nearly all predictions have {self.feature.name}, and the trace has not"


@dataclass(frozen=True)
class Agreement:
    """How the trace compares with predictions.

    Attributes
    ----------
    probability
        Part of predicted traces that are at least as unlike the others as the trace is.
    scores
        Deviation of each summary from the median prediction, in spreads of the predictions; NaN
        where it cannot be compared.
    worst
        Of the groups of summaries that disagree most, the summary that is farthest off.
    """

    probability: float
    scores: Array
    worst: tuple[Disagreement, ...]

    @property
    def is_rejected(self) -> bool:
        """Whether the model does not describe the trace."""
        return self.probability < REJECTED


def compare(
    features: Sequence[Feature], simulated: Array, predicted: Array, observed: Array
) -> Agreement:
    """Compare a trace with predictions of the posterior.

    Each group of summaries gives a distance, that of Mahalanobis with the covariance of simulations
    near the posterior, so that a trace is unlike the others if its summaries do not go together as
    theirs do. Distances are judged by those of the predictions: no law is assumed. The group that
    disagrees most counts, and is judged by the groups of the predictions that disagree most.

    Parameters
    ----------
    features
        The summaries.
    simulated
        Summaries of simulations near the posterior, shape (simulations, summaries).
    predicted
        Summaries of traces that the posterior predicts, shape (traces, summaries).
    observed
        Summaries of the trace.
    """
    has = np.isfinite(predicted).mean(axis=0)
    there = np.isfinite(observed)
    missing = (has >= NEARLY_ALL) & ~there
    extra = (has <= HARDLY_ANY) & there
    scores = np.full(len(features), np.nan)
    compared = there & (has >= NEARLY_ALL)
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
    for place, group in enumerate(groups):
        inside = compared & (names == group)
        reference, others, mine = (
            np.clip(
                np.nan_to_num((one[..., inside] - centre[inside]) / spread[inside]),
                -LARGEST_DEVIATION,
                LARGEST_DEVIATION,
            )
            for one in (simulated, predicted, observed)
        )
        covariance = np.cov(reference.T).reshape(len(mine), -1)
        # What is hardly ever different in simulations is taken to differ a little.
        covariance += RIDGE * np.mean(np.diag(covariance)) * np.eye(len(mine))
        inverse = np.linalg.inv(covariance)
        own[:, place] = np.einsum("ij,jk,ik->i", others, inverse, others)
        trace[place] = mine @ inverse @ mine
    # Of each prediction the part of all that are at least as far off, group by group.
    count = len(predicted)
    ranks = (count - np.argsort(np.argsort(own, axis=0), axis=0)) / count
    parts = (1 + np.sum(own >= trace, axis=0)) / (1 + count)
    least = ranks.min(axis=1, initial=1.0)
    probability = (1 + np.sum(least <= parts.min(initial=1.0))) / (1 + count)
    found = []
    for place in np.argsort(parts):
        inside = np.where(compared & (names == groups[place]), np.abs(scores), -1.0)
        farthest = int(np.argmax(inside))
        found.append(Disagreement(features[farthest], float(scores[farthest])))
    scores[missing], scores[extra] = -np.inf, np.inf
    for place in np.flatnonzero(missing | extra)[::-1]:
        one = Disagreement(features[place], float(scores[place]))
        found = [one, *(other for other in found if other.feature.group != one.feature.group)]
        probability = 1 / (1 + count)
    return Agreement(float(probability), scores, tuple(found[:NAMED]))


def shrinkage(draws: Array) -> Array:
    """How much narrower the posterior is than the prior, 0 (no narrower) to 1.

    Parameters
    ----------
    draws
        On the unit cube, shape (draws, parameters).
    """
    return np.asarray(np.clip(1 - draws.std(axis=0) / PRIOR_DEVIATION, 0, 1))


def informed_by(
    features: Sequence[Feature],
    parameters: Array,
    summaries: Array,
    observed: Array,
) -> dict[str, Array]:
    """What each group of summaries alone tells of each parameter.

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
        By group, the part of the variance of each parameter over the simulations that the group
        predicts, 0 to 1.
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
    """What a user must know before using the parameters."""
    if agreement.is_rejected:
        told = "; ".join(str(one) for one in agreement.worst)
        yield (
            "no parameters in the ranges describe the trace "
            f"(p = {agreement.probability:.2g}): {told}"
        )
    shrunk = shrinkage(draws)
    for one, part in zip(prior.free, shrunk, strict=True):
        if part < UNDETERMINED:
            yield f"{one.key} is not determined by this trace: the result is the range given"
    for place, one in enumerate(prior.free):
        if shrunk[place] < UNDETERMINED:
            continue
        for name, part in (
            ("from", np.mean(draws[:, place] < EDGE)),
            ("to", np.mean(draws[:, place] > 1 - EDGE)),
        ):
            if part > AT_EDGE:
                yield f"{one.key} lies at the end of its range: widen fit.free.{one.key}.{name}"
    correlation = np.corrcoef(draws.T).reshape(len(prior), -1)
    for first in range(len(prior)):
        for second in range(first + 1, len(prior)):
            value = correlation[first, second]
            if abs(value) > TOGETHER:
                yield (
                    f"{prior.free[first].key} and {prior.free[second].key} are only determined "
                    f"together (correlation {value:+.2f})"
                )
    if np.max(r_hat) > 1.05:
        yield f"the chains do not agree (R-hat {np.max(r_hat):.2f}); give more fit.simulations"
