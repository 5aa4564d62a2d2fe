"""Rate-and-state laws fitted to measured records: search over decades, least squares, errors.

The slip distance is searched from the resolution of the record to its length, with a, b and, if it
is unknown, the stiffness of the spring. Least squares start from the best points for several slip
distances. Residuals are weighted with the noise, which is estimated from them with its correlation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.rate_and_state.correlated import CorrelatedNoise, estimate, white_noise
from mesoslip.analysis.rate_and_state.points import Points, motions
from mesoslip.errors import RunError

Array = NDArray[np.float64]

# Laws that are fitted: the evolution of the state, and the number of state variables.
MEASURED_LAWS = {
    "ageing": ("ageing", 1),
    "slip": ("slip", 1),
    "ageing, two states": ("ageing", 2),
    "slip, two states": ("slip", 2),
}
# Grid of the search: a over the range of the force for an e-fold of velocity, b over a, slip
# distances and stiffnesses in a decade.
GRID_A = (0.03, 0.1, 0.3, 0.8, 2.0, 5.0)
GRID_RATIO = (0.3, 0.7, 1.0, 1.5, 3.0)
PER_DECADE = 3
STIFFNESSES = 7
# The same for the second state: b over that of one state, D over it.
SECOND_B = (-0.5, 0.3, 0.7)
SECOND_DISTANCE = (0.05, 0.2, 5.0, 20.0)
# Tolerances of motions in the grid and in least squares, and the step of derivatives.
GRID_TOLERANCE, TOLERANCE = 1e-4, 1e-8
DERIVATIVE_STEP = 1e-3
# Starts of least squares, and their maximum number of evaluations.
MAX_STARTS, MAX_SECOND_STARTS = 4, 2
MAX_EVALUATIONS = 40
# Residual of a motion that cannot be integrated, in ranges of the force.
FAILED = 10.0
# Minimum noise of a sample over the range of the force: errors of the motion.
MIN_NOISE = 1e-6
# Improvement of chi square over laws without evolution that makes it stand out of the noise, and
# maximum relative errors of parameters that count as determined.
MIN_IMPROVEMENT = 25.0
MAX_ERROR = 0.25
# Deviation from steady sliding, over the range of the force, in which a law is tested.
ACTIVE = 0.02
MIN_ACTIVE = 8
# Minimum probability of the residuals of an adequate law.
MIN_P_VALUE = 0.001
# Decades beyond its range that least squares may take a slip distance or stiffness.
MARGIN = math.log(30.0)


class Model:
    """Forces of a law at the points of a record, as a function of scaled parameters.

    The parameters are: reference force; trend; ln a; b and ln D of each state; ln k if it is free.
    Forces are divided by the range of the record.

    Parameters
    ----------
    points
        The record.
    law
        Name in `MEASURED_LAWS`.
    stiffness
        Stiffness of the spring; NaN if it is free.
    with_trend
        Whether friction has a linear trend with displacement.
    """

    def __init__(self, points: Points, law: str, stiffness: float, with_trend: bool) -> None:
        self.points, self.law, self.stiffness = points, law, stiffness
        self.evolution, self.states = MEASURED_LAWS[law]
        self.with_trend = with_trend
        self.scale = points.force_range
        self.level = float(points.force.mean())
        self.length = max(float(np.ptp(points.load_displacement)), 1e-300)
        longest = max(
            max(one.start_velocity, one.end_velocity) * one.duration for one in points.stages[1:]
        )
        self.distances = (points.max_velocity * points.interval, 2 * max(longest, 1e-300))
        self.stiffnesses = (self.scale / longest, 3 * self.scale / self.distances[0])
        names = ["reference_force", *(["trend"] if with_trend else []), "a", "b", "slip_distance"]
        if self.states == 2:
            names += ["b2", "slip_distance2"]
        if math.isnan(stiffness):
            names.append("stiffness")
        self.names = tuple(names)

    def parameters(self, at: Array) -> dict[str, Array]:
        """Parameters in SI of points of shape (..., parameters)."""
        found = dict(zip(self.names, np.moveaxis(at, -1, 0), strict=True))
        result = {
            "reference_force": self.level + self.scale * found["reference_force"],
            "trend": self.scale / self.length * found.get("trend", np.zeros(at.shape[:-1])),
        }
        for name, value in found.items():
            if name in {"b", "b2"}:
                result[name] = self.scale * value
            elif name == "a":
                result[name] = self.scale * np.exp(value)
            elif name not in result:
                result[name] = np.exp(value)
        if "stiffness" not in result:
            result["stiffness"] = np.full(at.shape[:-1], self.stiffness)
        return result

    def factors(self, at: Array) -> Array:
        """Derivatives of the parameters in SI by the scaled ones."""
        found = self.parameters(at)
        linear = {
            "reference_force": self.scale,
            "trend": self.scale / self.length,
            "b": self.scale,
            "b2": self.scale,
        }
        return np.array([linear.get(name, found[name]) for name in self.names], dtype=float)

    def forces(self, at: Array, tolerance: float = TOLERANCE, *, coarse: bool = False) -> Any:
        """Forces of sets of parameters and displacements, over the range, (sets, points); whether
        each failed."""
        found = self.parameters(at)
        zero, one = np.zeros(len(at)), np.ones(len(at))
        second = [found.get("b2", zero), found.get("slip_distance2", one)]
        table = np.stack(
            [
                found["a"],
                found["b"],
                found["slip_distance"],
                *second,
                found["stiffness"],
                found["trend"],
            ],
            axis=1,
        )
        # A trend that is steeper than the spring has no motion.
        wrong = table[:, 5] + table[:, 6] <= 0
        table[wrong, 6] = 0.0
        force, displacement, failed = motions(
            self.points, self.evolution, self.states, table, tolerance, coarse=coarse
        )
        force = (force + found["reference_force"][:, None]) / self.scale
        return force, displacement / self.length, failed | wrong

    def residuals(self, at: Array, tolerance: float = TOLERANCE) -> Array:
        """Record minus law, over the range."""
        force, _, failed = self.forces(at[None, :], tolerance)
        if failed[0]:
            return np.full(self.points.force.size, FAILED)
        found: Array = np.clip(self.points.force / self.scale - force[0], -FAILED, FAILED)
        return found

    def jacobian(self, at: Array) -> Array:
        """Derivatives of the residuals, shape (points, parameters)."""
        size = at.size
        steps = DERIVATIVE_STEP * np.concatenate([np.eye(size), -np.eye(size)])[:, :]
        moved = np.concatenate([at[None, :] + steps])
        force, _, failed = self.forces(moved)
        forward, backward = force[:size], force[size:]
        middle = None
        columns = []
        for index in range(size):
            if not failed[index] and not failed[size + index]:
                slope = (forward[index] - backward[index]) / (2 * DERIVATIVE_STEP)
            else:
                if middle is None:
                    middle = self.forces(at[None, :])[0][0]
                if not failed[index]:
                    slope = (forward[index] - middle) / DERIVATIVE_STEP
                elif not failed[size + index]:
                    slope = (middle - backward[index]) / DERIVATIVE_STEP
                else:
                    slope = np.zeros_like(middle)
            columns.append(-slope)
        return np.stack(columns, axis=1)

    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the search."""
        low, high = np.full(len(self.names), -np.inf), np.full(len(self.names), np.inf)
        for index, name in enumerate(self.names):
            if name.startswith("slip_distance"):
                ends = self.distances
            elif name == "stiffness":
                ends = self.stiffnesses
            elif name == "a":
                low[index], high[index] = math.log(1e-5), math.log(1e4)
                continue
            else:
                continue
            low[index], high[index] = math.log(ends[0]) - MARGIN, math.log(ends[1]) + MARGIN
        return low, high

    def starts(self) -> list[Array]:
        """Starting points: the best of a grid for each slip distance, the best of these first."""
        ratios = [
            abs(math.log(later.start_velocity / earlier.end_velocity))
            for earlier, later in pairwise(self.points.stages)
            if min(later.start_velocity, earlier.end_velocity) > 0
        ]
        unit = max([one for one in ratios if one > 0.1], default=3.0)
        low, high = np.log(self.distances)
        distances = np.linspace(low, high, 1 + max(2, round(PER_DECADE * (high - low) / 2.3)))
        stiffnesses = [math.nan]
        if "stiffness" in self.names:
            least, most = np.log(self.stiffnesses)
            stiffnesses = list(np.linspace(least, most, STIFFNESSES))
        rows = []
        for distance, a, ratio, stiffness in product(distances, GRID_A, GRID_RATIO, stiffnesses):
            row = {"a": math.log(a / unit), "b": ratio * a / unit, "slip_distance": distance}
            rows.append([{**row, "stiffness": stiffness}.get(name, 0.0) for name in self.names])
        return self._best(np.array(rows), self.names.index("slip_distance"))

    def second_starts(self, first: Array, names: Sequence[str]) -> list[Array]:
        """Starting points with a second state beside the law of one state."""
        known = dict(zip(names, first, strict=True))
        rows = []
        for b, distance in product(SECOND_B, SECOND_DISTANCE):
            row = known | {
                "b": known["b"] * (1 - b),
                "b2": known["b"] * b,
                "slip_distance2": known["slip_distance"] + math.log(distance),
            }
            rows.append([row[name] for name in self.names])
        return self._best(np.array(rows), self.names.index("slip_distance2"))

    def _best(self, rows: Array, group: int) -> list[Array]:
        """The best row for each value of a column, with its best level and trend."""
        force, displacement, failed = self.forces(rows, GRID_TOLERANCE, coarse=True)
        weight = np.sqrt(self.points.count)
        residual = (self.points.force / self.scale - force) * weight
        basis = [np.broadcast_to(weight, residual.shape)]
        if self.with_trend:
            basis.append(displacement * weight)
        # Least squares by Gram-Schmidt, row by row.
        found = np.zeros((len(rows), len(basis)))
        first = basis[0]
        norm = np.sum(first * first, axis=1)
        found[:, 0] = np.sum(residual * first, axis=1) / norm
        if self.with_trend:
            share = np.sum(basis[1] * first, axis=1) / norm
            other = basis[1] - share[:, None] * first
            size = np.maximum(np.sum(other * other, axis=1), 1e-300)
            found[:, 1] = np.sum(residual * other, axis=1) / size
            found[:, 0] -= found[:, 1] * share
        for index, one in enumerate(basis):
            residual = residual - found[:, index : index + 1] * one
        cost = np.where(failed, np.inf, np.sum(residual**2, axis=1))
        rows = rows.copy()
        rows[:, : found.shape[1]] += found
        chosen = []
        for value in np.unique(rows[:, group]):
            mine = np.flatnonzero(rows[:, group] == value)
            best = mine[np.argmin(cost[mine])]
            if math.isfinite(cost[best]):
                chosen.append((float(cost[best]), best))
        if not chosen:
            return []
        # Minima over the slip distance first.
        costs = np.array([one[0] for one in chosen])
        around = np.concatenate([[np.inf], costs, [np.inf]])
        is_minimum = (costs <= around[:-2]) & (costs <= around[2:])
        order = np.lexsort((costs, ~is_minimum))
        return [rows[chosen[one][1]] for one in order[:MAX_STARTS]]


