"""Contacts that age, against formulas: restart peaks, velocity steps, steady forces.

Three tables, which stand in ``docs/ageing.md``::

    .venv/bin/python tests/studies/ageing.py holds
    .venv/bin/python tests/studies/ageing.py steps
    .venv/bin/python tests/studies/ageing.py steady
"""

import math
import sys
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
from mesoslip import Config
from mesoslip.theory.contacts import contact_theory
from numpy.typing import NDArray

Array = NDArray[np.float64]

RUNS = Path(__file__).parents[2] / "runs"
HOLDS = (0.1, 1.0, 10.0, 100.0, 1000.0)
VELOCITY = 1e-6


def held_peaks(growth: float, width: float, engine: str) -> tuple[Config, Array]:
    """A run of slide, hold, slide, and its restart peaks over the static force."""
    config = Config.load(
        RUNS / "slide-hold-slide.toml",
        [
            f"run.engine={engine}",
            f"contacts.ageing.growth={growth}",
            f"contacts.threshold.relative_width={width}",
            "contacts.thermal=none",
            "contacts.count=50000",
            "run.realizations=1",
            "output.interval=50 ms",
        ],
    )
    stages = mesoslip.run(config, executor=1)["stages"].to_dataset()
    restarts = np.isin(stages["stage_number"], np.arange(2, 2 * len(HOLDS) + 1, 2))
    return config, stages["max_force"].values[restarts] / config.contacts.static_force


def per_decade(peaks: Array) -> float:
    """Slope of the peaks over log10 of the hold time."""
    return float(np.polyfit(np.log10(HOLDS), peaks, 1)[0])


def compare_holds() -> None:
    for width in (0.1, 0.2):
        for growth in (0.005, 0.02, 0.05):
            slopes = []
            for engine in ("me", "eq"):
                config, peaks = held_peaks(growth, width, engine)
                slopes.append(per_decade(peaks))
            expected = np.array(
                [contact_theory(config).restart_peak(VELOCITY, hold) for hold in HOLDS]
            )
            formula = per_decade(expected / config.contacts.static_force)
            print(
                f"width {width}, growth {growth}: formula {formula:.5f}, me {slopes[0]:.5f}, "
                f"eq {slopes[1]:.5f}, growth ln 10 {growth * math.log(10):.5f}",
                flush=True,
            )


def first_order(width: float, back: float, factor: float) -> tuple[float, float]:
    """Of a velocity step by a factor: fall of the steady force over growth times ln(factor), and
    the area between force and steady force over that fall, in mean breaking stretches.

    To first order in the growth; of a gaussian law. Derived in ``docs/ageing.md``.
    """
    point, weight = np.polynomial.hermite_e.hermegauss(40)
    weight = weight / weight.sum()
    u = 1 + width * point
    life = u - back
    mean, second, third = (float(weight @ life**power) for power in (1, 2, 3))
    ratio = 1 / factor
    # Mean of 1 - c(q), of the part of its change that a threshold still lacks.
    q, share = np.polynomial.legendre.leggauss(60)
    late = 1 - np.log1p((ratio - 1) * (1 + q) / 2) / math.log(ratio)
    lack = float(share @ late) / 2
    fall = float(weight @ (u * life)) / mean - second / (2 * mean**2)
    area = (
        lack * float(weight @ (u * life**2)) / mean
        - lack * float(weight @ (u * life)) * second / (2 * mean**2)
        - (third / (3 * mean**2) - second**2 / (4 * mean**3))
    )
    return fall, area / fall


