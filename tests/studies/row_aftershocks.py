"""Omori's law in a row of blocks: events that are not whole after those that are.

Contacts without and with ageing and temperature (Braun and Tosatti, Phys. Rev. E 90, 032403
(2014), found aftershocks with ageing and an elastic slider); numbers for docs/interface.md.

    python tests/studies/row_aftershocks.py [REALIZATIONS [VELOCITY [DISPLACEMENT]]]
"""

import sys

import mesoslip
import numpy as np
import xarray as xr
from mesoslip.analysis.events.laws import omori

WHOLE = 1

BASE = {
    "contacts.count": 640,
    "slider.loading": "both",
    "slider.top_stiffness": "60 kN/m",
    "output.interval": "5 ms",
}
KINDS = {
    "plain": {},
    "ageing, relax 20 ms": {
        "contacts.ageing.law": "relax",
        "contacts.ageing.time": "20 ms",
        "contacts.ageing.young_force_ratio": 0.3,
        "contacts.ageing.young_relative_width": 0.3,
    },
    "ageing, log": {
        "contacts.ageing.law": "log",
        "contacts.ageing.time": "0.1 ms",
        "contacts.ageing.growth": 0.05,
    },
    "temperature": {"contacts.thermal.rate": "1e4 1/s", "contacts.thermal.force_ratio": 0.03},
}


def sequences(events: xr.Dataset, duration: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Times [s] and kinds of the events of all realizations, each from its first whole event on,
    one after another, and their duration."""
    times, kinds, offset = [], [], 0.0
    for _, own in events.groupby("realization_index"):
        start, kind = own["start_time"].values, own["kind"].values
        if not kind.any():
            continue
        first = start[kind == WHOLE][0]
        times.append(start[start >= first] - first + offset)
        kinds.append(kind[start >= first])
        offset += duration - first
    return np.concatenate(times), np.concatenate(kinds), offset


def main() -> None:
    realizations, velocity, displacement = (
        *sys.argv[1:],
        *("10", "1 mm/s", "3 mm")[len(sys.argv) - 1 :],
    )
    drive = {"drive.velocity": velocity, "run.drive_displacement": displacement}
    for name, changes in KINDS.items():
        config = mesoslip.Config.load(
            "runs/precursors.toml",
            [f"{key}={value}" for key, value in (BASE | drive | changes).items()],
        ).replace({"run.realizations": int(realizations)})
        events = mesoslip.fronts(mesoslip.run(config))["events"].to_dataset()
        times, kinds, end = sequences(events, config.expected_duration)
        whole = times[kinds == WHOLE]
        others = times[kinds != WHOLE]
        since = others - whole[np.searchsorted(whole, others, "right") - 1]
        waits = np.diff(whole)
        print(
            f"{name}: {whole.size} whole, every {1e3 * waits.mean():.1f} ms "
            f"(standard deviation {1e3 * waits.std():.1f}); {others.size} others"
        )
        if others.size:
            deciles = 1e3 * np.quantile(since, [0.1, 0.25, 0.5, 0.75, 0.9])
            print("  after the last whole one [ms; 10, 25, 50, 75, 90 %]:", deciles.round(2))
            print(" ", omori(times, kinds.astype(float), WHOLE, end), flush=True)


if __name__ == "__main__":
    main()
