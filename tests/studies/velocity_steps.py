"""Velocity steps of activated, ageing contacts over four decades: ``docs/velocity-steps.png``.

Steps up and down between neighbouring decades, of contacts that weaken and of contacts that
strengthen with velocity. It prints what `mesoslip.response` finds beside the theory, in F_s and nm.
Laws are fitted for a rigid interface, and with the stiffness of the contacts in series::

    .venv/bin/python tests/studies/velocity_steps.py [figure]
"""

import math
import sys
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
import xarray as xr
from matplotlib import pyplot as plt
from mesoslip import Config
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.response.dataset import response_of, rows_of
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.contacts.thermal_sliding import RateAndStateTheory
from mesoslip.theory.steady_sliding import sliding_of

ROOT = Path(__file__).parents[2]
# f_T/f_s, with a growth of 0.05.
RATIOS = (0.02, 0.08)
VELOCITIES = 10.0 ** np.arange(-9, -4)
# Displacement of a stage, and of a sample after a step up [m].
STAGE, SAMPLE = 90e-9, 0.025e-9
COUNT, REALIZATIONS = 10_000, 4
COLOURS = ("#0072b2", "#009e73", "#e69f00", "#d55e00")


def stepped(ratio: float, velocity: float) -> Config:
    """A tenfold step up from a velocity and back."""
    config = Config.load(ROOT / "runs" / "velocity-step.toml")
    stages = [{"velocity": one, "displacement": STAGE} for one in velocity * np.array([1, 10, 1])]
    return config.replace(
        {
            "run.duration": 2.1 * STAGE / velocity,
            "run.realizations": REALIZATIONS,
            "contacts.count": COUNT,
            "contacts.thermal.force_ratio": ratio,
            "drive.stage": stages,
            "output.interval": SAMPLE / (10 * velocity),
            "output.slip_interval": None,
        }
    )


def theory(config: Config, velocity: float) -> RateAndStateTheory:
    """a, b and D_c by the formulas."""
    return sliding_of(config, velocity).rate_and_state


def report(config: Config, tree: xr.DataTree, velocity: float) -> dict[str, Any]:
    """Print the response to steps between a velocity and ten times that; the ageing law fitted
    with the stiffness of the contacts."""
    static, middle = config.contacts.static_force, math.sqrt(10) * velocity
    found = mesoslip.response(tree)
    known = theory(config, middle)
    forces = [
        contact_theory(config).steady_force(one) / static for one in (velocity, 10 * velocity)
    ]
    print(f"{velocity:.0e} m/s, f_T = {config.contacts.thermal.force_ratio} f_s")
    for row, force in zip(rows_of(found, "steady"), (*forces, forces[0]), strict=True):
        print(
            f"  F {row['steady_force'] / static:.5f} ± {row['steady_force_error'] / static:.5f}, "
            f"theory {force:.5f}"
        )
    print(
        f"  theory at the middle: a {known.a / static:.5f}, b {known.b / static:.5f}, "
        f"a-b {(known.a - known.b) / static:.5f}, D_c {known.slip_distance * 1e9:.3f}; "
        f"a-b of the forces {(forces[1] - forces[0]) / math.log(10):.5f}"
    )
    for row in rows_of(found, "steps"):
        print(
            f"  step: a {row['apparent_a'] / static:.5f}, "
            f"a-b {row['rate_dependence'] / static:.5f} ± "
            f"{row['rate_dependence_error'] / static:.5f}, "
            f"area {row['integral_displacement'] * 1e9:.3f} ± "
            f"{row['integral_displacement_error'] * 1e9:.3f}"
        )
    elastic = Experiment(tree, "elastic contacts").with_stiffness(config.contacts.stiffness)
    for name, fitted in (("rigid", found), ("N k", response_of([elastic]))):
        fits = rows_of(fitted, "rate_and_state")
        for row in fits:
            print(
                f"  {name}, {row['law']}: "
                f"a {row['a'] / static:.5f} ± {row['a_error'] / static:.5f}, "
                f"b {row['b'] / static:.5f} ± {row['b_error'] / static:.5f}, "
                f"D_c {row['slip_distance'] * 1e9:.3f} ± {row['slip_distance_error'] * 1e9:.3f}, "
                f"misfit {row['relative_misfit']:.3f}, described {row['is_described']}",
                flush=True,
            )
    return next(row for row in fits if row["law"] == "ageing")


def main(target: Path) -> None:
    figure, panels = plt.subplots(3, 2, figsize=(8, 8.6))
    for column, ratio in enumerate(RATIOS):
        fits = []
        for velocity, colour in zip(VELOCITIES[:-1], COLOURS, strict=True):
            config = stepped(ratio, velocity)
            static = config.contacts.static_force
            tree = mesoslip.run(config)
            fits.append(report(config, tree, velocity))
            force = tree["spring_force"].values.mean(axis=0) / static
            moved = tree["displacement"].values[0] * 1e9
            level = contact_theory(config).steady_force(velocity) / static
            for start, sign in ((STAGE * 1e9, 1), (2 * STAGE * 1e9, -1)):
                inside = (moved > start - 2) & (moved < start + 14)
                label = f"{velocity * 1e6:g} to {velocity * 1e7:g} µm/s" if sign > 0 else None
                before = (
                    level
                    if sign > 0
                    else contact_theory(config).steady_force(10 * velocity) / static
                )
                panels[0, column].plot(
                    moved[inside] - start,
                    force[inside] - before,
                    color=colour,
                    linewidth=0.8,
                    label=label,
                )
        _draw_parameters(panels[1:, column], config, fits)
        panels[0, column].set_title(f"$f_T$ = {ratio:g} $f_s$, growth 0.05", loc="left")
        panels[0, column].set_xlabel("displacement after the step (nm)")
        panels[2, column].set_xlabel("velocity (µm/s)")
    panels[0, 0].set_ylabel("change of the force over $F_s$")
    panels[0, 1].legend(fontsize=7, frameon=False)
    panels[1, 0].set_ylabel("a, b over $F_s$")
    panels[1, 0].legend(fontsize=7, frameon=False)
    panels[2, 0].set_ylabel("$D_c$ (nm)")
    panels[2, 0].legend(fontsize=7, frameon=False)
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(target, dpi=130)


def _draw_parameters(panels: Any, config: Config, fits: list[dict[str, Any]]) -> None:
    """Draw a, b and D_c by the formulas, and those of the fits."""
    static = config.contacts.static_force
    grid = np.geomspace(VELOCITIES[0], VELOCITIES[-1], 13)
    known = [theory(config, one) for one in grid]
    middle = math.sqrt(10) * VELOCITIES[:-1] * 1e6
    for name, row, unit, colour in (
        ("a", 0, static, COLOURS[0]),
        ("b", 0, static, COLOURS[3]),
        ("slip_distance", 1, 1e-9, "black"),
    ):
        axes, label = panels[row], "$D_c$" if row else name
        curve = [getattr(one, name) / unit for one in known]
        axes.plot(grid * 1e6, curve, color=colour, label=f"{label}, formula")
        axes.errorbar(
            middle,
            [one[name] / unit for one in fits],
            [one[f"{name}_error"] / unit for one in fits],
            fmt="o",
            markersize=4,
            color=colour,
            label=f"{label}, fit of the ageing law",
        )
    for axes in panels:
        axes.set_xscale("log")
        axes.set_ylim(bottom=0)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "velocity-steps.png")
