"""300 made records with known slips, by which the rule for slips of measured traces is judged.

Motions are those of the program (sampled, ageing, thermal, irregular), of spring sliders with
rate-and-state friction (without and with mass, on a plain and on a rough track), and of a jerky
slider with falls of all sizes; a fifth have no slips. The noise is white and correlated, with hum,
impulses, digital steps and a low-pass filter. `made_record` of a number from 0 on is always the
same. The rule was written with the records of which `is_for_design` is true, half of all::

    .venv/bin/python tests/studies/made_records.py [cache directory]

prints recall and precision by kind, and by force drop over noise, of both halves.
"""

import itertools
import math
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import mesoslip
import numpy as np
from mesoslip import Config
from mesoslip.analysis.alternating_extremes import extremes_of
from mesoslip.analysis.sampled_slips import find_slips
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, lfilter, sosfilt

Array = NDArray[np.float64]

NUMBER = 300
MAX_SAMPLES = 100_000
# Edges of the classes of force drop over noise.
CLASSES = (0, 2, 3, 5, 8, 12, 20, 50, math.inf)
KLEIN = Config.load(
    Path(__file__).parents[2] / "runs" / "klein.toml",
    ["run.duration=40 s", "contacts.count=400", "output.slip_interval=none"],
)
IRREGULAR = {
    "slider.damping_ratio": 0.02,
    "slider.stiffness": 75.9,
    "contacts.coupling": "equal",
    "contacts.delay": 2.765e-3,
    "contacts.threshold.relative_width": 0.0316,
    "contacts.ageing": {
        "law": "relax",
        "time": 0.15,
        "young_force_ratio": 0.2877,
        "young_relative_width": 0.2264,
    },
    "drive.velocity": 2.32e-6,
    "run.duration": 8.0,
}
RUNS = (
    {},
    {"contacts.threshold.relative_width": 0.1},
    {"contacts.delay": 1e-3, "contacts.threshold.relative_width": 0.05},
    {
        "slider.stiffness": 140.0,
        "contacts.static_force": 25e-6,
        "contacts.delay": 1.3e-3,
        "contacts.threshold.relative_width": 0.04,
    },
    {"slider.stiffness": 300.0, "contacts.delay": 3e-3, "run.duration": 20.0},
    {"drive.velocity": 1e-6, "run.duration": 8.0},
    {
        "drive.velocity": 3e-6,
        "contacts.threshold.relative_width": 0.05,
        "contacts.delay": 2e-3,
        "run.duration": 4.0,
    },
    {"slider.damping_ratio": 0.05, "contacts.delay": 2e-3},
    {"drive.velocity": 3e-7, "contacts.coupling": "equal", "contacts.delay": 1e-3},
    IRREGULAR,
    IRREGULAR | {"drive.velocity": 1e-6, "run.duration": 16.0},
    {
        "contacts.coupling": "equal",
        "contacts.delay": 1e-3,
        "contacts.thermal": {"rate": 1.0, "force_ratio": 0.04},
        "drive.velocity": 3e-7,
    },
)


@dataclass(frozen=True)
class Motion:
    """A force without noise, and its slips: times of start and end, and force drops."""

    time: Array
    force: Array
    start: Array
    end: Array
    drop: Array


@dataclass(frozen=True)
class MadeRecord:
    """A record: samples, slips, and the standard deviation of white and correlated noise."""

    kind: str
    time: Array
    force: Array
    start: Array
    end: Array
    drop: Array
    noise: float


def is_for_design(number: int) -> bool:
    """Whether a record was seen when the rule was written."""
    return number // 10 % 2 == 0


