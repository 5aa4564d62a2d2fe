"""Coverage of the errors of b-values and of Omori's law, in made catalogues.

python tests/studies/event_coverage.py [COUNT]
"""

import itertools
import math
import sys

import numpy as np
from mesoslip.analysis.events.laws import b_value, omori
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sizes(rng: np.random.Generator, b: float, count: int, blur: float = 0.0) -> Array:
    """Sizes with a b-value: of magnitudes from 0, or with a gradual completeness around 0.5.

    The detection is a cumulative normal distribution of the magnitude; of an exponential law, the
    detected magnitudes are exponential around normal ones.
    """
    rate = b * math.log(10)
    middle = 0.5 - rate * blur**2 if blur else 0.0
    return np.asarray(
        10 ** (middle + rng.exponential(1 / rate, count) + blur * rng.normal(0, 1, count))
    )


def ramp(rng: np.random.Generator, b: float, count: int) -> Array:
    """Sizes from 1 on that are detected with a probability that grows from 0 at 1.5 to 1 at 5.5."""
    found = rng.pareto(b, 40 * count) + 1
    return np.asarray(found[(found - 1.5) / 4 > rng.random(found.size)][:count])


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
    """Print shares of intervals that contain the truth, and of results within 1.96 errors."""
    rng = np.random.default_rng(1)
    kinds = {"sharp": 0.0, "gradual": 0.2, "wide": 0.4}
    for b in (0.7, 1.0, 1.5):
        for kind, number in itertools.product((*kinds, "ramp"), (50, 100, 200, 1000)):
            found = []
            for _ in range(count):
                made = sizes(rng, b, number, kinds[kind]) if kind in kinds else ramp(rng, b, number)
                one = b_value(made)
                if one is not None:
                    found.append(one)
            inside = np.mean([one.low <= b <= one.high for one in found])
            limits = np.mean([math.isinf(one.high) for one in found])
            ratios = [(one.value - b) / one.error for one in found if math.isfinite(one.error)]
            print(
                f"b {b}, {kind}, {number} events: {inside:.2f} of {len(found)} inside, "
                f"{limits:.2f} lower limits, bias of the others {np.mean(ratios):+.2f} errors",
                flush=True,
            )
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
