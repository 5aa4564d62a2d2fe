"""How well rates and states of measured traces are found: synthetic records of an integrator of its
own (Radau in the logarithm of the velocity), with noise; the stages are found in the load point,
and the laws of one state variable are fitted and judged as by `mesoslip response`.

Prints the share of records within three errors, that of 95 % intervals that contain the truth, and
the records that do not. Usage: measured_rates.py [RECORDS] [FIRST_SEED]
"""

import math
import sys
import time as clock
from dataclasses import dataclass

import numpy as np
import xarray as xr
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.rows import fit_rows
from mesoslip.measured.load_point import drive_stages
from mesoslip.measured.output_groups import stage_group
from scipy.integrate import solve_ivp

UM = 1e-6


@dataclass(frozen=True)
class Truth:
    """A synthetic experiment: a step from one velocity to another [SI]."""

    law: str
    a: float
    b: float
    slip_distance: float
    stiffness: float
    trend: float
    before: float
    after: float
    noise: float
    rates: tuple[float, float]


def draw(seed: int) -> Truth:
    """An experiment whose sliding is stable, at random."""
    rng = np.random.default_rng(seed)
    while True:
        a = rng.uniform(0.003, 0.015)
        b = a + rng.uniform(-0.005, 0.004)
        slip_distance = 0.5 * UM * 1000 ** rng.random()
        stiffness = 1e-4 / UM * 1000 ** rng.random()
        ratio = 3 * 10 ** rng.random()
        if b > 0.002 and stiffness > 1.5 * (b - a) / slip_distance:
            break
    slow = UM * 10 ** rng.uniform(-0.5, 1)
    before, after = (slow, slow * ratio) if rng.random() < 0.5 else (slow * ratio, slow)
    rate = 10 ** rng.uniform(1, 3)
    rates = (rate, rate) if rng.random() < 0.5 else (rate, min(1000.0, rate * 10))
    noise = 1e-5 * 100 ** rng.random()
    law = "ageing" if rng.random() < 0.5 else "slip"
    return Truth(
        law, a, b, slip_distance, stiffness, rng.normal() * 1e-6 / UM, before, after, noise, rates
    )


def friction(truth: Truth, step: float, time: np.ndarray) -> np.ndarray:
    """Friction at some times, the step being at one of its own."""
    scale = truth.before

    def rates(velocity: float):
        def derivative(_: float, at: np.ndarray) -> list[float]:
            speed = scale * math.exp(min(at[0], 60.0))
            omega = at[0] + at[1]
            if truth.law == "ageing":
                state = (scale * math.exp(min(-at[1], 60.0)) - speed) / truth.slip_distance
            else:
                state = -speed / truth.slip_distance * omega
            loading = truth.stiffness * (velocity - speed) - truth.trend * speed
            return [(loading - truth.b * state) / truth.a, state, speed]

        return derivative

    lag = math.log(truth.stiffness / (truth.stiffness + truth.trend))
    at, found = [lag, -lag, 0.0], []
    parts = ((0.0, step, truth.before, time < step), (step, time[-1], truth.after, time >= step))
    for begin, end, velocity, chosen in parts:
        wanted = np.unique(np.append(time[chosen], end))
        path = solve_ivp(rates(velocity), (begin, end), at, "Radau", wanted, rtol=1e-8, atol=1e-10)
        assert path.success
        u, psi, moved = path.y[:, : int(chosen.sum())]
        found.append(0.6 + truth.a * u + truth.b * psi + truth.trend * moved)
        at = path.y[:, -1]
    return np.concatenate(found)


