"""Other laws of avalanche sizes beside the power law that was fitted."""

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
from mesoslip.analysis.avalanche_sizes.tally import Array, Tally, tally_of

# Powers of the size in stretched exponentials, and minimum sigma of lognormal laws: sums over
# steeper ones would need more nodes.
POWERS = (1e-3, 3.0)
MIN_SIGMA = 0.1
# Two laws differ if the logarithm of their ratio varies more than this.
MIN_DIFFERENCE = 1e-12


@dataclass(frozen=True)
class LawComparison:
    """Another law of the sizes against the best form of the power law, from the same size on."""

    law: str
    """Its name."""
    parameters: dict[str, float]
    """The likeliest ones, by name."""
    log_likelihood_ratio: float
    """Natural logarithm of the sizes' probability under the power law over that under this one:
    positive if the power law is likelier."""
    p_value: float
    """Probability of a ratio as far from 0 if both laws were as good; for the pure power law, a
    special case of the other, of such a ratio if it were right."""


def compare_laws(sizes: ArrayLike, fit: PowerLawFit) -> tuple[LawComparison, ...]:
    """Other laws of the sizes that a power law was fitted to, from its minimum size on.

    ``pure`` power law, p ~ s^-τ; ``exponential_cutoff`` and ``gaussian_cutoff``, power laws with
    the cutoffs exp(-s/s_c) and exp(-(s/s_c)²) and no correction; ``lognormal``,
    p ~ exp(-(ln s - mu)²/(2 sigma²))/s; and ``stretched_exponential``, p ~ s^(power - 1)
    exp(-(s/scale)^power), with ``log_scale``, the logarithm of the scale, and a power within
    POWERS; sigma is at least MIN_SIGMA. The first is tested as the special case that it is; the
    others by Vuong's ratio of likelihoods [1]_, two-sided, for independent sizes.

    Parameters
    ----------
    sizes
        Positive integers, of any shape: those of the fit.
    fit
        The result of `fit_power_law`.

    Raises
    ------
    MesoslipError
        If a size is not a positive integer.

    References
    ----------
    .. [1] Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
       Econometrica 57, 307 (1989), doi:10.2307/1912557.
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
    log_min_size = math.log(fit.min_size)

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
    r = np.log(tally.sizes / fit.min_size)
    centre = float(part @ r)
    spread = max(math.sqrt(float(part @ (r - centre) ** 2)), MIN_SIGMA)
    bend = 1 / (2 * spread**2)
    slope, curvature = _likeliest_parameters(
        tally,
        rule,
        lognormal,
        [[pure.exponent, 0.01], [-2 * bend * centre, bend]],
        [(min(-r[-1] / MIN_SIGMA**2, MIN_EXPONENT), None), (1e-9, 1 / (2 * MIN_SIGMA**2))],
    )
    found.append(
        _vuong(
            "lognormal",
            {
                "mu": (1 - slope) / (2 * curvature) + log_min_size,
                "sigma": 1 / math.sqrt(2 * curvature),
            },
            tally,
            best,
            _log_probability(tally, rule, lambda r: lognormal(r, np.array([slope, curvature]))),
        )
    )
    power, decay = _likeliest_parameters(
        tally,
        rule,
        stretched,
        [[0.3, max(pure.exponent - 1, 0.1)], [1.0, max(math.exp(-centre), 1e-12)]],
        [POWERS, (1e-12, None)],
    )
    found.append(
        _vuong(
            "stretched_exponential",
            {
                "power": power,
                "log_scale": log_min_size + math.log(power / decay) / power,
            },
            tally,
            best,
            _log_probability(tally, rule, lambda r: stretched(r, np.array([power, decay]))),
        )
    )
    return tuple(found)


def _log_norm(rule: Rule, height: Array) -> float:
    return float(scipy.special.logsumexp(rule.log_weight + height))


def _likeliest_parameters(
    tally: Tally,
    rule: Rule,
    logarithm: Callable[[Array, Array], Array],
    starts: list[list[float]],
    bounds: list[tuple[float | None, float | None]],
) -> tuple[float, float]:
    """The two parameters of the likeliest law of ln(s/min_size), within bounds."""
    r, part = np.log(tally.sizes / rule.min_size), tally.counts / tally.total

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


def _pure(tally: Tally, best: Law, pure: Law) -> LawComparison:
    """The pure power law, of which the best form has a cutoff or a correction more, or neither."""
    ratio = max(log_likelihood(best, tally) - log_likelihood(pure, tally), 0.0)
    more = len(best.parameters) - 1
    p_value = 1.0
    if more:
        # A cutoff can only be on one side of none.
        tails = [scipy.special.chdtrc(one, 2 * ratio) for one in (more, more - 1) if one]
        p_value = float(np.sum(tails)) / 2
    if more and not best.form.cutoff_shape:
        p_value = float(scipy.special.chdtrc(more, 2 * ratio))
    return LawComparison("pure", {"exponent": pure.exponent}, ratio, p_value)


def _log_probability(tally: Tally, rule: Rule, logarithm: Callable[[Array], Array]) -> Array:
    """Logarithms of the probabilities of sizes, from those of a law that is not normalized."""
    logarithms = logarithm(np.log(tally.sizes / rule.min_size))
    return logarithms - _log_norm(rule, logarithm(rule.log_ratio))


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
