"""The attacks: each makes one case of a name, tries it, and reports what did not hold.

A name such as "configurations:1:17" is all that a case depends on.
"""

import hashlib
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

import netCDF4
import numpy as np
import tomli_w
import xarray as xr
from apart import Command, Told, call, limit_memory, patience
from configurations import draw, mutate, text
from conftest import klein_tables
from invariants import broken, differences, energy_residual, left_over, promised_residual
from kinds import FAST, KINDS
from mesoslip import Config
from mesoslip.output.tree import build_tree
from mesoslip.simulation.checkpoint import Checkpoint, checkpoint_folder
from mesoslip.simulation.memory import memory_problems
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import Results, run_realizations

# Time that a run has before it is interrupted [s].
SECONDS = 2.0
# Computing time in which a command answers an interrupt [s].
ANSWER_SECONDS = 3.0
# Longest run that is repeated in other segments [s].
REPEATED_SECONDS = 0.3
# Cuts of such a run.
MOST_CUTS = 4

FINISHED, REFUSED, FAILED, STOPPED = "finished", "refused", "failed", "stopped"
OUTCOMES = {0: FINISHED, 2: REFUSED, 1: FAILED, 130: STOPPED}


@dataclass
class Report:
    """What came of a case."""

    outcome: str
    problems: list[str] = field(default_factory=list)
    material: bytes = b""
    """The configuration, if that is what the case is about."""
    residual: tuple[str, float] | None = None
    """Of which kind of run, and the part of what it may lack that its energy balance lacks."""


def wrong_words(printed: Told) -> list[str]:
    """What is wrong with what a command said."""
    found = []
    if printed.status not in OUTCOMES:
        found.append(f"status: {printed.status}: {printed.err[-300:]}")
    err = printed.err
    if printed.cpu_after_signal is not None:
        # An interrupt in a finalizer, of no consequence, is reported by the interpreter.
        err = re.sub(r"Exception ignored in[^\n]*\nTraceback[^\n]*\n(\s.*\n|\n)*", "", err)
    for word in ("Traceback", "Warning:", "HDF5-DIAG", "Error in", "At line", "Fortran runtime"):
        if word in err + printed.out:
            found.append(f"words: {printed.err[-600:]}")
            break
    messages = sum(line.startswith(("mesoslip: ", "Error: ")) for line in printed.err.splitlines())
    if printed.status in {1, 2} and messages != 1:
        found.append(f"message: {messages} of them: {printed.err[-300:]}")
    if printed.status in {1, 2} and len(printed.err) > 20_000:
        found.append(f"message: {len(printed.err)} characters")
    if printed.cpu_after_signal is not None and printed.cpu_after_signal > ANSWER_SECONDS:
        found.append(f"deaf: {printed.cpu_after_signal:.1f} s of work after an interrupt")
    return found


def _digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def read(path: Path) -> xr.DataTree:
    """An output in memory, by the library alone."""
    with xr.open_datatree(path, engine="netcdf4") as tree:
        return tree.load()


# Configurations.


def material(name: str) -> bytes:
    """The configuration of a case: one that is meant to run, or one with mistakes."""
    random = Random(name)
    tables = draw(random)
    return mutate(random, tables) if name.startswith("mutations") else text(tables)


def configurations(name: str, folder: Path) -> Report:
    """A configuration, with mistakes or without."""
    return check_configuration(material(name), name, folder)


def check_configuration(material: bytes, name: str, folder: Path) -> Report:
    """Run a configuration, look at all that it leaves, and run it again in other segments."""
    limit_memory()
    random = Random(f"{name} more")
    case, output = folder / "case.toml", folder / "out.nc"
    case.write_bytes(material)
    more = random.choice([[], ["--quiet"], ["--workers", 1], ["--checkpoint-interval", 0.02]])
    printed = call(["run", case, "-o", output, *more], folder, SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed), material)
    problems = report.problems
    if case.read_bytes() != material:
        problems.append("input: changed by the run")
    wanted = {"case.toml"}
    if printed.status == 0:
        wanted |= {"out.nc"}
        tree, config = read(output), Config.load(case)
        problems += broken(tree, config)
        report.residual = (_kind(config), energy_residual(tree) / promised_residual(config))
        if printed.seconds < REPEATED_SECONDS:
            problems += _other_segments(config, tree, random, folder.parent / "cut")
    elif printed.status == 130:
        wanted |= {"out.partial.nc", "out.checkpoint"}
        if (folder / "out.partial.nc").exists():
            read(folder / "out.partial.nc")
        if output.exists():
            # The interrupt came when all was done.
            wanted = {"case.toml", "out.nc"}
            problems += broken(read(output), Config.load(case))
    problems += [f"left over: {one}" for one in left_over(folder, wanted)]
    if report.outcome in {FINISHED, REFUSED}:
        problems += _other_command(case, output, printed.status, random, folder)
    return report


