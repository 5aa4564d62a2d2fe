"""Posterior checks: agreement of model and trace, also in words, and information on parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mesoslip.array_types import Array
from mesoslip.inference.features import Feature
from mesoslip.inference.likelihood import project
from mesoslip.inference.prior import Prior
from mesoslip.quantities import column

# Minimum deviation of a summary that is mentioned, in spreads of the predictions.
MIN_SCORE = 2.0
# Maximum number of sentences, and of sentences on one group.
MAX_SENTENCES, MAX_IN_GROUP = 5, 2
# Digits of the quantities.
DIGITS = 3


def sentences(
    features: Sequence[Feature],
    groups: Sequence[str],
    scores: Array,
    observed: Array,
    predicted: Array,
) -> Iterator[str]:
    """The largest disagreements with the model, the worst first; scores are deviations from the
    predictions in spreads."""
    named = 0
    for group in groups:
        labels: set[str] = set()
        inside = [index for index, one in enumerate(features) if one.group == group]
        order = sorted(inside, key=lambda index: -np.nan_to_num(abs(scores[index])))
        if np.isinf(scores[order[0]]) and named < MAX_SENTENCES:
            named += 1
            yield _unnamed(features[order[0]], scores[order[0]])
            continue
        for index in order:
            one, score = features[index], scores[index]
            label = one.high if score < 0 else one.low
            if named >= MAX_SENTENCES or len(labels) >= MAX_IN_GROUP:
                break
            if not (np.isfinite(score) and one.is_mentioned) or abs(score) < MIN_SCORE:
                continue
            if label in labels:
                continue
            labels.add(label)
            named += 1
            yield sentence(one, score, observed[index], predicted[:, index])
        if not labels and named < MAX_SENTENCES and order:
            named += 1
            yield _unnamed(features[order[0]], scores[order[0]])


def sentence(feature: Feature, score: float, observed: float, predicted: Array) -> str:
    """A disagreement in words: slips are too deep: force drop 31 to 35 mN, measured 24 mN."""
    known = predicted[np.isfinite(predicted)]
    low, high = (feature.quantity(one) for one in np.percentile(known, [5, 95]))
    measured = feature.quantity(observed)
    shown = column((low, high, measured), feature.unit, DIGITS)
    low_text, high_text, text = (shown.text(one) for one in (low, high, measured))
    unit = f" {shown.scale.name}" if shown.scale.name else ""
    between = f"{low_text} to {high_text}" if low_text != high_text else low_text
    words = feature.high if score < 0 else feature.low
    return f"{words}: {feature.label} {between}{unit}, measured {text}{unit}"


def _unnamed(feature: Feature, score: float) -> str:
    """A disagreement in a summary without sentences of its own."""
    if np.isfinite(score) and abs(score) < MIN_SCORE:
        return f"{feature.group}: each quantity is as in the trace, but not all of them together"
    if np.isfinite(score):
        return f"the {feature.meaning} is off by {-score:+.1f} spreads of the predictions"
    if score > 0:
        return f"the {feature.meaning} is defined for the trace, but for hardly any prediction"
    return f"the {feature.meaning} is defined for nearly all predictions, but not for the trace"


# Probability below which the model is rejected.
REJECTED = 0.02
# Fraction of predicted traces with a summary above which a trace without it disagrees, and fraction
# below which a trace with it disagrees.
NEARLY_ALL, HARDLY_ANY = 0.95, 0.05
# Maximum deviation, in spreads, and regularization of a covariance, in mean variances.
MAX_DEVIATION = 30.0
RIDGE = 1e-3
# Minimum of 1 - leverage of a prediction on the covariance.
MIN_REMAINDER = 1e-9
# Standard deviation of the prior on the unit cube.
PRIOR_DEVIATION = 12**-0.5
# Shrinkage below which a parameter is not determined, and above which it is.
UNDETERMINED, DETERMINED = 0.25, 0.75
# Correlation above which two parameters are only determined together.
MAX_CORRELATION = 0.9
# Width of the margin at the ends of a range, and maximum fraction of the draws in it.
MARGIN, MAX_IN_MARGIN = 0.02, 0.1
# Maximum R-hat of converged chains.
MAX_R_HAT = 1.05
# Minimum information of a group that a parameter follows from, over that of the most informative
# one, and maximum number of such groups.
SHARE = 0.7
MAX_NEEDED = 2


@dataclass(frozen=True)
class Agreement:
    """Comparison of traces with predictions."""

    probability: float
    """Fraction of predicted traces that deviate from the others at least as much as the trace."""
    scores: Array
    """Deviation of each summary from the median prediction, in spreads of the predictions; NaN if
    they cannot be compared, infinite if it is defined only for one of them."""
    groups: dict[str, float]
    """For each group of summaries, the fraction of the predictions that deviate as much in it."""
    sentences: tuple[str, ...]
    """The disagreements, in words."""

    @property
    def is_rejected(self) -> bool:
        return self.probability < REJECTED

    @property
    def disagreeing(self) -> tuple[str, ...]:
        """Groups of summaries in which the trace disagrees, the worst first."""
        found = [name for name, one in self.groups.items() if one < REJECTED]
        return tuple(sorted(found, key=lambda name: self.groups[name]))


def compare(
    features: Sequence[Feature], simulated: Array | None, predicted: Array, observed: Array
) -> Agreement:
    """Compare a trace with predictions of the posterior.

    The distance of each group of summaries is Mahalanobis', with the covariance of simulations near
    the posterior, so that unusual combinations of summaries disagree too. Without simulations it is
    that of the predictions, for each of them that of the others. Distances are ranked
    among those of the predictions, without assuming a distribution. The largest disagreement of a
    group is compared with the largest one of each prediction.

    Summaries have the shapes (simulations, summaries) and (traces, summaries).
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
    spread[~compared] = np.nan
    scores[compared] = (observed - centre)[compared] / spread[compared]
    names = np.array([one.group for one in features])
    groups = [one for one in dict.fromkeys(names) if np.any(compared & (names == one))]
    own, trace = np.zeros((len(predicted), len(groups))), np.zeros(len(groups))
    standard = [
        np.clip(np.nan_to_num((one - centre) / spread), -MAX_DEVIATION, MAX_DEVIATION)
        for one in (predicted, observed, simulated)
        if one is not None
    ]
    for index, group in enumerate(groups):
        inside = compared & (names == group)
        own[:, index], trace[index] = _distances(
            standard[0][:, inside],
            standard[1][inside],
            None if simulated is None else standard[2][:, inside],
        )
    # For each prediction and group, the fraction of predictions at the same distance or more.
    count = len(predicted)
    ranks = (count - np.argsort(np.argsort(own, axis=0), axis=0)) / count
    parts = (1 + np.sum(own >= trace, axis=0)) / (1 + count)
    # Distances beyond all others are compared too: with many groups, some prediction is always the
    # farthest one of a group.
    others = np.sort(own, axis=0)[-2:]
    limit = np.where(own >= others[-1], others[0], others[-1])
    unusual = _unusual(own, limit) - np.log(ranks)
    own_unusual = _unusual(trace, others[-1]) - np.log(parts)
    is_more = unusual.max(axis=1, initial=0.0) >= own_unusual.max(initial=0.0)
    probability = (1 + np.sum(is_more)) / (1 + count)
    scores[missing], scores[extra] = -np.inf, np.inf
    found = {groups[index]: float(parts[index]) for index in np.argsort(parts)}
    for index in np.flatnonzero(missing | extra).tolist():
        found[features[index].group] = 1 / (1 + count)
        probability = 1 / (1 + count)
    # Equal groups are sorted by their worst summaries.
    worst = {
        group: float(np.nanmax(np.abs(scores[names == group]), initial=0.0)) for group in found
    }
    order = sorted(found, key=lambda group: (found[group], -worst[group]))
    ranked = {str(group): found[group] for group in order}
    disagreeing = [group for group in order if found[group] < REJECTED]
    return Agreement(
        float(probability),
        scores,
        ranked,
        tuple(sentences(features, disagreeing, scores, observed, predicted)),
    )