@dataclass(frozen=True)
class MeasuredFit:
    """A law fitted to a measured record.

    Attributes
    ----------
    model
        The law.
    at
        Scaled parameters.
    covariance
        Their covariance.
    residual
        Record minus law, in the unit of the force.
    chi_square
        Sum of the squares of the residuals over the noise.
    noise
        Noise, over the range of the record.
    improvement
        Decrease of chi square from the best law without evolution.
    p_value, runs_p_value
        Probability of residuals as large where the force evolves, compared with those where it is
        steady; of so few changes of their sign.
    """

    model: Model
    at: Array
    covariance: Array
    residual: Array
    chi_square: float
    noise: CorrelatedNoise
    improvement: float
    p_value: float
    runs_p_value: float

    def value(self, name: str) -> float:
        """A parameter in SI; a_minus_b too."""
        found = self.model.parameters(self.at)
        if name == "a_minus_b":
            return float(found["a"] - found["b"] - found.get("b2", 0.0))
        return float(found[name])

    def error(self, name: str) -> float:
        """Its standard error; 0 if it was given."""
        if name == "a_minus_b":
            wanted = {"a": 1.0, "b": -1.0, "b2": -1.0}
            gradient = np.array([wanted.get(one, 0.0) for one in self.model.names])
        elif name in self.model.names:
            gradient = np.array([float(one == name) for one in self.model.names])
        else:
            return 0.0
        gradient = gradient * self.model.factors(self.at)
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    @property
    def information_criterion(self) -> float:
        """Akaike's criterion with the correction for the number of independent points."""
        size = self.at.size
        count = max(self.noise.independent_points, size + 2.0)
        return self.chi_square + 2 * size + 2 * size * (size + 1) / (count - size - 1)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the parameters that the record does not determine."""
        names = {"a": "a", "b": "b", "slip_distance": "D_c", "b2": "b2", "slip_distance2": "D_c2"}
        low, high = self.model.bounds()
        found = []
        for index, name in enumerate(self.model.names):
            is_at_bound = self.at[index] - low[index] < 0.05 or high[index] - self.at[index] < 0.05
            if name in names and (
                is_at_bound or not self.error(name) < MAX_ERROR * abs(self.value(name))
            ):
                found.append(names[name])
        return tuple(found)

    @property
    def stands_out(self) -> bool:
        """Whether the evolution stands out of the noise."""
        return self.improvement > MIN_IMPROVEMENT

    @property
    def is_described(self) -> bool:
        """Whether the law describes the record within its noise."""
        return not self.p_value < MIN_P_VALUE and not self.runs_p_value < MIN_P_VALUE

    @property
    def relative_misfit(self) -> float:
        """Residual over the standard deviation of the record."""
        weight = self.model.points.count / self.model.points.count.sum()
        spread = math.sqrt(float(np.cov(self.model.points.force, aweights=weight)))
        return math.sqrt(float(np.sum(weight * self.residual**2))) / max(spread, 1e-300)


def fit_laws(
    points: Points,
    stiffness: float,
    *,
    with_trend: bool = True,
    laws: Sequence[str] = tuple(MEASURED_LAWS),
) -> dict[str, MeasuredFit]:
    """Fit laws to a measured record, all with the noise about the best of them.

    Parameters
    ----------
    points
        The record.
    stiffness
        Stiffness of the spring, unit of the force over metre; NaN if it is fitted.
    with_trend
        Whether a linear trend with displacement is fitted.
    laws
        Names in `MEASURED_LAWS`; one of two states needs that of one state.

    Raises
    ------
    RunError
        If the motion cannot be integrated for any parameters.
    """
    noise = white_noise(points.count, 1.0)
    models: dict[str, Model] = {}
    found: dict[str, Any] = {}
    for law in laws:
        model = Model(points, law, stiffness, with_trend)
        if model.states == 1:
            starts = model.starts()
        else:
            single = MEASURED_LAWS[law][0]
            if single not in found:
                continue
            starts = model.second_starts(found[single].x, models[single].names)
            starts = starts[:MAX_SECOND_STARTS]
        best = _best_of(model, starts, noise)
        if best is not None:
            models[law], found[law] = model, best
    if not found:
        raise RunError("the motion of the laws along this record cannot be integrated")
    for _ in range(2):
        law = min(found, key=lambda one: found[one].cost + len(models[one].names))
        noise = _noise(models[law], found[law].x)
        for one, model in models.items():
            found[one] = _squares(model, found[one].x, noise)
    result = {}
    for law, model in models.items():
        result[law] = _result(model, found[law], noise)
    return result


def _best_of(model: Model, starts: Sequence[Array], noise: CorrelatedNoise) -> Any:
    """The least squares of several starts."""
    best = None
    for start in starts:
        found = _squares(model, start, noise)
        if best is None or found.cost < best.cost:
            best = found
    return best


def _squares(model: Model, start: Array, noise: CorrelatedNoise) -> Any:
    """Least squares from a starting point."""
    from scipy.optimize import least_squares

    low, high = model.bounds()

    def residuals(at: Array) -> Array:
        return noise.whitened(model.residuals(at)[:, None])[:, 0]

    def jacobian(at: Array) -> Array:
        return noise.whitened(model.jacobian(at))

    return least_squares(
        residuals,
        np.clip(start, low + 1e-6, high - 1e-6),
        jacobian,
        bounds=(low, high),
        x_scale="jac",
        max_nfev=MAX_EVALUATIONS,
        xtol=1e-7,
        ftol=1e-9,
    )


def _noise(model: Model, at: Array) -> CorrelatedNoise:
    """The noise about a law."""
    points = model.points
    return estimate(
        points.time,
        points.spread,
        points.count,
        points.interval,
        model.residuals(at),
        model.jacobian(at),
        MIN_NOISE,
    )


def _result(model: Model, found: Any, noise: CorrelatedNoise) -> MeasuredFit:
    """A fit with its errors and tests."""
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    chi_square = 2 * float(found.cost)
    improvement = _without_evolution(model, found.x, noise) - chi_square
    p_value, runs = _tests(model, found)
    return MeasuredFit(
        model,
        found.x,
        covariance,
        model.residuals(found.x) * model.scale,
        chi_square,
        noise,
        improvement,
        p_value,
        runs,
    )


def _without_evolution(model: Model, at: Array, noise: CorrelatedNoise) -> float:
    """Least chi square of laws without evolution: a direct effect alone, with a spring; or a steady
    force that changes with the velocity at once."""
    points = model.points
    values = points.force[:, None] / model.scale
    found = []
    if all(min(one.start_velocity, one.end_velocity) > 0 for one in points.stages):
        columns = [np.ones_like(points.time), points.log_velocity]
        if model.with_trend:
            columns.append(points.load_displacement / model.length)
        matrix = noise.whitened(np.stack(columns, axis=1))
        wanted = noise.whitened(values)[:, 0]
        best, *_ = np.linalg.lstsq(matrix, wanted, rcond=None)
        found.append(float(np.sum((wanted - matrix @ best) ** 2)))
    plain = Model(points, model.evolution, model.stiffness, model.with_trend)
    shape = dict(zip(model.names, at, strict=True)) | {"b": 0.0}
    fixed = np.array([shape[name] for name in plain.names])
    free = [index for index, name in enumerate(plain.names) if name not in {"b", "slip_distance"}]
    found += [_direct_effect(plain, fixed, free, shift, noise) for shift in (0.0, math.log(0.2))]
    return min(found)


def _direct_effect(
    model: Model, fixed: Array, free: Sequence[int], shift: float, noise: CorrelatedNoise
) -> float:
    """Least chi square with some parameters free, from a start with another a."""
    from scipy.optimize import least_squares

    low, high = model.bounds()

    def complete(part: Array) -> Array:
        whole = fixed.copy()
        whole[free] = part
        return whole

    start = fixed.copy()
    start[model.names.index("a")] += shift
    found = least_squares(
        lambda part: noise.whitened(model.residuals(complete(part))[:, None])[:, 0],
        np.clip(start[free], low[free] + 1e-6, high[free] - 1e-6),
        lambda part: noise.whitened(model.jacobian(complete(part))[:, free]),
        bounds=(low[free], high[free]),
        x_scale="jac",
        max_nfev=40,
    )
    return 2 * float(found.cost)


def _tests(model: Model, found: Any) -> tuple[float, float]:
    """Probabilities of the residuals where the force evolves, and of their signs."""
    from scipy.special import fdtrc

    points = model.points
    parameters = model.parameters(found.x)
    steady = parameters["a"] - parameters["b"] - parameters.get("b2", 0.0)
    force, displacement, _ = model.forces(found.x[None, :])
    level = force[0] - parameters["trend"] * displacement[0] * model.length / model.scale
    level = level - parameters["reference_force"] / model.scale
    is_active = np.abs(level - steady / model.scale * points.log_velocity) > ACTIVE
    squares = found.fun**2
    active, quiet = squares[is_active], squares[~is_active]
    p_value = math.nan
    if min(active.size, quiet.size) >= MIN_ACTIVE + found.x.size:
        freedom = active.size - found.x.size + 2
        ratio = float(active.sum() / freedom / (quiet.sum() / quiet.size))
        p_value = float(fdtrc(freedom, quiet.size, ratio))
    return p_value, _runs(found.fun[is_active])


def _runs(residuals: Array) -> float:
    """Probability of so few changes of sign of independent residuals (Wald and Wolfowitz)."""
    from scipy.special import ndtr

    ups = int(np.sum(residuals > 0))
    downs = residuals.size - ups
    if residuals.size < 2 * MIN_ACTIVE or min(ups, downs) == 0:
        return math.nan
    signs = residuals > 0
    runs = 1 + int(np.sum(signs[1:] != signs[:-1]))
    expected = 1 + 2 * ups * downs / residuals.size
    variance = (expected - 1) * (expected - 2) / (residuals.size - 1)
    return float(ndtr((runs - expected) / math.sqrt(variance))) if variance > 0 else math.nan
