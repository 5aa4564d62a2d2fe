"""The density of thresholds that are known by samples, for what depends on a density.

K* is nearly the maximum of the density of ln x_s, X P_c(X): in the logarithm it is estimated with
Gaussian kernels of one bandwidth, which is chosen from the samples (Z. I. Botev, J. F. Grotowski
and D. P. Kroese, Ann. Statist. 38 (2010) 2916).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, optimize, special

from mesoslip.array_types import Array
from mesoslip.configuration.kernel_parameters import Parameters

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Cells of the smoothed law, bins of the samples for each, and bandwidths beyond the samples.
CELLS, BINS, BEYOND = 3000, 8, 5
# Probability of a cell that counts as none.
EMPTY = 1e-14
# Bins for the choice of the bandwidth, stages of the plug-in rule, and the range of the result.
MODES, STAGES, MAX_BANDWIDTH = 2**12, 7, 0.3
# Ratio of the bandwidths of two estimates whose biases, of second order, are extrapolated from, and
# the roughness of the kernel of the extrapolated one.
WIDER = math.sqrt(2)
ROUGHNESS = (4 - 4 * math.sqrt(2 / 3) + 1 / math.sqrt(2)) / (2 * math.sqrt(math.pi))
# Standard deviations of the error that is stated.
COVERAGE = 2.0


@dataclass(frozen=True)
class SampledLaw:
    """Break stretches over f_s/k, stiffnesses over k, and shares of samples, and the bandwidth of
    the density of ln x_s."""

    stretch: Array
    stiffness: Array
    weight: Array
    bandwidth: float
    """Standard deviation of the kernel, in ln x_s."""
    power: float
    """Power of the kernel's cells in the break stretch."""
    has_stiffnesses: bool
    """Whether the cells of the kernel have stiffnesses of their own."""

    @property
    def size(self) -> float:
        """Effective number of samples, 1/Σ w²."""
        return 1 / float(np.sum(self.weight**2))

    def parameters(self, widening: float = 1.0) -> Parameters:
        """Cells of the smoothed law in the kernel; the bandwidth may be widened by a factor."""
        bandwidth, place = widening * self.bandwidth, np.log(self.stretch)
        low, high = place.min() - BEYOND * bandwidth, place.max() + BEYOND * bandwidth
        edges = np.linspace(low, high, CELLS + 1)
        share = _smoothed(place, self.weight, edges, bandwidth)
        load = _smoothed(place, self.weight * self.stiffness, edges, bandwidth)
        used = np.flatnonzero(share > EMPTY)
        some = slice(used[0], used[-1] + 1)
        share = np.maximum(share[some], EMPTY)
        stiffness = load[some] / share
        share = share / np.sum(share)
        edge = np.exp(self.power * edges[used[0] : used[-1] + 2])
        middle = (edge[1:] + edge[:-1]) / 2
        stiffness = stiffness / np.sum(share * stiffness)
        mean = np.sum(share * middle * (stiffness if self.has_stiffnesses else 1.0))
        cells = {"threshold_edges": edge / mean, "threshold_weights": share}
        if self.has_stiffnesses:
            cells["threshold_stiffnesses"] = stiffness
        return {name: tuple(values.tolist()) for name, values in cells.items()}

    def slope_error(self, stretch: Array) -> Array:
        """Error of the extrapolated -F' over N k at displacements over f_s/k, by sampling."""
        distance = (np.log(self.stretch) - np.log(stretch)[:, None]) / self.bandwidth
        near = self.weight * np.exp(-(distance**2) / 2) / math.sqrt(2 * math.pi) / self.bandwidth
        density = np.sum(near, axis=1)
        # A break at X releases k X: the slope is the mean stiffness times the density of ln x_s.
        stiffness = near @ self.stiffness / np.maximum(density, EMPTY)
        variance = density * ROUGHNESS / (self.size * self.bandwidth)
        return np.asarray(COVERAGE * stiffness * np.sqrt(variance))

    @property
    def force_error(self) -> float:
        """Maximum error of the force of the first generation over F_s, by sampling."""
        order = np.argsort(self.stretch)
        stretch, stiffness, weight = (
            one[order] for one in (self.stretch, self.stiffness, self.weight)
        )
        above = np.cumsum((weight * stiffness)[::-1])[::-1]
        square = np.cumsum((weight * stiffness**2)[::-1])[::-1]
        variance = np.maximum(square - above**2, 0.0) * stretch**2
        return COVERAGE * math.sqrt(float(np.max(variance)) / self.size)