def _distances(others: Array, mine: Array, reference: Array | None) -> tuple[Array, float]:
    """Squared distances of predictions and of the trace from the median of the predictions.

    Without a reference the covariance is that of the predictions, but for each prediction without
    itself: it would be nearer to the others than the trace, which is not one of them.
    """
    covariance = np.cov((others if reference is None else reference).T).reshape(len(mine), -1)
    # Regularized, for summaries that hardly vary in simulations.
    covariance += RIDGE * np.mean(np.diag(covariance)) * np.eye(len(mine))
    inverse = np.linalg.inv(covariance)
    own = np.einsum("ij,jk,ik->i", others, inverse, others)
    if reference is None:
        count = len(others)
        away = others - others.mean(axis=0)
        # Each prediction's part of the covariance is taken out (Sherman & Morrison 1950).
        part = count / (count - 1) ** 2
        leverage = part * np.einsum("ij,jk,ik->i", away, inverse, away)
        along = np.einsum("ij,jk,ik->i", others, inverse, away)
        own += part * along**2 / np.maximum(1 - leverage, MIN_REMAINDER)
    return own, float(mine @ inverse @ mine)


def _unusual(distance: Array, limit: Array) -> Array:
    """Logarithm of distances over the farthest of the others, at least 0."""
    return np.asarray(np.log(np.maximum(distance, 1e-300) / np.maximum(limit, 1e-300)).clip(0))


