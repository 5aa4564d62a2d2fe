"""Linear stability of steady sliding: roots of Z(λ) + Λ(λ), of any contacts.

A slider of dynamic stiffness Z(λ) on contacts of the response Λ(λ) has the characteristic equation
Z(λ) + Λ(λ) = 0, whose roots in the right half-plane are counted by the argument principle. The
derivation is in ``docs/steady-sliding.md``.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mesoslip.array_types import Array, Complex
from mesoslip.configuration import arguments
from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.quantities import percent, with_unit
from mesoslip.theory.contacts.steady import newborn_problems, steady_problems
from mesoslip.theory.critical_spring import NO_GROWTH, critical_spring, has_critical_spring
from mesoslip.theory.delays import delay_law
from mesoslip.theory.frequency_paths import MAX_POINTS, Parts, Turns, counting_path, search_path
from mesoslip.theory.sliders import dynamic_stiffness, stability_problems

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Maximum change of the argument between two points of the path along which roots are counted, and
# maximum number of halvings of an interval.
MAX_TURN = 0.8
MAX_HALVINGS = 40
# Maximum growth rate over the frequency of the slider.
MAX_GROWTH = 1e6
# Steps of Newton's method, and relative change at which a root is found.
STEPS, ROOT_TOLERANCE = 25, 1e-10
# Imaginary part over the absolute value below which a root is real.
REAL = 1e-9
# Maximum number of starts of Newton's method on the path.
MAX_CANDIDATES = 40
# Maximum number of layers whose frequencies the points of the path resolve.
MAX_LAYERS = 16

# Relative width of thresholds with which contacts are dephased.
DEPHASED_WIDTH = 0.5
# Statements that linear theory leaves open, for a stable and an unstable motion.
OTHER_MOTION = "A large oscillation may be possible too"
NO_AMPLITUDE = "Linear theory gives no amplitude"


class LinearStability(abc.ABC):
    """Steady sliding of a configuration at a velocity [m/s], by default that of the drive, and the
    growth of small perturbations of it."""

    def __init__(self, config: Config, velocity: float | None = None) -> None:
        contacts = config.contacts
        problems = [*self._problems(config), *steady_problems(config)]
        problems += stability_problems(config.slider)
        if not config.pressing.is_uniform:
            message = "has no theory of stability: blocks under unlike loads do not move together"
            problems.append(Problem("", "load.profile", message))
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
        self.delay = 0.0 if config.slider.ignores_delay else contacts.delay
        self._delays = delay_law(config)
        # Displacement in units of the breaking stretch, for a second.
        self._rate = self.velocity / contacts.break_stretch
        self._drag = contacts.count * contacts.contact_drag if self.delay > 0 else 0.0

    @classmethod
    def _problems(cls, config: Config) -> Iterator[Problem]:
        """Further parts of a configuration that the theory does not have."""
        return newborn_problems(config)

    @property
    @abc.abstractmethod
    def force(self) -> float:
        """Steady force F(v) [N]."""

    @property
    @abc.abstractmethod
    def slope(self) -> float:
        """dF/dv [N s/m]: below zero sliding is weaker the faster it is."""

    @cached_property
    def dephased(self) -> LinearStability:
        """Sliding of contacts whose lives differ by half a breaking stretch; itself if they do.

        A large oscillation itself spreads lives by as much. That an instability which needs
        contacts in phase stays small is a heuristic, with exceptions (``docs/steady-sliding.md``).
        """
        wide = self._with_wide_thresholds()
        return self if wide is None else type(self)(wide, self.velocity)

    @property
    def is_stable_dephased(self) -> bool:
        """Whether no perturbation grows for dephased contacts; see `dephased`."""
        return self.dephased.is_stable

    def _with_wide_thresholds(self) -> Config | None:
        """The configuration with thresholds of dephased contacts; None if they have them."""
        contacts = self.config.contacts
        threshold = contacts.threshold
        if threshold.relative_width >= DEPHASED_WIDTH or threshold.kind.is_sampled:
            return None
        widths = contacts.relative_widths.items()
        try:
            return self.config.replace({key: max(width, DEPHASED_WIDTH) for key, width in widths})
        except ConfigError:
            return None

    @property
    @abc.abstractmethod
    def _ingredients(self) -> str:
        """Parts of the theory that the force curve does not have, in words."""

    @abc.abstractmethod
    def _parts(self, rate: Complex) -> Parts:
        """Λ at rates [1/s], in parts."""

    @cached_property
    def _path(self) -> Array:
        """Frequencies along which the argument of the characteristic function is computed."""
        return counting_path(self.config.slider, self._parts, self._scale, self._turns)

    @property
    @abc.abstractmethod
    def is_passive(self) -> bool:
        """Whether the force of steady contacts does not depend on the motion of the slider."""

    @arguments.checked(frequency=arguments.frequencies)
    def response(self, frequency: ArrayLike) -> Complex:
        """Λ(iω): contact force over displacement, of a slider moved at frequencies ω [N/m].

        Its real part is the stiffness of the contacts, its imaginary part over ω their damping;
        where that is negative, contacts feed an oscillation.
        """
        return self.response_at(1j * np.asarray(frequency, dtype=float))

    @arguments.checked(rate=arguments.rates)
    def response_at(self, rate: ArrayLike) -> Complex:
        """Λ(λ) for complex rates λ other than 0 [N/m]."""
        values = np.asarray(rate, dtype=np.complex128)
        parts = self._parts(values.ravel())
        return ((parts.fed + parts.free * parts.births) / parts.births).reshape(values.shape)

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

    def _right_of(self, real: float) -> int:
        """Number of roots with a real part above a positive one, by the argument principle.

        Z + Λ has no poles there. It grows as a power of λ, whose degree gives the change of its
        argument around the half-plane; the change along the line itself is computed.
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

    @cached_property
    def unstable_count(self) -> int:
        """Number of roots that grow, each of a pair counted; a RunError on overflow."""
        if not self._has_motion or self.is_passive:
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
        searched = np.arange(len(root))
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                near = root[searched]
                here, beside = np.split(
                    self._characteristic(np.concatenate([near, near + step[searched]]))[0], 2
                )
                move = here * step[searched] / (beside - here)
                # Steps are bounded.
                max_step = 0.3 * (np.abs(near) + self._scale)
                move *= np.minimum(1, max_step / np.maximum(np.abs(move), 1e-300))
                root[searched] = near - move
                change[searched] = np.abs(move) / np.abs(root[searched])
                searched = searched[change[searched] > ROOT_TOLERANCE]
                if searched.size == 0:
                    break
        root = root[change < 1e-6]
        root = np.where(np.abs(root.imag) < REAL * np.abs(root), root.real + 0j, root)
        return np.where(root.imag < 0, root.conj(), root)

    @cached_property
    def critical_stiffness(self) -> tuple[float, float] | None:
        """Stiffness of the spring above which steady sliding is linearly stable [N/m], and the
        angular frequency of the oscillation there [1/s].

        None if it is stable with any spring, or none is known, as for layers on a base or with a
        delay of the contacts, or where a delay feeds a slider without damping too fast.

        Of a layered slider it is the static stiffness, with which all its springs go. The damping
        is that of the configuration, which grows with the spring where it is a ratio.
        """
        if self.is_passive or not self.has_critical_stiffness:
            return None
        path = self._search_path
        assert path is not None
        return critical_spring(self.config.slider, self.response, path)

    @cached_property
    def _search_path(self) -> Array | None:
        """Frequencies between which critical ones of any spring are sought; None if contacts feed
        stiff springs too fast."""
        path = self._path[1:]
        if self.delay == 0:
            return path
        return search_path(self.config.slider, self._parts, self._scale, self._turns, path)

    @property
    @abc.abstractmethod
    def _turns(self) -> Turns:
        """The times with which the response turns."""

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
        """Work of finding the roots, points of the path times the degree of the slider; 10 000 take
        about 0.1 s."""
        if not self._has_motion or self.is_passive:
            return 0
        slider = dynamic_stiffness(self.config.slider, np.array([1j * self._scale]))
        assert slider is not None
        return len(self._path) * slider.degree

    @property
    def summary(self) -> str | None:
        """The statement of linear theory and its limits; None for a slider without inertia."""
        if not self._has_motion:
            return None
        other = f"{OTHER_MOTION}: {shown_by(self.config)}"
        where = f"steady sliding at {with_unit(self.velocity, 'm/s', 3)}"
        if self.is_passive:
            return (
                f"{where} is linearly stable, as there is no delay: the force of steady contacts "
                f"does not depend on the motion of the slider. {other}"
            )
        if self.is_stable:
            decay = with_unit(-self.growth_rate, "1/s", 3)
            return (
                f"{where} is linearly stable, with {self._ingredients}: small perturbations decay "
                f"at {decay}. {other}"
            )
        growth = with_unit(self.growth_rate, "1/s", 3)
        dephased = ""
        if self.dephased is not self:
            also = "but not" if self.is_stable_dephased else "also"
            dephased = f", {also} for dephased contacts (thresholds of {percent(DEPHASED_WIDTH)})"
        return (
            f"{where} is linearly unstable, with {self._ingredients}: {self._perturbation} grows "
            f"at {growth}{dephased}. {NO_AMPLITUDE}: {shown_by(self.config)}"
        )

    @property
    def has_critical_stiffness(self) -> bool:
        """Whether the slider has a spring of which the critical one is known."""
        known = has_critical_spring(self.config.slider, self.delay)
        return known and (self.is_passive or self._search_path is not None)

    @property
    def limit(self) -> str | None:
        """The stiffness above which sliding is stable, in words; None without such a limit."""
        if self.is_passive or not self.has_critical_stiffness:
            return None
        change = "strengthens" if self.slope > 0 else "weakens"
        found = self.critical_stiffness
        if found is None:
            return f"it {change} with velocity, and is linearly stable with any spring"
        stiffness, frequency = found
        return (
            f"it {change} with velocity, and is linearly stable with springs stiffer than "
            f"{with_unit(stiffness, 'N/m', 3)}, with which it oscillates at "
            f"{with_unit(frequency / (2 * math.pi), 'Hz', 3)}"
        )

    @property
    def _perturbation(self) -> str:
        if not self.frequency > 0:
            return "a perturbation"
        return f"an oscillation of {with_unit(self.frequency / (2 * math.pi), 'Hz', 3)}"


def shown_by(config: Config) -> str:
    """The command that shows the motion of a configuration: `mesoslip cycle` has no layers, no
    changes of the drive, no contacts that do not attach again or are in one engine only."""
    part = config.drive_parts[-1]
    is_constant = len(config.drive_parts) == 1 and part.start_velocity == part.end_velocity != 0
    has_cycle = config.slider.oscillator is not None and is_constant
    if has_cycle and config.contacts.reattach and config.has_master_equation:
        return "only a run or mesoslip cycle shows it"
    return "only a run shows it"
