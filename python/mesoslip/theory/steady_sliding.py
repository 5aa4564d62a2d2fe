"""Stability of steady sliding of a configuration, by the theory that its contacts have."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.errors import ConfigError, RunError
from mesoslip.theory.contacts import contact_theory

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.theory.linear_stability import LinearStability

# Range of spring stiffnesses over that of all contacts in which the stable ones are sought.
MAX_STIFFNESS, MIN_STIFFNESS = 16.0, 1e-4


def sliding_of(config: Config, velocity: float | None = None) -> LinearStability:
    """Steady sliding of a configuration at a velocity [m/s], by default that of the drive, by the
    theory that its contacts have."""
    return contact_theory(config).sliding(velocity)


@lru_cache(maxsize=16)
def steady_sliding(config: Config, max_work: int) -> LinearStability | None:
    """Steady sliding of a configuration, cached; None without a theory, or if it takes more
    work."""
    sliding = _affordable(config, max_work)
    if sliding is None:
        return None
    try:
        # The summary needs both, and caches them. Extreme parameters may overflow.
        with np.errstate(all="ignore"):
            if sliding.leading_root is not None and not sliding.is_stable:
                _ = sliding.is_stable_dephased
    except RunError:
        return None
    return sliding


@lru_cache(maxsize=16)
def _affordable(config: Config, max_work: int) -> LinearStability | None:
    try:
        sliding = sliding_of(config)
    except ConfigError:
        return None
    return sliding if sliding.work <= max_work else None


def decay_of_sliding(config: Config, max_work: int) -> tuple[bool | None, complex | None]:
    """Whether steady sliding is stable, and its leading root [1/s] if it is; None where they are
    not known, as in `steady_sliding`, which computes more."""
    sliding = _affordable(config, max_work)
    if sliding is None:
        return None, None
    try:
        with np.errstate(all="ignore"):
            return sliding.is_stable, sliding.leading_root if sliding.is_stable else None
    except RunError:
        return None, None


def stability_boundary(
    config: Config,
    key: str,
    low: float,
    high: float,
    tolerance: float = 1e-3,
    *,
    dephased: bool = False,
) -> float | None:
    """Value of a key at which steady sliding becomes stable or unstable, between two others.

    Parameters
    ----------
    config
        The configuration.
    key
        A key such as "contacts.delay" or "slider.stiffness"; or "drive.velocity".
    low, high
        Positive values, in SI, between which to search, on a logarithmic scale.
    tolerance
        Relative.
    dephased
        Whether stability is that of dephased contacts, as after slips
        (`SteadySliding.is_stable_dephased`): that boundary is nearer to the results of runs.

    Returns
    -------
    float or None
        One of the values at which it changes; None if sliding is stable at both ends, or unstable.
    """

    def is_stable(logarithm: float) -> bool:
        return _is_stable(config, key, math.exp(logarithm), dephased=dephased)

    from scipy import optimize

    first, last = math.log(low), math.log(high)
    begins = is_stable(first)
    if begins == is_stable(last):
        return None
    found: float = optimize.bisect(
        lambda logarithm: 1.0 if is_stable(logarithm) == begins else -1.0,
        first,
        last,
        xtol=tolerance,
    )
    return math.exp(found)


def _is_stable(config: Config, key: str, value: float, *, dephased: bool) -> bool:
    sliding = sliding_of(config.replace({key: value}))
    return sliding.is_stable_dephased if dephased else sliding.is_stable


def stable_stiffness(config: Config, *, dephased: bool = False) -> float | None:
    """Stiffness of the spring above which steady sliding at the drive's velocity is stable [N/m].

    All other parameters are those of the configuration, the mass of the slider for example. It is
    `LinearStability.critical_stiffness` where that is known. Otherwise, as for layers with a delay,
    it is sought from `MAX_STIFFNESS` down to `MIN_STIFFNESS` times the stiffness of the contacts,
    by factors of two, with a relative tolerance of a thousandth.

    Parameters
    ----------
    config
        The configuration, of a slider on a spring.
    dephased
        As in `stability_boundary`.

    Returns
    -------
    float or None
        None if sliding is stable with all springs, or unstable with one that is `MAX_STIFFNESS`
        times as stiff as the contacts.
    """
    max_stiffness = MAX_STIFFNESS * config.contacts.stiffness
    sliding = sliding_of(config)
    if sliding.has_critical_stiffness:
        critical = (sliding.dephased if dephased else sliding).critical_stiffness
        return critical[0] if critical and critical[0] < max_stiffness else None
    return _first_stable_stiffness(config, max_stiffness, dephased=dephased)


def _first_stable_stiffness(
    config: Config, max_stiffness: float, *, dephased: bool
) -> float | None:
    """The same by counting roots, from stiff springs to soft ones by factors of two."""
    key, stiffness = "slider.stiffness", max_stiffness
    while stiffness > MIN_STIFFNESS * config.contacts.stiffness:
        if not _is_stable(config, key, stiffness, dephased=dephased):
            if stiffness == max_stiffness:
                return None
            return stability_boundary(config, key, stiffness, 2 * stiffness, dephased=dephased)
        stiffness /= 2
    return None


class StiffnessLimits(NamedTuple):
    """Stiffnesses of the spring [N/m] above which sliding at the velocity of the drive [m/s] is
    linearly stable: with delay, and for dephased contacts, None if that is no smaller."""

    velocity: float
    in_phase: float
    dephased: float | None


def stiffness_limits(config: Config, max_work: int) -> StiffnessLimits | None:
    """Stiffnesses above which steady sliding is stable; None if they take more than some ten times
    the work for one stiffness, or there are none."""
    sliding = steady_sliding(config, max_work // 10)
    if sliding is None or sliding.is_passive or not 0 < config.spring_stiffness < math.inf:
        return None
    try:
        stable = stable_stiffness(config)
        dephased = stable_stiffness(config, dephased=True)
    except RunError:
        return None
    if stable is None:
        return None
    if dephased is not None and dephased >= stable:
        dephased = None
    return StiffnessLimits(sliding.velocity, stable, dephased)
