"""Comparison of the fitted power law of avalanche sizes with other laws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mesoslip.analysis.avalanche_sizes.laws import (
    EXPONENTIAL_CUTOFF,
    MIN_EXPONENT,
    Law,
    likeliest_law,
    log_likelihood,
    uncut_law,
)
from mesoslip.analysis.avalanche_sizes.power_law import PowerLawFit
from mesoslip.analysis.avalanche_sizes.sums import Rule, sum_rule
from mesoslip.analysis.avalanche_sizes.tally import Tally, tally_of
from mesoslip.array_types import Array

# Powers of the size in stretched exponentials, and minimum sigma of lognormal laws: sums over
# steeper ones would need more nodes.
POWERS = (1e-3, 3.0)
MIN_SIGMA = 0.1
# Minimum standard deviation of the logarithm of the ratio of two laws that differ.
MIN_DIFFERENCE = 1e-12


@dataclass(frozen=True)
class LawComparison:
    """Another law of the sizes against the best form of the power law, from the same size on."""

    law: str
    parameters: dict[str, float]
    """The likeliest ones, by name."""
    log_likelihood_ratio: float
    """Natural logarithm of the sizes' probability under the power law over that under this one."""
    p_value: float
    """Probability of a ratio as far from 0 if both laws were as good; for the pure power law, a
    special case of the other, of such a ratio if it were right."""


def compare_laws(sizes: ArrayLike, fit: PowerLawFit) -> tuple[LawComparison, ...]:
    """Other laws of the sizes that a power law was fitted to, from its minimum size on.

    ``pure`` power law, p ~ s^-τ; ``exponential_cutoff`` and ``gaussian_cutoff``, power laws with
    the cutoffs exp(-s/s_c) and exp(-(s/s_c)²) and no correction; ``lognormal``,
    p ~ exp(-(ln s - mu)²/(2 sigma²))/s; and ``stretched_exponential``, p ~ s^(power - 1)
    exp(-(s/scale)^power), with ``log_scale``, the logarithm of the scale, and a power within
    POWERS; sigma is at least MIN_SIGMA. The first is tested as a special case of the fitted law;
    the others by Vuong's ratio of likelihoods (Econometrica 57, 307 (1989)), two-sided, for
    independent sizes.
    """
    tally = tally_of(sizes).between(fit.min_size, fit.max_size)
    rule = sum_rule(fit.min_size, fit.max_size)
    pure = uncut_law(tally, fit.min_size, fit.max_size)
    best = likeliest_law(fit.form, tally, pure) or pure
    found = [_pure(tally, best, pure)]
    for name, shape in (("exponential_cutoff", 1.0), ("gaussian_cutoff", 2.0)):
        law = likeliest_law(EXPONENTIAL_CUTOFF._replace(cutoff_shape=shape), tally, pure) or pure
        parameters = {"exponent": law.exponent, "cutoff": law.cutoff}
        found.append(_vuong(name, parameters, tally, best, law.log_probability(tally.sizes)))
    # Starts: nearly the pure law, and a law with its middle at the sizes.
    part = tally.counts / tally.total
    r = np.log(tally.sizes / fit.min_size)
    centre = float(part @ r)
    spread = max(math.sqrt(float(part @ (r - centre) ** 2)), MIN_SIGMA)
    bend = 1 / (2 * spread**2)
    log_min_size = math.log(fit.min_size)
    (slope, curvature), probability = _likeliest(
        tally,
        rule,
        _lognormal,
        [[pure.exponent, 0.01], [-2 * bend * centre, bend]],
        [(min(-r[-1] / MIN_SIGMA**2, MIN_EXPONENT), None), (1e-9, 1 / (2 * MIN_SIGMA**2))],
    )
    parameters = {
        "mu": (1 - slope) / (2 * curvature) + log_min_size,
        "sigma": 1 / math.sqrt(2 * curvature),
    }
    found.append(_vuong("lognormal", parameters, tally, best, probability))
    (power, decay), probability = _likeliest(
        tally,
        rule,
        _stretched,
        [[0.3, max(pure.exponent - 1, 0.1)], [1.0, max(math.exp(-centre), 1e-12)]],
        [POWERS, (1e-12, None)],
    )
    parameters = {"power": power, "log_scale": log_min_size + math.log(power / decay) / power}
    found.append(_vuong("stretched_exponential", parameters, tally, best, probability))
    return tuple(found)


def _lognormal(r: Array, parameters: Array) -> Array:
    slope, curvature = parameters
    logarithm: Array = -slope * r - curvature * r**2
    return logarithm


def _stretched(r: Array, parameters: Array) -> Array:
    power, decay = parameters
    # As the power goes to 0, this becomes a power law of exponent 1 + decay.
    logarithm: Array = (power - 1) * r - decay * np.expm1(power * r) / power
    return logarithm


def _likeliest(
    tally: Tally,
    rule: Rule,
    logarithm: Callable[[Array, Array], Array],
    starts: list[list[float]],
    bounds: list[tuple[float | None, float | None]],
) -> tuple[tuple[float, float], Array]:
    """The likeliest two parameters of a law of r = ln(s/min_size) that is not normalized, within
    bounds, and logarithms of the probabilities of the sizes."""
    r, part = np.log(tally.sizes / rule.min_size), tally.counts / tally.total

    def log_norm(parameters: Array) -> float:
        height = logarithm(rule.log_ratio, parameters)
        return float(scipy.special.logsumexp(rule.log_weight + height))

    def cost(parameters: Array) -> float:
        return log_norm(parameters) - float(part @ logarithm(r, parameters))

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
    best = min(found, key=lambda one: one.fun).x
    return (float(best[0]), float(best[1])), logarithm(r, best) - log_norm(best)


def _pure(tally: Tally, best: Law, pure: Law) -> LawComparison:
    """The pure power law, a special case of the best form."""
    ratio = max(log_likelihood(best, tally) - log_likelihood(pure, tally), 0.0)
    more = len(best.parameters) - 1
    p_value = 1.0
    if more:
        # 1/s_c cannot be negative.
        tails = [scipy.special.chdtrc(one, 2 * ratio) for one in (more, more - 1) if one]
        p_value = float(np.sum(tails)) / 2
    if more and not best.form.cutoff_shape:
        p_value = float(scipy.special.chdtrc(more, 2 * ratio))
    return LawComparison("pure", {"exponent": pure.exponent}, ratio, p_value)


def _vuong(
    name: str, parameters: dict[str, float], tally: Tally, best: Law, other: Array
) -> LawComparison:
    """Vuong's comparison of a law with the best form of the power law."""
    difference = best.log_probability(tally.sizes) - other
    part = tally.counts / tally.total
    mean = float(part @ difference)
    deviation = math.sqrt(float(part @ (difference - mean) ** 2))
    p_value = 1.0
    if deviation > MIN_DIFFERENCE:
        p_value = math.erfc(abs(mean) / deviation * math.sqrt(tally.total / 2))
    return LawComparison(name, parameters, tally.total * mean, p_value)
