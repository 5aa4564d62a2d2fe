"""The posterior by rounds of simulations that converge on it.

The first round covers the prior. After each round the synthetic likelihood is learnt from the
simulations of the region, and the next round is drawn from its posterior, widened by a factor of
two; the new region contains it. When the posterior is not much narrower than the region, the
remaining simulations are made there. The misfit of a likelihood learnt over a wide region counts as
noise, so that early posteriors are too wide rather than biased.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.errors import RunError
from mesoslip.inference.likelihood import Projection, Surrogate, learn, project, usable
from mesoslip.inference.sampler import draw
from mesoslip.inference.simulations import Simulations

# Fractions of the simulations in the first round and in each of the next ones, their minimum
# numbers, and the maximum fraction before the region is final.
FIRST, NEXT = 0.16, 0.12
MIN_FIRST, MIN_NEXT = 100, 60
MAX_SEARCH = 0.65
# Width of a round over that of the posterior.
WIDTH = 2.0
# Maximum width of the region over that of the posterior for a final region, and minimum number of
# rounds.
MAX_RATIO = 3.2
MIN_ROUNDS = 3
# Fraction of a round inside the region.
INSIDE = 0.98
# Draws of each chain during the search and at the end, and chains at the end.
ROUGH, FINE = 500, 1000
CHAINS = 4
# Maximum number of starting points of a chain.
STARTS = 40
# Minimum number of simulations for a likelihood.
MIN_VALID = 40
# Factor by which the limit of a region with fewer simulations is increased.
GROWTH = 1.5
# Simulations with all contacts, if the others have fewer: fraction of all, and minimum number.
EXACT = 0.05
MIN_EXACT = 60
# Minimum width of the region on the unit cube.
MIN_WIDTH = 1e-6


@dataclass(frozen=True)
class Region:
    """An ellipsoid on the unit cube: centre, inverse covariance, and maximum squared distance."""

    centre: Array
    inverse: Array
    limit: float

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Whether each point, of shape (points, parameters), lies in the region."""
        inside = self.distance(points) <= self.limit
        return np.asarray(inside & np.all((points >= 0) & (points <= 1), axis=1))

    def distance(self, points: Array) -> Array:
        """Squared distances of points from the centre, shape (points,)."""
        away = points - self.centre
        return np.asarray(np.einsum("ij,jk,ik->i", away, self.inverse, away))

    @classmethod
    def around(cls, points: Array) -> Region:
        """The ellipsoid that contains a fraction `INSIDE` of the points."""
        covariance = np.cov(points.T).reshape(points.shape[1], -1)
        covariance += MIN_WIDTH**2 * np.eye(points.shape[1])
        whole = cls(points.mean(axis=0), np.asarray(np.linalg.inv(covariance)), np.inf)
        limit = float(np.quantile(whole.distance(points), INSIDE))
        return cls(whole.centre, whole.inverse, limit)


@dataclass(frozen=True)
class Estimate:
    """The posterior after a round."""

    chains: Array
    """Draws from the posterior on the unit cube, shape (chains, draws, parameters)."""
    projection: Projection
    surrogate: Surrogate
    statistics: Array
    """Statistics of the trace."""
    coverage: tuple[float, float]
    """Fractions of the simulations inside the 50 % and the 90 % regions of the likelihood."""
    parameters: Array
    summaries: Array
    """Those of the simulations that the likelihood was learnt from."""
    ratio: float
    """Width of their region over that of the posterior, the maximum over the parameters."""

    @property
    def draws(self) -> Array:
        """Draws of all chains, shape (draws, parameters)."""
        return self.chains.reshape(-1, self.chains.shape[-1])


def estimate_posterior(
    simulations: Simulations, observed: Array, total: int, rng: np.random.Generator
) -> Estimate:
    """The posterior after all rounds, which add simulations up to a total number."""
    from scipy.stats import qmc

    size = len(simulations.simulator.prior)
    first = max(MIN_FIRST, round(FIRST * total))
    each = max(MIN_NEXT, round(NEXT * total))
    simulations.add(qmc.LatinHypercube(size, rng=rng).random(first))
    region: Region | None = None
    while (
        _inside(simulations.parameters, simulations.summaries, observed, None)[0].sum() < MIN_VALID
        and len(simulations) + each <= MAX_SEARCH * total
    ):
        simulations.add(qmc.LatinHypercube(size, rng=rng).random(each))
    count = 1
    while True:
        estimate = fit_region(simulations, observed, region, rng)
        remaining = total - len(simulations)
        is_final = count >= MIN_ROUNDS and estimate.ratio < MAX_RATIO
        if is_final or len(simulations) + each > MAX_SEARCH * total:
            break
        points = around(estimate.draws, min(each, remaining), rng)
        region = Region.around(points)
        simulations.add(points)
        count += 1
    # Two last rounds, the second from the improved posterior.
    exact = max(MIN_EXACT, round(EXACT * total)) // 2 if simulations.has_coarse else 0
    for part in (0.5, 1.0):
        remaining = total - len(simulations) - round(exact / part)
        points = around(estimate.draws, max(1, round(part * remaining)), rng)
        if len(points) > 2 * size:
            region = Region.around(points)
        simulations.add(points)
        if exact:
            simulations.add(around(estimate.draws, exact, rng), exact=True)
        estimate = fit_region(simulations, observed, region, rng)
    return fit_region(simulations, observed, region, rng, chain_count=CHAINS, draws=FINE)


