"""Power laws with a cutoff and a correction, and the likeliest law of a sample.

p(s) = s^-τ exp(-(s/s_c)^c) exp(a s^-b)/Z is an exponential family in τ, s_c^-c and a: the
likelihood has one maximum, which Newton's method finds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from mesoslip.analysis.avalanche_sizes.sums import MIN_RATE, Rule, sum_rule
from mesoslip.analysis.avalanche_sizes.tally import Tally
from mesoslip.array_types import Array

# Minimum exponent: sums of laws that rise more steeply would need more nodes.
MIN_EXPONENT = -20.0
# Maximum number of Newton's steps, of which some ten are needed.
MAX_STEPS = 200
# Standard deviation of the prior of a correction's amplitude: of order one at size one.
CORRECTION_WIDTH = 1.0


class Form(NamedTuple):
    """The factors of a law besides s^-τ."""

    cutoff_shape: float
    """c of the cutoff exp(-(s/s_c)^c): 1 exponential, 2 Gaussian; 0 for none."""
    correction_power: float
    """b of the correction exp(a s^-b) of small sizes; 0 for none."""


EXPONENTIAL_CUTOFF = Form(1.0, 0.0)
FORMS = tuple(Form(shape, power) for shape in (1.0, 2.0) for power in (0.0, 0.5, 1.0))


class _Moments(NamedTuple):
    """ln Z, and mean and covariance of the features f."""

    log_norm: float
    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Law:
    """A law of a form: probability exp(-θ·f(s))/Z of the sizes s between two limits."""

    min_size: int
    max_size: int | None
    form: Form
    scale: float
    """Size that the cutoff's feature (s/scale)^c is relative to."""
    parameters: Array
    """θ: τ; (scale/s_c)^c if there is a cutoff; a if there is a correction."""
    moments: _Moments
    fitted_form: Form
    """The form that was fitted; it has a cutoff even if the likeliest law has none."""

    @property
    def exponent(self) -> float:
        """τ."""
        return float(self.parameters[0])

    @property
    def cutoff(self) -> float:
        """s_c; infinite without a cutoff."""
        if not self.form.cutoff_shape:
            return math.inf
        ratio = float(self.parameters[1]) ** (-1 / self.form.cutoff_shape)
        return self.scale * float(ratio)

    @property
    def correction(self) -> float:
        """a; 0 without a correction."""
        return float(self.parameters[-1]) if self.form.correction_power else 0.0

    def log_probability(self, sizes: Array) -> Array:
        """Natural logarithm of the probability of sizes, of any shape."""
        offset = sizes - self.min_size
        log_ratio = np.log1p(offset / self.min_size)
        features = _features(self.form, self.min_size, self.scale, log_ratio, offset)
        logarithm: Array = -np.tensordot(self.parameters, features, axes=1)
        return logarithm - self.moments.log_norm

    def masses(self, sizes: Array) -> Array:
        """Probabilities of the intervals of sizes that end at these sizes."""
        before = np.concatenate([[self.min_size - 1.0], sizes[:-1]])
        length = sizes - before
        # Sum over each interval by two nodes.
        half = np.sqrt((length**2 - 1) / 12)
        centre = (before + sizes + 1) / 2
        ends = np.exp(self.log_probability(np.stack([centre - half, centre + half])))
        mass: Array = length * np.mean(ends, axis=0)
        return mass

    def errors(self, count: int) -> Array:
        """Standard errors of the parameters for a number of independent sizes."""
        return np.sqrt(np.diag(np.linalg.inv(count * _information(self, count))))

    def cutoff_error(self, count: int) -> float:
        """Standard error of s_c; infinite without a cutoff."""
        if not self.form.cutoff_shape:
            return math.inf
        relative = float(self.errors(count)[1] / self.parameters[1])
        return self.cutoff * relative / self.form.cutoff_shape


