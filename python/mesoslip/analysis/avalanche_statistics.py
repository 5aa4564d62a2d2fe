"""Statistics of avalanche sizes: histograms, power laws with an exponential cutoff, other laws.

The law is p(s) = s^-τ exp(-s/s_c)/Z for integers s from ``smallest`` to ``largest``. It is fitted
here and not by the library ``powerlaw``, whose distances of a discrete law with a cutoff are those
of a continuous one, and which gives neither errors of such a law nor its goodness of fit.

How the least size is chosen, and that the errors cover then, was measured: see
``tests/studies/exponent_coverage.py`` and what it recorded in ``docs/exponents.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import ArrayLike, NDArray

from mesoslip.errors import MesoslipError

Array = NDArray[np.float64]

# Fewest sizes, and fewest different ones, of which a law is fitted.
FEWEST_SIZES = 10
FEWEST_DIFFERENT = 3
# A cutoff is resolved if a pure law is less likely than this to look as much cut.
RESOLVED = 0.01
# A fit is rejected if sizes of its law are less likely than this to fit as badly.
REJECTED = 0.05

# A law may begin where its leading correction is within so many standard errors of none, and where
# sizes in bins agree with it at this level: stricter ones go on for the noise of the largest sizes.
CORRECTION = 2.0
AGREEMENT = 0.01
# It is fitted from so many times that size: what was too small to be seen there biases the exponent
# by less than its error here.
BEYOND = 6
# A least size that is chosen leaves at least this number of sizes, and this ratio of sizes.
LEAST_LEFT = 50
LEAST_RANGE = 10
# Bins of the goodness of fit: in a factor of ten, and sizes expected in each at least.
BINS = 10
LEAST_EXPECTED = 10.0
# Sizes that the goodness of fit is tested with at most.
TEST_SIZES = 1_000_000

# Integers that are summed one by one, and nodes of longer blocks.
DIRECT = 16
NODES = 12
# Doublings of blocks, up to 2^53; exp(-s/s_c) is negligible there for 1/s_c above the least rate.
DOUBLINGS = 49
LEAST_RATE = 2.0**-47
# Sums of laws that rise more steeply before they fall would need more nodes.
LEAST_EXPONENT = -20.0
# Newton's steps, of which some ten are needed.
MOST_STEPS = 200
# Relative steps of tables of cumulative probabilities: of misfits, where any size is added to
# them, and of synthetic sizes, which are uniform between two of them.
MISFIT_STEP = 0.05
TABLE_STEP = 0.002
# Powers of the size in stretched exponentials, and least sigma of lognormal laws: sums over steeper
# ones would need more nodes.
POWERS = (1e-3, 3.0)
LEAST_SIGMA = 0.1
# Two laws differ if the logarithm of their ratio varies more than this.
LEAST_DIFFERENCE = 1e-12


@dataclass(frozen=True)
class LogarithmicBins:
    """A histogram of sizes; all arrays have dimension ``bin``, and no bin is empty."""

    centre: Array
    """Geometric mean of the first and the last integer."""
    edges: Array
    """Lower and upper edge, half-integers; shape (bin, 2)."""
    count: NDArray[np.int64]
    density: Array
    """Probability of one size: part of the sizes that are here, over the integers here."""
    density_error: Array
    """Standard error of the density if sizes are independent: it over the root of the count."""


@dataclass(frozen=True)
class PowerLawFit:
    """The likeliest p(s) = s^-τ exp(-s/s_c)/Z of sizes s between two limits."""

    exponent: float
    """τ."""
    exponent_error: float
    """Its standard error, with the cutoff as uncertain as it is."""
    cutoff: float
    """s_c; infinite if the likeliest law has none. See `cutoff_is_resolved`."""
    cutoff_error: float
    """Its standard error; infinite if the cutoff is."""
    smallest: int
    """Smallest size of the law."""
    largest: int | None
    """Largest size of the law; None if there is none."""
    count: int
    """Sizes between the limits."""
    log_likelihood: float
    """Natural logarithm of their probability."""
    distance: float
    """Kolmogorov-Smirnov distance: greatest difference of the cumulative distributions."""
    p_value: float
    """Probability that sizes of such a law fit as badly; NaN if not tested."""
    tested: int
    """Sizes that this was tested with; 0 if not tested."""
    cutoff_significance: float
    """Probability that a pure power law looks as much cut as the sizes."""
    pure_exponent: float
    """τ of the likeliest law without a cutoff."""
    pure_exponent_error: float
    """Its standard error if there is no cutoff."""

    @property
    def cutoff_is_resolved(self) -> bool:
        """Whether the sizes tell that there is a cutoff."""
        return self.cutoff_significance < RESOLVED

    @property
    def is_rejected(self) -> bool:
        """Whether the sizes are not of such a law; its numbers mean nothing then."""
        return self.p_value < REJECTED


@dataclass(frozen=True)
class LawComparison:
    """Another law of the sizes against the power law with a cutoff, from the same size on."""

    law: str
    """Its name."""
    parameters: dict[str, float]
    """The likeliest ones, by name."""
    log_likelihood_ratio: float
    """Natural logarithm of the sizes' probability under the power law with a cutoff over that under
    this one: positive if the power law with a cutoff is likelier."""
    p_value: float
    """Probability of a ratio as far from 0 if both laws were as good; for the pure power law, which
    is one without cutoff, of such a ratio if it were right."""


class _Tally(NamedTuple):
    """The different sizes, ascending, and how often each occurs."""

    sizes: Array
    counts: NDArray[np.int64]

    def between(self, smallest: float, largest: float | None) -> _Tally:
        first = np.searchsorted(self.sizes, smallest)
        last = np.searchsorted(self.sizes, math.inf if largest is None else largest, side="right")
        return _Tally(self.sizes[first:last], self.counts[first:last])

    @property
    def total(self) -> int:
        return int(np.sum(self.counts))

    @property
    def is_degenerate(self) -> bool:
        return self.total < FEWEST_SIZES or len(self.sizes) < FEWEST_DIFFERENT


def _tally(sizes: ArrayLike) -> _Tally:
    array = np.asarray(sizes).ravel()
    if not array.size:
        return _Tally(np.empty(0), np.empty(0, dtype=np.int64))
    whole = np.issubdtype(array.dtype, np.integer) or bool(np.all(array == np.rint(array)))
    if not whole or not 1 <= np.min(array) <= np.max(array) < 2**53:
        raise MesoslipError("sizes of avalanches are not positive integers below 2^53")
    array = array.astype(np.int64, copy=False)
    if np.max(array) <= 4 * array.size:
        # No need to sort them.
        counts = np.bincount(array)
        different = np.flatnonzero(counts)
        return _Tally(different.astype(float), counts[different])
    different, counts = np.unique(array, return_counts=True)
    return _Tally(different.astype(float), counts)


def logarithmic_bins(sizes: ArrayLike, per_decade: int = 10) -> LogarithmicBins:
    """The histogram of sizes in bins of equal logarithmic width, as far as integers allow.

    The edges do not depend on the sizes; bins without any are left out.

    Parameters
    ----------
    sizes
        Positive integers, of any shape.
    per_decade
        Bins in a factor of ten, where they are wider than an integer.

    Raises
    ------
    MesoslipError
        If a size is not a positive integer, or too large for a float to hold it exactly.
    """
    different, counts = _tally(sizes)
    if not len(different):
        empty = np.empty(0)
        return LogarithmicBins(empty, np.empty((0, 2)), np.empty(0, dtype=np.int64), empty, empty)
    decades = math.log10(different[-1])
    number = np.arange(math.floor(decades * per_decade) + 2)
    last = np.unique(np.rint(10 ** (number / per_decade)))
    first = np.concatenate([[1.0], last[:-1] + 1])
    count = np.zeros(len(last), dtype=np.int64)
    np.add.at(count, np.searchsorted(last, different), counts)
    full = count > 0
    first, last, count = first[full], last[full], count[full]
    density = count / (np.sum(count) * (last - first + 1))
    edges = np.stack([first - 0.5, last + 0.5], axis=1)
    return LogarithmicBins(np.sqrt(first * last), edges, count, density, density / np.sqrt(count))


def ccdf(sizes: ArrayLike) -> tuple[NDArray[np.int64], Array]:
    """The different sizes s, ascending, and the part of the sizes that are not smaller, P(S ≥ s).

    Raises
    ------
    MesoslipError
        If a size is not a positive integer, or too large for a float to hold it exactly.
    """
    different, counts = _tally(sizes)
    not_smaller = np.cumsum(counts[::-1])[::-1]
    return different.astype(np.int64), not_smaller / np.sum(counts)


@lru_cache
def _block(length: int) -> tuple[Array, Array]:
    """Nodes and weights of a sum over the integers from 0 below a length.

    Gauss's rule of the polynomials that are orthogonal on these integers: exact for polynomials of
    degree 2 NODES - 1.
    """
    if length <= DIRECT:
        return np.arange(length, dtype=np.float64), np.ones(length)
    k = np.arange(1.0, NODES)
    beside = np.sqrt(k**2 * (float(length) ** 2 - k**2) / (4 * (4 * k**2 - 1)))
    node, vectors = scipy.linalg.eigh_tridiagonal(np.zeros(NODES), beside)
    return node + (length - 1) / 2, length * vectors[0] ** 2


@dataclass(frozen=True)
class _Rule:
    """Nodes and weights of sums of smooth functions of the sizes between two limits."""

    smallest: int
    log_ratio: Array
    """ln(s/smallest) at the nodes."""
    offset: Array
    """s - smallest."""
    log_weight: Array
    products: Array
    """Of the two, to the second degree; shape (5, node)."""
    last: float
    """The last offset of the sum."""
    is_open: bool
    """Whether sizes go on beyond it."""


@lru_cache
def _rule(smallest: int, largest: int | None) -> _Rule:
    """The rule of all sizes from the smallest to the largest.

    Blocks start at offsets that double: so s^-τ varies as little in all of them, and exp(-s/s_c)
    varies much only where it is small.
    """
    total = DIRECT << DOUBLINGS
    if largest is not None:
        total = min(total, largest - smallest + 1)
    offsets, weights = [], []
    start, length = 0, DIRECT
    while start < total:
        node, weight = _block(min(length, total - start))
        offsets.append(start + node)
        weights.append(weight)
        start += length
        length = start
    offset = np.concatenate(offsets)
    log_ratio = np.log1p(offset / smallest)
    products = [log_ratio, offset, log_ratio**2, log_ratio * offset, offset**2]
    return _Rule(
        smallest,
        log_ratio,
        offset,
        np.log(np.concatenate(weights)),
        np.array(products),
        total - 1.0,
        largest is None,
    )


class _Moments(NamedTuple):
    """Of r = ln(s/smallest) and the offset x = s - smallest under a law."""

    log_norm: float
    """Logarithm of the sum of exp(-τ r - x/s_c)."""
    log_mean: float
    mean: float
    log_variance: float
    covariance: float
    variance: float


def _moments(rule: _Rule, exponent: float, rate: float) -> _Moments:
    """The moments; of a pure law without a largest size, no use is made of the last two."""
    height = rule.log_weight - exponent * rule.log_ratio - rate * rule.offset
    peak = float(np.max(height))
    part = np.exp(height - peak)
    norm = float(np.sum(part))
    r, x, rr, rx, xx = (float(one) for one in rule.products @ part)
    if rate == 0 and rule.is_open:
        # The integral over what is beyond; there is no mean unless τ > 2.
        end = 1 + (rule.last + 0.5) / rule.smallest
        edge, scale = math.log(end), 1 / (exponent - 1)
        rest = rule.smallest * math.exp(-edge / scale - peak) * scale
        norm += rest
        r += rest * (edge + scale)
        rr += rest * (edge**2 + 2 * edge * scale + 2 * scale**2)
        if exponent > 2:
            x += rule.smallest * rest * (end * (exponent - 1) / (exponent - 2) - 1)
        else:
            x = math.inf
    r, x = r / norm, x / norm
    return _Moments(
        peak + math.log(norm), r, x, rr / norm - r**2, rx / norm - r * x, xx / norm - x**2
    )


@dataclass(frozen=True)
class _Law:
    smallest: int
    largest: int | None
    exponent: float
    rate: float
    """1/s_c."""
    moments: _Moments

    def log_probability(self, sizes: Array) -> Array:
        offset = sizes - self.smallest
        logarithm: Array = -self.exponent * np.log1p(offset / self.smallest) - self.rate * offset
        return logarithm - self.moments.log_norm

    def masses(self, sizes: Array) -> Array:
        """The probability of all sizes above the one before, or from the smallest, up to each."""
        before = np.concatenate([[self.smallest - 1.0], sizes[:-1]])
        length = sizes - before
        # The rule of a block with two nodes.
        half = np.sqrt((length**2 - 1) / 12)
        centre = (before + sizes + 1) / 2
        ends = np.exp(self.log_probability(np.stack([centre - half, centre + half])))
        mass: Array = length * np.mean(ends, axis=0)
        return mass


def _offsets(last: float, ratio: float) -> Array:
    """Integers from 0 to a last one in steps of 1 or of a part of the integer, if that is more."""
    number = math.ceil(math.log(last + 1) / ratio) + 1
    return np.unique(np.rint(np.geomspace(1.0, last + 1, number))) - 1


def _pure_law(rule: _Rule, largest: int | None, log_mean: float) -> _Law:
    """The likeliest law without a cutoff."""

    def excess(exponent: float) -> float:
        return _moments(rule, exponent, 0.0).log_mean - log_mean

    # Without a largest size there is no law unless τ > 1.
    low, high = 1.5, 2.0
    while excess(low) < 0 and low > LEAST_EXPONENT:
        low = (low + 1) / 2 if largest is None else max(2 * low - 2, LEAST_EXPONENT)
    while excess(high) > 0:
        high *= 2
    exponent = low
    if low > LEAST_EXPONENT:
        exponent = scipy.optimize.brentq(excess, low, high, xtol=1e-12)
    return _Law(rule.smallest, largest, exponent, 0.0, _moments(rule, exponent, 0.0))


def _cut_law(rule: _Rule, pure: _Law, log_mean: float, mean: float) -> _Law:
    """The likeliest law with a cutoff; the pure one if that is the likeliest, or nearly.

    So it is where sizes vary so little that s^-τ and exp(-s/s_c) are no different.

    The negative logarithm of the likelihood of one size, ln Z + τ ⟨r⟩ + ⟨x⟩/s_c, is convex in τ
    and 1/s_c: Newton's method with steps cut as long as it does not fall.
    """
    if pure.moments.mean <= mean:
        return pure
    exponent, rate = pure.exponent, 1 / (1 + mean)
    now = _moments(rule, exponent, rate)
    for _ in range(MOST_STEPS):
        slope, rate_slope = log_mean - now.log_mean, mean - now.mean
        determinant = now.log_variance * now.variance - now.covariance**2
        if determinant < 1e-12 * now.log_variance * now.variance:
            return pure
        rate_step = (now.covariance * slope - now.log_variance * rate_slope) / determinant
        # The best step that keeps 1/s_c positive.
        rate_step = max(rate_step, -0.9 * rate)
        step = -(slope + now.covariance * rate_step) / now.log_variance
        descent = -(step * slope + rate_step * rate_slope)
        part = 1.0
        is_last = descent < 1e-12 and rate_step > -0.9 * rate
        value = now.log_norm + exponent * log_mean + rate * mean
        while True:
            new_exponent, new_rate = exponent + part * step, rate + part * rate_step
            now = _moments(rule, new_exponent, new_rate)
            new_value = now.log_norm + new_exponent * log_mean + new_rate * mean
            if is_last or new_value <= value - 1e-4 * part * descent:
                break
            part /= 2
        exponent, rate = new_exponent, new_rate
        if rate < LEAST_RATE or exponent < LEAST_EXPONENT:
            return pure
        if is_last:
            break
    return _Law(rule.smallest, pure.largest, exponent, rate, now)


class _Misfit(NamedTuple):
    distance: float
    """Kolmogorov and Smirnov's."""
    chi_squared: float
    """Of the sizes in logarithmic bins: it weighs tails more than the distance does."""
    agreement: float
    """Probability of a larger one; 1 if there are too few bins to tell."""


