"""How long does the noise of N contacts take to start a large oscillation beside steady sliding?

Runs from steady contacts until the first slip by more than a tenth of the static force, for an
apparatus whose steady sliding is linearly stable (back force 0), or ends in an oscillation of 1 %
(back force 0.1). Prints the mean waiting time for each N, and the fit of tau exp(N/N_0) in
``docs/steady-sliding.md``; a quarter of an hour::

    .venv/bin/python tests/studies/noise_escape.py [back_force_ratio]
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import mesoslip
import numpy as np
from mesoslip import Config

KLEIN = Path(__file__).parents[2] / "runs" / "klein.toml"
APPARATUS = (
    "slider.mass=3.2e-3",
    "slider.stiffness=310",
    "slider.damping_ratio=none",
    "slider.damping=12",
    "contacts.static_force=55e-6",
    "contacts.stiffness=4000",
    "contacts.delay=0.8e-3",
    "contacts.threshold.relative_width=0.2",
    "contacts.initial=steady",
    "drive.velocity=0.05 um/s",
    "output.slip_interval=0",
    "output.interval=4 ms",
)
COUNTS = (1000, 2000, 4000, 8000, 12000, 16000, 24000, 32000)
MIN_FIT_COUNT = 4000
RUNS, DURATION = 12, 80.0
MIN_DROP = 0.1


def waiting_times(count: int, back: str) -> list[float]:
    """Times of the first large slip of each run [s]; infinite without one."""
    found = []
    for seed in range(100, 100 + RUNS):
        changes = (
            f"contacts.count={count}",
            f"contacts.back_force_ratio={back}",
            f"run.seed={seed}",
            f"run.duration={DURATION}",
        )
        config = Config.load(KLEIN, [*APPARATUS, *changes])
        slips = mesoslip.slips(mesoslip.run(config, executor=1))
        is_large = slips["force_drop"].values > MIN_DROP * config.contacts.static_force
        found.append(min(slips["start_time"].values[is_large], default=math.inf))
    return found


def main() -> None:
    back = sys.argv[1] if len(sys.argv) > 1 else "0"
    rows = []
    for count in COUNTS:
        times = np.array(waiting_times(count, back))
        started = int(np.isfinite(times).sum())
        mean = float(np.minimum(times, DURATION).sum()) / max(started, 1)
        print(f"N = {count}: {started} of {RUNS}, mean waiting time {mean:.3g} s", flush=True)
        if count >= MIN_FIT_COUNT and started:
            rows.append((count, math.log(mean), math.sqrt(started)))
    number, logarithm, weight = np.array(rows).T
    (slope, offset), covariance = np.polyfit(number, logarithm, 1, w=weight, cov="unscaled")
    error = math.sqrt(covariance[0, 0]) / slope**2
    print(f"{math.exp(offset):.2g} s exp(N/N_0), N_0 = {1 / slope:.0f} +- {error:.0f}")


if __name__ == "__main__":
    main()
