"""Disagreements of a model with a trace in words, with numbers and units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mesoslip.array_types import Array
from mesoslip.inference.features import Feature
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
