"""What runs of the master equation with temperature say of their errors, over random runs.

The first loading of a rigid slider, half of the runs with ageing: `force_error` beside the error
before the first slip, the difference from a fine run. For ``docs/validation.md``::

    .venv/bin/python tests/studies/thermal_errors.py
"""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from mesoslip import Config, Realization
from mesoslip.simulation.recorded_tables import SLIP_COLUMNS, TRACE_COLUMNS

CASES = 24
FINEST, RESOLUTIONS = 0.0625, (1.0, 0.5, 0.25)
# Displacement of the drive, some stretches of contacts, and maximum duration.
PATH, MAX_DURATION = 3.6e-7, 0.6
KLEIN = tomllib.loads((Path(__file__).parents[2] / "runs" / "klein.toml").read_text())
AGEING = {"law": "relax", "time": 0.05, "young_force_ratio": 0.7, "young_relative_width": 0.2}


def random_tables(number: int) -> dict[str, Any]:
    """A configuration of a number."""
    random = np.random.default_rng([11, number])
    thermal = {"force_ratio": 10 ** random.uniform(-2, -1.1), "rate": 10 ** random.uniform(1, 4)}
    velocity = float(10 ** random.uniform(-6.5, -5))
    contacts: dict[str, Any] = KLEIN["contacts"] | {
        "coupling": "equal",
        "delay": float(random.choice([0, 1e-3, 3e-3])),
        "thermal": {name: float(value) for name, value in thermal.items()},
        "threshold": KLEIN["contacts"]["threshold"]
        | {"relative_width": float(random.uniform(0.05, 0.3))},
    }
    if number % 2:
        contacts["ageing"] = AGEING
    return KLEIN | {
        "contacts": contacts,
        "drive": {"velocity": velocity},
        "run": {"engine": "me", "duration": min(MAX_DURATION, PATH / velocity)},
        "output": {"interval": "1 ms"},
    }


def run(tables: dict[str, Any], resolution: float) -> tuple[Realization, float]:
    """A run with a resolution, and the time of its first slip [s]."""
    config = Config.from_dict(tables | {"run": tables["run"] | {"resolution": resolution}})
    one = Realization(config)
    while not one.finished:
        one.advance()
    starts = one.slips[:, SLIP_COLUMNS.index("start_time")]
    return one, float(np.min(starts, initial=np.inf))


def main() -> None:
    """Print the ratio of error and `force_error` for each run and resolution."""
    force = TRACE_COLUMNS.index("contact_force")
    all_ratios = []
    for number in range(CASES):
        tables = random_tables(number)
        finest, slip = run(tables, FINEST)
        ratios = []
        for resolution in RESOLUTIONS:
            one, own_slip = run(tables, resolution)
            before = finest.trace[:, 0] < min(slip, own_slip)
            error = np.max(np.abs(one.trace[before, force] - finest.trace[before, force]))
            ratios.append(float(error / one.force_error))
        all_ratios.append(ratios)
        print(number, *(f"{one:.2f}" for one in ratios), flush=True)
    for resolution, ratio in zip(RESOLUTIONS, np.array(all_ratios).T, strict=True):
        print(
            f"resolution {resolution}: median {np.median(ratio):.2f}, {ratio.min():.2f} to "
            f"{ratio.max():.2f}, {np.sum((ratio < 5) & (ratio > 0.2))} within a factor of 5"
        )


if __name__ == "__main__":
    main()
