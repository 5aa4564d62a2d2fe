"""Least-squares fits of rate-and-state laws to records, with errors and tests of the residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mesoslip.analysis.rate_and_state.law import RateAndState
from mesoslip.analysis.rate_and_state.noise import Noise, estimated_noise, white_noise
from mesoslip.analysis.rate_and_state.records import Record
from mesoslip.array_types import Array
from mesoslip.errors import RunError

# Maximum number of evaluations in least squares.
MAX_EVALUATIONS = 40
# Relative difference of the sums of squares of two starts that agree.
AGREEMENT = 1e-3
# Improvement of chi square over laws without evolution that makes it stand out of the noise, and
# maximum relative errors of parameters that count as determined.
MIN_IMPROVEMENT = 25.0
MAX_ERROR = 0.25
# Distance of a logarithm from its bound at which the parameter is not determined.
AT_BOUND = 0.05
# Deviation from steady sliding, over the range of the force, in which a law is tested.
ACTIVE = 0.02
MIN_ACTIVE = 8
# Minimum probability of the residuals of an adequate law. It is small, as the noise itself is
# estimated.
MIN_P_VALUE = 0.001
# Maximum relative misfit of an adequate law, for a record without noise.
MAX_MISFIT = 0.01
# Minimum difference of Akaike's criterion that prefers a law.
MIN_PREFERENCE = 2.0
VERDICTS = ("described", "not described", "not determined")
# Names in sentences.
SYMBOLS = {"slip_distance": "D_c", "slip_distance2": "D_c2"}


@dataclass(frozen=True)
class Fit:
    """A law fitted to a record."""

    law: RateAndState
    at: Array
    """Scaled parameters."""
    covariance: Array
    """Their covariance."""
    residual: Array
    """Record minus law, in the unit of the force."""
    chi_square: float
    """Sum of the squares of the residuals over the noise."""
    noise: Noise
    p_value: float
    """Probability of residuals as large by noise alone; of noise that is estimated, where the force
    evolves, compared with those where it is steady."""
    runs_p_value: float
    """Probability of so few changes of the residuals' sign by chance."""
    improvement: float = math.nan
    """Decrease of chi square from the best law without evolution, if the noise is estimated."""

    def value(self, name: str) -> float:
        """A parameter in SI; a_minus_b too."""
        found = self.law.parameters(self.at)
        if name == "a_minus_b":
            return float(found["a"] - found["b"] - found["b2"])
        return float(found[name])

    def error(self, name: str) -> float:
        """Its standard error; 0 if it was given."""
        wanted = {"a": 1.0, "b": -1.0, "b2": -1.0} if name == "a_minus_b" else {name: 1.0}
        gradient = np.array([wanted.get(one, 0.0) for one in self.law.names])
        gradient = gradient * self.law.factors(self.at)
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    @property
    def mean_square(self) -> float:
        """Mean square of the residuals over the noise."""
        return self.chi_square / self.residual.size

    @property
    def information_criterion(self) -> float:
        """Akaike's criterion for the number of independent points."""
        size, count = self.at.size, self.noise.independent_points
        if self.noise.is_known:
            return count * self.mean_square + 2 * size
        # With the correction for a small number.
        count = max(count, size + 2.0)
        return self.chi_square + 2 * size + 2 * size * (size + 1) / (count - size - 1)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Symbols of the parameters that the record does not determine: they are at the bounds of
        the search, or, if the noise is estimated, uncertain by more than 25 %."""
        found = []
        for name, at, low, high in zip(self.law.names, self.at, *self.law.bounds(), strict=True):
            if self.noise.is_known:
                is_uncertain = False
            elif name in {"a", "b", "slip_distance", "b2", "slip_distance2"}:
                is_uncertain = not self.error(name) < MAX_ERROR * abs(self.value(name))
            else:
                continue
            if is_uncertain or min(at - low, high - at) < AT_BOUND:
                found.append(SYMBOLS.get(name, name))
        return tuple(found)

    @property
    def excessive(self) -> tuple[str, ...]:
        """Names of a and b that exceed the friction, which they change by a few percent."""
        friction = float(np.max(np.abs(self.law.points.force)))
        names = ("a", "b", "b2")[: 1 + self.law.states]
        return tuple(name for name in names if abs(self.value(name)) > friction)

    @property
    def stands_out(self) -> bool:
        """Whether the evolution stands out of the noise; no question of noise that is known."""
        return self.noise.is_known or self.improvement > MIN_IMPROVEMENT

    @property
    def is_determined(self) -> bool:
        """Whether the record determines the parameters."""
        return self.stands_out and not self.undetermined and not self.excessive

    @property
    def is_described(self) -> bool:
        """Whether the law describes the record: within its noise, or without noise to 1 %."""
        return self.is_determined and self._fits

    @property
    def _fits(self) -> bool:
        if self.noise.deviation == 0:
            return self.relative_misfit < MAX_MISFIT
        return not self.p_value < MIN_P_VALUE and not self.runs_p_value < MIN_P_VALUE

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if self.is_described:
            return VERDICTS[0]
        is_judged = self.is_determined or self.noise.is_known
        return VERDICTS[2] if self._fits or not is_judged else VERDICTS[1]

    @property
    def relative_misfit(self) -> float:
        """Residual over the standard deviation of the record, NaN for a constant force."""
        is_known, points = self.noise.is_known, self.law.points
        weight = None if is_known else points.count
        spread = float(np.cov(points.force, aweights=weight, ddof=0 if is_known else 1))
        square = float(np.average(self.residual**2, weights=weight))
        return math.sqrt(square / spread) if spread > 0 else math.nan


def preferred_law(fits: dict[str, Fit]) -> str:
    """The law that the data prefer by Akaike's criterion, of those whose parameters they determine;
    empty if there is none, or if the criteria of two agree within 2."""
    order = sorted(
        (one.information_criterion, law) for law, one in fits.items() if one.is_determined
    )
    if not order or (len(order) > 1 and order[1][0] - order[0][0] < MIN_PREFERENCE):
        return ""
    return order[0][1]


def fit_laws(record: Record, laws: Sequence[str] = ()) -> dict[str, Fit]:
    """Fits of the laws of a record, or of some of them, all with the noise about the best of them
    unless it is known. A law of two states needs that of one state."""
    noise = record.noise or white_noise(record.points.count, 1.0)
    weight = noise.point_deviation**-2
    models: dict[str, RateAndState] = {}
    found: dict[str, Any] = {}
    for name in laws or record.laws:
        law = RateAndState(
            record.points, name, record.stiffness, record.distances, with_trend=record.with_trend
        )
        if law.states == 1:
            starts = law.starts(weight)
        elif law.evolution in found:
            single = law.evolution
            starts = law.second_starts(found[single].x, models[single].names, weight)
        else:
            continue
        best = _best_of(law, starts, noise)
        if best is not None:
            models[name], found[name] = law, best
    if not found:
        raise RunError("the motion of the laws along this record cannot be integrated")
    if record.noise is not None:
        return {name: _of_known_noise(law, found[name], noise) for name, law in models.items()}
    for _ in range(2):
        best = min(found, key=lambda one: found[one].cost + len(models[one].names))
        law, at = models[best], found[best].x
        noise = estimated_noise(record.points, law.residuals(at), law.jacobian(at))
        found = {name: _squares(law, found[name].x, noise) for name, law in models.items()}
    return {name: _of_estimated_noise(law, found[name], noise) for name, law in models.items()}


def _best_of(law: RateAndState, starts: Sequence[Array], noise: Noise) -> Any:
    """The least squares of several starts; with known noise, until two agree."""
    best = None
    for start in starts:
        found = _squares(law, start, noise)
        agrees = best is not None and abs(found.cost - best.cost) <= AGREEMENT * best.cost
        if best is None or found.cost < best.cost:
            best = found
        if noise.is_known and agrees:
            break
    return best


def _squares(
    law: RateAndState, start: Array, noise: Noise, free: Sequence[int] | None = None
) -> Any:
    """Least squares from a starting point, in some of the parameters or in all of them."""
    from scipy.optimize import least_squares

    chosen = np.arange(start.size) if free is None else np.array(free)
    low, high = law.bounds()
    start = np.clip(start, low + 1e-6, high - 1e-6)

    def complete(part: Array) -> Array:
        whole = start.copy()
        whole[chosen] = part
        return whole

    return least_squares(
        lambda part: noise.whitened(law.residuals(complete(part))[:, None])[:, 0],
        start[chosen],
        lambda part: noise.whitened(law.jacobian(complete(part))[:, chosen]),
        bounds=(low[chosen], high[chosen]),
        x_scale="jac",
        max_nfev=MAX_EVALUATIONS,
        xtol=1e-7,
        ftol=1e-9,
    )


def _of_known_noise(law: RateAndState, found: Any, noise: Noise) -> Fit:
    """A fit, tested against the noise; its covariance is multiplied by chi square if the law does
    not describe the record."""
    from scipy.special import chdtrc

    independent = noise.independent_points
    square = 2 * float(found.cost) / found.fun.size * independent
    freedom = max(independent - found.x.size, 1.0)
    p_value = float(chdtrc(freedom, square)) if noise.deviation > 0 else math.nan
    covariance = noise.covariance(found.jac)
    if not p_value >= MIN_P_VALUE:
        covariance = covariance * square / freedom
    step = max(1, math.ceil(found.fun.size / independent))
    return _fit(law, found, noise, covariance, p_value, found.fun[::step])


def _of_estimated_noise(law: RateAndState, found: Any, noise: Noise) -> Fit:
    """A fit, compared with laws without evolution and tested where the force evolves."""
    from scipy.special import fdtrc

    points = law.points
    parameters = law.parameters(found.x)
    steady = parameters["a"] - parameters["b"] - parameters["b2"]
    force, displacement, _ = law.forces(found.x[None, :])
    level = force[0] - parameters["trend"] * displacement[0] * law.length / law.scale
    level = level - parameters["reference_force"] / law.scale
    is_active = np.abs(level - steady / law.scale * points.log_velocity) > ACTIVE
    squares = found.fun**2
    active, quiet = squares[is_active], squares[~is_active]
    p_value = math.nan
    if min(active.size, quiet.size) >= MIN_ACTIVE + found.x.size:
        freedom = active.size - found.x.size + 2
        ratio = float(active.sum() / freedom / (quiet.sum() / quiet.size))
        p_value = float(fdtrc(freedom, quiet.size, ratio))
    fit = _fit(law, found, noise, noise.covariance(found.jac), p_value, found.fun[is_active])
    return replace(fit, improvement=_without_evolution(law, found.x, noise) - fit.chi_square)


def _fit(
    law: RateAndState, found: Any, noise: Noise, covariance: Array, p_value: float, tested: Array
) -> Fit:
    residual = law.residuals(found.x) * law.scale
    chi_square = 2 * float(found.cost)
    return Fit(law, found.x, covariance, residual, chi_square, noise, p_value, _runs(tested))


def _without_evolution(law: RateAndState, at: Array, noise: Noise) -> float:
    """Least chi square of laws without evolution: a direct effect alone, with a spring; or a steady
    force that changes with the velocity at once."""
    points = law.points
    found = []
    if all(min(one.start_velocity, one.end_velocity) > 0 for one in points.stages):
        columns = [np.ones_like(points.time), points.log_velocity]
        if law.with_trend:
            columns.append(points.load_displacement / law.length)
        whitened = noise.whitened(np.column_stack([*columns, points.force / law.scale]))
        matrix, wanted = whitened[:, :-1], whitened[:, -1]
        best, *_ = np.linalg.lstsq(matrix, wanted, rcond=None)
        found.append(float(np.sum((wanted - matrix @ best) ** 2)))
    plain = RateAndState(
        points, law.evolution, law.stiffness, law.distances, with_trend=law.with_trend
    )
    known = dict(zip(law.names, at, strict=True)) | {"b": 0.0}
    free = [index for index, one in enumerate(plain.names) if one not in {"b", "slip_distance"}]
    # From two values of a.
    for factor in (1.0, 0.2):
        shifted = known | {"a": known["a"] + math.log(factor)}
        start = np.array([shifted[one] for one in plain.names])
        found.append(2 * float(_squares(plain, start, noise, free).cost))
    return min(found)


def _runs(residuals: Array) -> float:
    """Probability of so few changes of sign of independent residuals (Wald and Wolfowitz)."""
    from scipy.special import ndtr

    signs = residuals > 0
    ups, count = int(signs.sum()), signs.size
    downs = count - ups
    if count < 2 * MIN_ACTIVE or min(ups, downs) == 0:
        return math.nan
    runs = 1 + int(np.sum(signs[1:] != signs[:-1]))
    expected = 1 + 2 * ups * downs / count
    variance = (expected - 1) * (expected - 2) / (count - 1)
    return float(ndtr((runs - expected) / math.sqrt(variance))) if variance > 0 else math.nan
