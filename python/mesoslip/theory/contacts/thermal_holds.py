"""Holds and restarts of contacts that break by thermal activation, under a prescribed slider.

The derivations are in ``docs/temperature.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mesoslip.array_types import Array
from mesoslip.errors import MesoslipError
from mesoslip.theory.contacts.thermal_lives import ThermalLives
from mesoslip.theory.delays import delay_law

# Probability that a contact which attaches in a hold breaks in it, beyond which its force there
# is refused.
MAX_NEWBORN_BREAKS = 0.01
# Steps of a restart for a stretch of f_T/k, and stretch up to which its peak is sought.
RESTART_STEPS, RESTART_STRETCH = 12, 1.5
# Parts of a hold in which contacts attach.
HOLD_PARTS = 16


def hold_force(lives: ThermalLives, time: ArrayLike) -> Array:
    """Force in a hold of a prescribed slider, at times [s] since its start, any shape [N].

        F(t) = N k {⟨∫ x S(a) e^(-∫_0^t ω(k x, f_s(a + s)) ds) da⟩ + x_b n(t)}/(⟨∫ S da⟩ + τ_d)

    with the contacts n that have attached in the hold. They bear the back force and are taken not
    to break in it.

    A MesoslipError is raised if more than one in a hundred of those would break in it.
    """
    contacts, delay = lives.config.contacts, lives.delay
    times = np.asarray(time, dtype=np.float64)
    total = lives.life + delay
    held = np.array([_held(lives, t) for t in times.ravel()]).reshape(-1, 2)
    force = held[:, 0] / total
    if contacts.back_force_ratio > 0 and times.size > 0:
        _check_newborn(lives, float(np.max(times)))
        # Pinned since the start of the hold, and broken a delay ago or longer.
        late = np.maximum(times.ravel() - delay, 0.0)
        broken = lives.life - np.array([_held(lives, t)[1] for t in late])
        arrived = np.minimum(times.ravel(), delay)
        force = force + contacts.back_force_ratio * (broken + arrived) / total
    return contacts.static_force * force.reshape(times.shape)


class Restart(NamedTuple):
    """Force [N] over the displacement since the end of a hold [m], under a prescribed slider."""

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


def restart(lives: ThermalLives, hold: float) -> Restart:
    """Force of a prescribed slider that continues at the velocity before a hold [s], over a
    displacement of one and a half f_s/k.

    Contacts that were pinned before the hold, and those that attach in it or afterwards, are
    followed in steps of a twelfth of f_T/k, with an error of second order. Errors are those of
    `hold_force`.
    """
    delay = lives.delay
    total = lives.life + delay
    _check_newborn(lives, hold)
    count = max(200, math.ceil(RESTART_STRETCH * RESTART_STEPS / min(lives.scale, 0.5)))
    step = RESTART_STRETCH / lives.speed / count
    # Two half steps for each step: contacts that attach within a step do so in its middle.
    time = step * np.arange(2 * count + 1) / 2
    share = lives.weight * lives.step * np.exp(-lives.hazard - lives.hazard_held(hold)) / total
    force, number = _slide_on(lives, time[::2], share, lives.age + hold, lives.stretch)
    edges, attached = _attached_in_hold(lives, hold, total)
    back = np.full_like(lives.weight, lives.back)
    for end, start, arrived in zip(edges[1:], edges[:-1], attached, strict=True):
        age = np.full_like(back, hold - (start + end) / 2)
        more = _slide_on(lives, time[::2], arrived * lives.weight, age, back)
        force, number = force + more[0], number + more[1]
    new_force, new_number = _slide_on(lives, time, lives.weight, np.zeros_like(back), back)
    waiting = _attaching_after(lives, hold, total, time[::2])
    late = round(delay / step)
    born, pinned = np.zeros(count), np.ones(count + 1)
    pinned[0] = number[0]
    for i in range(1, count + 1):
        # Ages at the end of the step of those that attached in the steps before.
        ages = 2 * (i - np.arange(i)) - 1
        without_last = number[i] + float(born[: i - 1] @ new_number[ages[:-1]])
        if delay == 0:
            born[i - 1] = (1 - without_last) / new_number[1]
        else:
            since = i - 1 - late
            broken = pinned[since] + born[since] - pinned[since + 1] if late and since >= 0 else 0.0
            born[i - 1] = waiting[i - 1] + broken
        pinned[i] = without_last + born[i - 1] * new_number[1]
        force[i] += float(born[:i] @ new_force[ages])
    return Restart(lives.velocity * time[::2], lives.config.contacts.static_force * force)


def _slide_on(
    lives: ThermalLives, time: Array, share: Array, age: Array, stretch: Array
) -> tuple[Array, Array]:
    """Force over F_s and number over N of contacts that continue to slide, at even times [s], from
    their share, ages and stretches."""
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


def _held(lives: ThermalLives, hold: float) -> tuple[float, float]:
    """⟨∫ x S da⟩ and ⟨∫ S da⟩ of the contacts that survive a hold [s]."""
    survival = np.exp(-lives.hazard - lives.hazard_held(hold))
    return lives.mean(lives.stretch * survival), lives.mean(survival)


def _check_newborn(lives: ThermalLives, hold: float) -> None:
    """Raise an error if contacts that attach in a hold [s] would break in it."""
    rate = lives.rate_at(np.zeros_like(lives.weight), np.full_like(lives.weight, lives.back))
    broken = float(np.sum(lives.weight * -np.expm1(-rate * hold)))
    delay_law(lives.config).common("the force of a hold")
    if lives.back > 0 and broken > MAX_NEWBORN_BREAKS:
        raise MesoslipError(
            "the force of a hold is known while contacts that attach in it with the back force do "
            f"not break in it: {100 * broken:.2g} % of them would"
        )


def _attached_in_hold(lives: ThermalLives, hold: float, total: float) -> tuple[Array, Array]:
    """Ends of parts of a hold, and the numbers of contacts over N that attach in them."""
    delay = lives.delay
    if hold <= 0:
        return np.zeros(1), np.zeros(0)
    edges = np.concatenate([[0.0], np.geomspace(1e-6 * hold, hold, HOLD_PARTS)])
    broken = np.array([lives.life - _held(lives, max(0.0, t - delay))[1] for t in edges])
    return edges, np.diff(broken + np.minimum(edges, delay)) / total


def _attaching_after(lives: ThermalLives, hold: float, total: float, time: Array) -> Array:
    """Numbers over N of contacts that broke before the end of a hold and attach in each step."""
    delay = lives.delay
    if delay == 0:
        return np.zeros(len(time) - 1)
    broke = np.minimum(hold + time - delay, hold)
    numbers = [lives.life - _held(lives, t)[1] if t > 0 else t for t in broke]
    return np.asarray(np.diff(numbers)) / total
