"""Peak forces over the velocity of the drive, of contacts that age: ``docs/bifurcation.png``.

The runs are those of a sweep, whose regimes it prints::

    .venv/bin/python tests/studies/bifurcation.py [runs/sweeps/velocity-ageing.toml [figure]]
"""

from __future__ import annotations

import sys
from pathlib import Path

import mesoslip
import numpy as np
from mesoslip.campaign.plan import Plan
from numpy.typing import NDArray
from scipy.signal import find_peaks

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
SWEEP = ROOT / "runs" / "sweeps" / "velocity-ageing.toml"
NAMES = ("smooth", "stick-slip", "irregular", "transient")
COLOURS = ("tab:green", "tab:red", "tab:orange", "grey")


def peaks_of(force: Array) -> Array:
    """Peaks that stand out by half the distance of the percentiles, as in the rules of regimes."""
    low, high = np.percentile(force, [5, 95])
    places, _ = find_peaks(force, prominence=0.5 * (high - low))
    found: Array = force[places]
    return found


def main(sweep: Path, file: Path) -> None:
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7, 6), sharex=True, height_ratios=(3, 1), layout="constrained"
    )
    for combination in Plan.load(sweep).combinations:
        config = combination.config
        assert config.drive.velocity is not None
        velocity = 1e6 * config.drive.velocity
        tree = mesoslip.run(config, executor=1)
        judged = mesoslip.regime(tree)
        regime = int(judged["regime"][0])
        time = tree["time"].values
        inside = time > 0.5 * time[-1]
        force = tree["spring_force"].values[0][inside] / config.contacts.static_force
        peaks = peaks_of(force)
        above.plot(np.full(peaks.size, velocity), peaks, ".", color=COLOURS[regime], markersize=2.5)
        above.plot(velocity, force.mean(), "_", color="black", markersize=5)
        below.plot(
            velocity,
            float(judged["relative_amplitude"][0]),
            "o",
            color=COLOURS[regime],
            markersize=4,
        )
        print(
            f"{velocity:.3g} um/s: {NAMES[regime]}, mean {force.mean():.3f}, peaks "
            f"{peaks.mean():.3f} +- {peaks.std():.3f} ({peaks.size}), "
            f"periods vary by {float(judged['period_variation'][0]):.3f}, falls by "
            f"{float(judged['fall_variation'][0]):.3f}",
            flush=True,
        )
    for name, colour in zip(NAMES, COLOURS, strict=True):
        above.plot([], [], "o", color=colour, markersize=4, label=name)
    above.plot([], [], "_", color="black", label="mean force")
    above.set(ylabel="peaks of the spring force / $F_s$")
    above.legend()
    below.set(xlabel="velocity of the drive, µm/s", ylabel="amplitude / mean", yscale="log")
    figure.savefig(file, dpi=100)


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else SWEEP,
        Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "docs" / "bifurcation.png",
    )
