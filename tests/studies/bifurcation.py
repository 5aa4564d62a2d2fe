"""Peaks of the spring force over the velocity of the drive, of contacts that age: the picture
``docs/bifurcation.png``, at the parameters of an irregular motion.

    .venv/bin/python tests/studies/bifurcation.py [figure]
"""

from __future__ import annotations

import sys
from pathlib import Path

import mesoslip
import numpy as np
from mesoslip.analysis.return_map import settled_peaks

ROOT = Path(__file__).parents[2]
RUN = ROOT / "runs" / "source" / "irregular.toml"
# Velocities of the drive [m/s], and the displacement in a run [m].
VELOCITIES = np.geomspace(0.8e-6, 25e-6, 16)
DISTANCE = 10e-6


def main(file: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for velocity in VELOCITIES:
        duration = float(np.clip(DISTANCE / velocity, 2.0, 10.0))
        config = mesoslip.Config.load(
            RUN,
            overrides=[
                "run.engine=eq",
                "contacts.count=1000",
                f"drive.velocity={velocity}",
                f"run.duration={duration}",
            ],
        )
        tree = mesoslip.run(config, executor=1)
        peaks = settled_peaks(tree) / config.contacts.static_force
        axes.semilogx(np.full(peaks.size, 1e6 * velocity), peaks, "k.", markersize=2)
        variation = peaks.std() / abs(peaks.mean()) if peaks.size else np.nan
        print(
            f"{1e6 * velocity:.3g} um/s: {peaks.size} peaks varying by {variation:.3f}", flush=True
        )
    axes.set(
        xlabel="velocity of the drive, µm/s", ylabel="spring force at the starts of slips / $F_s$"
    )
    figure.savefig(file, dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "bifurcation.png")
