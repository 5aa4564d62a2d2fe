"""Is the linear stability of steady sliding that of the master equation's engine?

Three comparisons, whose numbers stand in ``docs/steady-sliding.md``::

    .venv/bin/python tests/studies/steady_sliding.py response      # of a shaken slider
    .venv/bin/python tests/studies/steady_sliding.py growth        # of a rigid slider's motion
    .venv/bin/python tests/studies/steady_sliding.py random        # with exponential delays
    .venv/bin/python tests/studies/steady_sliding.py thermal       # with temperature
    .venv/bin/python tests/studies/steady_sliding.py ageing        # of contacts that age
    .venv/bin/python tests/studies/steady_sliding.py map [figure]  # the boundary, and runs
"""

import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
from mesoslip import Config, SteadySliding
from mesoslip.theory.linear_stability import DEPHASED_WIDTH
from mesoslip.theory.steady_sliding import sliding_of
from numpy.typing import NDArray

Array = NDArray[np.float64]

KLEIN = tomllib.loads((Path(__file__).parents[2] / "runs" / "klein.toml").read_text())
STATIC_FORCE = 18e-6
MASS = 1.47e-3
# Velocities of the drive in a period, and in a slow ramp.
STEPS, RAMP_STEPS = 48, 120


def tables(**changes: dict[str, Any]) -> dict[str, Any]:
    """Klein's case with broad thresholds, so that contacts forget soon."""
    whole: dict[str, Any] = {
        "run": {"engine": "me", "resolution": 0.1},
        "slider": {"mass": MASS, "stiffness": 97.0, "damping_ratio": 0.2},
        "contacts": {
            **KLEIN["contacts"],
            "initial": "steady",
            "threshold": {"law": "gaussian", "relative_width": 0.2},
        },
    }
    for name, table in changes.items():
        whole[name] = {**whole.get(name, {}), **table}
    return whole


def shaken_response(
    velocity: float,
    frequency: float,
    amplitude: float,
    settle: float,
    periods: int = 20,
    **changes: Any,
) -> complex:
    """Force over displacement at a frequency [1/s], of a slider shaken by an amplitude [m]."""
    period = 2 * math.pi / frequency
    step = period / STEPS
    count = (periods + math.ceil(settle / period)) * STEPS
    shaken = amplitude * np.cos(frequency * step * np.arange(count + 1))
    stages = [
        {"duration": step, "velocity": float(one)} for one in velocity + np.diff(shaken) / step
    ]
    config = tables(**changes, output={"interval": step / 2})
    config |= {"slider": {"kind": "prescribed"}, "drive": {"stage": stages}}
    config["run"]["duration"] = count * step
    tree = mesoslip.run(config)
    time, force = tree["time"].values, tree["contact_force"].values[0]
    # Between the steps of velocity, at which the drag jumps.
    chosen = (np.arange(len(time)) % 2 == 1) & (time > time[-1] - periods * period)
    moved = tree["displacement"].values[0] - velocity * time
    angle = frequency * time[chosen]
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle), angle], axis=-1)
    parts = [np.linalg.lstsq(basis, one[chosen], rcond=None)[0] for one in (force, moved)]
    answer, cause = (complex(one[0], -one[1]) for one in parts)
    return answer / cause


def compare_responses() -> None:
    cases: list[tuple[str, dict[str, Any]]] = [
        ("scaled", {}),
        ("equal, strong drag, 2 ms", {"coupling": "equal", "drag_rate": 2e14, "delay": 2e-3}),
        ("no back force", {"back_force_ratio": 0.0}),
    ]
    velocity = 1e-6
    for name, contacts in cases:
        changes = {"contacts": contacts}
        config = Config.from_dict(
            {**tables(**changes), "drive": {"velocity": velocity}}
            | {"run": {"engine": "me", "duration": 1.0}}
        )
        for frequency in (100.0, 400.0, 700.0, 1500.0, 4000.0):
            expected = complex(SteadySliding(config).response(frequency))
            found = shaken_response(velocity, frequency, 7e-11, 0.3, **changes)
            print(
                f"{name:26} {frequency:6.0f} 1/s  theory {expected:.1f}  engine {found:.1f} N/m"
                f"  difference {100 * abs(found / expected - 1):.2f} %",
                flush=True,
            )


