"""The synthetic likelihood of a trace's summaries, as a function learnt from simulations.

In two steps, each a regression on simulations near the parameters that matter:

1. **Statistics.** The expected parameters given the summaries: one number a parameter, a linear
   combination of all summaries, by ridge regression (Fearnhead & Prangle 2012, J. R. Stat. Soc. B
   74, 419). Being sums of many summaries they are nearly normal, which the summaries are not.
2. **Synthetic likelihood** (Wood 2010, Nature 466, 1102). The statistics of a trace are normal with
   a mean that is a polynomial of the parameters, and a covariance that grows or shrinks with them.

A simulation's own statistics are predicted by a regression of all others, and those of the trace by
one of all simulations, so both scatter alike. The uncertainty of the polynomial is part of the
covariance; and what the polynomial cannot follow is, as a part of the residuals, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Summaries beyond this many spreads of the simulations are cut off there.
LARGEST_SCORE = 6.0
RIDGES = np.geomspace(1e-6, 1e2, 33)
# Influence of a simulation on its own statistics, beyond which nothing is left without it.
LARGEST_LEVERAGE = 1 - 1e-6
# Simulations for each coefficient before the polynomial is given one more degree.
SIMULATIONS_PER_TERM = 8
# Degrees of freedom of tails that are tried, beside normal ones.
FREEDOMS = (3.0, 4.0, 6.0, 9.0, 14.0, 25.0)
# Median of the size of a standard normal deviate.
NORMAL_MEDIAN = 0.6744897501960817
# Range of the logarithm of a standard deviation over the region.
LARGEST_LOG_RANGE = 1.5


@dataclass(frozen=True)
class Projection:
    """Statistics of summaries: linear functions of them after they were brought to one scale."""

    used: NDArray[np.bool_]
    centre: Array
    spread: Array
    weights: Array
    offset: Array
    has_squares: bool

    def scores(self, summaries: Array) -> Array:
        """Summaries in units of their spread, shape (..., used summaries)."""
        scores = (summaries[..., self.used] - self.centre) / self.spread
        return np.asarray(np.clip(scores, -LARGEST_SCORE, LARGEST_SCORE))

    def __call__(self, summaries: Array) -> Array:
        """Statistics, shape (..., parameters)."""
        statistics: Array = (
            _with_squares(self.scores(summaries), self.has_squares) @ self.weights + self.offset
        )
        return statistics


def _with_squares(scores: Array, has_squares: bool) -> Array:
    return np.concatenate([scores, scores**2 - 1], axis=-1) if has_squares else scores


def usable(summaries: Array, observed: Array) -> NDArray[np.bool_]:
    """Summaries that the trace has, and nearly all simulations.

    Parameters
    ----------
    summaries
        Of simulations, shape (simulations, summaries); NaN for what one has not.
    observed
        Of the trace, shape (summaries,).
    """
    finite = np.isfinite(summaries)
    most = finite.mean(axis=0) > 0.5
    # A trace that has what few simulations have is compared with those that have it.
    return np.asarray(np.isfinite(observed) & most)


def project(summaries: Array, parameters: Array, observed: Array) -> tuple[Projection, Array]:
    """Learn statistics from simulations.

    Parameters
    ----------
    summaries
        Shape (simulations, summaries), without NaN where `usable`.
    parameters
        Shape (simulations, parameters).
    observed
        Summaries of the trace.

    Returns
    -------
    projection, statistics
        The statistics; and those of each simulation, shape (simulations, parameters), by the
        regression of all others.
    """
    used = usable(summaries, observed)
    values = summaries[:, used]
    centre = np.median(values, axis=0)
    low, high = np.percentile(values, [16, 84], axis=0)
    spread = (high - low) / 2
    # What does not vary says nothing.
    varies = spread > 1e-9 * (1 + np.abs(centre))
    used = used.copy()
    used[np.flatnonzero(used)[~varies]] = False
    centre, spread = centre[varies], spread[varies]
    count = len(values)
    has_squares = count > 4 * centre.size
    empty = Projection(used, centre, spread, np.empty(0), np.empty(0), has_squares)
    scores = _with_squares(empty.scores(summaries), has_squares)
    weights, offset, statistics = _ridge(scores, parameters)
    return Projection(used, centre, spread, weights, offset, has_squares), statistics


def _ridge(scores: Array, parameters: Array) -> tuple[Array, Array, Array]:
    """Ridge regression; the penalty of each parameter by leaving out one simulation at a time.

    Returns
    -------
    weights, offset, left_out
        Of the regression; and what it predicts of each simulation when it is not in it.
    """
    middle, mean = scores.mean(axis=0), parameters.mean(axis=0)
    left, sizes, right = np.linalg.svd(scores - middle, full_matrices=False)
    along = left.T @ (parameters - mean)
    count = len(scores)
    weights = np.empty((scores.shape[1], parameters.shape[1]))
    left_out = np.empty_like(parameters)
    shrunk = sizes**2 / (sizes**2 + count * RIDGES[:, None])
    # Influence of each simulation on what is predicted of itself, shape (simulations, ridges).
    leverage = np.minimum(1 / count + left**2 @ shrunk.T, LARGEST_LEVERAGE)
    for place in range(parameters.shape[1]):
        predicted = mean[place] + left @ (shrunk * along[:, place]).T
        without = predicted - parameters[:, [place]]
        without = without / (1 - leverage) + parameters[:, [place]]
        best = int(np.argmin(np.sum((without - parameters[:, [place]]) ** 2, axis=0)))
        left_out[:, place] = without[:, best]
        weights[:, place] = right.T @ (shrunk[best] / np.maximum(sizes, 1e-300) * along[:, place])
    return weights, mean - middle @ weights, left_out


@dataclass(frozen=True)
class Surrogate:
    """The synthetic likelihood, within the region of the simulations that it was learnt from.

    Attributes
    ----------
    powers
        Factors of each term of the polynomial: numbers of parameters.
    centre, spread
        By which parameters are brought to one scale.
    coefficients
        Of the polynomial, shape (terms, statistics).
    inverse
        (X^T X)^-1 of the regression, which tells the uncertainty of the polynomial.
    log_scale
        Coefficients of the logarithm of the standard deviations, shape (1 + parameters,
        statistics).
    log_range
        Least and greatest logarithm in the simulations, shape (2, statistics).
    root
        Cholesky factor of the correlation.
    freedom
        Degrees of freedom of the tails; infinite for normal ones.
    validity
        Coefficients of the log odds that a simulation has the summaries of the trace.
    """

    powers: tuple[tuple[int, ...], ...]
    centre: Array
    spread: Array
    coefficients: Array
    inverse: Array
    log_scale: Array
    log_range: Array
    root: Array
    freedom: float
    validity: Array | None

    @cached_property
    def _unmix(self) -> Array:
        """What makes correlated deviations independent."""
        return np.asarray(np.linalg.inv(self.root).T)

    def mean(self, parameters: Array) -> Array:
        """Expected statistics, shape (..., statistics)."""
        mean: Array = self._terms(parameters) @ self.coefficients
        return mean

    def _terms(self, parameters: Array) -> Array:
        return _terms((parameters - self.centre) / self.spread, self.powers)

    def standardized(self, statistics: Array, parameters: Array) -> tuple[Array, Array]:
        """Deviations from what is expected in independent standard units, and the logarithm of the
        determinant of what they were divided by."""
        scaled = (parameters - self.centre) / self.spread
        terms = _terms(scaled, self.powers)
        leverage = np.sum((terms @ self.inverse) * terms, axis=-1)
        ones = np.ones((*scaled.shape[:-1], 1))
        log_scale = np.clip(
            np.concatenate([ones, scaled], axis=-1) @ self.log_scale, *self.log_range
        )
        log_scale = log_scale + 0.5 * np.log1p(leverage)[..., None]
        deviations = (statistics - terms @ self.coefficients) / np.exp(log_scale)
        return deviations @ self._unmix, log_scale.sum(axis=-1)

    def log_likelihood(self, statistics: Array, parameters: Array) -> Array:
        """Logarithm of the synthetic likelihood but for a constant, shape (...,).

        Parameters
        ----------
        statistics
            Of the trace, shape (statistics,).
        parameters
            Shape (..., parameters).
        """
        deviations, log_determinant = self.standardized(statistics, parameters)
        distance = np.sum(deviations**2, axis=-1)
        size = deviations.shape[-1]
        if math.isfinite(self.freedom):
            value = -0.5 * (self.freedom + size) * np.log1p(distance / self.freedom)
        else:
            value = -0.5 * distance
        if self.validity is not None:
            scaled = (parameters - self.centre) / self.spread
            value = value - np.logaddexp(0, -(self.validity[0] + scaled @ self.validity[1:]))
        return np.asarray(value - log_determinant)


def learn(statistics: Array, parameters: Array, all_parameters: Array) -> Surrogate:
    """Learn the synthetic likelihood.

    Parameters
    ----------
    statistics
        Of the simulations that have the summaries of the trace, shape (simulations, statistics).
    parameters
        Their parameters, shape (simulations, parameters).
    all_parameters
        Parameters of all simulations of the region, those first that have the summaries.
    """
    centre, spread = all_parameters.mean(axis=0), all_parameters.std(axis=0) + 1e-12
    scaled = (parameters - centre) / spread
    count, size = scaled.shape
    powers = _powers(size, count)
    terms = _terms(scaled, powers)
    weight = np.ones((count, statistics.shape[1]))
    scale_terms = np.concatenate([np.ones((count, 1)), scaled], axis=1)
    log_scale = np.zeros((1 + size, statistics.shape[1]))
    coefficients = np.empty((len(powers), statistics.shape[1]))
    # Deviations tell the weights, weights the polynomial.
    for _ in range(3):
        for place in range(statistics.shape[1]):
            root = np.sqrt(weight[:, place])
            coefficients[:, place] = np.linalg.lstsq(
                terms * root[:, None], statistics[:, place] * root, rcond=None
            )[0]
        residuals = statistics - terms @ coefficients
        residuals *= math.sqrt(count / max(count - len(powers), 1))
        sizes = np.log(np.abs(residuals) + 1e-12)
        # Of a standard normal deviate the logarithm of the size is -0.635 in the mean.
        fitted = np.linalg.lstsq(scale_terms, sizes + 0.6351814, rcond=None)[0]
        slope = np.maximum(np.sum(np.abs(fitted[1:]), axis=0) / LARGEST_LOG_RANGE, 1)
        fitted[1:] /= slope
        log_scale = fitted
        weight = np.exp(-2 * (scale_terms @ log_scale))
        weight /= weight.mean(axis=0)
    logs = scale_terms @ log_scale
    standard = residuals / np.exp(logs)
    # Medians, as a few far ones do not tell the width of the others.
    deviation = np.median(np.abs(standard), axis=0) / NORMAL_MEDIAN
    log_scale[0] += np.log(deviation)
    logs = logs + np.log(deviation)
    standard = np.clip(standard / deviation, -LARGEST_SCORE, LARGEST_SCORE)
    correlation = np.corrcoef(standard, rowvar=False).reshape(statistics.shape[1], -1)
    # A little towards independence, so that it stays positive.
    correlation = 0.98 * correlation + 0.02 * np.eye(statistics.shape[1])
    root = np.linalg.cholesky(correlation)
    distance = np.sum(np.linalg.solve(root, standard.T) ** 2, axis=0)
    freedom, width = _tails(distance, statistics.shape[1])
    log_scale[0] += math.log(width)
    logs = logs + math.log(width)
    return Surrogate(
        powers,
        centre,
        spread,
        coefficients,
        np.asarray(np.linalg.pinv(terms.T @ terms)),
        log_scale,
        np.array([logs.min(axis=0), logs.max(axis=0)]),
        root,
        freedom,
        _validity(parameters, all_parameters, centre, spread),
    )


def _powers(size: int, count: int) -> tuple[tuple[int, ...], ...]:
    """Terms of the polynomial of as high a degree as the simulations allow."""
    powers: list[tuple[int, ...]] = [()]
    for degree in (1, 2, 3):
        more = list(combinations_with_replacement(range(size), degree))
        if degree > 1 and SIMULATIONS_PER_TERM * (len(powers) + len(more)) > count:
            if degree == 2:
                # Squares without products.
                powers += [(one, one) for one in range(size)]
            break
        powers += more
    return tuple(powers)


def _terms(scaled: Array, powers: tuple[tuple[int, ...], ...]) -> Array:
    terms = np.empty((*scaled.shape[:-1], len(powers)))
    place = {one: number for number, one in enumerate(powers)}
    for number, one in enumerate(powers):
        # The product of one factor and a term that is there already.
        rest = place.get(one[1:])
        known = terms[..., rest] if rest is not None else np.prod(scaled[..., list(one[1:])], -1)
        terms[..., number] = scaled[..., one[0]] * known if one else 1.0
    return terms


def _tails(distance: Array, size: int) -> tuple[float, float]:
    """Degrees of freedom and width of a multivariate t distribution, by maximum likelihood.

    Parameters
    ----------
    distance
        Squared distances of the deviations from their mean, shape (deviations,).
    size
        Dimensions of a deviation.

    Returns
    -------
    freedom, width
        Infinite for a normal distribution; and by what lengths are to be divided.
    """
    from scipy.special import gammaln

    square = float(np.mean(distance)) / size
    best = (
        -0.5 * float(np.mean(distance)) / square - 0.5 * size * math.log(square) + _normal(size),
        math.inf,
        math.sqrt(square),
    )
    for freedom in FREEDOMS:
        square = float(np.median(distance)) / size
        for _ in range(100):
            weight = (freedom + size) / (freedom + distance / square)
            square = float(np.mean(weight * distance)) / size
        constant = gammaln((freedom + size) / 2) - gammaln(freedom / 2)
        constant -= 0.5 * size * math.log(freedom * math.pi)
        value = constant - 0.5 * size * math.log(square)
        value -= 0.5 * (freedom + size) * float(np.mean(np.log1p(distance / (freedom * square))))
        if value > best[0]:
            best = (value, freedom, math.sqrt(square))
    return best[1], best[2]


def _normal(size: int) -> float:
    return -0.5 * size * math.log(2 * math.pi)


def _validity(
    parameters: Array, all_parameters: Array, centre: Array, spread: Array
) -> Array | None:
    """Logistic regression of whether a simulation has the summaries of the trace."""
    from scipy.optimize import minimize

    count, whole = len(parameters), len(all_parameters)
    if count == whole:
        return None
    terms = np.concatenate([np.ones((whole, 1)), (all_parameters - centre) / spread], axis=1)
    sign = np.where(np.arange(whole) < count, 1.0, -1.0)

    def loss(coefficients: Array) -> tuple[float, Array]:
        odds = sign * (terms @ coefficients)
        value = np.sum(np.logaddexp(0, -odds)) + 0.5 * np.sum(coefficients[1:] ** 2)
        gradient = -terms.T @ (sign / (1 + np.exp(np.clip(odds, -50, 50))))
        gradient[1:] += coefficients[1:]
        return float(value), gradient

    result: Array = minimize(loss, np.zeros(terms.shape[1]), jac=True).x
    return result
