"""Steady sliding and holds of contacts that break by thermal activation (model section 13).

A contact that attached with the stretch x_b and slides at the velocity v has survived until the
stretch x with the probability S(x) = exp(-H(x)), with the hazard

    H(x) = (ω_0 f_T/(k v)) e^(-f_s/f_T) (e^(k x/f_T) - e^(k x_b/f_T)),

and breaks at f_s at the latest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.errors import MesoslipError
from mesoslip.theory.thresholds import threshold_quadrature

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

# Panels and points of the quadrature over the thresholds, and the normal deviate that has the
# probability of its limits.
PANELS, POINTS = 60, 10
# Hazards between which stretches have a quadrature: below, all contacts survive, above, none.
MIN_HAZARD, MAX_HAZARD = 1e-17, 40.0
# Exponents whose exponential functions are numbers.
MAX_EXPONENT = 700.0
# Maximum length of a panel over stretches, relative to that over which rates change by e.
MAX_PANEL = 1.0


class _Lives(NamedTuple):
    """A quadrature over thresholds and stretches; forces relative to the static force, and
    stretches to f_s/k."""

    weight: Array
    """Weights of the averages, (thresholds, points)."""
    stretch: Array
    """Stretches x."""
    hazard: Array
    """H(x)."""
    log_rate: Array
    """Logarithm of the rate of breaking over ω_0."""

    def mean(self, values: Array) -> float:
        """⟨∫ values dx⟩."""
        return float(np.sum(self.weight * values))


def steady_force(config: Config, velocity: float) -> float:
    """Force of contacts that slide steadily at a velocity, with delay and drag [N].

        F(v) = N (k ⟨∫ x S dx⟩ + m η v² τ_d)/(⟨∫ S dx⟩ + v τ_d)

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``.
    velocity
        Positive [m/s].

    Returns
    -------
    float
        The force [N].
    """
    contacts = config.contacts
    lives = _lives(config, velocity)
    survival = np.exp(-lives.hazard)
    delay = 0.0 if config.slider.ignores_delay else contacts.delay
    slid = velocity * delay / contacts.break_stretch
    drag = contacts.contact_drag * contacts.count * velocity * slid
    work = contacts.static_force * lives.mean(lives.stretch * survival)
    return (work + drag) / (lives.mean(survival) + slid)


def steady_slope(config: Config, velocity: float) -> float:
    """Derivative dF/d ln v of the steady force [N]; f_T/f_s F_s/2 for one high threshold.

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``.
    velocity
        Positive [m/s].

    Returns
    -------
    float
        The derivative [N].
    """
    contacts = config.contacts
    lives = _lives(config, velocity)
    survival = np.exp(-lives.hazard)
    delay = 0.0 if config.slider.ignores_delay else contacts.delay
    slid = velocity * delay / contacts.break_stretch
    drag = contacts.contact_drag * contacts.count * velocity * slid
    # The hazard at a stretch goes with 1/v.
    life = lives.mean(survival) + slid
    work = contacts.static_force * lives.mean(lives.stretch * survival) + drag
    work_slope = contacts.static_force * lives.mean(lives.stretch * lives.hazard * survival)
    life_slope = lives.mean(lives.hazard * survival) + slid
    return (work_slope + 2 * drag) / life - work * life_slope / life**2


def hold_force(config: Config, velocity: float, time: ArrayLike) -> Array:
    """Force in a hold of a prescribed slider after steady sliding, without delay [N].

        F(t) = N k ⟨∫ x S e^(-ω(k x) t) dx⟩/⟨∫ S dx⟩

    Contacts that attach in the hold bear no force.

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``, without delay and back force.
    velocity
        Positive, before the hold [m/s].
    time
        Times since its start, of any shape [s].

    Returns
    -------
    ndarray
        The force at each time [N].

    Raises
    ------
    MesoslipError
        If contacts have a delay or a back force.
    """
    contacts = config.contacts
    if contacts.back_force_ratio > 0 or (contacts.delay > 0 and not config.slider.ignores_delay):
        raise MesoslipError("the force in a hold is known without delay and back force only")
    assert contacts.thermal is not None
    lives = _lives(config, velocity, 0.0)
    survival = np.exp(-lives.hazard)
    times = np.asarray(time, dtype=np.float64)
    rate = contacts.thermal.rate * np.exp(lives.log_rate)
    work = [lives.mean(lives.stretch * survival * np.exp(-rate * t)) for t in times.ravel()]
    return contacts.static_force * np.reshape(work, times.shape) / lives.mean(survival)


def _lives(config: Config, velocity: float, min_hazard: float = MIN_HAZARD) -> _Lives:
    """The quadrature over lives at a velocity; one panel for stretches of hazards below the
    minimum."""
    contacts, thermal = config.contacts, config.contacts.thermal
    assert thermal is not None
    back, scale = contacts.back_force_ratio, thermal.ratio(contacts.contact_static_force)
    share, threshold = threshold_quadrature(config, PANELS, POINTS)
    log_reach = np.log(thermal.rate * scale * contacts.break_stretch / velocity)
    # Logarithm of the hazard over e^((x - x_b)/f_T) - 1.
    log_first = log_reach + (back - threshold) / scale
    end = np.minimum(threshold, back + scale * np.logaddexp(0, np.log(MAX_HAZARD) - log_first))
    start = np.full_like(end, back)
    if min_hazard > 0:
        start = np.minimum(end, back + scale * np.logaddexp(0, np.log(min_hazard) - log_first))
    panels = max(12, int(np.ceil(np.max(end - start) / (MAX_PANEL * scale))))
    edges = start[:, None] + (end - start)[:, None] * np.linspace(0, 1, panels + 1)
    edges = np.concatenate([np.full((len(share), 1), back), edges], axis=1)
    point, weight = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(edges, axis=1)[:, :, None] / 2
    stretch = (edges[:, :-1, None] + half * (1 + point)).reshape(len(share), -1)
    grown = np.expm1(np.minimum((stretch - back) / scale, MAX_EXPONENT))
    log_hazard = log_first[:, None] + np.log(np.maximum(grown, np.finfo(float).tiny))
    return _Lives(
        weight=(share[:, None, None] * half * weight).reshape(len(share), -1),
        stretch=stretch,
        hazard=np.exp(np.minimum(log_hazard, MAX_EXPONENT)),
        log_rate=(stretch - threshold[:, None]) / scale,
    )
