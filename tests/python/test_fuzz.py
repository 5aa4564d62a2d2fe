"""A small part of the attack (tests/fuzz), always the same; and what it must be able to see."""

import signal
import sys
import threading
import time
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import tomli_w
import xarray as xr
from apart import Command
from configurations import NASTY, draw, mutate, text
from conftest import ROOT, klein_tables, long, run_program
from invariants import broken, left_over
from kinds import configuration
from mesoslip.simulation.run_realizations import run_realizations

# Computing time in which a run answers a signal [s].
ANSWER_SECONDS = 3.0


def test_attack():
    """A few cases of most attacks, each in a process of its own; make fuzz tries thousands."""
    counts = "configurations=1 mutations=1 checkpoints=1 calls=1"
    options = ("--jobs", "1", "--seed", "2026", "--no-keep")
    script = ROOT / "tests" / "fuzz" / "fuzz.py"
    status, printed, errors = run_program(sys.executable, script, *counts.split(), *options)
    assert status == 0, printed[-3000:] + errors[-3000:]
    assert "mutations" in printed


def test_cases_are_made_again_from_their_names():
    from random import Random

    for name in ("mutations:1:1", "mutations:1:2"):
        one, other = (mutate(random, draw(random)) for random in (Random(name), Random(name)))
        assert one == other
    assert text(draw(Random("a"))) != text(draw(Random("b")))
    assert len(NASTY) > 40


@pytest.mark.parametrize(
    ("where", "name", "value", "printed"),
    [
        ("/", "spring_force", np.nan, "finite"),
        ("/", "velocity", np.inf, "finite"),
        ("/", "detached_contacts", 10**6, "contacts"),
        ("/", "energy_residual", 1e-6, "energy"),
        ("/", "breaks", 10, "slips"),
        ("slips", "end_time", 0.0, "slips: one ends before it starts"),
        ("slips", "end_time", 1.0, "slips: one is not within the run"),
        ("slips", "realization_index", 5, "slips: of no realization"),
    ],
)
def test_what_is_broken_is_seen(where, name, value, printed):
    config = configuration("rigid", drive={"velocity": 1e-5}, run__duration=0.1)
    tree = mesoslip.run(config)
    assert list(broken(tree, config)) == []
    tree[where][name].values[..., -1] = value
    assert any(one.startswith(printed) for one in broken(tree, config))


def test_avalanches_that_do_not_add_up_are_seen():
    config = configuration("quasistatic, lattice")
    tree = mesoslip.run(config)
    assert list(broken(tree, config)) == []
    tree["avalanches/size"].values[0] += 1
    assert any("breaks of" in one for one in broken(tree, config))


# Signals at moments that are not left to chance.


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "folder"
    place.mkdir()
    return place


def long_run(folder: Path, **changes: object) -> Path:
    path = folder / "case.toml"
    path.write_text(tomli_w.dumps(klein_tables(**changes)))
    return path


# A second to run, and as long to write.
FINE = {"run__duration": 12.0, "contacts__count": 200}
FINE |= {"output": {"interval": 1.2e-5, "slip_interval": 1e-5}}


