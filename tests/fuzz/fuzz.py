"""Attack the program with cases at random, and see what does not hold: ``make fuzz``.

Each case has a name, such as ``configurations:1:17``, from which it can be made again. What is
found is kept in out/fuzz: the configuration of the case, the smallest one that still shows the
same, and what did not hold.
"""

import argparse
import os
import re
import shutil
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "python"), str(ROOT / "tests" / "fuzz")]
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MPLBACKEND"] = "agg"

import attacks  # noqa: E402
import files  # noqa: E402
import limits  # noqa: E402
import resources  # noqa: E402
from apart import Apart, result_of, wait_for_any  # noqa: E402
from attacks import Report, check_configuration, prepare  # noqa: E402

ATTACKS = attacks.ATTACKS | files.ATTACKS | limits.ATTACKS | resources.ATTACKS

# Time that a case has [s]; what is interrupted in it takes less.
CASE_SECONDS = 120.0
# That of cases which take long on any machine [s].
LONG_SECONDS = {"many": 1200.0}
# Trials for the smallest configuration that shows what was found, and time for them [s].
MOST_TRIALS = 150
SMALLEST_SECONDS = 20.0
# Cases of one problem for which it is sought.
MOST_SMALLEST = 2

# Attacks that start from outputs which are made before.
NEED_OUTPUTS = {"outputs", "signals", "disks", "terminals", "links", "movies"}

NUMBER = re.compile(rb"(?<== )-?[0-9.]+(e-?[0-9]+)?$")


def run_case(name: str, place: Path) -> Report:
    """Try a case in a folder of its own; called in a process of its own."""
    attack, _ = ATTACKS[name.partition(":")[0]]
    return attack(name, _fresh(place))


def _fresh(place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    folder = place / "folder"
    folder.mkdir(parents=True)
    os.environ["TMPDIR"] = str(place)
    os.chdir(folder)
    return folder


def report_of(result: tuple[bool, Report | str], log: Path) -> Report:
    """The report of a case, also of one that crashed."""
    is_whole, report = result
    if is_whole and isinstance(report, Report):
        return report
    printed = log.read_text(errors="replace")[-1000:] if log.exists() else ""
    return Report("other", [f"{report}\n{printed}".strip()])


def smallest(material: bytes, name: str, problem: str, place: Path) -> bytes:
    """The smallest configuration that shows a problem: lines left out, numbers made round."""
    end, trials = time.monotonic() + SMALLEST_SECONDS, 0

    def shows(lines: list[bytes]) -> bool:
        nonlocal trials
        trials += 1
        function = partial(_check, b"\n".join(lines) + b"\n", name, place)
        log = place.with_suffix(".log")
        report = report_of(result_of(function, CASE_SECONDS, log), log)
        return any(_label(one) == _label(problem) for one in report.problems)

    def is_over() -> bool:
        return trials >= MOST_TRIALS or time.monotonic() > end

    lines = [line for line in material.split(b"\n") if line.strip()]
    if not shows(lines):
        return material
    length = len(lines) // 2
    while length and not is_over():
        start = 0
        while start < len(lines) and not is_over():
            less = lines[:start] + lines[start + length :]
            if shows(less):
                lines = less
            else:
                start += length
        length //= 2
    for number, line in enumerate(lines):
        match = NUMBER.search(line)
        if match and not is_over():
            rounded = f"{float(match[0]):.0e}" if b"." in match[0] or b"e" in match[0] else "1"
            one = lines.copy()
            one[number] = line[: match.start()] + rounded.encode()
            if one != lines and shows(one):
                lines = one
    return b"\n".join(lines) + b"\n"


def _check(material: bytes, name: str, place: Path) -> Report:
    return check_configuration(material, name, _fresh(place))


def _label(problem: str) -> str:
    """What a problem is, without its numbers."""
    return re.sub(r"[-+0-9.e]+", "0", problem)[:30]


def _different(problems: list[str]) -> list[str]:
    """One problem of each kind."""
    return list({_label(one): one for one in reversed(problems)}.values())[::-1]


def fuzz(
    counts: dict[str, int],
    *,
    seed: int = 1,
    jobs: int = 1,
    only: list[str] | None = None,
    kept: Path | None = None,
    tell: Callable[[str], None] = print,
) -> dict[str, list[str]]:
    """Try so many cases of each attack, and find what did not hold, by the names of cases.

    Cases are made of the seed; `only` names the only ones. What is found is kept in a folder, and
    a line is told for each case that does not hold, and a table in the end.
    """
    names = only or [
        f"{attack}:{seed}:{number}" for attack, count in counts.items() for number in range(count)
    ]
    found: dict[str, list[str]] = {}
    outcomes: dict[str, Counter[str]] = defaultdict(Counter)
    residuals: dict[str, list[float]] = defaultdict(list)
    here = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="mesoslip-fuzz-") as name_of_folder:
        folder = Path(name_of_folder)
        store = folder / "store" / "files"
        store.mkdir(parents=True)
        os.environ["FUZZ_STORE"] = str(store)
        if any(name.partition(":")[0] in NEED_OUTPUTS for name in names):
            with_long = any(name.startswith(("signals", "disks")) for name in names)
            function = partial(prepare, store, with_long)
            is_whole, why = result_of(function, 600.0, folder / "prepare.log")
            if not is_whole:
                raise RuntimeError(why)
        waiting, running = list(reversed(names)), {}
        free = list(range(jobs))
        while waiting or running:
            while waiting and free:
                name, place = waiting.pop(), folder / str(free[-1])
                seconds = LONG_SECONDS.get(name.partition(":")[0], CASE_SECONDS)
                one = Apart(partial(run_case, name, place), seconds, place.with_suffix(".log"))
                running[one] = (name, free.pop())
            wait_for_any(list(running))
            for one, (name, number) in list(running.items()):
                result = one.look()
                if result is None:
                    continue
                del running[one]
                free.append(number)
                report = report_of(result, one.log)
                report.problems = _different(report.problems)
                attack = name.partition(":")[0]
                outcomes[attack]["BROKEN" if report.problems else report.outcome] += 1
                if report.residual is not None:
                    residuals[report.residual[0]].append(report.residual[1])
                if report.problems:
                    found[name] = report.problems
                    tell(f"{name}\n  " + "\n  ".join(report.problems))
        if kept is not None:
            labels: Counter[str] = Counter()
            for name, problems in found.items():
                label = _label(problems[0])
                labels[label] += 1
                is_new = labels[label] <= MOST_SMALLEST
                _keep(name, problems, kept, folder / "smallest" if is_new else None)
    os.chdir(here)
    _tell_table(outcomes, residuals, tell)
    return found


