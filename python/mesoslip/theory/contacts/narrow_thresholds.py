"""Rate and state of activated contacts with thresholds that hardly differ, in closed form.

All contacts break near one stretch. The derivation is in ``docs/temperature.md``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.configuration.contacts.thermal import thermal_of
from mesoslip.errors import MesoslipError
from mesoslip.theory.contacts.thermal_sliding import RateAndStateTheory
from mesoslip.theory.delays import mean_delay

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Steps of the iteration for the stretch at which contacts break, and its tolerance.
STEPS, TOLERANCE = 200, 1e-12


def rate_and_state_of_narrow_thresholds(config: Config, velocity: float) -> RateAndStateTheory:
    """a, b and D_c at a velocity [m/s] of contacts of one threshold f(t), without delay.

    For f_T ≪ f_s they break in the mean at the stretch x = f(T) - f_T [E₁(z) + ln z + γ], of the
    age T = (x - x_b)/v, with z = ω_0 f_T/(k v c) and c = 1 - f'(T)/(k v). With the share
    σ = 1 - e^(-z) that breaks below its threshold, and the growth g = T f'(T) of thresholds,

        a = N f_T σ/c²,   a - b = N (f_T σ - g)/(2c),   D_c = (x - x_b) (f_T σ/6 + g/3)/(f_T σ + g).
    """
    from scipy.special import exp1

    contacts, thermal = config.contacts, thermal_of(config)
    if mean_delay(config) > 0:
        raise MesoslipError("rate and state of narrow thresholds are known without contacts.delay")
    ratio, back = thermal.ratio(contacts.contact_static_force), contacts.back_force_ratio
    speed = velocity / contacts.break_stretch
    stretch = 1.0
    for _ in range(STEPS):
        life = (stretch - back) / speed
        threshold, growth = _threshold(config, life)
        approach = 1 - growth / speed
        z = thermal.rate * ratio / (speed * approach)
        before = stretch
        stretch = threshold - ratio * (float(exp1(z)) + math.log(z) + float(np.euler_gamma))
        if abs(stretch - before) < TOLERANCE:
            break
    activated, grown = -ratio * math.expm1(-z), life * growth
    a = activated / approach**2
    net = (activated - grown) / (2 * approach)
    distance = (stretch - back) * (activated / 6 + grown / 3) / (activated + grown)
    static = contacts.static_force
    return RateAndStateTheory(static * a, static * (a - net), distance * contacts.break_stretch)


def _threshold(config: Config, age: float) -> tuple[float, float]:
    """Mean threshold over f_s at an age, and its change in a second."""
    ages = age * np.array([1 - 1e-5, 1.0, 1 + 1e-5])
    before, here, after = config.contacts.threshold_at(np.ones(1), ages)
    return float(here), float(after - before) / (2e-5 * age)