def measured_growth(config: Config, start: float) -> tuple[float, float]:
    """Growth rate and frequency of the oscillation after a time [1/s], while it is small."""
    tree = mesoslip.run(config)
    time, velocity = tree["time"].values, tree["velocity"].values[0]
    steady = config.drive_parts[-1].end_velocity
    inside = time > start
    time, shaken = time[inside], velocity[inside] / steady - 1
    turns = np.flatnonzero((shaken[1:-1] - shaken[:-2]) * (shaken[2:] - shaken[1:-1]) < 0) + 1
    # One extreme for each half of a period at least, above what the engine resolves.
    size = np.abs(shaken[turns])
    first = int(np.argmax(size < 0.05))
    turns, size = turns[first:], size[first:]
    linear = (size > 2e-4) & (size < 0.05)
    end = int(np.argmin(linear)) if not linear.all() else len(linear)
    turns, size = turns[:end], size[:end]
    growth = np.polyfit(time[turns], np.log(size), 1)[0]
    found = math.pi * (len(turns) - 1) / (time[turns[-1]] - time[turns[0]])
    return float(growth), found


def compare_growth() -> None:
    """From a velocity of the drive at which sliding is stable, slowly to another one."""
    for stiffness, delay, begin, velocity in [
        (97.0, 5e-5, 60e-6, 10e-6),
        (97.0, 1e-4, 60e-6, 30e-6),
        (97.0, 1e-4, 60e-6, 20e-6),
        (97.0, 1e-4, 60e-6, 15e-6),
        (97.0, 3e-4, 80e-6, 50e-6),
        (97.0, 3e-4, 80e-6, 40e-6),
        (97.0, 3e-4, 80e-6, 30e-6),
        (97.0, 1e-3, 80e-6, 40e-6),
        (400.0, 1e-4, 40e-6, 10e-6),
        (400.0, 3e-4, 40e-6, 20e-6),
        (400.0, 3e-4, 40e-6, 12e-6),
        (400.0, 3e-4, 40e-6, 10e-6),
        (400.0, 1e-3, 40e-6, 20e-6),
        (1600.0, 3e-4, 20e-6, 6e-6),
        (1600.0, 3e-4, 20e-6, 3e-6),
    ]:
        print_growth(stiffness, delay, begin, velocity)


def compare_growth_with_random_delays() -> None:
    """The same with delays from the exponential law."""
    for delay, velocity in [(1e-4, 30e-6), (3e-4, 60e-6), (3e-4, 30e-6)]:
        print_growth(97.0, delay, 100e-6, velocity, delay_law="exponential")


def compare_growth_with_temperature() -> None:
    """The same with thermally activated breaking, and delays of both laws."""
    for delay_law, ratio, stiffness, delay, begin, velocity in [
        ("fixed", 0.01, 97.0, 1e-4, 60e-6, 20e-6),
        ("fixed", 0.03, 97.0, 1e-4, 60e-6, 10e-6),
        ("fixed", 0.03, 97.0, 1e-4, 60e-6, 30e-6),
        ("fixed", 0.03, 97.0, 3e-4, 60e-6, 20e-6),
        ("fixed", 0.1, 97.0, 1e-4, 60e-6, 10e-6),
        ("fixed", 0.1, 97.0, 3e-4, 60e-6, 20e-6),
        ("fixed", 0.1, 97.0, 1e-3, 60e-6, 30e-6),
        ("fixed", 0.1, 400.0, 3e-4, 60e-6, 10e-6),
        ("exponential", 0.03, 97.0, 1e-4, 60e-6, 10e-6),
        ("exponential", 0.1, 97.0, 3e-4, 60e-6, 20e-6),
        ("exponential", 0.1, 97.0, 3e-4, 60e-6, 40e-6),
    ]:
        print(f"{delay_law}, f_T = {ratio:g} f_s: ", end="")
        thermal = {"rate": 1e4, "force_ratio": ratio}
        contacts = {"coupling": "equal", "delay_law": delay_law, "thermal": thermal}
        print_growth(stiffness, delay, begin, velocity, **contacts)


