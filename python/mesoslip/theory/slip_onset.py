"""The onset of slip: contacts that break one after another, or a film that melts at once.

Eqs. S46 and S47 of Braun's "Stick-slip kinetics" in the dimensionless displacement
x = K (X - X_c)/F_s and time τ = Ω_S (t - t_c), integrated by CVODE (``fortran/theory/onset.f90``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy import optimize

from mesoslip import _core
from mesoslip.array_types import Array
from mesoslip.errors import ConfigError, RunError
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import ONSET
from mesoslip.text_rows import named_meanings
from mesoslip.theory.force_curve import ForceCurve

# Units and meanings of the summary of the onset.
SUMMARY = named_meanings("""
stable | 1 | whether K >= K*, so that slow sliding has no onset of slip
K_star | N/m | spring constant above which there is no onset
X_c | m | displacement at the onset
D0 | 1 | F(X_c)/F_s
D1 | 1 | v_d (K M)^(1/2)/F_s
D2 | 1 | -(1/2) F''(X_c) F_s/K^2
D3 | 1 | -(1/6) F'''(X_c) F_s^2/K^3
alpha | 1 | duration of a slip in which contacts break one after another (S46), in 1/Omega_S:
    (6/D1)^(1/3)
slip_time_sequential | s | duration of such a slip, alpha/Omega_S
B | 1 | start of a slip in which the whole film melts at once (S47), where the spring force falls by
    B F_s (Omega_S t)^2: (D0 - eta D1/Omega_S)/2
beta | 1 | duration of such a slip, in 1/Omega_S: B^(-1/2)
slip_time_melting | s | duration of such a slip, beta/Omega_S
expansion_end | 1 | x up to which the expansion S46 describes the contacts
expansion_end_time | 1 | tau = Omega_S (t - t_c) at that x
""")

EQUATIONS = ("sequential", "melting")
# S46 describes the contacts while its force differs by less than this fraction of F_s.
EXPANSION_ERROR = 0.02
TOLERANCE = 1e-10
MAX_SAMPLES = 50_000
# Samples in the time scale of an equation.
SAMPLES = 200


@dataclass(frozen=True)
class Onset:
    """A solution of S46 or S47; arrays over the samples of τ, x, x′ and its running mean.

    The force drop is ΔF_d/F_s = D1 τ - x, negative: the change of the spring force. S46 ends at the
    end of its expansion, S47 at the minimum spring force.
    """

    time: Array
    displacement: Array
    velocity: Array
    mean_velocity: Array
    force_drop: Array
    ended: bool


def solve(
    equation: Literal["sequential", "melting"],
    coefficients: tuple[float, float, float, float],
    *,
    damping: float = 0.0,
    drag: float = 0.0,
    end_displacement: float = math.inf,
    interval: float | None = None,
) -> Onset:
    """Integrate S46 ("sequential") or S47 ("melting") with the coefficients D0 to D3.

    ``damping`` is η_S/Ω_S, ``drag`` the η/Ω_S of the molten film per slider mass; S46 ends at the x
    of ``end_displacement``; ``interval`` of the samples in τ is by default a small fraction of the
    equation's time scale. A RunError is raised if the integration fails.
    """
    _, d_1, d_2, _ = coefficients
    if interval is None:
        scale = 1.0
        if equation == "sequential":
            scale = min(1.0, (d_1 * max(d_2, 1.0)) ** -0.2, 4 * end_displacement / d_1)
        interval = scale / SAMPLES
    samples = np.zeros((4, MAX_SAMPLES), order="F")
    count, ended, status, message = _core.onset(
        equation,
        np.array(coefficients),
        damping,
        drag,
        min(end_displacement, 1e300),
        interval,
        TOLERANCE,
        samples,
    )
    if status != 0:
        raise RunError(message.decode().strip())
    time, displacement, velocity, mean = samples[:, :count]
    return Onset(time, displacement, velocity, mean, d_1 * time - displacement, bool(ended))


def end_of_expansion(curve: ForceCurve) -> float:
    """Displacement from X_c [m] at which the expansion of F differs by `EXPANSION_ERROR` of F_s, or
    the curve ends."""
    critical = curve.critical_points[0]
    spring = curve.config.spring_stiffness
    start = critical.displacement
    x = curve.samples[curve.samples > start] - start

    def excess(distance: Array | float) -> Any:
        expansion = (
            critical.force
            - spring * distance
            + critical.curvature * distance**2 / 2
            + critical.third_derivative * distance**3 / 6
        )
        error = np.abs(expansion - curve.force(start + distance))
        return error - EXPANSION_ERROR * curve.config.contacts.static_force

    beyond = np.flatnonzero(excess(x) > 0)
    if beyond.size == 0:
        return float(x[-1])
    first = int(beyond[0])
    low = float(x[first - 1]) if first > 0 else 0.0
    return float(optimize.brentq(excess, low, float(x[first]), xtol=1e-15 * float(x[-1])))


def onset(config: ConfigLike) -> xr.DataTree:
    """The onset of slip by Eqs. S46 and S47, from the force curve of the master equation.

    Parameters
    ----------
    config
        A TOML file, an output, nested tables, or a `Config`.

    Returns
    -------
    xarray.DataTree
        Groups ``sequential`` (S46) and ``melting`` (S47) with dimension ``time``; attributes: the
        coefficients, the slip times of both and their endings. Without groups if sliding is stable.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong, the slider is not rigid, or the drive does
        not move.
    RunError
        If an integration fails.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> sorted(mesoslip.onset(path).children)
    ['melting', 'sequential']
    """
    config = as_config(config)
    slider = config.slider.oscillator
    if slider is None:
        kind = config.slider.kind
        raise ConfigError.of("slider.kind", "must be rigid for the onset of slip", kind)
    curve = ForceCurve(config)
    if curve.is_sampled:
        message = "has no onset: S46 needs derivatives of the density, which samples do not give"
        raise ConfigError.of("contacts.threshold.law", message, config.contacts.threshold.law)
    summary = curve.summary()
    if summary["D1"] is None:
        raise ConfigError.of("drive", "must move for the onset of slip")
    attributes = program_attributes(config, "onset") | {
        name: value for name, value in summary.items() if value is not None
    }
    attributes["stable"] = str(curve.stable).lower()
    if not curve.critical_points:
        attributes["comment"] = f"F' is above -K everywhere: there is no onset; {curve.verdict}"
        return xr.DataTree(xr.Dataset(attrs=attributes))

    omega = slider.frequency
    critical = curve.critical_points[0]
    coefficients = (critical.D0, float(summary["D1"]), critical.D2, critical.D3)
    damping = slider.damping / omega
    drag = config.contacts.count * config.contacts.contact_drag / slider.mass / omega
    end = end_of_expansion(curve) * slider.stiffness / config.contacts.static_force
    solutions = {
        "sequential": solve("sequential", coefficients, damping=damping, end_displacement=end)
    }
    # The force does not drop if the drag of the film at the velocity of the drive exceeds D0.
    drops = coefficients[0] > drag * coefficients[1]
    if drops:
        solutions["melting"] = solve("melting", coefficients, damping=damping, drag=drag)
    attributes |= slip_times(coefficients, drag, omega) | {
        "omega_s": omega,
        "expansion_end": end,
        "expansion_end_time": float(solutions["sequential"].time[-1]),
        "comment": "S46 ends where its expansion of the force differs by "
        f"{EXPANSION_ERROR:g} of the static force"
        + ("" if solutions["sequential"].ended else "; it did not reach that")
        + (
            "; S47 has no solution with a drop, as the drag of the film exceeds D0"
            if not drops
            else "; S47 ends at the minimum spring force"
            + ("" if solutions["melting"].ended else ", but did not reach it")
        )
        + f"; {curve.verdict}",
    }
    groups = {
        name: xr.DataTree(_dataset(one, asymptote(name, one.time, coefficients, drag)))
        for name, one in solutions.items()
    }
    return xr.DataTree(xr.Dataset(attrs=attributes), children=groups)


def slip_times(
    coefficients: tuple[float, float, float, float], drag: float, omega: float
) -> dict[str, float]:
    """α, β and B of section 6 of the model with the slip times [s]; β only if it exists."""
    d_0, d_1, _, _ = coefficients
    alpha = (6 / d_1) ** (1 / 3)
    b = 0.5 * (d_0 - drag * d_1)
    times = {"alpha": alpha, "slip_time_sequential": alpha / omega, "B": b}
    if b > 0:
        times |= {"beta": b**-0.5, "slip_time_melting": b**-0.5 / omega}
    return times


def asymptote(
    equation: str, time: Array, coefficients: tuple[float, float, float, float], drag: float
) -> Array:
    """ΔF_d/F_s at short times: -D1 τ³/6 for S46, -B τ² for S47."""
    d_0, d_1, _, _ = coefficients
    if equation == "sequential":
        return -d_1 * time**3 / 6
    return -0.5 * (d_0 - drag * d_1) * time**2


def _dataset(solution: Onset, short_times: Array) -> xr.Dataset:
    columns = {
        "onset_displacement": solution.displacement,
        "onset_velocity": solution.velocity,
        "onset_mean_velocity": solution.mean_velocity,
        "relative_force_drop": solution.force_drop,
        "asymptote": short_times,
    }
    return xr.Dataset(
        {name: ONSET.variable(name, ("onset_time",), values) for name, values in columns.items()},
        coords={"onset_time": ONSET.variable("onset_time", ("onset_time",), solution.time)},
        attrs={"ended": str(solution.ended).lower()},
    )
