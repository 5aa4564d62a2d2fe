"""Steady fronts of detachment along a long row of blocks (section 16 of the model).

Ahead of a front every block bears the part τ of its static force; behind it contacts bear nothing
but their drag. Lengths, times and forces are in units of the spacing of blocks, of (m_b/k_b)^(1/2),
and of the static force of a block. In a steady front block j moves as u(t - jT), and breaks at
t = jT. The one-sided Fourier transforms u₊ of detached and u₋ of pinned blocks, in e^{pt}, obey

    L(p) u₊ + P(p) u₋ = τ/p + α u(0),
    L = p² [1 + η/(p + η)] + κ_t + α p + (1 + γ p)(2 - 2 cosh pT),   P = L - α p + κ,

with the drag α, the stiffness κ of contacts, damping γ of neighbours and η of the setup, and
springs κ_t from above. A = (κ - α p) u₊ + τ/p + α u(0), and B, the same of the pinned blocks, obey
(L/P) A = -B. Factors of L/P = M₊ M₋ that are analytic to the right and to the left (Wiener and
Hopf) give A = τ/[p M₊(p) M₋(0)]; A(κ/α) = α/κ, as κ u(0) + τ = 1 when a block breaks. So

    τ = M₋(0) M₊(κ/α).

Without drag and damping it is τ = ω (1 - T²)^(1/2)/κ^(1/2), where ω² = κ + 4 sin²(ωT/2); and for
stiff contacts the speed is 1/T = (1 - τ²)^(-1/2), that of Amundsen et al. (2015). Without drag no
front is steady below the velocity of sound.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip.array_types import Array
from mesoslip.errors import ConfigError
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.sliders import row_scales

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Times of a front over a block, in units of that of sound, between which speeds are sought, and
# their number in a decade.
MIN_TIME, MAX_TIME, TIMES_PER_DECADE = 1e-2, 1e4, 8
# Parts of the lowest and multiples of the highest frequency up to which integrals go; panels in a
# decade of frequency and in an oscillation of the coupling of neighbours; points in a panel.
LOW, HIGH = 1e-9, 1e9
PANELS_PER_DECADE, PANELS_PER_OSCILLATION, POINTS = 6, 6, 8
# Frequency up to which oscillations are resolved: beyond, they are small against inertia.
RESOLVED = 40.0
# Halvings of panels beside a resonance.
HALVINGS = 32


class SteadyFront:
    """Steady fronts of detachment along a row of blocks that is long in both directions.

    Contacts break at one force, and do not attach behind the front. The attribute
    ``sound_velocity`` is c [m/s].

    Parameters
    ----------
    config
        A configuration with ``slider.kind = "interface"``; the number of blocks gives their spacing
        only, and the spring at the edge has no effect.

    Raises
    ------
    ConfigError
        With another slider, a single block, a profile of the load, contacts that attach again
        (``contacts.reattach``), age, break by thermal activation, keep their thresholds, or lie on
        a track.

    Notes
    -----
    Exact for the chain of blocks, by the method of Wiener and Hopf. Without drag and damping, for
    stiff contacts, the speed is c (1 - τ²)^(-1/2) with the stress over the strength τ: Amundsen et
    al., Physical Review E 92, 032406 (2015).

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("front-types")  # writes front-types.toml
    >>> front = mesoslip.SteadyFront(mesoslip.Config.load(path))
    >>> round(front.prestress, 3), round(float(front.speed(0.5)) / front.sound_velocity, 3)
    (0.502, 1.116)
    """

    def __init__(self, config: Config) -> None:
        scales = row_scales(config.slider, config)
        if scales is None:
            message = 'fronts run along the blocks of slider.kind = "interface", two or more'
            raise ConfigError.of("slider.kind", message, config.slider.kind)
        if not config.pressing.is_uniform:
            message = "a steady front needs the same strength of all blocks: leave it out"
            raise ConfigError.of("load.profile", message)
        contact_theory(config).check_steady_front()
        self.sound_velocity = scales.sound_velocity
        self._contacts, self._top, self._edge = scales.contacts, scales.top, scales.edge
        self._drag, self._viscosity, self._damping = scales.drag, scales.viscosity, scales.damping

    @property
    def prestress(self) -> float:
        """Stress over strength of the blocks far from the edge as the first one breaks, if the
        drive loads the row slowly and from rest.

        The springs from above move a block far from the edge by y D, D being the displacement of
        the drive, and the spring at the edge moves the first one by z D more; that decays by the
        factor λ from a block to the next, λ + 1/λ = 2 + κ + κ_t.
        """
        pinned = self._contacts + self._top
        decay = 1 / (1 + 0.5 * pinned + math.sqrt(pinned + 0.25 * pinned**2))
        far = self._top / pinned
        near = self._edge * (1 - far) / (pinned + self._edge + 1 - decay)
        return far / (far + near)

    def stress_ratio(self, speed: ArrayLike) -> Array:
        """Stress over strength ahead of a front.

        Parameters
        ----------
        speed
            Speeds of fronts [m/s], positive.

        Returns
        -------
        ndarray
            Stresses on the contacts far ahead over their strength, of the shape of ``speed``; NaN
            where no front is steady, and below c/10 000, beyond which nothing is computed.
        """
        with np.errstate(divide="ignore"):
            times = self.sound_velocity / np.asarray(speed, dtype=float)
        with np.errstate(invalid="ignore"):
            found: Array = np.vectorize(self._stress_of, otypes=[float])(times)
        return found

    def speed(self, stress_ratio: ArrayLike) -> Array:
        """Speed of a front, the highest if there are several.

        Parameters
        ----------
        stress_ratio
            Stresses on the contacts far ahead over their strength, between 0 and 1.

        Returns
        -------
        ndarray
            Speeds [m/s], of the shape of ``stress_ratio``; NaN where no front is steady, or none
            between c/10 000 and 100 c, where they are sought.
        """
        ratios = np.asarray(stress_ratio, dtype=float)
        count = round(TIMES_PER_DECADE * math.log10(MAX_TIME / MIN_TIME)) + 1
        times = np.geomspace(MIN_TIME, MAX_TIME, count)
        stresses: list[float] = []
        lowest = np.nanmin(ratios, initial=np.inf)
        for time in times:
            stresses.append(self._stress_of(time))
            if not stresses[-1] > lowest:
                break
        known = np.array(stresses)

        def speed_at(ratio: float) -> float:
            from scipy.optimize import brentq

            below = np.flatnonzero(~(known > ratio))
            if not below.size or below[0] == 0 or not 0 < ratio < 1:
                return math.nan
            low, high = times[below[0] - 1], times[below[0]]
            if math.isnan(known[below[0]]):
                high = self._end_of_steady(low, high)
                if not self._stress_of(high) <= ratio:
                    return math.nan
            root = brentq(lambda time: self._stress_of(time) - ratio, low, high, rtol=1e-10)
            return float(self.sound_velocity / root)

        found: Array = np.vectorize(speed_at, otypes=[float])(ratios)
        return found

    def _end_of_steady(self, low: float, high: float) -> float:
        """The longest time at which there is a steady front, between one of one and one without."""
        while high - low > 1e-15 * high:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            low, high = (low, middle) if math.isnan(self._stress_of(middle)) else (middle, high)
        return low

    def _stress_of(self, time: float) -> float:
        """τ of a front that passes a block in a time, in units of that of sound."""
        if not 0 < time <= MAX_TIME:
            return math.nan
        order, start = self._start(time)
        if not start > 0:
            return math.nan
        target = self._contacts / self._drag if self._drag > 0 else math.inf
        total = 0.5 * math.log(start)
        frequency, weight = self._rule(time)
        free, pinned = self._kernels(frequency, time)
        # Without zeros at p = 0, which belong to M₊ as (p/(p + 1))^order.
        values = np.angle(free) - np.angle(pinned) + order * (np.arctan(frequency) - 0.5 * math.pi)
        if not math.isinf(target):
            ratio = np.log(np.abs(free)) - np.log(np.abs(pinned))
            ratio += order * np.log(np.hypot(1.0, frequency) / frequency)
            values = (values + frequency / target * ratio) / (1 + (frequency / target) ** 2)
        total += float(np.sum(weight * values)) / math.pi
        if not math.isinf(target):
            total += order * math.log(target / (target + 1))
        return math.exp(total)

    def _start(self, time: float) -> tuple[int, float]:
        """Order of the zero of L/P at p = 0, and its leading coefficient."""
        pinned = self._contacts + self._top
        if self._top > 0:
            return 0, self._top / pinned
        if self._drag > 0:
            return 1, self._drag / pinned
        inertia = 2.0 if self._damping > 0 else 1.0
        return 2, (inertia - time**2) / pinned

    def _kernels(self, frequency: Array, time: float) -> tuple[NDArray[np.complex128], ...]:
        """L and P at p = iω. Their imaginary parts are not negative: so waves without damping are
        those that it leaves behind as it vanishes."""
        setup = self._damping / (1j * frequency + self._damping) if self._damping > 0 else 0.0
        common = self._top - frequency**2 * (1 + setup)
        common = common + (1 + 1j * self._viscosity * frequency) * (
            4 * np.sin(0.5 * frequency * time) ** 2
        )
        return common + 1j * self._drag * frequency, common + self._contacts

    def _rule(self, time: float) -> tuple[Array, Array]:
        """Frequencies and weights of integrals over their logarithm."""
        scales = [1.0, 1 / time, math.sqrt(4 + self._contacts + self._top)]
        rates = [self._drag, self._damping, math.sqrt(self._top)]
        if self._drag > 0:
            rates += [self._contacts / self._drag, self._top / self._drag]
        scales += [one for one in rates if one > 0]
        low, high = LOW * min(scales), HIGH * max(scales)
        panels = math.ceil(PANELS_PER_DECADE * math.log10(high / low))
        edges = np.geomspace(low, high, panels + 1)
        step = 2 * math.pi / time / PANELS_PER_OSCILLATION
        edges = np.union1d(edges, np.arange(step, RESOLVED, step))
        edges = np.union1d(edges, self._beside_resonances(edges, time))
        edges = edges[np.diff(edges, prepend=0.0) > 1e-13 * edges]
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        lower, half = edges[:-1, None], 0.5 * np.diff(edges)[:, None]
        frequency = lower + half * (1 + nodes)
        return frequency, half * weights / frequency

    def _beside_resonances(self, edges: Array, time: float) -> Array:
        """Edges of panels that become shorter towards frequencies at which L or P is small."""
        found = [np.empty(0)]
        for which in (0, 1):

            def value(frequency: Array, which: int = which) -> NDArray[np.complex128]:
                return self._kernels(frequency, time)[which]

            signs = np.signbit(value(edges).real)
            places = np.flatnonzero(signs[1:] != signs[:-1])
            low, high = edges[places], edges[places + 1]
            width = high - low
            for _ in range(HALVINGS + 8):
                middle = 0.5 * (low + high)
                is_left = np.signbit(value(middle).real) == signs[places]
                low, high = np.where(is_left, middle, low), np.where(is_left, high, middle)
            for halving in range(1, HALVINGS):
                part = width * 0.5**halving
                # By damping it is as wide as the change of L that equals its imaginary part.
                slope = np.abs(value(low + 1e-6 * width).real - value(low - 1e-6 * width).real)
                is_narrow = part * slope > 1e-7 * width * np.abs(value(low).imag)
                near, part = low[is_narrow], part[is_narrow]
                found += [near - part, near + part]
            found.append(low)
        return np.concatenate(found)