def _kind(config: Config) -> str:
    solver = config.slider.solver_name(config)
    return f"{config.slider.kind}, {config.contact_kind.kernel_kind}" + (
        f", {solver}" if solver else ""
    )


def _other_segments(config: Config, tree: xr.DataTree, random: Random, folder: Path) -> list[str]:
    """Whether a run that is cut into segments, put away and taken up again, is the same."""
    whole = build_tree(run_realizations(config, executor=random.choice([1, 2])))
    problems = [f"file and memory: {one} differs" for one in differences(tree, whole)]
    advances = int(whole.attrs["advance_count"])
    printed: list[str] = []
    for _ in range(random.randint(1, MOST_CUTS)):
        _, found = advanced(config, folder, random.randint(1, 1 + advances // 2), printed)
        problems += found
    results, found = advanced(config, folder, None, printed, work=10 ** random.uniform(2.5, 5))
    problems += found
    again = build_tree(results)
    return problems + [f"resumed: {one} differs" for one in differences(whole, again)]


def advanced(
    config: Config,
    folder: Path,
    advances: int | None,
    printed: list[str],
    *,
    work: float | None = None,
) -> tuple[Results, list[str]]:
    """Go on from the checkpoint in a folder for some advances and keep another, or to the end."""
    realizations = [Realization(config, number) for number in range(config.run.realizations)]
    problems: list[str] = []
    with Checkpoint(folder, config, resume=True, report=printed.append) as checkpoint:
        checkpoint.restore(realizations)
        for one in realizations:
            while not one.finished:
                one.advance(advances, work=work)
                problems += _lost_contacts(one)
                if advances is not None:
                    break
        if advances is not None and not checkpoint.write(realizations):
            problems.append("checkpoint: not written")
    return Results(config, realizations, advances is None, 0.0), problems


def _lost_contacts(one: Realization) -> list[str]:
    """Whether each of N contacts is pinned or detached; under a load some have separated."""
    if not one.config.contact_kind.is_discrete:
        return []
    bare = int(np.sum(one.contacts["stiffness"] == 0))
    separated = bare - one.detached
    if separated < 0 or (separated > 0 and not one.config.pressing.acts):
        return [f"contacts: {bare} without stiffness, {one.detached:g} detached"]
    return []


def _other_command(
    case: Path, output: Path, status: int, random: Random, folder: Path
) -> list[str]:
    """Another command with the same configuration, or with its output."""
    table, picture = folder / "table.csv", folder / "picture.png"
    commands: list[list[object]] = [["info", case], ["info", case, "--json"]]
    if status == 0:
        commands += [["curve", case, "--json"], ["onset", case], ["slips", output, "--json"]]
        commands += [["slips", output, "--csv", table], ["avalanches", output, "--json"]]
        commands += [["plot", output, "-o", picture], ["run", output, "-o", folder / "again.nc"]]
    # Those of little to do are many, as drawing and the theory take their time.
    command = random.choices(commands, [3 if one[0] in QUICK else 1 for one in commands])[0]
    printed = call(command, folder, SECONDS)
    problems = [f"{command[0]}: {one}" for one in wrong_words(printed)]
    if printed.status == 0 and "--json" in command:
        try:
            json.loads(printed.out, parse_constant=_no_constant)
        except ValueError as error:
            problems.append(f"{command[0]}: not JSON: {error}")
    if command[0] == "run" and printed.status == 0:
        found = differences(read(output), read(folder / "again.nc"))
        problems += [f"run again: {one} differs" for one in found]
    is_refused = printed.status in {1, 2} and command[0] in {"slips", "plot"}
    if command[0] == "info" and printed.status not in {status, 130}:
        # A run that this machine has no memory for is described nevertheless; contacts of some
        # kinds, and of some together, have no theory.
        is_described = printed.status == 0 and bool(memory_problems(Config.load(case)))
        is_refused = not is_described and "no derived quantities" not in printed.err
    if is_refused:
        problems.append(f"{command[0]}: status {printed.status}: {printed.err[-300:]}")
    return problems


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


# Commands that are over in a moment.
QUICK = {"info", "slips", "avalanches"}


# Files.

STANDARD = ("rigid", "rigid, lattice", "rigid, me", "layered", "quasistatic, lattice")


def prepare(folder: Path, with_long: bool) -> None:
    """Write the outputs that are damaged, and the runs that are cut off, into a folder."""
    for number, kind in enumerate(STANDARD):
        tables = klein_tables(**FAST | KINDS[kind])
        (folder / f"{number}.toml").write_text(tomli_w.dumps(tables))
        status = call(["run", folder / f"{number}.toml", "-o", folder / f"{number}.nc"], folder, 60)
        assert status.status == 0, status.err
    for command in ("curve", "onset"):
        path = folder / f"{command}.nc"
        status = call([command, folder / "0.toml", "-o", path], folder, 60)
        assert status.status == 0, status.err
    for name, changes in LONG.items() if with_long else ():
        path = folder / f"{name}.toml"
        path.write_text(tomli_w.dumps(klein_tables(**changes)))
        status = call(["run", path, "-o", folder / f"{name}.nc"], folder, 120)
        assert status.status == 0, status.err


# Runs of about a second, whose outputs take a while to build and to write.
LONG: dict[str, dict[str, Any]] = {
    "fine": {
        "contacts__count": 200,
        "run__duration": 12.0,
        "run__realizations": 2,
        "output": {"interval": 1.2e-5, "slip_interval": 1e-5},
    },
    "busy": {"run__duration": 20.0, "output": {"interval": 1e-2}},
    "me": {"run__engine": "me", "run__duration": 12.0, "output": {"interval": 1e-4}},
    "layers": {
        "slider": {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 400},
        "run__duration": 3e-3,
        "drive__velocity": 1e-2,
        "contacts__count": 100,
        "output": {"interval": 1e-4, "layers": True},
    },
}


def damaged(data: bytes, random: Random) -> bytes:
    """A file with some bytes changed or missing."""
    changed = bytearray(data)
    what = random.choice(["bits", "bits", "bytes", "heap", "zeros", "cut", "more", "moved"])
    place, length = random.randrange(len(data)), random.randint(1, 4096)
    if what in {"bits", "bytes"}:
        for _ in range(random.choice([1, 1, 3, 30])):
            where = random.randrange(random.choice([len(data), min(len(data), 4096)]))
            changed[where] ^= 1 << random.randrange(8) if what == "bits" else random.randrange(256)
    elif what == "heap":
        # It has no checksum, and the library follows the sizes of its objects.
        where = data.find(b"GCOL") + random.randrange(1024)
        changed[where % len(data)] = random.randrange(256)
    elif what == "zeros":
        changed[place : place + length] = bytes(len(changed[place : place + length]))
    elif what == "cut":
        del changed[place:]
    elif what == "more":
        changed += random.randbytes(length)
    else:
        other = random.randrange(len(data))
        piece = changed[other : other + length]
        changed[place : place + len(piece)] = piece
    return bytes(changed)


def _rewritten(path: Path, random: Random) -> None:
    """Change variables and attributes of an output as a library does that knows the format."""
    with netCDF4.Dataset(path, "a") as file:
        place = random.choice([file, *file.groups.values()])
        what = random.choice(["attribute", "rename", "values", "drop"])
        if what == "attribute" and place.ncattrs():
            name = random.choice(place.ncattrs())
            place.setncattr(name, random.choice([7, 1e300, "", "x", [1.0, 2.0], math.nan]))
        elif what == "drop" and place.ncattrs():
            place.delncattr(random.choice(place.ncattrs()))
        elif what == "rename" and place.variables:
            place.renameVariable(random.choice(list(place.variables)), "another")
        elif what == "values" and place.variables:
            variable = place[random.choice(list(place.variables))]
            variable[...] = random.choice([0, -1, 1, 100])


def outputs(name: str, folder: Path) -> Report:
    """A damaged output."""
    limit_memory()
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    path = folder / "damaged.nc"
    number = random.choice([*map(str, range(len(STANDARD))), "curve", "onset"])
    data = (store / f"{number}.nc").read_bytes()
    if random.random() < 0.3:
        path.write_bytes(data)
        _rewritten(path, random)
    else:
        path.write_bytes(damaged(data, random))
    before = _digest(path)
    new = {"run": "new.nc", "plot": "new.png", "--csv": "new.csv", "curve": "curve.nc"}
    arguments = random.choice(
        [
            ["info", path],
            ["run", path, "-o", folder / "new.nc"],
            ["curve", path, "-o", folder / "curve.nc"],
            ["slips", path],
            ["slips", path, "--csv", folder / "new.csv"],
            ["avalanches", path, "--json"],
            ["plot", path, "-o", folder / "new.png"],
            ["plot", path, "-o", folder / "new.png", "--view", "lattice"],
        ]
    )
    printed = call(arguments, folder, 5 * SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    problems = report.problems
    if _digest(path) != before:
        problems.append("input: changed")
    there = {value for key, value in new.items() if key in arguments}
    if printed.status == 130:
        there |= {"new.partial.nc", "new.checkpoint"}
    if printed.status in {1, 2} and there & {one.name for one in folder.iterdir()}:
        problems.append("half written: an output of a command that failed")
    if printed.status == 0 and arguments[0] == "run":
        problems += broken(read(folder / "new.nc"), Config.from_toml(_text_of(path)))
    problems += [f"left over: {one}" for one in left_over(folder, {path.name, *there})]
    return report


def _text_of(path: Path) -> str:
    # What is damaged elsewhere in the file is not read for it.
    with xr.open_dataset(path) as root:
        return str(root.attrs["configuration"])


def checkpoints(name: str, folder: Path) -> Report:
    """A damaged checkpoint: the run goes on to the bit, starts anew, or says what is wrong."""
    limit_memory()
    random = Random(name)
    kind = random.choice([one for one in KINDS if "bdf" not in one and "adams" not in one])
    config = Config.from_dict(klein_tables(**FAST | KINDS[kind]))
    case, output = folder / "case.toml", folder / "out.nc"
    case.write_text(config.to_toml())
    place, ignored = checkpoint_folder(output), []
    for _ in range(random.randint(1, 3)):
        advanced(config, place, random.randint(1, 500), ignored)
    for _ in range(random.choice([1, 1, 2])):
        path = random.choice(sorted(place.iterdir()))
        data = path.read_bytes()
        if random.random() < 0.2:
            path.unlink()
        elif data:
            path.write_bytes(damaged(data, random))
        if not any(place.iterdir()):
            break
    printed = call(["run", case, "-o", output, "--resume"], folder, patience(20.0))
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed), case.read_bytes())
    wanted = {"case.toml", "out.checkpoint"}
    if printed.status == 0:
        wanted = {"case.toml", "out.nc"}
        whole = build_tree(run_realizations(config))
        found = differences(read(output), whole)
        report.problems += [f"resumed: {one} differs" for one in found]
    report.problems += [f"left over: {one}" for one in left_over(folder, wanted)]
    return report


# Signals.

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


def signals(name: str, folder: Path) -> Report:
    """Signals at a random moment, then the same run again with --resume."""
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    which = random.choice(list(LONG))
    case, output = store / f"{which}.toml", folder / "out.nc"
    arguments = ["run", case, "-o", output, "--checkpoint-interval", random.choice([0, 0.05, 60])]
    process = Command(arguments, folder)
    time.sleep(random.uniform(0, 1) * random.choice([0.3, 1.5, 3]))
    sent = [random.choice(SIGNALS)]
    if random.random() < 0.4:
        sent.append(random.choice(SIGNALS[:3]))
    before = process.cpu_seconds()
    for number in sent:
        process.send(number)
        time.sleep(random.choice([0, 0.001, 0.1]))
    printed = process.wait(60.0)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: 60 s after {sent}, {which}"])
    problems = []
    if printed.seconds - before > ANSWER_SECONDS:
        problems.append(
            f"deaf: {printed.seconds - before:.1f} s of work after {sent[0]!r}, {which}"
        )
    allowed = {0} | {-number for number in sent} | {128 + number for number in sent}
    if printed.status not in allowed:
        problems.append(f"status: {printed.status} after {sent}, {which}: {printed.err[-400:]}")
    if "Traceback" in printed.err:
        problems.append(f"words: {printed.err[-400:]}")
    wanted = {"out.checkpoint", "out.partial.nc", "out.nc"}
    is_killed = signal.SIGKILL in sent or printed.status < 0
    if is_killed:
        # Whose end nothing can tidy up after.
        wanted |= {path.name for path in folder.glob(f".mesoslip-*-{process.pid}-*")}
    problems += [f"left over: {one}, {which}" for one in left_over(folder, wanted)]
    expected = read(store / f"{which}.nc")
    if (folder / "out.partial.nc").exists():
        read(folder / "out.partial.nc")
    if printed.status == 0 and not output.exists():
        problems.append("status: 0 without an output")
    if output.exists():
        problems += [f"half written: {one}" for one in differences(read(output), expected)]
    else:
        again = call(["run", case, "-o", output, "--resume"], folder, 60.0)
        problems += [f"resumed: {one}" for one in wrong_words(again)]
        if again.status == 0:
            found = differences(read(output), expected)
            problems += [f"resumed: {one} differs, {which}" for one in found]
    outcome = FINISHED if printed.status == 0 else "killed" if printed.status < 0 else STOPPED
    return Report(outcome, problems)


# Disks.


def disks(name: str, folder: Path) -> Report:
    """A disk that is full before or in the midst of a command."""
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    size = int(10 ** random.uniform(3.6, 6.8))
    is_mounted = os.geteuid() == 0 and mount(folder, size)
    try:
        return _on_small_disk(random, store, folder, size, is_mounted)
    finally:
        if is_mounted:
            subprocess.run(["umount", "--lazy", folder], check=False)


def mount(folder: Path, size: int) -> bool:
    """Put a disk of a size in the place of a folder [bytes]; whether that was possible."""
    line = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    return subprocess.run(line, check=False, capture_output=True).returncode == 0


def _on_small_disk(
    random: Random, store: Path, folder: Path, size: int, is_mounted: bool
) -> Report:
    arguments: list[object]
    what = random.choice(["run", "run", "run", "curve", "onset", "plot", "csv"])
    new = {"plot": "new.png", "csv": "new.csv"}.get(what, "new.nc")
    output, number = folder / new, random.randrange(len(STANDARD))
    if what == "run":
        case = random.choice([store / f"{number}.toml", store / "fine.toml", store / "busy.toml"])
        interval = random.choice([0, 0.05])
        arguments = ["run", case, "-o", output, "--checkpoint-interval", interval]
    elif what in {"curve", "onset"}:
        arguments = [what, store / "0.toml", "-o", output]
    elif what == "plot":
        arguments = ["plot", store / f"{number}.nc", "-o", output]
    else:
        arguments = ["slips", store / f"{number}.nc", "--csv", output]
    is_old = random.random() < 0.5
    if is_old:
        output.write_bytes(b"old")

    def limit() -> None:
        if not is_mounted:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    process = Command(arguments, folder, limit)
    printed = process.wait(60.0)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: {what}"])
    problems = [f"{what}: {one}" for one in wrong_words(printed)]
    if printed.status == 0 and what == "run":
        expected = store / Path(str(arguments[1])).with_suffix(".nc").name
        problems += [f"half written: {one}" for one in differences(read(output), read(expected))]
    elif printed.status != 0 and output.exists() != is_old:
        problems.append(f"{what}: half written" if output.exists() else f"{what}: the old is gone")
    elif printed.status != 0 and is_old and output.read_bytes() != b"old":
        problems.append(f"{what}: the old is overwritten")
    wanted = {new} if printed.status == 0 else {new, "new.checkpoint"}
    problems += [f"left over: {one}, {what}" for one in left_over(folder, wanted)]
    return Report(OUTCOMES.get(printed.status, "other"), problems)


# Terminals.

STREAMS = ("", "0<&-", "1>&-", "2>&-", "1>&- 2>&-", "0<&- 1>&- 2>&-", ">/dev/full", "2>/dev/full")
STREAMS += (">/dev/full 2>&1", "| true", "2>&1 | true", "| head -c 10", "</dev/null", ">/dev/null")
SETTINGS: tuple[dict[str, str], ...] = (
    {},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"PYTHONIOENCODING": "latin-1"},
    {"PYTHONIOENCODING": "ascii:strict"},
    {"TERM": "dumb"},
    {"TERM": "nonsense", "COLUMNS": "0", "LINES": "-1"},
    {"HOME": "/nonexistent", "MPLCONFIGDIR": "/proc/none", "XDG_CACHE_HOME": "/proc/none"},
    {"TMPDIR": "/nonexistent"},
    {"NO_COLOR": "1", "FORCE_COLOR": "1"},
)