def wait_for(condition, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def wait_for_work(process: Command, seconds: float) -> float:
    """Wait until a command has worked for so long since it took over the signals.

    Returns the computing time that it has had then.
    """
    wait_for(process.catches_signals)
    start = process.cpu_seconds()
    wait_for(lambda: process.cpu_seconds() >= start + seconds)
    return process.cpu_seconds()


@pytest.mark.parametrize(
    ("number", "times"),
    [
        *((signal.SIGTERM, 2), long(signal.SIGINT, 1), long(signal.SIGHUP, 1)),
        *(long(signal.SIGINT, 2), long(signal.SIGTERM, 1), long(signal.SIGHUP, 2)),
    ],
)
def test_signals_while_the_output_is_written(number, times, folder):
    """The file becomes whole all the same, and nothing else stays."""
    process = Command(["run", long_run(folder, **FINE), "-o", "out.nc"], folder)
    wait_for(lambda: list(folder.glob(".mesoslip-*/out.nc")))
    wait_for(lambda: any(one.stat().st_size > 10**5 for one in folder.glob(".mesoslip-*/out.nc")))
    for _ in range(times):
        process.send(number)
        time.sleep(0.01)
    printed = process.wait(60.0)
    assert printed is not None
    assert "Traceback" not in printed.err
    # Those that come after all is written end the program as they end any.
    assert printed.status in {0, 128 + number, -number}
    assert left_over(folder, {"case.toml", "out.nc"}) == []
    with xr.open_datatree(folder / "out.nc") as tree:
        assert np.isfinite(tree.load()["spring_force"].values).all()


@pytest.mark.parametrize("times", [long(1), 2])
def test_ctrl_c_before_the_first_event(times, folder):
    """While configuration, checkpoint and kernel are made, as with very many contacts."""
    case = long_run(folder, contacts__count=1_000_000, contacts__initial="steady")
    for seconds in (0.0, 0.4) if times == 1 else (0.15,):
        process = Command(["run", case, "-o", "out.nc"], folder)
        before = wait_for_work(process, seconds)
        for _ in range(times):
            process.send(signal.SIGINT)
        printed = process.wait(60.0)
        assert printed is not None
        assert printed.status == 130
        assert "Traceback" not in printed.err
        assert printed.seconds - before < ANSWER_SECONDS
        # A checkpoint is kept until a run of the output is complete.
        kept = {"case.toml", "out.partial.nc", "out.checkpoint", "out.checkpoint.old"}
        kept |= {f"out.checkpoint.old{number}" for number in (2, 3)}
        assert left_over(folder, kept) == []


SLOW = {
    "layers": {
        "slider": {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 20000},
    },
    "layers, bdf": {
        "slider": {
            "kind": "layered",
            "mass": 1.47e-3,
            "stiffness": 97.0,
            "layers": 20000,
            "solver": {"method": "bdf"},
        },
    },
    "me": {"run__engine": "me", "run__resolution": 0.01, "contacts__delay": 0.05},
    "me, wide": {
        "run__engine": "me",
        "run__resolution": 0.01,
        "contacts__threshold__relative_width": 0.5,
        "contacts__threshold__law": "lognormal",
    },
    "me, layers": {
        "run__engine": "me",
        "slider": {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 5000},
    },
    "lattice": {
        "contacts__count": 1_000_000,
        "interaction": {"strength": 1.0, "columns": 1000, "rows": 1000},
    },
}


@pytest.mark.parametrize(
    ("kind", "seconds"),
    [long(kind, 0.2) if kind in {"layers, bdf", "layers", "me"} else (kind, 0.2) for kind in SLOW]
    + [long(kind, 2.0) for kind in SLOW],
)
def test_runs_answer(kind, seconds, klein):
    """Segments end by the work that is done, for every kind."""
    stop, asked = threading.Event(), []

    def ask() -> None:
        asked.append(time.process_time())
        stop.set()

    threading.Timer(seconds, ask).start()
    results = run_realizations(klein(**SLOW[kind]), executor=1, stop=stop)
    assert not results.complete
    assert time.process_time() - asked[0] < ANSWER_SECONDS


# Arguments in Python.


@pytest.mark.parametrize("workers", [-1, 0, float("nan"), 1.5, "2", True, np.int64(-1)])
def test_workers_are_refused(workers):
    with pytest.raises(mesoslip.ConfigError, match=r"executor = .*: must be a whole") as printed:
        mesoslip.run(configuration("rigid"), executor=workers)
    assert "\n" not in str(printed.value)


def test_numbers_of_numpy_are_taken():
    tables = klein_tables(contacts__count=np.int64(50), run__duration=np.float64(0.1))
    tables["run"]["realizations"] = np.int32(2)
    tree = mesoslip.run(tables, executor=np.int64(2))
    assert tree.sizes["realization"] == 2
