"""Fits of cases whose truth is known, and of traces that the model does not describe.

Prints the tables of ``docs/fit-accuracy.md``; some minutes of a processor a case::

    python tests/studies/fit_cases.py hidden smooth rate_and_state mass
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
from mesoslip.inference.posterior import table

ROOT = Path(__file__).parents[2]
KLEIN = ROOT / "runs" / "klein.toml"
HIDDEN = [
    "slider.stiffness=140 N/m",
    "contacts.static_force=25 uN",
    "contacts.delay=1.3 ms",
    "contacts.threshold.relative_width=0.04",
    "run.seed=77",
]
FREE = {
    "contacts.static_force": {"from": "5 uN", "to": "100 uN", "prior": "logarithmic"},
    "contacts.threshold.relative_width": {"from": 0.003, "to": 0.3, "prior": "logarithmic"},
    "contacts.delay": {"from": "0.01 ms", "to": "10 ms", "prior": "logarithmic"},
}
# What a trace may tell, around the truth by factors of two and more.
ALL = {
    "contacts.static_force": (1e-5, 6e-5),
    "contacts.threshold.relative_width": (0.01, 0.15),
    "contacts.delay": (3e-4, 4e-3),
    "slider.stiffness": (60.0, 300.0),
    "slider.mass": (7e-4, 3e-3),
    "slider.damping_ratio": (0.05, 0.8),
    "contacts.stiffness": (800.0, 5000.0),
    "contacts.back_force_ratio": (0.02, 0.4),
    "contacts.count": (1000, 9000),
    "contacts.drag_rate": (2e10, 2e13),
}
NOISE = 5e-8


def noisy(tree: Any, noise: float = NOISE, seed: int = 1) -> Any:
    """A run with noise on its force."""
    rng = np.random.default_rng(seed)
    tree["spring_force"] = tree["spring_force"] + noise * rng.standard_normal(
        tree["spring_force"].shape
    )
    return tree


def with_force(time_: np.ndarray, force: np.ndarray) -> Any:
    """A run's tree with another force."""
    config = mesoslip.Config.load(KLEIN, [f"run.duration={time_[-1]}", "contacts.count=100"])
    tree = mesoslip.run(config)
    tree["spring_force"] = tree["spring_force"].copy(data=force[None])
    return noisy(tree)


def simulated(changes: list[str], noise: float = NOISE) -> Any:
    return noisy(mesoslip.run(mesoslip.Config.load(KLEIN, changes)), noise)


def smooth() -> Any:
    """A force that rises to a constant."""
    time_ = np.arange(12001) * 1e-3
    return with_force(time_, 16e-6 * (1 - np.exp(-time_ / 0.8)))


def rate_and_state() -> Any:
    """Stick-slip of Klein's slider on a rate-and-state interface with Dieterich's ageing law.

    Spring, inertia and damping as in the model; mu = mu_0 + a ln(v/v_0) + b ln(v_0 age/L), and
    the stiffness well below (b - a)/L times the normal force, where sliding is unstable.
    """
    from scipy.integrate import solve_ivp

    mass, stiffness, drive, normal = 1.47e-3, 97.0, 1e-7, 30e-6
    damping = 0.2 * np.sqrt(stiffness / mass)
    a, b, length, reference = 0.01, 0.03, 1.5e-9, 0.6

    def friction(log_velocity: float, log_age: float) -> float:
        direct = a * (log_velocity - np.log(drive))
        return normal * (reference + direct + b * (log_age + np.log(drive / length)))

    def rates(_: float, state: np.ndarray) -> list[float]:
        spring, log_velocity, log_age = state
        velocity = np.exp(log_velocity)
        force = spring - friction(log_velocity, log_age) - mass * damping * velocity
        ageing = np.exp(-log_age) - velocity / length
        return [stiffness * (drive - velocity), force / (mass * velocity), ageing]

    time_ = np.arange(12001) * 1e-3
    # The spring is relaxed at first. Below a creep far slower than the drive it is only loaded.
    log_velocity, log_age = np.log(1e-14), 0.0
    creeping = friction(log_velocity, log_age)
    force = stiffness * drive * time_
    is_moving = force > creeping
    since = time_[is_moving] - creeping / (stiffness * drive)
    start = [creeping, log_velocity, log_age]
    solved = solve_ivp(
        rates, (0, since[-1]), start, "Radau", since, rtol=1e-6, atol=[1e-12, 1e-7, 1e-7]
    )
    force[is_moving] = solved.y[0]
    return with_force(time_, force)


CASES: dict[str, tuple[Callable[[], Any], dict[str, Any], dict[str, Any]]] = {
    "hidden": (lambda: simulated(HIDDEN), {"stiffness": 140.0}, {}),
    "hidden_quiet": (lambda: simulated(HIDDEN, NOISE / 5), {"stiffness": 140.0}, {}),
    "hidden_stiffness": (
        lambda: simulated(HIDDEN),
        {},
        {"slider.stiffness": {"from": "30 N/m", "to": "500 N/m", "prior": "logarithmic"}},
    ),
    "all": (
        lambda: simulated(HIDDEN),
        {},
        {
            key: {"from": low, "to": high, "prior": "logarithmic"}
            for key, (low, high) in ALL.items()
        },
    ),
    "klein": (lambda: simulated([]), {}, {}),
    "smooth": (smooth, {}, {}),
    "rate_and_state": (rate_and_state, {}, {}),
    "mass": (lambda: simulated(["slider.mass=2.94 g"]), {}, {}),
}


def main() -> None:
    for name in sys.argv[1:]:
        name, _, count = name.partition(":")
        make, slider, more = CASES[name]
        fit: dict[str, Any] = {"free": FREE | more}
        if count:
            fit["simulations"] = int(count)
        tables = {"base": str(KLEIN), "slider": slider, "fit": fit}
        tree = make()
        start, wall = time.process_time(), time.perf_counter()
        try:
            posterior = mesoslip.fit(tree, tables)
        except mesoslip.MesoslipError as error:
            print(f"{name}: {error}", flush=True)
            continue
        print(
            f"{name}: {posterior.attrs['simulation_count']} simulations, "
            f"{time.process_time() - start:.0f} s of processor, "
            f"{time.perf_counter() - wall:.0f} s, agreement p = "
            f"{posterior.attrs['agreement_probability']:.2g}"
        )
        for row in table(posterior):
            print(f"   {row.key:36}", *(f"{one:.4g}" for one in row.percentiles), row.verdict)
        data = posterior["parameters"].to_dataset()
        print(data["information"].to_pandas().round(2).to_string())
        print(posterior.attrs["warnings"], flush=True)


if __name__ == "__main__":
    main()
