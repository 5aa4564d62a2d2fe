"""Power laws of avalanche sizes: exponents averaged over the forms of a law, and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mesoslip.analysis.avalanche_sizes.goodness import MAX_TESTED, Misfit, misfit, p_value
from mesoslip.analysis.avalanche_sizes.laws import (
    FORMS,
    Form,
    Law,
    likeliest_law,
    log_likelihood,
    log_posterior,
    uncut_law,
)
from mesoslip.analysis.avalanche_sizes.tally import MIN_DIFFERENT, Tally, tally_of
from mesoslip.array_types import Array
from mesoslip.errors import MesoslipError

# Significance below which a cutoff is resolved, and p-value below which a fit is rejected.
RESOLVED = 0.01
REJECTED = 0.05

# Minimum agreement of sizes in bins with the best form, from which on a law may begin: a stricter
# test would exclude sizes for the noise of the largest ones.
AGREEMENT = 0.01
# Multiple of that size from which the law is fitted: a deviation too small to be detected there
# biases the exponent by less than its error here.
BEYOND = 6
# Minimum number of sizes above a chosen minimum size, and minimum ratio of the largest to it.
MIN_ABOVE = 50
MIN_RANGE = 10


class FittedForm(NamedTuple):
    """The likeliest law of one form."""

    form: Form
    """Its cutoff shape is 0 if the likeliest law has no cutoff."""
    exponent: float
    exponent_error: float
    """Standard error if the law has this form."""
    cutoff: float
    """s_c; infinite without a cutoff."""
    correction: float
    """Amplitude a of the correction; 0 without one."""
    weight: float
    """Akaike weight among the forms."""

    def relative_probability(self, sizes: Array) -> Array:
        """Probability of sizes, of any shape, up to a constant factor."""
        probability: Array = sizes**-self.exponent
        if self.form.cutoff_shape:
            probability = probability * np.exp(-((sizes / self.cutoff) ** self.form.cutoff_shape))
        if self.form.correction_power:
            probability = probability * np.exp(self.correction * sizes**-self.form.correction_power)
        return probability


@dataclass(frozen=True)
class PowerLawFit:
    """Power law of sizes s between two limits."""

    exponent: float
    """τ, averaged over the forms of the law."""
    exponent_error: float
    """Its standard error, with the uncertainty of the form."""
    form: Form
    """The best form. The following values belong to it."""
    cutoff: float
    """s_c; infinite if the likeliest law has none."""
    cutoff_error: float
    """Its standard error; infinite if the cutoff is."""
    min_size: int
    """Minimum size of the law."""
    max_size: int | None
    """Maximum size of the law, if any."""
    count: int
    """Number of sizes between the limits."""
    log_likelihood: float
    """Natural logarithm of their probability."""
    distance: float
    """Kolmogorov-Smirnov distance: maximum difference of the cumulative distributions."""
    p_value: float
    """Probability that sizes of such a law fit as badly; NaN if not tested."""
    tested: int
    """Number of tested sizes."""
    cutoff_significance: float
    """Probability that a law without cutoff looks as much cut as the sizes."""
    pure_exponent: float
    """τ of the likeliest law without cutoff and correction."""
    pure_exponent_error: float
    """Its standard error if that is the law."""
    forms: tuple[FittedForm, ...]
    """All averaged forms, the best first."""

    @property
    def cutoff_is_resolved(self) -> bool:
        """Whether the sizes show a cutoff."""
        return self.cutoff_significance < RESOLVED

    @property
    def is_rejected(self) -> bool:
        """Whether the sizes do not follow such a law; then its exponent and cutoff are void."""
        return self.p_value < REJECTED


@dataclass(frozen=True)
class LocalExponent:
    """Exponent of the pure power law that is nearest to the sizes in a window."""

    min_size: int
    max_size: int
    count: int
    """Sizes in the window."""
    exponent: float
    exponent_error: float
    """Standard error for independent sizes."""


class _Candidate(NamedTuple):
    """Laws of all forms fitted to the same sizes, the best first, and their Akaike weights."""

    pure: Law
    laws: tuple[Law, ...]
    weights: tuple[float, ...]

    @property
    def best(self) -> Law:
        return self.laws[0]


def _candidate(
    tally: Tally, min_size: int, max_size: int | None, forms: tuple[Form, ...]
) -> _Candidate:
    """The likeliest law of each form, and their Akaike weights.

    A cutoff that is not resolved is kept: without it, the exponent would be too large and its error
    far too small if there is a cutoff that the sizes do not show.
    """
    pure = uncut_law(tally, min_size, max_size)
    fitted: dict[Form, Law] = {}
    for form in forms:
        law = likeliest_law(form, tally, pure)
        if law is not None:
            fitted.setdefault(law.form, law)
    laws = list(fitted.values()) or [pure]
    gain = np.array([log_posterior(law, tally) - len(law.parameters) for law in laws])
    weights = np.exp(gain - np.max(gain))
    weights /= np.sum(weights)
    order = np.argsort(-weights, kind="stable")
    return _Candidate(
        pure, tuple(laws[one] for one in order), tuple(float(weights[one]) for one in order)
    )


def _chosen(tally: Tally, max_size: int | None, forms: tuple[Form, ...]) -> int:
    """The minimum size: well beyond the first one from which the best form agrees."""
    not_smaller = np.cumsum(tally.counts[::-1])[::-1]
    different = np.arange(len(tally.sizes), 0, -1)
    enough = (not_smaller >= MIN_ABOVE) & (different >= MIN_DIFFERENT)
    enough &= tally.sizes * MIN_RANGE <= tally.sizes[-1]
    last = tally.sizes[enough][-1] if np.any(enough) else tally.sizes[0]
    grid = np.rint(10 ** (np.arange(math.floor(10 * math.log10(last)) + 1) / 10))
    grid = grid[(grid <= last) & (grid >= tally.sizes[0])]
    sizes = np.unique(
        np.concatenate([tally.sizes[:1], tally.sizes[np.searchsorted(tally.sizes, grid)]])
    )
    misfits: list[Misfit] = []
    for size in sizes:
        above = tally.between(size, None)
        misfits.append(misfit(_candidate(above, int(size), max_size, forms).best, above))
        if misfits[-1].agreement >= AGREEMENT:
            start = np.searchsorted(sizes, BEYOND * size)
            return int(sizes[min(start, len(sizes) - 1)])
    return int(sizes[np.argmin([one.distance for one in misfits])])


def fit_power_law(
    sizes: ArrayLike,
    min_size: int | None = None,
    max_size: int | None = None,
    *,
    forms: tuple[Form, ...] = FORMS,
    replicas: int = 200,
    seed: int = 0,
) -> PowerLawFit | None:
    """The power law of sizes: p(s) = s^-τ exp(-(s/s_c)^c) exp(a s^-b)/Z.

    The form of the cutoff, and of a correction to the law of small sizes, is not known, and the
    exponent depends on it. So the exponent is averaged by Akaike's weights over the forms:
    exponential and Gaussian cutoffs, without a correction or with one that decays as s^(-1/2) or
    1/s. Its variance is the mean of those of the forms plus the variance among them [2]_. The
    amplitude a has a normal prior of width CORRECTION_WIDTH.

    The exponent of a geometric law is 0, and negative for sizes whose probability mostly increases;
    its minimum is MIN_EXPONENT. Errors are those of the observed information, and hold for
    independent sizes.

    A cutoff is always part of a form. It is resolved if its significance is below RESOLVED: twice
    the logarithm of the ratio of likelihoods with and without is zero for half of the samples of an
    uncut law, since 1/s_c cannot be negative, and χ² with one degree of freedom for the others.
    Uncut laws with τ < 3 and no maximum size have no variance, and are taken for cut ones more
    often: twice as often for τ = 1.5.

    The goodness of fit of the best form is tested by synthetic samples, each with a fit of its own
    [1]_, and by two misfits together: the Kolmogorov-Smirnov distance, and χ² of the sizes in
    logarithmic bins, which weighs tails more. At most MAX_TESTED sizes, chosen at random, are
    tested.

    By default sizes are left out below the first, of ten in a decade, from which the sizes in bins
    agree with the best form, times BEYOND, as far as MIN_ABOVE sizes and a ratio of MIN_RANGE
    remain above. If no form agrees, it is the one of the minimum distance. The law ends at a
    maximum size that is given. None if there are fewer than MIN_COUNT sizes between the limits, or
    fewer than MIN_DIFFERENT different ones.

    References
    ----------
    .. [1] A. Clauset, C. R. Shalizi, M. E. J. Newman, "Power-law distributions in empirical data",
       SIAM Review 51, 661 (2009), doi:10.1137/070710111.
    .. [2] S. T. Buckland, K. P. Burnham, N. H. Augustin, "Model selection: an integral part of
       inference", Biometrics 53, 603 (1997), doi:10.2307/2533961.
    """
    if min_size is not None and min_size < 1:
        raise MesoslipError("minimum size of a power law is not a positive integer")
    tally = tally_of(sizes).between(min_size or 1, max_size)
    if tally.is_degenerate:
        return None
    start = _chosen(tally, max_size, forms) if min_size is None else min_size
    fitted = tally.between(start, None)
    found = _candidate(fitted, start, max_size, forms)
    law, pure = found.best, found.pure
    probability, tested = _tested(fitted, law, replicas, seed) if replicas else (math.nan, 0)
    count = fitted.total
    each = np.array([one.exponent for one in found.laws])
    errors = np.array([one.errors(count)[0] for one in found.laws])
    exponent = float(np.dot(found.weights, each))
    variance = float(np.dot(found.weights, errors**2 + (each - exponent) ** 2))
    return PowerLawFit(
        exponent=exponent,
        exponent_error=math.sqrt(variance),
        form=law.form,
        cutoff=law.cutoff,
        cutoff_error=law.cutoff_error(count),
        min_size=start,
        max_size=max_size,
        count=count,
        log_likelihood=log_likelihood(law, fitted),
        distance=misfit(law, fitted).distance,
        p_value=probability,
        tested=tested,
        cutoff_significance=_cutoff_significance(law, pure, fitted),
        pure_exponent=pure.exponent,
        pure_exponent_error=float(pure.errors(count)[0]),
        forms=tuple(
            FittedForm(one.form, one.exponent, float(error), one.cutoff, one.correction, weight)
            for one, error, weight in zip(found.laws, errors, found.weights, strict=True)
        ),
    )


def _tested(tally: Tally, law: Law, replicas: int, seed: int) -> tuple[float, int]:
    """Probability that sizes of a law fit as badly, and the number of tested sizes."""
    generator = np.random.default_rng(seed)
    sample = tally
    if tally.total > MAX_TESTED:
        counts = generator.multivariate_hypergeometric(tally.counts, MAX_TESTED, method="marginals")
        sample = Tally(tally.sizes[counts > 0], counts[counts > 0])
    return p_value(sample, law, replicas, generator), sample.total


def _cutoff_significance(law: Law, pure: Law, tally: Tally) -> float:
    """Probability that the law of this form without its cutoff looks as much cut."""
    if not law.form.cutoff_shape:
        return 1.0
    uncut = likeliest_law(law.form._replace(cutoff_shape=0.0), tally, pure) or pure
    ratio = 2 * (log_posterior(law, tally) - log_posterior(uncut, tally))
    # 1/s_c cannot be negative: half of the samples of an uncut law show no cutoff.
    return math.erfc(math.sqrt(max(ratio, 0.0) / 2)) / 2


def local_exponents(
    sizes: ArrayLike, min_size: int = 1, ratio: float = 10.0
) -> tuple[LocalExponent, ...]:
    """Exponents of the pure power laws nearest to the sizes in successive windows.

    The limits of a window have the given ratio; windows with too few sizes are left out. A law with
    corrections or a cutoff has another exponent in each window. If the last ones still differ, the
    exponent of large sizes is not known.
    """
    if not ratio > 1:
        raise MesoslipError("ratio of the limits of a window is not above 1")
    tally = tally_of(sizes)
    found = []
    first = max(min_size, 1)
    while len(tally.sizes) and first <= tally.sizes[-1]:
        last = max(math.ceil(first * ratio) - 1, first)
        window = tally.between(first, last)
        if not window.is_degenerate:
            law = uncut_law(window, first, last)
            error = float(law.errors(window.total)[0])
            found.append(LocalExponent(first, last, window.total, law.exponent, error))
        first = last + 1
    return tuple(found)
