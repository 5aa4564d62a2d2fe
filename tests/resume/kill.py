"""Kill runs of all kinds at random moments, take them up, and compare every byte.

Usage: kill.py [KILLS]. Prints a line for each kind, and what was lost or differed; exit status 0 if
nothing did. A short version is in tests/python/test_resume.py.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from conftest import klein_tables
from kinds import BASE, LAYERED
from mesoslip import Config
from test_resume import assert_same, read_whole

# Runs that take some seconds, so that there is time to be killed; a fast drive, so that much
# happens in them.
LONG: dict[str, Any] = {
    "run__duration": 60.0,
    "output__interval": 1e-3,
    "output__slip_interval": 1e-4,
}
PLACES = {"strength": 0.3, "lattice": "triangular", "columns": 60, "rows": 68}
SOFT = {"contacts__stiffness": 200.0, "contacts__threshold__relative_width": 0.3}
KINDS: dict[str, dict[str, Any]] = {
    "rigid": {"run__duration": 100.0},
    "rigid, realizations": {"run__realizations": 5, "run__duration": 25.0},
    "rigid, me": {"run__engine": "me", "run__duration": 40.0},
    "rigid, lattice": SOFT | {"interaction": PLACES, "output__snapshot_size": 500},
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
        "interaction": PLACES,
    },
}


def start(config: Path, output: Path, *more: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "mesoslip", "run", str(config), "-o", str(output), "--quiet"]
    return subprocess.Popen([*command, *more], stderr=subprocess.PIPE)


def attack(kind: str, kills: int, folder: Path, random: np.random.Generator) -> tuple[int, int]:
    """Kill a run so many times at least, again and again from the beginning; kills, differences."""
    config = folder / "run.toml"
    config.write_text(Config.from_dict(klein_tables(**LONG | KINDS[kind])).to_toml())
    expected = folder / "whole.nc"
    begun = time.monotonic()
    process = start(config, expected)
    process.communicate()
    assert process.returncode == 0
    length = time.monotonic() - begun
    whole = read_whole(expected)
    done = differences = 0
    while done < kills:
        output = folder / "killed.nc"
        # It may even be killed between the last renaming and the removal of its checkpoint.
        while process.returncode != 0 or not output.exists():
            process = start(config, output, "--resume", "--checkpoint-interval", "0.1")
            try:
                process.wait(float(random.uniform(0.2, 1.0)) * (1.0 + 0.5 * length))
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                done += 1
            _, told = process.communicate()
            if process.returncode not in {0, -signal.SIGKILL}:
                print(f"{kind}: exit status {process.returncode}: {told.decode()}")
                return done, differences + 1
        try:
            assert_same(whole, read_whole(output))
        except AssertionError as error:
            print(f"{kind}: {error}")
            differences += 1
        left = {path.name for path in folder.iterdir()} - {"run.toml", "whole.nc", "killed.nc"}
        if left:
            print(f"{kind}: left behind: {left}")
            differences += 1
        output.unlink()
    return done, differences


def main() -> None:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    random = np.random.default_rng(int(os.environ.get("SEED", "1")))
    total = wrong = 0
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as folder:
            done, differences = attack(kind, -(-kills // len(KINDS)), Path(folder), random)
        print(f"{kind:24} {done:5d} kills, {differences} differences", flush=True)
        total += done
        wrong += differences
    print(f"{total} kills, {wrong} differences")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
