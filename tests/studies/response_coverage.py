"""Do the errors of steady forces and of rate-and-state parameters cover?

Prints the tables of ``docs/response.md``::

    export PYTHONPATH=tests/python
    .venv/bin/python tests/studies/response_coverage.py [steady] [runs] [fits]
"""

import sys
from dataclasses import replace

import mesoslip
import numpy as np
from mesoslip.analysis.rate_and_state.noise import known_noise
from mesoslip.analysis.rate_and_state.points import Loading, points_of_run
from mesoslip.analysis.rate_and_state.records import Record
from mesoslip.analysis.rate_and_state.search import Fit, fit_laws
from mesoslip.analysis.steady_force import SteadyMean, steady_mean
from numpy.typing import NDArray
from oracles import Friction, spring_slider
from scipy.signal import lfilter

Array = NDArray[np.float64]

SAMPLES = 400
TRACES = 100

# A velocity step up and down and a hold, as in many laboratories; friction coefficients and metres.
TRUTH = Friction(0.6, 1e-6, 0.005, 0.01, 1e-5)
STIFFNESS = 1e3
STAGES = (
    Loading(20, 1e-6, 1e-6),
    Loading(15, 1e-5, 1e-5),
    Loading(60, 1e-6, 1e-6),
    Loading(100, 0.0, 0.0),
    Loading(60, 1e-6, 1e-6),
)
INTERVAL = 0.05
NOISE = 5e-4
# Range of D_c in the search [m].
DISTANCES = (6e-7, 6e-5)


def autoregression(realizations: int, count: int, repeat: float, seed: int) -> Array:
    """Steady series of the first order, of mean 0 and variance 1, shape (realizations, count)."""
    generator = np.random.default_rng(seed)
    steps = generator.standard_normal((realizations, count))
    steps[:, 1:] *= np.sqrt(1 - repeat**2)
    series: Array = lfilter([1], [1, -repeat], steps, axis=1)
    return series


def steady_coverage(
    realizations: int, count: int, repeat: float, transient: float = 0.0, samples: int = SAMPLES
) -> tuple[float, float, float, float]:
    """Part of the 95 % intervals that cover, median error over the true one, part said to be long
    enough, and coverage of those."""
    decay = transient * np.exp(-np.arange(count) / (0.03 * count))
    found: list[SteadyMean] = []
    for seed in range(samples):
        mean = steady_mean(5.0 + decay + autoregression(realizations, count, repeat, seed))
        assert mean is not None
        found.append(mean)
    covers = np.array([abs(one.mean - 5.0) < one.half_width for one in found])
    resolved = np.array([one.is_resolved for one in found])
    true = np.sqrt((1 + repeat) / (1 - repeat) / (count * realizations))
    ratio = float(np.median([one.error for one in found]) / true)
    among = float(covers[resolved].mean()) if resolved.any() else np.nan
    return float(covers.mean()), ratio, float(resolved.mean()), among


def noise_along(way: Array, length: float, generator: np.random.Generator) -> Array:
    """Noise of variance 1 that goes on as the slider moves; white for a length of 0."""
    noise = generator.standard_normal(way.size)
    if length == 0:
        return noise
    repeat = np.exp(-np.abs(np.diff(way)) / length)
    for place, one in enumerate(repeat, start=1):
        noise[place] = one * noise[place - 1] + np.sqrt(1 - one**2) * noise[place]
    return noise


def synthetic_fit(law: str, length: float, seed: int, fitted: str | None = None) -> Fit:
    """A law fitted to a synthetic record with noise."""
    times = np.arange(0, sum(one.duration for one in STAGES), INTERVAL)
    # The slip law is unstable in such a step on a spring only twice as stiff as critical.
    stiffness = STIFFNESS if law == "ageing" else 5 * STIFFNESS
    motion = spring_slider(replace(TRUTH, law=law), STAGES, times, stiffness)
    generator = np.random.default_rng(seed)
    force = motion.force + NOISE * noise_along(motion.displacement, length, generator)
    record = record_of(times, force, motion.displacement, stiffness, NOISE, length)
    return fit_laws(record, [fitted or law])[fitted or law]


