"""Cost of a contact event over the number of contacts, and against fixed-step models.

Run by ``make bench``; at the end each number that has a goal stands beside it. Times of one run are
to be compared with each other, not with other machines.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(1, str(Path(__file__).parents[1] / "python"))
from fixed_step import numba_run, numpy_steps, verlet_run
from mesoslip import Config
from mesoslip.output.writing import write_results
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import run_realizations
from mesoslip.theory.force_curve import ForceCurve
from plain_interface import PlainInterface

ROOT = Path(__file__).parents[2]
KLEIN = ROOT / "runs" / "klein.toml"

# What a break and the birth after it are to cost on a machine that has nothing else to do [ns].
GOALS = {
    "klein": {4080: 175, 408_000: 400},
    "prescribed": {4080: 120},
    "quasistatic": {4080: 110, 100_000: 200},
    "lattice": {4080: 500},
}
# The same as ratios to 4080 contacts.
RATIO_GOAL = 2.5
# The same of a lattice of a million contacts.
LATTICE_RATIO_GOAL = 2.0
# Seconds of kernel that 12 s of Klein's case are to take, of whole commands, and how many times as
# long as the events a fixed step of the same error is to take.
LAYERS_GOAL = 1.5
MASTER_EQUATION_GOAL = 0.4
COMMAND_GOALS = {"run": 0.8, "info": 0.5}
FIXED_STEP_GOAL = 170.0
# How many times as long as a row of 128 blocks a plain code takes for a break, and how many times
# as long as with 8 blocks a break may take with 1024: as the square root of their number.
PLAIN_ROW_GOAL, ROW_RATIO_GOAL = 50.0, 128**0.5
# Cost of contacts that age over that of contacts that do not.
AGEING_GOAL = 1.5
# The same of other kinds of contacts over plain ones, and of some of them.
KIND_GOAL = 1.5
KIND_GOALS = {
    "f_T = 0.02 f_s": 1.6,
    "ageing log": 2.0,
    "ageing log, f_T = 0.02 f_s": 3.5,
    "track": 1.1,
}

# The same of an event under a normal load that changes: a break and the birth after it, or a site
# that touches and one that separates.
LOAD_GOAL = 1.2
# The same of a short realization [us], and of a stop near the end of 10^5 [s].
SHORT_REALIZATIONS = 20_000
SHORT_GOAL = 60.0
STOP_GOAL = 3.0

# What was measured beside its goal, for the table at the end: name, value, sign, goal, unit.
met: list[tuple[str, float, str, float, str]] = []

# Runs of a case, the fastest of which counts: other programs only make it slower.
REPETITIONS = 5


def goal(case: str, count: int, cost: float) -> str:
    """The goal of a case, to stand beside what was measured [ns], and in the table at the end."""
    wanted = GOALS[case].get(count)
    if wanted is None:
        return " " * 6
    met.append((f"{case}, {count} contacts", cost, "<=", wanted, "ns/break"))
    return f"{wanted:6d}"


class Measured(Realization):
    """A realization whose kernel seconds are those of the processor, whatever else it does."""

    def advance(self, advances: int | None = None, *, work: float | None = None) -> None:
        """Go on for one segment."""
        before, start = self.kernel_seconds, time.process_time()
        super().advance(advances, work=work)
        self.kernel_seconds = before + time.process_time() - start


def finish(config: Config) -> Realization:
    realization = Measured(config, 0)
    while not realization.finished:
        realization.advance()
    return realization


def fastest(config: Config) -> Realization:
    """The fastest of some runs."""
    return min((finish(config) for _ in range(REPETITIONS)), key=lambda one: one.kernel_seconds)


def memory_in_use() -> int:
    """Memory of this process now [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def cost_over_contacts() -> None:
    """Nanoseconds for a break and the birth after it, in the slips of Klein's case."""
    print("\nCost of a break and rebirth in Klein's case, slips included")
    print("  contacts    breaks   ns/break   goal   against 4080   bytes/contact")
    reference = 0.0
    for count in (100, 4080, 100_000, 408_000, 1_000_000, 4_000_000):
        config = Config.load(KLEIN, [f"contacts.count={count}", "output.slip_interval=1ms"])
        realization = Measured(config, 0)
        before = memory_in_use()
        # Loading up to the first breaks costs the same for any number of contacts.
        while realization.breaks < count / 2 and not realization.finished:
            realization.advance(20_000)
        breaks, seconds = realization.breaks, realization.kernel_seconds
        while realization.breaks < max(400_000, 3 * count) and not realization.finished:
            realization.advance(2_000_000)
        # The queue lives in the kernel during a segment: 12 bytes a contact twice, and its buckets.
        memory = (memory_in_use() - before) / count + 24 + 12
        breaks = realization.breaks - breaks
        cost = (realization.kernel_seconds - seconds) / breaks * 1e9
        reference = cost if count == 4080 else reference
        ratio = f"{cost / reference:14.2f}" if reference else " " * 14
        room = f"{memory:15.0f}" if count >= 1_000_000 else " " * 15
        print(
            f"{count:10d} {breaks:9d} {cost:10.0f} {goal('klein', count, cost)} {ratio} {room}",
            flush=True,
        )
    met.append(("klein, 4000000 over 4080 contacts", cost / reference, "<=", RATIO_GOAL, ""))


def prescribed_cost() -> None:
    """The same without a slider to advance: the cost of the contacts alone."""
    print("\nCost of a break and rebirth under the prescribed slider")
    print("  contacts    breaks   ns/break   goal")
    for count in (4080, 1_000_000, 4_000_000):
        tables = Config.load(KLEIN).to_dict()
        tables["slider"] = {"kind": "prescribed"}
        tables["contacts"] |= {"count": count, "initial": "steady"}
        tables["run"]["duration"] = 0.0162 * max(1.0, 2e6 / count)
        tables["drive"]["velocity"] = 1e-6
        tables["output"] = {"interval": tables["run"]["duration"]}
        realization = finish(Config.from_dict(tables))
        cost = realization.kernel_seconds / realization.breaks * 1e9
        print(
            f"{count:10d} {realization.breaks:9d} {cost:10.0f} {goal('prescribed', count, cost)}",
            flush=True,
        )


def ageing_cost() -> None:
    """What ageing adds to a break and rebirth, from old to young contacts."""
    print("\nCost of a break and rebirth of contacts that age, prescribed slider, 4080 contacts")
    print(
        "  velocity over that of ageing     ns/break   advances/break   without age   ratio   goal"
    )
    ageing = {"law": "relax", "time": 0.01, "young_force_ratio": 0.5, "young_relative_width": 0.3}
    for ratio in (0.01, 0.1, 1.0, 10.0, 100.0):
        tables = Config.load(KLEIN).to_dict()
        tables["slider"] = {"kind": "prescribed"}
        tables["drive"]["velocity"] = 9e-9 / 0.01 * ratio
        tables["run"]["duration"] = 60 * 0.01 / ratio
        tables["output"] = {"interval": tables["run"]["duration"]}
        tables["contacts"] |= {"initial": "steady", "coupling": "equal", "delay": 0.0}
        tables["contacts"]["threshold"]["relative_width"] = 0.1
        both = [Config.from_dict(tables)]
        tables["contacts"]["ageing"] = ageing
        both.append(Config.from_dict(tables))
        plain, aged = (
            min((finish(one) for _ in range(REPETITIONS)), key=lambda run: run.kernel_seconds)
            for one in both
        )
        costs = [one.kernel_seconds / one.breaks * 1e9 for one in (aged, plain)]
        print(
            f"{ratio:30g} {costs[0]:12.0f} {aged.advances / aged.breaks:16.3f} {costs[1]:16.0f} "
            f"{costs[0] / costs[1]:7.2f} {AGEING_GOAL:6g}",
            flush=True,
        )


def ageing_in_slips() -> None:
    """The same where the velocity of the slider changes by five orders between stick and slip."""
    tables = Config.load(KLEIN, ["run.duration=4", "output.slip_interval=1ms"]).to_dict()
    tables["contacts"]["coupling"] = "equal"
    costs = []
    for ageing in (
        None,
        {"law": "relax", "time": 0.01, "young_force_ratio": 0.5, "young_relative_width": 0.3},
    ):
        if ageing:
            tables["contacts"]["ageing"] = ageing
        runs = [finish(Config.from_dict(tables)) for _ in range(REPETITIONS)]
        best = min(runs, key=lambda one: one.kernel_seconds)
        costs.append(best.kernel_seconds / best.breaks * 1e9)
        print(
            f"  Klein's case {'with' if ageing else 'without'} ageing: {costs[-1]:.0f} ns/break, "
            f"{best.advances / best.breaks:.3f} advances/break",
            flush=True,
        )
    print(f"  ratio {costs[1] / costs[0]:.2f}, goal {AGEING_GOAL:g}")


def kinds_of_contacts() -> None:
    """Cost of kinds of contacts over that of plain ones, run by run in alternation."""
    print("\nCost of a break and rebirth over that of contacts without temperature, 4080 contacts")
    print("  slider      contacts                      ns/break   advances/break   ratio   goal")
    ageing = {"law": "relax", "time": 0.01, "young_force_ratio": 0.5, "young_relative_width": 0.3}
    log = {"law": "log", "time": 1e-3, "growth": 0.05}
    warm = {"rate": 1e4, "force_ratio": 0.02}
    kinds: dict[str, dict[str, Any]] = {
        "plain": {},
        "f_T = 0.02 f_s": {"thermal": warm},
        "f_T = 0.05 f_s": {"thermal": {"rate": 1e3, "force_ratio": 0.05}},
        "f_T = 0.005 f_s": {"thermal": {"rate": 10.0, "force_ratio": 0.005}},
        "ageing": {"ageing": ageing},
        "ageing, f_T = 0.02 f_s": {"ageing": ageing, "thermal": warm},
        "ageing log": {"ageing": log},
        "ageing log, f_T = 0.02 f_s": {"ageing": log, "thermal": warm},
        "track": {"track": {"spread": 0.05, "length": "10 nm"}},
        "exponential delays": {"delay_law": "exponential"},
        "newborn width 0.05": {"newborn_width": 0.05},
    }
    for slider in ("prescribed", "rigid"):
        configs = {}
        for name, changes in kinds.items():
            tables = Config.load(KLEIN, ["run.duration=4", "output.slip_interval=1ms"]).to_dict()
            tables["contacts"] |= {"coupling": "equal", **changes}
            if slider == "prescribed":
                prescribe(tables)
            configs[name] = Config.from_dict(tables)
        costs: dict[str, list[float]] = {name: [] for name in configs}
        advances: dict[str, float] = {}
        for _ in range(REPETITIONS):
            for name, config in configs.items():
                one = finish(config)
                costs[name].append(one.kernel_seconds / one.breaks * 1e9)
                advances[name] = one.advances / one.breaks
        for name, cost in costs.items():
            ratio = float(np.median(np.array(cost) / costs["plain"]))
            wanted = KIND_GOALS.get(name, KIND_GOAL)
            print(
                f"  {slider:11} {name:28} {min(cost):9.0f} {advances[name]:16.3f} {ratio:7.2f} "
                f"{wanted:6g}",
                flush=True,
            )
            if name != "plain":
                met.append((f"{slider}, {name}", ratio, "<=", wanted, ""))


def prescribe(tables: dict[str, Any]) -> None:
    """Have the slider move steadily."""
    tables["slider"] = {"kind": "prescribed"}
    tables["drive"]["velocity"] = 1e-6
    tables["run"]["duration"] = 0.36
    tables["output"] = {"interval": 0.36}
    # Contacts that attach with another force have no steady start.
    tables["contacts"]["initial"] = "uniform"
    tables["contacts"]["threshold"]["relative_width"] = 0.1


def changing_load_cost() -> None:
    """Cost of an event under a vibrating load over that under a constant one."""
    print("\nCost of an event under a load of 50 uN that vibrates, 4080 contacts")
    print("  slider       amplitude  frequency   ns/event   ratio   goal")
    for slider in ("prescribed", "rigid"):
        loads = [(0.0, 0), (0.1, 200), (0.4, 200), (0.4, 20), (0.01, 200)]
        runs: dict[tuple[float, int], list[float]] = {load: [] for load in loads}
        for _ in range(REPETITIONS):
            for amplitude, frequency in loads:
                changes = ["run.duration=4", "output.slip_interval=1ms", "contacts.coupling=equal"]
                tables = Config.load(KLEIN, changes).to_dict()
                if slider == "prescribed":
                    prescribe(tables)
                if amplitude:
                    cycle = {"amplitude": amplitude * 50e-6, "frequency": frequency}
                    tables["load"] = {"normal_force": 50e-6, "cycle": cycle}
                one = finish(Config.from_dict(tables))
                # Each half of a cycle passes twice the amplitude.
                sites = 4 * amplitude * 4080 * frequency * tables["run"]["duration"]
                runs[amplitude, frequency].append(one.kernel_seconds / (one.breaks + sites / 2))
        for (amplitude, frequency), costs in runs.items():
            ratio = float(np.median(np.array(costs) / runs[0.0, 0]))
            print(
                f"  {slider:11} {amplitude:10g} {frequency:7d} 1/s {min(costs) * 1e9:10.0f} "
                f"{ratio:7.2f} {LOAD_GOAL:6g}",
                flush=True,
            )
            if amplitude:
                name = f"{slider}, load {amplitude:g}, {frequency} 1/s"
                met.append((name, ratio, "<=", LOAD_GOAL, ""))


def against_fixed_steps() -> None:
    """A fixed-step model at the step that gives the first slip of Klein's case to 1 % of F_s."""
    duration = 1.96
    config = Config.load(KLEIN, [f"run.duration={duration}", "output.slip_interval=1ms"])
    events = fastest(config)
    before, after = events.slips[0, 3], events.slips[0, 4]
    static = config.contacts.static_force
    print(f"\nKlein's case up to {duration} s, the end of the first slip, 4080 contacts")
    print(f"  event-driven: {events.kernel_seconds:.4f} s, {events.breaks} breaks, ", end="")
    print(f"spring force {before * 1e6:.3f} to {after * 1e6:.3f} uN")
    step = 2e-4
    while True:
        highest, lowest, seconds = numba_run(config, step, duration)
        error = max(abs(highest - before), abs(lowest - after)) / static
        ratio = seconds / events.kernel_seconds
        print(
            f"  Numba, step {step * 1e6:6.2f} us: {seconds:8.3f} s, {ratio:8.1f} times as long, "
            f"spring force {highest * 1e6:.3f} to {lowest * 1e6:.3f} uN, off by {error:.2%} of F_s",
            flush=True,
        )
        if error < 0.01 or step < 5e-7:
            break
        step /= 2
    met.append(("Numba fixed step over events", ratio, ">=", FIXED_STEP_GOAL, ""))
    steps = 1000
    seconds = numpy_steps(config, step, steps) / steps * (duration / step)
    print(
        f"  NumPy, step {step * 1e6:6.2f} us: {seconds:8.1f} s, "
        f"{seconds / events.kernel_seconds:8.1f} times as long (from {steps} steps)"
    )


def curve_cost() -> None:
    """Kernel time of the force curve over 20 periods, and the digits it has."""
    print("\nForce curve of the master equation over 20 mean breaking stretches")
    print("  law          width   panels   kernel s   digits   slope error")
    for law, width in (
        ("gaussian", 0.2),
        ("gaussian", 0.01),
        ("gaussian", 0.003),
        ("lognormal", 1.0),
        ("exponential", 0.5),
        ("uniform", 0.2),
    ):
        tables = Config.load(KLEIN).to_dict()
        tables["contacts"]["threshold"] = {"law": law, "relative_width": width}
        tables["curve"] = {"tolerance": 1e-8}
        curve = ForceCurve(Config.from_dict(tables))
        print(
            f"  {law:12} {width:5g} {curve.panels:8d} {curve.kernel_seconds:10.3f} "
            f"{curve.digits:8d} {curve.slope_error:13.0e}",
            flush=True,
        )
    tables["contacts"]["threshold"] = {"law": "gaussian", "relative_width": 0.05}
    print("  The same with width 0.05 over more periods")
    for periods in (20, 200, 2000):
        tables["curve"] = {"tolerance": 1e-8, "length": periods * 9e-9}
        curve = ForceCurve(Config.from_dict(tables))
        print(f"  {periods:5d} periods: {curve.panels:8d} panels, {curve.kernel_seconds:7.3f} s")


def master_equation_cost() -> None:
    """Cost and accuracy of the master equation, beside N contacts of the same accuracy."""
    print("\nKlein's case by the master equation; error of the first slip's force over F_s")
    print("  resolution   12 s run: kernel s    advances   energy residual   error")
    static = Config.load(KLEIN).contacts.static_force

    def first_slip(changes: list[str]) -> Realization:
        return finish(
            Config.load(KLEIN, ["run.duration=1.96", "output.slip_interval=1ms", *changes])
        )

    exact = first_slip(["run.engine=me", "run.resolution=0.05"]).slips[0, 3]
    error = 1.0
    for resolution in (1.0, 0.5, 0.25, 0.125):
        changes = ["run.engine=me", f"run.resolution={resolution}"]
        whole = fastest(Config.load(KLEIN, changes))
        if resolution == Config.load(KLEIN, ["run.engine=me"]).run.resolution:
            seconds = whole.kernel_seconds
            met.append(("master equation, 12 s", seconds, "<=", MASTER_EQUATION_GOAL, "s"))
        error = abs(first_slip(changes).slips[0, 3] - exact) / static
        print(
            f"  {resolution:10g} {whole.kernel_seconds:20.3f} {whole.advances:11d} "
            f"{whole.energy_residual:17.0e} {error:7.0e}",
            flush=True,
        )
    print("  N contacts   12 s run: kernel s    advances   energy residual   error (16 seeds)")
    for count in (1000, 10_000, 100_000):
        whole = finish(Config.load(KLEIN, [f"contacts.count={count}"]))
        forces = [
            first_slip([f"contacts.count={count}", f"run.seed={seed}"]).slips[0, 3]
            for seed in range(1, 17)
        ]
        scatter = float(np.sqrt(np.mean((np.array(forces) - exact) ** 2))) / static
        print(
            f"  {count:10d} {whole.kernel_seconds:20.3f} {whole.advances:11d} "
            f"{whole.energy_residual:17.0e} {scatter:7.0e}",
            flush=True,
        )
    print(
        f"  An error of {error:.0e} by N contacts takes N = {count * (scatter / error) ** 2:.0e}, "
        f"{whole.kernel_seconds * (scatter / error) ** 2:.0e} s"
    )


def layers(count: int, duration: float, *changes: str) -> Config:
    tables = Config.load(KLEIN, [f"run.duration={duration}", *changes]).to_dict()
    tables["slider"] = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": count}
    return Config.from_dict(tables)


def layered_cost() -> None:
    """Cost over the number of layers, of the series and of CVODE, and beside a Verlet scheme."""
    print("\nElastic slider in Klein's case, 4080 contacts, energy balance of the whole run")
    whole = fastest(layers(64, 12.0))
    met.append(("64 layers, 12 s", whole.kernel_seconds, "<=", LAYERS_GOAL, "s"))
    print(
        f"  64 layers, 12 s: {whole.kernel_seconds:.2f} s, {whole.breaks} breaks, "
        f"{whole.advances} advances, balance to {abs(whole.energy_residual):.0e}"
    )
    print("  layers   to 1.94 s: kernel s      breaks    advances   us/advance   slip time ms")
    for count in (1, 4, 16, 64, 256, 1024):
        one = finish(layers(count, 1.94))
        slip = one.slips[0] if len(one.slips) else np.full(7, np.nan)
        print(
            f"  {count:6d} {one.kernel_seconds:20.3f} {one.breaks:11d} {one.advances:11d} "
            f"{1e6 * one.kernel_seconds / one.advances:12.2f} {1e3 * (slip[2] - slip[1]):14.2f}",
            flush=True,
        )
    print("  16 layers, 200 contacts to 1.94 s by each solver, tolerance 1e-8")
    tables = layers(16, 1.94, "contacts.count=200").to_dict()
    series = 0.0
    for method in ("series", "adams", "bdf"):
        tables["slider"]["solver"] = {"method": method}
        one = finish(Config.from_dict(tables))
        series = series or one.kernel_seconds
        steps, evaluations, failed = one.integrator_counts
        print(
            f"  {method:8} {one.kernel_seconds:8.3f} s, {one.kernel_seconds / series:6.1f} times "
            f"as long, {steps} steps, {evaluations} evaluations, {failed} failed, balance to "
            f"{abs(one.energy_residual):.0e}",
            flush=True,
        )
    config = layers(64, 1.94)
    events = finish(config)
    before, after = events.slips[0, 3], events.slips[0, 4]
    print(f"  64 layers to 1.94 s: {events.kernel_seconds:.3f} s by events")
    step = 5e-6
    while step > 1e-7:
        highest, lowest, seconds = verlet_run(config, step, 1.94)
        error = max(abs(highest - before), abs(lowest - after)) / config.contacts.static_force
        print(
            f"  Verlet in Numba, step {1e6 * step:5.2f} us: {seconds:7.2f} s, "
            f"{seconds / events.kernel_seconds:6.1f} times as long, off by {error:.2%} of F_s",
            flush=True,
        )
        if error < 0.01:
            break
        step /= 2


def row_of(blocks: int, contacts: int) -> Config:
    """Blocks of runs/fronts.toml, however many there are, with contacts of each."""
    part = blocks / 128
    changes = {"slider.mass": 0.128 * part, "slider.length": 0.4 * part, "slider.blocks": blocks}
    changes |= {"slider.bar_stiffness": 78.125e3 / part, "slider.top_stiffness": 300e3 * part}
    changes |= {"contacts.count": blocks * contacts, "contacts.static_force": 128.0 * part}
    changes |= {"contacts.stiffness": 142.4e6 * part, "contacts.drag": 2560.0 * part}
    changes |= {"run.drive_displacement": 1e-3, "contacts.renewal": "keep"}
    return Config.load(ROOT / "runs" / "fronts.toml").replace(changes)


def cost_of_breaks(config: Config, breaks: float) -> float:
    """Microseconds for a break and the birth after it, once a tenth of the contacts have broken."""
    realization = Measured(config, 0)
    while realization.breaks < 0.1 * config.contacts.count:
        realization.advance(2000)
    before, seconds = realization.breaks, realization.kernel_seconds
    while realization.breaks < before + breaks and not realization.finished:
        realization.advance(20_000)
    return 1e6 * (realization.kernel_seconds - seconds) / (realization.breaks - before)


def plain_row_cost(config: Config, breaks: int) -> float:
    """The same of the plain code of the tests, in NumPy, from blocks that slip on all contacts."""
    slider, contacts = config.slider, config.contacts
    with Realization(config) as start:
        stretches = start.contacts["break_stretch"].reshape(slider.block_count, -1)
    plain = PlainInterface(
        slider.mass,
        slider.neighbour_spring,
        slider.edge_stiffness,
        slider.total_top_stiffness,
        stretches * contacts.contact_stiffness,
        contacts.contact_stiffness,
        config.drive_speed,
        delay=contacts.delay,
        back_force_ratio=contacts.back_force_ratio,
        drag=contacts.contact_drag,
        neighbour_damping=slider.neighbour_damping,
        damping=slider.damping_rate,
    )
    plain.place[:], plain.speed[:] = stretches.min(), 0.1
    seconds = time.process_time()
    while plain.breaks < breaks:
        plain.advance(plain.time + 1e-7, 1e-6)
    return 1e6 * (time.process_time() - seconds) / plain.breaks


def interface_cost() -> None:
    """Cost of a break over the number of blocks, and beside a plain code."""
    print("\nCost of a break and rebirth in a row of blocks, springs from above and at the edge")
    print("  blocks   contacts of each   us/break")
    costs = {}
    for blocks, contacts in ((8, 200), (128, 200), (1024, 200), (128, 1000)):
        cost = cost_of_breaks(row_of(blocks, contacts), 200_000 + 200 * blocks)
        costs[blocks, contacts] = cost
        print(f"  {blocks:6d} {contacts:18d} {cost:10.2f}", flush=True)
    plain = plain_row_cost(row_of(128, 1000), 100)
    print(f"  the plain code of the tests, in NumPy, 128 blocks of 1000 contacts: {plain:.0f} us")
    ratio = costs[1024, 200] / costs[8, 200]
    met.append(("1024 over 8 blocks of a row", ratio, "<=", ROW_RATIO_GOAL, ""))
    ratio = plain / costs[128, 1000]
    met.append(("a plain row in NumPy over events", ratio, ">=", PLAIN_ROW_GOAL, ""))


def interacting(count: int, columns: int, strength: float | None) -> Config:
    """Klein's contacts at the same distance from each other, however many there are."""
    tables = Config.load(KLEIN, [f"contacts.count={count}"]).to_dict()
    tables["contacts"]["area"] = 1e-10 * count / 4080
    tables["contacts"]["threshold"]["relative_width"] = 0.1
    if strength is not None:
        rows = count // columns
        tables["interaction"] = {"strength": strength, "columns": columns, "rows": rows}
    # Without the catalogue, which takes 80 bytes an avalanche.
    tables["output"] = {"interval": 0.01}
    if strength is not None:
        tables["output"]["avalanche_size"] = 10**9
    return Config.from_dict(tables)


def interaction_cost() -> None:
    """Nanoseconds for a break and the birth after it, among neighbours."""
    print("\nCost of a break and rebirth with interaction, rigid slider, relative width 0.1")
    print(
        "  contacts   strength    breaks   ns/break   goal   against 4080   bytes/contact   "
        "mean avalanche"
    )
    for strength in (None, 0.03, 0.1, 0.3):
        reference = 0.0
        for count, columns in ((4080, 60), (1_000_000, 1000)):
            realization = Measured(interacting(count, columns, strength), 0)
            before = memory_in_use()
            while realization.breaks < count / 2 and not realization.finished:
                realization.advance(20_000)
            breaks, seconds = realization.breaks, realization.kernel_seconds
            most = breaks + max(400_000, 3 * count)
            while realization.breaks < most and not realization.finished:
                realization.advance(1_000_000)
            # Tree, what its neighbours are to a contact, and a list of contacts live in the kernel
            # during a segment.
            memory = (memory_in_use() - before) / count
            memory += 36 if strength is None else 17 + 16 + 4
            breaks = realization.breaks - breaks
            cost = (realization.kernel_seconds - seconds) / breaks * 1e9
            reference = reference or cost
            mean = realization.breaks / max(realization.avalanche_count, 1)
            print(
                f"{count:10d} {strength or 0.0:10g} {breaks:9d} {cost:10.0f} "
                f"{goal('lattice', count if strength == 0.1 else 0, cost)} "
                f"{cost / reference:14.2f} {memory if count > 4080 else np.nan:15.0f} {mean:16.1f}",
                flush=True,
            )
            if strength == 0.1 and count > 4080:
                ratio = cost / reference
                met.append(
                    ("lattice, 1000000 over 4080 contacts", ratio, "<=", LATTICE_RATIO_GOAL, "")
                )


def quasistatic_cost() -> None:
    """Nanoseconds a break of a slider without inertia, contacts attaching at once."""
    print("\nCost of a break and rebirth under the quasi-static slider")
    print("  contacts   K/Nk   strength    breaks   ns/break   goal   mean avalanche")
    for count, columns, spring, strength in (
        (4080, 60, 200.0, None),
        (4080, 60, 20.0, None),
        (100_000, 250, 200.0, None),
        (1_000_000, 1000, 200.0, None),
        (4080, 60, 200.0, 0.1),
        (1_000_000, 1000, 200.0, 0.1),
    ):
        tables = interacting(count, columns, strength).to_dict()
        tables["slider"] = {"kind": "quasistatic", "stiffness": spring}
        tables["contacts"]["threshold"]["relative_width"] = 0.3
        del tables["run"]["duration"]
        tables["run"]["avalanches"] = int(4e6 * spring / (2000 + spring))
        realization = Measured(Config.from_dict(tables), 0)
        while realization.breaks < count and not realization.finished:
            realization.advance(20_000)
        breaks, seconds = realization.breaks, realization.kernel_seconds
        while not realization.finished:
            realization.advance()
        breaks = realization.breaks - breaks
        cost = (realization.kernel_seconds - seconds) / breaks * 1e9
        print(
            f"{count:10d} {spring / 2000:6g} {strength or 0.0:10g} {breaks:9d} {cost:10.0f} "
            f"{goal('quasistatic', count if spring == 200.0 and not strength else 0, cost)} "
            f"{realization.breaks / realization.avalanche_count:16.1f}",
            flush=True,
        )


def processor_time() -> float:
    """Processor time of all commands so far [s]."""
    used = os.times()
    return used.children_user + used.children_system


def command_cost() -> None:
    """Processor time of whole commands on a second start."""
    print("\nWhole commands")
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in (
            ("run", [str(KLEIN), "-o", f"{folder}/klein.nc", "--quiet"]),
            ("info", [str(KLEIN)]),
        ):
            seconds = []
            for _ in range(REPETITIONS):
                start = processor_time()
                subprocess.run(
                    [sys.executable, "-m", "mesoslip", name, *arguments],
                    check=True,
                    capture_output=True,
                    env=environment,
                )
                seconds.append(processor_time() - start)
            print(f"  {name:5} {min(seconds):6.2f} s, goal {COMMAND_GOALS[name]}", flush=True)
            met.append(
                (f"mesoslip {name} klein.toml", min(seconds), "<=", COMMAND_GOALS[name], "s")
            )


def short_realizations() -> None:
    """Many realizations of 2 contacts, with their checkpoint and output, over two workers."""
    print("\nRealizations of 2 contacts, two workers, each")
    changes = ["contacts.count=2", "run.duration=20ms", "output.interval=10ms"]
    config = Config.load(KLEIN, [*changes, f"run.realizations={SHORT_REALIZATIONS}"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        with Checkpoint(path / "short.checkpoint", config) as checkpoint:
            wall, processor = time.perf_counter(), time.process_time()
            results = run_realizations(config, executor=2, checkpoint=checkpoint)
            write_results(results, path / "short.nc", threads=2)
            each = 1e6 / SHORT_REALIZATIONS
            wall = (time.perf_counter() - wall) * each
            processor = (time.process_time() - processor) * each
            print(f"  {wall:.0f} us, {processor:.0f} us of the processor, goal {SHORT_GOAL}")
            met.append(("a realization of 2 contacts", wall, "<=", SHORT_GOAL, "us"))
            start = time.process_time()
            checkpoint.write(results.realizations)
            write_results(results, path / "partial.nc")
            seconds = (time.process_time() - start) / SHORT_REALIZATIONS * 1e5
            print(f"  stopped near the end of 10^5: {seconds:.1f} s of the processor", end="")
            print(f", goal {STOP_GOAL}")
            met.append(("a stop of 10^5 realizations", seconds, "<=", STOP_GOAL, "s"))


def table_of_goals() -> None:
    """Each number that has a goal, beside it."""
    print("\nWhat was measured, and its goal")
    for name, value, sign, wanted, unit in met:
        reached = value <= wanted if sign == "<=" else value >= wanted
        line = f"  {name:38} {value:8.3g} {sign} {wanted:5g} {unit:9}"
        print(f"{line} {'' if reached else 'missed'}".rstrip())


def main() -> None:
    np.seterr(all="raise")
    start = time.perf_counter()
    whole = fastest(Config.load(KLEIN))
    cost = whole.kernel_seconds / whole.breaks * 1e9
    met.append(("klein, 12 s with finer traces", cost, "<=", GOALS["klein"][4080], "ns/break"))
    print(
        f"Klein's case, 12 s with finer traces: {whole.kernel_seconds:.3f} s of kernel time, "
        f"{whole.breaks} breaks, {whole.advances} advances, "
        f"{cost:.0f} ns/break (goal {GOALS['klein'][4080]})"
    )
    cost_over_contacts()
    prescribed_cost()
    ageing_cost()
    ageing_in_slips()
    kinds_of_contacts()
    changing_load_cost()
    against_fixed_steps()
    curve_cost()
    master_equation_cost()
    layered_cost()
    interface_cost()
    interaction_cost()
    quasistatic_cost()
    short_realizations()
    command_cost()
    table_of_goals()
    print(f"All of it took {time.perf_counter() - start:.0f} s.")


if __name__ == "__main__":
    main()
