"""The motion of a slider on a spring with rate-and-state friction.

The friction force is F = F_0 + a ln(V/V_0) + b ln(V_0 θ/D_c), with one state variable θ
(Dieterich, J. Geophys. Res. 84, 2161 (1979); Ruina, J. Geophys. Res. 88, 10359 (1983)):

- ageing law: dθ/dt = 1 - V θ/D_c,
- slip law: dθ/dt = -(V θ/D_c) ln(V θ/D_c).

Forces are in newtons, or divided by the normal force: then they are friction coefficients, a and b
are numbers, and a stiffness is an inverse length.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.errors import RunError

Array = NDArray[np.float64]

LAWS = ("ageing", "slip")

UNSTABLE = (
    "the motion of the spring and slider cannot be integrated: it is unstable, or its parameters "
    "are out of range"
)

# Maximum number of integration steps between two times.
MAX_STEPS = 20_000
# Logarithm of a velocity over V_0 that only an unstable motion without mass reaches.
RUNAWAY = 40.0
# Maximum exponent in trial steps of the integration, so that nothing overflows.
MAX_EXPONENT = 100.0
# Tolerance of the integration: relative, and absolute for logarithms of velocity and state.
TOLERANCE = 1e-10


@dataclass(frozen=True)
class RateAndState:
    """Parameters of the law.

    Parameters
    ----------
    reference_force
        Steady force F_0 at the reference velocity [N, or 1].
    reference_velocity
        V_0 [m/s].
    a, b
        Parameters of the direct effect and of the evolution effect, in the unit of force; a > 0.
    slip_distance
        D_c [m].
    law
        "ageing" or "slip".
    """

    reference_force: float
    reference_velocity: float
    a: float
    b: float
    slip_distance: float
    law: str = "ageing"

    def steady_force(self, velocity: float) -> float:
        """Force of steady sliding at a velocity, F_0 + (a - b) ln(V/V_0)."""
        return self.reference_force + (self.a - self.b) * math.log(
            velocity / self.reference_velocity
        )

    @property
    def critical_stiffness(self) -> float:
        """Stiffness (b - a)/D_c below which steady sliding without inertia is unstable."""
        return (self.b - self.a) / self.slip_distance


@dataclass(frozen=True)
class Loading:
    """A stage of the load point: from a velocity to a velocity [m/s], both >= 0, in a time [s]."""

    duration: float
    start_velocity: float
    end_velocity: float


@dataclass(frozen=True)
class Motion:
    """Motion of the slider, each array with the shape of the wanted times.

    Attributes
    ----------
    force
        Force of the spring, in the unit of the law. NaN where a rigid drive holds still.
    velocity
        Velocity of the slider [m/s].
    state
        θ [s].
    displacement
        Displacement of the slider since time 0 [m].
    """

    force: Array
    velocity: Array
    state: Array
    displacement: Array


def spring_slider(
    law: RateAndState,
    stages: Sequence[Loading],
    times: Array,
    stiffness: float,
    *,
    damping: float = 0.0,
    mass: float = 0.0,
    tolerance: float = TOLERANCE,
) -> Motion:
    """Integrate a slider on a spring through stages of its load point, from steady sliding on.

    The logarithms of velocity and state are integrated by LSODA, which switches to a stiff method;
    without mass k (X_lp - X) = F + η V gives (a + η V) d ln V/dt = k (V_lp - V) - b d ln θ/dt.

    Parameters
    ----------
    law
        The law of friction.
    stages
        Consecutive stages of the load point; the first starts with steady sliding at its velocity.
    times
        Times in ascending order, from the start of the first stage on [s].
    stiffness
        k of the spring, unit of force over metre; infinite for a slider that moves with the
        load point.
    damping
        η of viscous damping (such as radiation damping), unit of force times s/m.
    mass
        Mass of the slider, unit of force times s²/m; 0 for motion without inertia.
    tolerance
        Tolerance of the integration.

    Raises
    ------
    ValueError
        If the first stage does not slide, the load point goes back, or a is not positive.
    RunError
        If the motion cannot be integrated, such as an unstable one without mass.
    """
    if not stages or stages[0].start_velocity <= 0:
        raise ValueError("the first stage must slide")
    if any(min(one.start_velocity, one.end_velocity) < 0 for one in stages):
        raise ValueError("the load point must not go back")
    if not law.a > 0 or not law.slip_distance > 0 or law.law not in LAWS:
        raise ValueError("a and D_c must be positive, and the law one of " + ", ".join(LAWS))
    is_rigid = math.isinf(stiffness)
    system = _rigid(law) if is_rigid else _on_spring(law, stiffness, damping, mass)
    start = math.log(stages[0].start_velocity / law.reference_velocity)
    # In steady sliding V θ = D_c.
    force = law.reference_force + (law.a - law.b) * start
    force += damping * stages[0].start_velocity
    at: list[float] = [-start] if is_rigid else [start, -start, 0.0]
    if not is_rigid:
        at.append(force if mass > 0 else 0.0)
    velocity, logarithm, displacement, load = (np.full(times.shape, np.nan) for _ in range(4))
    begin = load_point = 0.0
    for number, stage in enumerate(stages):
        last = number == len(stages) - 1
        end = begin + stage.duration
        first = int(np.searchsorted(times, begin, "right")) if number else 0
        after = times.size if last else int(np.searchsorted(times, end, "right"))
        inside = np.clip(times[first:after] - begin, 0.0, None)
        wanted = np.concatenate([[0.0], inside, [stage.duration]] if not last else [[0.0], inside])
        acceleration = (stage.end_velocity - stage.start_velocity) / stage.duration
        path = _integrate(system, at, np.maximum.accumulate(wanted), stage, acceleration, tolerance)
        here = slice(first, after)
        there = slice(1, 1 + inside.size)
        driven = stage.start_velocity + acceleration * inside
        moved = load_point + (stage.start_velocity + 0.5 * acceleration * inside) * inside
        if is_rigid:
            velocity[here], logarithm[here], displacement[here] = driven, path[there, 0], moved
        else:
            velocity[here] = law.reference_velocity * np.exp(path[there, 0])
            logarithm[here] = path[there, 1]
            displacement[here] = path[there, 2]
            if mass > 0:
                load[here] = path[there, 3]
        at = list(path[-1])
        # A short excursion belongs to a trial step of the integration.
        if not is_rigid and mass == 0:
            if at[3] > law.slip_distance:
                raise RunError(UNSTABLE)
            at[3] = 0.0
        load_point += 0.5 * (stage.start_velocity + stage.end_velocity) * stage.duration
        begin = end
    if is_rigid or mass == 0:
        slides = velocity > 0
        rate = np.log(np.where(slides, velocity, np.nan) / law.reference_velocity)
        load = law.reference_force + law.a * rate + law.b * logarithm + damping * velocity
    state = law.slip_distance / law.reference_velocity * np.exp(logarithm)
    return Motion(load, velocity, state, displacement)


def _evolution(law: RateAndState) -> Any:
    """d ln θ/dt as a function of V/V_0, its logarithm, and ln(V_0 θ/D_c)."""
    rate = law.reference_velocity / law.slip_distance

    def ageing(velocity: float, _: float, state: float) -> float:
        return rate * (math.exp(min(-state, MAX_EXPONENT)) - velocity)

    def slip(velocity: float, logarithm: float, state: float) -> float:
        return -rate * velocity * (logarithm + state)

    return ageing if law.law == "ageing" else slip


def _rigid(law: RateAndState) -> Any:
    """Derivative of ln V_0 θ/D_c at prescribed velocity."""
    evolution, reference = _evolution(law), law.reference_velocity

    def derivative(time: float, at: Array, start: float, acceleration: float) -> list[float]:
        velocity = (start + acceleration * time) / reference
        logarithm = math.log(velocity) if velocity > 0 else 0.0
        return [evolution(max(velocity, 0.0), logarithm, at[0])]

    return derivative


def _on_spring(law: RateAndState, stiffness: float, damping: float, mass: float) -> Any:
    """Derivatives of ln V/V_0, ln V_0 θ/D_c and the displacement of the slider; fourth, that of the
    spring force with a mass, of the displacement at runaway velocity without."""
    evolution, reference, a, b = _evolution(law), law.reference_velocity, law.a, law.b
    force_0 = law.reference_force

    def derivative(time: float, at: Array, start: float, acceleration: float) -> list[float]:
        logarithm, state = at[0], at[1]
        ratio = math.exp(min(logarithm, MAX_EXPONENT))
        velocity = reference * ratio
        change = evolution(ratio, logarithm, state)
        loading = stiffness * (start + acceleration * time - velocity)
        if mass == 0:
            rate = (loading - b * change) / (a + damping * velocity)
            return [rate, change, velocity, velocity if logarithm > RUNAWAY else 0.0]
        friction = force_0 + a * logarithm + b * state + damping * velocity
        return [(at[3] - friction) / (mass * velocity), change, velocity, loading]

    return derivative


def _integrate(
    system: Any,
    at: Sequence[float],
    times: Array,
    stage: Loading,
    acceleration: float,
    tolerance: float,
) -> Array:
    """Integrate one stage; shape (times, variables)."""
    from scipy.integrate import ODEintWarning, odeint

    # Displacements are small in metres: their tolerance is relative to their change.
    absolute = np.full(len(at), tolerance)
    absolute[2:] = 0.0
    if len(at) > 2:
        absolute[2] = tolerance * max(
            stage.duration * max(stage.start_velocity, stage.end_velocity), 1e-12
        )
    if len(at) > 3:
        absolute[3] = tolerance * abs(at[3]) or math.inf
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", ODEintWarning)
        path, report = odeint(
            system,
            at,
            times,
            args=(stage.start_velocity, acceleration),
            tfirst=True,
            rtol=tolerance,
            atol=absolute,
            mxstep=MAX_STEPS,
            full_output=True,
        )
    if report["message"] != "Integration successful." or not np.all(np.isfinite(path)):
        raise RunError(UNSTABLE)
    result: Array = path
    return result
