"""Least-squares fits of rate-and-state laws to records of the force."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.rate_and_state.motion import RateAndState, spring_slider
from mesoslip.analysis.rate_and_state.record import Record
from mesoslip.errors import RunError

Array = NDArray[np.float64]

# Relative tolerance of the motion in a fit.
TOLERANCE = 1e-8
# Step in the logarithm of a parameter for derivatives, well above that.
DERIVATIVE_STEP = 1e-4
# Maximum factor between a parameter and its scale in the record.
MAX_FACTOR = 1e4
# The same for the stiffness.
MAX_STIFFNESS_FACTOR = 100.0
# Maximum difference of the reference force and the initial force, in ranges of the record.
MAX_SHIFT = 100.0
# Starting points of the search, over the scales of the record: a and b, and D_c.
START_RATES = (0.02, 0.06, 0.2, 0.6)
START_LENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0)
# Relative tolerance of the motion there.
START_TOLERANCE = 1e-5
# Number of starting points from which the fit is run, until two results agree.
BEST_STARTS = 4
AGREEMENT = 1e-3
# Residuals of parameters whose motion cannot be integrated, in ranges of the record.
FAILED_RESIDUAL = 10.0
# Minimum probability of the residuals of an adequate law. It is small, as the noise itself is
# estimated from the steady parts of the record.
MIN_P_VALUE = 0.001


@dataclass(frozen=True)
class Fit:
    """A law fitted to a record.

    Attributes
    ----------
    law
        The law with its parameters.
    stiffness
        Stiffness of the spring.
    covariance
        Covariance of reference force, a, b, D_c and, if it was free, the stiffness.
    residual
        Record minus law at each point.
    chi_square
        Mean square of the residuals over their standard deviations.
    independent_points
        Equivalent number of independent points.
    p_value, runs_p_value
        Probability of such residuals by noise alone; of so few changes of their sign by chance.
    at_bounds
        Names of the parameters at the bounds of the search, which the record does not determine.
    """

    law: RateAndState
    stiffness: float
    covariance: Array
    residual: Array
    chi_square: float
    independent_points: float
    p_value: float
    runs_p_value: float
    at_bounds: tuple[str, ...]

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals [N]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    def relative_misfit(self, record: Record) -> float:
        """The misfit over the standard deviation of the record; NaN for a constant force."""
        variation = float(record.force.std())
        return self.misfit / variation if variation > 0 else math.nan

    @property
    def errors(self) -> Array:
        """Standard errors of reference force, a, b, D_c and, if it was free, the stiffness."""
        errors: Array = np.sqrt(np.diag(self.covariance))
        return errors

    @property
    def information_criterion(self) -> float:
        """Akaike's criterion, for the number of independent points."""
        return self.independent_points * self.chi_square + 2 * len(self.covariance)


