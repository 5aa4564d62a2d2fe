"""Which motions are possible over stiffness and velocity: `mesoslip cycle` from relaxed and from
steady contacts at each point, beside linear theory: ``docs/motions-map.png``; ten minutes on two
processors::

    .venv/bin/python tests/studies/motions_map.py [--workers N] [figure]
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import mesoslip
import numpy as np
from mesoslip import Config
from mesoslip.theory.steady_sliding import stability_boundary
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
APPARATUS = {
    "run": {"engine": "me", "duration": "30 s"},
    "drive": {"velocity": "0.4 um/s"},
    "slider": {"kind": "rigid", "mass": "3.2 g", "stiffness": "310 N/m", "damping": "12 1/s"},
    "contacts": {
        "count": 12000,
        "static_force": "55 uN",
        "stiffness": "4 kN/m",
        "delay": "0.8 ms",
        "coupling": "equal",
        "threshold": {"law": "gaussian", "relative_width": 0.04},
    },
    "output": {"interval": "2 ms"},
}
STIFFNESSES = np.geomspace(310.0, 40e3, 11)
VELOCITIES = np.geomspace(0.05e-6, 1.6e-6, 6)
STARTS = ("relaxed", "steady")
# Velocities between which the linear boundary lies [m/s].
ENDS = 0.01e-6, 5e-6


class Motion(NamedTuple):
    """The motion that a start leads to."""

    stiffness: float
    velocity: float
    start: str
    kind: str
    amplitude: float
    smooth_stable: bool | None
    cycles: int
    followed: float


def motion(stiffness: float, velocity: float, start: str) -> Motion:
    """The motion that a start leads to at a point."""
    changes = {"slider.stiffness": stiffness, "drive.velocity": velocity}
    found = mesoslip.cycle(
        Config.from_dict(APPARATUS).replace(changes), start=start, find_multipliers=False
    )
    return Motion(
        stiffness,
        velocity,
        start,
        found.motion,
        found.amplitude_ratio,
        found.smooth_stable,
        found.cycles,
        found.followed,
    )


def boundary() -> tuple[Array, Array]:
    """Stiffnesses, and velocities below which smooth sliding is linearly stable."""
    base = Config.from_dict(APPARATUS)
    stiffnesses = np.geomspace(STIFFNESSES[0], STIFFNESSES[-1], 41)
    velocities = [
        stability_boundary(base.replace({"slider.stiffness": one}), "drive.velocity", *ENDS)
        for one in stiffnesses
    ]
    return stiffnesses, np.array(velocities)


def draw(motions: list[Motion], file: Path) -> None:
    """Amplitudes from both starts, and where smooth sliding is linearly stable."""
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter

    figure, axes = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
    stiffnesses, velocities = boundary()
    axes.fill_between(stiffnesses, 1e6 * velocities, 1e6 * ENDS[0], color="0.88", linewidth=0)
    for start, edge, size in (("relaxed", "black", 90), ("steady", "white", 25)):
        chosen = [one for one in motions if one.start == start]
        moving = [one for one in chosen if one.kind != "smooth"]
        still = [one for one in chosen if one.kind == "smooth"]
        drawn = axes.scatter(
            [one.stiffness for one in moving], [1e6 * one.velocity for one in moving], s=size,
            c=[one.amplitude for one in moving], norm=LogNorm(0.01, 3.0), cmap="viridis_r",
            edgecolors=edge, linewidths=0.8,
        )  # fmt: skip
        axes.scatter(
            [one.stiffness for one in still], [1e6 * one.velocity for one in still], s=size,
            facecolors="white", edgecolors="black", linewidths=0.8,
        )  # fmt: skip
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    figure.colorbar(drawn, label="amplitude / $F_s$", format=plain)
    axes.set(
        xscale="log", yscale="log", xlabel="stiffness of the spring (N/m)",
        ylabel="velocity of the drive (µm/s)", xlim=(250, 50e3), ylim=(0.038, 2.1),
    )  # fmt: skip
    axes.yaxis.set_major_formatter(plain)
    figure.savefig(file, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figure", nargs="?", type=Path, default=ROOT / "docs" / "motions-map.png")
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    points = [
        (stiffness, velocity, start)
        for velocity in VELOCITIES
        for stiffness in STIFFNESSES
        for start in STARTS
    ]
    motions = []
    with ProcessPoolExecutor(chosen.workers) as pool:
        for one in pool.map(motion, *zip(*points, strict=True)):
            motions.append(one)
            print(
                f"{one.stiffness:9.4g} N/m, {1e6 * one.velocity:.3g} um/s, {one.start:8}: "
                f"{one.kind:9} {one.amplitude:.3f} after {one.cycles} passages in "
                f"{one.followed:.3g} s; smooth sliding "
                f"{'stable' if one.smooth_stable else 'unstable'}",
                flush=True,
            )
    draw(motions, chosen.figure)


if __name__ == "__main__":
    main()
