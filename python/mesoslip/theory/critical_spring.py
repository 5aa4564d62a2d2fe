"""The spring at which steady sliding of a rigid or layered slider loses linear stability.

There K + Z(iω) + Λ(iω) = 0 at a frequency, Z being the dynamic stiffness of the slider without its
spring. A damping that is given relative to the frequency of the setup grows with the spring.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import singledispatch

import numpy as np

from mesoslip.array_types import Array, Complex
from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.rigid import RigidSlider
from mesoslip.theory.sliders import chain_stiffness

# Growth rate over the frequency of the slider, Ω_S/π, below which a perturbation does not grow.
NO_GROWTH = 1e-7
# Rounds of the search for a critical frequency, and points of each.
ROUNDS, POINTS_A_ROUND = 3, 12
# Points of the search for a change of sign between the neighbours of a minimum.
POINTS_A_MINIMUM = 16
# Doublings and halvings of an interval in which the stiffness of a chain is sought.
MAX_DOUBLINGS, HALVINGS = 8, 50


@singledispatch
def has_critical_spring(slider: SliderTable, delay: float) -> bool:  # noqa: ARG001
    """Whether a slider has a spring of which the critical one is known, with a delay of contacts
    [s]."""
    return False


@has_critical_spring.register
def _rigid_has_one(slider: RigidSlider, delay: float) -> bool:  # noqa: ARG001
    return True


@has_critical_spring.register
def _layered_has_one(slider: LayeredSlider, delay: float) -> bool:
    # On a base sliding may be unstable however stiff the springs are. A delay may feed layers at
    # frequencies that grow with their springs, beyond any path.
    return slider.base is None and delay == 0


def critical_spring(
    slider: SliderTable, response: Callable[[Array], Complex], path: Array
) -> tuple[float, float] | None:
    """Largest stiffness of the spring at which a perturbation neither grows nor decays.

    It is the static stiffness [N/m], with the angular frequency of the perturbation [1/s]; None
    also for a slider of which no critical spring is known. The slider's own spring does not matter.
    ``response`` gives Λ(iω) [N/m]; roots are sought between ascending frequencies ``path`` > 0.
    """
    stiffness, excess = balancing_spring(slider, path, response(path))
    added = _near_minima(path, excess)
    if added.size:
        path = np.union1d(path, added)
        stiffness, excess = balancing_spring(slider, path, response(path))
    found = None
    for at in _changes_of_sign(excess):
        if max(stiffness[at], stiffness[at + 1]) <= 0:
            continue
        low, high = path[at : at + 2]
        for _ in range(ROUNDS):
            points = np.geomspace(low, high, POINTS_A_ROUND)
            springs, left = balancing_spring(slider, points, response(points))
            first = _changes_of_sign(left)[0]
            low, high = points[first : first + 2]
        share = left[first] / (left[first] - left[first + 1])
        spring = float(springs[first] + share * (springs[first + 1] - springs[first]))
        if spring > 0 and (found is None or spring > found[0]):
            found = spring, float(low + share * (high - low))
    return found


def outweighed_from(slider: SliderTable, frequency: Array, free: Complex, fed: Array) -> float:
    """Frequency from which on the damping of the slider is stronger than what contacts feed [1/s].

    Infinite if that is not so up to the last one. ``free`` is the part of Λ(iω) without births, and
    ``fed`` the maximum of the rest [N/m], at ascending frequencies.
    """
    # Real, the rest asks for a softer spring, with less damping.
    _, excess = balancing_spring(slider, frequency, free + (1 - 1j) * fed)
    weak = np.flatnonzero(excess <= 0)
    if weak.size == 0:
        return float(frequency[0])
    return math.inf if weak[-1] == len(frequency) - 1 else float(frequency[weak[-1] + 1])


def _hidden(mass: float, frequency: Array) -> Array:
    """Damping that hides a growth which does not count [N/m]."""
    return 2 * NO_GROWTH / math.pi * mass * frequency**2


def _near_minima(path: Array, excess: Array) -> Array:
    """Points around minima above zero, of which the parabola through three points comes near it."""
    before, here, after = excess[:-2], excess[1:-1], excess[2:]
    with np.errstate(all="ignore"):
        steps = np.diff(path)
        slope_before, slope_after = (here - before) / steps[:-1], (after - here) / steps[1:]
        bend = (slope_after - slope_before) / (path[2:] - path[:-2])
        slope = (steps[1:] * slope_before + steps[:-1] * slope_after) / (path[2:] - path[:-2])
        is_near = (here > 0) & (here <= before) & (here <= after) & (slope**2 > 2 * bend * here)
    places = np.flatnonzero(is_near) + 1
    return np.linspace(path[places - 1], path[places + 1], POINTS_A_MINIMUM).ravel()


def _changes_of_sign(values: Array) -> list[int]:
    """Places before which and behind which values have different signs; NaN has none."""
    change = np.diff(np.sign(values))
    return [int(at) for at in np.flatnonzero(np.isfinite(change) & (change != 0))]


@singledispatch
def balancing_spring(
    slider: SliderTable,  # noqa: ARG001
    frequency: Array,
    response: Complex,  # noqa: ARG001
) -> tuple[Array, Array]:
    """Stiffness with which the real part of the characteristic function is zero, and its imaginary
    part then [N/m]; the largest one if there are several, NaN without one."""
    unknown = np.full_like(frequency, math.nan)
    return unknown, unknown


@balancing_spring.register
def _of_rigid_slider(
    slider: RigidSlider, frequency: Array, response: Complex
) -> tuple[Array, Array]:
    """The damping is that of the slider with this spring."""
    inertia = slider.mass * frequency**2
    needed = inertia - response.real
    if slider.damping is not None:
        rate = np.full_like(frequency, slider.damping)
        stiffness = needed + slider.mass * (rate * frequency) ** 2 / (rate**2 + frequency**2)
    else:
        # K = T + A r² K/(r² K + A), with T the stiffness needed without damping and A = M ω².
        square = (slider.damping_ratio or 0.0) ** 2
        linear = inertia * (1 - square) - square * needed
        root = np.sqrt(np.maximum(linear**2 + 4 * square * needed * inertia, 0.0))
        if square > 0:
            # The form without a difference of numbers that are nearly the same.
            large = np.where(linear > 0, linear + root, 1.0)
            stiffness = np.where(
                linear > 0, 2 * needed * inertia / large, (root - linear) / (2 * square)
            )
        else:
            stiffness = needed
        rate = math.sqrt(square / slider.mass) * np.sqrt(np.maximum(stiffness, 0.0))
    damping = slider.mass * rate * frequency**3 / (rate**2 + frequency**2)
    return stiffness, response.imag + damping + _hidden(slider.mass, frequency)


@balancing_spring.register
def _of_layered_slider(
    slider: LayeredSlider, frequency: Array, response: Complex
) -> tuple[Array, Array]:
    """The static stiffness of the chain, all springs of which go with it.

    Without damping the dynamic stiffness of the chain grows with that of its springs, from -∞ at
    the stiffness with which the layers above the first one resonate. Layers resonate at the largest
    root with softer springs only.
    """
    rate = 1j * frequency

    def lack(stiffness: Array) -> Array:
        numerator, denominator = chain_stiffness(slider, rate, stiffness)
        return np.real(numerator / denominator) + response.real

    resonant = np.zeros_like(frequency)
    if slider.layers > 1:
        mass, sine = slider.mass / slider.layers, math.sin(math.pi / (2 * slider.layers))
        resonant = mass * frequency**2 / (4 * slider.layers * sine**2)
    # All of the mass at the contacts needs no stiffer spring, but for the layers' own motion.
    high = 2 * (resonant + slider.mass * frequency**2 + np.abs(response))
    for _ in range(MAX_DOUBLINGS):
        high = np.where(lack(high) > 0, high, 2 * high)
    low = resonant.copy()
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        is_low = lack(middle) < 0
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    numerator, denominator = chain_stiffness(slider, rate, high)
    excess = np.imag(numerator / denominator) + response.imag
    excess += _hidden(slider.mass, frequency)
    # With strong damping of the layers, or a single one, there may be no such spring.
    has_root = low > resonant
    return np.where(has_root, high, math.nan), np.where(has_root, excess, math.nan)
