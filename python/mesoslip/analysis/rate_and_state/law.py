"""A rate-and-state law on a spring, along the points of a record.

The friction force is F = F_0 + a ln(V/V_0) + Σ b_i ln(V_0 θ_i/D_i) + c X, with one or two state
variables θ (Dieterich, J. Geophys. Res. 84, 2161 (1979); Ruina, J. Geophys. Res. 88, 10359 (1983))
and a linear trend c over the displacement X of the slider:

- ageing law: dθ/dt = 1 - V θ/D,
- slip law: dθ/dt = -(V θ/D) ln(V θ/D).

Forces are in newtons, or divided by the normal force: then they are friction coefficients, a and b
are numbers, and a stiffness is an inverse length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from mesoslip import _core
from mesoslip.analysis.rate_and_state.points import Points
from mesoslip.array_types import Array

# Laws: the evolution of the state, and the number of state variables.
LAWS = {
    "ageing": ("ageing", 1),
    "slip": ("slip", 1),
    "ageing, two states": ("ageing", 2),
    "slip, two states": ("slip", 2),
}
# Parameters of a motion, as the integrator takes them.
OF_MOTION = ("a", "b", "slip_distance", "b2", "slip_distance2", "stiffness", "trend")
# Grid of the search: a over the range of the force for an e-fold of velocity, b over a, slip
# distances and stiffnesses in a decade.
GRID_A = (0.03, 0.1, 0.3, 0.8, 2.0, 5.0)
GRID_RATIO = (0.3, 0.7, 1.0, 1.5, 3.0)
PER_DECADE = 3
STIFFNESSES = 7
# The same for the second state: b over that of one state, D over it.
SECOND_B = (-0.5, 0.3, 0.7)
SECOND_DISTANCE = (0.05, 0.2, 5.0, 20.0)
# Number of starting points.
MAX_STARTS, MAX_SECOND_STARTS = 4, 2
# Tolerances of motions in the grid and in least squares, and the step of derivatives.
GRID_TOLERANCE, TOLERANCE = 1e-4, 1e-8
DERIVATIVE_STEP = 1e-3
# Residual of a motion that cannot be integrated, in ranges of the force.
FAILED = 10.0
# Factors beyond their ranges that slip distances and stiffnesses may take, and range of a.
MARGIN = 30.0
MIN_A, MAX_A = 1e-5, 1e4
# Stiffness that stands for an infinite one, in ranges of the force over the least slip distance.
RIGID = 1e9


class RateAndState:
    """A law along the points of a record, as a function of scaled parameters.

    The parameters, in the order of `names`, are: reference force; trend; ln a; b and ln D of each
    state; ln k if it is free. Forces are divided by the range of the record.
    """

    def __init__(
        self,
        points: Points,
        name: str,
        stiffness: float,
        distances: tuple[float, float],
        *,
        with_trend: bool = False,
    ) -> None:
        """The stiffness is infinite for a slider that moves with the load point, NaN if it is free;
        distances are the range of D in the search."""
        self.points, self.name, self.stiffness = points, name, stiffness
        self.evolution, self.states = LAWS[name]
        self.distances, self.with_trend = distances, with_trend
        self.scale = points.force_range
        self.level = float(points.force.mean())
        self.length = max(float(np.ptp(points.load_displacement)), 1e-300)
        longest = max(one.max_velocity * one.duration for one in points.stages[1:])
        self.stiffnesses = (self.scale / longest, 3 * self.scale / distances[0])
        names = ["reference_force", *(["trend"] if with_trend else []), "a", "b", "slip_distance"]
        if self.states == 2:
            names += ["b2", "slip_distance2"]
        if math.isnan(stiffness):
            names.append("stiffness")
        self.names = tuple(names)
        # Scales of the parameters that are not logarithms.
        self._linear = {
            "reference_force": self.scale,
            "trend": self.scale / self.length,
            "b": self.scale,
            "b2": self.scale,
        }

    def parameters(self, at: Array) -> dict[str, Array]:
        """Parameters in SI of points of shape (..., parameters)."""
        fixed = {"trend": 0.0, "b2": 0.0, "slip_distance2": 1.0, "stiffness": self.stiffness}
        result = {name: np.full(at.shape[:-1], value) for name, value in fixed.items()}
        for name, value in zip(self.names, np.moveaxis(at, -1, 0), strict=True):
            result[name] = self._linear[name] * value if name in self._linear else np.exp(value)
        result["reference_force"] = result["reference_force"] + self.level
        result["a"] = self.scale * result["a"]
        return result

    def scaled(self, values: Array) -> Array:
        """Scaled parameters of parameters in SI, in the order of `names`, of shape (...,
        parameters)."""
        columns = []
        for name, value in zip(self.names, np.moveaxis(values, -1, 0), strict=True):
            if name in self._linear:
                level = self.level if name == "reference_force" else 0.0
                columns.append((value - level) / self._linear[name])
            else:
                columns.append(np.log(value / self.scale if name == "a" else value))
        return np.stack(columns, axis=-1)

    def factors(self, at: Array) -> Array:
        """Derivatives of the parameters in SI by the scaled ones."""
        found = self.parameters(at)
        return np.array([self._linear.get(one, found[one]) for one in self.names], dtype=float)

    def forces(
        self, at: Array, tolerance: float = TOLERANCE, *, coarse: bool = False
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Forces over the range and displacements over that of the load point of sets of
        parameters, shape (sets, points); whether each set failed."""
        points, found = self.points, self.parameters(at)
        table = np.stack([found[name] for name in OF_MOTION])
        stiffness, trend = table[-2:]
        np.minimum(stiffness, RIGID * self.scale / self.distances[0], out=stiffness)
        # A trend that is steeper than the spring has no motion.
        wrong = stiffness + trend <= 0
        trend[wrong] = 0.0
        times = points.time
        if not coarse:
            # Two points in time have the mean of a cubic over the samples.
            times = np.stack([times - points.spread, times + points.spread], axis=1).ravel()
            times = np.maximum.accumulate(np.maximum(times, 0.0))
        force, displacement, failed, status, message = _core.rate_and_state_motions(
            self.evolution,
            self.states,
            np.asfortranarray(table),
            points.reference_velocity,
            np.array([one.duration for one in points.stages]),
            np.array([one.start_velocity for one in points.stages]),
            np.array([one.end_velocity for one in points.stages]),
            times,
            tolerance,
        )
        assert status == 0, message
        if not coarse:
            force, displacement = (0.5 * (one[::2] + one[1::2]) for one in (force, displacement))
        force = (force.T + found["reference_force"][:, None]) / self.scale
        return force, displacement.T / self.length, (failed != 0) | wrong

    def residuals(self, at: Array) -> Array:
        """Record minus law, over the range."""
        force, _, failed = self.forces(at[None, :])
        if failed[0]:
            return np.full(self.points.force.size, FAILED)
        found: Array = np.clip(self.points.force / self.scale - force[0], -FAILED, FAILED)
        return found

    def jacobian(self, at: Array) -> Array:
        """Derivatives of the residuals, shape (points, parameters)."""
        steps = DERIVATIVE_STEP * np.eye(at.size)
        force, _, failed = self.forces(np.concatenate([at + steps, at - steps]))
        # The motion on one side may be unstable.
        if failed.any():
            force[failed] = self.forces(at[None, :])[0][0]
        forward, backward = np.split(force, 2)
        sides = 2 - np.sum(np.split(failed, 2), axis=0)
        slopes: Array = (backward - forward).T / (DERIVATIVE_STEP * np.maximum(sides, 1))
        return slopes

    def bounds(self) -> tuple[Array, Array]:
        near, far = self.distances[0] / MARGIN, self.distances[1] * MARGIN
        ranges = {
            "a": (MIN_A, MAX_A),
            "slip_distance": (near, far),
            "slip_distance2": (near, far),
            "stiffness": (self.stiffnesses[0] / MARGIN, self.stiffnesses[1] * MARGIN),
        }
        low, high = np.full(len(self.names), -np.inf), np.full(len(self.names), np.inf)
        for index, name in enumerate(self.names):
            if name in ranges:
                low[index], high[index] = np.log(ranges[name])
        return low, high

    def starts(self, weight: Array) -> list[Array]:
        """Starting points: the best of a grid for each slip distance, the best of these first; the
        weight of each point in the sum of squares is given."""
        ratios = [
            abs(math.log(later.start_velocity / earlier.end_velocity))
            for earlier, later in pairwise(self.points.stages)
            if min(later.start_velocity, earlier.end_velocity) > 0
        ]
        unit = max([one for one in ratios if one > 0.1], default=3.0)
        low, high = np.log(self.distances)
        distances = np.linspace(low, high, 1 + max(2, round(PER_DECADE * (high - low) / 2.3)))
        least, most = np.log(self.stiffnesses)
        stiffnesses = np.linspace(least, most, STIFFNESSES)
        if "stiffness" not in self.names:
            stiffnesses = stiffnesses[:1]
        rows = []
        for distance, a, ratio, stiffness in product(distances, GRID_A, GRID_RATIO, stiffnesses):
            row = {"a": math.log(a / unit), "b": ratio * a / unit, "slip_distance": distance}
            rows.append([{**row, "stiffness": stiffness}.get(name, 0.0) for name in self.names])
        return self._best(np.array(rows), "slip_distance", weight)

    def second_starts(self, first: Array, names: Sequence[str], weight: Array) -> list[Array]:
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
        return self._best(np.array(rows), "slip_distance2", weight)[:MAX_SECOND_STARTS]

    def _best(self, rows: Array, group: str, weight: Array) -> list[Array]:
        """The best row for each value of a parameter, with its best level and trend."""
        force, displacement, failed = self.forces(rows, GRID_TOLERANCE, coarse=True)
        weight = weight / weight.sum()
        residual = self.points.force / self.scale - force
        level = residual @ weight
        residual -= level[:, None]
        if self.with_trend:
            middle = displacement @ weight
            displacement -= middle[:, None]
            size = np.maximum(displacement**2 @ weight, 1e-300)
            trend = (residual * displacement) @ weight / size
            residual -= trend[:, None] * displacement
            rows[:, 1] += trend
            level -= trend * middle
        rows[:, 0] += level
        cost = np.where(failed, np.inf, residual**2 @ weight)
        values = rows[:, self.names.index(group)]
        best = []
        for value in np.unique(values):
            mine = np.flatnonzero(values == value)
            best.append(mine[np.argmin(cost[mine])])
        # Minima over the slip distance first.
        costs = cost[best]
        around = np.concatenate([[np.inf], costs, [np.inf]])
        is_minimum = (costs <= around[:-2]) & (costs <= around[2:])
        order = np.lexsort((costs, ~is_minimum))
        return [rows[best[one]] for one in order if math.isfinite(costs[one])][:MAX_STARTS]