class _Likeliest(NamedTuple):
    law: _Law
    log_likelihood: float
    pure: _Law
    significance: float
    misfit: _Misfit


def _likeliest(tally: _Tally, smallest: int, largest: int | None) -> _Likeliest:
    """The likeliest law of sizes between two limits.

    A cutoff that is not resolved stays: the exponent of a pure law is too large, and its error far
    too small, where there is a cutoff that the sizes do not tell.
    """
    count = tally.total
    part = tally.counts / count
    rule = _rule(smallest, largest)
    log_mean = float(part @ np.log(tally.sizes / smallest))
    mean = float(part @ (tally.sizes - smallest))
    pure = _pure_law(rule, largest, log_mean)
    law = _cut_law(rule, pure, log_mean, mean)

    def log_likelihood(law: _Law) -> float:
        return -count * (law.moments.log_norm + law.exponent * log_mean + law.rate * mean)

    # A cutoff can only be on one side of none: half of the samples of a pure law show one.
    ratio = 2 * (log_likelihood(law) - log_likelihood(pure))
    significance = math.erfc(math.sqrt(max(ratio, 0.0) / 2)) / 2 if law.rate > 0 else 1.0
    return _Likeliest(law, log_likelihood(law), pure, significance, _misfit(law, tally))


def _misfit(law: _Law, tally: _Tally) -> _Misfit:
    """How far sizes are from the law that was fitted to them."""
    points = np.union1d(
        tally.sizes, law.smallest + _offsets(tally.sizes[-1] - law.smallest, MISFIT_STEP)
    )
    cumulative = np.cumsum(law.masses(points))
    below = cumulative[np.searchsorted(points, tally.sizes)]
    part = tally.counts / tally.total
    observed = np.cumsum(part)
    difference = below - observed
    # Next, just before each size.
    before = difference - np.exp(law.log_probability(tally.sizes)) + part
    distance = float(max(np.max(np.abs(difference)), np.max(np.abs(before))))

    decades = math.log10(points[-1] / law.smallest)
    ends = law.smallest * 10 ** (np.arange(1, math.ceil(decades * BINS) + 1) / BINS)
    last = np.unique(np.searchsorted(points, ends, side="right") - 1)
    bins = np.concatenate([[0.0], np.minimum(cumulative[last], 1.0), [1.0]]) * tally.total
    rows = np.searchsorted(tally.sizes, points[last], side="right")
    counts = np.concatenate([[0.0], np.concatenate([[0.0], observed])[rows], [1.0]]) * tally.total
    # Bins are joined until enough is expected in each; what is left at the end joins the last.
    ends_kept = [0]
    for end in range(1, len(bins)):
        enough = bins[end] - bins[ends_kept[-1]] >= LEAST_EXPECTED
        if enough and bins[-1] - bins[end] >= LEAST_EXPECTED:
            ends_kept.append(end)
    ends_kept.append(len(bins) - 1)
    expected = np.diff(bins[ends_kept])
    chi_squared = float(np.sum((np.diff(counts[ends_kept]) - expected) ** 2 / expected))
    freedom = len(expected) - (3 if law.rate > 0 else 2)
    agreement = float(scipy.special.chdtrc(freedom, chi_squared)) if freedom > 0 else 1.0
    return _Misfit(distance, chi_squared, agreement)