def compare_steps() -> None:
    for width in (0.1, 0.2):
        for growth in (0.01, 0.05):
            for factor in (2.0, 0.1, 10.0):
                # Between them 0.3 um/s is the geometric mean.
                before = 3e-7 / math.sqrt(factor)
                after = before * factor
                way = 40 * 9e-9
                stages: list[dict[str, Any]] = [
                    {"duration": way / velocity, "velocity": velocity}
                    for velocity in (before, after)
                ]
                tables = Config.load(RUNS / "velocity-step.toml").to_dict()
                tables["drive"] = {"stage": stages}
                tables["run"] |= {
                    "engine": "me",
                    "realizations": 1,
                    "resolution": 0.1,
                    "duration": sum(one["duration"] for one in stages),
                }
                tables["output"] = {"interval": 0.02 * 9e-9 / max(before, after)}
                tables["contacts"] |= {"delay": 0.0, "back_force_ratio": 0.1}
                del tables["contacts"]["thermal"]
                tables["contacts"]["threshold"]["relative_width"] = width
                tables["contacts"]["ageing"]["growth"] = growth
                config = Config.from_dict(tables)
                tree = mesoslip.run(config)
                time, force = tree["time"].values, tree["contact_force"].values[0]
                static = config.contacts.static_force
                old, new = (contact_theory(config).steady_force(one) for one in (before, after))
                later = time > stages[0]["duration"]
                way_after = (time[later] - stages[0]["duration"]) * after
                area = np.trapezoid(force[later] - new, way_after) / (old - new)
                fall, expected = first_order(width, 0.1, factor)
                # Thresholds have grown by the time at which contacts break.
                assert config.contacts.ageing is not None
                life = (1 - 0.1) * 9e-9 / 3e-7
                expected *= 1 + growth * math.log1p(life / config.contacts.ageing.time)
                rate = (old - new) / static / math.log(factor)
                rest = (force[-1] - new) / (old - new)
                print(
                    f"width {width}, growth {growth}, factor {factor}: (b - a)/growth "
                    f"{rate / growth:.4f}, formula {fall:.4f}; D_c {area / 9e-9:.4f} x^, "
                    f"formula {expected:.4f}; left at the end {rest:.1e}",
                    flush=True,
                )


def compare_steady() -> None:
    for law, width in (("gaussian", 0.1), ("uniform", 0.2), ("weibull", 0.15)):
        for velocity in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4):
            period = 9e-9 / velocity
            changes = {
                "drive.velocity": velocity,
                "slider.kind": "'prescribed'",
                "run.seed": 7,
                "contacts.coupling": "'equal'",
                "contacts.initial": "'steady'",
                "contacts.delay": 0,
                "contacts.drag_rate": 0,
                "contacts.count": 1000,
                "contacts.threshold.law": f"'{law}'",
                "contacts.threshold.relative_width": width,
                "contacts.ageing.law": "'relax'",
                "contacts.ageing.time": 0.01,
                "contacts.ageing.young_force_ratio": 0.5,
                "contacts.ageing.young_relative_width": 0.3,
            }
            own = [f"{key}={value}" for key, value in changes.items()]
            many = [
                f"run.duration={90 * period}",
                f"output.interval={0.01 * period}",
                f"output.slip_interval={0.01 * period}",
            ]
            infinite = [
                f"run.duration={25 * period}",
                f"output.interval={0.003 * period}",
                f"output.slip_interval={0.003 * period}",
                "run.engine=me",
                f"run.resolution={0.05 if law == 'gaussian' else 0.1}",
            ]
            config = Config.load(RUNS / "klein.toml", own + many)
            static = config.contacts.static_force
            force = mesoslip.run(config, executor=1)["contact_force"].values[0][1000:9000] / static
            blocks = force.reshape(20, -1).mean(axis=1)
            error = blocks.std(ddof=1) / math.sqrt(20)
            tree = mesoslip.run(Config.load(RUNS / "klein.toml", own + infinite), executor=1)
            limit = tree["contact_force"].values[0][-2000:].mean() / static
            expected = contact_theory(config).steady_force(velocity) / static
            print(
                f"{law} {width}, {1e6 * velocity:g} um/s: integral {expected:.7f}, me {limit:.7f}, "
                f"eq {blocks.mean():.4f} +- {error:.4f}",
                flush=True,
            )


if __name__ == "__main__":
    {"holds": compare_holds, "steps": compare_steps, "steady": compare_steady}[sys.argv[1]]()