def made_record(number: int) -> MadeRecord:
    """The record of a number."""
    rng = np.random.default_rng([17, number])
    kind = number % 10
    if kind >= 8:
        return _without_slips(rng, number // 10 * 2 + kind - 8)
    makers = (_run, _run, _run, _rate_and_state, _inertial, _rough, _jerky, _jerky)
    names = ("run", "run", "run", "rate and state", "with mass", "rough track", "jerky", "jerky")
    motion = makers[kind](rng, number // 10 * 3 + kind)
    return _recorded(rng, names[kind], motion)


def _recorded(rng: np.random.Generator, kind: str, motion: Motion) -> MadeRecord:
    """A motion as an apparatus records it."""
    drops = np.sort(motion.drop)
    typical = float(drops[np.searchsorted(np.cumsum(drops), drops.sum() / 2)])
    count, duration = len(motion.start), np.ptp(motion.time)
    samples = float(np.exp(rng.uniform(math.log(3), math.log(3000))))
    size = int(np.clip(samples * count, 200, MAX_SAMPLES))
    # The falls of a slider with mass are sampled in any case.
    last = motion.time[0] + min(duration, size / samples * duration / count)
    time = np.linspace(motion.time[0], last, size)
    noise = typical / float(np.exp(rng.uniform(math.log(2), math.log(100))))
    force = np.interp(time, motion.time, motion.force)
    # The noise is made for steps of the force that are unknown to it.
    force, noise, delay = _with_noise(rng, force, noise, 0.2 * typical)
    start, end = (one + delay * (time[1] - time[0]) for one in (motion.start, motion.end))
    kept = (start > time[0]) & (end < time[-1])
    return MadeRecord(kind, time, force, start[kept], end[kept], motion.drop[kept], noise)


def _with_noise(
    rng: np.random.Generator, force: Array, noise: float, slow: float
) -> tuple[Array, float, float]:
    """A force with noise, hum, impulses, drift and digital steps; the standard deviation, and the
    delay by a filter [samples]."""
    size, delay = len(force), 0.0
    share = float(rng.choice([0.0, 0.0, 0.4, 0.7]))
    memory = math.exp(-1 / math.exp(rng.uniform(0, 3)))
    correlated = lfilter([math.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(size + 200))[
        200:
    ]
    added = noise * (math.sqrt(1 - share**2) * rng.standard_normal(size) + share * correlated)
    extra = np.zeros(size)
    if rng.random() < 0.3:
        frequency = rng.uniform(0.01, 0.2)
        extra += (
            noise
            * rng.uniform(0.3, 3)
            * np.sin(2 * math.pi * frequency * np.arange(size) + rng.uniform(0, 6))
        )
    if rng.random() < 0.3:
        hit = rng.random(size) < 0.01 * rng.random()
        extra += hit * rng.standard_normal(size) * noise * rng.uniform(5, 30)
    if rng.random() < 0.3:
        at = np.linspace(0, rng.uniform(1, 6), size)
        extra += slow * rng.uniform(0.2, 3) * np.sin(at + rng.uniform(0, 6))
    if rng.random() < 0.3:
        cutoff = 1 / rng.uniform(2.5, 10)
        sections, delay = butter(2, cutoff, output="sos"), math.sqrt(2) / (math.pi * cutoff)
        level = force[0]
        force = level + sosfilt(sections, force - level)
        added, extra = sosfilt(sections, added), sosfilt(sections, extra)
    whole = force + added + extra
    deviation = float(np.std(added))
    if rng.random() < 0.3:
        step = deviation * rng.uniform(0.5, 3)
        whole = np.round(whole / step) * step
        deviation = math.hypot(deviation, step / math.sqrt(12))
    return whole, deviation, delay


@cache
def _run_of(which: int, seed: int) -> Motion:
    tree = mesoslip.run(KLEIN.replace(RUNS[which] | {"run.seed": seed}))
    found = mesoslip.slips(tree)
    columns = (found[name].values for name in ("start_time", "end_time", "force_drop"))
    return Motion(tree["time"].values, tree["spring_force"].values[0], *columns)


def _run(_: np.random.Generator, number: int) -> Motion:
    return _run_of(number % len(RUNS), number // len(RUNS) % 2)


def _falls(time: Array, force: Array) -> Motion:
    """A motion whose slips are the falls of a force without noise."""
    extremes = extremes_of(force)
    tops, bottoms = extremes.falls(0.01 * float(extremes.fall_sizes[-1]))
    tops, bottoms = tops[tops > 0], bottoms[tops > 0]
    return Motion(time, force, time[tops], time[bottoms], force[tops] - force[bottoms])


def _slider(
    rng: np.random.Generator, *, mass: float = 0.0, track: Callable[[float], float] | None = None
) -> Motion:
    """A spring slider with rate-and-state friction; distances in D_c, forces over the load."""
    a, b = 0.01, rng.uniform(0.013, 0.025)
    stiffness = (b - a) * float(np.exp(rng.uniform(math.log(0.08), math.log(0.7))))
    damping = 10 ** rng.uniform(-6, -3.5)
    kind = rng.random() < 0.7

    def change(_: float, at: Array) -> tuple[float, ...]:
        stretch, state, path, speed = at
        velocity = math.exp(min(max(speed, -100.0), 60.0))
        ageing = math.exp(min(-state, 60.0)) - velocity
        slipping = -velocity * (speed + state)
        evolution = ageing if kind else slipping
        level, slope = (0.0, 0.0) if track is None else track(path)
        friction = a * speed + b * state + damping * velocity + level
        if mass:
            rate = (stiffness * stretch - friction) / (mass * velocity)
        else:
            loading = stiffness * (1 - velocity) - b * evolution - slope * velocity
            rate = loading / (a + damping * velocity)
        return 1 - velocity, evolution, velocity, rate

    begin = (a * 0.1 + damping) / stiffness if mass else 0.0
    length = 15 * 30 * (b - a) / stiffness
    found = solve_ivp(
        change,
        (0, length),
        (begin, 0.0, 0.0, 0.3),
        method="Radau" if mass else "LSODA",
        rtol=1e-5,
        atol=1e-7,
        max_step=length / 50,
    )
    # The force is that of the spring; the first cycles settle.
    force = stiffness * found.y[0]
    return _falls(found.t, force)


def _rate_and_state(rng: np.random.Generator, _: int) -> Motion:
    return _slider(rng)


def _inertial(_: np.random.Generator, number: int) -> Motion:
    """One of six, as they are slow."""
    return _inertial_of(number // 3 % 6)


@cache
def _inertial_of(number: int) -> Motion:
    rng = np.random.default_rng([18, number])
    with np.errstate(over="ignore"):
        return _slider(rng, mass=10 ** rng.uniform(-8, -6))


def _rough(rng: np.random.Generator, _: int) -> Motion:
    """A strength that varies along the track as a sum of waves."""
    lengths = np.exp(rng.uniform(math.log(8), math.log(300), 40))
    phases, wave = rng.uniform(0, 2 * math.pi, 40), 2 * math.pi / lengths
    size = rng.uniform(0.005, 0.03) * math.sqrt(2 / 40)

    def track(path: float) -> tuple[float, float]:
        at = wave * path + phases
        return float(size * np.sin(at).sum()), float(size * (wave * np.cos(at)).sum())

    return _slider(rng, track=track)


def _jerky(rng: np.random.Generator, _: int) -> Motion:
    """Lines of loading between falls by half a cosine, of lognormal sizes, with ringing.

    With small intervals the next fall begins soon after the end of the one before.
    """
    count = int(rng.integers(20, 150))
    spread = rng.uniform(0.1, 1.0)
    drops = np.exp(spread * rng.standard_normal(count))
    duration = rng.uniform(0.02, 0.15)
    ringing = float(rng.choice([0.0, 0.0, 0.3, 0.6]))
    pauses = np.maximum(
        drops * np.exp(0.5 * rng.uniform(0, 1) * rng.standard_normal(count)), 1.5 * duration
    )
    creep = rng.uniform(0, 0.6)
    step = duration / 40
    force, time, level = [], [], 5.0
    starts, ends, at = [], [], 0.0
    for drop, pause in zip(drops, pauses, strict=True):
        since = np.arange(0, pause, step)
        # The rate of loading decreases towards the slip.
        rise = since * (1 - 0.5 * creep * (since / pause) ** 3)
        # An echo of the fall before.
        last = drops[len(starts) - 1] if starts else 0.0
        echo = 0.5 * last * ringing * np.exp(-since / duration) * np.sin(math.pi * since / duration)
        force.append(level + rise + echo)
        time.append(at + since)
        at, level = at + pause, level + float(rise[-1] + echo[-1])
        falling = np.arange(0, duration, step)
        force.append(level - drop * 0.5 * (1 - np.cos(math.pi * falling / duration)))
        time.append(at + falling)
        starts.append(at)
        at, level = at + duration, level - float(drop)
        ends.append(at)
    # The mean level does not wander far.
    whole, times = np.concatenate(force), np.concatenate(time)
    line = np.interp(times, [0, *ends], np.concatenate([[5.0], np.interp(ends, times, whole)]))
    smooth = uniform_filter1d(line, len(times) // 10, mode="nearest")
    return Motion(times, whole - smooth + 5.0, np.array(starts), np.array(ends), drops)


def _without_slips(rng: np.random.Generator, number: int) -> MadeRecord:
    """Smooth sliding with drift, hum and noise of all colours, and responses to steps."""
    size = int(np.exp(rng.uniform(math.log(500), math.log(50_000))))
    time = np.arange(size, dtype=float)
    noise, kind = 1.0, number % 5
    force = np.full(size, 100.0)
    if kind == 1:
        memory = math.exp(-1 / math.exp(rng.uniform(0, 6)))
        gain = math.sqrt(1 - memory**2)
        slow = lfilter([gain], [1, -memory], rng.standard_normal(size + 2000))[2000:]
        force += rng.uniform(1, 6) * slow
    elif kind == 2:
        steps = np.sort(rng.uniform(0, size, int(rng.integers(1, 8))))
        scale = size / 30 * rng.uniform(0.1, 2)
        for number, step in enumerate(steps):
            since = np.maximum(time - step, 0)
            sign = 1 if number % 2 else -1
            direct, evolved = rng.uniform(2, 20), rng.uniform(2, 20)
            force += sign * (
                direct * (1 - np.exp(-since / (0.05 * scale)))
                - evolved * (1 - np.exp(-since / scale))
            )
    elif kind == 3:
        band = butter(2, [0.002, 0.002 * (1 + rng.uniform(0.5, 10))], "band", output="sos")
        wave = sosfilt(band, rng.standard_normal(size + 2000))[2000:]
        force += rng.uniform(1, 6) * wave / np.std(wave)
    elif kind == 4:
        # From rest to steady sliding.
        force = 100 * (1 - np.exp(-time / (size * rng.uniform(0.02, 0.2))))
    force, noise, _ = _with_noise(rng, force, noise, 10.0)
    names = ("noise", "correlated", "steps", "slow noise", "loading")
    nothing = np.empty(0)
    return MadeRecord(names[kind], time, force, nothing, nothing, nothing, noise)


@dataclass(frozen=True)
class Judgement:
    """Found slips of a record that are right, and slips that are found, with drops over noise."""

    kind: str
    is_found: NDArray[np.bool_]
    drop: Array
    is_right: NDArray[np.bool_]
    found_drop: Array


def matched(record: MadeRecord, start: Array, end: Array) -> tuple[NDArray[np.bool_], ...]:
    """Which slips are found, and which found ones are right, one for one, by overlap in time.

    Ends of falls are blurred by a sample, and by a quarter of the duration.
    """
    interval = float(np.median(np.diff(record.time)))
    lenient = 2 * interval + 0.25 * (record.end - record.start)
    is_found = np.zeros(len(record.start), dtype=bool)
    is_right = np.zeros(len(start), dtype=bool)
    order = np.argsort(-record.drop)
    for one in order.tolist():
        first, last = record.start[one] - lenient[one], record.end[one] + lenient[one]
        near = np.flatnonzero((end >= first) & (start <= last) & ~is_right)
        if near.size:
            middle = (record.start[one] + record.end[one]) / 2
            is_right[near[np.argmin(np.abs((start[near] + end[near]) / 2 - middle))]] = True
            is_found[one] = True
    return is_found, is_right


def judge(record: MadeRecord, **options: float) -> Judgement:
    """The slips that the rule finds in a record."""
    found = find_slips(record.time, record.force, **options)
    is_found, is_right = matched(record, found.start_time, found.end_time)
    return Judgement(
        record.kind,
        is_found,
        record.drop / record.noise,
        is_right,
        (found.force_before - found.force_after) / record.noise,
    )


def cached(number: int, directory: Path | None = None) -> MadeRecord:
    """The record of a number, kept in a directory."""
    if directory is None:
        return made_record(number)
    path = directory / f"{number}.npz"
    if not path.is_file():
        made = made_record(number)
        np.savez_compressed(path, **vars(made))
    with np.load(path) as data:
        scalars = {name: data[name].item() for name in ("kind", "noise")}
        return MadeRecord(
            **scalars, **{name: data[name] for name in data.files if name not in scalars}
        )


def _judged(number: int, directory: Path | None) -> Judgement:
    return judge(cached(number, directory))


def table(judgements: Iterable[Judgement]) -> str:
    """Slips, recall, found slips and precision, by kind and by drop over noise."""
    rows = []
    every = list(judgements)
    groups = {
        kind: [one for one in every if one.kind == kind]
        for kind in dict.fromkeys(one.kind for one in every)
    }
    for kind, some in groups.items():
        slips = sum(len(one.drop) for one in some)
        found = sum(int(one.is_found.sum()) for one in some)
        all_found = sum(len(one.is_right) for one in some)
        with_false = sum(bool((~one.is_right).any()) for one in some)
        rows.append(
            f"{kind:>15}: {len(some):3} records, {found:5} of {slips:5} slips, "
            f"{all_found - found:5} false of {all_found:5}, in {with_false} records"
        )
    drop, is_found, found_drop, is_right = (
        np.concatenate([getattr(one, name) for one in every])
        for name in ("drop", "is_found", "found_drop", "is_right")
    )
    for low, high in itertools.pairwise(CLASSES):
        inside = (drop >= low) & (drop < high)
        found = (found_drop >= low) & (found_drop < high)
        rows.append(
            f"{low:>7} to {high:>4}: recall {is_found[inside].mean():6.1%} of {inside.sum():5}, "
            f"precision {is_right[found].mean():6.1%} of {found.sum():5}"
            if inside.any() and found.any()
            else f"{low:>7} to {high:>4}: none"
        )
    return "\n".join(rows)


def main() -> None:
    """Judge all records."""
    directory = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(partial(_judged, directory=directory), range(NUMBER)))
    for is_design in (True, False):
        print("design" if is_design else "\nput aside")
        print(table(one for at, one in enumerate(found) if is_for_design(at) == is_design))


if __name__ == "__main__":
    main()