def fit(record: Record, law: str, *, free_stiffness: bool = False) -> Fit:
    """Fit a law to a record by least squares in the logarithms of a, b, D_c (and the stiffness).

    The Levenberg-Marquardt method within bounds (`scipy.optimize.least_squares`), from the best of
    many starting points. The covariance is that of correlated residuals, (JᵀJ)⁻¹ Jᵀ C J (JᵀJ)⁻¹
    with the correlation C of the noise; it is multiplied by χ² if the law does not describe the
    record.

    Raises
    ------
    RunError
        If the motion cannot be integrated for any parameters.
    """
    from scipy.optimize import least_squares

    scale, length = record.force_scale, record.length_scale
    free = free_stiffness and math.isfinite(record.stiffness)
    level = float(record.force[: max(1, record.force.size // 20)].mean())

    failed = FAILED_RESIDUAL * scale / record.deviation

    def model(at: Array) -> tuple[RateAndState, float]:
        stiffness = record.stiffness * math.exp(at[4]) if free else record.stiffness
        a, b = scale * math.exp(at[1]), scale * math.exp(at[2])
        slip = length * math.exp(at[3])
        return RateAndState(
            level + scale * at[0], record.reference_velocity, a, b, slip, law
        ), stiffness

    def residuals(at: Array, tolerance: float = TOLERANCE) -> Array:
        parameters, stiffness = model(at)
        try:
            motion = spring_slider(
                parameters, record.stages, record.time, stiffness, tolerance=tolerance
            )
        except RunError:
            return failed
        found: Array = (record.force - motion.force) / record.deviation
        return found if np.all(np.abs(found) <= failed) else failed

    bound = np.full(5 if free else 4, math.log(MAX_FACTOR))
    bound[0] = MAX_SHIFT
    if free:
        bound[4] = math.log(MAX_STIFFNESS_FACTOR)

    def jacobian(at: Array) -> Array:
        """Difference quotients; the force is linear in the reference force."""
        middle = residuals(at)
        columns = [-scale / record.deviation]
        for index in range(1, at.size):
            column = np.zeros_like(middle)
            # The motion on one side may be unstable.
            for step in (DERIVATIVE_STEP, -DERIVATIVE_STEP):
                moved = at.copy()
                moved[index] += step
                beside = residuals(moved)
                if not np.array_equal(beside, failed):
                    column = (beside - middle) / step
                    break
            columns.append(column)
        return np.stack(columns, axis=1)

    best = None
    for start in _starts(residuals, failed, bound.size, record):
        found = least_squares(
            residuals, start, jacobian, bounds=(-bound, bound), x_scale="jac", max_nfev=60
        )
        agrees = best is not None and abs(found.cost - best.cost) <= AGREEMENT * best.cost
        if best is None or found.cost < best.cost:
            best = found
        if agrees:
            break
    if best is None or np.array_equal(best.fun, failed):
        raise RunError("the motion of the law along this record cannot be integrated")
    return _result(record, best, *model(best.x), free, bound)


def _starts(
    residuals: Callable[[Array, float], Array], failed: Array, size: int, record: Record
) -> Iterator[Array]:
    """Starting points: the best of a grid of rates and lengths, each with its best level."""
    tried = []
    for a in START_RATES:
        for b in START_RATES:
            for length in START_LENGTHS:
                at = np.zeros(size)
                at[1:4] = np.log([a, b, length])
                found = residuals(at, START_TOLERANCE)
                if np.array_equal(found, failed):
                    continue
                # The force is linear in the reference force.
                weight = 1 / record.deviation
                level = float(np.sum(weight * found) / np.sum(weight**2))
                at[0] = level / record.force_scale
                tried.append((float(np.sum((found - level * weight) ** 2)), at))
    tried.sort(key=lambda one: one[0])
    yield from (at for _, at in tried[:BEST_STARTS])


def _result(
    record: Record, found: Any, law: RateAndState, stiffness: float, free: bool, bound: Array
) -> Fit:
    """The result of the search, with errors and tests of the residuals."""
    from scipy.special import chdtrc

    # From logarithms to the parameters themselves.
    factor = np.array([record.force_scale, law.a, law.b, law.slip_distance] + [stiffness] * free)
    inverse = np.linalg.pinv(found.jac.T @ found.jac)
    covariance = inverse @ (found.jac.T @ record.correlation @ found.jac) @ inverse
    count = found.fun.size
    independent = count**2 / float(np.sum(record.correlation**2))
    square = float(np.mean(found.fun**2))
    freedom = max(independent - factor.size, 1.0)
    p_value = float(chdtrc(freedom, square * independent)) if record.has_noise else math.nan
    if not record.has_noise or p_value < MIN_P_VALUE:
        covariance = covariance * square * independent / freedom
    names = ("reference force", "a", "b", "D_c", "stiffness")
    at_bounds = tuple(
        name
        for name, value, limit in zip(names, found.x, bound, strict=False)
        if abs(value) > 0.98 * limit
    )
    return Fit(
        law,
        stiffness,
        covariance * np.outer(factor, factor),
        found.fun * record.deviation,
        square,
        independent,
        p_value,
        _runs_p_value(found.fun, independent),
        at_bounds,
    )


def _runs_p_value(residuals: Array, independent: float) -> float:
    """Probability of so few changes of sign of independent residuals (Wald and Wolfowitz)."""
    from scipy.special import ndtr

    step = max(1, math.ceil(residuals.size / independent))
    above = residuals[::step] > 0
    ups, downs = int(above.sum()), int((~above).sum())
    count = ups + downs
    if min(ups, downs) == 0:
        return 0.0 if count > 5 else math.nan
    runs = 1 + int(np.sum(above[1:] != above[:-1]))
    expected = 1 + 2 * ups * downs / count
    variance = (expected - 1) * (expected - 2) / max(count - 1, 1)
    return float(ndtr((runs - expected) / math.sqrt(variance))) if variance > 0 else math.nan
