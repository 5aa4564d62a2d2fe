"""Linear stability of steady sliding with delay: does a small perturbation grow or decay?

The master equation under a slider that moves with v t + ε e^(λt). The response of the contacts is

    Λ(λ) = -N g s φ(s) (1 - e^(-λ τ_d)) / (1 - ψ(s) e^(-λ τ_d)) + drag,    s = λ/v,

with g = 1/(⟨x_s - x_b⟩ + v τ_d), the Laplace transform ψ of the density of the lives x_s - x_b, and
that of the force of a contact over its life, φ. A slider of dynamic stiffness Z(λ) has the
characteristic equation Z(λ) + Λ(λ) = 0, whose roots in the right half-plane are counted by the
argument principle. Where delays are exponential 1/(1 + λ τ_d) stands for e^(-λ τ_d). The derivation
is in ``docs/steady-sliding.md``.
"""

from __future__ import annotations

import math
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.configuration.threshold_law import ThresholdLaw
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.threshold_laws.table import law_cells
from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.quantities import percent, with_unit
from mesoslip.theory.sliders import dynamic_stiffness

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

# Panels over the lives, and points of each: a law is a polynomial in each panel.
PANELS, POINTS = 100, 10
# Probability beyond either end of the quadrature over a threshold law.
LEFT_OUT = 1e-16
# Points of the path along which roots are counted, for each turn of its fastest factor; maximum
# change of the argument between two of them, and maximum number of halvings of an interval.
POINTS_A_TURN = 10
MAX_TURN = 0.8
MAX_HALVINGS = 40
# Maximum angle between the slider's function and its leading power where the path ends.
UNLIKE_POWER = 0.3
# Maximum number of points of the path.
MAX_POINTS = 400_000
# Arguments beyond which integrals of a panel come from a recurrence, and points of the rule that
# they come from otherwise, which is exact to rounding there.
LARGE, QUADRATURE_POINTS = 12.0, 26
# Growth rate over the frequency of the slider below which a perturbation does not grow, and its
# maximum.
NO_GROWTH = 1e-7
MAX_GROWTH = 1e6
# Steps of Newton's method, and relative change at which a root is found.
STEPS, ROOT_TOLERANCE = 25, 1e-10
# Imaginary part over the absolute value below which a root is real.
REAL = 1e-9
# Maximum number of starts of Newton's method on the path.
MAX_CANDIDATES = 40

# Relative width of thresholds with which contacts do not break in step.
OUT_OF_STEP = 0.5
# What linear theory leaves open, of a stable and of an unstable motion.
SHOWN_BY = "only a run or mesoslip cycle shows it"
OTHER_MOTION = f"A large oscillation may be possible too: {SHOWN_BY}"
NO_AMPLITUDE = f"Linear theory gives no amplitude: {SHOWN_BY}"

# Range of spring stiffnesses over that of all contacts in which the stable ones are sought.
MAX_STIFFNESS, MIN_STIFFNESS = 16.0, 1e-4
# Maximum number of layers whose frequencies the points of the path resolve.
MAX_LAYERS = 16

WITHOUT_AGEING = (
    "has no linear stability theory here: contacts that age break at times that depend on the "
    "history of the motion, so that the response has no closed form; only runs show the motion"
)

WITHOUT_ACTIVATION = (
    "has a response of its own: use mesoslip.theory.activated_sliding.ActivatedSliding"
)


WITHOUT_NEWBORN_WIDTH = (
    "has no linear stability theory here: contacts must attach with one force; `mesoslip curve` "
    "gives the steady force of contacts of one stiffness"
)


class Lives(NamedTuple):
    """Averages over the threshold law; stretches over f_s/k, stiffness over k, mass over m."""

    mean_life: float
    spread: float
    """Standard deviation of the lives."""
    stiffness: float
    """⟨k⟩."""
    newborn_force: float
    """⟨k x_b⟩."""
    broken_force: float
    """⟨k x_s⟩."""
    work: float
    """⟨k (x_s² - x_b²)/2⟩."""
    mass: float
    """⟨m⟩."""