def _correction(law: _Law, tally: _Tally) -> float:
    """The leading correction of the law, p(s) (1 + a/s), in standard errors of none.

    Rao's score test of a = 0: the mean of 1/s, as far as τ and s_c cannot make up for it.
    """
    rule = _rule(law.smallest, law.largest)
    moments = law.moments
    weight = np.exp(
        rule.log_weight - law.exponent * rule.log_ratio - law.rate * rule.offset - moments.log_norm
    )
    inverse = law.smallest / (law.smallest + rule.offset)
    mean = float(weight @ inverse)
    variance = float(weight @ inverse**2) - mean**2
    with_log = float(weight @ (inverse * rule.log_ratio)) - mean * moments.log_mean
    left = variance - with_log**2 / moments.log_variance
    if law.rate > 0:
        with_size = float(weight @ (inverse * rule.offset)) - mean * moments.mean
        slope = moments.covariance / moments.log_variance
        of_size = moments.variance - slope * moments.covariance
        left -= (with_size - slope * with_log) ** 2 / of_size
    if left <= 1e-9 * variance:
        return 0.0
    excess = float(tally.counts @ (law.smallest / tally.sizes)) / tally.total - mean
    return excess * math.sqrt(tally.total / left)


def _chosen(tally: _Tally, largest: int | None) -> _Likeliest:
    """The likeliest law from well beyond the size where none is seen to be wrong any more."""
    not_smaller = np.cumsum(tally.counts[::-1])[::-1]
    different = np.arange(len(tally.sizes), 0, -1)
    enough = (not_smaller >= LEAST_LEFT) & (different >= FEWEST_DIFFERENT)
    enough &= tally.sizes * LEAST_RANGE <= tally.sizes[-1]
    last = tally.sizes[enough][-1] if np.any(enough) else tally.sizes[0]
    grid = np.rint(10 ** (np.arange(math.floor(10 * math.log10(last)) + 1) / 10))
    grid = grid[(grid <= last) & (grid >= tally.sizes[0])]
    candidates = np.unique(
        np.concatenate([tally.sizes[:1], tally.sizes[np.searchsorted(tally.sizes, grid)]])
    )

    def fit(candidate: float) -> _Likeliest:
        return _likeliest(tally.between(candidate, None), int(candidate), largest)

    fits = []
    for candidate in candidates:
        one = fit(candidate)
        fits.append(one)
        correction = _correction(one.law, tally.between(candidate, None))
        if abs(correction) < CORRECTION and one.misfit.agreement >= AGREEMENT:
            start = np.searchsorted(candidates, BEYOND * candidate)
            return fit(candidates[min(start, len(candidates) - 1)])
    return min(fits, key=lambda one: one.misfit.distance)