def compare_growth_with_ageing() -> None:
    """The same for contacts that age, without temperature."""
    log = {"law": "log", "time": 1e-4, "growth": 0.02}
    relax = {
        "law": "relax",
        "time": 1e-3,
        "young_force_ratio": 0.9,
        "young_relative_width": 0.25,
    }
    for ageing, delay, velocity in [
        (log, 0.0, 40e-6),
        (log, 0.0, 20e-6),
        (log, 1e-4, 40e-6),
        (relax, 0.0, 40e-6),
        (relax, 0.0, 20e-6),
        (relax, 1e-4, 40e-6),
    ]:
        print(f"{ageing['law']}: ", end="")
        contacts = {"coupling": "equal", "ageing": ageing}
        print_growth(97.0, delay, 100e-6, velocity, **contacts)


def print_growth(
    stiffness: float, delay: float, begin: float, velocity: float, **contacts: Any
) -> None:
    """Growth by theory and by the engine, from a velocity [m/s] slowly to another one."""
    changes = {"slider": {"stiffness": stiffness}, "contacts": {"delay": delay, **contacts}}
    alone = Config.from_dict(
        {**tables(**changes, run={"duration": 1.0}), "drive": {"velocity": velocity}}
    )
    root = sliding_of(alone).leading_root
    assert root is not None
    ramp = np.linspace(begin, velocity, RAMP_STEPS)
    stages = [{"duration": 0.5, "velocity": begin}]
    stages += [{"duration": 0.01, "velocity": float(one)} for one in ramp]
    last = {"duration": min(2.0, 12 / abs(root.real)), "velocity": velocity}
    started = sum(float(one["duration"]) for one in stages)
    config = Config.from_dict(
        {
            **tables(**changes, run={"duration": started + last["duration"], "resolution": 0.25}),
            "drive": {"stage": [*stages, last]},
            "output": {"interval": 2 * math.pi / root.imag / 50},
        }
    )
    growth, frequency = measured_growth(config, started)
    print(
        f"K {stiffness:6.0f} N/m, delay {1e3 * delay:.2f} ms, {1e6 * velocity:4.1f} um/s: "
        f"growth {root.real:7.2f}, engine {growth:7.2f} 1/s; "
        f"frequency {root.imag:7.2f}, engine {frequency:7.2f} 1/s",
        flush=True,
    )


# Of the map: velocities of its panels, delays and stiffnesses of runs, and of the theory.
VELOCITIES = (0.1e-6, 3e-6)
WIDTH = 0.05
DELAYS, STIFFNESSES = np.geomspace(3e-5, 1e-2, 10), np.geomspace(20.0, 4000.0, 10)
FINE_DELAYS, FINE_STIFFNESSES = np.geomspace(2e-5, 1.5e-2, 22), np.geomspace(15.0, 6000.0, 20)
COUNT = 1000
MARKERS = ("o", "s", "D", "x")
COLOURS = ("tab:green", "tab:red", "tab:orange", "black")


def at(velocity: float, delay: float, stiffness: float) -> Config:
    """A run of the map, from a relaxed start."""
    loading = STATIC_FORCE / stiffness / velocity
    period = 2 * math.pi * math.sqrt(MASS / stiffness)
    duration = 14 * loading + 80 * period + 40 * 9e-9 / velocity
    return Config.from_dict(
        {
            **tables(
                slider={"stiffness": stiffness},
                contacts={
                    "count": COUNT,
                    "delay": delay,
                    "initial": "relaxed",
                    "threshold": {"relative_width": WIDTH},
                },
                output={"interval": duration / 10000},
            ),
            "run": {"duration": duration},
            "drive": {"velocity": velocity},
        }
    )


