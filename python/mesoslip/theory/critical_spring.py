"""The spring at which steady sliding of a rigid slider turns linearly unstable.

There K + Z(iω) + Λ(iω) = 0 at a frequency, Z being the dynamic stiffness of the slider without its
spring. A damping that is given relative to the frequency of the setup grows with the spring.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.rigid import RigidSlider

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

# Rounds of the search for a critical frequency, and points of each.
ROUNDS, POINTS_A_ROUND = 3, 12


@singledispatch
def is_on_one_spring(slider: SliderTable) -> bool:  # noqa: ARG001
    """Whether a slider is a mass on one spring, of which a critical one is known."""
    return False


@is_on_one_spring.register
def _is_rigid(slider: RigidSlider) -> bool:  # noqa: ARG001
    return True


@singledispatch
def critical_spring(
    slider: SliderTable,  # noqa: ARG001
    response: Callable[[Array], Complex],  # noqa: ARG001
    path: Array,  # noqa: ARG001
) -> tuple[float, float] | None:
    """Largest stiffness of the spring at which a perturbation neither grows nor decays.

    Parameters
    ----------
    slider
        The slider, whose own spring does not matter.
    response
        Λ(iω) at frequencies [N/m].
    path
        Frequencies between which a root is sought [1/s], positive and ascending.

    Returns
    -------
    tuple of float, or None
        The stiffness [N/m] and the angular frequency of the perturbation [1/s]; None also for a
        slider that is not on one spring.
    """
    return None


@critical_spring.register
def _of_rigid_slider(
    slider: RigidSlider, response: Callable[[Array], Complex], path: Array
) -> tuple[float, float] | None:
    stiffness, excess = _spring(slider, path, response(path))
    found = None
    for at in np.flatnonzero(np.diff(np.sign(excess)) != 0):
        if max(stiffness[at], stiffness[at + 1]) <= 0:
            continue
        low, high = path[at : at + 2]
        for _ in range(ROUNDS):
            points = np.geomspace(low, high, POINTS_A_ROUND)
            springs, left = _spring(slider, points, response(points))
            first = int(np.flatnonzero(np.diff(np.sign(left)) != 0)[0])
            low, high = points[first : first + 2]
        share = left[first] / (left[first] - left[first + 1])
        spring = float(springs[first] + share * (springs[first + 1] - springs[first]))
        if spring > 0 and (found is None or spring > found[0]):
            found = spring, float(low + share * (high - low))
    return found


def _spring(slider: RigidSlider, frequency: Array, response: Complex) -> tuple[Array, Array]:
    """Stiffness with which the real part of the characteristic function is zero, and its imaginary
    part then [N/m]; the damping is that of the slider with this spring."""
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
    return stiffness, response.imag + damping
