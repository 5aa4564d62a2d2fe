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
from functools import cached_property

import numpy as np

from mesoslip.array_types import Complex
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.errors import Problem
from mesoslip.theory.contacts.base import KNOWN_KEYS
from mesoslip.theory.frequency_paths import Parts, Turns
from mesoslip.theory.life_transforms import LifeTransforms, Lives
from mesoslip.theory.linear_stability import DEPHASED_WIDTH, LinearStability
from mesoslip.theory.lives import newborn_stretch

OTHER_THEORY = "has a response of its own, that of mesoslip.theory.steady_sliding.sliding_of"

WITHOUT_NEWBORN_WIDTH = (
    'has a linear stability theory for coupling = "equal" only, with thresholds of which hardly '
    "any is below the width"
)


class SteadySliding(LinearStability):
    """Steady sliding of a configuration, and the growth of small perturbations of it.

    The contacts are those of the master equation, N → ∞, with delay, back force and drag.

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
        If contacts age, interact, break by thermal activation or do not attach again, or there is
        no velocity.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> sliding = mesoslip.SteadySliding(mesoslip.Config.load(path))
    >>> sliding.is_stable, round(sliding.growth_rate, 1), round(sliding.frequency)  # 1/s
    (False, 29.4, 257)
    >>> sliding.response([100.0, 400.0]).shape  # Λ(iω), N/m
    (2,)
    """

    @arguments.checked(
        config=arguments.instance(Config, "a Config"),
        velocity=arguments.number(),
        relative_width=arguments.number(0, is_open=True),
    )
    def __init__(
        self, config: Config, velocity: float | None = None, *, relative_width: float | None = None
    ) -> None:
        super().__init__(config, velocity)
        self.relative_width = relative_width or config.contacts.threshold.relative_width
        self._transforms = LifeTransforms(config, self.relative_width)
        self._stretch = config.contacts.break_stretch

    @classmethod
    def _problems(cls, config: Config) -> Iterator[Problem]:
        for key in sorted(config.given_contact_keys - KNOWN_KEYS):
            yield Problem("", key, OTHER_THEORY)
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
        late, missing = self._delays.late(rate)
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
        return Turns(turn, math.inf, self._delays.turning)

    @property
    def is_passive(self) -> bool:
        """Whether the force of steady contacts does not depend on the motion of the slider."""
        return self.delay == 0

    @cached_property
    def dephased(self) -> SteadySliding:
        if self.relative_width >= DEPHASED_WIDTH:
            return self
        return SteadySliding(self.config, self.velocity, relative_width=DEPHASED_WIDTH)

    @property
    def _ingredients(self) -> str:
        return "delay"
