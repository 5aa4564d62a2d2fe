"""The renewal equation of slow forward sliding, solved by collocation on panels of equal width.

The solver is ``fortran/theory/renewal.f90``; here its values become polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.interpolate import BPoly

from mesoslip import _core
from mesoslip.array_types import Array
from mesoslip.configuration.kernel_parameters import Parameters, named
from mesoslip.execution.interruptible import interruptible
from mesoslip.simulation.kernel import checked

# Points of collocation in a panel: the force converges with the order of this number.
POINTS = 12


@dataclass(frozen=True)
class RenewalSolution:
    """Polynomials of the dimensionless displacement, and numbers of the solver."""

    edges: Array
    point: Array
    force: BPoly
    slope: BPoly
    stiffness: BPoly
    breaks: BPoly
    conservation_error: float
    mismatch: float


def solve_renewal(
    parameters: Parameters, start: float, width: float, panels: int
) -> RenewalSolution:
    """Solve the renewal equation of a law by `law_parameters`, with start and width of panels over
    the mean breaking stretch."""
    point, breaks, slope, force, stiffness, pinned, mismatch = checked(
        interruptible(_core.force_curve, *named(parameters), start, width, panels, POINTS)
    )
    edges: Array = start + width * np.arange(panels + 1, dtype=np.float64)
    return RenewalSolution(
        edges,
        point,
        force=_polynomials(edges, point, force),
        slope=_polynomials(edges, point, slope),
        stiffness=_polynomials(edges, point, stiffness),
        breaks=_polynomials(edges, point, breaks),
        conservation_error=float(np.max(np.abs(pinned - 1))),
        mismatch=float(mismatch),
    )


def _polynomials(edges: Array, point: Array, values: Array) -> BPoly:
    """The polynomials through values at the points of each panel, shape (points, panels)."""
    degree = len(point) - 1
    k = np.arange(degree + 1)
    bernstein = special.comb(degree, k) * point[:, None] ** k * (1 - point[:, None]) ** (degree - k)
    return BPoly(np.linalg.solve(bernstein, values), edges, extrapolate=False)