def _keep(name: str, problems: list[str], kept: Path, place: Path | None) -> None:
    """Put what was found into a folder, and the smallest case, made in a place, if there is one."""
    target = kept / name.replace(":", "-")
    target.mkdir(parents=True, exist_ok=True)
    (target / "found.txt").write_text(f"{name}\n" + "\n".join(problems) + "\n")
    attack = name.partition(":")[0]
    if attack in {"configurations", "mutations"}:
        material = attacks.material(name)
        (target / "case.toml").write_bytes(material)
        if place is not None:
            (target / "smallest.toml").write_bytes(smallest(material, name, problems[0], place))


def _tell_table(
    outcomes: dict[str, Counter[str]],
    residuals: dict[str, list[float]],
    tell: Callable[[str], None],
) -> None:
    names = sorted({name for one in outcomes.values() for name in one})
    tell("attack".ljust(16) + "".join(name.rjust(10) for name in names) + "     cases")
    for attack, counts in outcomes.items():
        numbers = "".join(f"{counts[name]:10d}" for name in names)
        tell(attack.ljust(16) + numbers + f"{sum(counts.values()):10d}")
    if residuals:
        tell("energy residual, greatest and median, over what the kind of run promises")
    for kind, values in sorted(residuals.items()):
        middle = sorted(values)[len(values) // 2]
        tell(f"  {kind:40} {max(values):9.2g} {middle:9.2g} {len(values):6d} runs")


def _counts(texts: list[str]) -> dict[str, int]:
    if not texts:
        return {name: count for name, (_, count) in ATTACKS.items()}
    pairs = [one.partition("=") for one in texts]
    return {name: int(count) if count else ATTACKS[name][1] for name, _, count in pairs}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("attacks", nargs="*", metavar="ATTACK[=COUNT]", help=", ".join(ATTACKS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--only", action="append", metavar="NAME", help="such as signals:1:7")
    parser.add_argument("--kept", type=Path, default=ROOT / "out" / "fuzz")
    parser.add_argument("--no-keep", action="store_true", help="keep nothing, seek no smallest")
    given = parser.parse_args()
    found = fuzz(
        _counts(given.attacks),
        seed=given.seed,
        jobs=given.jobs,
        only=given.only,
        kept=None if given.no_keep else given.kept.resolve(),
        tell=partial(print, flush=True),
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