def around(draws: Array, count: int, rng: np.random.Generator) -> Array:
    """Points on the unit cube from a posterior widened by the factor `WIDTH`."""
    size = draws.shape[1]
    covariance = np.cov(draws.T).reshape(size, size) + MIN_WIDTH**2 * np.eye(size)
    points = np.empty((0, size))
    while len(points) < count:
        more = draws[rng.choice(len(draws), 2 * count)]
        more = more + np.sqrt(WIDTH**2 - 1) * rng.multivariate_normal(
            np.zeros(size), covariance, 2 * count
        )
        points = np.concatenate([points, more[np.all((more > 0) & (more < 1), axis=1)]])
    return points[:count]


def fit_region(
    simulations: Simulations,
    observed: Array,
    region: Region | None,
    rng: np.random.Generator,
    *,
    chain_count: int = 1,
    draws: int = ROUGH,
) -> Estimate:
    """The posterior from the simulations of a region; None for the whole cube."""
    parameters, summaries = simulations.parameters, simulations.summaries
    is_coarse = simulations.is_coarse if simulations.has_coarse else np.full(len(parameters), True)
    exact = parameters[~is_coarse], summaries[~is_coarse]
    parameters, summaries = parameters[is_coarse], summaries[is_coarse]
    valid, parameters, summaries, region = _inside(parameters, summaries, observed, region)
    if valid.sum() < MIN_VALID:
        raise RunError(
            f"only {int(valid.sum())} of {len(valid)} simulations have the features of the trace, "
            "such as its slips: no parameters in the ranges of [fit.free] seem to describe it"
        )
    order = np.argsort(~valid, kind="stable")
    parameters, summaries = parameters[order], summaries[order]
    count = int(valid.sum())
    projection, statistics = project(summaries[:count], parameters[:count], observed)
    surrogate = learn(statistics, parameters[:count], parameters)
    target = projection(observed)
    deviations = surrogate.standardized(statistics, parameters[:count])[0]
    if len(exact[0]):
        surrogate = surrogate.corrected(*_near(*exact, projection, region))

    def log_density(points: Array) -> Array:
        value = surrogate.log_likelihood(target, points)
        if region is not None:
            value = np.where(region.contains(points), value, -np.inf)
        return np.asarray(value)

    away = np.sum(((statistics - target) / statistics.std(axis=0)) ** 2, axis=1)
    start = parameters[:count][np.argsort(away)[:STARTS]]
    chains = draw(log_density, start, rng, chains=chain_count, draws=draws)
    spread = chains.reshape(-1, chains.shape[-1]).std(axis=0)
    return Estimate(
        chains,
        projection,
        surrogate,
        target,
        _coverage(np.sum(deviations**2, axis=1), statistics.shape[1], surrogate.freedom),
        parameters[:count],
        summaries[:count],
        float(np.max(parameters.std(axis=0) / np.maximum(spread, MIN_WIDTH))),
    )


def _inside(
    parameters: Array, summaries: Array, observed: Array, region: Region | None
) -> tuple[NDArray[np.bool_], Array, Array, Region | None]:
    """Simulations of a region, enlarged until enough have the summaries of the trace: whether each
    has them, parameters, summaries, region."""
    while True:
        inside = np.full(len(parameters), True) if region is None else region.contains(parameters)
        used = usable(summaries[inside], observed)
        valid = np.all(np.isfinite(summaries[inside][:, used]), axis=1) & used.any()
        if region is None or inside.all() or valid.sum() >= MIN_VALID:
            return valid, parameters[inside], summaries[inside], region
        region = replace(region, limit=GROWTH * region.limit)


def _near(
    parameters: Array, summaries: Array, projection: Projection, region: Region | None
) -> tuple[Array, Array]:
    """Statistics and parameters of simulations in a region, or of the nearest ones."""
    valid = np.all(np.isfinite(summaries[:, projection.used]), axis=1)
    parameters, summaries = parameters[valid], summaries[valid]
    if region is not None:
        distance = region.distance(parameters)
        few = np.sort(distance)[: MIN_EXACT // 2]
        inside = distance <= max(region.limit, few[-1] if few.size else np.inf)
        parameters, summaries = parameters[inside], summaries[inside]
    return projection(summaries), parameters


def _coverage(distance: Array, size: int, freedom: float) -> tuple[float, float]:
    from scipy.stats import chi2, f

    def limit(part: float) -> float:
        if np.isfinite(freedom):
            return float(size * f.ppf(part, size, freedom))
        return float(chi2.ppf(part, size))

    return float(np.mean(distance <= limit(0.5))), float(np.mean(distance <= limit(0.9)))
