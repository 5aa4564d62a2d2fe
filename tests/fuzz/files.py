"""Attacks on files: those of others beside an output, stores, links out of an output, tables.

What holds in each: files that the program did not make are as they were.
"""

import ctypes
import os
import resource
import shutil
import subprocess
from pathlib import Path
from random import Random

import measurements as measured
import numpy as np
import tomli_w
from apart import Command, call, limit_memory
from attacks import OUTCOMES, STANDARD, Attack, Report, advanced, mount, read, wrong_words
from conftest import klein_tables
from invariants import differences
from kinds import FAST, KINDS
from mesoslip import Config, MesoslipError
from mesoslip.output.tree import build_tree
from mesoslip.output.writing import write
from mesoslip.simulation.checkpoint import checkpoint_folder
from mesoslip.simulation.recorded_tables import TABLES
from mesoslip.simulation.run_realizations import Results, run_realizations

# Time that a command has [s].
SECONDS = 20.0
SECRET = "73.0193"
"""What stands in a file that no output may be read into."""

Look = dict[str, tuple[int, bytes]]


def look_of(*folders: Path) -> Look:
    """Of all that is in folders: its kind and rights, and what it holds or leads to."""
    found: Look = {}
    for folder in folders:
        for path in folder.rglob("*"):
            if path.is_symlink():
                held = os.fsencode(path.readlink())
            else:
                held = path.read_bytes() if path.is_file() else b""
            found[str(path)] = (path.lstat().st_mode, held)
    return found


def touched(before: Look, after: Look, own: set[Path]) -> list[str]:
    """Files of others that are gone or changed, but for those that a command is to replace."""
    names = [name for name, look in before.items() if after.get(name) != look]
    return [
        f"file of another: {Path(name).name} is {'changed' if name in after else 'gone'}"
        for name in names
        if Path(name) not in own
    ]


def _short(**changes: object) -> str:
    return tomli_w.dumps(klein_tables(**FAST | KINDS["rigid"] | changes))


SWEEP = """
[sweep]
realizations = 2
measures = ["mean_force"]
[sweep.grid]
"contacts.delay" = ["0.1 ms", "0.5 ms"]
"""


def _plant(random: Random, path: Path, others: Path) -> None:
    """Put a file, a folder or a link of another where the program might put something."""
    kind = random.choice(["file", "folder", "folder", "link", "link to a folder", "no end"])
    target = others / path.name
    if kind == "folder":
        for name in ("mine.txt", "state.npz", "lock", ".gitignore", "data/mine.txt"):
            if random.random() < 0.7:
                (path / name).parent.mkdir(parents=True, exist_ok=True)
                (path / name).write_bytes(b"mine")
        if path.is_dir() and random.random() < 0.5:
            (others / "target").write_bytes(b"mine")
            (path / "plan.toml").symlink_to(others / "target")
            if not (path / "lock").exists():
                (path / "lock").symlink_to(others / "target")
    elif kind == "file":
        path.write_bytes(b"mine")
    elif kind == "link":
        target.write_bytes(b"mine")
        path.symlink_to(target)
    elif kind == "link to a folder":
        target.mkdir()
        (target / "mine.txt").write_bytes(b"mine")
        path.symlink_to(target)
    else:
        path.symlink_to(path)


