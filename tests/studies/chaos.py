"""Largest Lyapunov exponents around an irregular motion: ``docs/chaos.png`` and the tables of
``docs/ageing.md``.

Peaks of the spring force and exponents over the velocity of the drive, the damping and the delay,
by the master equation; then the exponent of the irregular motion against the resolution, the
displacement of the twins, the time for which they are followed, and the number of contacts::

    .venv/bin/python tests/studies/chaos.py [--only map|checks] [figure]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import mesoslip
import numpy as np
import xarray as xr
from mesoslip import Config
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
RUN = ROOT / "runs" / "source" / "irregular.toml"
STATIC_FORCE = 18e-6
# Neighbourhood: velocities of the drive [m/s], damping ratios and delays [s].
VELOCITIES = np.geomspace(0.8e-6, 25e-6, 16)
DAMPING = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
DELAYS = (0.7e-3, 1.4e-3, 2.0e-3, 2.765e-3, 3.9e-3, 5.5e-3)
# Displacement of the drive in a run and in the life of a twin [m], and bounds of their times [s].
LENGTHS, TIMES, FOLLOWED = (25e-6, 2.5e-6), (9.0, 20.0), (0.8, 2.5)
TWINS = 8
DISPLACEMENT = 1e-6
# Regular motions [m/s].
REGULAR = (15.8e-6, 25e-6)


class Point(NamedTuple):
    """Exponent and peaks of a motion."""

    exponent: float
    error: float
    peaks: Array

    @classmethod
    def of_tree(cls, tree: xr.DataTree) -> Point:
        exponent, error = (float(tree[name]) for name in ("lyapunov_exponent", "lyapunov_error"))
        return cls(exponent, error, tree["peak_force"].values / STATIC_FORCE)

    def __str__(self) -> str:
        peaks = self.peaks
        variation = peaks.std() / abs(peaks.mean()) if peaks.size else np.nan
        return (
            f"{self.exponent:.2f} +- {self.error:.2f} 1/s, {peaks.size} peaks "
            f"varying by {variation:.3f}"
        )


def near(key: str, value: float, velocity: float = 2.32e-6) -> Point:
    """A motion of the master equation that differs in one key."""
    duration = float(np.clip(LENGTHS[0] / velocity, *TIMES))
    followed = float(np.clip(LENGTHS[1] / velocity, *FOLLOWED))
    config = Config.load(RUN, ["run.resolution=1", f"run.duration={duration}", f"{key}={value}"])
    point = Point.of_tree(
        mesoslip.lyapunov(
            config, twins=TWINS, duration=followed, displacement=DISPLACEMENT, executor=1
        )
    )
    print(f"{key} = {value:.4g}: {point}", flush=True)
    return point


def neighbourhood(file: Path) -> None:
    """Draw peaks and exponents over the velocity and the damping, and print those over delays."""
    import matplotlib.pyplot as plt

    keys = (
        ("drive.velocity", VELOCITIES, 1e6, "velocity of the drive (µm/s)"),
        ("slider.damping_ratio", DAMPING, 1.0, r"damping ratio $\eta_S/\Omega_S$"),
    )
    figure, axes = plt.subplots(
        2, 2, figsize=(5.5, 4.0), layout="constrained", sharex="col", sharey="row",
        width_ratios=(2, 1),
    )  # fmt: skip
    for (above, below), (key, values, scale, label) in zip(axes.T, keys, strict=True):
        points = [near(key, one, one if key == "drive.velocity" else 2.32e-6) for one in values]
        shown = scale * np.asarray(values)
        for x, point in zip(shown, points, strict=True):
            above.plot(np.full(point.peaks.size, x), point.peaks, "k.", markersize=1.5)
        below.errorbar(
            shown, [one.exponent for one in points], [one.error for one in points], fmt="o",
            markersize=3, linewidth=1, capsize=2, color="tab:blue",
        )  # fmt: skip
        below.axhline(0.0, color="grey", linewidth=0.7)
        below.set(xlabel=label, xscale="log")
    axes[0, 0].set_ylabel("force at the starts\nof slips over $F_s$")
    axes[1, 0].set_ylabel("largest exponent (1/s)")
    figure.savefig(file, dpi=130)
    for delay in DELAYS:
        near("contacts.delay", delay)


def checks() -> None:
    """Print the exponent of the irregular motion, and of two regular ones, in several ways."""
    eq = ["run.engine=eq"]
    for label, changes, duration, twins, followed, displacement in (
        *((f"resolution {one}", [f"run.resolution={one}"], 25.0, 16, 1.2, 1e-10)
          for one in (1.0, 0.5, 0.25)),
        *((f"displacement {one:g}", ["run.resolution=1"], 25.0, 16, 1.2, one)
          for one in (1e-8, 1e-6, 1e-4)),
        *((f"followed {one} s", ["run.resolution=1"], 25.0, 24, one, 1e-6) for one in (0.3, 0.6)),
        *((f"N = {count}, seed {seed}", [*eq, f"contacts.count={count}", f"run.seed={seed}"],
           12.0, 12, 0.7, 3.0 / count)
          for count, seeds in ((4000, 3), (16000, 3), (64000, 1)) for seed in range(1, seeds + 1)),
        *((f"{1e6 * one:.3g} um/s", [f"drive.velocity={one}"], 20.0, 8, 2.0, 1e-6)
          for one in REGULAR),
        *((f"{1e6 * one:.3g} um/s, N = 64000", [*eq, "contacts.count=64000",
           f"drive.velocity={one}"], 4.0, 6, 0.5, 1e-2) for one in REGULAR),
    ):  # fmt: skip
        config = Config.load(RUN, [f"run.duration={duration}", *changes])
        tree = mesoslip.lyapunov(
            config, twins=twins, duration=followed, displacement=displacement, executor=1
        )
        print(f"{label}: {Point.of_tree(tree)}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figure", nargs="?", type=Path, default=ROOT / "docs" / "chaos.png")
    parser.add_argument("--only", choices=("map", "checks"))
    chosen = parser.parse_args()
    if chosen.only != "checks":
        neighbourhood(chosen.figure)
    if chosen.only != "map":
        checks()