def terminals(name: str, folder: Path) -> Report:
    """Streams and environments of all kinds."""
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    case: Any = folder / "case.toml"
    if random.random() < 0.3:
        case = folder / random.choice(["a b.toml", "é.toml", "-.toml", os.fsdecode(b"\xff.toml")])
    tables = klein_tables(**FAST | KINDS["rigid"] | {"title": random.choice(["x", "μ–slip ☃"])})
    case.write_bytes(tomli_w.dumps(tables).encode())
    commands: dict[str, list[object]] = {
        "run": ["run", case, "-o", folder / "out.nc"],
        "info": ["info", case],
        "wrong": ["run", case, "-o", folder / "out.nc", "--set", "contacts.delay=1 µN"],
        "slips": ["slips", store / "0.nc"],
        "curve": ["curve", case, "--json"],
        "plot": ["plot", store / "0.nc", "-o", folder / "new.png"],
        "help": ["--help"],
        "nothing": [],
    }
    what = random.choice(list(commands))
    line = [sys.executable, "-m", "mesoslip", *map(str, commands[what])]
    streams, settings = random.choice(STREAMS), random.choice(SETTINGS)
    shell = ["bash", "-o", "pipefail", "-c", f'"$@" {streams}', "bash", *line]
    if random.random() < 0.15:
        # A terminal, for which progress is drawn.
        shell = [sys.executable, "-c", PTY, *line]
    result = subprocess.run(
        shell, capture_output=True, env={**os.environ, **settings}, cwd=folder, check=False
    )
    texts = (one.decode(errors="replace") for one in (result.stdout, result.stderr))
    printed = Told(result.returncode, *texts, 0.0)
    problems = []
    where = f"{what} {streams} {settings}"
    if printed.status not in {0, 1, 2, 128 + signal.SIGPIPE}:
        problems.append(f"status: {printed.status}, {where}: {printed.err[-300:]}")
    err = printed.err
    if printed.cpu_after_signal is not None:
        # An interrupt in a finalizer, of no consequence, is reported by the interpreter.
        err = re.sub(r"Exception ignored in[^\n]*\nTraceback[^\n]*\n(\s.*\n|\n)*", "", err)
    for word in ("Traceback", "Warning:", "Exception ignored"):
        if word in printed.err + printed.out:
            problems.append(f"words: {where}: {(printed.err + printed.out)[-500:]}")
            break
    # Who listens no more, or has no room, is no mistake of the user.
    is_heard = "|" not in streams and "full" not in streams
    if what == "run" and is_heard and printed.status != 0:
        problems.append(f"run: status {printed.status}, {where}: {printed.err[-300:]}")
    if what == "wrong" and is_heard and printed.status != 2:
        problems.append(f"wrong: status {printed.status}, {where}")
    if (folder / "out.nc").exists():
        problems += broken(read(folder / "out.nc"), Config.load(case))
    wanted = {case.name, "out.nc", "new.png"}
    problems += [f"left over: {one}, {where}" for one in left_over(folder, wanted)]
    return Report(OUTCOMES.get(printed.status, "other"), problems)


PTY = "import os, pty, sys; sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[1:])))"

Attack = Callable[[str, Path], Report]
# Each attack, and how many cases of it are tried.
ATTACKS: dict[str, tuple[Attack, int]] = {
    "configurations": (configurations, 1000),
    "mutations": (configurations, 1000),
    "outputs": (outputs, 300),
    "checkpoints": (checkpoints, 200),
    "signals": (signals, 150),
    "disks": (disks, 150),
    "terminals": (terminals, 150),
}