def _features(form: Form, min_size: int, scale: float, log_ratio: Array, offset: Array) -> Array:
    """f(s), stacked along the first dimension."""
    rows = [log_ratio]
    if form.cutoff_shape:
        # Relative to the minimum size, so that nothing overflows there.
        start = (min_size / scale) ** form.cutoff_shape
        rows.append(((min_size + offset) / scale) ** form.cutoff_shape - start)
    if form.correction_power:
        rows.append(-((min_size + offset) ** -form.correction_power))
    return np.stack(rows)


def _prior(form: Form, count: int) -> Array:
    """Precision of the prior of each parameter, over the number of sizes."""
    precision = np.zeros(1 + bool(form.cutoff_shape) + bool(form.correction_power))
    if form.correction_power:
        precision[-1] = 1 / (count * CORRECTION_WIDTH**2)
    return precision


def _information(law: Law, count: int) -> Array:
    """Information of one size about the parameters, with that of the prior."""
    return law.moments.covariance + np.diag(_prior(law.form, count))


def _moments(rule: Rule, features: Array, parameters: Array) -> _Moments:
    """Moments of the features under a law."""
    height = rule.log_weight - parameters @ features
    peak = float(np.max(height))
    part = np.exp(height - peak)
    norm = float(np.sum(part))
    used = part > 0
    kept, part = features[:, used], part[used]
    first, second = kept @ part, (kept * part) @ kept.T
    return _Moments(
        peak + math.log(norm),
        first / norm,
        second / norm - np.outer(first, first) / norm**2,
    )


def _uncut_moments(rule: Rule, features: Array, parameters: Array) -> _Moments:
    """Moments without a cutoff, with the integral beyond an open rule.

    All features but the first are negligible there.
    """
    inside = _moments(rule, features, parameters)
    if not rule.is_open:
        return inside
    edge, scale = math.log1p((rule.last + 0.5) / rule.min_size), 1 / (parameters[0] - 1)
    rest = rule.min_size * math.exp(-edge / scale - inside.log_norm) * scale
    first, second = inside.mean, inside.covariance + np.outer(inside.mean, inside.mean)
    first[0] += rest * (edge + scale)
    second[0, 0] += rest * (edge**2 + 2 * edge * scale + 2 * scale**2)
    norm = 1 + rest
    return _Moments(
        inside.log_norm + math.log(norm),
        first / norm,
        second / norm - np.outer(first, first) / norm**2,
    )


def uncut_law(tally: Tally, min_size: int, max_size: int | None) -> Law:
    """The likeliest pure power law of sizes between two limits."""
    rule = sum_rule(min_size, max_size)
    features = rule.log_ratio[None]
    part = tally.counts / tally.total
    log_mean = float(part @ np.log(tally.sizes / min_size))

    def excess(exponent: float) -> float:
        return float(_uncut_moments(rule, features, np.array([exponent])).mean[0]) - log_mean

    # Without a maximum size there is no law unless τ > 1.
    low, high = 1.5, 2.0
    while excess(low) < 0 and low > MIN_EXPONENT:
        low = (low + 1) / 2 if max_size is None else max(2 * low - 2, MIN_EXPONENT)
    while excess(high) > 0:
        high *= 2
    exponent = low
    if low > MIN_EXPONENT:
        exponent = scipy.optimize.brentq(excess, low, high, xtol=1e-12)
    parameters = np.array([exponent])
    moments = _uncut_moments(rule, features, parameters)
    form = Form(0.0, 0.0)
    return Law(min_size, max_size, form, 1.0, parameters, moments, form)


