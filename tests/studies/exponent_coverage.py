"""Do the errors of fitted exponents cover, and how far off are the exponents?

Samples of laws that are known exactly are fitted as `mesoslip avalanches` fits, with the minimum
size chosen by the program, and the result is compared with the exponent of the law for large sizes.
Prints the tables of ``docs/exponents.md``::

    .venv/bin/python tests/studies/exponent_coverage.py [samples]
"""

import math
import sys
from collections.abc import Callable

import numpy as np
from mesoslip.analysis.avalanche_sizes import FORMS, Form, PowerLawFit, fit_power_law
from numpy.typing import NDArray
from scipy import optimize, special

Array = NDArray[np.float64]

SAMPLES = 200
# Not those that the way of choosing was found with.
FIRST_SEED = 100_000
COUNTS = (500, 5_000, 20_000, 50_000, 500_000)
# Half the width of 95 % intervals, in standard errors.
HALF_WIDTH = 1.96


def sliding(stiffness_ratio: float) -> Array:
    """Sizes of a quasi-static slider with memoryless thresholds at K/Nk, from 1 on.

    A branching process with a geometric number of offspring, of mean 1/(1 + K/Nk): exponent 3/2,
    and corrections in powers of 1/s.
    """
    ends = (1 + stiffness_ratio) / (2 + stiffness_ratio)
    cutoff = -1 / math.log(4 * ends * (1 - ends))
    s = np.arange(1.0, min(50 * cutoff + 100, 4e6))
    logarithm = special.gammaln(2 * s - 1) - special.gammaln(s) - special.gammaln(s + 1)
    return np.exp(logarithm + s * math.log(ends) + (s - 1) * math.log(1 - ends))


def borel(offspring: float) -> Array:
    """Sizes of a branching process with a Poisson number of offspring, from 1 on: exponent 3/2."""
    s = np.arange(1.0, 50 / (offspring - 1 - math.log(offspring)) + 100)
    return np.exp((s - 1) * np.log(offspring * s) - offspring * s - special.gammaln(s + 1))


def power_law(exponent: float, cutoff: float = math.inf, other_below: int = 1) -> Array:
    """An exact power law, and below a size another one, from 1 on."""
    s = np.arange(1.0, min(50 * cutoff, 1e6) + 1)
    weights: Array = s**-exponent * np.exp(-s / cutoff)
    below = np.arange(1.0, other_below)
    weights[: other_below - 1] = np.sum(weights[: other_below - 1]) * below / np.sum(below)
    return weights


def gaussian_cutoff(exponent: float, cutoff: float) -> Array:
    """A power law that is cut as exp(-(s/s_c)²), from 1 on."""
    s = np.arange(1.0, 8 * cutoff)
    weights: Array = s**-exponent * np.exp(-((s / cutoff) ** 2))
    return weights


def corrected(exponent: float, cutoff: float) -> Array:
    """A power law with a correction that dies slowly, s^-τ (1 + s^(-1/2)), from 1 on."""
    s = np.arange(1.0, 50 * cutoff)
    weights: Array = s**-exponent * (1 + s**-0.5) * np.exp(-s / cutoff)
    return weights


def bundle(last: int = 200_000) -> Array:
    """All bursts of an infinite bundle with thresholds uniform from 0, from 1 on.

    Hemmer and Hansen, J. Appl. Mech. 59, 909 (1992): exponent 5/2, with corrections in powers of
    s^(-1/2). The integral over the load is done at some sizes; between, the logarithm is smooth.
    """
    distance = np.geomspace(1e-9, 0.5, 20_001)
    middle, width = np.sqrt(distance[1:] * distance[:-1]), np.diff(distance)
    r = 2 * middle / (0.5 + middle)
    at = np.unique(np.rint(np.geomspace(1, last, 600)))
    logarithm = [
        (s - 1) * math.log(s)
        - s
        - special.gammaln(s + 1)
        + math.log(np.sum(r * np.exp((s - 1) * np.log1p(-r) + s * r) * width))
        for s in at
    ]
    return np.exp(np.interp(np.log(np.arange(1.0, last + 1)), np.log(at), logarithm))


LAWS: dict[str, tuple[float, Callable[[], Array]]] = {
    "sliding, K/Nk = 0.3": (1.5, lambda: sliding(0.3)),
    "sliding, K/Nk = 0.1": (1.5, lambda: sliding(0.1)),
    "sliding, K/Nk = 0.03": (1.5, lambda: sliding(0.03)),
    "sliding, K/Nk = 0.01": (1.5, lambda: sliding(0.01)),
    "Borel, mean offspring 0.9": (1.5, lambda: borel(0.9)),
    "Borel, mean offspring 0.97": (1.5, lambda: borel(0.97)),
    "power law 1.2, cutoff 1000": (1.2, lambda: power_law(1.2, 1000.0)),
    "power law 2.5, no cutoff": (2.5, lambda: power_law(2.5)),
    "power law 1.5, cutoff 300, other below 5": (1.5, lambda: power_law(1.5, 300.0, 5)),
    "power law 1.6, Gaussian cutoff 200": (1.6, lambda: gaussian_cutoff(1.6, 200.0)),
    "power law 1.5 with s^(-1/2), cutoff 5000": (1.5, lambda: corrected(1.5, 5000.0)),
    "fibre bundle, all bursts": (2.5, bundle),
}