def draw_map(file: str) -> None:
    """The boundary of stability in delay and stiffness, and what runs do."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(VELOCITIES), figsize=(12, 5), layout="constrained")
    for velocity, panel in zip(VELOCITIES, axes, strict=True):
        for width, style in ((WIDTH, "solid"), (DEPHASED_WIDTH, "dashed")):
            growth = np.array(
                [
                    [
                        SteadySliding(
                            at(velocity, delay, stiffness), relative_width=width
                        ).growth_rate
                        for delay in FINE_DELAYS
                    ]
                    for stiffness in FINE_STIFFNESSES
                ]
            )
            panel.contour(
                *(1e3 * FINE_DELAYS, FINE_STIFFNESSES, growth, [0]),
                colors=["tab:red"],
                linestyles=style,
            )
            if width == WIDTH:
                panel.contourf(
                    *(1e3 * FINE_DELAYS, FINE_STIFFNESSES, growth, [0, 1e9]),
                    colors=["tab:red"],
                    alpha=0.15,
                )
        printed: dict[tuple[str, str], int] = {}
        for delay in DELAYS:
            for stiffness in STIFFNESSES:
                config = at(velocity, delay, stiffness)
                data = mesoslip.regime(mesoslip.run(config, executor=1))
                regime = int(data["regime"][0])
                sliding = SteadySliding(config)
                stable = "stable" if sliding.is_stable else "unstable"
                if sliding.is_stable != sliding.is_stable_dephased:
                    stable += " in phase only"
                name = data["regime"].attrs["flag_meanings"].split()[regime]
                printed[stable, name] = printed.get((stable, name), 0) + 1
                if sliding.is_stable_dephased == (regime in {1, 2}):
                    print(
                        f"{1e6 * velocity:g} um/s, {1e3 * delay:.3g} ms, {stiffness:.3g} N/m: "
                        f"{stable}, {name}, "
                        f"amplitude {float(data['relative_amplitude'][0]):.3f}",
                        flush=True,
                    )
                panel.plot(
                    1e3 * delay, stiffness, MARKERS[regime], color=COLOURS[regime], markersize=5
                )
        print(velocity, printed, flush=True)
        own = np.sqrt(MASS / FINE_STIFFNESSES)
        panel.plot(1e3 * own, FINE_STIFFNESSES, ":", color="grey")
        panel.annotate("1/Ω$_S$", (1e3 * own[2], FINE_STIFFNESSES[2]), color="grey")
        panel.axvline(1e3 * math.sqrt(MASS / 2000), linestyle="--", color="grey")
        panel.annotate("1/Ω$_L$", (1e3 * math.sqrt(MASS / 2000), 4500), color="grey")
        panel.set(xscale="log", yscale="log", xlim=(0.02, 15), ylim=(15, 6000))
        panel.set(xlabel="delay, ms", ylabel="stiffness K, N/m", title=f"{1e6 * velocity:g} µm/s")
    for number, name in enumerate(("smooth", "stick-slip", "irregular", "transient")):
        axes[0].plot([], [], MARKERS[number], color=COLOURS[number], label=name)
    axes[0].fill_between([], [], color="tab:red", alpha=0.15, label="steady sliding unstable")
    axes[0].plot([], [], "--", color="tab:red", label="the same, dephased contacts")
    figure.legend(loc="outside lower center", ncols=6)
    figure.savefig(file, dpi=110)


if __name__ == "__main__":
    if sys.argv[1] == "map":
        draw_map(sys.argv[2] if len(sys.argv) > 2 else "docs/steady-sliding.png")
    else:
        {
            "response": compare_responses,
            "growth": compare_growth,
            "random": compare_growth_with_random_delays,
            "thermal": compare_growth_with_temperature,
            "ageing": compare_growth_with_ageing,
        }[sys.argv[1]]()