def shrinkage(draws: Array) -> Array:
    """Shrinkage from prior to posterior, 1 less the ratio of standard deviations, by draws on the
    unit cube, shape (draws, parameters)."""
    return np.asarray(np.clip(1 - draws.std(axis=0) / PRIOR_DEVIATION, 0, 1))


def information(
    features: Sequence[Feature],
    parameters: Array,
    summaries: Array,
    observed: Array,
) -> dict[str, Array]:
    """Share of the variance of each parameter over simulations near the posterior that each group
    of summaries predicts."""
    result = {}
    for group in dict.fromkeys(one.group for one in features):
        inside = np.array([one.group == group for one in features])
        masked = np.where(inside, observed, np.nan)
        if not np.isfinite(masked).any():
            continue
        statistics = project(summaries, parameters, masked)[1]
        unexplained = np.var(statistics - parameters, axis=0) / np.var(parameters, axis=0)
        result[group] = np.clip(1 - unexplained, 0, 1)
    return result


def needed_groups(prior: Prior, informed: dict[str, Array]) -> dict[str, tuple[str, ...]]:
    """The groups of summaries that each parameter follows from, by the result of `information`, the
    most informative first."""
    found = {}
    for index, one in enumerate(prior.free):
        parts = {group: float(values[index]) for group, values in informed.items()}
        limit = SHARE * max(parts.values(), default=0.0)
        groups = [group for group, part in parts.items() if part >= limit > 0]
        found[one.key] = tuple(sorted(groups, key=lambda group: -parts[group])[:MAX_NEEDED])
    return found


def warnings(
    prior: Prior,
    draws: Array,
    agreement: Agreement,
    r_hat: Array,
    needs: dict[str, tuple[str, ...]],
) -> Iterator[str]:
    """Warnings about the parameters of a fit; ``needs`` is the result of `needed_groups`."""
    if agreement.is_rejected:
        reasons = "; ".join(agreement.sentences)
        yield (
            "no parameters in the ranges describe the trace "
            f"(p = {agreement.probability:.2g}). In the model {reasons}"
        )
    shrunk = shrinkage(draws)
    for one, part in zip(prior.free, shrunk, strict=True):
        needed = needs.get(one.key, ())
        wrong = [group for group in needed if group in agreement.disagreeing]
        if wrong and agreement.is_rejected and part >= UNDETERMINED:
            yield (
                f"{one.key} follows from {' and '.join(needed)}; of these the model does not "
                f"describe {' and '.join(wrong)}, so its interval cannot be relied on"
            )
    yield from draw_warnings(prior, draws)
    if np.max(r_hat) > MAX_R_HAT:
        yield f"the chains do not agree (R-hat {np.max(r_hat):.2f}): increase fit.simulations"


def draw_warnings(
    prior: Prior, draws: Array, advice: str = ": widen fit.free.{}.{}"
) -> Iterator[str]:
    """Warnings by draws on the unit cube, shape (draws, parameters); the advice has places for the
    key and "from" or "to"."""
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
                yield f"{one.key} lies at the end of its range{advice.format(one.key, name)}"
    correlation = np.corrcoef(draws.T).reshape(len(prior), -1)
    for first in range(len(prior)):
        for second in range(first + 1, len(prior)):
            value = correlation[first, second]
            if abs(value) > MAX_CORRELATION:
                yield (
                    f"{prior.free[first].key} and {prior.free[second].key} are only determined "
                    f"together (correlation {value:+.2f})"
                )