class Transforms(NamedTuple):
    """Averages with e^(-s (x_s - x_b)), for each s."""

    life: Complex
    """ψ(s)."""
    stiffness: Complex
    """⟨k e^(-s (x_s - x_b))⟩."""
    broken_force: Complex
    """⟨k x_s e^(-s (x_s - x_b))⟩."""
    mass: Complex
    """⟨m e^(-s (x_s - x_b))⟩."""


class SteadySliding:
    """Steady sliding of a configuration, and the growth of small perturbations of it.

    The contacts are those of the master equation, N → ∞, with delay, back force and drag, without
    interaction.

    Parameters
    ----------
    config
        The configuration.
    velocity
        Velocity [m/s]; that of the drive by default.
    relative_width
        Relative width of the threshold law; that of the configuration by default.

    Raises
    ------
    ConfigError
        If contacts age or do not attach again, or there is no velocity.
    """

    is_activated: ClassVar[bool] = False

    def __init__(
        self,
        config: Config,
        velocity: float | None = None,
        *,
        relative_width: float | None = None,
    ) -> None:
        contacts = config.contacts
        problems = []
        if contacts.ageing is not None and not self.is_activated:
            problems.append(Problem("", "contacts.ageing", WITHOUT_AGEING))
        if contacts.thermal is not None and not self.is_activated:
            problems.append(Problem("", "contacts.thermal", WITHOUT_ACTIVATION))
        if contacts.newborn_width > 0:
            problems.append(Problem("", "contacts.newborn_width", WITHOUT_NEWBORN_WIDTH))
        if not contacts.reattach:
            problems.append(
                Problem("", "contacts.reattach", "without it there is no steady sliding", False)
            )
        if config.slider.layer_count > MAX_LAYERS:
            message = f"linear stability is found for at most {MAX_LAYERS}"
            problems.append(Problem("", "slider.layers", message, config.slider.layer_count))
        self.velocity = abs(config.drive_speed if velocity is None else velocity)
        if not 0 < self.velocity < math.inf:
            problems.append(
                Problem("", "drive.velocity", "steady sliding needs a velocity", self.velocity)
            )
        if problems:
            raise ConfigError(problems)
        self.config = config
        self.relative_width = relative_width or contacts.threshold.relative_width
        self.delay = 0.0 if config.slider.ignores_delay else contacts.delay
        self._stretch = contacts.break_stretch
        # Displacement in units of the breaking stretch, for a second.
        self._rate = self.velocity / self._stretch
        self._drag = contacts.count * contacts.contact_drag if self.delay > 0 else 0.0

    @cached_property
    def _law(self) -> ThresholdLaw:
        """The threshold law; of another width than samples have, a lognormal one."""
        threshold, minimum = self.config.contacts.threshold, self.config.contacts.min_threshold
        if self.relative_width == threshold.relative_width:
            return threshold.above(minimum)
        name = "lognormal" if threshold.kind.is_sampled else threshold.law
        return ThresholdLaw(name, self.relative_width, minimum)

    @cached_property
    def _panels(self) -> tuple[Array, float, Array]:
        """Middles of the panels, half their width, and coefficients (panels, points, averages) of
        Legendre polynomials for density, stiffness, force at breaking and mass."""
        first, last = self._life(self._law.quantile([1 - LEFT_OUT, LEFT_OUT]))
        edges = np.linspace(first, last, PANELS + 1)
        half = (edges[1] - edges[0]) / 2
        middle = (edges[1:] + edges[:-1]) / 2
        if LAWS[self._law.law].is_sampled:
            return middle, half, self._projected(edges)
        point, weight = np.polynomial.legendre.leggauss(POINTS)
        lives = middle[:, None] + half * point
        density, averaged = self._at_lives(lives)
        density /= half * np.sum(density * weight)
        values = density[:, :, None] * averaged
        legendre = np.polynomial.legendre.legvander(point, POINTS - 1).T
        order = (np.arange(POINTS) + 0.5)[:, None]
        coefficients = np.einsum("nj,pja->pna", order * legendre * weight, values)
        return middle, half, half * coefficients

    def _life(self, threshold: Array) -> Array:
        """Life x_s - x_b of contacts of a threshold."""
        contacts = self.config.contacts
        back = contacts.back_force_ratio
        if contacts.coupling == "equal":
            return threshold - back
        return np.sqrt(threshold) - back / np.sqrt(threshold)

    def _at_lives(self, lives: Array) -> tuple[Array, Array]:
        """Density of lives, and 1, stiffness, force at breaking and mass of contacts of a life."""
        contacts = self.config.contacts
        back = contacts.back_force_ratio
        if contacts.coupling == "scaled":
            root = (lives + np.sqrt(lives**2 + 4 * back)) / 2
            threshold, stretch, stiffness, mass = root**2, root, root, root**2
            # du/dl, as l = u^(1/2) - b u^(-1/2).
            density = self._law.density(threshold) * 2 * root / (1 + back / root**2)
        else:
            threshold = stretch = lives + back
            stiffness = mass = np.ones_like(lives)
            density = self._law.density(threshold)
        return density, np.stack(
            [np.ones_like(lives), stiffness, stiffness * stretch, mass], axis=-1
        )

    def _projected(self, edges: Array) -> Array:
        """Coefficients of panels for a law whose density is constant in cells: integrals over the
        parts of cells in each panel."""
        law = self._law
        assert law.samples is not None
        cells = self._life(law_cells(law.samples, law.weights).edges[1:])
        ends = np.unique(np.clip(np.concatenate([edges, cells]), edges[0], edges[-1]))
        point, weight = np.polynomial.legendre.leggauss(POINTS)
        half = np.diff(ends)[:, None] / 2
        lives = ends[:-1, None] + half * (1 + point)
        density, averaged = self._at_lives(lives)
        share = density * half * weight
        share /= np.sum(share)
        panel = np.clip(np.searchsorted(edges, lives[:, 0], "right") - 1, 0, PANELS - 1)
        width = edges[1] - edges[0]
        place = 2 * (lives - edges[panel][:, None]) / width - 1
        legendre = np.polynomial.legendre.legvander(place, POINTS - 1)
        order = np.arange(POINTS) + 0.5
        parts = np.einsum("pj,pjn,pja->pna", share, order * legendre, averaged)
        coefficients = np.zeros((PANELS, *parts.shape[1:]))
        np.add.at(coefficients, panel, parts)
        return coefficients

    @cached_property
    def lives(self) -> Lives:
        """Averages over the lives of contacts."""
        middle, half, coefficients = self._panels
        # Of the polynomials only the first has a mean, and the first two a first moment.
        mean = 2 * coefficients[:, 0].sum(axis=0)
        linear = 2 * middle @ coefficients[:, 0] + 2 / 3 * half * coefficients[:, 1].sum(axis=0)
        square = (
            2 * (middle**2 + half**2 / 3) @ coefficients[:, 0, 0]
            + 4 / 3 * half * middle @ coefficients[:, 1, 0]
            + 4 / 15 * half**2 * coefficients[:, 2, 0].sum()
        )
        life = float(linear[0])
        # k x_b = k x_s - k l, and k (x_s² - x_b²)/2 = k x_s l - k l²/2; k x_b is the back force.
        back = self.config.contacts.back_force_ratio
        quadratic = (
            2 * (middle**2 + half**2 / 3) @ coefficients[:, 0, 1]
            + 4 / 3 * half * middle @ coefficients[:, 1, 1]
            + 4 / 15 * half**2 * coefficients[:, 2, 1].sum()
        )
        return Lives(
            mean_life=life,
            spread=math.sqrt(max(0.0, float(square) - life**2)),
            stiffness=float(mean[1]),
            newborn_force=back,
            broken_force=float(mean[2]),
            work=float(linear[2] - quadratic / 2),
            mass=float(mean[3]),
        )

    def _transforms(self, s: Complex) -> Transforms:
        """Averages with e^(-s l): each polynomial of a panel is integrated exactly."""
        middle, half, coefficients = self._panels
        result = np.empty((len(s), 4), dtype=np.complex128)
        flat = coefficients.reshape(PANELS, -1)
        for start in range(0, len(s), 4096):
            part = s[start : start + 4096]
            side = np.where(part.real < 0, -1.0, 1.0)
            nearest = middle - half * side[:, None]
            sums = (np.exp(-part[:, None] * nearest) @ flat).reshape(len(part), POINTS, 4)
            integrals = _legendre_transforms(half * part, side)
            result[start : start + 4096] = np.einsum("sn,sna->sa", integrals, sums)
        return Transforms(*result.T)

    @property
    def force(self) -> float:
        """F(v) = N [⟨k (x_s² - x_b²)/2⟩ + ⟨m⟩ η v² τ_d]/(⟨x_s - x_b⟩ + v τ_d) [N]."""
        lives = self.lives
        slid = self._rate * self.delay
        dragged = self._drag * lives.mass * self.velocity * slid
        static = self.config.contacts.static_force
        return (static * lives.work + dragged) / (lives.mean_life + slid)

    @property
    def slope(self) -> float:
        """dF/dv [N s/m]: below zero sliding is weaker the faster it is."""
        lives = self.lives
        slid = self._rate * self.delay
        rise = 2 * self._drag * lives.mass * slid
        return (rise - self.force * self.delay / self._stretch) / (lives.mean_life + slid)

    def response(self, frequency: ArrayLike) -> Complex:
        """Λ(iω): contact force over displacement, of a slider moved at frequencies ω [N/m].

        Its real part is the stiffness of the contacts, its imaginary part over ω their damping;
        where that is negative, contacts feed an oscillation.
        """
        return self.response_at(1j * np.asarray(frequency, dtype=float))

    def response_at(self, rate: ArrayLike) -> Complex:
        """Λ(λ) for complex rates λ other than 0 [N/m]."""
        values = np.asarray(rate, dtype=np.complex128)
        parts = self._parts(values.ravel())
        return ((parts.fed + parts.free * parts.births) / parts.births).reshape(values.shape)

    def _parts(self, rate: Complex) -> Parts:
        lives, contacts = self.lives, self.config.contacts
        s = rate / self._rate
        transforms = self._transforms(s)
        # Average of e^(-λ t) over the delays t, and 1 less that, to all digits where it is small.
        if self.config.contacts.delay_law == "exponential":
            late = 1 / (1 + rate * self.delay)
            missing = rate * self.delay * late
        else:
            late = np.exp(-rate * self.delay)
            missing = -np.expm1(-rate * self.delay)
        births = 1 - transforms.life * late
        density = 1 / (lives.mean_life + self._rate * self.delay)
        load = lives.newborn_force - transforms.broken_force
        load += (lives.stiffness - transforms.stiffness) / s
        fed = -contacts.stiffness * density * load * missing
        dragging = self._drag * density * self._rate
        fed -= dragging * missing**2 * transforms.mass
        free = dragging * lives.mass * (rate * self.delay + missing)
        return Parts(fed, births, free, np.abs(transforms.life * late))

    def _characteristic(self, rate: Complex) -> tuple[Complex, Complex]:
        """An entire function with the roots of Z + Λ, over λ; and one with its extra roots, over λ.

        The second one is 1 - ψ e^(-λ τ_d), whose roots are those of the contacts alone, all of them
        with a negative real part but for that at 0.
        """
        slider = dynamic_stiffness(self.config.slider, rate)
        assert slider is not None
        parts = self._parts(rate)
        whole = slider.numerator + slider.denominator * parts.free
        scale = self._scale
        return (
            (whole * parts.births + slider.denominator * parts.fed) / (rate / scale),
            parts.births / (rate / scale),
        )

    @property
    def _scale(self) -> float:
        """A frequency of the slider [1/s]."""
        return 1 / self.config.slider.quiet_time

    @cached_property
    def _has_motion(self) -> bool:
        """Whether the slider has a motion of its own that the contacts may feed."""
        rate = np.array([1j * self._scale])
        return dynamic_stiffness(self.config.slider, rate) is not None

    @cached_property
    def _path(self) -> Array:
        """Frequencies along which the argument of the characteristic function is computed."""
        lives = self.lives
        turn = lives.mean_life / self._rate + self.delay
        # Beyond the last frequency the slider outweighs any response of the contacts.
        coarse = self._scale * np.geomspace(1e-2, 1e6, 1500)
        rate = 1j * coarse
        slider = dynamic_stiffness(self.config.slider, rate)
        assert slider is not None
        parts = self._parts(rate)
        whole = np.abs(slider.numerator + slider.denominator * parts.free)
        upper = np.abs(slider.denominator * parts.fed) / (1 - np.minimum(parts.life, 1 - 1e-12))
        weak = np.flatnonzero(whole < 3 * upper)
        last = coarse[weak[-1]] if weak.size else coarse[0]
        # There it grows as the power of λ, off the axis as well, where no part is real.
        slanting = np.exp(0.25j * math.pi)
        free = dynamic_stiffness(self.config.slider, slanting * coarse)
        assert free is not None
        turn_left = np.angle(free.numerator * slanting**-free.degree)
        unlike = np.flatnonzero(np.abs(turn_left) > UNLIKE_POWER)
        last = 1.5 * max(last, coarse[unlike[-1]] if unlike.size else coarse[0])
        # Fast factors: e^(-s l) while lives are alike enough for it not to average out.
        alike = min(last, 12 * self._rate / lives.spread)
        fine = _spaced(0.0, alike, 2 * math.pi / (POINTS_A_TURN * turn))
        late = 2 * math.pi / (POINTS_A_TURN * max(self.delay, 1e-300))
        rest = _spaced(alike, last, late)
        own = np.geomspace(1e-3 * self._scale, last, max(400, 100 * slider.degree))
        frequencies: Array = np.unique(np.concatenate([[0.0], fine, rest, own[own <= last]]))
        return frequencies

    def _right_of(self, real: float) -> int:
        """Number of roots with a real part above a positive one, by the argument principle.

        Z + Λ has no poles there. It grows as a power of λ, whose degree gives the change of its
        argument around the half-plane; the change along the line itself is computed.

        Raises
        ------
        RunError
            If that leaves the range of floating-point numbers.
        """
        slider = dynamic_stiffness(self.config.slider, np.array([1j * self._scale]))
        assert slider is not None
        path = self._path
        values = self._values(real + 1j * path)
        for _ in range(MAX_HALVINGS):
            turns = np.abs(np.angle(values[:, 1:] / values[:, :-1])).max(axis=0)
            large = np.flatnonzero(turns > MAX_TURN)
            if large.size == 0 or path.size > MAX_POINTS:
                break
            between = (path[large] + path[large + 1]) / 2
            added = self._values(real + 1j * between)
            path = np.insert(path, large + 1, between)
            values = np.insert(values, large + 1, added, axis=1)
        turned = np.sum(np.angle(values[:, 1:] / values[:, :-1]), axis=1)
        turned += np.angle(values[:, 0])
        # The rest of the path turns with the power of λ.
        angle = math.atan2(path[-1], real)
        last = complex(values[0, -1] / values[1, -1] * np.exp(-1j * slider.degree * angle))
        argument = float(turned[0] - turned[1]) - math.atan2(last.imag, last.real)
        argument += slider.degree * (math.pi / 2 - angle)
        return round(slider.degree / 2 - argument / math.pi)

    def _values(self, rate: Complex) -> Complex:
        """Both parts of the characteristic function, shape (2, rates), none of them zero."""
        with np.errstate(all="ignore"):
            values: Complex = np.stack(self._characteristic(rate))
        if not np.all(np.isfinite(values) & (np.abs(values) > 0)):
            raise RunError(
                "the stability of steady sliding leaves the range of floating-point numbers"
            )
        return values

    @property
    def _is_passive(self) -> bool:
        """Whether the force of steady contacts does not depend on the motion of the slider."""
        return self.delay == 0

    @cached_property
    def unstable_count(self) -> int:
        """Number of roots that grow, each of a pair counted.

        Raises
        ------
        RunError
            If that leaves the range of floating-point numbers.
        """
        if not self._has_motion or self._is_passive:
            return 0
        return self._right_of(NO_GROWTH * self._scale)

    @property
    def is_stable(self) -> bool:
        """Whether no small perturbation of steady sliding grows.

        Without delay none does: the force of steady contacts, whose distribution of stretches is
        stationary, does not change, however the slider moves. Nor does one grow under a slider
        without inertia.
        """
        return self.unstable_count == 0

    @cached_property
    def is_stable_out_of_step(self) -> bool:
        """Whether no perturbation grows for contacts whose lives differ by half a breaking stretch.

        A large oscillation itself spreads lives by as much. That an instability which needs
        contacts in step stays small is a heuristic, with exceptions (``docs/steady-sliding.md``).
        """
        if self.relative_width >= OUT_OF_STEP:
            return self.is_stable
        other = SteadySliding(self.config, self.velocity, relative_width=OUT_OF_STEP)
        return other.is_stable

    @cached_property
    def leading_root(self) -> complex | None:
        """The root λ with the maximum real part [1/s], of those with an imaginary part ≥ 0.

        None for a slider without inertia.
        """
        if not self._has_motion:
            return None
        found = self._roots(NO_GROWTH * self._scale)
        if self.is_stable:
            found = found[found.real <= NO_GROWTH * self._scale]
            return complex(found[np.argmax(found.real)]) if found.size else None
        leading = found[np.argmax(found.real)] if found.size else 0j
        margin = 1e-3 * max(abs(leading.real), NO_GROWTH * self._scale)
        if leading.real <= 0 or self._right_of(leading.real + margin) > 0:
            leading = self._rightmost(max(leading.real + margin, NO_GROWTH * self._scale))
        return complex(leading)

    def _rightmost(self, low: float) -> complex:
        """The root with the maximum real part, if that is above a given one, by bisection."""
        high = 2 * low
        while high < MAX_GROWTH * self._scale and self._right_of(high) > 0:
            low, high = high, 2 * high
        while high - low > 1e-3 * high:
            middle = (low + high) / 2
            low, high = (middle, high) if self._right_of(middle) > 0 else (low, middle)
        found = self._roots((low + high) / 2)
        near = found[np.abs(found.real - (low + high) / 2) < (high - low) + 1e-3 * high]
        return complex(near[0]) if near.size else complex((low + high) / 2, math.nan)

    def _roots(self, real: float) -> Complex:
        """Roots that Newton's method finds from where the function is small on a line."""
        path = self._path
        starts = real + 1j * path[1:]
        size = np.log(np.abs(self._characteristic(starts)[0]))
        low = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
        # The deepest minima first.
        around = np.convolve(size, np.ones(15) / 15, "same")
        low = low[np.argsort(size[low] - around[low])][:MAX_CANDIDATES]
        own = math.sqrt(self.config.contacts.stiffness / self._mass)
        root = np.concatenate([starts[low], 1j * np.geomspace(0.1 * self._scale, own, 8)])
        change = np.full(root.shape, np.inf)
        step = 1e-6 * (np.abs(root) + self._scale)
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                here = self._characteristic(root)[0]
                move = here * step / (self._characteristic(root + step)[0] - here)
                # Steps are bounded.
                max_step = 0.3 * (np.abs(root) + self._scale)
                move *= np.minimum(1, max_step / np.maximum(np.abs(move), 1e-300))
                root = root - move
                change = np.abs(move) / np.abs(root)
                if not np.any(change > ROOT_TOLERANCE):
                    break
        root = root[change < 1e-6]
        root = np.where(np.abs(root.imag) < REAL * np.abs(root), root.real + 0j, root)
        return np.where(root.imag < 0, root.conj(), root)

    @property
    def _mass(self) -> float:
        """Inertia of the slider at high frequencies [kg]."""
        high = 1e3 * self._scale
        slider = dynamic_stiffness(self.config.slider, np.array([high + 0j]))
        assert slider is not None
        return float((slider.numerator / slider.denominator).real[0]) / high**2

    @property
    def growth_rate(self) -> float:
        """Real part of the leading root [1/s]; negative if perturbations decay."""
        return math.nan if self.leading_root is None else self.leading_root.real

    @property
    def frequency(self) -> float:
        """Imaginary part of the leading root, the angular frequency of its perturbation [1/s]."""
        return math.nan if self.leading_root is None else self.leading_root.imag

    @property
    def work(self) -> int:
        """Work of finding the roots, points of the path times the degree of the slider.

        Ten thousand take about a tenth of a second.
        """
        if not self._has_motion or self.delay == 0:
            return 0
        slider = dynamic_stiffness(self.config.slider, np.array([1j * self._scale]))
        assert slider is not None
        return len(self._path) * slider.degree

    @property
    def summary(self) -> str | None:
        """What linear theory states, and what it leaves open; None for a slider without inertia."""
        if not self._has_motion:
            return None
        where = f"steady sliding at {with_unit(self.velocity, 'm/s', 3)}"
        if self.delay == 0:
            return (
                f"{where} is linearly stable, as there is no delay: the force of steady contacts "
                f"does not depend on the motion of the slider. {OTHER_MOTION}"
            )
        if self.is_stable:
            decay = with_unit(-self.growth_rate, "1/s", 3)
            return (
                f"{where} is linearly stable, with delay: small perturbations decay at {decay}. "
                f"{OTHER_MOTION}"
            )
        other = "but not" if self.is_stable_out_of_step else "also"
        growth = with_unit(self.growth_rate, "1/s", 3)
        return (
            f"{where} is linearly unstable, with delay: {self._perturbation} grows at {growth}, "
            f"{other} for contacts out of step (thresholds of {percent(OUT_OF_STEP)}). "
            f"{NO_AMPLITUDE}"
        )

    @property
    def _perturbation(self) -> str:
        if not self.frequency > 0:
            return "a perturbation"
        return f"an oscillation of {with_unit(self.frequency / (2 * math.pi), 'Hz', 3)}"


