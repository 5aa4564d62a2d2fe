"""Records that go back and forth with known friction: are their strokes measured right?

Two hundred made records, of a triangle, a sine or a trapezoid of the load point at 0.01 to 50 Hz;
of Coulomb friction behind a spring, of Maxwell elements in gross and in partial slip, and of
stick-slip; with offsets and noise up to a tenth of the friction; with a load point or without.
Those with odd numbers were put aside before the rules were written, and those from 200 on before
they were mended. Prints for each half how many strokes and slips are right, and how often known
values are within the stated errors (95 %)::

    .venv/bin/python tests/studies/stroke_records.py
    .venv/bin/python tests/studies/stroke_records.py 200 400
"""

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COUNT = 200
SHAPES = ("triangle", "sine", "trapezoid")
INTERFACES = ("coulomb", "gross slip", "partial slip", "stick-slip")
QUANTITIES = ("friction", "loop energy", "offset", "stiffness")


@dataclass(frozen=True)
class Made:
    """A made record with its truth; the arrays have the shape (samples,)."""

    number: int
    name: str
    time: Array
    force: Array
    position: Array | None
    turns: Array
    """Times of the reversals [s]."""
    slips: Array
    """Times of the slips [s]."""
    friction: float
    loop_energy: float
    offset: float
    stiffness: float
    strength: float
    """Friction of sliding, which partial slip does not reach."""

    def write(self, file: Path) -> None:
        """The record as a laboratory would write it."""
        columns = [self.time, self.force]
        header = "time [s],force [N]"
        if self.position is not None:
            columns.append(self.position)
            header += ",load point [m]"
        np.savetxt(
            file, np.transpose(columns), fmt="%.9g", delimiter=",", header=header, comments=""
        )


def waves(shape: str, phase: Array, rest: float) -> Array:
    """A drive between -1 and 1 that turns at the phases 1/4, 3/4, ... [cycles]; a trapezoid rests
    there for a share of the time."""
    sine = np.sin(2 * np.pi * phase)
    if shape == "sine":
        return sine
    triangle = 2 / np.pi * np.arcsin(sine)
    return triangle if shape == "triangle" else np.clip(triangle / (1 - rest), -1, 1)


def pull(x: Array, stiffness: Array, strength: Array) -> Array:
    """Force of springs in parallel, each with a slider that slides at its strength."""
    force = np.zeros(stiffness.size)
    rows = np.empty(x.size)
    for index, step in enumerate(np.diff(x, prepend=x[0])):
        force = np.clip(force + stiffness * step, -strength, strength)
        rows[index] = force.sum()
    return rows


def pull_in_slips(
    x: Array, stiffness: float, levels: Array, drop: float
) -> tuple[Array, NDArray[np.int_]]:
    """Force of a spring whose slider slips at levels, one after the other; samples of slips."""
    force, number = 0.0, 0
    rows, slips = np.empty(x.size), []
    for index, step in enumerate(np.diff(x, prepend=x[0])):
        force += stiffness * step
        level = levels[number % levels.size]
        if abs(force) > level:
            force = math.copysign(level * (1 - drop), force)
            slips.append(index)
            number += 1
        rows[index] = force
    return rows, np.array(slips, dtype=int)


