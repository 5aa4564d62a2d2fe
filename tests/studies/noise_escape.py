"""How long does the noise of N contacts take to start a large oscillation beside steady sliding?

Runs from steady contacts until the first slip by more than a tenth of the static force, for an
apparatus whose steady sliding is linearly stable (back force 0), or ends in an oscillation of 1 %
(back force 0.1). Prints the mean waiting time for each N, with its error, and the fit of
tau exp(N/N_0) with its chi square: ``docs/steady-sliding.md``; some five minutes::

    .venv/bin/python tests/studies/noise_escape.py [back_force_ratio] [KEY=VALUE ...]
"""

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
    "output.interval=1 s",
)
# Numbers of contacts, and runs of each.
RUNS = {
    1000: 40,
    2000: 40,
    4000: 40,
    8000: 40,
    12000: 40,
    16000: 40,
    24000: 24,
    32000: 16,
    40000: 12,
    50000: 6,
}
MIN_FIT_COUNT = 4000
# Time simulated in a run at most [s], and advances between two looks at its slips.
DURATION, ADVANCES = 400.0, 20_000
MIN_DROP = 0.1


def waiting_time(config: Config) -> tuple[float, bool]:
    """Time of the first large slip of a run [s], or of its end; and whether there was one."""
    with mesoslip.Realization(config) as run:
        while not run.finished:
            run.advance(ADVANCES)
            slips = run.records("slips")
            drops = slips["force_before"] - slips["force_after"]
            large = np.flatnonzero(drops > MIN_DROP * config.contacts.static_force)
            if large.size:
                return float(slips["start_time"][large[0]]), True
    return DURATION, False


def main() -> None:
    back = sys.argv[1] if len(sys.argv) > 1 else "0"
    rows = []
    for count, runs in RUNS.items():
        changes = [f"contacts.count={count}", f"contacts.back_force_ratio={back}", *sys.argv[2:]]
        base = Config.load(KLEIN, [*APPARATUS, f"run.duration={DURATION}", *changes])
        found = [waiting_time(base.replace({"run.seed": 100 + seed})) for seed in range(runs)]
        started = sum(is_large for _, is_large in found)
        # Maximum likelihood of an exponential law, with the runs that ended before.
        mean = math.fsum(time for time, _ in found) / max(started, 1)
        error = mean / math.sqrt(max(started, 1))
        print(f"N = {count}: {started} of {runs}, {mean:.3g} +- {error:.2g} s", flush=True)
        if count >= MIN_FIT_COUNT and started:
            rows.append((count, math.log(mean), math.sqrt(started)))
    number, logarithm, weight = np.array(rows).T
    (slope, offset), covariance = np.polyfit(number, logarithm, 1, w=weight, cov="unscaled")
    rest = float(np.sum(((logarithm - offset - slope * number) * weight) ** 2))
    error = math.sqrt(covariance[0, 0]) / slope**2
    print(f"{math.exp(offset):.2g} s exp(N/N_0), N_0 = {1 / slope:.0f} +- {error:.0f}")
    print(f"chi square {rest:.1f} of {len(rows) - 2}")


if __name__ == "__main__":
    main()