@lru_cache(maxsize=16)
def steady_sliding(config: Config, max_work: int) -> SteadySliding | None:
    """Steady sliding of a configuration; None without a theory, or if it takes more work.

    The latest results are cached, as several functions ask for the same configuration.
    """
    if config.interaction is not None and config.interaction.strength > 0:
        return None
    try:
        sliding = SteadySliding(config)
    except ConfigError:
        return None
    if sliding.work > max_work:
        return None
    try:
        # The summary needs both, and caches them. Extreme parameters may overflow.
        with np.errstate(all="ignore"):
            if sliding.leading_root is not None and not sliding.is_stable:
                _ = sliding.is_stable_out_of_step
    except RunError:
        return None
    return sliding


class Parts(NamedTuple):
    """Λ = fed/births + free, for each rate; ``life`` is |ψ e^(-λ τ_d)|."""

    fed: Complex
    births: Complex
    free: Complex
    life: Array


def _spaced(low: float, high: float, step: float) -> Array:
    """Points between two limits, at most a step apart unless there would be too many."""
    if high <= low:
        return np.empty(0)
    return np.linspace(low, high, min(math.ceil((high - low) / step) + 1, MAX_POINTS // 4))


@cache
def _quadrature() -> tuple[Array, Array]:
    """Points between -1 and 1, and weighted Legendre polynomials there, shape (points, orders)."""
    point, weight = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    return point, weight[:, None] * np.polynomial.legendre.legvander(point, POINTS - 1)


def _legendre_transforms(z: Complex, side: Array) -> Complex:
    """∫ P_n(x) e^(-z (x + side)) dx over [-1, 1], shape (arguments, orders).

    The side is the sign of the real part of z, so that no exponential is large.
    """
    result = np.empty((len(z), POINTS), dtype=np.complex128)
    is_large = np.abs(z) > LARGE
    point, legendre = _quadrature()
    near = z[~is_large, None] * (point + side[~is_large, None])
    result[~is_large] = np.exp(-near) @ legendre
    # From e^(-z x) by parts: I_(n+1) = I_(n-1) - (2n + 1)/z I_n but for the sign (-1)^n.
    far, side = z[is_large], side[is_large]
    ends = np.exp(far * (1 - side)), np.exp(-far * (1 + side))
    orders = [(ends[0] - ends[1]) / far, (ends[0] + ends[1] - (ends[0] - ends[1]) / far) / far]
    for n in range(1, POINTS - 1):
        orders.append(orders[n - 1] - (2 * n + 1) / far * orders[n])
    result[is_large] = np.stack(orders, axis=-1) * (-1.0) ** np.arange(POINTS)
    return result


def stability_boundary(
    config: Config,
    key: str,
    low: float,
    high: float,
    tolerance: float = 1e-3,
    *,
    out_of_step: bool = False,
) -> float | None:
    """Value of a key at which steady sliding becomes stable or unstable, between two others.

    Parameters
    ----------
    config
        The configuration.
    key
        A key such as "contacts.delay" or "slider.stiffness"; or "drive.velocity".
    low, high
        Positive values, in SI, between which to search, on a logarithmic scale.
    tolerance
        Relative.
    out_of_step
        Whether stability is that of contacts that break out of step, as after slips
        (`SteadySliding.is_stable_out_of_step`): that boundary is nearer to the results of runs.

    Returns
    -------
    float or None
        One of the values at which it changes; None if sliding is stable at both ends, or unstable.
    """

    def is_stable(logarithm: float) -> bool:
        return _is_stable(config, key, math.exp(logarithm), out_of_step=out_of_step)

    from scipy import optimize

    first, last = math.log(low), math.log(high)
    begins = is_stable(first)
    if begins == is_stable(last):
        return None
    found: float = optimize.bisect(
        lambda logarithm: 1.0 if is_stable(logarithm) == begins else -1.0,
        first,
        last,
        xtol=tolerance,
    )
    return math.exp(found)


def _is_stable(config: Config, key: str, value: float, *, out_of_step: bool) -> bool:
    sliding = SteadySliding(config.replace({key: value}))
    return sliding.is_stable_out_of_step if out_of_step else sliding.is_stable


def stable_stiffness(config: Config, *, out_of_step: bool = False) -> float | None:
    """Stiffness of the spring above which steady sliding at the drive's velocity is stable [N/m].

    All other parameters are those of the configuration, the mass of the slider for example. It is
    sought from `MAX_STIFFNESS` down to `MIN_STIFFNESS` times the stiffness of the contacts, with a
    relative tolerance of a thousandth.

    Parameters
    ----------
    config
        The configuration, of a slider on a spring.
    out_of_step
        As in `stability_boundary`.

    Returns
    -------
    float or None
        None if sliding is stable with all of these springs, or unstable with the stiffest one.
    """
    key, max_stiffness = "slider.stiffness", MAX_STIFFNESS * config.contacts.stiffness
    stiffness = max_stiffness
    while stiffness > MIN_STIFFNESS * config.contacts.stiffness:
        if not _is_stable(config, key, stiffness, out_of_step=out_of_step):
            if stiffness == max_stiffness:
                return None
            return stability_boundary(
                config, key, stiffness, 2 * stiffness, out_of_step=out_of_step
            )
        stiffness /= 2
    return None


class StiffnessLimits(NamedTuple):
    """Stiffnesses of the spring above which steady sliding is linearly stable.

    Attributes
    ----------
    velocity
        Velocity of sliding [m/s], that of the drive.
    in_step
        With delay [N/m].
    out_of_step
        The same for contacts that break out of step [N/m]; None if that is no smaller.
    """

    velocity: float
    in_step: float
    out_of_step: float | None


def stiffness_limits(config: Config, max_work: int) -> StiffnessLimits | None:
    """Stiffnesses above which steady sliding is stable; None if they take more than some ten times
    the work for one stiffness, or there are none."""
    sliding = steady_sliding(config, max_work // 10)
    if sliding is None or sliding.delay == 0 or not 0 < config.spring_stiffness < math.inf:
        return None
    try:
        stable = stable_stiffness(config)
        out_of_step = stable_stiffness(config, out_of_step=True)
    except RunError:
        return None
    if stable is None:
        return None
    if out_of_step is not None and out_of_step >= stable:
        out_of_step = None
    return StiffnessLimits(sliding.velocity, stable, out_of_step)
