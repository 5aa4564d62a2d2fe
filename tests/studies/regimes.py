"""Do the rules of `mesoslip regime` see what the spectrum of the force sees?

Runs of Klein's case with 500 contacts over velocity, stiffness, delay and width of the thresholds
are judged by the program, which counts cycles, and by the spectrum of the same force: by its power,
by how that changes, and by its lines. Lines and a broad band differ in their Fourier transform,
the correlation of the force with itself: how far it comes back after it has been negative. Close
to a boundary a spectrum leaves both sides open. Prints the table of ``docs/regimes.md``, the points
at which the two disagree, and draws these on request::

    .venv/bin/python tests/studies/regimes.py [figure]

The table is that of 360 points, which take three minutes; ``tests/python/test_regime.py`` has
fewer.
"""

import itertools
import math
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mesoslip
import numpy as np
from mesoslip import Config
from mesoslip.analysis.regime.result import NAMES
from numpy.typing import NDArray

Array = NDArray[np.float64]

VELOCITIES = (0.05e-6, 0.2e-6, 1e-6, 4e-6, 15e-6)
STIFFNESSES = (40.0, 97.0, 250.0, 1000.0)
DELAYS = (0.0, 0.2e-3, 0.5e-3, 1e-3, 2e-3, 6e-3)
WIDTHS = (0.01, 0.03, 0.1)
COUNT = 500
KLEIN = Config.load(
    Path(__file__).parents[2] / "runs" / "klein.toml", ["output.slip_interval=none"]
)
STATIC_FORCE = 18e-6
MASS = 1.47e-3

SMOOTH, STICK_SLIP, IRREGULAR, TRANSIENT = range(4)
# Power over that of the noise of N contacts, 0.8 N^(-1/2) of the static force and 2 % of the mean:
# below the first it is noise, above the second it is more.
NOISE = (0.8, 1.3)
# How far the correlation comes back: below the first a broad band, above the second lines.
LINES = (0.3, 0.5)
# Amplitude of the second half over that of the first, or the inverse: settled, and not.
SETTLED = (0.87, 0.75)


class Point(NamedTuple):
    """A point of the grid: velocity [m/s], stiffness [N/m], delay [s], relative width."""

    velocity: float
    stiffness: float
    delay: float
    width: float

    @property
    def duration(self) -> float:
        """So many loadings of the spring, periods of the setup, and lives of contacts [s]."""
        loading = STATIC_FORCE / self.stiffness / self.velocity
        period = 2 * math.pi * math.sqrt(MASS / self.stiffness)
        return 24 * loading + 120 * period + 40 * 9e-9 / self.velocity

    def configuration(self, seed: int) -> Config:
        return KLEIN.replace(
            {
                "run": {"duration": self.duration, "seed": seed},
                "drive.velocity": self.velocity,
                "slider.stiffness": self.stiffness,
                "contacts.count": COUNT,
                "contacts.delay": self.delay,
                "contacts.threshold.relative_width": self.width,
                "output": {"interval": self.duration / 20000},
            }
        )


def points() -> list[Point]:
    grid = itertools.product(VELOCITIES, STIFFNESSES, DELAYS, WIDTHS)
    return [Point(*one) for one in grid]


def spectral_regimes(time: Array, force: Array, count: int, static_force: float) -> set[int]:
    """The regimes that the spectrum of a settled force leaves open."""
    mean = max(abs(float(np.mean(force))), 0.05 * static_force)
    rest = force - np.polyval(np.polyfit(time, force, 1), time)
    size = len(rest)
    # By Parseval's theorem the power of a signal is its variance; a wave's is half its square.
    amplitude = math.sqrt(2) * float(np.std(rest)) / mean
    noise = 0.02 + 0.8 * static_force / math.sqrt(count) / mean
    power = np.abs(np.fft.rfft(rest, 2 * size)) ** 2
    correlation = np.fft.irfft(power)[: size // 2] / np.arange(size, size - size // 2, -1)
    negative = np.flatnonzero(correlation < 0)
    lines = float(correlation[negative[0] :].max() / correlation[0]) if negative.size else 0.0
    halves = float(np.std(rest[size // 2 :]) / np.std(rest[: size // 2]))
    change = min(halves, 1 / halves)
    if amplitude < 0.02:
        return {SMOOTH}
    found = set()
    if amplitude < NOISE[1] * noise:
        found.add(SMOOTH)
    # Noise has no lines as sharp as these.
    if amplitude > NOISE[0] * noise or lines > 0.8:
        if change < SETTLED[0]:
            found.add(TRANSIENT)
        if change > SETTLED[1]:
            found |= {STICK_SLIP} if lines > LINES[0] else set()
            found |= {IRREGULAR} if lines < LINES[1] else set()
    return found


class Compared(NamedTuple):
    """A point, its run, the regime by the program, and those that the spectrum leaves open."""

    point: Point
    time: Array
    force: Array
    regime: int
    spectral: set[int]


def compare(grid: list[Point], first_seed: int = 5001) -> Iterator[Compared]:
    for number, point in enumerate(grid):
        tree = mesoslip.run(point.configuration(first_seed + number), executor=1)
        regime = int(mesoslip.regime(tree)["regime"][0])
        time, force = tree["time"].values, tree["spring_force"].values[0]
        half = len(time) // 2
        spectral = spectral_regimes(time[half:], force[half:], COUNT, STATIC_FORCE)
        yield Compared(point, time, force, regime, spectral)


def draw(disagreeing: list[Compared], file: str) -> None:
    import matplotlib.pyplot as plt

    rows = math.ceil(len(disagreeing) / 4)
    figure, axes = plt.subplots(rows, 4, figsize=(20, 2.5 * rows), squeeze=False)
    for one, panel in zip(disagreeing, axes.flat, strict=False):
        panel.plot(one.time, 1e6 * one.force, linewidth=0.4)
        spectral = " or ".join(NAMES[other] for other in sorted(one.spectral))
        panel.set_title(f"{one.point}\n{NAMES[one.regime]}, {spectral}", fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=60)


def main() -> None:
    compared = list(compare(points()))
    disagreeing = [one for one in compared if one.regime not in one.spectral]
    certain = sum(len(one.spectral) == 1 for one in compared)
    agreeing = 100 * (1 - len(disagreeing) / len(compared))
    print(f"{len(compared)} points, {certain} certain by the spectrum: {agreeing:.1f} % agree")
    counts = Counter((one.regime, tuple(sorted(one.spectral))) for one in compared)
    for (regime, spectral), count in sorted(counts.items()):
        names = " or ".join(NAMES[other] for other in spectral)
        print(f"{count:5d}  {NAMES[regime]:12} spectrum: {names}")
    for one in disagreeing:
        print(one.point, NAMES[one.regime], [NAMES[other] for other in one.spectral])
    if len(sys.argv) > 1:
        draw(disagreeing, sys.argv[1])


if __name__ == "__main__":
    main()