def draw(weights: Array, count: int, seed: int) -> NDArray[np.int64]:
    """Independent sizes."""
    total = np.cumsum(weights)
    part = np.random.default_rng(seed).random(count) * total[-1]
    return np.searchsorted(total, part, side="right") + 1


def fits(
    weights: Array,
    count: int,
    samples: int,
    min_size: int | None = None,
    forms: tuple[Form, ...] = FORMS,
) -> list[PowerLawFit]:
    """Fits of independent samples."""
    found = [
        fit_power_law(draw(weights, count, FIRST_SEED + one), min_size, forms=forms, replicas=0)
        for one in range(samples)
    ]
    return [fit for fit in found if fit is not None]


def covered(found: list[PowerLawFit], exponent: float) -> float:
    """Part of the 95 % intervals that hold the exponent."""
    return float(
        np.mean([abs(one.exponent - exponent) < HALF_WIDTH * one.exponent_error for one in found])
    )


def local_exponent(weights: Array, min_size: int) -> float:
    """Exponent of the pure power law that is nearest to a law from a size on.

    That is what the likeliest pure law of ever more sizes tends to.
    """
    many = 10**12
    counts = weights[min_size - 1 :] / np.sum(weights[min_size - 1 :]) * many
    log_mean = float(np.sum(counts * np.log(np.arange(min_size, len(weights) + 1)))) / many

    def excess(exponent: float) -> float:
        h = 1e-5
        low, high = special.zeta(exponent - h, min_size), special.zeta(exponent + h, min_size)
        return float(np.log(low / high) / (2 * h)) - log_mean

    low, high = 1.01, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return low


def local_law(weights: Array, min_size: int) -> tuple[float, float]:
    """Exponent and cutoff of the law with a cutoff that is nearest to a law from a size on."""
    s = np.arange(float(min_size), len(weights) + 1)
    part = weights[min_size - 1 :] / np.sum(weights[min_size - 1 :])
    log_mean, mean = float(part @ np.log(s)), float(part @ s)

    def cost(at: Array) -> float:
        rate = math.exp(at[1])
        norm = float(special.logsumexp(-at[0] * np.log(s) - rate * s))
        return norm + at[0] * log_mean + rate * mean

    best = optimize.minimize(
        cost, [1.5, -math.log(10 * mean)], method="Nelder-Mead", options={"fatol": 1e-13}
    )
    return float(best.x[0]), math.exp(-best.x[1])


def bursts_by_sorting(fibres: int, generator: np.random.Generator) -> NDArray[np.int64]:
    """Bursts of a bundle with uniform thresholds: distances of records of its force."""
    spacing = generator.standard_exponential(fibres + 1)
    threshold = np.cumsum(spacing[:-1]) / np.sum(spacing)
    force = threshold * np.arange(fibres, 0, -1)
    return np.diff(np.flatnonzero(force >= np.maximum.accumulate(force)))


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES
    print("| law | sizes | coverage | mean bias | median error | median minimum size |")
    print("|---|---|---|---|---|---|")
    for name, (exponent, law) in LAWS.items():
        weights = law()
        for count in COUNTS:
            found = fits(weights, count, samples)
            bias = np.mean([one.exponent for one in found]) - exponent
            error = np.median([one.exponent_error for one in found])
            min_size = np.median([one.min_size for one in found])
            print(
                f"| {name} | {count} | {100 * covered(found, exponent):.1f} % | {bias:+.4f} "
                f"| {error:.4f} | {min_size:g} |",
                flush=True,
            )
    print("\n| bursts from | exponent of the nearest pure law |\n|---|---|")
    weights = bundle(10_000_000)
    for min_size in (1, 10, 30, 100, 300, 1000):
        print(f"| {min_size} | {local_exponent(weights, min_size):.4f} |")
    print("\n| fibres | bundles | exponent from 30 | from 100 | from 300 |\n|---|---|---|---|---|")
    for fibres, bundles in ((10**5, 4000), (10**6, 400), (10**7, 40)):
        generator = np.random.default_rng(fibres)
        sizes = np.concatenate([bursts_by_sorting(fibres, generator) for _ in range(bundles)])
        sizes = sizes[sizes >= 30]
        row = [fit_power_law(sizes, min_size, replicas=0) for min_size in (30, 100, 300)]
        shown = [f"{one.pure_exponent:.4f} ± {one.pure_exponent_error:.4f}" for one in row if one]
        print(f"| {fibres} | {bundles} | {' | '.join(shown)} |", flush=True)
    print("\n| K/Nk | from | exponent | cutoff |\n|---|---|---|---|")
    for ratio, min_size in ((0.01, 10), (0.1, 10), (1.0, 4)):
        exponent, cutoff = local_law(sliding(ratio), min_size)
        print(f"| {ratio:g} | {min_size} | {exponent:.4f} | {cutoff:.4g} |")


if __name__ == "__main__":
    main()
