"""Attacks at limits: files without rights, other versions, large sweeps, long seeds, wrong calls.

What holds in each: files that the program did not make are as they were.
"""

import inspect
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import mesoslip
import numpy as np
import tomli_w
import xarray as xr
from apart import Command, call, limit_memory
from attacks import OUTCOMES, Attack, Report, advanced, read, wrong_words
from configurations import NASTY
from conftest import klein_tables
from files import SWEEP, look_of, touched
from invariants import differences
from kinds import FAST, KINDS
from mesoslip import Config, MesoslipError
from mesoslip.campaign import point
from mesoslip.simulation.checkpoint import PREVIOUS, STATE, checkpoint_folder

# Time that a command has [s].
SECONDS = 60.0
# Resident memory of a sweep or run of ten thousand [bytes].
MAX_MEMORY = 700 * 2**20
# User and group without rights.
NOBODY = 65534


def _case(folder: Path, more: str = "", **changes: Any) -> Path:
    path = folder / "case.toml"
    path.write_text(tomli_w.dumps(klein_tables(**FAST | KINDS["rigid"] | changes)) + more)
    return path


def _as_nobody() -> None:
    # The interpreter may lie where others cannot read.
    import matplotlib.pyplot  # noqa: F401
    import mesoslip.plots.plot  # noqa: F401

    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)


def read_only(name: str, folder: Path) -> Report:
    """Folders or files that may not be written or read: one message, and with rights all is well.

    The command is run by a user without rights, which needs an administrator.
    """
    if os.geteuid() != 0:
        return Report("no administrator")
    random = Random(name)
    # Folders of temporary files are closed to others.
    for one in (folder.parent, folder.parent.parent):
        one.chmod(0o755)
    place = folder / "place"
    place.mkdir()
    output = place / "out.nc"
    what = random.choice(["run", "resume", "sweep", "sweep", "csv", "plot"])
    case = _case(folder, SWEEP if what == "sweep" else "")
    command = "sweep" if what == "sweep" else "run"
    arguments: list[object] = [command, case, "-o", output, "--quiet"]
    whole = call([*arguments[:3], folder / "whole.nc", "--quiet"], folder, SECONDS)
    expected = read(folder / "whole.nc")
    if what == "resume":
        advanced(Config.load(case), checkpoint_folder(output), 100, [])
        arguments.append("--resume")
    elif what == "sweep":
        shutil.move(folder / "whole.points", place / "out.points")
        for path in sorted((place / "out.points").glob("[0-9a-f]*.json"))[::2]:
            path.unlink()
    elif what in {"csv", "plot"}:
        made = place / "new.csv" if what == "csv" else place / "new.png"
        options = ["slips", "--csv"] if what == "csv" else ["plot", "-o"]
        arguments = [options[0], folder / "whole.nc", options[1], made]
    _take_rights(random, place)
    before = look_of(folder)
    process = Command(arguments, folder, _as_nobody)
    printed = process.wait(SECONDS)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: {what}"])
    report = Report(
        OUTCOMES.get(printed.status, "other"), wrong_words(whole) + wrong_words(printed)
    )
    after = look_of(folder)
    own = {Path(one) for one in before if "out." in one} if printed.status == 0 else set()
    report.problems += touched(before, after, own)
    if printed.status != 0 and set(after) - set(before):
        report.problems.append(f"left over: {sorted(set(after) - set(before))}")
    for path in [place, *place.rglob("*")]:
        path.chmod(0o777 if path.is_dir() else 0o666)
    again = call(arguments, folder, SECONDS)
    report.problems += [f"with rights: {one}" for one in wrong_words(again)]
    if again.status != 0:
        report.problems.append(f"with rights: status {again.status}: {again.err[-300:]}")
    elif what in {"run", "resume", "sweep"}:
        found = differences(read(output), expected)
        report.problems += [f"with rights: {one} differs" for one in found]
    report.problems = [f"{what}: {one}" for one in report.problems]
    return report


def _take_rights(random: Random, place: Path) -> None:
    """Leave a user without rights only some of what is in a folder."""
    folders = [place, *(path for path in place.rglob("*") if path.is_dir())]
    files = [path for path in place.rglob("*") if path.is_file()]
    for path in [*folders, *files]:
        path.chmod(0o777 if path.is_dir() else 0o666)
    what = random.choice(["folder", "inner folder", "file", "unreadable file", "all"])
    if what == "folder":
        place.chmod(0o555)
    elif what == "inner folder":
        folders[-1].chmod(random.choice([0o555, 0o444, 0]))
    elif what == "all" or not files:
        for path in [*folders, *files]:
            path.chmod(0o555 if path.is_dir() else 0o444)
    else:
        random.choice(files).chmod(0o444 if what == "file" else 0)


