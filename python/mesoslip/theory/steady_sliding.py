"""Linear stability of steady sliding with delay: does a small perturbation grow or decay?

The master equation under a slider that moves with v t + ε e^(λt). The response of the contacts is

    Λ(λ) = -N g s φ(s) (1 - e^(-λ τ_d)) / (1 - ψ(s) e^(-λ τ_d)) + drag,    s = λ/v,

with g = 1/(⟨x_s - x_b⟩ + v τ_d), the Laplace transform ψ of the density of the lives x_s - x_b, and
that of the force of a contact over its life, φ. Where delays are exponential 1/(1 + λ τ_d) stands
for e^(-λ τ_d). The derivation is in ``docs/steady-sliding.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.theory.frequency_paths import Parts, Turns
from mesoslip.theory.life_transforms import LifeTransforms, Lives
from mesoslip.theory.linear_stability import OUT_OF_STEP, LinearStability
from mesoslip.theory.lives import newborn_stretch

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

# Range of spring stiffnesses over that of all contacts in which the stable ones are sought.
MAX_STIFFNESS, MIN_STIFFNESS = 16.0, 1e-4

WITHOUT_AGEING = "has a response of its own: use mesoslip.theory.ageing_sliding.AgeingSliding"

WITHOUT_ACTIVATION = (
    "has a response of its own: use mesoslip.theory.activated_sliding.ActivatedSliding"
)


WITHOUT_NEWBORN_WIDTH = (
    'has a linear stability theory for coupling = "equal" only, with thresholds of which hardly '
    "any is below the width"
)


class SteadySliding(LinearStability):
    """Steady sliding of a configuration, and the growth of small perturbations of it.

    The contacts are those of the master equation, N → ∞, with delay, back force and drag, without
    interaction.

    Parameters
    ----------
    config
        The configuration.
    velocity
        Velocity [m/s]; that of the drive by default.
    relative_width
        Relative width of the threshold law; that of the configuration by default.

    Raises
    ------
    ConfigError
        If contacts age or do not attach again, or there is no velocity.
    """

    def __init__(
        self,
        config: Config,
        velocity: float | None = None,
        *,
        relative_width: float | None = None,
    ) -> None:
        super().__init__(config, velocity)
        self.relative_width = relative_width or config.contacts.threshold.relative_width
        self._transforms = LifeTransforms(config, self.relative_width)
        self._stretch = config.contacts.break_stretch

    @classmethod
    def _problems(cls, config: Config) -> Iterator[Problem]:
        if config.contacts.ageing is not None:
            yield Problem("", "contacts.ageing", WITHOUT_AGEING)
        if config.contacts.thermal is not None:
            yield Problem("", "contacts.thermal", WITHOUT_ACTIVATION)
        if newborn_stretch(config) is None:
            yield Problem("", "contacts.newborn_width", WITHOUT_NEWBORN_WIDTH)

    @property
    def lives(self) -> Lives:
        """Averages over the lives of contacts."""
        return self._transforms.averages

    @property
    def force(self) -> float:
        """F(v) = N [⟨k (x_s² - x_b²)/2⟩ + ⟨m⟩ η v² τ_d]/(⟨x_s - x_b⟩ + v τ_d) [N]."""
        lives = self.lives
        slid = self._rate * self.delay
        dragged = self._drag * lives.mass * self.velocity * slid
        static = self.config.contacts.static_force
        return (static * lives.work + dragged) / (lives.mean_life + slid)

    @property
    def slope(self) -> float:
        """dF/dv [N s/m]: below zero sliding is weaker the faster it is."""
        lives = self.lives
        slid = self._rate * self.delay
        rise = 2 * self._drag * lives.mass * slid
        return (rise - self.force * self.delay / self._stretch) / (lives.mean_life + slid)

    def _parts(self, rate: Complex) -> Parts:
        lives, contacts = self.lives, self.config.contacts
        s = rate / self._rate
        transforms = self._transforms.transforms(s)
        late, missing = self._late(rate)
        births = 1 - transforms.life * late
        density = 1 / (lives.mean_life + self._rate * self.delay)
        load = lives.newborn_force - transforms.broken_force
        load += (lives.stiffness - transforms.stiffness) / s
        fed = -contacts.stiffness * density * load * missing
        dragging = self._drag * density * self._rate
        fed -= dragging * missing**2 * transforms.mass
        free = dragging * lives.mass * (rate * self.delay + missing)
        return Parts(fed, births, free, np.abs(transforms.life * late))

    @property
    def _turns(self) -> Turns:
        turn = self.lives.mean_life / self._rate + self.delay
        return Turns(turn, math.inf, self._fixed_delay)

    @property
    def is_passive(self) -> bool:
        """Whether the force of steady contacts does not depend on the motion of the slider."""
        return self.delay == 0

    @cached_property
    def out_of_step(self) -> SteadySliding:
        if self.relative_width >= OUT_OF_STEP:
            return self
        return SteadySliding(self.config, self.velocity, relative_width=OUT_OF_STEP)

    @property
    def _ingredients(self) -> str:
        return "delay"


def depends_on_velocity(config: Config) -> bool:
    """Whether slow sliding has no force of its own, so that F(X) has no curve."""
    return config.contacts.ageing is not None or config.contacts.thermal is not None


def sliding_of(config: Config, velocity: float | None = None) -> LinearStability:
    """Steady sliding of a configuration, by the theory that its contacts have.

    Parameters and errors are those of `LinearStability`.
    """
    # scipy takes long to import.
    if config.contacts.thermal is not None:
        from mesoslip.theory.activated_sliding import ActivatedSliding

        return ActivatedSliding(config, velocity)
    if config.contacts.ageing is not None:
        from mesoslip.theory.ageing_sliding import AgeingSliding

        return AgeingSliding(config, velocity)
    return SteadySliding(config, velocity)


@lru_cache(maxsize=16)
def steady_sliding(config: Config, max_work: int) -> LinearStability | None:
    """Steady sliding of a configuration; None without a theory, or if it takes more work.

    The latest results are cached, as several functions ask for the same configuration.
    """
    if config.interaction is not None and config.interaction.strength > 0:
        return None
    try:
        sliding = sliding_of(config)
    except ConfigError:
        return None
    if sliding.work > max_work:
        return None
    try:
        # The summary needs both, and caches them. Extreme parameters may overflow.
        with np.errstate(all="ignore"):
            if sliding.leading_root is not None and not sliding.is_stable:
                _ = sliding.is_stable_out_of_step
    except RunError:
        return None
    return sliding


def stability_boundary(
    config: Config,
    key: str,
    low: float,
    high: float,
    tolerance: float = 1e-3,
    *,
    out_of_step: bool = False,
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
    out_of_step
        Whether stability is that of contacts that break out of step, as after slips
        (`SteadySliding.is_stable_out_of_step`): that boundary is nearer to the results of runs.

    Returns
    -------
    float or None
        One of the values at which it changes; None if sliding is stable at both ends, or unstable.
    """

    def is_stable(logarithm: float) -> bool:
        return _is_stable(config, key, math.exp(logarithm), out_of_step=out_of_step)

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


