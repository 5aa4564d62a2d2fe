"""The force curve of the master equation, F(X), and the elastic instability it leads to.

Slow forward sliding of infinitely many contacts, for which the delay does not matter: a renewal
equation, solved by collocation of high order (``fortran/theory/renewal.f90``) on panels that are
halved until the force no longer changes. Sources: Braun's "Stick-slip kinetics", Eqs. S42, S43,
S48.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize
from scipy.interpolate import BPoly

from mesoslip.array_types import Array
from mesoslip.errors import ConfigError
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.lives import law_parameters, newborn_stretch, scales
from mesoslip.theory.renewal import POINTS, solve_renewal, stretch_density
from mesoslip.theory.sampled_law import WIDER, sampled_law
from mesoslip.theory.sliders import loading_rate

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


WITHOUT_NEWBORN_WIDTH = (
    'has a force curve for coupling = "equal" only, with thresholds of which hardly any is below '
    'the width; a run of a prescribed slider with engine "me" gives F(X)'
)

# Width of the first panels over the spread of the break stretches.
FIRST_WIDTH = 0.7
# Maximum multiplications of a finer solution, which take about a second.
MAX_WORK = 2e9
# The same with a density estimated from samples, whose error is larger.
MAX_SMOOTHED_WORK = 2e8
# Displacements at which the error of an estimated density is considered.
ERROR_POINTS = 400
# A force counts as falling if it falls by more than this fraction of F_s, and than its error.
MIN_FALL = 1e-11
# A curve has reached the stationary force if it ends within this fraction of it.
ARRIVED = 0.01
# Maximum number of panels, which fit into memory.
MAX_PANELS = 4_000_000


class CriticalPoint(NamedTuple):
    """A solution of F'(X) = -K, and the expansion of the force about it (model section 6)."""

    displacement: float
    """X_c [m]."""
    force: float
    """F(X_c) [N]."""
    curvature: float
    """F''(X_c) [N/m²]."""
    third_derivative: float
    """F'''(X_c) [N/m³]."""
    D0: float
    D2: float
    D3: float


