"""Orders of convergence of the master equation over random runs, and what runs say of their errors.

Sliders of three kinds load, rest and turn; contacts slip, age, attach late and bear a back force.
Prints a table and draws the histograms of ``docs/validation.md``::

    .venv/bin/python tests/studies/me_orders.py [docs/me-orders.png]
"""

import sys
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator
from mesoslip import Config, Realization
from numpy.typing import NDArray

Array = NDArray[np.float64]

CASES = 40
FINEST = 0.03125
# Resolutions of which the errors give the order, among them the default.
RESOLUTIONS = (0.5, 0.25, 0.125)
DEFAULT = 0.25
STATIC = 18e-6
KLEIN = tomllib.loads((Path(__file__).parents[2] / "runs" / "klein.toml").read_text())
# An error that is no more than what rounding and interpolation leave.
LEAST = 1e-10


class Outcome(NamedTuple):
    """How a case converges: errors over F_s or in s, and what the run says of them."""

    label: str
    slips: int
    order: float
    rms: Array
    force_error: float
    estimated_force_error: float
    slip_time_error: float
    estimated_slip_time_error: float


def random_tables(number: int) -> tuple[str, dict[str, Any]]:
    """A configuration of a number: contacts, slider and drive as they may be."""
    random = np.random.default_rng([7, number])
    law = str(random.choice(["gaussian", "uniform", "lognormal", "weibull"]))
    width = float(np.exp(random.uniform(np.log(0.05), np.log(0.3))))
    kind = ("rigid", "prescribed", "layered")[random.choice(3, p=[0.6, 0.2, 0.2])]
    ages = random.random() < 0.3
    velocity = float(np.exp(random.uniform(np.log(1e-6), np.log(1e-5))))
    stiffness = float(np.exp(random.uniform(np.log(50), np.log(800))))
    delay = float(random.choice([0, 5e-4, 2e-3, 5e-3]))
    back_force = float(random.choice([0, 0.1, 0.4, 0.7]))
    contacts: dict[str, Any] = KLEIN["contacts"] | {
        "delay": delay,
        "back_force_ratio": back_force,
        "threshold": {"law": law, "relative_width": width},
    }
    contacts["coupling"] = "equal" if ages else str(random.choice(["equal", "scaled"]))
    contacts["initial"] = str(random.choice(["relaxed", "steady", "uniform"]))
    if ages:
        contacts["ageing"] = {
            "law": "relax",
            "time": float(random.choice([3e-3, 2e-2])),
            "young_force_ratio": float(random.uniform(0.75, 0.95)),
            "young_relative_width": min(0.25, 1.5 * width),
        }
    slider: dict[str, Any] = {"mass": 1.47e-3, "stiffness": stiffness}
    slider["damping_ratio"] = float(random.uniform(0.05, 0.4))
    loading = STATIC / stiffness / velocity
    if kind == "layered":
        slider = {"kind": kind, "mass": 1.47e-3, "stiffness": stiffness, "layers": 4}
    if kind == "prescribed":
        slider = {"kind": kind}
        loading = 3e-8 / velocity
    part = float(random.uniform(0.8, 1.6))
    stages = ((part, velocity), (0.2, 0.0), (0.5, -velocity))
    drive = {"stage": [{"duration": a * loading, "velocity": v} for a, v in stages]}
    label = f"{kind:10} {law:9} {width:.2f} {delay * 1e3:3g} ms {back_force:g}"
    label += f" {contacts['coupling']:6} {contacts['initial']:7} {'ages' if ages else '':4}"
    return label, {
        "run": {"engine": "me"},
        "contacts": contacts,
        "slider": slider,
        "drive": drive,
        "output": {"interval": (part + 0.7) * loading / 1500},
    }


def finished(tables: dict[str, Any], resolution: float) -> Realization:
    """A run at a resolution; only that at the default estimates its errors."""
    config = Config.from_dict(tables | {"run": {"engine": "me", "resolution": resolution}})
    one = Realization(config, estimates_errors=resolution == DEFAULT)
    while not one.finished:
        one.advance()
    one.close()
    return one


