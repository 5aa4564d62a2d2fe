"""Kill a sweep and its workers at random moments, call it again, and compare every byte.

A sweep of 300 points is killed, as a whole or one of its workers, and called again until it is
whole; and again from the beginning until there were so many kills. Of each it is checked that

- the dataset is to the bit that of a sweep that nobody has killed,
- no point that was stored is computed or written again,
- no more points are computed than there are, and were under way when something was killed,
- workers end with the sweep.

A short version is in tests/python/test_sweep_kill.py.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from conftest import klein_tables
from mesoslip import Config
from tally import Tally

WORKERS = 2
OWN = '''
"""A measure that states when a point is computed, and takes its time."""
import os, time, tomllib

def printed(tree):
    """nothing"""
    delay = tomllib.loads(tree.attrs["configuration"])["contacts"]["delay"]
    realization = int(tree["realization"].values[0])
    with open(os.environ["POINT_LOG"], "a") as file:
        file.write(f"{time.time_ns()} {delay!r}-{realization}\\n")
    time.sleep(float(os.environ["POINT_SECONDS"]))
    return realization
'''
SWEEP = """
base = "base.toml"
[sweep]
realizations = 10
measures = ["mean_force", "breaks", "own.py:printed"]
[sweep.grid]
"contacts.delay" = { from = "0.1 ms", to = "1 ms", points = POINTS }
"""


@dataclass
class Study:
    """What was done to a sweep, and what was wrong with it."""

    folder: Path
    combinations: int
    random: np.random.Generator
    seconds: float = 0.2
    sweep_kills: int = 0
    worker_kills: int = 0
    computed: int = 0
    allowed: int = 0
    wrong: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        base = klein_tables(contacts__count=100, run__duration=1.0)
        (self.folder / "base.toml").write_text(Config.from_dict(base).to_toml())
        (self.folder / "own.py").write_text(OWN)
        text = SWEEP.replace("POINTS", str(self.combinations))
        (self.folder / "sweep.toml").write_text(text)

    @property
    def points(self) -> int:
        return 10 * self.combinations

    def start(self, output: Path, log: Path, seconds: float, pool: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "mesoslip", "sweep", str(self.folder / "sweep.toml")]
        command += ["-o", str(output), "--quiet", "--workers", str(WORKERS), "--pool", pool]
        environment = {"POINT_LOG": str(log), "POINT_SECONDS": str(seconds)}
        return subprocess.Popen(
            command,
            env={**os.environ, **environment, "OPENBLAS_NUM_THREADS": "1"},
            stderr=subprocess.PIPE,
        )

    def expected(self) -> xr.Dataset:
        """The dataset of a sweep that nobody kills."""
        output = self.folder / "whole.nc"
        process = self.start(output, self.folder / "whole.log", 0.0, "threads")
        _, printed = process.communicate()
        assert process.returncode == 0, printed.decode()
        return xr.load_dataset(output)

    def attack(self, name: str, whole: xr.Dataset, kills: int) -> None:
        """Kill a sweep so many times at most, until it is whole."""
        output, log = self.folder / f"{name}.nc", self.folder / f"{name}.log"
        log.touch()
        stored: dict[Path, tuple[int, int]] = {}
        told_before: dict[str, int] = {}
        sweep_kills = worker_kills = 0
        while not output.exists():
            pool = str(self.random.choice(["processes", "both"]))
            process = self.start(output, log, self.seconds, pool)
            end = time.monotonic() + float(self.random.uniform(1.0, 8.0))
            while process.poll() is None:
                time.sleep(float(self.random.uniform(0.1, 0.8)))
                enough = sweep_kills + worker_kills >= kills
                children = workers_of(process.pid)
                if enough or process.poll() is not None:
                    continue
                if time.monotonic() > end:
                    process.send_signal(signal.SIGKILL)
                    sweep_kills += 1
                    self._check_ended(children)
                elif children and self.random.random() < 0.7:
                    try:
                        os.kill(int(self.random.choice(children)), signal.SIGKILL)
                        worker_kills += 1
                    except ProcessLookupError:
                        continue
                self._check_stored(output, stored)
            _, printed = process.communicate()
            # A point may have cost too many workers: then it fails, and the next call computes it.
            if process.returncode not in {0, 1, -signal.SIGKILL}:
                self.wrong.append(f"exit status {process.returncode}: {printed.decode()}")
                return
            if process.returncode == 1 and b"3 workers died" in printed:
                output.unlink()
        self._check_stored(output, stored)
        self._check_log(log, output, told_before)
        self._check_numbers(whole, xr.load_dataset(output))
        computed = len(log.read_text().splitlines())
        allowed = self.points + worker_kills + (WORKERS + 1) * sweep_kills
        if computed > allowed:
            self.wrong.append(f"{computed} points computed, {allowed} allowed")
        self.computed += computed
        self.allowed += allowed
        self.sweep_kills += sweep_kills
        self.worker_kills += worker_kills

    def _check_ended(self, children: list[int]) -> None:
        """Workers of a sweep that was killed end soon."""
        deadline = time.monotonic() + 10
        while alive := [one for one in children if is_alive(one)]:
            if time.monotonic() > deadline:
                self.wrong.append(f"workers {alive} go on without their sweep")
                return
            time.sleep(0.02)

    def _check_stored(self, output: Path, stored: dict[Path, tuple[int, int]]) -> None:
        """Points that were stored are neither lost nor written again."""
        states = {path: path.stat() for path in points_of(output)}
        there = {path: (state.st_ino, state.st_mtime_ns) for path, state in states.items()}
        for path, state in stored.items():
            if there.get(path) != state:
                self.wrong.append(f"{path.name} was lost or written again")
        stored.update(there)

    def _check_log(self, log: Path, output: Path, last: dict[str, int]) -> None:
        """No point was computed after it had been stored."""
        for line in log.read_text().splitlines():
            moment, point = line.split()
            last[point] = max(last.get(point, 0), int(moment))
        for path in points_of(output):
            body = json.loads(path.read_text())
            point = f"{body['point']['contacts.delay']!r}-{body['realization']}"
            if last[point] > path.stat().st_mtime_ns:
                self.wrong.append(f"{point} was computed after it had been stored")
        if len(last) != self.points:
            self.wrong.append(f"{len(last)} of {self.points} points were ever computed")

    def _check_numbers(self, whole: xr.Dataset, killed: xr.Dataset) -> None:
        for name in whole.variables:
            if whole[name].values.tobytes() != killed[name].values.tobytes():
                self.wrong.append(f"{name} differs")


def points_of(output: Path) -> list[Path]:
    """The files of the points of a sweep, without those that are being written."""
    folder = output.with_name(f"{output.stem}.points")
    others = (".", "manifest.json")
    return [path for path in folder.glob("*.json") if not path.name.startswith(others)]


def workers_of(process: int) -> list[int]:
    """Processes that the threads of a process have started."""
    children: list[int] = []
    try:
        for path in Path(f"/proc/{process}/task").glob("*/children"):
            children += map(int, path.read_text().split())
    except OSError:
        return []
    return children


def is_alive(process: int) -> bool:
    """Whether a process is there, and not only waits to be buried."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] not in {"Z", "X"}


def attack_in_new_folder(kills: int, random: np.random.Generator) -> Tally:
    """Kill sweeps and their workers so many times at least, in a folder that is removed."""
    tally = Tally(["sweeps", "workers of sweeps"])
    with tempfile.TemporaryDirectory() as folder:
        study = Study(Path(folder), 30, random)
        whole = study.expected()
        while study.sweep_kills + study.worker_kills < kills and not study.wrong:
            left = kills - study.sweep_kills - study.worker_kills
            study.attack(f"killed{tally.compared}", whole, left)
            tally.compared += 1
            print(
                f"{tally.compared} sweeps of {study.points} points: {study.sweep_kills} kills of "
                f"sweeps, {study.worker_kills} of workers; {study.computed} points computed, of "
                f"which {study.computed - tally.compared * study.points} had been under way",
                flush=True,
            )
    tally.kills.update({"sweeps": study.sweep_kills, "workers of sweeps": study.worker_kills})
    for message in study.wrong:
        (tally.differing if message.endswith("differs") else tally.lost).append(message)
    return tally
