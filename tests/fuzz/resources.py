"""Attacks on what programs share: memory, a disk, a store of finished points."""

import os
import resource
import signal
import subprocess
import time
from pathlib import Path
from random import Random

from apart import Command
from attacks import OUTCOMES, SIGNALS, STANDARD, Attack, Report, mount, read, wrong_words
from configurations import draw, text
from files import SWEEP, small_fit, touched
from files import look_of as look
from invariants import broken, differences, left_over
from mesoslip import Config

# Time that a command has [s].
SECONDS = 100.0
# Memory that a command may take beyond that of the interpreter with its libraries [bytes].
MEMORIES = 2**12, 2**29


def memory(name: str, folder: Path) -> Report:
    """A limit of the memory: a result, or one message and nothing left over."""
    random = Random(name)
    what = random.choice(["run", "run", "run", "sweep", "sweep", "curve"])
    case, output = folder / "case.toml", folder / "out.nc"
    sweep = SWEEP.encode() if what == "sweep" else b""
    case.write_bytes(text(draw(random)) + b"\n" + sweep)
    room = int(MEMORIES[0] * (MEMORIES[1] / MEMORIES[0]) ** random.random())
    arguments: list[object] = [what, case, "-o", output, "--quiet"]
    if what == "sweep":
        arguments += ["--workers", random.choice([1, 2])]
        arguments += ["--pool", random.choice(["threads", "processes"])]
    elif what == "curve":
        arguments = arguments[:-1]

    def limit() -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + room
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    process = Command(arguments, folder, limit)
    printed = process.work(10.0)
    if printed is None:
        process.send(signal.SIGINT)
        printed = process.wait(SECONDS)
    if printed is None:
        process.kill()
        return Report("other", [f"hang: {what} with {room} bytes"])
    report = Report(OUTCOMES.get(printed.status, "other"), wrong_words(printed))
    # A limited store of points keeps what is finished.
    kept = {"case.toml", "out.nc", "out.checkpoint", "out.partial.nc", "out.points"}
    wanted = kept if printed.status in {0, 130} else kept - {"out.nc", "out.partial.nc"}
    report.problems += [f"left over: {one}" for one in left_over(folder, wanted)]
    if printed.status == 0 and what == "run":
        report.problems += broken(read(output), Config.load(case))
    report.problems = [f"{what} with {room} bytes: {one}" for one in report.problems]
    return report


def movies(name: str, folder: Path) -> Report:
    """A movie that is killed, or has no room on the disk: whole, or as before."""
    random, store = Random(name), Path(os.environ["FUZZ_STORE"])
    source = store / f"{random.randrange(len(STANDARD))}.nc"
    disk = folder / "disk"
    disk.mkdir()
    is_full = random.random() < 0.5
    is_mounted = is_full and os.geteuid() == 0 and mount(disk, 2 ** random.randint(12, 17))
    output = disk / random.choice(["new.gif", "new.mp4"])
    try:
        is_old = random.random() < 0.5
        if is_old:
            output.write_bytes(b"")
        before = look(folder)
        process = Command(["plot", source, "-o", output], folder)
        if not is_full:
            time.sleep(random.uniform(0, 6))
            process.send(random.choice(SIGNALS))
        printed = process.wait(SECONDS)
        if printed is None:
            process.kill()
            return Report("other", ["hang"])
        report = Report(OUTCOMES.get(printed.status, "killed"))
        if printed.status >= 0:
            report.problems += wrong_words(printed)
        own = {output} if printed.status == 0 else set()
        report.problems += touched(before, look(folder), own)
        if printed.status != 0 and output.exists() != is_old:
            report.problems.append("half written" if output.exists() else "the old is gone")
        if printed.status == 0 and not output.stat().st_size:
            report.problems.append("status 0 without a movie")
        wanted = {output.name}
        if printed.status < 0:
            # Whose end nothing can tidy up after.
            wanted |= {one for one in left_over(disk, set()) if one.startswith(".")}
        report.problems += [f"left over: {one}" for one in left_over(disk, wanted)]
        return report
    finally:
        if is_mounted:
            subprocess.run(["umount", "--lazy", disk], check=False)


def shared(name: str, folder: Path) -> Report:
    """Two programs with one output at a time, of which one may be killed: one result, and whole."""
    random = Random(name)
    what = random.choice(["sweep", "sweep", "run", "fit"])
    output = folder / "out.nc"
    if what == "fit":
        arguments = [*small_fit(folder), "-o", output]
    else:
        tables = text({**draw(Random("shared"))})
        case = folder / "case.toml"
        case.write_bytes(tables + b"\n" + (SWEEP.encode() if what == "sweep" else b""))
        arguments = [what, case, "-o", output, "--quiet"]
    first = Command(arguments, folder)
    time.sleep(random.uniform(0, 0.5))
    # What each says goes into the folder above its own.
    (folder.parent / "other" / "folder").mkdir(parents=True)
    second = Command(arguments, folder.parent / "other" / "folder")
    sent = random.choice(SIGNALS) if random.random() < 0.5 else None
    if sent is not None:
        time.sleep(random.uniform(0, 1))
        random.choice([first, second]).send(sent)
    report = Report("finished")
    for one in (first, second):
        printed = one.wait(SECONDS)
        if printed is None:
            one.kill()
            report.problems.append("hang")
        elif printed.status >= 0 and (sent is None or printed.status != 128 + sent):
            report.problems += wrong_words(printed)
    again = Command(arguments, folder).wait(SECONDS)
    if again is None or again.status != 0:
        report.problems.append(f"again: {again.status if again else 'hang'}: {again and again.err}")
        return report
    report.problems += [f"again: {one}" for one in wrong_words(again)]
    if what != "fit":
        alone = folder.parent / "alone.nc"
        Command([*arguments[:3], alone, "--quiet"], folder).wait(SECONDS)
        report.problems += [f"{one} differs" for one in differences(read(output), read(alone))]
    report.problems = [f"{what}: {one}" for one in report.problems]
    return report


ATTACKS: dict[str, tuple[Attack, int]] = {
    "memory": (memory, 100),
    "movies": (movies, 30),
    "shared": (shared, 30),
}