def neighbours(name: str, folder: Path) -> Report:
    """Files and links of others at names that the program uses beside its output."""
    limit_memory()
    random = Random(name)
    others = folder.parent / "others"
    shutil.rmtree(others, ignore_errors=True)
    others.mkdir()
    case, output = folder / "case.toml", folder / "out.nc"
    what = random.choice(["run", "run", "run", "sweep", "sweep"])
    case.write_text(_short() + (SWEEP if what == "sweep" else ""))
    for place in ("out.checkpoint", "out.checkpoint.old", "out.partial.nc", "out.points"):
        if random.random() < 0.5:
            _plant(random, folder / place, others)
    more: list[object] = random.choice([[], ["--quiet"]])
    if what == "run":
        more += random.choice([[], ["--resume"], ["--checkpoint-interval", 0]])
    before = look_of(folder, others)
    printed = call([what, case, "-o", output, *more], folder, SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    report.problems += touched(before, look_of(folder, others), {output})
    if what == "run" and printed.status in {1, 2} and output.exists():
        report.problems.append("half written: an output of a command that failed")
    return report


# Kinds of run whose checkpoints are damaged; parts that together are each byte of one, flips in a
# case of another, and cases.
BIT_KINDS = ("rigid", "rigid, lattice", "rigid, me", "quasistatic, lattice", "rigid, ageing, ramps")
BIT_PARTS = 25
BIT_FLIPS = 100
BIT_CASES = BIT_PARTS + 4 * len(BIT_KINDS)


def bits(name: str, folder: Path) -> Report:
    """Each byte of a small checkpoint, a part in each case: the run is the same, or refused.

    The first cases change each byte for the first kind; then come bytes at random for all kinds,
    with one state or with the one before as well.
    """
    limit_memory()
    random = Random(name)
    part, kind, states = int(name.rpartition(":")[2]), BIT_KINDS[0], 1
    if part >= BIT_PARTS:
        more = part - BIT_PARTS
        kind, states = BIT_KINDS[more % len(BIT_KINDS)], 1 + more // len(BIT_KINDS) % 2
    changes = FAST | KINDS[kind] | {"title": kind}
    if "interaction" not in changes:
        changes["contacts__count"] = 3
    config = Config.from_dict(klein_tables(**changes))
    place = checkpoint_folder(folder / "out.nc")
    for _ in range(states):
        advanced(config, place, 60, [])
    expected = _numbers(run_realizations(config, executor=1))
    kept = {path: path.read_bytes() for path in sorted(place.iterdir())}
    all_bytes = [(path, at) for path, data in kept.items() for at in range(len(data))]
    report = Report("finished")
    chosen = all_bytes[part::BIT_PARTS]
    if part >= BIT_PARTS:
        chosen = random.sample(all_bytes, min(BIT_FLIPS, len(all_bytes)))
    for path, at in chosen:
        for one in folder.iterdir():
            shutil.rmtree(one)
        place.mkdir()
        for one, data in kept.items():
            one.write_bytes(data)
        changed = bytearray(kept[path])
        changed[at] ^= 1 << random.randrange(8)
        path.write_bytes(changed)
        try:
            results, _ = advanced(config, place, None, [])
            found = "" if _numbers(results) == expected else "another result"
        except MesoslipError:
            continue
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        if found:
            report.problems.append(f"{kind}, byte {at} of {path.name}: {found}")
    return report


def _numbers(results: Results) -> list[bytes]:
    """All that realizations have recorded, and their balances of energy."""
    tables = [one.rows(table) for one in results.realizations for table in TABLES]
    recorded = [rows.read() if len(rows) else np.empty(0) for rows in tables]
    energies = [np.array(list(one.energy_terms.values())) for one in results.realizations]
    return [values.tobytes() for values in (*recorded, *energies)]


def stores(name: str, folder: Path) -> Report:
    """A sweep's store that was changed: the same dataset, or what is wrong in one message."""
    limit_memory()
    random = Random(name)
    case, output = folder / "case.toml", folder / "out.nc"
    case.write_text(_short() + SWEEP)
    whole = call(["sweep", case, "-o", output, "--quiet"], folder, 60.0)
    if whole.status != 0:
        return Report(OUTCOMES.get(whole.status, "other"), wrong_words(whole))
    expected = read(output)
    place = folder / "out.points"
    files = sorted(path for path in place.rglob("*") if path.is_file())
    for path in random.sample(files, min(len(files), random.choice([1, 1, 2, 4]))):
        data = path.read_bytes()
        what = random.choice(["flip", "cut", "empty", "gone", "brackets", "digits", "version"])
        if what == "flip" and data:
            changed = bytearray(data)
            changed[random.randrange(len(data))] ^= 1 << random.randrange(8)
            path.write_bytes(changed)
        elif what == "cut":
            path.write_bytes(data[: len(data) // 2])
        elif what == "empty":
            path.write_bytes(b"")
        elif what == "gone":
            path.unlink()
        elif what == "brackets":
            path.write_bytes(b"[" * 200_000)
        elif what == "digits":
            path.write_bytes(data.replace(b"0.", b"9" * 400 + b"0."))
        else:
            path.write_bytes(data.replace(b"1", b"2", 1))
    output.unlink()
    for name_of_other in random.sample([".gitignore", "mine.txt", "mine.nc", ".hidden"], 2):
        if not (place / name_of_other).exists():
            (place / name_of_other).write_bytes(b"mine")
    others = {path for path in place.iterdir() if path not in files}
    before = {name: look for name, look in look_of(folder).items() if Path(name) in others}
    printed = call(["sweep", case, "-o", output, "--quiet"], folder, 60.0)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    report.problems += touched(before, look_of(folder), set())
    if printed.status == 0:
        found = differences(read(output), expected)
        # A point is read from its file: a number changed there is another number.
        report.problems += [f"store: {one} differs" for one in found if "history" not in one]
    return report


def small_disks(name: str, folder: Path) -> Report:
    """No room for a sweep, a trace or a fit: one message, and with room the same as ever.

    The disk is full, or files may not become longer than a limit.
    """
    random = Random(name)
    disk = folder / "disk"
    disk.mkdir()
    case, output = folder / "case.toml", disk / "out.nc"
    size = int(10 ** random.uniform(2.0, 5.0))
    table = folder / "table.csv"
    rows = "".join(f"{0.01 * row:.2f},{row % 50}\n" for row in range(random.choice([200, 5000])))
    table.write_text("time [s],force [uN]\n" + rows)
    case.write_text(_short() + SWEEP)
    commands: list[list[object]] = [
        ["sweep", case, "-o", output, "--quiet", "--pool", "threads"],
        ["sweep", case, "-o", output, "--quiet", "--workers", 1],
        ["trace", table, "--velocity", "1 um/s", "-o", output],
        ["fit"],
    ]
    arguments = random.choice(commands)
    if arguments == ["fit"]:
        size = int(10 ** random.uniform(2.0, 6.3))
        arguments = [*small_fit(folder), "-o", output]
    is_mounted = os.geteuid() == 0 and random.random() < 0.5 and mount(disk, max(size, 4096))
    try:
        return _without_room(arguments, folder, output, random, None if is_mounted else size)
    finally:
        if is_mounted:
            subprocess.run(["umount", "--lazy", disk], check=False)


def small_fit(folder: Path) -> list[object]:
    """The command of a fit that takes some seconds, with its trace and configuration."""
    changes = {"run__duration": 2.0, "contacts__count": 50, "output__interval": 2e-3}
    tables = klein_tables(**changes, contacts__threshold__relative_width=0.05)
    write(build_tree(run_realizations(Config.from_dict(tables), executor=1)), folder / "run.nc")
    free = {"contacts.static_force": {"from": "5 uN", "to": "40 uN", "prior": "logarithmic"}}
    tables["fit"] = {"free": free, "simulations": 300, "noise": 5e-8}
    (folder / "fit.toml").write_text(tomli_w.dumps(tables))
    return ["fit", folder / "run.nc", folder / "fit.toml", "--quiet"]


def _without_room(
    arguments: list[object], folder: Path, output: Path, random: Random, limit: int | None
) -> Report:
    """Try a command on a full disk, or where no file may be longer than a limit [bytes]."""
    is_old = random.random() < 0.5
    if is_old:
        # Files of others are refused, but for empty ones.
        output.write_bytes(b"")
    before = look_of(folder)

    def limit_files() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    process = Command(arguments, folder, limit_files)
    printed = process.wait(60.0)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: {arguments[0]}"])
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    own = {output} if printed.status == 0 else set()
    report.problems += touched(before, look_of(folder), own)
    if printed.status != 0 and output.exists() != is_old:
        report.problems.append("half written")
    if printed.status != 0:
        if limit is None:
            line = ["mount", "-o", "remount,size=64m", str(output.parent)]
            subprocess.run(line, check=True)
        again = Command(arguments, folder).wait(60.0)
        if again is None:
            return Report("other", [f"hang with room: {arguments[0]}"])
        report.problems += [f"with room: {one}" for one in wrong_words(again)]
        if again.status != 0:
            report.problems.append(f"with room: status {again.status}: {again.err[-300:]}")
    report.problems = [f"{arguments[0]}: {one}" for one in report.problems]
    return report


def _hdf5() -> ctypes.CDLL | None:
    """The HDF5 library that netCDF is linked with."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        path = line.rpartition(" ")[2]
        if "libhdf5" in path and "_hl" not in path:
            return ctypes.CDLL(path)
    return None


def _external_storage(library: ctypes.CDLL, file: int, name: bytes, target: bytes) -> None:
    """A dataset whose numbers lie in another file."""
    handle = ctypes.c_int64
    size = (ctypes.c_uint64 * 1)(4)
    kind = handle.in_dll(library, "H5P_CLS_DATASET_CREATE_ID_g")
    number = handle.in_dll(library, "H5T_NATIVE_DOUBLE_g")
    library.H5Ldelete(file, name, handle(0))
    space = handle(library.H5Screate_simple(1, size, None))
    made = handle(library.H5Pcreate(kind))
    library.H5Pset_external(made, target, ctypes.c_int64(0), ctypes.c_uint64(32))
    data = library.H5Dcreate2(file, name, number, space, handle(0), made, handle(0))
    # A file with an open data set is not closed, and is written later.
    library.H5Dclose(handle(data))


def links(name: str, folder: Path) -> Report:
    """An output with links or storage out of itself, cycles, or a drive in another file."""
    limit_memory()
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    path, secret = folder / "out.nc", folder.parent / "secret"
    secret.write_text(f"time [s],displacement [um]\n0,{SECRET}\nx,{SECRET}\n" * 4)
    shutil.copy(store / f"{random.randrange(len(STANDARD))}.nc", path)
    library = _hdf5()
    what = random.choice(["external", "storage", "soft", "cycle", "fifo", "drive"])
    if what == "drive":
        _drive_elsewhere(path, secret)
    elif library is None:
        return Report("no library")
    else:
        for function in ("H5Fopen", "H5Screate_simple", "H5Pcreate", "H5Dcreate2"):
            getattr(library, function).restype = ctypes.c_int64
        _link(library, path, secret, what, random)
    commands: list[list[object]] = [
        ["slips", path, "--json"],
        ["info", path],
        ["avalanches", path],
        ["run", path, "-o", folder / "new.nc"],
        ["plot", path, "-o", folder / "new.png"],
        ["report", path, "-o", folder / "new.html"],
    ]
    before = look_of(folder)
    printed = call(random.choice(commands), folder, 10.0)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    report.problems = [f"{what}: {one}" for one in report.problems]
    report.problems += touched(before, look_of(folder), set())
    texts = [printed.out, printed.err]
    texts += [one.read_text(errors="replace") for one in folder.glob("new.*")]
    if any(SECRET in text for text in texts):
        report.problems.append(f"{what}: another file was read")
    if printed.status == 0 and what in {"external", "storage", "fifo"}:
        report.problems.append(f"{what}: not refused")
    return report


def _link(library: ctypes.CDLL, path: Path, secret: Path, what: str, random: Random) -> None:
    handle = ctypes.c_int64
    file = handle(library.H5Fopen(os.fsencode(path), ctypes.c_uint(1), handle(0)))
    name = random.choice([b"spring_force", b"velocity", b"slips/force_drop"])
    if what == "storage":
        _external_storage(library, file, name, os.fsencode(secret))
    elif what == "cycle":
        library.H5Lcreate_hard(file, b"/", file, b"slips/again", handle(0), handle(0))
    else:
        library.H5Ldelete(file, name, handle(0))
        if what == "soft":
            library.H5Lcreate_soft(b"/nowhere", file, name, handle(0), handle(0))
        else:
            target = secret.with_name("pipe")
            if what == "fifo":
                target.unlink(missing_ok=True)
                os.mkfifo(target)
            else:
                target = path.with_name("other.nc")
                shutil.copy(path, target)
            place = os.fsencode(target)
            library.H5Lcreate_external(place, b"/spring_force", file, name, handle(0), handle(0))
    library.H5Fclose(file)


def _drive_elsewhere(path: Path, secret: Path) -> None:
    import netCDF4

    with netCDF4.Dataset(path, "a") as file:
        tables = klein_tables(drive={"history": {"file": str(secret)}})
        file.setncattr("configuration", tomli_w.dumps(tables))


# Cells that are no numbers, or might be read as others than were meant.
CELLS = (
    *(
        "1_50",
        "١٢",
        "0x10",
        "1,5",
        "1 5",
        "1.5.2",
        "1e",
        "--1",
        "nan",
        "inf",
        "1e999",
        "+-2",
        "1d3",
    ),
    *("", "１", "1'000", "1,500", "∞", "1\u00a0000", "1e5_0", "true", "[1]", "0b1", "½"),
)
# Those of them that stand for a missing value.
MISSING = {"", "nan", "inf"}


def numbers(name: str, folder: Path) -> Report:
    """A table with a cell that is no number, or a row longer than its header."""
    random = Random(name)
    cell, separator = random.choice(CELLS), random.choice([",", ";", "\t"])
    rows = [[f"{0.01 * row:.2f}", f"{row % 20}"] for row in range(60)]
    if random.random() < 0.4 and separator != "," and "," not in cell:
        rows[random.randrange(60)].append("08")
    else:
        rows[random.randrange(60)][random.randrange(2)] = cell
    kind = random.choice(["trace", "history"])
    unit = "force [uN]" if kind == "trace" else "displacement [um]"
    table, output = folder / "table.csv", folder / "out.nc"
    lines = [separator.join(row) for row in (["time [s]", unit], *rows)]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    arguments: list[object] = ["trace", table, "--velocity", "1 um/s", "-o", output]
    if kind == "history":
        case = folder / "case.toml"
        case.write_text(_short(drive={"history": {"file": "table.csv"}}))
        arguments = ["run", case, "-o", output]
    before = look_of(folder)
    printed = call(arguments, folder, SECONDS)
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    report.problems += touched(before, look_of(folder), set())
    # A missing value of a measurement is left out, with a line that says so.
    is_reported = kind == "trace" and cell in MISSING and "left out" in printed.out + printed.err
    if printed.status == 0 and not is_reported:
        report.problems.append(f"number: {cell!r} between {separator!r} is read in a {kind}")
    return report


# Files of measurements in a case: a process takes longer to start than to read them.
FILES_OF_A_CASE = 100


def measurements(name: str, folder: Path) -> Report:
    """Files of measurements in many styles: read as they were made."""
    limit_memory()
    report = Report("finished")
    for number in range(FILES_OF_A_CASE):
        case = measured.make(f"{name} {number}")
        found = measured.check_whole(case, measured.write(case, folder))
        report.problems += [f"file {number}: {one}" for one in found]
    return report


def damaged_measurements(name: str, folder: Path) -> Report:
    """Damaged files of measurements: right, or one message; never wrong numbers in silence."""
    limit_memory()
    report = Report("finished")
    for number in range(FILES_OF_A_CASE):
        case, changed, how = measured.damage(f"{name} {number}")
        _, found = measured.check(case, measured.write(case, folder), changed, how)
        report.problems += [f"file {number}: {how}: {one}" for one in found]
    return report


ATTACKS: dict[str, tuple[Attack, int]] = {
    "neighbours": (neighbours, 100),
    "bits": (bits, BIT_CASES),
    "stores": (stores, 40),
    "small_disks": (small_disks, 40),
    "links": (links, 60),
    "numbers": (numbers, 100),
    "measurements": (measurements, 3),
    "damaged_measurements": (damaged_measurements, 30),
}
