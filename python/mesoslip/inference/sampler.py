"""Sampling of a posterior on the unit cube with a cheap density."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from mesoslip.array_types import Array
from mesoslip.errors import RunError

# Number of walkers of an ensemble, of steps of burn-in, and of steps between draws.
WALKERS, BURN_IN, THIN = 100, 120, 15


def check_installed() -> None:
    """Check that emcee is installed, before any simulation."""
    if find_spec("emcee") is None:
        raise RunError("a fit needs the package emcee: pip install 'mesoslip[fit]', or make setup")


def step_count(chains: int, draws: int) -> int:
    """Number of steps of all ensembles for a number of draws of each chain."""
    return chains * (BURN_IN + -(-draws // WALKERS) * THIN)


def draw(
    log_density: Callable[[Array], Array],
    start: Array,
    rng: np.random.Generator,
    *,
    chains: int,
    draws: int,
    after_step: Callable[[], None] = lambda: None,
) -> Array:
    """Draw from a density on the unit cube by independent ensembles of walkers (emcee).

    The result has the shape (chains, draws, parameters). Starting points, of shape (points,
    parameters), have a density above 0; the logarithm of the density is -inf outside its support. A
    function is called after each step of an ensemble (`step_count`).
    """
    import emcee

    size = start.shape[1]

    def bounded(points: Array) -> Array:
        inside = np.all((points >= 0) & (points <= 1), axis=1)
        value = np.full(len(points), -np.inf)
        if inside.any():
            value[inside] = log_density(points[inside])
        return value

    found = []
    for _ in range(chains):
        chosen = start[rng.choice(len(start), WALKERS)]
        first = chosen + 0.3 * start.std(axis=0) * rng.standard_normal(chosen.shape)
        is_out = ~np.isfinite(bounded(first))
        first[is_out] = chosen[is_out]
        sampler = emcee.EnsembleSampler(WALKERS, size, bounded, vectorize=True)
        sampler.random_state = np.random.RandomState(rng.integers(2**31)).get_state()
        steps = step_count(1, draws)
        for _ in sampler.sample(first, iterations=steps, skip_initial_state_check=True):
            after_step()
        found.append(sampler.get_chain(discard=BURN_IN, thin=THIN).reshape(-1, size)[:draws])
    return np.array(found)


def r_hat(chains: Array) -> Array:
    """Rank-free split R-hat of each parameter, 1 for chains that agree (Gelman & Rubin 1992)."""
    half = chains.shape[1] // 2
    parts = np.concatenate([chains[:, :half], chains[:, half : 2 * half]])
    within = parts.var(axis=1, ddof=1).mean(axis=0)
    between = parts.mean(axis=1).var(axis=0, ddof=1)
    ratio: Array = np.sqrt((half - 1) / half + between / np.maximum(within, 1e-300))
    return ratio