def _is_stable(config: Config, key: str, value: float, *, out_of_step: bool) -> bool:
    sliding = sliding_of(config.replace({key: value}))
    return sliding.is_stable_out_of_step if out_of_step else sliding.is_stable


def stable_stiffness(config: Config, *, out_of_step: bool = False) -> float | None:
    """Stiffness of the spring above which steady sliding at the drive's velocity is stable [N/m].

    All other parameters are those of the configuration, the mass of the slider for example. It is
    `LinearStability.critical_stiffness` where that is known. Otherwise, as for layers with a delay,
    it is sought from `MAX_STIFFNESS` down to `MIN_STIFFNESS` times the stiffness of the contacts,
    by factors of two, with a relative tolerance of a thousandth.

    Parameters
    ----------
    config
        The configuration, of a slider on a spring.
    out_of_step
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
        critical = (sliding.out_of_step if out_of_step else sliding).critical_stiffness
        return critical[0] if critical and critical[0] < max_stiffness else None
    return _first_stable_stiffness(config, max_stiffness, out_of_step=out_of_step)


def _first_stable_stiffness(
    config: Config, max_stiffness: float, *, out_of_step: bool
) -> float | None:
    """The same by counting roots, from stiff springs to soft ones by factors of two."""
    key, stiffness = "slider.stiffness", max_stiffness
    while stiffness > MIN_STIFFNESS * config.contacts.stiffness:
        if not _is_stable(config, key, stiffness, out_of_step=out_of_step):
            if stiffness == max_stiffness:
                return None
            return stability_boundary(
                config, key, stiffness, 2 * stiffness, out_of_step=out_of_step
            )
        stiffness /= 2
    return None


class StiffnessLimits(NamedTuple):
    """Stiffnesses of the spring above which steady sliding is linearly stable.

    Attributes
    ----------
    velocity
        Velocity of sliding [m/s], that of the drive.
    in_step
        With delay [N/m].
    out_of_step
        The same for contacts that break out of step [N/m]; None if that is no smaller.
    """

    velocity: float
    in_step: float
    out_of_step: float | None


def stiffness_limits(config: Config, max_work: int) -> StiffnessLimits | None:
    """Stiffnesses above which steady sliding is stable; None if they take more than some ten times
    the work for one stiffness, or there are none."""
    sliding = steady_sliding(config, max_work // 10)
    if sliding is None or sliding.is_passive or not 0 < config.spring_stiffness < math.inf:
        return None
    try:
        stable = stable_stiffness(config)
        out_of_step = stable_stiffness(config, out_of_step=True)
    except RunError:
        return None
    if stable is None:
        return None
    if out_of_step is not None and out_of_step >= stable:
        out_of_step = None
    return StiffnessLimits(sliding.velocity, stable, out_of_step)