class _Source:
    """Where synthetic sizes of a law come from."""

    def __init__(self, law: _Law) -> None:
        rule = _rule(law.smallest, law.largest)
        offsets = _offsets(rule.last, TABLE_STEP)
        self._last = law.smallest + offsets
        self._first = np.concatenate([self._last[:1], self._last[:-1] + 1])
        masses = law.masses(self._last)
        self._probability = masses / np.sum(masses)

    def draw(self, count: int, generator: np.random.Generator) -> _Tally:
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
        return _Tally(sizes[order], counts[order])


def _p_value(sample: _Tally, law: _Law, replicas: int, generator: np.random.Generator) -> float:
    """Part of synthetic samples, and the sizes, that fit as badly as the sizes do.

    How badly is the worse of the ranks of the distance and of chi-squared among all samples.
    """

    def misfit(sample: _Tally) -> _Misfit:
        # What is left of very steep laws may be too little for a fit, and is fitted by any.
        if sample.is_degenerate:
            return _Misfit(0.0, 0.0, 1.0)
        return _likeliest(sample, law.smallest, law.largest).misfit

    source = _Source(law)
    samples = [sample, *(source.draw(sample.total, generator) for _ in range(replicas))]
    misfits = np.array([misfit(one)[:2] for one in samples])
    as_far = np.sum(misfits[:, None, :] <= misfits[None, :, :], axis=1)
    rank = np.min(as_far, axis=1)
    return float(np.mean(rank <= rank[0]))