def record_of(
    times: Array,
    force: Array,
    displacement: Array,
    stiffness: float,
    noise: float,
    length: float = 0.0,
    stages: tuple[Loading, ...] = STAGES,
) -> Record:
    """A record like that of a run, of known noise."""
    points = points_of_run(stages, times, force)
    return Record(points, stiffness, DISTANCES, known_noise(points, displacement, noise, length))


def departure(found: Fit) -> Array:
    """How far reference force, a, b and D_c are from the truth, in their errors."""
    names = ("reference_force", "a", "b", "slip_distance")
    return np.array(
        [(found.value(name) - getattr(TRUTH, name)) / found.error(name) for name in names]
    )


def show_steady() -> None:
    print("| realizations | samples | repeat | transient | covers | error | long enough | covers |")
    print("|---|---|---|---|---|---|---|---|")
    for realizations, count in ((1, 200), (1, 1000), (1, 10_000), (5, 200), (5, 1000)):
        for repeat in (0.0, 0.5, 0.9, 0.98):
            for transient in (0.0, 5.0):
                row = steady_coverage(realizations, count, repeat, transient)
                print(
                    f"| {realizations} | {count} | {repeat} | {transient:g} | {100 * row[0]:.1f} % "
                    f"| {row[1]:.2f} | {100 * row[2]:.0f} % | {100 * row[3]:.1f} % |",
                    flush=True,
                )


def show_runs() -> None:
    """Each realization by itself against the mean of all, sliding and sticking and slipping."""
    klein = mesoslip.Config.load("runs/klein.toml").replace(
        **{"contacts.count": 500, "run.realizations": 200}
    )
    prescribed = {"slider": {"kind": "prescribed"}}
    runs = {
        "sliding, delta 0.2": ({"contacts.threshold.relative_width": 0.2} | prescribed, 3.0),
        "sliding, delta 0.05": ({"contacts.threshold.relative_width": 0.05} | prescribed, 6.0),
        "stick-slip, delta 0.1": ({"contacts.threshold.relative_width": 0.1}, 30.0),
    }
    print("| run | covers | long enough | covers |\n|---|---|---|---|")
    for name, (changes, duration) in runs.items():
        config = klein.replace(changes, {"run.duration": duration, "output.interval": 2e-3})
        force = mesoslip.run(config)["spring_force"].values
        # Of the second half, the mean that each should cover.
        true = float(force[:, force.shape[1] // 2 :].mean())
        error = float(force[:, force.shape[1] // 2 :].mean(axis=1).std()) / np.sqrt(len(force))
        found = [one for one in (steady_mean(row[None, :]) for row in force) if one is not None]
        covers = np.array(
            [abs(one.mean - true) < np.hypot(one.half_width, 1.96 * error) for one in found]
        )
        resolved = np.array([one.is_resolved for one in found])
        among = 100 * covers[resolved].mean() if resolved.any() else np.nan
        print(
            f"| {name} | {100 * covers.mean():.1f} % | {100 * resolved.mean():.0f} % "
            f"| {among:.1f} % |",
            flush=True,
        )


def show_fits() -> None:
    print(
        "| law | noise | F_0 | a | b | D_c | all within 3 | said to describe | other law said to |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for law, length in (("ageing", 0.0), ("ageing", 2e-6), ("slip", 0.0), ("slip", 2e-6)):
        found = [synthetic_fit(law, length, seed) for seed in range(TRACES)]
        apart = np.array([departure(one) for one in found])
        covers = " | ".join(f"{100 * part:.0f} %" for part in np.mean(np.abs(apart) < 1.96, axis=0))
        within = 100 * np.mean(np.all(np.abs(apart) < 3, axis=1))
        described = 100 * np.mean([one.p_value >= 0.01 for one in found])
        other = "slip" if law == "ageing" else "ageing"
        wrong = [synthetic_fit(law, length, seed, other) for seed in range(TRACES // 10)]
        mistaken = 100 * np.mean([one.p_value >= 0.01 for one in wrong])
        kind = "white" if length == 0 else "along the way"
        print(
            f"| {law} | {kind} | {covers} | {within:.0f} % "
            f"| {described:.0f} % | {mistaken:.0f} % |",
            flush=True,
        )


def main() -> None:
    wanted = sys.argv[1:] or ["steady", "runs", "fits"]
    for name in wanted:
        {"steady": show_steady, "runs": show_runs, "fits": show_fits}[name]()
        print()


if __name__ == "__main__":
    main()
