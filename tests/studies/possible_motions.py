"""Are the motions that `mesoslip cycle` and linear theory call possible those that runs show?

Runs of 4000 and 100 000 contacts and of the master equation, from relaxed and from steady contacts,
over stiffness and velocity of the apparatus of `motions_map.py`. A run of the master equation
should show the motion that `cycle` finds from the same start; one of contacts a motion that is
possible there: smooth sliding if it is linearly stable, an oscillation if `cycle` finds one from
either start. Oscillations that `cycle` saw end after many passages count as possible too. Prints
each run that does not agree, and the table of ``docs/cycles.md``; half an hour on two processors::

    .venv/bin/python tests/studies/possible_motions.py [--workers N]
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import mesoslip
import numpy as np
from mesoslip import Config
from motions_map import APPARATUS, STARTS, STIFFNESSES, VELOCITIES, Motion, motion

# Every second stiffness of the map.
CHOSEN = STIFFNESSES[::2]
COUNTS = 4000, 100_000
MASS, STATIC_FORCE, STIFFNESS = 3.2e-3, 55e-6, 4000.0
# Loadings of the spring in a run, and mean lives of contacts: what their start leaves of phases in
# common is forgotten in some hundred.
LOADINGS, LIVES = 40, 300
# Passages of an oscillation that ends, but may last longer from another start.
LONG_TRANSIENT = 40
# Amplitude of the master equation that is an oscillation, over F_s.
MIN_AMPLITUDE = 0.002
# Samples in a period of the slider on the spring and on the contacts.
SAMPLES = 12


class Run(NamedTuple):
    """A run, and the amplitude of its last third over F_s."""

    stiffness: float
    velocity: float
    start: str
    count: int | None
    amplitude: float

    @property
    def limit(self) -> float:
        """Amplitude of an oscillation at least: thrice the noise of steady contacts."""
        return MIN_AMPLITUDE if self.count is None else 2.4 * self.count**-0.5

    @property
    def oscillates(self) -> bool:
        return self.amplitude > self.limit


def run(stiffness: float, velocity: float, start: str, count: int | None) -> Run:
    """A run of so many contacts, or of the master equation if None."""
    loading = STATIC_FORCE / stiffness / velocity
    duration = max(LOADINGS * loading, LIVES * STATIC_FORCE / STIFFNESS / velocity)
    period = 2 * math.pi * math.sqrt(MASS / (stiffness + STIFFNESS))
    changes = {
        "run.engine": "me" if count is None else "eq",
        "run.duration": duration,
        "slider.stiffness": stiffness,
        "drive.velocity": velocity,
        "contacts.initial": start,
        "output.interval": period / SAMPLES,
        **({} if count is None else {"contacts.count": count}),
    }
    tree = mesoslip.run(Config.from_dict(APPARATUS).replace(changes), executor=1)
    force = tree["spring_force"].values[0]
    low, high = np.percentile(force[2 * len(force) // 3 :], (5, 95))
    return Run(stiffness, velocity, start, count, float(high - low) / 2 / STATIC_FORCE)


def expected(
    one: Run, found: Sequence[Motion], long_transient: float = LONG_TRANSIENT
) -> set[bool]:
    """Whether the run may oscillate, and may not."""
    point = one.stiffness, one.velocity
    here = [other for other in found if (other.stiffness, other.velocity) == point]
    possible = set()
    for other in here:
        if one.count is None and other.start != one.start:
            continue
        if other.kind == "smooth":
            possible.add(False)
        if other.kind != "smooth" or other.cycles > long_transient:
            # The amplitude of a cycle is from maximum to minimum.
            is_small = 0 < other.amplitude / 2 < one.limit
            possible |= {True, False} if is_small else {True}
    return possible | ({False} if one.count and here[0].smooth_stable else set())


def computed(workers: int) -> Iterator[Motion | Run]:
    points = [(float(one), float(other)) for other in VELOCITIES for one in CHOSEN]
    with ProcessPoolExecutor(workers) as pool:
        tasks = [pool.submit(motion, *point, start) for point in points for start in STARTS]
        tasks += [
            pool.submit(run, *point, start, count)
            for count in (None, *COUNTS)
            for point in points
            for start in STARTS
        ]
        for task in tasks:
            yield task.result()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=2)
    found: list[Motion] = []
    runs: list[Run] = []
    for one in computed(parser.parse_args().workers):
        print(one, flush=True)
        if isinstance(one, Motion):
            found.append(one)
        else:
            runs.append(one)
    for count in (None, *COUNTS):
        of_kind = [one for one in runs if one.count == count]
        wrong = [one for one in of_kind if one.oscillates not in expected(one, found)]
        strict = sum(one.oscillates in expected(one, found, math.inf) for one in of_kind)
        both = sum(len(expected(one, found)) > 1 for one in of_kind)
        print(
            f"{'master equation' if count is None else f'N = {count}'}: {len(of_kind)} runs, "
            f"{len(of_kind) - len(wrong)} as expected, {strict} without transient oscillations, "
            f"{both} where both motions are possible"
        )
        for one in wrong:
            print("   ", one, "expected", expected(one, found))


if __name__ == "__main__":
    main()
