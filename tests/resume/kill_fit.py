"""Kill a fit at random moments, call it again, and compare every byte of the posterior.

Of each fit it is checked that

- the posterior is to the bit that of a fit that was not killed,
- no simulation that was stored is lost or written again,
- nothing but the posterior remains.

A short version is in tests/python/test_fit_kill.py.
"""

import tempfile
from pathlib import Path

import emcee  # noqa: F401
import mesoslip.inference.fit_trace  # noqa: F401
import numpy as np
import tomli_w
from apart import Command
from invariants import differences
from mesoslip.output.writing import write
from tally import Tally
from test_fit import experiment, fit_tables
from test_resume import read_whole

# Time that a fit has [s], and maximum number of times that one is killed before it may end.
MAX_SECONDS = 600.0
MAX_KILLS = 3


def stored(folder: Path) -> dict[str, tuple[int, int]]:
    """Files of simulations, and which file and of what moment each is."""
    states = {}
    for path in (folder / "posterior.simulations").glob("[0-9]*.json"):
        try:
            state = path.stat()
        except FileNotFoundError:
            continue
        states[path.name] = (state.st_ino, state.st_mtime_ns)
    return states


def prepared(folder: Path) -> list[object]:
    """The command, with a trace and what is to be fitted in a folder."""
    few = {"contacts__count": 50, "run__duration": 2.0}
    write(experiment(**few), folder / "trace.nc")
    tables = fit_tables()
    tables["contacts"]["count"], tables["run"]["duration"] = few.values()
    (folder / "fit.toml").write_text(tomli_w.dumps(tables))
    return ["fit", folder / "trace.nc", folder / "fit.toml", "--quiet"]


def attack(kills: int, folder: Path, random: np.random.Generator) -> Tally:
    """Kill a fit so many times at least, again and again from the beginning; each comes to its end.

    The random numbers give the moments; what the fits print is written beside the empty folder.
    """
    line = prepared(folder)
    expected, output = folder / "whole.nc", folder / "posterior.nc"
    tally = Tally(["fits"])
    end = Command([*line, "-o", expected], folder).wait(MAX_SECONDS)
    assert end is not None
    assert end.status == 0, end.err
    length = end.seconds
    whole = read_whole(expected)
    kept = {path.name for path in folder.iterdir()} | {"posterior.nc"}
    while tally.kills["fits"] < kills:
        remaining, there = int(random.integers(1, MAX_KILLS + 1)), {}
        while True:
            process = Command([*line, "-o", output], folder)
            seconds = float(random.uniform(0.02, 0.9)) * length
            end = process.work(seconds) if remaining else process.wait(MAX_SECONDS)
            if end is not None:
                break
            process.kill()
            if not remaining:
                tally.lose("a fit does not end")
                return tally
            remaining -= 1
            tally.kills["fits"] += 1
            now = stored(folder)
            if not output.exists():
                gone = [name for name, state in there.items() if now.get(name) != state]
                for name in gone:
                    tally.lose(f"simulation {name} was lost or written again")
            there = now
        if end.status != 0:
            tally.lose(f"exit status {end.status}: {end.err}")
            return tally
        tally.compare("fit", differences(whole, read_whole(output)))
        left = {path.name for path in folder.iterdir()} - kept
        if left:
            tally.lose(f"left behind: {sorted(left)}")
        output.unlink()
    return tally


def attack_in_new_folder(kills: int, random: np.random.Generator) -> Tally:
    """Kill fits in a folder that is removed afterwards; see `attack`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "folder"
        folder.mkdir()
        return attack(kills, folder, random)
