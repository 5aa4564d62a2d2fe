"""Friction of contacts that break by thermal activation: steady sliding, creep, holds, restarts.

Contacts may age, attach late and with a back force (model sections 9 and 13); their thresholds have
any law. The derivations are in ``docs/temperature.md``.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.errors import MesoslipError
from mesoslip.theory.activated_lives import ActivatedLives

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

# Change of ln v for derivatives of the force of contacts that age.
SLOPE_STEP = 1e-3
# Velocities between which creep is sought, over that of activation, ω_0 f_T/k, and their number.
MIN_CREEP, MAX_CREEP, CREEP_POINTS = 1e-30, 1e6, 80
# Length of the panels of the quadratures on the grid of these velocities.
GRID_COARSENESS = 4.0
# Probability that a contact which attaches in a hold breaks in it, beyond which its force there
# is refused.
MAX_NEWBORN_BREAKS = 0.01
# Steps of a restart for a stretch of f_T/k, and stretch up to which its peak is sought.
RESTART_STEPS, RESTART_STRETCH = 12, 1.5
# Length of the panels of the quadratures for a restart, whose steps have fewer digits.
RESTART_COARSENESS = 3.0
# Panels and points of the hazard in a hold of contacts that age, and parts of a hold in which
# contacts attach.
HOLD_PANELS, HOLD_POINTS, HOLD_PARTS = 24, 4, 16


def steady_force(config: Config, velocity: float) -> float:
    """Force of contacts that slide steadily at a velocity, with delay and drag [N].

        F(v) = N (k ⟨∫ x S dt⟩ + m η v τ_d)/(⟨∫ S dt⟩ + τ_d)

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
    return _force_of(config, ActivatedLives(config, velocity), velocity)


def _force_of(config: Config, lives: ActivatedLives, velocity: float) -> float:
    """Force of contacts with these lives in steady sliding [N]."""
    delay = _delay(config)
    drag = config.contacts.contact_drag * config.contacts.count * velocity * delay
    return (config.contacts.static_force * lives.work + drag) / (lives.life + delay)


def steady_slope(config: Config, velocity: float) -> float:
    """Derivative dF/d ln v of the steady force [N]; (f_T/f_s) F_s/2 for one high threshold.

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
    if contacts.ageing is not None:
        up, down = (
            steady_force(config, velocity * math.exp(sign * SLOPE_STEP)) for sign in (1, -1)
        )
        return (up - down) / (2 * SLOPE_STEP)
    lives = ActivatedLives(config, velocity)
    delay = _delay(config)
    drag = contacts.contact_drag * contacts.count * velocity * delay
    # The hazard at a stretch goes with 1/v, and so does the age.
    life = lives.life + delay
    work = contacts.static_force * lives.work + drag
    broken = lives.hazard * lives.survival
    work_slope = contacts.static_force * (lives.mean(lives.stretch * broken) - lives.work) + drag
    life_slope = lives.mean(broken) - lives.life
    return work_slope / life - work * life_slope / life**2


def creep_force(config: Config, velocity: float) -> float:
    """Force under which a slider creeps steadily: F(v) and its damping relative to the ground [N].

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
    return steady_force(config, velocity) + _ground_damping(config) * velocity


def creep_velocity(config: Config, force: float) -> float:
    """Velocity of steady creep under a constant force, the inverse of F(v) [m/s].

    The damping of a slider under a force relative to the ground is part of F(v). Where F(v) falls,
    sliding under a force is unstable: the velocity is the lowest one at which F(v) rises.

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``.
    force
        Positive [N].

    Returns
    -------
    float
        The velocity; NaN if no steady creep bears the force.
    """
    from scipy import optimize

    contacts, thermal = config.contacts, config.contacts.thermal
    assert thermal is not None
    damping = _ground_damping(config)
    scale = thermal.rate * thermal.ratio(contacts.contact_static_force) * contacts.break_stretch

    def excess(logarithm: float, coarseness: float = 1.0) -> float:
        velocity = scale * math.exp(logarithm)
        lives = ActivatedLives(config, velocity, coarseness=coarseness)
        return _force_of(config, lives, velocity) + damping * velocity - force

    grid = np.linspace(math.log(MIN_CREEP), math.log(MAX_CREEP), CREEP_POINTS)
    before = excess(grid[0], GRID_COARSENESS)
    for low, high in itertools.pairwise(grid):
        after = excess(high, GRID_COARSENESS)
        if before < 0 <= after:
            if excess(low) > 0 or excess(high) < 0:
                # A force of the grid, to its digits.
                return scale * math.exp(low if abs(before) < after else high)
            found: float = optimize.brentq(excess, low, high, xtol=1e-10)
            return scale * math.exp(found)
        before = after
    return math.nan


