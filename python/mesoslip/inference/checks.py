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
        Part of predicted traces whose worst summary is at least as far off as that of the trace.
    scores
        Deviation of each summary, NaN where it cannot be compared.
    worst
        Summaries that are farthest off, one of each group.
    """

    probability: float
    scores: Array
    worst: tuple[Disagreement, ...]

    @property
    def is_rejected(self) -> bool:
        """Whether the model does not describe the trace."""
        return self.probability < REJECTED


def compare(features: Sequence[Feature], predicted: Array, observed: Array) -> Agreement:
    """Compare a trace with predictions of the posterior, summary by summary.

    The greatest deviation counts, and is judged by those of the predictions, each compared with the
    others: no law is assumed.

    Parameters
    ----------
    features
        The summaries.
    predicted
        Summaries of predicted traces, shape (traces, summaries).
    observed
        Summaries of the trace.
    """
    has = np.isfinite(predicted).mean(axis=0)
    there = np.isfinite(observed)
    missing = (has >= NEARLY_ALL) & ~there
    extra = (has <= HARDLY_ANY) & there
    scores = np.full(len(features), np.nan)
    scores[missing], scores[extra] = -np.inf, np.inf
    compared = np.flatnonzero(there & (has >= NEARLY_ALL))
    values = predicted[:, compared]
    centre = np.nanmedian(values, axis=0)
    low, high = np.nanpercentile(values, [16, 84], axis=0)
    spread = (high - low) / 2
    varies = spread > 1e-9 * (1 + np.abs(centre))
    compared, values = compared[varies], values[:, varies]
    centre, spread = centre[varies], spread[varies]
    scores[compared] = (observed[compared] - centre) / spread
    own = np.nanmax(np.abs(values - centre) / spread, axis=1, initial=0.0)
    worst = np.max(np.abs(scores[compared]), initial=0.0)
    if missing.any() or extra.any():
        worst = np.inf
    probability = (1 + np.sum(own >= worst)) / (1 + len(own))
    found: dict[str, Disagreement] = {}
    for place in np.argsort(-np.nan_to_num(np.abs(scores), nan=-1.0, posinf=1e300)):
        if not np.isnan(scores[place]):
            one = Disagreement(features[place], float(scores[place]))
            found.setdefault(one.feature.group, one)
    return Agreement(float(probability), scores, tuple(found.values())[:NAMED])


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
    rng: np.random.Generator,
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
    rng
        Random numbers.

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
        statistics = project(summaries, parameters, masked, rng)[1]
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
