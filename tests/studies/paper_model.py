"""Contacts that creep and age beside a measured trace of paper on paper: ``docs/paper-model.png``.

It prints the means of the slips after the first, and the scatter of single slips::

    .venv/bin/python tests/studies/paper_model.py [figure]
"""

import sys
from pathlib import Path

import mesoslip
import numpy as np
from matplotlib import pyplot as plt

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "runs" / "measured"
# Seconds that are shown, and those of one period.
SHOWN, CLOSE = 5.0, 1.1
WEIGHT = 30.7e-3 * 9.81
COLUMNS = (
    "force_before",
    "force_drop",
    "waiting_time",
    "loading_stiffness",
    "creep_displacement",
    "duration",
)


def main(target: Path) -> None:
    measured = mesoslip.read_trace(RUNS / "paper-k1002-v42.toml")
    model = mesoslip.run(RUNS / "paper-k1002-v42-model.toml")
    figure, panels = plt.subplots(2, 2, figsize=(8, 4.6), sharey=True, width_ratios=[2, 1])
    # The model starts on relaxed contacts: its first slip is larger.
    for row, tree, first, name in (
        (0, measured, 200.0, "measured"),
        (1, model, 6.0, "model"),
    ):
        time, force = tree["time"].values, tree["spring_force"].values[0] / WEIGHT
        slips = mesoslip.slips(tree)
        starts = slips["start_time"].values
        chosen = starts[starts > first]
        for axes, start, length in (
            (panels[row, 0], first, SHOWN),
            (panels[row, 1], chosen[1] - CLOSE + 0.1, CLOSE),
        ):
            inside = (time >= start) & (time <= start + length)
            axes.plot(time[inside] - start, force[inside], color="black", linewidth=0.6)
            axes.spines[["top", "right"]].set_visible(False)
        panels[row, 0].set_ylabel("force over weight")
        panels[row, 0].set_title(name, loc="left")
        settled = starts > starts[0]
        print(name)
        for column in COLUMNS:
            values = slips[column].values[settled]
            values = values[np.isfinite(values)]
            print(f"  {column}: {values.mean():.4g} ± {values.std(ddof=1):.2g} ({values.size})")
    for axes in panels[1]:
        axes.set_xlabel("time (s)")
    figure.tight_layout()
    figure.savefig(target, dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "paper-model.png")