def made(number: int) -> Made:
    """One of the records."""
    rng = np.random.default_rng([40, number])
    shape = SHAPES[number // 2 % 3]
    interface = INTERFACES[int(rng.integers(len(INTERFACES)))]
    has_load_point = rng.random() < 0.7
    frequency = float(10 ** rng.uniform(-2, math.log10(50)))
    per_cycle = round(10 ** rng.uniform(math.log10(60), math.log10(2000)))
    if interface == "stick-slip":
        per_cycle = max(per_cycle, 600)
    cycles = min(
        round(10 ** rng.uniform(math.log10(5), math.log10(80))), max(5, 40_000 // per_cycle)
    )
    friction = float(10 ** rng.uniform(-3, 2))
    half = float(10 ** rng.uniform(math.log10(2e-5), -2))
    reversal = float(10 ** rng.uniform(math.log10(0.03), math.log10(0.3)))
    stiffness = 2 * friction / (2 * half * reversal)
    offset = float(rng.uniform(-0.7, 0.7))
    rest = float(rng.uniform(0.1, 0.4))
    start = float(rng.uniform(0, 1))
    # Reversals are points of the path, between samples.
    grid = start + np.arange(round((cycles + rng.uniform(0, 1)) * per_cycle)) / per_cycle
    ends = np.arange(math.ceil(2 * (start - 0.25)), 2 * (grid[-1] - 0.25)) / 2 + 0.25
    path = np.union1d(grid, ends)
    x = half * waves(shape, path, rest)
    energy, slip_rows = math.nan, np.empty(0, dtype=int)
    if interface == "stick-slip":
        drop = float(rng.uniform(0.15, 0.5))
        # Some samples between slips.
        speed = 4 * half / per_cycle
        stiffness = min(stiffness, friction * drop / (20 * speed))
        levels = friction * (1 + rng.uniform(0, 0.1) * rng.uniform(-1, 1, 997))
        force, slip_rows = pull_in_slips(x, stiffness, levels, drop)
    elif interface == "coulomb":
        force = pull(x, np.array([stiffness]), np.array([friction]))
        energy = 2 * friction * 2 * half - 4 * friction**2 / stiffness
    else:
        count = 12
        shares = rng.dirichlet(np.full(count, 4.0))
        strengths = friction * shares
        reaches = np.linspace(0.3, 1.0, count) * half * reversal
        if interface == "partial slip":
            reaches *= float(rng.uniform(1.2, 3)) / reversal
        springs = strengths / reaches
        force = pull(x, springs, strengths)
        slides = reaches < half
        energy = float(np.sum((4 * strengths * (half - reaches))[slides]))
        stiffness = float(springs.sum())
    signs = np.sign(np.cos(2 * np.pi * path))
    strength = friction
    friction, bias = truth(path, x, force, ends, signs, interface, friction, has_load_point)
    if not math.isfinite(energy):
        energy = measured_energy(path, x, force, ends)
    sampled = np.isin(path, grid)
    samples = np.cumsum(sampled) - 1
    size = float(np.abs(force).max())
    offset *= size
    noise = size * float(10 ** rng.uniform(-3, -1))
    if interface == "stick-slip":
        noise = min(noise, 0.1 * size * drop)
    values = rng.standard_normal(grid.size)
    if rng.random() < 0.3:
        # Behind a filter: correlated over some samples.
        decay = math.exp(-1 / float(rng.uniform(0.5, 3)))
        for row in range(1, values.size):
            values[row] = decay * values[row - 1] + math.sqrt(1 - decay**2) * values[row]
    sensor = -1.0 if has_load_point and rng.random() < 0.3 else 1.0
    shaken = (
        2 * half * float(10 ** rng.uniform(-5, math.log10(3e-3))) * rng.standard_normal(grid.size)
    )
    time = (grid - grid[0]) / frequency
    return Made(
        number,
        f"{interface}, {shape}{'' if has_load_point else ', no load point'}",
        time,
        sensor * force[sampled] + offset + noise * values,
        x[sampled] + shaken if has_load_point else None,
        (ends - grid[0]) / frequency,
        time[samples[slip_rows]],
        friction,
        energy if has_load_point else math.nan,
        offset + sensor * bias,
        stiffness if has_load_point else math.nan,
        strength,
    )


def strokes_between(path: Array, ends: Array) -> list[slice]:
    """Samples of the path in each whole stroke."""
    at = np.searchsorted(path, ends)
    return [slice(one, two + 1) for one, two in pairwise(at)]


def truth(
    path: Array,
    x: Array,
    force: Array,
    ends: Array,
    signs: Array,
    interface: str,
    friction: float,
    has_load_point: bool,
) -> tuple[float, float]:
    """Friction and offset without noise.

    In stick-slip these are means over whole periods; in partial slip over the position in the
    middle 80 %, and springs that never slip keep the force with which they began.
    """
    if interface in {"coulomb", "gross slip"}:
        return friction, 0.0
    means: dict[float, list[float]] = {-1.0: [], 1.0: []}
    # The first strokes depend on the start.
    for part in strokes_between(path, ends)[2:]:
        sign = float(signs[(part.start + part.stop) // 2])
        along = sign * force[part]
        if interface == "partial slip":
            at = sign * x[part] if has_load_point else path[part]
            share = (at - at[0]) / (at[-1] - at[0])
            even = np.linspace(0.1, 0.9, 20_001)
            means[sign].append(float(np.interp(even, share, along).mean()))
        else:
            falls = np.flatnonzero(np.diff(along) < -0.05 * friction)
            if falls.size > 1:
                # Whole periods.
                means[sign].append(float(along[falls[0] + 1 : falls[-1] + 1].mean()))
    forwards, backwards = (float(np.mean(means[one])) for one in (1.0, -1.0))
    return 0.5 * (forwards + backwards), 0.5 * (forwards - backwards)


def measured_energy(path: Array, x: Array, force: Array, ends: Array) -> float:
    """Mean area of the loops of a force without noise."""
    parts = strokes_between(path, ends)[2:]
    areas = [
        sum(float(np.trapezoid(force[part], x[part])) for part in pair)
        for pair in zip(parts[::2], parts[1::2], strict=False)
    ]
    return float(np.mean(areas))


@dataclass
class Verdict:
    """What was found in a record."""

    strokes_right: bool
    reversals_as_slips: int
    false_slips: int
    found_slips: int
    true_slips: int
    late_ends: int
    """Found slips that end more than four samples from where they do."""
    limit: float
    """Stated lower limit of the friction of sliding over that friction; NaN if it is not stated."""
    deviations: dict[str, float]
    """Deviation over the stated error by quantity; NaN if it is not stated."""
    relative: dict[str, float]


def judged(record: Made) -> Verdict:
    """Read a record as a file, and compare its strokes with the truth."""
    import mesoslip
    from mesoslip.analysis.strokes.catalogue import strokes_of
    from mesoslip.errors import FileError

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.csv"
        record.write(file)
        tree = mesoslip.read_trace(file)
    slips = mesoslip.slips(tree)
    starts, stops = slips["start_time"].values, slips["end_time"].values
    interval = float(record.time[1])
    crossing = [
        bool(((record.turns > one - interval) & (record.turns < two + interval)).any())
        for one, two in zip(starts, stops, strict=True)
    ]
    near = 4 * interval
    real = [
        bool(((record.slips >= one - near) & (record.slips <= two + near)).any())
        for one, two in zip(starts, stops, strict=True)
    ]
    late = sum(
        is_real and float(np.abs(record.slips - two).min()) > near
        for is_real, two in zip(real, stops, strict=True)
    )
    reversals = sum(one and not two for one, two in zip(crossing, real, strict=True))
    false = len(real) - sum(real)
    try:
        found = strokes_of(tree)
    except FileError:
        counts = (reversals, false, sum(real), record.slips.size, late)
        return Verdict(False, *counts, math.nan, {}, {})
    begun = np.array([one.start_time for one in found.strokes[0]])
    period = 2 * float(np.median(np.diff(record.turns)))
    expected = record.turns[:-1]
    is_found = [float(np.abs(begun - one).min()) < 0.12 * period for one in expected]
    # The first and the last may be too short to be seen, or be seen as parts.
    right = all(is_found[1:-1]) and len(expected) - 2 <= begun.size <= len(expected)
    truths = {
        "mean_friction": record.friction,
        "loop_energy": record.loop_energy,
        "offset": record.offset,
        "stiffness": record.stiffness,
    }
    deviations, relative = {}, {}
    for name, (key, value) in zip(QUANTITIES, truths.items(), strict=True):
        one = found.overall.get(key)
        if not math.isfinite(value):
            continue
        if one is None:
            deviations[name] = math.nan
            continue
        deviations[name] = (one.mean - value) / max(one.error, 1e-12 * abs(value))
        scale = record.friction if name == "offset" else abs(value)
        relative[name] = (one.mean - value) / scale
    limit = math.nan if found.min_friction is None else found.min_friction.value / record.strength
    counts = (right, reversals, false, sum(real), record.slips.size, late)
    return Verdict(*counts, limit, deviations, relative)


def main() -> None:
    """Judge the records, and print the table of each half."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", nargs="?", type=int, default=0)
    parser.add_argument("after", nargs="?", type=int, default=COUNT)
    parser.add_argument(
        "--seen", action="store_true", help="only the half that was seen, with misses"
    )
    options = parser.parse_args()
    numbers = range(options.first, options.after, 2 if options.seen else 1)
    verdicts = {number: judged(made(number)) for number in numbers}
    for half, name in ((0, "even, seen"), (1, "odd, put aside")):
        mine = [one for number, one in verdicts.items() if number % 2 == half]
        if mine:
            print(f"\n{name}: {len(mine)} records")
            report(mine)
    if options.seen:
        for number, one in verdicts.items():
            wrong = [
                f"{key} {value:+.1f} s ({100 * one.relative.get(key, math.nan):+.2g} %)"
                for key, value in one.deviations.items()
                if not abs(value) <= 1.96
            ]
            if wrong or not one.strokes_right or one.false_slips:
                found = f"strokes {one.strokes_right}, false slips {one.false_slips}"
                print(number, made(number).name, found, "; ".join(wrong))


def report(verdicts: Sequence[Verdict]) -> None:
    """Print the numbers of one half."""
    print("strokes right:", sum(one.strokes_right for one in verdicts))
    print("reversals among slips:", sum(one.reversals_as_slips for one in verdicts))
    print("records with false slips:", sum(one.false_slips > 0 for one in verdicts))
    found, there = (
        sum(getattr(one, key) for one in verdicts) for key in ("found_slips", "true_slips")
    )
    late = sum(one.late_ends for one in verdicts)
    print(f"slips found: {found} of {there}, {late} with an end more than 4 samples off")
    limits = np.array([one.limit for one in verdicts if math.isfinite(one.limit)])
    print(f"lower limits of friction: {limits.size}, above it {int((limits > 1.01).sum())}")
    for quantity in QUANTITIES:
        stated = [one.deviations[quantity] for one in verdicts if quantity in one.deviations]
        known = np.array([one for one in stated if math.isfinite(one)])
        inside = int((np.abs(known) <= 1.96).sum())
        share = inside / max(known.size, 1)
        sizes = [abs(one.relative[quantity]) for one in verdicts if quantity in one.relative]
        print(
            f"{quantity}: within 95 % errors {inside} of {known.size} = {share:.3f}, "
            f"not stated {len(stated) - known.size}; deviation {100 * np.median(sizes):.2g} % "
            f"(median), {100 * np.quantile(sizes, 0.9):.2g} % (90 % quantile)"
        )


if __name__ == "__main__":
    main()