def versions(name: str, folder: Path) -> Report:
    """Checkpoints and stores of another version: refused, or left alone and computed anew."""
    limit_memory()
    random = Random(name)
    output = folder / "out.nc"
    if random.random() < 0.5:
        return _sweep_of_another_version(folder, output)
    case, place = _case(folder), checkpoint_folder(output)
    for _ in range(2):
        advanced(Config.load(case), place, 80, [])
    key = random.choice(["format", "version", "commit", "compiler"])
    value = random.choice(["9", 9, None, [], "x" * 300, "\x1b[31m"])
    for state in random.choice([(STATE,), (STATE, PREVIOUS)]):
        with np.load(place / state) as file:
            arrays = dict(file)
        header = json.loads(str(arrays.pop("header")))
        header[key] = value
        with (place / state).open("wb") as file:
            np.savez(file, header=np.array(json.dumps(header)), **arrays)
    before = look_of(folder)
    printed = call(["run", case, "-o", output, "--resume", "--quiet"], folder, SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    report.problems += touched(before, look_of(folder), set())
    if printed.status != 2:
        report.problems.append(f"version: {key} = {value!r} is resumed: status {printed.status}")
    if "\x1b" in printed.err:
        report.problems.append("version: characters that steer the terminal")
    anew = call(["run", case, "-o", output, "--quiet"], folder, SECONDS)
    report.problems += [f"anew: {one}" for one in wrong_words(anew)]
    if anew.status != 0:
        report.problems.append(f"anew: status {anew.status}: {anew.err[-300:]}")
    return report


def _sweep_of_another_version(folder: Path, output: Path) -> Report:
    """A store with the points of another version of the program."""
    case = _case(folder, SWEEP)
    own = point.program
    point.program = lambda: "mesoslip 0.0.1 another"
    try:
        first = call(["sweep", case, "-o", output, "--quiet", "--pool", "threads"], folder, SECONDS)
    finally:
        point.program = own
    problems = wrong_words(first)
    before = look_of(folder / "out.points")
    again = call(["sweep", case, "-o", output, "--quiet", "--pool", "threads"], folder, SECONDS)
    problems += wrong_words(again)
    kept = {folder / "out.points" / "manifest.json"}
    problems += touched(before, look_of(folder / "out.points"), kept)
    other = folder / "other.nc"
    call(["sweep", case, "-o", other, "--quiet", "--pool", "threads"], folder, SECONDS)
    problems += [f"version: {one} differs" for one in differences(read(output), read(other))]
    points = len(list((folder / "out.points").glob("[0-9a-f]*.json")))
    if points != 2 * len(list((folder / "other.points").glob("[0-9a-f]*.json"))):
        problems.append(f"version: {points} points, as if those of the other had been taken")
    return Report(OUTCOMES.get(again.status, "other"), problems)


def many(name: str, folder: Path) -> Report:
    """Ten thousand points or realizations: in bounded memory."""
    number = int(name.rpartition(":")[2]) % 3
    short = {"contacts__count": 1, "slider": {"kind": "prescribed"}}
    short |= {"drive": {"velocity": 1e-5}, "run__duration": 2e-3}
    output = folder / "out.nc"
    table = '[sweep]\nmeasures = ["mean_force"]\n'
    if number == 0:
        table += "[sweep.grid]\n"
        table += '"run.seed" = { from = 9007199254740993, to = 9007199254750992, points = 10000 }\n'
    elif number == 1:
        table += 'realizations = 10000\n[sweep.grid]\n"contacts.delay" = ["0.5 ms"]\n'
    else:
        short["run__realizations"] = 10000
    case = _case(folder, "" if number == 2 else table, **short)
    arguments = ["run" if number == 2 else "sweep", case, "-o", output, "--quiet"]
    process = Command([*arguments, "--workers", 2], folder)
    printed = process.wait(1200.0)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: {arguments[0]}"])
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    if printed.memory > MAX_MEMORY:
        report.problems.append(f"memory: {printed.memory / 2**20:.0f} MB")
    if printed.status != 0 or not output.exists():
        report.problems.append(f"status: {printed.status}: {printed.err[-300:]}")
    else:
        data = read(output)
        count = data["energy_residual" if number == 2 else "mean_force"].size
        if count != 10_000:
            report.problems.append(f"{count} of 10000 are there")
    return report


def seeds(name: str, folder: Path) -> Report:
    """A sweep over seeds that no double holds: those seeds, and no others."""
    limit_memory()
    random = Random(name)
    first = random.randrange(2**53, 2**63 - 100)
    step, points = random.randint(1, 9), random.randint(2, 4)
    wanted = [first + step * number for number in range(points)]
    grid: object = wanted
    if random.random() < 0.5:
        grid = {"from": wanted[0], "to": wanted[-1], "points": points}
    sweep = {"measures": ["breaks", "mean_force"], "grid": {"run.seed": grid}}
    tables = klein_tables(**FAST | KINDS["rigid"]) | {"sweep": sweep}
    case, output = folder / "case.toml", folder / "out.nc"
    case.write_text(tomli_w.dumps(tables))
    printed = call(["sweep", case, "-o", output, "--quiet", "--pool", "threads"], folder, SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    if printed.status != 0:
        report.problems.append(f"status: {printed.status}: {printed.err[-300:]}")
        return report
    with xr.open_dataset(output) as data:
        there = data["run.seed"].values.tolist()
        breaks = data["breaks"].values.reshape(points, -1)[:, 0].tolist()
    if there != wanted:
        report.problems.append(f"seeds: {there}, and {wanted} are wanted")
    one = random.randrange(points)
    tables = klein_tables(**FAST | KINDS["rigid"] | {"run__seed": wanted[one]})
    if int(mesoslip.run(tables, executor=1)["breaks"].values[0]) != breaks[one]:
        report.problems.append(f"seeds: breaks of {wanted[one]} are those of another")
    too_long = random.choice([2**63, 2**64, -1, 10**30])
    case.write_text(tomli_w.dumps(klein_tables(**FAST | {"run__seed": 1})))
    printed = call(["run", case, "-o", folder / "no.nc", "--set", f"run.seed={too_long}"], folder)
    report.problems += wrong_words(printed)
    if printed.status != 2:
        report.problems.append(f"seeds: {too_long} is taken: status {printed.status}")
    return report


# All but what starts a page, which nothing here would end. They are imported here: each case has a
# process of its own, which would import them again.
FUNCTIONS: list[Callable[..., Any]] = [
    function
    for name in sorted(mesoslip.__all__)
    if name != "explore" and inspect.isfunction(function := getattr(mesoslip, name))
]


def calls(name: str, folder: Path) -> Report:
    """A function of the library with wrong arguments: one of its own errors, or a TypeError."""
    limit_memory()
    random = Random(name)
    function = random.choice(FUNCTIONS)
    case = _case(folder)
    good: list[Any] = [str(case), case, Config.load(case), klein_tables(**FAST), folder / "x.nc"]
    nasty = [*NASTY, None, object(), b"x", np.nan, np.zeros(3), {1}, len, Path("nowhere.nc")]
    positional, named = [], {}
    for one in inspect.signature(function).parameters.values():
        value = random.choice(random.choice([good, nasty, nasty]))
        if one.kind is one.KEYWORD_ONLY:
            if random.random() < 0.4:
                named[one.name] = value
        elif one.default is one.empty or random.random() < 0.3:
            positional.append(value)
    before = look_of(folder)
    report = Report("finished")
    try:
        function(*positional, **named)
    except MesoslipError as error:
        report.outcome = "refused"
        if not str(error).strip() or len(str(error)) > 20_000:
            report.problems.append(f"message: {str(error)[:200]!r}")
    except Exception as error:
        text = f"{type(error).__name__}: {error}"[:300]
        shown = [*map(_shown, positional), *(f"{key}={_shown(named[key])}" for key in named)]
        report.problems.append(f"{function.__name__}: {text}; of ({', '.join(shown)})")
    report.problems += touched(before, look_of(folder), set())
    return report


def _shown(value: object) -> str:
    try:
        return repr(value)[:60]
    except ValueError:
        return type(value).__name__


ATTACKS: dict[str, tuple[Attack, int]] = {
    "read_only": (read_only, 60),
    "versions": (versions, 40),
    "many": (many, 3),
    "seeds": (seeds, 30),
    "calls": (calls, 1000),
}
