"""Measures that theory predicts from a configuration, to compare with its runs."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, RunError

if TYPE_CHECKING:
    from mesoslip.theory.linear_stability import LinearStability
    from mesoslip.theory.steady_front import SteadyFront

# Length of the force curve in mean breaking stretches; its steepest descent is the first one.
CURVE_LENGTH = 3.0
# Maximum work for the stability of steady sliding, some tenths of a second.
MAX_WORK = 10**6


def _configuration(tree: DataTree) -> Config:
    """The configuration of a run, the same for all realizations."""
    return Config.from_toml(tree.attrs["configuration"]).replace("run.seed=1")


def _steady_sliding(tree: DataTree) -> LinearStability | None:
    # SciPy, which it imports, is not needed by most sweeps.
    from mesoslip.theory.steady_sliding import steady_sliding

    return steady_sliding(_configuration(tree), MAX_WORK)


def growth_rate(tree: DataTree) -> float:
    """Growth rate of small perturbations of steady sliding, with delay [1/s]."""
    sliding = _steady_sliding(tree)
    return math.nan if sliding is None else sliding.growth_rate


def stable_dephased(tree: DataTree) -> float:
    """Whether steady sliding is stable, 1 or 0, of dephased contacts too."""
    sliding = _steady_sliding(tree)
    try:
        return math.nan if sliding is None else float(sliding.is_stable_dephased)
    except RunError:
        return math.nan


def critical_stiffness_ratio(tree: DataTree) -> float:
    """K* of the master equation over the stiffness of the spring."""
    return _critical_stiffness_ratio(_configuration(tree))


def waiting_over_damping(tree: DataTree) -> float:
    """Mean time between slips times the damping rate of the setup."""
    from mesoslip.analysis.slips import slips

    oscillator = _configuration(tree).slider.oscillator
    waiting = slips(tree)["waiting_time"].values
    waiting = waiting[np.isfinite(waiting)]
    if oscillator is None or not waiting.size:
        return math.nan
    return float(waiting.mean() * oscillator.damping)


def _critical_stiffness_ratio(config: Config) -> float:
    from mesoslip.theory.contacts import contact_theory

    spring = config.series_stiffness
    if not 0 < spring < math.inf or contact_theory(config).depends_on_velocity:
        return math.nan
    length = CURVE_LENGTH * config.contacts.break_stretch
    # F(X) depends on neither, which many maps vary.
    alike = {"slider.kind": "prescribed", "contacts.delay": 0.0, "curve.length": length}
    return _critical_stiffness(config.replace(alike)) / spring


@lru_cache(maxsize=16)
def _critical_stiffness(config: Config) -> float:
    """K* of a force curve [N/m]."""
    from mesoslip.theory.force_curve import ForceCurve

    return ForceCurve(config).K_star[0]


def front_prestress(tree: DataTree) -> float:
    """Stress over strength of the blocks far from the edge as the first one breaks."""
    front = _steady_front(tree)
    return math.nan if front is None else front.prestress


def steady_front_speed_ratio(tree: DataTree) -> float:
    """Speed of a steady front under that prestress, over that of sound."""
    front = _steady_front(tree)
    if front is None:
        return math.nan
    return float(front.speed(front.prestress)) / front.sound_velocity


def _steady_front(tree: DataTree) -> SteadyFront | None:
    from mesoslip.theory.steady_front import SteadyFront

    try:
        return SteadyFront(_configuration(tree))
    except ConfigError:
        return None