def fit_power_law(
    sizes: ArrayLike,
    smallest: int | None = None,
    largest: int | None = None,
    *,
    replicas: int = 200,
    seed: int = 0,
) -> PowerLawFit | None:
    """The likeliest power law with an exponential cutoff.

    The exponent of a geometric law is 0, and less than that of sizes that mostly grow more likely;
    it is sought above LEAST_EXPONENT. Errors are those of the observed information, and hold for
    independent sizes. Where ``smallest`` is chosen they hold too, as was measured: intervals of
    1.96 errors cover at 90 % and more for laws with corrections in powers of 1/s.

    The cutoff is always fitted with the exponent. It is resolved if its significance is below
    RESOLVED: twice the logarithm of the ratio of likelihoods with and without is zero for half of
    the samples of a pure law, since 1/s_c cannot be negative, and of one degree of freedom of χ²
    for the others. Pure laws with τ < 3 and no largest size have no variance, and pass for cut ones
    more often: twice as often for τ = 1.5.

    The goodness of fit goes by synthetic samples of the fitted law, each with a fit of its own
    [1]_, and by two misfits together: the Kolmogorov-Smirnov distance, and χ² of the sizes in
    logarithmic bins, which weighs tails more. Of more than TEST_SIZES sizes, only so
    many, chosen at random, are tested.

    Parameters
    ----------
    sizes
        Positive integers, of any shape.
    smallest
        Sizes below it are left out. None chooses: of ten in a decade, the first where a correction
        (1 + a/s) is within CORRECTION standard errors of none and the bins agree, times BEYOND, as
        far as LEAST_LEFT sizes and a ratio of LEAST_RANGE remain above. Where a law is first seen
        to fit it is about as wrong as its errors are wide; from BEYOND times that on it is wrong by
        much less. If none fits, the one of the least distance.
    largest
        Sizes above are left out, and the law ends here.
    replicas
        Synthetic samples of the test; none if 0.
    seed
        Of the generator of the test.

    Returns
    -------
    PowerLawFit or None
        None if there are fewer than FEWEST_SIZES sizes between the limits, or fewer than
        FEWEST_DIFFERENT different ones.

    Raises
    ------
    MesoslipError
        If a size or ``smallest`` is not a positive integer.

    References
    ----------
    .. [1] A. Clauset, C. R. Shalizi, M. E. J. Newman, "Power-law distributions in empirical data",
       SIAM Review 51, 661 (2009), doi:10.1137/070710111.
    """
    if smallest is not None and smallest < 1:
        raise MesoslipError("smallest size of a power law is not a positive integer")
    tally = _tally(sizes).between(smallest or 1, largest)
    if tally.is_degenerate:
        return None
    chosen = _chosen(tally, largest) if smallest is None else _likeliest(tally, smallest, largest)
    law, pure = chosen.law, chosen.pure
    fitted = tally.between(law.smallest, None)
    p_value, sample = math.nan, fitted
    if replicas:
        generator = np.random.default_rng(seed)
        if fitted.total > TEST_SIZES:
            counts = generator.multivariate_hypergeometric(
                fitted.counts, TEST_SIZES, method="marginals"
            )
            sample = _Tally(fitted.sizes[counts > 0], counts[counts > 0])
        p_value = _p_value(sample, law, replicas, generator)
    moments = law.moments
    information = moments.log_variance
    cutoff, cutoff_error = math.inf, math.inf
    if law.rate > 0:
        information -= moments.covariance**2 / moments.variance
        cutoff = 1 / law.rate
        of_rate = moments.variance - moments.covariance**2 / moments.log_variance
        cutoff_error = cutoff**2 / math.sqrt(fitted.total * of_rate)
    return PowerLawFit(
        exponent=law.exponent,
        exponent_error=1 / math.sqrt(fitted.total * information),
        cutoff=cutoff,
        cutoff_error=cutoff_error,
        smallest=law.smallest,
        largest=largest,
        count=fitted.total,
        log_likelihood=chosen.log_likelihood,
        distance=chosen.misfit.distance,
        p_value=p_value,
        tested=sample.total if replicas else 0,
        cutoff_significance=chosen.significance,
        pure_exponent=pure.exponent,
        pure_exponent_error=1 / math.sqrt(fitted.total * pure.moments.log_variance),
    )