def likeliest_law(form: Form, tally: Tally, pure: Law) -> Law | None:
    """The likeliest law of a form; None if it has a correction that the sizes cannot determine.

    The sizes are between the limits of the pure law. The law has no cutoff if that is likelier, or
    if the sizes vary so little that s^-τ and the cutoff cannot be distinguished.
    """
    start = pure
    if form.correction_power:
        corrected = _newton(Form(0.0, form.correction_power), tally, pure, [pure.exponent, 0.0])
        if corrected is None:
            return None
        start = corrected
    if not form.cutoff_shape:
        return start
    rule = sum_rule(pure.min_size, pure.max_size)
    scale = float(tally.sizes[-1])
    part = tally.counts / tally.total
    only_cutoff = Form(form.cutoff_shape, 0.0)
    sample = float(
        part
        @ _features(
            only_cutoff, pure.min_size, scale, np.log(tally.sizes), tally.sizes - pure.min_size
        )[1]
    )
    if not rule.is_open or start.exponent > 1 + form.cutoff_shape:
        expected = (
            np.exp(rule.log_weight + start.log_probability(rule.min_size + rule.offset))
            @ (_features(only_cutoff, pure.min_size, scale, rule.log_ratio, rule.offset)[1])
        )
        if expected <= sample:
            return replace(start, fitted_form=form)
    # With this rate, an exponential law has the mean of (s/scale)^c of the sizes.
    first = [start.exponent, 1 / (sample + (1 / scale) ** form.cutoff_shape)]
    cut = _newton(form, tally, pure, [*first, *start.parameters[1:]], scale)
    return replace(start, fitted_form=form) if cut is None else cut


def _newton(
    form: Form, tally: Tally, pure: Law, start: list[float], scale: float = 1.0
) -> Law | None:
    """The likeliest law by Newton's method with halved steps; None if the likelihood has no
    definite maximum at a finite cutoff."""
    rule = sum_rule(pure.min_size, pure.max_size)
    moments_of = _moments if form.cutoff_shape else _uncut_moments
    features = _features(form, pure.min_size, scale, rule.log_ratio, rule.offset)
    offset = tally.sizes - pure.min_size
    sample = _features(form, pure.min_size, scale, np.log1p(offset / pure.min_size), offset) @ (
        tally.counts / tally.total
    )
    prior = _prior(form, tally.total)
    floor = np.full(len(start), -math.inf)
    if form.cutoff_shape:
        floor[1] = 0.0
    elif rule.is_open:
        floor[0] = 1.0
    now = np.array(start)
    moments = moments_of(rule, features, now)

    def cost(parameters: Array, moments: _Moments) -> float:
        return float(moments.log_norm + parameters @ sample + 0.5 * prior @ parameters**2)

    for _ in range(MAX_STEPS):
        slope = sample - moments.mean + prior * now
        curvature = moments.covariance + np.diag(prior)
        spread = np.sqrt(np.diag(curvature))
        if not np.all(spread > 0) or np.linalg.det(curvature / np.outer(spread, spread)) < 1e-12:
            return None
        step = -np.linalg.solve(curvature, slope)
        is_whole = True
        for one in np.flatnonzero(now + step <= floor):
            # The best step within the range of this parameter.
            is_whole = False
            rest = np.arange(len(now)) != one
            step[one] = 0.9 * (floor[one] - now[one])
            right = slope[rest] + curvature[rest, one] * step[one]
            step[rest] = -np.linalg.solve(curvature[np.ix_(rest, rest)], right)
        descent = -float(step @ slope)
        is_last = descent < 1e-12 and is_whole
        value, share = cost(now, moments), 1.0
        while True:
            new = now + share * step
            moments = moments_of(rule, features, new)
            if is_last or cost(new, moments) <= value - 1e-4 * share * descent:
                break
            share /= 2
        now = new
        rate = now[1] ** (1 / form.cutoff_shape) / scale if form.cutoff_shape else 1.0
        if rate < MIN_RATE or now[0] < MIN_EXPONENT:
            return None
        if is_last:
            break
    return Law(pure.min_size, pure.max_size, form, scale, now, moments, form)


def log_likelihood(law: Law, tally: Tally) -> float:
    """Natural logarithm of the probability of sizes."""
    return float(tally.counts @ law.log_probability(tally.sizes))


def log_posterior(law: Law, tally: Tally) -> float:
    """The logarithm of likelihood and prior, up to a constant."""
    prior = _prior(law.form, tally.total) * tally.total
    return log_likelihood(law, tally) - float(0.5 * prior @ law.parameters**2)
