"""Break the program on purpose, and see whether tests notice: ``make mutants``.

Each mutant of mutants.toml replaces a text, which stands once in a source, by a wrong one, and
names the tests that should fail then: of pytest, or a program of tests/fortran. The sources
themselves are not touched: mutants are made of copies in build/mutants.
"""

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "mutants"
SOURCE, KERNEL, PACKAGE = FOLDER / "source", FOLDER / "kernel", FOLDER / "python" / "mesoslip"
LIST = Path(__file__).with_name("mutants.toml")
# Time of the tests of a mutant [s]: one that hangs is noticed too.
TEST_SECONDS = 300.0
# Mutants that may live: some wrong programs answer as the right one does.
MAX_ALIVE = 2
KILLED, ALIVE, NOT_BUILT = "killed", "ALIVE", "does not compile"


@dataclass(frozen=True)
class Mutant:
    """A wrong program: a text of a source and what replaces it, and tests that should fail."""

    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    @property
    def is_fortran(self) -> bool:
        return self.file.endswith(".f90")

    @property
    def label(self) -> str:
        return f"{self.file}: {self.old.strip().splitlines()[0].strip()}"

    def mistake(self) -> str:
        """Why it is no mutant of the sources that there are; empty if it is one."""
        path = ROOT / self.file
        if not path.exists():
            return "there is no such file"
        count = path.read_text().count(self.old)
        return "" if count == 1 else f"the text stands there {count} times"


def load(path: Path) -> list[Mutant]:
    """Read a list of mutants."""
    tables = tomllib.loads(path.read_text())["mutant"]
    return [Mutant(**{**table, "tests": tuple(table["tests"])}) for table in tables]


@contextmanager
def changed(path: Path, mutant: Mutant) -> Iterator[None]:
    """Have a copy of a source wrong for a while."""
    right = path.read_text()
    path.write_text(right.replace(mutant.old, mutant.new))
    try:
        yield
    finally:
        path.write_text(right)


def copy_package() -> None:
    """Copy the installed package, of which Python mutants are made."""
    import mesoslip

    shutil.rmtree(PACKAGE, ignore_errors=True)
    shutil.copytree(Path(mesoslip.__file__).parent, PACKAGE)


def prepare_kernel() -> None:
    """Copy the sources and build them; later builds compile what is changed."""
    names = run("git", "ls-files", "-co", "--exclude-standard").stdout.split("\n")
    for name in filter(None, names):
        source, target = ROOT / name, SOURCE / name
        is_new = not target.exists() or target.read_bytes() != source.read_bytes()
        if source.is_file() and is_new:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    if not (KERNEL / "build.ninja").exists():
        options = ["--buildtype=plain", "-Doptimization=1", "-Db_lto=false", "-Dtests=true"]
        setup = run("meson", "setup", *options, KERNEL, SOURCE)
        if setup.returncode:
            raise SystemExit(setup.stdout + setup.stderr)
    if not build_kernel(programs=[]):
        raise SystemExit("mutants: the sources as they are do not compile")


def build_kernel(programs: list[str]) -> bool:
    """Build Fortran tests; without any, the kernels, and put them into the copied package."""
    targets = [f"tests/fortran/test_{name}" for name in programs]
    library = f"python/_core{sysconfig.get_config_var('EXT_SUFFIX')}"
    if run("ninja", "-C", KERNEL, *(targets or [library])).returncode:
        return False
    if not targets:
        shutil.copyfile(KERNEL / library, PACKAGE / Path(library).name)
    return True


def run(*line: object, seconds: float | None = None) -> subprocess.CompletedProcess[str]:
    environment = {
        **os.environ,
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": str(PACKAGE.parent),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return subprocess.run(
        [str(word) for word in line],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )


PYTEST = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider")


def check_tests(mutants: list[Mutant]) -> None:
    """Have the tests pass with the package as it is, or a failure would not tell a mutant."""
    tests = sorted({test for one in mutants for test in one.tests if not is_program(test)})
    done = run(*PYTEST, "-n", 2, *tests)
    if done.returncode:
        raise SystemExit(f"mutants: the tests fail without any mutant\n{done.stdout[-3000:]}")


def is_program(test: str) -> bool:
    """Whether a test is a Fortran program."""
    return test.endswith(".f90")


def programs_of(tests: tuple[str, ...]) -> list[str]:
    """Names of the Fortran programs among tests."""
    return [Path(test).stem.removeprefix("test_") for test in tests if is_program(test)]


def passes(tests: tuple[str, ...]) -> bool:
    """Whether the tests pass with the copied package."""
    programs = programs_of(tests)
    line = ("meson", "test", "-C", KERNEL, "--no-rebuild", *programs)
    if not programs:
        line = (*PYTEST, *tests)
    try:
        done = run(*line, seconds=TEST_SECONDS)
    except subprocess.TimeoutExpired:
        return False
    if done.returncode not in {0, 1, 2}:
        raise SystemExit(f"mutants: {' '.join(tests)} cannot be run\n{done.stdout[-2000:]}")
    return done.returncode == 0


def outcome(mutant: Mutant) -> str:
    """Make a mutant, and see whether its tests pass."""
    if mutant.is_fortran:
        with changed(SOURCE / mutant.file, mutant):
            if not build_kernel(programs_of(mutant.tests)):
                return NOT_BUILT
            return ALIVE if passes(mutant.tests) else KILLED
    with changed(PACKAGE / Path(mutant.file).relative_to("python/mesoslip"), mutant):
        return ALIVE if passes(mutant.tests) else KILLED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="TEXT", help="part of a file's name or text")
    parser.add_argument("--check", action="store_true", help="only look for the texts")
    given = parser.parse_args()
    mutants = load(LIST)
    mistakes = [f"{one.label}: {why}" for one in mutants if (why := one.mistake())]
    if mistakes or given.check:
        print("\n".join(mistakes) or f"{len(mutants)} mutants")
        return 1 if mistakes else 0
    if given.names:
        mutants = [one for one in mutants if any(name in one.label for name in given.names)]
    # Those of Python first, with the kernels as installed.
    mutants.sort(key=lambda one: one.is_fortran)
    FOLDER.mkdir(parents=True, exist_ok=True)
    copy_package()
    check_tests(mutants)
    alive = 0
    is_prepared = False
    for mutant in mutants:
        if mutant.is_fortran and not is_prepared:
            prepare_kernel()
            is_prepared = True
        start = time.monotonic()
        found = outcome(mutant)
        alive += found != KILLED
        print(f"{found:17} {time.monotonic() - start:5.0f} s  {mutant.label}", flush=True)
    print(f"{len(mutants)} mutants, {alive} alive, at most {MAX_ALIVE}")
    return 1 if alive > MAX_ALIVE else 0


if __name__ == "__main__":
    sys.exit(main())
