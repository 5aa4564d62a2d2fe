"""Is the uncertainty of fits right? Simulation-based calibration (Talts et al. 2018).

Parameters are drawn from the prior, an experiment is simulated with them and fitted with the same
prior; the rank of the truth among the draws of its posterior must be uniform. Short runs of few
contacts, so that a fit takes half a minute of a processor. What is done is kept in a file, and the
study goes on from there:

    python tests/studies/fit_calibration.py out/calibration.csv --experiments 100
    python tests/studies/fit_calibration.py out/calibration.csv --report docs/fit-calibration.png

With `--noise laboratory` the noise is coloured and digitized, with impulses in 1 % of the samples,
and estimated from the trace as that of a measurement. With `--contacts 4800 --simulated 800` the
interface has more contacts than most simulations of its fit. With `--case levels` an experiment is
two records of contacts on tracks, with springs of 97 and 160 N/m and a level each:

    python tests/studies/fit_calibration.py out/levels.csv --case levels --experiments 30
"""

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
from mesoslip.errors import RunError
from mesoslip.inference.fit import prepare, usable_summaries
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.noise import Noise
from mesoslip.inference.prior import level_name
from mesoslip.inference.rounds import estimate_posterior
from mesoslip.inference.simulations import Simulations

ROOT = Path(__file__).parents[2]
NOISE = 5e-8
TABLES = {
    "base": str(ROOT / "runs" / "klein.toml"),
    "run": {"duration": 6.0},
    "contacts": {"count": 800},
    "output": {"interval": 2e-3},
    "fit": {
        "noise": NOISE,
        "simulations": 500,
        "free": {
            "contacts.static_force": {"from": 8e-6, "to": 2.5e-5, "prior": "logarithmic"},
            "contacts.threshold.relative_width": {
                "from": 0.01,
                "to": 0.15,
                "prior": "logarithmic",
            },
            "contacts.delay": {"from": 3e-4, "to": 3e-3, "prior": "logarithmic"},
            "slider.stiffness": {"from": 60.0, "to": 250.0, "prior": "logarithmic"},
        },
    },
}


LEVELS = {
    "base": str(ROOT / "runs" / "klein.toml"),
    "run": {"duration": 3.3},
    "drive": {"velocity": 1e-6},
    "contacts": {"count": 100, "drag_rate": 0, "track": {"correlation": "exponential"}},
    "output": {"interval": 2e-3},
    "fit": {
        "noise": NOISE,
        "after": "300 nm",
        "level": {"width": 0.1},
        "simulations": 300,
        "free": {
            **{
                key: TABLES["fit"]["free"][key]  # type: ignore[index,call-overload]
                for key in ("contacts.static_force", "contacts.delay")
            },
            "contacts.track.spread": {"from": 0.02, "to": 0.3, "prior": "logarithmic"},
            "contacts.track.length": {"from": 5e-8, "to": 2e-6, "prior": "logarithmic"},
        },
    },
}
# Tables of each case, and the springs of its records [N/m]; None is that of the tables.
CASES: dict[str, tuple[dict[str, Any], tuple[float | None, ...]]] = {
    "klein": (TABLES, (None,)),
    "levels": (LEVELS, (97.0, 160.0)),
}


def laboratory(force: np.ndarray, interval: float, rng: np.random.Generator) -> np.ndarray:
    """A force as a laboratory records it: coloured noise, digital steps, and impulses."""
    noise = Noise(NOISE, coloured=NOISE, correlation_time=20e-3, step=NOISE)
    noisy = noise.added(force, interval, rng)
    is_impulse = rng.random(len(force)) < 0.01
    return np.where(is_impulse, noisy + 20 * NOISE * rng.standard_normal(len(force)), noisy)


