"""What the tests share."""

import copy
import functools
import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
import typer
from mesoslip import Config, ConfigError, MesoslipError, _core
from mesoslip.command_line.main import main
from mesoslip.errors import Problem

ROOT = Path(__file__).parents[2]

# A shell that starts tests in the background has them, and what they start, ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)


# New objects between two looks for unused cycles: by default they take 7 % of the time of tests.
COLLECTION_THRESHOLDS = (20_000, 20, 20)

# Parsers of commands, which typer makes again for each command of a test: 20 ms each.
typer.main.get_command = functools.cache(typer.main.get_command)

# No test cuts the power: none has to wait until a disk has what is written, 4 ms a file.
# Processes of their own still wait, which tests kill.
os.fsync = lambda _: None


def pytest_configure():
    gc.set_threshold(*COLLECTION_THRESHOLDS)


def pytest_collection_finish():
    """What is imported by now stays, and need not be looked through."""
    gc.collect()
    gc.freeze()


def skip_without_sundials(message: str) -> None:
    """Skip a test that needs SUNDIALS, if this copy was built without: its message says so."""
    if "built without SUNDIALS" in message and not _core.sundials().strip():
        pytest.skip("this copy of mesoslip was built without SUNDIALS")


def _or_skip() -> Generator[None]:
    """Around fixtures and tests."""
    try:
        return (yield)
    except MesoslipError as error:
        skip_without_sundials(str(error))
        raise


pytest_runtest_setup = pytest.hookimpl(wrapper=True)(_or_skip)
pytest_runtest_call = pytest.hookimpl(wrapper=True)(_or_skip)


def long(*values: Any) -> Any:
    """Values of a parameter whose cases are run by ``make fuzz``, not by ``make test``."""
    return pytest.param(*values, marks=pytest.mark.long)


KLEIN = {
    "run": {"duration": 12.0},
    "drive": {"velocity": 1e-7},
    "slider": {"mass": 1.47e-3, "stiffness": 97.0, "damping_ratio": 0.2},
    "contacts": {
        "count": 4080,
        "area": 1e-10,
        "film_thickness": 3.5e-9,
        "film_density": 956.0,
        "static_force": 18e-6,
        "stiffness": 2000.0,
        "drag_rate": 2e11,
        "delay": 5e-4,
        "back_force_ratio": 0.1,
        "threshold": {"law": "gaussian", "relative_width": 0.01},
    },
    "output": {"interval": 1e-3},
}


def changed(tables: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """Tables with changes; a double underscore separates tables from keys, None removes a key."""
    tables = copy.deepcopy(tables)
    for path, value in changes.items():
        *outer, key = path.split("__")
        table = tables
        for name in outer:
            table = table.setdefault(name, {})
        if value is None:
            table.pop(key, None)
        else:
            table[key] = copy.deepcopy(value)
    return tables


def klein_tables(**changes: Any) -> dict[str, Any]:
    """Klein's case as tables, with changes."""
    return changed(KLEIN, **changes)


def drive_in_stages(*stages: tuple[float, float]) -> dict[str, Any]:
    """The table of a drive in stages, each of a duration and a velocity."""
    return {"stage": [{"duration": time, "velocity": velocity} for time, velocity in stages]}


@pytest.fixture
def klein():
    """Klein's case as a configuration, with changes."""

    def configure(**changes: Any) -> Config:
        return Config.from_dict(klein_tables(**changes))

    return configure


def problem_of(tables: dict[str, Any]) -> Problem:
    """The only mistake of tables that are refused."""
    with pytest.raises(ConfigError) as caught:
        Config.from_dict(tables)
    (problem,) = caught.value.problems
    return problem


def wait_until(condition: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait for something that must come to hold in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def at_end(one: Any, advances: int | None = None) -> Any:
    """A realization, advanced to its end in segments of a number of advances."""
    while not one.finished:
        one.advance(advances)
    return one


@pytest.fixture
def few_replicas(monkeypatch):
    """Fits of avalanche sizes with few synthetic samples, where their goodness does not matter."""
    from mesoslip.analysis.avalanche_sizes.power_law import fit_power_law

    monkeypatch.setitem(fit_power_law.__kwdefaults__, "replicas", 20)


@pytest.fixture
def no_step_errors(monkeypatch):
    """Master equations without the second run by which errors of their steps are estimated."""
    from mesoslip.simulation.realization import Realization

    def leave_out(self, *_):
        self._lacks_errors = False

    monkeypatch.setattr(Realization, "_estimate_errors", leave_out)


@pytest.fixture
def quick_pictures(monkeypatch):
    """Pictures that are coarse and not arranged, where it does not matter how they look."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    save = Figure.savefig
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda *_: None)
    monkeypatch.setattr(
        Figure, "savefig", lambda *given, **more: save(*given, **more | {"dpi": 30})
    )


def run_program(*words: object, **options: Any) -> tuple[int, str, str]:
    """Exit status, standard output and errors of a program in a process of its own."""
    line = list(map(str, words))
    done = subprocess.run(line, capture_output=True, text=True, check=False, **options)
    return done.returncode, done.stdout, done.stderr


def python(code: str, *words: object, **options: Any) -> str:
    """Standard output of lines of Python in a process of its own, which succeed."""
    status, printed, errors = run_program(sys.executable, "-c", code, *words, **options)
    assert status == 0, errors
    return printed


class Command:
    """Runs a command of the program in this process."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch, self._capfd = monkeypatch, capfd

    def __call__(self, *arguments: object) -> tuple[Any, str, str]:
        """Exit status, standard output and standard error."""
        self._monkeypatch.setattr(sys, "argv", ["mesoslip", *map(str, arguments)])
        with pytest.raises(SystemExit) as exit_:
            main()
        captured = self._capfd.readouterr()
        assert "Traceback" not in captured.err
        skip_without_sundials(captured.err)
        return exit_.value.code or 0, captured.out, captured.err

    def output(self, *arguments: object) -> str:
        """Standard output of a command that succeeds."""
        status, printed, message = self(*arguments)
        assert status == 0, message
        return printed

    def messages(self, *arguments: object) -> str:
        """Standard error of a command that succeeds."""
        status, _, message = self(*arguments)
        assert status == 0, message
        return message

    def refusal(self, *arguments: object) -> str:
        """Standard error of a command that refuses its arguments or files."""
        status, _, message = self(*arguments)
        assert status == 2, message
        return message


@pytest.fixture
def command(monkeypatch, capfd):
    return Command(monkeypatch, capfd)
