"""Coverage of the errors of b-values and of Omori's law, in made catalogues.

python tests/studies/event_coverage.py [COUNT]
"""

from __future__ import annotations

import math
import sys

import numpy as np
from mesoslip.analysis.events import b_value, omori
from numpy.typing import NDArray
from scipy.special import ndtr

Array = NDArray[np.float64]


def sizes(rng: np.random.Generator, b: float, count: int, blur: float = 0.0) -> Array:
    """Sizes with a b-value, of magnitudes from 0; with a gradual completeness around 0.5."""
    if blur == 0:
        return np.asarray(rng.pareto(b, count) + 1)
    found = rng.pareto(b, 20 * count) + 1
    seen = ndtr((np.log10(found) - 0.5) / blur) > rng.random(found.size)
    return np.asarray(found[seen][:count])


def sequence(
    rng: np.random.Generator, p: float, c: float, main_count: int, each: int, background: float
) -> tuple[Array, Array, float]:
    """Times and sizes of main events (size 10) and of others (1) after them, and the end."""
    length = 1000.0
    times, marks = [], []
    for number in range(main_count):
        edge = c ** (1 - p) - (length + c) ** (1 - p)
        share = rng.random(rng.poisson(each))
        after = (c ** (1 - p) - share * edge) ** (1 / (1 - p)) - c
        others = length * rng.random(rng.poisson(background * length))
        inside = np.concatenate([[0.0], after, others])
        times.append(number * length + inside)
        marks.append(np.concatenate([[10.0], np.ones(inside.size - 1)]))
    return np.concatenate(times), np.concatenate(marks), main_count * length


def main(count: int) -> None:
    """Print shares of results within 1.96 standard errors."""
    rng = np.random.default_rng(1)
    for b in (0.7, 1.0, 1.5):
        for number, blur in ((50, 0.0), (300, 0.0), (300, 0.2), (3000, 0.2)):
            ratios = []
            for _ in range(count):
                found = b_value(sizes(rng, b, number, blur))
                if found is not None:
                    ratios.append((found.value - b) / found.error)
            inside = np.mean(np.abs(ratios) < 1.96)
            print(
                f"b {b}, {number} events, blur {blur}: {inside:.2f} of {len(ratios)} inside, ",
                end="",
            )
            print(f"bias {np.mean(ratios):+.2f} errors")
    for p in (0.9, 1.2):
        for main_count, each in ((5, 40), (20, 40)):
            inside, decays = [], []
            for _ in range(max(1, count // 4)):
                found = omori(
                    *sequence(rng, p, 1.0, main_count, each, 0.005)[:2], 10.0, 1e3 * main_count
                )
                decays.append(found is not None and found.decays)
                if found is not None and math.isfinite(found.p_error):
                    inside.append(abs(found.p - p) < 1.96 * found.p_error)
            print(
                f"p {p}, {main_count} x {each}: {np.mean(inside):.2f} of {len(inside)} inside, ",
                end="",
            )
            print(f"decays in {np.mean(decays):.2f}")
    false = 0
    for _ in range(count // 4):
        times = 1e4 * np.sort(rng.random(300))
        marks = np.where(rng.random(300) < 0.05, 10.0, 1.0)
        found = omori(times, marks, 10.0, 1e4)
        false += found is not None and found.decays
    print(f"decays in events without one: {false} of {count // 4}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
