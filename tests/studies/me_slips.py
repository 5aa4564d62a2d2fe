"""Errors of the master equation in random runs with slips, what they cost, and what runs say.

Rigid sliders pulled at a constant velocity, five threshold laws of widths from 0.02 to 0.3, delay,
and back forces up to 0.8. Errors are differences from a run with steps an eighth of the default::

    .venv/bin/python tests/studies/me_slips.py errors.json [first case] [number of cases]
    .venv/bin/python tests/studies/me_slips.py docs/me-cost.png before.json after.json
"""

from __future__ import annotations

import json
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from mesoslip import Config, Realization
from mesoslip.simulation.audit import step_errors
from numpy.typing import NDArray

Array = NDArray[np.float64]

CASES = 30
FINEST, DEFAULT = 0.03125, 0.25
# Resolutions, each with twice the one after it: the pair of which a run states its errors.
RESOLUTIONS = (1.0, 0.5, 0.25, 0.125)
# Processor time of a run at the default beyond which the case is left out [s].
MAX_SECONDS = 0.12
# Cases in the picture.
LINES = 20
STATIC = 18e-6
KLEIN = tomllib.loads((Path(__file__).parents[2] / "runs" / "klein.toml").read_text())


def random_tables(number: int) -> tuple[str, dict[str, Any]]:
    """A configuration of a number."""
    random = np.random.default_rng([67, number])
    laws = ["gaussian", "uniform", "lognormal", "weibull", "exponential"]
    law = str(random.choice(laws, p=[0.3, 0.2, 0.2, 0.2, 0.1]))
    width = float(np.exp(random.uniform(np.log(0.02), np.log(0.3))))
    velocity = float(np.exp(random.uniform(np.log(1e-6), np.log(1e-5))))
    stiffness = float(np.exp(random.uniform(np.log(40), np.log(500))))
    contacts: dict[str, Any] = KLEIN["contacts"] | {
        "delay": float(np.exp(random.uniform(np.log(2e-4), np.log(5e-3)))),
        "back_force_ratio": float(random.uniform(0, 0.8)),
        "threshold": {"law": law, "relative_width": min(width, 0.15 if law == laws[4] else 0.3)},
        "coupling": str(random.choice(["equal", "scaled"])),
        "initial": str(random.choice(["relaxed", "uniform", "steady"], p=[0.5, 0.3, 0.2])),
    }
    duration = float(random.uniform(1.2, 2.2)) * STATIC / stiffness / velocity
    label = f"{law:11} {contacts['threshold']['relative_width']:.3f} K {stiffness:3.0f} N/m, "
    label += f"{1e3 * contacts['delay']:.2f} ms, f_b {contacts['back_force_ratio']:.2f} "
    label += f"{contacts['coupling']:6} "
    return label + f"{contacts['initial']:7}", {
        "run": {"engine": "me", "duration": duration},
        "contacts": contacts,
        "slider": {
            "mass": 1.47e-3,
            "stiffness": stiffness,
            "damping_ratio": float(random.uniform(0.05, 0.6)),
        },
        "drive": {"velocity": velocity},
        "output": {"interval": duration / 2000},
    }


def finished(tables: dict[str, Any], resolution: float) -> tuple[Realization, float]:
    """A run at a resolution, and its processor time [s]."""
    config = Config.from_dict(tables | {"run": tables["run"] | {"resolution": resolution}})
    start = time.process_time()
    one = Realization(config, estimates_errors=False)
    while not one.finished:
        one.advance()
    one.close()
    return one, time.process_time() - start


def outcome(number: int) -> dict[str, Any] | None:
    """Times, errors and stated errors of a case by resolution; None without slips."""
    label, tables = random_tables(number)
    run, seconds = finished(tables, DEFAULT)
    if not len(run.slips) or seconds > MAX_SECONDS:
        return None
    runs = {one: finished(tables, one) for one in RESOLUTIONS}
    fine = finished(tables, FINEST)[0]
    result: dict[str, Any] = {"number": number, "label": label, "slips": len(fine.slips)}
    for resolution, (run, seconds) in runs.items():
        # The "estimate" of the difference from the finest run is a third of it.
        errors = step_errors(run.trace, run.slips, fine.trace, fine.slips)
        one = {"seconds": seconds, "force": 3 * errors.force, "time": 3 * errors.slip_time}
        if 2 * resolution in runs:
            coarse = runs[2 * resolution][0]
            stated = step_errors(run.trace, run.slips, coarse.trace, coarse.slips)
            one |= {"stated_force": stated.force, "stated_time": stated.slip_time}
        result[str(resolution)] = one
    return result


def values(outcomes: list[dict[str, Any]], resolution: float, name: str) -> Array:
    """A number of all cases."""
    return np.array([one[str(resolution)][name] for one in outcomes])


def report(outcomes: list[dict[str, Any]]) -> None:
    """Print how often stated errors are true, and the orders."""
    for resolution in RESOLUTIONS[1:]:
        for name in ("force", "time"):
            error = values(outcomes, resolution, name)
            ratio = values(outcomes, resolution, f"stated_{name}") / error
            order = np.log2(values(outcomes, 2 * resolution, name) / error)
            print(
                f"{resolution} {name}: {np.sum((ratio >= 1 / 3) & (ratio <= 3))} of {len(ratio)} "
                f"within a factor of 3, {np.sum(ratio < 1 / 3)} too small, median "
                f"{np.median(ratio):.2f}, order {np.median(order):.2f}, geometric mean "
                f"{np.exp(np.mean(np.log(error))):.2e}"
            )


def draw(path: Path, files: list[Path]) -> None:
    """Errors over the time that a run takes: a line a case, and their medians."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0), layout="constrained", sharex=True)
    colors = ["0.55", "C0"][-len(files) :]
    labels = ["before", "now"][-len(files) :]
    for file, color, label in zip(files, colors, labels, strict=True):
        outcomes = json.loads(file.read_text())[:LINES]
        seconds = np.array([values(outcomes, one, "seconds") for one in RESOLUTIONS])
        for one, name, unit in zip(axes, ("force", "time"), (STATIC, 1e-6), strict=True):
            errors = np.array([values(outcomes, each, name) for each in RESOLUTIONS]) / unit
            one.plot(seconds, errors, color=color, linewidth=0.5, alpha=0.6)
            middle = np.median(seconds, axis=1), np.median(errors, axis=1)
            one.plot(*middle, "o-", color=color, linewidth=2, markersize=4, label=label)
    for one, name in zip(axes, ("force before slips / $F_s$", "time of slips (µs)"), strict=True):
        one.set(xscale="log", yscale="log", xlabel="processor time (s)", ylabel=f"error: {name}")
    axes[0].legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, or draw what was measured."""
    path, *others = sys.argv[1:]
    if path.endswith(".png"):
        draw(Path(path), [Path(one) for one in others])
        return
    first, count = (int(one) for one in (*others, "0", str(CASES))[:2])
    outcomes: list[dict[str, Any]] = []
    while len(outcomes) < count:
        one = outcome(first)
        first += 1
        if one is None:
            continue
        outcomes.append(one)
        default = one[str(DEFAULT)]
        print(
            f"{one['number']:3} {one['label']} slips {one['slips']} force "
            f"{default['force'] / STATIC:.1e} said {default['stated_force'] / STATIC:.1e}, "
            f"time {default['time']:.1e} s said {default['stated_time']:.1e} s",
            flush=True,
        )
    report(outcomes)
    Path(path).write_text(json.dumps(outcomes))


if __name__ == "__main__":
    main()