def hold_force(config: Config, velocity: float, time: ArrayLike) -> Array:
    """Force in a hold of a prescribed slider after steady sliding [N].

        F(t) = N k {⟨∫ x S(a) e^(-∫_0^t ω(k x, f_s(a + s)) ds) da⟩ + x_b n(t)}/(⟨∫ S da⟩ + τ_d)

    with the contacts n that have attached in the hold. They bear the back force and are taken not
    to break in it.

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``.
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
        If more than one in a hundred of the contacts that attach in the hold with a back force
        would break in it.
    """
    contacts = config.contacts
    lives = ActivatedLives(config, velocity)
    times = np.asarray(time, dtype=np.float64)
    delay = _delay(config)
    total = lives.life + delay
    held = np.array([_held(lives, t) for t in times.ravel()]).reshape(-1, 2)
    force = held[:, 0] / total
    if contacts.back_force_ratio > 0 and times.size > 0:
        _check_newborn(config, lives, float(np.max(times)))
        # Pinned since the start of the hold, and broken a delay ago or longer.
        late = np.maximum(times.ravel() - delay, 0.0)
        broken = lives.life - np.array([_held(lives, t)[1] for t in late])
        arrived = np.minimum(times.ravel(), delay)
        force = force + contacts.back_force_ratio * (broken + arrived) / total
    return contacts.static_force * force.reshape(times.shape)


class Restart(NamedTuple):
    """Force after a hold, under a prescribed slider.

    Attributes
    ----------
    displacement
        Displacements since the end of the hold [m].
    force
        The force there [N].
    """

    displacement: Array
    force: Array

    @property
    def peak(self) -> float:
        """Maximum of the force [N]."""
        return float(np.max(self.force))

    @property
    def peak_displacement(self) -> float:
        """Displacement at which the force has its maximum [m]."""
        return float(self.displacement[np.argmax(self.force)])


def restart(config: Config, velocity: float, hold: float) -> Restart:
    """Force of a prescribed slider that goes on at the velocity before a hold.

    Contacts that were pinned before the hold, and those that attach in it or afterwards, are
    followed in steps of a twelfth of f_T/k, with an error of second order.

    Parameters
    ----------
    config
        A configuration with ``contacts.thermal``.
    velocity
        Positive, before and after the hold [m/s].
    hold
        Time for which the slider stands [s].

    Returns
    -------
    Restart
        The force over a displacement of one and a half f_s/k.

    Raises
    ------
    MesoslipError
        As `hold_force`.
    """
    contacts = config.contacts
    lives = ActivatedLives(config, velocity, coarseness=RESTART_COARSENESS)
    total = lives.life + _delay(config)
    _check_newborn(config, lives, hold)
    count = max(200, math.ceil(RESTART_STRETCH * RESTART_STEPS / min(lives.scale, 0.5)))
    step = RESTART_STRETCH / lives.speed / count
    # Two half steps for each step: contacts that attach within a step do so in its middle.
    time = step * np.arange(2 * count + 1) / 2
    share = lives.weight * lives.step * np.exp(-lives.hazard - _hazard_held(lives, hold)) / total
    force, number = _go_on(lives, time[::2], share, lives.age + hold, lives.stretch)
    edges, attached = _attached_in_hold(config, lives, hold, total)
    back = np.full_like(lives.weight, lives.back)
    for end, start, arrived in zip(edges[1:], edges[:-1], attached, strict=True):
        age = np.full_like(back, hold - (start + end) / 2)
        more = _go_on(lives, time[::2], arrived * lives.weight, age, back)
        force, number = force + more[0], number + more[1]
    new_force, new_number = _go_on(lives, time, lives.weight, np.zeros_like(back), back)
    waiting = _attaching_after(config, lives, hold, total, time[::2])
    delayed = _delay(config) > 0
    late = round(_delay(config) / step)
    born, pinned = np.zeros(count), np.ones(count + 1)
    pinned[0] = number[0]
    for i in range(1, count + 1):
        # Ages at the end of the step of those that attached in the steps before.
        ages = 2 * (i - np.arange(i)) - 1
        without_last = number[i] + float(born[: i - 1] @ new_number[ages[:-1]])
        if not delayed:
            born[i - 1] = (1 - without_last) / new_number[1]
        else:
            since = i - 1 - late
            broken = pinned[since] + born[since] - pinned[since + 1] if late and since >= 0 else 0.0
            born[i - 1] = waiting[i - 1] + broken
        pinned[i] = without_last + born[i - 1] * new_number[1]
        force[i] += float(born[:i] @ new_force[ages])
    return Restart(velocity * time[::2], contacts.static_force * force)