def outcome(number: int) -> Outcome:
    """Runs of a case at all resolutions, compared with the finest."""
    label, tables = random_tables(number)
    fine = finished(tables, FINEST)
    runs = {resolution: finished(tables, resolution) for resolution in RESOLUTIONS}
    rms = np.array([_rms(one, fine) for one in runs.values()])
    order = float(np.polyfit(np.log(RESOLUTIONS), np.log(np.maximum(rms, LEAST)), 1)[0])
    run = runs[DEFAULT]
    starts, fine_starts = run.slips[:, 1], fine.slips[:, 1]
    before = run.trace[:, 0] < min(np.min(one, initial=np.inf) for one in (starts, fine_starts))
    errors = np.abs(run.trace[before, 5] - fine.trace[before, 5]) / STATIC
    late = np.nan
    if len(starts) == len(fine_starts):
        late = float(np.max(np.abs(starts - fine_starts), initial=0.0))
    return Outcome(
        label,
        len(fine_starts),
        order if rms[0] > LEAST else np.nan,
        rms,
        float(np.max(errors)),
        run.force_error / STATIC,
        late,
        run.slip_time_error,
    )


def _rms(run: Realization, fine: Realization) -> float:
    return float(np.sqrt(np.mean((run.trace[:, 5] - fine.trace[:, 5]) ** 2))) / STATIC


def draw(outcomes: list[Outcome], path: Path) -> None:
    """Histograms of the orders, and of what runs say of their errors over what these are."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 2.8), layout="constrained")
    orders = np.array([one.order for one in outcomes])
    axes[0].hist(orders[np.isfinite(orders)], bins=np.arange(0.25, 2.76, 0.125), color="C0")
    axes[0].axvline(np.nanmedian(orders), color="0.3", linewidth=1)
    axes[0].set(xlabel="order of convergence", ylabel="runs")
    force = ratios(outcomes, "force_error")
    time = ratios(outcomes, "slip_time_error")
    edges = np.geomspace(0.01, 20, 31)
    both = [np.clip(one, edges[0], edges[-1]) for one in (force, time)]
    labels = ["force before slips", "time of slips"]
    axes[1].hist(both, bins=edges, stacked=True, label=labels, color=["C0", "C1"])
    axes[1].axvspan(0.2, 5, color="0.92", zorder=0)
    axes[1].set(xscale="log", xlabel="estimated error / error", ylabel="runs")
    for one in axes:
        one.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes[1].legend(frameon=False, loc="upper left")
    figure.savefig(path, dpi=150)


def ratios(outcomes: list[Outcome], name: str) -> Array:
    """Estimated errors over errors, where there are any."""
    pairs = [(getattr(one, f"estimated_{name}"), getattr(one, name)) for one in outcomes]
    return np.array([estimate / error for estimate, error in pairs if error > LEAST])


def main() -> None:
    """The table, its summary, and the picture."""
    outcomes = []
    for number in range(CASES):
        one = outcome(number)
        outcomes.append(one)
        print(
            f"{number:2} {one.label} slips {one.slips:2} order {one.order:5.2f} rms "
            + " ".join(f"{value:.1e}" for value in one.rms)
            + f"  force {one.force_error:.1e} said {one.estimated_force_error:.1e}"
            + f"  time {one.slip_time_error:.1e} s said {one.estimated_slip_time_error:.1e} s",
            flush=True,
        )
    orders = np.array([one.order for one in outcomes if np.isfinite(one.order)])
    print(
        f"{len(orders)} orders: median {np.median(orders):.2f}, least {np.min(orders):.2f}, "
        f"{np.count_nonzero(orders < 1.5)} below 1.5"
    )
    low = [one for one in outcomes if one.order < 1.5]
    for name in ("force_error", "slip_time_error"):
        ratio = ratios(low, name)
        within = np.count_nonzero((ratio > 0.2) & (ratio < 5))
        print(f"of order below 1.5: {name}: {within} of {len(ratio)} within a factor of 5")
    for name in ("force_error", "slip_time_error"):
        ratio = ratios(outcomes, name)
        within = np.count_nonzero((ratio > 0.2) & (ratio < 5))
        print(
            f"{name}: {within} of {len(ratio)} within a factor of 5, median {np.median(ratio):.2f}"
        )
    if len(sys.argv) > 1:
        draw(outcomes, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
