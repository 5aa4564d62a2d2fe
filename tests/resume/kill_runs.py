"""Kill runs of all kinds at random moments, resume them, and compare every byte.

Half of the kills are of runs that had been resumed. Of each kind it is checked that

- the output is to the bit that of a run that was not killed,
- a kill costs no more than what came after the last checkpoint,
- nothing but the output remains.

A short version is in tests/python/test_resume.py.
"""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from apart import Command
from conftest import klein_tables
from invariants import differences
from kinds import AGEING, BASE, COARSE, FORCE, LAYERED, NEWBORN, RANDOM, THERMAL
from mesoslip import Config
from mesoslip.simulation.checkpoint import PREVIOUS, STATE, checkpoint_folder
from tally import Tally
from test_resume import read_whole

# Runs that take some seconds, so that there is time to be killed; a fast drive, so that much
# happens in them.
LONG: dict[str, Any] = {
    "run__duration": 60.0,
    "output__interval": 1e-3,
    "output__slip_interval": 1e-4,
}
SITES = {"strength": 0.3, "lattice": "triangular", "columns": 60, "rows": 68}
SOFT = {"contacts__stiffness": 200.0, "contacts__threshold__relative_width": 0.3}
# So that a block under a force creeps, and slides in the end.
RAMP: dict[str, Any] = {"drive": {"force_rate": 4e-7}}
KINDS: dict[str, dict[str, Any]] = {
    "rigid": {"run__duration": 100.0},
    "rigid, realizations": {"run__realizations": 5, "run__duration": 25.0},
    "rigid, me": {"run__engine": "me", "run__duration": 40.0},
    "rigid, lattice": SOFT | {"interaction": SITES, "output__snapshot_size": 500},
    "rigid, ageing": AGEING | {"run__duration": 25.0},
    "rigid, thermal": THERMAL | NEWBORN | {"run__duration": 25.0},
    "rigid, thermal, me": THERMAL | RANDOM | COARSE | {"run__duration": 40.0},
    "force, thermal": FORCE | THERMAL | RAMP | {"run__duration": 40.0},
    "force, thermal, me": FORCE | THERMAL | COARSE | RAMP | {"run__duration": 5.0},
    "prescribed": {"slider": {"kind": "prescribed"}, "run__duration": 40.0},
    "layered": {"slider": LAYERED | {"layers": 16, "base": BASE}, "run__duration": 8.0},
    "layered, bdf": {
        "slider": LAYERED | {"solver": {"method": "bdf", "relative_tolerance": 1e-5}},
        "contacts__count": 200,
        "run__duration": 6.0,
    },
    "quasistatic": {
        "slider": {"kind": "quasistatic", "stiffness": 97.0},
        "run__duration": 100.0,
        "interaction": SITES,
    },
}

# Time that a run has [s].
MAX_SECONDS = 600.0


def attack(
    kind: str, kills: int, folder: Path, random: np.random.Generator, *, scale: float = 1.0
) -> Tally:
    """Kill a run of a kind so many times at least, again and again from the beginning.

    Of runs that start and of runs that were resumed there are as many kills; the random numbers
    give the moments. The folder is empty, and what the runs print is written beside it.
    """
    changes = LONG | KINDS[kind]
    changes["run__duration"] *= scale
    config = folder / "run.toml"
    config.write_text(Config.from_dict(klein_tables(**changes)).to_toml())
    expected, output = folder / "whole.nc", folder / "killed.nc"
    tally = Tally(["runs", "resumed runs"])
    end = Command(["run", config, "-o", expected, "--quiet"], folder).wait(MAX_SECONDS)
    assert end is not None
    assert end.status == 0, end.err
    length = end.seconds
    whole = read_whole(expected)
    place = checkpoint_folder(output)
    line = ["run", config, "-o", output, "--resume", "--checkpoint-interval", 0.03, "--quiet"]
    while min(tally.kills.values()) < kills:
        status, seconds = -1, 0.0
        # It may even be killed between the last renaming and the removal of its checkpoint.
        while status != 0 or not output.exists():
            is_resumed = saved_seconds(place) > 0
            process = Command(line, folder)
            if is_resumed and tally.kills["resumed runs"] >= kills:
                end = process.wait(MAX_SECONDS)
            else:
                end = process.work(float(random.uniform(0.05, 0.7)) * length)
            if end is None:
                process.kill()
                tally.kills["resumed runs" if is_resumed else "runs"] += 1
                now = saved_seconds(place)
                if now < seconds and not output.exists():
                    tally.lose(f"{kind}: the checkpoint was of {seconds:.3f} s, is of {now:.3f} s")
                seconds = max(seconds, now)
                # So that a run comes to its end, however little of it is saved.
                length *= 1.02
                continue
            status = end.status
            if status != 0:
                tally.lose(f"{kind}: exit status {status}: {end.err}")
                return tally
        tally.compare(kind, differences(whole, read_whole(output)))
        left = {path.name for path in folder.iterdir()} - {"run.toml", "whole.nc", "killed.nc"}
        if left:
            tally.lose(f"{kind}: left behind: {sorted(left)}")
        output.unlink()
    return tally


def saved_seconds(place: Path) -> float:
    """Wall time of a run up to its checkpoint, which grows with each of them [s]."""
    for name in (STATE, PREVIOUS):
        try:
            with np.load(place / name) as file:
                return float(json.loads(str(file["header"]))["wall_seconds"])
        except FileNotFoundError:
            continue
    return 0.0


def attack_all(kills: int, random: np.random.Generator, *, scale: float = 1.0) -> Tally:
    """Kill runs of each kind; half of the kills are of resumed runs."""
    total = Tally(["runs", "resumed runs"])
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "folder"
            folder.mkdir()
            total.add(attack(kind, -(-kills // (2 * len(KINDS))), folder, random, scale=scale))
        print(f"{kind:24} {total}", flush=True)
    return total
