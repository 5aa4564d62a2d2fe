"""How long does an irregular motion last beside stable smooth sliding?

The apparatus of `motions_map.py` at 0.05 um/s, by the master equation. Irregular motions with a
spring of 500 N/m, at different times, go on with stiffer springs, up to the last fall of the force
by more than 4 % of F_s in a window of two seconds. Prints the mean time until then for each spring,
with its error by an exponential law: ``docs/cycles.md``; a quarter of an hour::

    .venv/bin/python tests/studies/transient_chaos.py
"""

import math

import numpy as np
from mesoslip import Config
from mesoslip.cycles.branch import adapted
from mesoslip.cycles.cycle import master_equation
from mesoslip.cycles.section import Motion
from mesoslip.simulation.kernel import Words
from motions_map import APPARATUS

VELOCITY, SOFT = 0.05e-6, 500.0
STIFFNESSES = (500.0, 600.0, 700.0, 770.0, 819.0, 870.0, 930.0, 1000.0)
# Motions with each spring, time between their starts, window, and maximum time [s].
COUNT, BETWEEN, WINDOW, LONGEST = 12, 3.0, 2.0, 300.0
MIN_FALL = 0.04


def configuration(stiffness: float) -> Config:
    changes = {
        "slider.stiffness": stiffness,
        "drive.velocity": VELOCITY,
        "contacts.initial": "relaxed",
    }
    return master_equation(Config.from_dict(APPARATUS).replace(changes))


def starts() -> list[Words]:
    motion = Motion(configuration(SOFT))
    words, _ = motion.advance(None, 30.0)
    found = []
    for _ in range(COUNT):
        words, _ = motion.advance(words, BETWEEN)
        found.append(words)
    return found


def lifetime(words: Words, config: Config) -> tuple[float, bool]:
    """Time until a motion has ended [s], or for which it was followed; and whether it has."""
    motion, time = Motion(config), 0.0
    while time < LONGEST:
        words, trace = motion.advance(words, WINDOW)
        force = trace["spring_force"]
        fall = float(np.max(np.maximum.accumulate(force) - force))
        if fall < MIN_FALL * config.contacts.static_force:
            return time, True
        time += WINDOW
    return time, False


def main() -> None:
    first = configuration(SOFT)
    states = starts()
    for stiffness in STIFFNESSES:
        config = configuration(stiffness)
        found = [lifetime(adapted(one, first, config), config) for one in states]
        ended = sum(has_ended for _, has_ended in found)
        total = math.fsum(time for time, _ in found)
        mean = total / max(ended, 1)
        print(
            f"{stiffness:g} N/m: {ended} of {len(found)} end; mean "
            + (f"{mean:.3g} +- {mean / math.sqrt(ended):.2g} s" if ended else f"over {total:.3g} s")
            + f" ({', '.join(f'{time:.0f}' for time, _ in found)})",
            flush=True,
        )


if __name__ == "__main__":
    main()
