"""Settled cycles beside the last slips of long runs of the master equation, and the time of both.

Points of a Latin hypercube around the example of ``docs/cycles.md``, some two minutes::

    .venv/bin/python tests/studies/cycle_runs.py [POINTS]

It prints a row for each point with a periodic motion: relative differences of period and peaks,
the error that `mesoslip.cycle` reports, the modulus of the leading multiplier, and its computing
time over that of a run of 100 periods; then the median of these ratios.
"""

import math
import sys
import time
from pathlib import Path

import mesoslip
import numpy as np
from scipy.stats import qmc

KLEIN = Path(__file__).parents[2] / "runs" / "klein.toml"
# Ranges on a logarithmic scale.
RANGES = {
    "drive.velocity": (2e-6, 1e-5),
    "contacts.delay": (1e-3, 4e-3),
    "contacts.threshold.relative_width": (0.05, 0.25),
    "slider.stiffness": (60.0, 200.0),
    "slider.damping_ratio": (0.5, 2.0),
}
PERIODS, LAST = 100, 20


def points(count: int) -> list[mesoslip.Config]:
    """Configurations of a Latin hypercube."""
    sample = qmc.LatinHypercube(len(RANGES), rng=1).random(count)
    low, high = np.log(np.array(list(RANGES.values()))).T
    base = mesoslip.Config.load(KLEIN, ["run.engine=me", "output.slip_interval=0"])
    return [
        base.replace(dict(zip(RANGES, map(float, one), strict=True)))
        for one in np.exp(qmc.scale(sample, low, high))
    ]


def cpu(function, *arguments, **options):
    """A result, and the computing time that it took [s]."""
    start = time.process_time()
    result = function(*arguments, **options)
    return result, time.process_time() - start


def run(config: mesoslip.Config, duration: float) -> np.ndarray:
    """Start times and forces before the slips of a run."""
    changes = {"run.duration": duration, "output.interval": duration}
    with mesoslip.Realization(config.replace(changes), estimates_errors=False) as one:
        while not one.finished:
            one.advance()
        slips = one.records("slips")
        return np.array([slips["start_time"], slips["force_before"]])


def main(count: int) -> None:
    """Print a row for each point."""
    print("v um/s  delay ms  width  K N/m  damping | motion     multiple  period    peak     error")
    print("        multiplier, passages at resolution 1 and at the default, time over the run's")
    ratios = []
    for config in points(count):
        keys = [config.contacts.delay, config.contacts.threshold.relative_width]
        keys += [config.spring_stiffness, config.slider.damping_ratio]
        row = f"{config.drive_speed * 1e6:6.2f} {keys[0] * 1e3:9.3f} {keys[1]:6.3f} {keys[2]:6.1f} "
        row += f"{keys[3]:8.3f} | "
        found, seconds = cpu(mesoslip.cycle, config)
        if found.motion != "periodic":
            print(f"{row}{found.motion}", flush=True)
            continue
        (times, peaks), longest = cpu(run, config, PERIODS * found.period)
        ratios.append(seconds / longest)
        last = LAST * found.slips
        if found.slips == 0 or len(times) <= last:
            print(f"{row}{len(times)} slips only", flush=True)
            continue
        period = (times[-1] - times[-1 - last]) / LAST
        highest = peaks[-last:].reshape(LAST, -1).max(axis=1).mean()
        multiplier = abs(found.multipliers[0]) if found.multipliers else math.nan
        print(
            f"{row}{found.motion:10} {found.multiple:8d} {found.period / period - 1:9.1e} "
            f"{found.peak_force / highest - 1:9.1e} {found.error:8.1e}\n"
            f"        {multiplier:8.2f} {found.coarse_cycles:5d} {found.cycles:5d} "
            f"{seconds / longest:8.3f}",
            flush=True,
        )
    print(f"median {np.median(ratios):.3f} of {len(ratios)} points")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 25)
