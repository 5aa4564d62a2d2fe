"""The synthetic likelihood of the summaries of a trace, learnt from simulations.

Two regressions on simulations near the posterior:

1. **Statistics.** The expected parameters given the summaries: one statistic a parameter, a linear
   combination of all summaries, by ridge regression (Fearnhead & Prangle 2012, J. R. Stat. Soc. B
   74, 419). As sums of many summaries they are nearly normal, unlike the summaries themselves.
2. **Synthetic likelihood** (Wood 2010, Nature 466, 1102). The statistics of a trace are normal,
   with a mean that is a polynomial of the parameters, and a covariance that depends on them.

The statistics of a simulation are predicted by the regression of all others, those of the trace by
the regression of all simulations, so that both have the same scatter. The covariance includes the
uncertainty of the polynomial, and its misfit as part of the residuals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.noise.levels import NORMAL_MEDIAN
from mesoslip.array_types import Array

# Maximum deviation of a summary, in spreads of the simulations.
MAX_SCORE = 6.0
# Penalties of the ridge regression per simulation.
RIDGES = np.geomspace(1e-6, 1e2, 33)
# Maximum leverage of a simulation on its own statistics.
MAX_LEVERAGE = 1 - 1e-6
# Minimum number of simulations per coefficient of the polynomial.
SIMULATIONS_PER_TERM = 8
# Degrees of freedom of t distributions; the normal one is a further candidate.
FREEDOMS = (3.0, 4.0, 6.0, 9.0, 14.0, 25.0)
# Minimum number of simulations for a correction of the likelihood, their maximum deviation in
# standard deviations, and minimum factor of the width.
MIN_CORRECTION = 20
MAX_CORRECTION = 4.0
MIN_CORRECTED = 0.2
# Maximum change of the logarithm of a standard deviation over one spread of the parameters.
MAX_LOG_SLOPE = 1.5


@dataclass(frozen=True)
class Projection:
    """Statistics of summaries: linear functions of the standardized summaries."""

    used: NDArray[np.bool_]
    centre: Array
    spread: Array
    weights: Array
    offset: Array
    has_squares: bool

    def scores(self, summaries: Array) -> Array:
        """Summaries in units of their spread, shape (..., used summaries)."""
        scores = (summaries[..., self.used] - self.centre) / self.spread
        return np.asarray(np.clip(scores, -MAX_SCORE, MAX_SCORE))

    def __call__(self, summaries: Array) -> Array:
        """Statistics, shape (..., parameters)."""
        return _with_squares(self.scores(summaries), self.has_squares) @ self.weights + self.offset


def _with_squares(scores: Array, has_squares: bool) -> Array:
    return np.concatenate([scores, scores**2 - 1], axis=-1) if has_squares else scores


def usable(summaries: Array, observed: Array) -> NDArray[np.bool_]:
    """Whether each summary is defined, not NaN, for the trace and for most simulations."""
    finite = np.isfinite(summaries)
    is_common = finite.mean(axis=0) > 0.5
    return np.asarray(np.isfinite(observed) & is_common)


def project(summaries: Array, parameters: Array, observed: Array) -> tuple[Projection, Array]:
    """Learn the projection of summaries to statistics from simulations.

    The second result is the statistics of each simulation by the regression of all others, shape
    (simulations, parameters). `usable` summaries, of shape (simulations, summaries), have no NaN.
    """
    used = usable(summaries, observed)
    values = summaries[:, used]
    centre = np.median(values, axis=0)
    low, high = np.percentile(values, [16, 84], axis=0)
    spread = (high - low) / 2
    # Constant summaries have no information.
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
    """Weights and offset of a ridge regression, with penalties by leave-one-out validation, and its
    predictions of left-out simulations."""
    middle, mean = scores.mean(axis=0), parameters.mean(axis=0)
    left, sizes, right = np.linalg.svd(scores - middle, full_matrices=False)
    along = left.T @ (parameters - mean)
    count = len(scores)
    weights = np.empty((scores.shape[1], parameters.shape[1]))
    left_out = np.empty_like(parameters)
    shrunk = sizes**2 / (sizes**2 + count * RIDGES[:, None])
    # Leverage of each simulation on its own prediction, shape (simulations, ridges).
    leverage = np.minimum(1 / count + left**2 @ shrunk.T, MAX_LEVERAGE)
    for index in range(parameters.shape[1]):
        predicted = mean[index] + left @ (shrunk * along[:, index]).T
        without = predicted - parameters[:, [index]]
        without = without / (1 - leverage) + parameters[:, [index]]
        best = int(np.argmin(np.sum((without - parameters[:, [index]]) ** 2, axis=0)))
        left_out[:, index] = without[:, best]
        weights[:, index] = right.T @ (shrunk[best] / np.maximum(sizes, 1e-300) * along[:, index])
    return weights, mean - middle @ weights, left_out


@dataclass(frozen=True)
class Surrogate:
    """The synthetic likelihood, valid in the region of the simulations it was learnt from."""

    powers: tuple[tuple[int, ...], ...]
    """Factors of each term of the polynomial: indices of parameters."""
    centre: Array
    spread: Array
    """Spread of the parameters about their centre, for standardization."""
    coefficients: Array
    """Coefficients of the polynomial, shape (terms, statistics)."""
    inverse: Array
    """(X^T X)^-1 of the regression, for the uncertainty of the polynomial."""
    log_scale: Array
    """Coefficients of the logarithm of the standard deviations, shape (1 + parameters, statistics).
    """
    log_range: Array
    """Minimum and maximum of that logarithm over the simulations, shape (2, statistics)."""
    root: Array
    """Cholesky factor of the correlation."""
    freedom: float
    """Degrees of freedom of the t distribution; infinite for a normal one."""
    validity: Array | None
    """Coefficients of the log odds that the summaries of the trace are defined for a simulation;
    None if they always are."""

    @property
    def simulations_for_products(self) -> int:
        """Number of simulations from which on products of parameters are terms of the polynomial; 0
        if they are."""
        size = len(self.centre)
        if size < 2 or any(len(set(one)) > 1 for one in self.powers):
            return 0
        return SIMULATIONS_PER_TERM * (size + 1) * (size + 2) // 2

    @cached_property
    def _unmix(self) -> Array:
        """Transformation of correlated deviations to independent ones."""
        return np.asarray(np.linalg.inv(self.root).T)

    def mean(self, parameters: Array) -> Array:
        """Expected statistics, shape (..., statistics)."""
        return self._terms(parameters) @ self.coefficients

    def _terms(self, parameters: Array) -> Array:
        return _terms((parameters - self.centre) / self.spread, self.powers)

    def standardized(self, statistics: Array, parameters: Array) -> tuple[Array, Array]:
        """Independent deviations from the mean in standard units, and the log determinant of their
        scales."""
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

    def corrected(self, statistics: Array, parameters: Array) -> Surrogate:
        """The likelihood with the mean and the width of simulations with all contacts.

        The simulations that it was learnt from have fewer contacts than the interface, so their
        summaries scatter more, and are shifted a little. The errors of shift and width by the
        number of the others are part of the likelihood.
        """
        count = len(statistics)
        if count < MIN_CORRECTION:
            return self
        scaled = (parameters - self.centre) / self.spread
        terms = _terms(scaled, self.powers)
        scale = np.concatenate([np.ones((count, 1)), scaled], axis=1) @ self.log_scale
        scale = np.exp(np.clip(scale, *self.log_range))
        standard = (statistics - terms @ self.coefficients) / scale
        shift = np.median(standard, axis=0)
        standard = np.clip(standard - shift, -MAX_CORRECTION, MAX_CORRECTION)
        shift = shift + standard.mean(axis=0)
        width = np.sqrt(np.sum((standard - standard.mean(axis=0)) ** 2, axis=0) / (count - 1))
        width *= math.sqrt(1 + 1 / count)
        coefficients = self.coefficients.copy()
        coefficients[0] += shift * np.median(scale, axis=0)
        log_scale, log_width = self.log_scale.copy(), np.log(np.maximum(width, MIN_CORRECTED))
        log_scale[0] += log_width
        return replace(
            self,
            coefficients=coefficients,
            # The polynomial keeps its errors by the simulations that it was learnt from.
            inverse=self.inverse / float(np.mean(np.exp(2 * log_width))),
            log_scale=log_scale,
            log_range=self.log_range + log_width,
        )

    def log_likelihood(self, statistics: Array, parameters: Array) -> Array:
        """Logarithm of the synthetic likelihood up to a constant, shape (...,) for parameters of
        shape (..., parameters)."""
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

    Statistics and parameters are those of the simulations for which the summaries of the trace are
    defined. These simulations are the first of all simulations of the region.
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
    # The polynomial by the weights, and the weights by its residuals, in turn.
    for _ in range(3):
        for index in range(statistics.shape[1]):
            root = np.sqrt(weight[:, index])
            coefficients[:, index] = np.linalg.lstsq(
                terms * root[:, None], statistics[:, index] * root, rcond=None
            )[0]
        residuals = statistics - terms @ coefficients
        residuals *= math.sqrt(count / max(count - len(powers), 1))
        sizes = np.log(np.abs(residuals) + 1e-12)
        # The mean logarithm of the absolute value of a standard normal deviate is -0.635.
        fitted = np.linalg.lstsq(scale_terms, sizes + 0.6351814, rcond=None)[0]
        slope = np.maximum(np.sum(np.abs(fitted[1:]), axis=0) / MAX_LOG_SLOPE, 1)
        fitted[1:] /= slope
        log_scale = fitted
        weight = np.exp(-2 * (scale_terms @ log_scale))
        weight /= weight.mean(axis=0)
    logs = scale_terms @ log_scale
    standard = residuals / np.exp(logs)
    # The median hardly depends on a few large deviations.
    deviation = np.median(np.abs(standard), axis=0) / NORMAL_MEDIAN
    log_scale[0] += np.log(deviation)
    logs = logs + np.log(deviation)
    standard = np.clip(standard / deviation, -MAX_SCORE, MAX_SCORE)
    correlation = np.corrcoef(standard, rowvar=False).reshape(statistics.shape[1], -1)
    # Regularized, so that it stays positive definite.
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
    """Terms of the polynomial of the highest degree that the number of simulations allows."""
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
    index = {one: number for number, one in enumerate(powers)}
    for number, one in enumerate(powers):
        # The product of one factor and an earlier term.
        other = index.get(one[1:])
        known = terms[..., other] if other is not None else np.prod(scaled[..., list(one[1:])], -1)
        terms[..., number] = scaled[..., one[0]] * known if one else 1.0
    return terms


def _tails(distance: Array, size: int) -> tuple[float, float]:
    """Degrees of freedom, infinite for a normal distribution, and width of a multivariate t
    distribution of dimension ``size``, by squared distances from the mean."""
    from scipy.special import gammaln

    square = float(np.mean(distance)) / size
    value = -0.5 * float(np.mean(distance)) / square - 0.5 * size * math.log(square)
    best = (value - 0.5 * size * math.log(2 * math.pi), math.inf, math.sqrt(square))
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


def _validity(
    parameters: Array, all_parameters: Array, centre: Array, spread: Array
) -> Array | None:
    """Logistic regression of whether the summaries of the trace are defined for a simulation."""
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