def _go_on(
    lives: ActivatedLives, time: Array, share: Array, age: Array, stretch: Array
) -> tuple[Array, Array]:
    """Force over F_s and number over N of contacts that slide on, at evenly spaced times.

    ``share`` is their number over N at first, ``age`` and ``stretch`` are theirs then.
    """
    step = time[1] - time[0]
    hazard = np.zeros_like(share)
    before = lives.rate_at(age, stretch)
    force, number = np.empty_like(time), np.empty_like(time)
    for i, t in enumerate(time):
        now, there = age + t, stretch + lives.speed * t
        if i > 0:
            rate = lives.rate_at(now, there)
            hazard = hazard + step * (before + rate) / 2
            before = rate
        alive = np.where(there < lives.threshold_at(now), share * np.exp(-hazard), 0.0)
        force[i], number[i] = np.sum(alive * there), np.sum(alive)
    return force, number


def _hazard_held(lives: ActivatedLives, hold: float) -> Array:
    """Hazard in a hold of contacts that were pinned before, shape (thresholds, points)."""
    if hold == 0 or lives.config.contacts.ageing is None:
        return np.asarray(lives.rate * hold)
    point, weight = np.polynomial.legendre.leggauss(HOLD_POINTS)
    # Thresholds change with the logarithm of the age.
    first = 1e-2 * min(lives.config.contacts.ageing.time, hold)
    edges = np.concatenate([[0.0], np.geomspace(first, hold, HOLD_PANELS)])
    hazard = np.zeros_like(lives.rate)
    for low, high in itertools.pairwise(edges):
        half = (high - low) / 2
        for at, share in zip(low + half * (1 + point), half * weight, strict=True):
            hazard += share * lives.rate_at(lives.age + at, lives.stretch)
    return hazard


def _held(lives: ActivatedLives, hold: float) -> tuple[float, float]:
    """⟨∫ x S da⟩ and ⟨∫ S da⟩ of the contacts that survive a hold [s]."""
    survival = np.exp(-lives.hazard - _hazard_held(lives, hold))
    return lives.mean(lives.stretch * survival), lives.mean(survival)


def _check_newborn(config: Config, lives: ActivatedLives, hold: float) -> None:
    """Raise an error if contacts that attach in a hold would break in it."""
    rate = lives.rate_at(np.zeros_like(lives.weight), np.full_like(lives.weight, lives.back))
    broken = float(np.sum(lives.weight * -np.expm1(-rate * hold)))
    if config.contacts.delay_law == "exponential" and _delay(config) > 0:
        raise MesoslipError(
            'the force of a hold is known for contacts.delay_law = "fixed" or without delay'
        )
    if config.contacts.back_force_ratio > 0 and broken > MAX_NEWBORN_BREAKS:
        raise MesoslipError(
            "the force of a hold is known while contacts that attach in it with the back force do "
            f"not break in it: {100 * broken:.2g} % of them would"
        )


def _attached_in_hold(
    config: Config, lives: ActivatedLives, hold: float, total: float
) -> tuple[Array, Array]:
    """Ends of parts of a hold, and the numbers of contacts over N that attach in them."""
    delay = _delay(config)
    if hold <= 0:
        return np.zeros(1), np.zeros(0)
    edges = np.concatenate([[0.0], np.geomspace(1e-6 * hold, hold, HOLD_PARTS)])
    broken = np.array([lives.life - _held(lives, max(0.0, t - delay))[1] for t in edges])
    return edges, np.diff(broken + np.minimum(edges, delay)) / total


def _attaching_after(
    config: Config, lives: ActivatedLives, hold: float, total: float, time: Array
) -> Array:
    """Numbers over N of contacts that broke before the end of a hold and attach in each step."""
    delay = _delay(config)
    if delay == 0:
        return np.zeros(len(time) - 1)
    broke = np.minimum(hold + time - delay, hold)
    numbers = [lives.life - _held(lives, t)[1] if t > 0 else t for t in broke]
    return np.asarray(np.diff(numbers)) / total


def _ground_damping(config: Config) -> float:
    """Force of the slider's damping relative to the ground over its velocity [N s/m]."""
    if not config.drive.is_force:
        return 0.0
    slider = config.slider.kernel_parameters(config)
    return float(slider.get("mass", 0.0)) * float(slider.get("damping", 0.0))


def _delay(config: Config) -> float:
    return 0.0 if config.slider.ignores_delay else config.contacts.delay