def experiment(number: int, options: argparse.Namespace) -> dict[str, object]:
    """One experiment: ranks of the truth, by parameter, and what the fit took."""
    case, springs = CASES[options.case]
    tables = {**case, "fit": {**case["fit"], "seed": number}}
    if options.contacts:
        tables["contacts"] = {**case["contacts"], "count": options.contacts}
    tables["fit"]["simulated_contacts"] = options.simulated
    if options.noise == "laboratory":
        del tables["fit"]["noise"]
    plan = Plan.from_dict(tables).of_traces(len(springs))
    rng = np.random.default_rng([2026, number])
    truth = rng.random(len(plan.prior))
    values = plan.prior.values(truth)
    changes, levels = plan.prior.changes(values), plan.prior.nuisances(values)
    trees = []
    for place, spring in enumerate(springs):
        config = plan.config.replace({**changes, "run.seed": 10**6 + number + 10**5 * place})
        if spring is not None:
            config = config.replace({"slider.stiffness": spring})
        level = levels.get(level_name(place, len(springs)), 1.0)
        contacts = config.contacts
        tree = mesoslip.run(
            config.replace(
                {
                    "contacts.static_force": level * contacts.static_force,
                    "contacts.stiffness": level * contacts.stiffness,
                }
            )
        )
        exact = tree["spring_force"]
        if options.noise == "laboratory":
            tree.attrs["origin"] = "measured"
            tree["spring_force"] = exact.copy(data=[laboratory(exact.values[0], 2e-3, rng)])
        else:
            tree["spring_force"] = exact + NOISE * rng.standard_normal(exact.shape)
        trees.append(tree)
    start = time.process_time()
    simulator = prepare(trees, [str(one) for one in range(len(trees))], plan)
    observed, left_out = usable_summaries(simulator)
    observed[left_out] = np.nan
    made = Simulations(simulator, expected=plan.simulations, executor=options.workers)
    row: dict[str, object] = {"experiment": number, "status": "fitted"}
    try:
        estimate = estimate_posterior(
            made, observed, plan.simulations, np.random.default_rng(number)
        )
    except RunError:
        return row | {"status": "failed"}
    draws = estimate.draws
    for place, key in enumerate(plan.prior.keys):
        row[f"rank {key}"] = float(np.mean(draws[:, place] < truth[place]))
        row[f"truth {key}"] = float(truth[place])
        row[f"deviation {key}"] = float(draws[:, place].std())
    row["seconds"] = time.process_time() - start
    return row


def keys_of(case: str) -> tuple[str, ...]:
    """The parameters of a case."""
    tables, springs = CASES[case]
    return Plan.from_dict(tables).of_traces(len(springs)).prior.keys


def fields(keys: tuple[str, ...]) -> list[str]:
    columns = [f"{what} {key}" for key in keys for what in ("rank", "truth", "deviation")]
    return ["experiment", "status", *columns, "seconds"]


def read(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def coverage(ranks: np.ndarray, part: float) -> float:
    """Part of the truths within the central interval."""
    return float(np.mean(np.abs(ranks - 0.5) <= part / 2))


def report(rows: list[dict[str, str]], keys: tuple[str, ...], picture: Path | None) -> None:
    """Tell, and draw, how uniform the ranks are."""
    from matplotlib.figure import Figure
    from scipy.stats import binom, kstest

    fitted = [row for row in rows if row["status"] == "fitted"]
    print(f"{len(rows)} experiments, {len(fitted)} fitted")
    figure = Figure(figsize=(6.5, 1.9 * ((len(keys) + 1) // 2)), layout="constrained", dpi=200)
    axes = figure.subplots((len(keys) + 1) // 2, 2).ravel()
    for key, panel in zip(keys, axes, strict=False):
        ranks = np.array([float(row[f"rank {key}"]) for row in fitted])
        deviations = np.array([float(row[f"deviation {key}"]) for row in fitted])
        p = kstest(ranks, "uniform").pvalue
        print(
            f"{key:36} KS p {p:.2f}, 50 % covers {100 * coverage(ranks, 0.5):.0f} %, "
            f"90 % covers {100 * coverage(ranks, 0.9):.0f} %, shrinkage "
            f"{1 - np.median(deviations) * np.sqrt(12):.2f}"
        )
        bins = 10
        low, high = binom.ppf([0.025, 0.975], len(ranks), 1 / bins)
        panel.axhspan(low, high, color="0.9")
        panel.hist(ranks, bins, range=(0, 1), color="0.4")
        panel.set_title(f"{key} (p = {p:.2f})", loc="left", fontsize=7)
        panel.tick_params(labelsize=7)
    if picture is not None:
        figure.supxlabel("rank of the truth in the posterior", fontsize=8)
        figure.supylabel("experiments", fontsize=8)
        figure.savefig(picture)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument("--experiments", type=int, default=0)
    parser.add_argument("--report", type=Path, default=None, metavar="PICTURE")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--noise", choices=("white", "laboratory"), default="white")
    parser.add_argument("--case", choices=tuple(CASES), default="klein")
    parser.add_argument("--contacts", type=int, default=None)
    parser.add_argument("--simulated", type=int, default=2000, metavar="CONTACTS")
    options = parser.parse_args()
    done, keys = read(options.table), keys_of(options.case)
    numbers = {int(row["experiment"]) for row in done}
    if not done:
        options.table.parent.mkdir(parents=True, exist_ok=True)
        with options.table.open("w", newline="") as file:
            csv.DictWriter(file, fields(keys)).writeheader()
    for number in range(options.experiments):
        if number in numbers:
            continue
        row = experiment(number, options)
        with options.table.open("a", newline="") as file:
            csv.DictWriter(file, fields(keys)).writerow(row)
        print(row["experiment"], row["status"], row.get("seconds"), flush=True)
    report(read(options.table), keys, options.report)


if __name__ == "__main__":
    main()