def sampled_law(config: Config) -> SampledLaw | None:
    """The samples of the thresholds of a configuration; None for a law with a formula."""
    contacts = config.contacts
    threshold = contacts.threshold
    if threshold.samples is None:
        return None
    value = np.array(threshold.samples)
    weight = np.ones(len(value)) if threshold.weights is None else np.array(threshold.weights)
    weight = weight / np.sum(weight)
    value = value / np.sum(weight * value)
    has_stiffnesses = contacts.coupling == "table"
    if has_stiffnesses:
        stiffness = np.array(threshold.stiffnesses)
        stiffness = stiffness / np.sum(weight * stiffness)
    else:
        stiffness = np.sqrt(value) if contacts.coupling == "scaled" else np.ones_like(value)
    stretch, stiffness, weight = (one[weight > 0] for one in (value / stiffness, stiffness, weight))
    bandwidth = _bandwidth(tuple(np.log(stretch).tolist()), tuple(weight.tolist()))
    power = 2.0 if contacts.coupling == "scaled" else 1.0
    return SampledLaw(stretch, stiffness, weight, bandwidth, power, has_stiffnesses)


def _smoothed(place: Array, weight: Array, edges: Array, bandwidth: float) -> Array:
    """Sums of weights in cells after each sample is spread normally, shape (cells,)."""
    total, bins = np.histogram(
        place, bins=BINS * (len(edges) - 1), range=(edges[0], edges[-1]), weights=weight
    )
    used = total > 0
    middle, total = ((bins[1:] + bins[:-1]) / 2)[used], total[used]
    below = np.zeros_like(edges)
    # In parts that fit into the cache.
    for first in range(0, len(middle), 500):
        some = slice(first, first + 500)
        below += special.ndtr((edges[:, None] - middle[some]) / bandwidth) @ total[some]
    return np.diff(below)


@lru_cache(maxsize=8)
def _bandwidth(place: tuple[float, ...], weight: tuple[float, ...]) -> float:
    """Bandwidth of the least mean square error by Botev's plug-in rule, in the unit of places."""
    x, w = np.array(place), np.array(weight)
    size: float = 1 / float(np.sum(w**2))
    low, high = x.min(), x.max()
    margin = 0.1 * (high - low)
    low, length = low - margin, high - low + 2 * margin
    share, _ = np.histogram(x, bins=MODES, range=(low, low + length), weights=w)
    square = (fft.dct(share)[1:] / 2) ** 2
    order = np.arange(1, MODES) ** 2.0

    def functional(stage: int, time: float) -> float:
        decay = np.exp(-order * math.pi**2 * time)
        return float(2 * math.pi ** (2 * stage) * np.sum(order**stage * square * decay))

    def excess(time: float) -> float:
        value = functional(STAGES, time)
        for stage in range(STAGES - 1, 1, -1):
            odd = math.prod(range(1, 2 * stage, 2)) / math.sqrt(2 * math.pi)
            constant = 2 * odd * (1 + 0.5 ** (stage + 0.5)) / 3
            value = functional(stage, (constant / (size * value)) ** (2 / (3 + 2 * stage)))
        return float(time - (2 * size * math.sqrt(math.pi) * value) ** -0.4)

    times = np.geomspace(1e-12, MAX_BANDWIDTH**2, 60)
    values = [excess(float(one)) for one in times]
    at = next((i for i in range(59) if values[i] < 0 <= values[i + 1]), None)
    if at is None:
        # Too few samples for the rule: that of a normal law.
        spread = math.sqrt(float(np.sum(w * (x - np.sum(w * x)) ** 2)))
        return float(1.06 * spread * size**-0.2)
    found: float = optimize.brentq(excess, times[at], times[at + 1])
    return float(math.sqrt(found) * length)
