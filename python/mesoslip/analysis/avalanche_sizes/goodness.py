"""Goodness of fit: distances of sizes from the law fitted to them, and their probability."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy

from mesoslip.analysis.avalanche_sizes.laws import Law, likeliest_law, uncut_law
from mesoslip.analysis.avalanche_sizes.sums import sum_rule
from mesoslip.analysis.avalanche_sizes.tally import Tally
from mesoslip.array_types import Array

# Bins of chi-squared in a factor of ten, and minimum expected number of sizes in each.
BINS = 10
MIN_EXPECTED = 10.0
# Maximum number of sizes in a test.
MAX_TESTED = 1_000_000
# Relative steps of tables of cumulative probabilities: of misfits, which have all sizes too, and of
# synthetic sizes, which are uniform within a step.
MISFIT_STEP = 0.05
TABLE_STEP = 0.002


class Misfit(NamedTuple):
    """Distances of sizes from a law."""

    distance: float
    """Kolmogorov-Smirnov distance."""
    chi_squared: float
    """χ² of the sizes in logarithmic bins, which weighs tails more than the distance does."""
    agreement: float
    """Probability of a larger χ²; 1 if there are too few bins to test."""


def _offsets(last: float, ratio: float) -> Array:
    """Integers from 0 to a last one, in steps of 1 or of a ratio."""
    number = math.ceil(math.log(last + 1) / ratio) + 1
    return np.unique(np.rint(np.geomspace(1.0, last + 1, number))) - 1


def misfit(law: Law, tally: Tally) -> Misfit:
    """Distances of sizes from the law fitted to them."""
    points = np.union1d(
        tally.sizes, law.min_size + _offsets(tally.sizes[-1] - law.min_size, MISFIT_STEP)
    )
    cumulative = np.cumsum(law.masses(points))
    below = cumulative[np.searchsorted(points, tally.sizes)]
    part = tally.counts / tally.total
    observed = np.cumsum(part)
    difference = below - observed
    # The distance just before each size.
    before = difference - np.exp(law.log_probability(tally.sizes)) + part
    distance = float(max(np.max(np.abs(difference)), np.max(np.abs(before))))

    decades = math.log10(points[-1] / law.min_size)
    ends = law.min_size * 10 ** (np.arange(1, math.ceil(decades * BINS) + 1) / BINS)
    last = np.unique(np.searchsorted(points, ends, side="right") - 1)
    bins = np.concatenate([[0.0], np.minimum(cumulative[last], 1.0), [1.0]]) * tally.total
    rows = np.searchsorted(tally.sizes, points[last], side="right")
    counts = np.concatenate([[0.0], np.concatenate([[0.0], observed])[rows], [1.0]]) * tally.total
    # Bins are joined until enough sizes are expected in each; the last takes up the remainder.
    ends_kept = [0]
    for end in range(1, len(bins)):
        enough = bins[end] - bins[ends_kept[-1]] >= MIN_EXPECTED
        if enough and bins[-1] - bins[end] >= MIN_EXPECTED:
            ends_kept.append(end)
    ends_kept.append(len(bins) - 1)
    expected = np.diff(bins[ends_kept])
    chi_squared = float(np.sum((np.diff(counts[ends_kept]) - expected) ** 2 / expected))
    freedom = len(expected) - 1 - len(law.parameters)
    agreement = float(scipy.special.chdtrc(freedom, chi_squared)) if freedom > 0 else 1.0
    return Misfit(distance, chi_squared, agreement)


class Source:
    """Synthetic sizes of a law."""

    def __init__(self, law: Law) -> None:
        rule = sum_rule(law.min_size, law.max_size)
        offsets = _offsets(rule.last, TABLE_STEP)
        self._last = law.min_size + offsets
        self._first = np.concatenate([self._last[:1], self._last[:-1] + 1])
        masses = law.masses(self._last)
        self._probability = masses / np.sum(masses)

    def draw(self, count: int, generator: np.random.Generator) -> Tally:
        """A number of independent sizes."""
        cell = generator.multinomial(count, self._probability)
        is_wide = self._last > self._first
        first, width = (
            np.repeat(one[is_wide], cell[is_wide])
            for one in (self._first, self._last - self._first + 1)
        )
        wide, wide_counts = np.unique(
            first + np.floor(generator.random(len(first)) * width), return_counts=True
        )
        sizes = np.concatenate([self._first[~is_wide], wide])
        counts = np.concatenate([cell[~is_wide], wide_counts])
        order = np.argsort(sizes)
        order = order[counts[order] > 0]
        return Tally(sizes[order], counts[order])


def p_value(tally: Tally, law: Law, replicas: int, generator: np.random.Generator) -> float:
    """Share of samples that fit as badly as the sizes or worse, by the worse of their ranks by
    distance and by χ²."""

    def misfit_of(sample: Tally) -> Misfit:
        # The tail of very steep laws may be too short for a fit; then any law fits.
        if sample.is_degenerate:
            return Misfit(0.0, 0.0, 1.0)
        pure = uncut_law(sample, law.min_size, law.max_size)
        return misfit(likeliest_law(law.fitted_form, sample, pure) or pure, sample)

    source = Source(law)
    samples = [tally, *(source.draw(tally.total, generator) for _ in range(replicas))]
    misfits = np.array([misfit_of(one)[:2] for one in samples])
    as_far = np.sum(misfits[:, None, :] <= misfits[None, :, :], axis=1)
    rank = np.min(as_far, axis=1)
    return float(np.mean(rank <= rank[0]))