def trace(truth: Truth, seed: int, share: float = 0.0, *, is_known: bool = True) -> xr.DataTree:
    """The experiment as a measured trace; a share of the variance of its noise is correlated over
    3 to 100 samples before the step, and its stiffness may be unknown."""
    rng = np.random.default_rng(seed + 10**6)
    # Until the state has evolved, and the spring has followed.
    length = max(20 * truth.slip_distance, 5 * truth.a / truth.stiffness, 5 * UM)
    durations = length / truth.before, 1.5 * length / truth.after
    # As laboratories do, no more samples than a day of work.
    rates = [min(rate, 30_000 / one) for rate, one in zip(truth.rates, durations, strict=True)]
    step = durations[0]
    late = step - min(0.5 * step, 20 / rates[1])
    time = np.concatenate(
        [np.arange(0, late, 1 / rates[0]), np.arange(late, sum(durations), 1 / rates[1])]
    )
    load = truth.before * np.minimum(time, step) + truth.after * np.maximum(time - step, 0)
    load = load + 0.02 * UM * rng.standard_normal(time.size)
    noise = rng.standard_normal(time.size)
    if share > 0:
        correlation = 3 * 30 ** rng.random() / rates[0]
        repeat = np.exp(-np.diff(time, prepend=-math.inf) / correlation)
        correlated = rng.standard_normal(time.size) * np.sqrt(1 - repeat**2)
        for place in range(1, time.size):
            correlated[place] += repeat[place] * correlated[place - 1]
        noise = math.sqrt(1 - share) * noise + math.sqrt(share) * correlated
    coefficient = friction(truth, step, time) + truth.noise * noise
    root = xr.Dataset(
        {
            "friction_coefficient": (("realization", "time"), coefficient[None]),
            "drive_displacement": (("realization", "time"), load[None]),
        },
        {"realization": [0], "time": time},
        {
            "origin": "measured",
            "trace": "",
            "configuration": f"[slider]\nstiffness = {truth.stiffness!r}\n" if is_known else "",
        },
    )
    stages = stage_group(drive_stages(time, load))
    return xr.DataTree.from_dict({"/": root, "/stages": stages})


def main(records: int, first: int) -> None:
    """Run the study."""
    begin = clock.perf_counter()
    names = ("a", "b", "slip_distance")
    pulls: dict[str, list[float]] = {name: [] for name in names}
    silent, wrong_law, undecided, within = [], 0, 0, 0
    for seed in range(first, first + records):
        truth = draw(seed)
        exact = dict(zip(names, (truth.a, truth.b, truth.slip_distance), strict=True))
        tree = trace(truth, seed)
        rows = fit_rows(Experiment(tree), 0, laws=("ageing", "slip"))
        row = next((one for one in rows if one["law"] == truth.law), rows[0])
        if not math.isfinite(row["a"]):
            silent.append(seed)
            print(f"{seed}: {row['note']}; {truth}", flush=True)
            continue
        single = [one for one in rows if one["law"] in {"ageing", "slip"}]
        best = min(single, key=lambda one: one["information_criterion"])
        difference = abs(np.subtract(*(one["information_criterion"] for one in single)))
        undecided += bool(difference < 10)
        wrong_law += bool(best["law"] != truth.law and difference >= 10)
        found = [(row[name] - value) / row[f"{name}_error"] for name, value in exact.items()]
        for name, pull in zip(names, found, strict=True):
            pulls[name].append(pull)
        good = max(map(abs, found)) <= 3
        within += good
        if not good:
            values = ", ".join(f"{row[name]:.4g} ± {row[name + '_error']:.2g}" for name in names)
            print(f"{seed}: {values}; {row['note']}; {truth}", flush=True)
    count = records - len(silent)
    print(f"{records} records in {clock.perf_counter() - begin:.0f} s")
    print(f"evolution within the noise: {len(silent)}")
    print(f"all three within three errors: {within} of {count} ({within / max(count, 1):.1%})")
    for name, values in pulls.items():
        inside = np.mean(np.abs(values) < 1.96)
        print(f"{name}: 95 % intervals cover {inside:.1%}, pulls of {np.std(values):.2f}")
    print(f"the other law by 10 or more: {wrong_law}; laws within 10: {undecided}")


if __name__ == "__main__":
    given = [int(one) for one in sys.argv[1:]]
    main(*(given + [300, 0][len(given) :]))