def compare_laws(sizes: ArrayLike, fit: PowerLawFit) -> tuple[LawComparison, ...]:
    """Other laws of the sizes that a power law with a cutoff was fitted to, from its least size on.

    ``pure`` power law, p ~ s^-τ; ``lognormal``, p ~ exp(-(ln s - mu)²/(2 sigma²))/s; and
    ``stretched_exponential``, p ~ s^(power - 1) exp(-(s/scale)^power), with ``log_scale``, the
    logarithm of the scale, and a power within POWERS; sigma is at least LEAST_SIGMA. The first is
    the power law without a cutoff and is tested as that; the others by Vuong's ratio of likelihoods
    [1]_, two-sided, for independent sizes.

    Parameters
    ----------
    sizes
        Positive integers, of any shape: those of the fit.
    fit
        What `fit_power_law` found.

    Raises
    ------
    MesoslipError
        If a size is not a positive integer.

    References
    ----------
    .. [1] Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
       Econometrica 57, 307 (1989), doi:10.2307/1912557.
    """
    tally = _tally(sizes).between(fit.smallest, fit.largest)
    rule = _rule(fit.smallest, fit.largest)
    chosen = _likeliest(tally, fit.smallest, fit.largest)
    ratio = float(
        tally.counts
        @ (chosen.law.log_probability(tally.sizes) - chosen.pure.log_probability(tally.sizes))
    )
    found = [
        LawComparison(
            "pure", {"exponent": chosen.pure.exponent}, max(ratio, 0.0), chosen.significance
        )
    ]
    log_smallest = math.log(fit.smallest)

    def lognormal(r: Array, parameters: Array) -> Array:
        slope, curvature = parameters
        logarithm: Array = -slope * r - curvature * r**2
        return logarithm

    def stretched(r: Array, parameters: Array) -> Array:
        power, decay = parameters
        # As the power goes to 0 this goes to a power law, of exponent 1 + decay.
        logarithm: Array = (power - 1) * r - decay * np.expm1(power * r) / power
        return logarithm

    # Starts: nearly the pure law, and a law with its middle at the sizes.
    part = tally.counts / tally.total
    r = np.log(tally.sizes / fit.smallest)
    centre = float(part @ r)
    spread = max(math.sqrt(float(part @ (r - centre) ** 2)), LEAST_SIGMA)
    bend = 1 / (2 * spread**2)
    slope, curvature = _likeliest_parameters(
        tally,
        rule,
        lognormal,
        [[chosen.pure.exponent, 0.01], [-2 * bend * centre, bend]],
        [(min(-r[-1] / LEAST_SIGMA**2, LEAST_EXPONENT), None), (1e-9, 1 / (2 * LEAST_SIGMA**2))],
    )
    found.append(
        _vuong(
            "lognormal",
            {
                "mu": (1 - slope) / (2 * curvature) + log_smallest,
                "sigma": 1 / math.sqrt(2 * curvature),
            },
            tally,
            rule,
            chosen.law,
            lambda r: lognormal(r, np.array([slope, curvature])),
        )
    )
    power, decay = _likeliest_parameters(
        tally,
        rule,
        stretched,
        [[0.3, max(chosen.pure.exponent - 1, 0.1)], [1.0, max(math.exp(-centre), 1e-12)]],
        [POWERS, (1e-12, None)],
    )
    found.append(
        _vuong(
            "stretched_exponential",
            {
                "power": power,
                "log_scale": log_smallest + math.log(power / decay) / power,
            },
            tally,
            rule,
            chosen.law,
            lambda r: stretched(r, np.array([power, decay])),
        )
    )
    return tuple(found)


