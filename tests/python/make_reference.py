"""Write the reference outputs anew: on purpose only, by ``make reference``.

What changed is then to be explained in the commit that changes them.
"""

from __future__ import annotations

from pathlib import Path

import mesoslip
from conftest import klein_tables
from mesoslip.output import files

FOLDER = Path(__file__).parents[1] / "reference"

# Up to the end of the first slip: later the motion is too sensitive to the last digit.
STAGES = [(0.02, 1e-6), (0.005, 0.0), (0.06, -1e-6), (0.04, 2e-6)]
CASES = {
    "klein": klein_tables(run__duration=1.94, output__slip_interval=1e-4),
    "infinite": klein_tables(run__engine="me", run__duration=1.94, output__slip_interval=1e-4),
    "block": klein_tables(
        run__duration=None,
        drive={"stage": [{"duration": time, "velocity": speed} for time, speed in STAGES]},
        slider={"kind": "prescribed"},
        contacts__count=500,
        contacts__initial="steady",
        contacts__coupling="equal",
        contacts__threshold={"law": "weibull", "relative_width": 0.5},
    ),
}

if __name__ == "__main__":
    for name, tables in CASES.items():
        FOLDER.mkdir(exist_ok=True)
        files.write(mesoslip.run(tables), FOLDER / f"{name}.nc")
        print(FOLDER / f"{name}.nc")