class ForceCurve:
    """F(X) of a configuration, from the start of its contacts to ``curve.length``.

    All displacements, forces and stiffnesses are in SI units and of all contacts together.

    Parameters
    ----------
    config
        The contacts; the table ``curve`` has the length of the curve and its tolerance.

    Attributes
    ----------
    stretch_unit
        Mean breaking stretch F_s/(N k) [m].
    error, slope_error
        Estimated errors of the force over F_s and of its slope over Nk: the change in the last
        halving of the panels, an upper estimate.
    conservation_error
        Maximum deviation of the number of contacts from 1.
    panels, kernel_seconds
        Panels of the result; computing time of all solutions together.

    Raises
    ------
    ConfigError
        If the curve is too long for so narrow a threshold law, or contacts age or break by
        thermal activation.
    """

    def __init__(self, config: Config, *, _widening: float | None = None) -> None:
        self.config = config
        contacts = config.contacts
        contact_theory(config).check_force_curve()
        if contacts.newborn_width > 0 and contacts.initial == "steady":
            raise ConfigError.of(
                "contacts.initial",
                'must be "relaxed" for a force curve with contacts.newborn_width: from the '
                'start "steady" the force stays at F_steady of `mesoslip info`',
                contacts.initial,
            )
        newborn_width = newborn_stretch(config)
        if newborn_width is None:
            raise ConfigError.of("contacts.newborn_width", WITHOUT_NEWBORN_WIDTH)
        self.newborn_width = newborn_width or config.curve.newborn_width
        self.stretch_unit = contacts.static_force / contacts.stiffness
        self.scales = scales(config, self.newborn_width)
        self._sampled = sampled_law(config)
        self._widening = _widening
        self.length = config.curve_length
        self._force_unit = contacts.static_force
        self._refine()

    def _refine(self) -> None:
        parameters = law_parameters(self.config, self.newborn_width)
        if self._sampled is not None and self._widening is not None:
            parameters |= self._sampled.parameters(self._widening)
        elif self._sampled is not None and self._has_equal_cells:
            # The solver of cells with stiffnesses does not sample a rough density at points.
            ones = (1.0,) * np.size(parameters["threshold_weights"])
            parameters |= {"coupling": "table", "threshold_stiffnesses": ones}
        length = self.length / self.stretch_unit
        start, width = self._first_panels(length)
        coarse = None
        self.kernel_seconds = 0.0
        self._solution_error = self.slope_error = math.inf
        while True:
            begin = time.perf_counter()
            panels = math.ceil((length - start) / width)
            if panels > MAX_PANELS:
                raise ConfigError.of(
                    "curve.length",
                    f"needs {panels:.1e} steps of the spread of the breaking stretches, of "
                    f"which there may be {MAX_PANELS:.0e}: choose a shorter curve or a "
                    "wider threshold law",
                    self.length,
                )
            fine = solve_renewal(parameters, start, width, panels)
            self.kernel_seconds += time.perf_counter() - begin
            if coarse is not None:
                inside = np.linspace(max(0.0, start), length, 20011)[1:-1]
                self._solution_error = float(
                    np.max(np.abs(fine.force(inside) - coarse.force(inside)))
                )
                self.slope_error = float(np.max(np.abs(fine.slope(inside) - coarse.slope(inside))))
            is_exact = self._solution_error <= self.config.curve.tolerance
            if is_exact or (coarse is not None and self._is_too_much(2 * panels, width / 2)):
                break
            coarse = fine
            width /= 2
        self._solution = fine
        self.panels = panels
        self.conservation_error = fine.conservation_error if self.config.contacts.reattach else 0.0
        self._solution_error = max(self._solution_error, self.conservation_error)

    @property
    def _has_equal_cells(self) -> bool:
        """Whether contacts of a table have one stiffness and attach with one force."""
        return self.config.contacts.coupling == "equal" and self.newborn_width == 0

    @property
    def error(self) -> float:
        """Estimated error of the force over F_s: of the solution, and of samples of thresholds."""
        sampling = 0.0 if self._sampled is None else self._sampled.force_error
        return self._solution_error + sampling

    def _is_too_much(self, panels: int, width: float) -> bool:
        """Whether a solution would take too much work."""
        band = min(panels, (self.scales.longest - self.scales.shortest) / width + 3)
        max_work = MAX_WORK if self._widening is None else MAX_SMOOTHED_WORK
        return panels * band * POINTS * (3 + 2 * POINTS) > max_work

    def _first_panels(self, length: float) -> tuple[float, float]:
        """Start and width of the panels, with their edges where the density is discontinuous."""
        threshold, is_scaled = (
            self.config.contacts.threshold,
            self.config.contacts.coupling == "scaled",
        )
        spread = min(self.config.contacts.stretch_width, 0.175 if is_scaled else 0.35)
        width = min(FIRST_WIDTH * spread, length)
        scales = self.scales
        # The first generation breaks between two displacements, the next ones after lives of at
        # least the shortest; the width divides the distance between discontinuities.
        period = 0.0
        if self.config.contacts.initial == "uniform":
            period = scales.first_shortest
        elif threshold.kind.jumps == "both":
            period = scales.first_longest - scales.first_shortest
        elif threshold.kind.jumps == "lower":
            period = scales.shortest
        if period > width / 20:
            width = period / math.ceil(period / width)
        if self.config.contacts.initial != "relaxed":
            return 0.0, width
        first = scales.first_shortest
        return min(0.0, first - math.ceil(first / width) * width), width

    @property
    def digits(self) -> int:
        """Decimal digits of the force over F_s that are certain."""
        return max(0, math.floor(-math.log10(max(self.error, 1e-16))))

    def _evaluate(self, polynomial: BPoly, displacement: ArrayLike, unit: float) -> Array:
        values: Array = unit * polynomial(np.asarray(displacement, dtype=float) / self.stretch_unit)
        return values

    def force(self, displacement: ArrayLike) -> Array:
        """F(X) [N]; NaN beyond the curve."""
        return self._evaluate(self._solution.force, displacement, self._force_unit)

    def slope(self, displacement: ArrayLike, derivative: int = 1) -> Array:
        """F'(X) [N/m] or a higher derivative [N/m^n]; NaN beyond the curve."""
        slope = self._solution.slope
        if derivative > 1:
            slope = slope.derivative(derivative - 1)
        return self._evaluate(slope, displacement, self._force_unit / self.stretch_unit**derivative)

    def stiffness(self, displacement: ArrayLike) -> Array:
        """Stiffness of the pinned contacts, K_c(X) [N/m]."""
        return self._evaluate(
            self._solution.stiffness, displacement, self._force_unit / self.stretch_unit
        )

    def breaks(self, displacement: ArrayLike) -> Array:
        """Γ(X): breaks of a contact over displacement [1/m]."""
        return self._evaluate(self._solution.breaks, displacement, 1 / self.stretch_unit)

    def potential(self, displacement: ArrayLike, drive_displacement: float) -> Array:
        """V_eff(X_d, X) = K (X_d - X)²/2 + ∫₀^X F [J], Eq. S42."""
        x = np.asarray(displacement, dtype=float)
        work = self._work_of_contacts
        values: Array = 0.5 * self.spring_stiffness * (drive_displacement - x) ** 2
        values += self._force_unit * self.stretch_unit * (work(x / self.stretch_unit) - work(0.0))
        return values

    @cached_property
    def _work_of_contacts(self) -> BPoly:
        return self._solution.force.antiderivative()

    @property
    def spring_stiffness(self) -> float:
        """K, in series with the spring of a base [N/m]; infinite for a prescribed slider, 0 for one
        that is driven by force."""
        return self.config.series_stiffness

    @cached_property
    def samples(self) -> Array:
        """Displacements [m] that show every feature: the points of the panels above 0."""
        solution = self._solution
        width = solution.edges[1] - solution.edges[0]
        nodes = (solution.edges[:-1, None] + width * solution.point).ravel()
        nodes = np.concatenate([[0.0], nodes[nodes > 0]])
        return self.stretch_unit * nodes[nodes * self.stretch_unit <= self.length]

    def _extreme(self, function: Callable[[Array], Array], sample: int) -> tuple[float, float]:
        """Displacement and value of the minimum of a function next to one of the samples."""
        low = self.samples[max(sample - 1, 0)]
        high = self.samples[min(sample + 1, len(self.samples) - 1)]
        scale = self.stretch_unit
        found = optimize.minimize_scalar(
            lambda x: float(function(x * scale)),
            bounds=(low / scale, high / scale),
            method="bounded",
            options={"xatol": 1e-12},
        )
        best = min((float(function(x)), float(x)) for x in (low, high, found.x * scale))
        return best[1], best[0]

    @cached_property
    def K_star(self) -> tuple[float, float]:  # noqa: N802
        """K* = max(-F'(X)) [N/m] and its displacement [m]: a stiffer spring slides smoothly.

        A force that does not fall flattens out for ever, so that K* is 0, at infinity. That is so
        for lives the likelier to end the younger they are: wide laws whose density diverges at 0,
        or the exponential one (M. Brown, Ann. Probab. 8 (1980) 227: ages grow with displacement).
        """
        if not self.is_sampled:
            return self._steepest if self.falls else (0.0, math.inf)
        stiffness, displacement = self._smoothed._steepest
        # The bias of a density estimate is of second order in the bandwidth.
        wider = ForceCurve(self.config, _widening=WIDER)._steepest[0]
        return max(0.0, 2 * stiffness - wider), displacement

    @property
    def is_sampled(self) -> bool:
        """Whether thresholds are known by samples.

        F(X) is that of the cells around them, as in runs; K* and X_c need a density, and are those
        of an estimated one.
        """
        return self._sampled is not None

    @cached_property
    def _smoothed(self) -> ForceCurve:
        """The curve of the estimated density of samples; itself if the law has a formula."""
        if self._sampled is None or self._widening is not None:
            return self
        return ForceCurve(self.config, _widening=1.0)

    @cached_property
    def K_star_error(self) -> float:  # noqa: N802
        """Error of K* [N/m]: of the solution, and of samples of thresholds, two standard
        deviations and the correction for the bandwidth."""
        smoothed = self._smoothed
        error = smoothed.slope_error * self._force_unit / self.stretch_unit
        if self._sampled is None:
            return error
        stretch = np.linspace(0, self.scales.first_longest, ERROR_POINTS)[1:]
        slope = smoothed.slope(stretch * self.stretch_unit)
        sampling = self._sampled.slope_error(stretch) * self.config.contacts.stiffness
        steepest = smoothed._steepest[0]
        # The maximum may be anywhere that the errors allow.
        above = float(np.nanmax(sampling - slope)) - steepest
        return error + math.hypot(above, self.K_star[0] - max(steepest, 0.0))

    @cached_property
    def _steepest(self) -> tuple[float, float]:
        """Maximum of -F'(X) [N/m] and its displacement [m]."""
        sample = int(np.argmin(self.slope(self.samples)))
        displacement, slope = self._extreme(self.slope, sample)
        return -slope, displacement

    @cached_property
    def falls(self) -> bool:
        """Whether the force falls anywhere on the curve by more than the error of its solution."""
        force = self.force(self.samples)
        fall = np.max(np.maximum.accumulate(force) - force) / self._force_unit
        return bool(fall > max(self._solution_error, MIN_FALL))

    @cached_property
    def peak(self) -> tuple[float, float]:
        """Maximum force [N] and its displacement [m]; the curve's end if the force only rises."""
        sample = int(np.argmax(self.force(self.samples)))
        displacement, force = self._extreme(lambda x: -self.force(x), sample)
        return -force, displacement

    @property
    def steady_force(self) -> float:
        """Force of stationary slow sliding, N ⟨k (x_s² - x_b²)/2⟩/⟨x_s - x_b⟩ [N]."""
        return self.scales.steady_force * self._force_unit

    @property
    def stable(self) -> bool:
        """Whether K ≥ K*: slow sliding from this start has no instability; see `verdict`."""
        return self.spring_stiffness >= self.K_star[0]

    @property
    def verdict(self) -> str:
        """Conclusions for the configured spring, and their limits."""
        sentences = []
        if not self.falls:
            sentences.append("the force does not fall: it has no peak, and K* = 0")
        if self._ends_early:
            sentences.append(
                "the curve ends before the force is stationary, so that K* may be larger: choose a "
                "longer curve.length"
            )
        if self._is_open:
            sentences.append(
                f"{self._name} differs from K* by less than the error of K*, which the samples of "
                "thresholds leave"
            )
        if math.isinf(self.spring_stiffness):
            sentences.append("the slider follows the drive, so it has no instability")
        elif self.spring_stiffness == 0 and self.falls:
            sentences.append(
                "there is no spring: under a force that grows slowly the slider starts to slide at "
                "F_peak, its static friction"
            )
        elif self.stable:
            sentences.append(
                f"{self._name} >= K*: without delay slow sliding from this start has no "
                f"instability{self._with_delay}"
            )
        else:
            sentences.append(
                f"{self._name} < K*: slow sliding from this start becomes unstable at X_c, where "
                f"the first slip starts{self._after_slip}"
            )
        return "; ".join(sentences)

    @property
    def _is_open(self) -> bool:
        """Whether samples of thresholds do not decide between the spring and K*."""
        difference = abs(self.spring_stiffness - self.K_star[0])
        return self.is_sampled and difference < self.K_star_error

    @property
    def _name(self) -> str:
        """The stiffness that is compared with K*, in words."""
        if self.spring_stiffness == self.config.spring_stiffness:
            return "K"
        from mesoslip.quantities import with_unit

        return f"K in series with the base, {with_unit(self.spring_stiffness, 'N/m', 3)},"

    @property
    def _with_delay(self) -> str:
        if not self.config.contacts.reattach:
            return ""
        return ". The delay is not part of the curve: with it there may be stick-slip nevertheless"

    @property
    def _after_slip(self) -> str:
        if not self.config.contacts.reattach:
            return ""
        return (
            ". The delay, which is not part of the curve, and inertia decide whether slips "
            "continue or decay into smooth sliding"
        )

    @property
    def _ends_early(self) -> bool:
        """Whether the force beyond the end of the curve may change K*."""
        if self.falls:
            return bool(self.K_star[1] > self.samples[-3])
        end = float(self.force(self.samples[-1]))
        return end < (1 - ARRIVED) * self.steady_force or not self.config.contacts.reattach

    @cached_property
    def critical_points(self) -> tuple[CriticalPoint, ...]:
        """All solutions of F'(X) = -K, the lowest first; none if sliding is smooth."""
        if self._smoothed is not self:
            return self._smoothed.critical_points
        spring = self.spring_stiffness
        if math.isinf(spring):
            return ()
        samples = self.samples
        if self.falls:
            samples = np.unique([*samples, self._steepest[1]])
        excess = self.slope(samples) + spring
        changes = np.flatnonzero(np.diff(np.sign(excess)) != 0)
        scale = self.stretch_unit
        points = []
        for first in changes:
            low, high = samples[first : first + 2] / scale
            root = optimize.brentq(
                lambda x: float(self.slope(x * scale)) + spring, low, high, xtol=1e-15
            )
            points.append(self._critical_point(root * scale))
        return tuple(points)

    def _critical_point(self, displacement: float) -> CriticalPoint:
        force = float(self.force(displacement))
        second, third = (float(self.slope(displacement, order)) for order in (2, 3))
        if self.is_sampled:
            # Samples do not give derivatives of a density.
            second = third = math.nan
        unit = self._force_unit
        extension = unit / self.spring_stiffness if self.spring_stiffness > 0 else math.inf
        return CriticalPoint(
            displacement,
            force,
            second,
            third,
            force / unit,
            -second * extension**2 / (2 * unit),
            -third * extension**3 / (6 * unit),
        )

    def stretch_density(self, stretch: ArrayLike, displacement: float) -> tuple[Array, float]:
        """Q(x; X) [1/m] at stretches x [m], and the fraction of contacts that are all at x = X.

        The fraction is not zero after a relaxed start while some of the first generation remain.
        The integral of the density and the fraction add up to 1.
        """
        unit = self.stretch_unit
        density, atom = stretch_density(
            self.config,
            self._solution.breaks,
            np.atleast_1d(np.asarray(stretch, dtype=float)) / unit,
            displacement / unit,
            newborn_width=self.newborn_width / unit,
            mean_life=self.scales.mean_life,
        )
        return density / unit, atom

    @property
    def solver(self) -> str:
        """How it was solved, in words."""
        return f"collocation at {POINTS} points of {self.panels} panels"

    def summary(self) -> dict[str, float | bool | None]:
        """Derived quantities of the curve in SI units; None for those that do not exist.

        ``X_c`` and ``D0``, ``D2``, ``D3`` belong to the lowest solution of F'(X) = -K, which does
        not exist if sliding is stable; ``D2`` and ``D3`` need a law with a formula, as samples of
        thresholds do not give derivatives of a density; ``bandwidth`` is that of samples; ``D1``
        needs a drive that moves and a slider with a mass. A force that does not fall has neither
        ``F_peak`` nor a displacement at K*, which is 0.
        """
        critical = self.critical_points[0] if self.critical_points else None
        force, peak_displacement = self.peak
        stiffness, stiffness_displacement = self.K_star
        return {
            "K_star": stiffness,
            "K_star_error": self.K_star_error,
            "K_star_displacement": stiffness_displacement if stiffness > 0 else None,
            "K_star_estimate": contact_theory(self.config).K_star_estimate,
            "stable": self.stable,
            "X_c": critical.displacement if critical else None,
            "F_c": critical.force if critical else None,
            "F_peak": force if self.falls else None,
            "X_peak": peak_displacement if self.falls else None,
            "F_steady": self.steady_force,
            "D0": critical.D0 if critical else None,
            "D1": loading_rate(self.config.slider, self.config),
            "D2": critical.D2 if critical and self._sampled is None else None,
            "D3": critical.D3 if critical and self._sampled is None else None,
            "bandwidth": self._sampled.bandwidth if self._sampled else None,
            "error": self.error,
            "slope_error": self.slope_error,
            "digits": self.digits,
            "conservation_error": self.conservation_error,
        }