def _log_norm(rule: _Rule, height: Array) -> float:
    return float(scipy.special.logsumexp(rule.log_weight + height))


def _likeliest_parameters(
    tally: _Tally,
    rule: _Rule,
    logarithm: Callable[[Array, Array], Array],
    starts: list[list[float]],
    bounds: list[tuple[float | None, float | None]],
) -> tuple[float, float]:
    """The two parameters of the likeliest law of ln(s/smallest), within bounds."""
    r, part = np.log(tally.sizes / rule.smallest), tally.counts / tally.total

    def cost(parameters: Array) -> float:
        height = logarithm(rule.log_ratio, parameters)
        return _log_norm(rule, height) - float(part @ logarithm(r, parameters))

    found = [
        scipy.optimize.minimize(
            cost,
            start,
            bounds=bounds,
            method="Nelder-Mead",
            options={"xatol": 1e-7, "fatol": 1e-12, "maxiter": 2000, "maxfev": 2000},
        )
        for start in starts
    ]
    best = min(found, key=lambda one: one.fun)
    first, second = best.x
    return float(first), float(second)


def _vuong(
    name: str,
    parameters: dict[str, float],
    tally: _Tally,
    rule: _Rule,
    law: _Law,
    logarithm: Callable[[Array], Array],
) -> LawComparison:
    """Vuong's comparison of a law with the power law with a cutoff."""
    other = logarithm(np.log(tally.sizes / rule.smallest))
    other -= _log_norm(rule, logarithm(rule.log_ratio))
    difference = law.log_probability(tally.sizes) - other
    part = tally.counts / tally.total
    mean = float(part @ difference)
    deviation = math.sqrt(float(part @ (difference - mean) ** 2))
    p_value = 1.0
    if deviation > LEAST_DIFFERENCE:
        p_value = math.erfc(abs(mean) / deviation * math.sqrt(tally.total / 2))
    return LawComparison(name, parameters, tally.total * mean, p_value)
