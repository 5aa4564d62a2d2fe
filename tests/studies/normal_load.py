"""Steps and vibrations of the normal load beside their closed forms: ``docs/normal-load.png``.

Left, the ready run ``load-step`` with shorter stages: force and coefficient, with the force curve
of relaxed contacts.
Right, the ready run ``vibrating-load`` and its sweep, with the limits of fast and slow vibration.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mesoslip
import numpy as np
from mesoslip import Config

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "runs"
BLUE, GREY = "C0", "0.5"
# Duration of a stage in the picture [s].
STAGE = 0.6


def beside(axes, time, load, top):
    """The normal load on a scale of its own."""
    other = axes.twinx()
    other.plot(time, 1e6 * load, color=GREY, lw=1)
    other.set_ylabel("normal force (µN)", color=GREY)
    other.set_ylim(0, top)


def draw_steps(force, coefficient):
    """Force and coefficient in the steps of the load."""
    config = Config.load(RUNS / "load-step.toml")
    stages = [
        {"duration": STAGE, "normal_force": one.normal_force} for one in config.normal_load.stage
    ]
    config = config.replace({"run.duration": len(stages) * STAGE, "load.stage": stages})
    root = mesoslip.run(config).to_dataset().mean("realization")
    time = root["time"].values
    force.plot(time, 1e6 * root["spring_force"], color=BLUE, lw=1, label="force")
    relaxed = {"load": None, "contacts.initial": "relaxed"}
    curve = mesoslip.curve(config.replace(relaxed))
    after = (time > STAGE) & (time <= 2 * STAGE)
    moved = config.drive_speed * (time[after] - STAGE)
    steady = mesoslip.derived(config)["F_steady"].value
    new = np.interp(moved, curve["displacement"], curve["contact_force"])
    expected = "$[L_1 F_{ss} + (L_2 - L_1) F_0(X)]/L_0$"
    force.plot(time[after], 1e6 * (steady + 0.5 * new), "k--", lw=1, label=expected)
    for start in (0, 2 * STAGE):
        label = "$F_{ss} L/L_0$" if start else None
        force.plot([start, start + STAGE], 2 * [1e6 * steady], "k:", lw=1, label=label)
    force.set(xlabel="time (s)", ylabel="force (µN)", ylim=(0, 16.5))
    force.legend(loc="lower right")
    beside(force, time, root["normal_force"].values, 110)
    coefficient.plot(time, root["friction_coefficient"], color=BLUE, lw=1)
    coefficient.set(xlabel="time (s)", ylabel="friction coefficient", ylim=(0.1, 0.22))


def draw_vibration(force, mean):
    """The force in some periods, and its mean over the displacement in a period."""
    config = Config.load(RUNS / "vibrating-load.toml")
    steady = 1e6 * mesoslip.derived(config)["F_steady"].value
    root = mesoslip.run(config).to_dataset().isel(realization=0, time=slice(0, 200))
    time = 1e3 * root["time"].values
    force.plot(time, 1e6 * root["spring_force"], color=BLUE, lw=1)
    for level, style, which in ((steady, "k:", "mean"), (0.6 * steady, "k--", "minimum")):
        force.plot(time[[0, -1]], 2 * [level], style, lw=1, label=f"$F_{{ss}}$ at the {which} load")
    force.set(xlabel="time (ms)", ylabel="force (µN)", ylim=(0, 14))
    force.legend(loc="upper right")
    beside(force, time, root["normal_force"].values, 180)

    sweep = mesoslip.sweep(RUNS / "sweeps" / "vibrating-load.toml")
    stretch = config.contacts.break_stretch
    moved = config.drive_speed / sweep["load.cycle.frequency"].values / stretch
    fast = np.geomspace(0.05, 0.75, 50)
    for row, amplitude in enumerate(sweep["load.cycle.amplitude"].values):
        part = amplitude / config.normal_load.normal_force
        found = 1e6 * sweep["mean_force"].values[row, :, 0]
        (line,) = mean.plot(moved, found, "o", ms=4, label=f"A = {part:g}")
        touching = 18 * fast * (np.pi**2 - 4) / (2 * np.pi**2)
        color = line.get_color()
        mean.plot(fast, (1 - part) * steady + part * touching, "--", color=color, lw=1)
        print(
            part, *(f"{one:.3g}: {force:.4g} uN" for one, force in zip(moved, found, strict=True))
        )
    mean.axhline(steady, color="k", ls=":", lw=1)
    mean.set(xlabel="displacement in a period over the breaking stretch, $vT/x_s$", xscale="log")
    mean.set(ylabel="mean force (µN)", ylim=(0, 10.5))
    mean.legend()


def main(path: Path) -> None:
    figure, ((steps, vibration), (coefficient, mean)) = plt.subplots(
        2, 2, figsize=(9, 6.4), layout="constrained"
    )
    draw_steps(steps, coefficient)
    draw_vibration(vibration, mean)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "normal-load.png")
