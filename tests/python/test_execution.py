"""Executors, their store and their stop: nothing is lost, and files of others stay as they are."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import klein_tables, long, run_program
from mesoslip import Config, ConfigError, FileError
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.execution import local
from mesoslip.execution.executors import ThreadsThenProcesses, as_executor, completed
from mesoslip.execution.interruptible import interruptible
from mesoslip.execution.pool import PoolError, WorkerLostError
from mesoslip.execution.stop import Stop
from mesoslip.execution.store import Folder, Pieces, Store
from mesoslip.simulation.checkpoint import checkpoint_folder
from pieces import divmod_of, kill_or_square, sleep_until_stopped
from test_sweep import SIMPLE, TINY, sweep_file

__all__ = ["sweep_file"]

EXECUTORS = [mesoslip.Threads(3), mesoslip.Processes(2), ThreadsThenProcesses(2)]


def results(executor, function, pieces, **options):
    with closing(completed(executor, function, pieces, Stop(), **options)) as work:
        return [(piece, future.result()) for piece, future in work]


@pytest.mark.parametrize("executor", EXECUTORS, ids=repr)
def test_every_piece_comes_back_once(executor):
    pieces = [(number, 7) for number in range(50)]
    found = results(executor, divmod_of, pieces, in_order=True)
    assert found == [(piece, divmod(*piece)) for piece in pieces]
    assert results(executor, divmod_of, []) == []


def test_only_some_pieces_are_in_flight():
    """A list that never ends need not fit into memory."""
    taken = []

    def endless():
        while True:
            taken.append(len(taken))
            yield taken[-1]

    with closing(completed(mesoslip.Threads(2), lambda one, _: one, endless(), Stop())) as work:
        for done, (piece, future) in enumerate(work, 1):
            assert future.result() == piece
            assert len(taken) - done <= 4
            if done == 100:
                break


def test_an_error_is_that_of_its_piece_alone():
    def reciprocal(piece, _stop):
        return 1 / piece

    found = {}
    with closing(completed(mesoslip.Threads(1), reciprocal, [2, 0, 4], Stop())) as work:
        for piece, future in work:
            found[piece] = future.exception() or future.result()
    assert (found[2], found[4]) == (0.5, 0.25)
    assert isinstance(found[0], ZeroDivisionError)


def test_a_killed_process_costs_its_piece_alone():
    found = {}
    with closing(
        completed(mesoslip.Processes(2), kill_or_square, range(8), Stop(), in_order=True)
    ) as work:
        for piece, future in work:
            found[piece] = future.exception() or future.result()
    assert list(found) == list(range(8))
    assert isinstance(found.pop(3), WorkerLostError)
    assert isinstance(found.pop(5), ConfigError)
    assert all(value == piece**2 for piece, value in found.items())


def test_processes_that_cannot_start_end_the_work(monkeypatch):
    monkeypatch.setattr(local, "PROCESS", "raise SystemExit(7)")
    work = completed(mesoslip.Processes(1), kill_or_square, range(8), Stop())
    with closing(work), pytest.raises(PoolError, match="ended with status 7"):
        list(work)


@pytest.mark.parametrize("started", [0, 1])
def test_threads_that_cannot_start_do_without_or_end_the_work(started, monkeypatch):
    """As where the memory of a process is limited: Python has an error of another kind for it."""

    class Thread(threading.Thread):
        count = 0

        def start(self):
            Thread.count += 1
            if Thread.count > started:
                raise RuntimeError("can't start new thread")
            super().start()

    monkeypatch.setattr(local.threading, "Thread", Thread)
    work = completed(mesoslip.Threads(3), lambda one, _: one**2, range(8), Stop())
    with closing(work):
        if not started:
            with pytest.raises(PoolError, match="a worker cannot be started"):
                next(work)
        else:
            assert sorted(future.result() for _, future in work) == [n**2 for n in range(8)]


@pytest.mark.parametrize("executor", EXECUTORS, ids=repr)
def test_a_stop_is_answered_at_once(executor):
    stop = Stop()
    threading.Timer(0.3, stop.set).start()
    begin = time.monotonic()
    with closing(completed(executor, sleep_until_stopped, [60.0] * 1000, stop)) as work:
        assert not [future for _, future in work if future.exception() is None]
    assert time.monotonic() - begin < 5


def test_an_interrupt_does_not_wait_for_a_long_call():
    """As of the force curve in the kernel, which looks at no signal."""
    assert interruptible(divmod, 7, 2) == (3, 1)
    with pytest.raises(ZeroDivisionError):
        interruptible(divmod, 1, 0)
    timer = threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT))
    begin = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        interruptible(time.sleep, 3.0)
    assert time.monotonic() - begin < 2.0


def test_executors_are_checked():
    assert as_executor(None) == mesoslip.Threads()
    assert as_executor(3) == mesoslip.Threads(3) != mesoslip.Processes(3)
    for wrong in (0, -1, True, 1.5, "threads"):
        with pytest.raises(ConfigError, match="executor = "):
            as_executor(wrong)


# The store.


def test_pieces_come_back_or_are_missing(tmp_path):
    body = {"value": repr(0.1)}
    with Store(tmp_path / "points", "points") as store:
        store.write("00000a", body)
        assert store.names() == {"00000a"}
        path = tmp_path / "points" / "00000a.json"
        whole = path.read_bytes()
        changed = whole.replace(b"0.1", b"0.2")
        for damaged in (whole[:-9], b"", b"[" * 200_000, changed, b"1" * 5000):
            path.write_bytes(damaged)
            assert store.read("00000a") is None
        path.write_bytes(whole)
    assert Pieces(tmp_path / "points").read("00000a")["value"] == "0.1"
    assert Pieces(tmp_path / "none").names() == set()


def test_a_store_of_something_else_is_refused(tmp_path):
    path = tmp_path / "simulations"
    with Store(path, "simulations", "one") as store:
        store.write("00000001", {})
    with pytest.raises(FileError, match="of another configuration, trace or version"):
        Store(path, "simulations", "other")
    with Store(path, "simulations", "one") as store:
        assert store.names() == {"00000001"}
        store.remove()
    assert not path.exists()


def test_foreign_files_are_never_touched(tmp_path):
    """Nor is what a link leads to, nor what only looks like a file of a store."""
    precious = tmp_path / "precious"
    precious.write_text("precious")
    linked = tmp_path / "linked"
    linked.mkdir()
    (linked / "lock").symlink_to(precious)
    with pytest.raises(FileError, match="was not made by this program"):
        Store(linked, "points")
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "lock").write_text("theirs")
    with pytest.raises(FileError, match="was not made by this program"):
        Store(theirs, "points")
    shared = tmp_path / "shared"
    shared.mkdir()
    names = (".gitignore", ".note.part", "state.npz", "00000a.txt")
    for name in names:
        (shared / name).write_text(name)
    with Store(shared, "points") as store:
        store.write("00000a", {})
        store.remove()
    assert {one.name: one.read_text() for one in shared.iterdir() if one.name in names} == {
        name: name for name in names
    }
    assert precious.read_text() == "precious"
    assert (theirs / "lock").read_text() == "theirs"


def test_links_in_a_store_are_not_followed(tmp_path):
    """As in one out of an archive."""
    precious, points = tmp_path / "precious", tmp_path / "points"
    precious.write_text("precious")
    with Store(points, "points", "one") as store:
        for name in (".00000a.json.part", ".00000a.nc.part", "00000b.json"):
            (points / name).symlink_to(precious)
        store.write("00000a", {}, b"output")
        with pytest.raises(FileError, match=r"00000b\.json: cannot be read: is a link"):
            store.read("00000b")
    (points / "manifest.json").unlink()
    (points / "manifest.json").symlink_to(precious)
    with pytest.raises(FileError, match="of another configuration"):
        Store(points, "points", "one")
    assert precious.read_text() == "precious"


def test_pipes_in_a_folder_are_refused(tmp_path):
    os.mkfifo(tmp_path / "00000a.json")
    with pytest.raises(FileError, match=r"00000a\.json: cannot be read: is not a regular file"):
        Pieces(tmp_path).read("00000a")


@pytest.mark.parametrize("names", [[], ["thesis.tex"]])
def test_a_link_to_a_folder_needs_the_mark_of_a_store(names, tmp_path):
    theirs, link = tmp_path / "theirs", tmp_path / "out.points"
    theirs.mkdir()
    for name in names:
        (theirs / name).write_text("theirs")
    link.symlink_to(theirs)
    with pytest.raises(FileError, match="was not made by this program"):
        Store(link, "points")
    assert [one.name for one in theirs.iterdir()] == names
    link.unlink()
    with Store(tmp_path / "kept", "points") as store:
        store.write("00000a", {})
    link.symlink_to(tmp_path / "kept")
    with Store(link, "points") as store:
        assert store.names() == {"00000a"}


@pytest.mark.parametrize("name", ["manifest.json", "00000a.nc", ".00000a.json.part", "lock"])
def test_a_store_takes_no_file_of_its_names_for_its_own(name, tmp_path):
    """In a folder that holds files of others, such as .gitignore; an empty lock is one of them."""
    (tmp_path / ".gitignore").write_text("*")
    (tmp_path / name).write_text("")
    with pytest.raises(FileError, match="was not made by this program"):
        Store(tmp_path, "points", "one")
    assert {one.name for one in tmp_path.iterdir()} == {".gitignore", name}
    assert (tmp_path / name).read_text() == ""


def test_a_store_in_a_folder_of_others_is_found_again_and_removed(tmp_path):
    (tmp_path / ".gitignore").write_text("*")
    with Store(tmp_path, "points", "one") as store:
        store.write("00000a", {})
    with Store(tmp_path, "points", "one") as store:
        assert store.names() == {"00000a"}
        store.remove()
    assert [one.name for one in tmp_path.iterdir()] == [".gitignore"]


@pytest.mark.parametrize("count", range(6))
def test_a_store_is_its_own_however_much_of_it_was_removed(count, tmp_path, monkeypatch):
    """As when the program is killed after the output of a fit is there."""
    path, unlink, removed = tmp_path / "simulations", Path.unlink, []

    def killed(self, **more):
        if len(removed) == count:
            raise KeyboardInterrupt
        removed.append(self.name)
        unlink(self, **more)

    store = Store(path, "simulations", "one")
    for number in range(4):
        store.write(f"{number:08d}", {})
    monkeypatch.setattr(Path, "unlink", killed)
    with pytest.raises(KeyboardInterrupt):
        store.remove()
    monkeypatch.undo()
    store.close()
    with Store(path, "simulations", "one") as store:
        assert len(store.names()) == max(4 - count, 0)
        store.remove()
    assert not path.exists()


def test_a_folder_of_files_of_known_names_is_not_one_of_ours(tmp_path):
    (tmp_path / "state.npz").write_text("theirs")
    with pytest.raises(FileError, match="was not made by this program"):
        Folder(tmp_path, "checkpoint", r"state\.npz").lock()
    Folder(tmp_path, "checkpoint", r"state\.npz").remove()
    assert (tmp_path / "state.npz").read_text() == "theirs"


# Commands.


def contents(folder: Path) -> dict[str, bytes]:
    """All files under a folder."""
    paths = [one for one in folder.rglob("*") if one.is_file()]
    return {str(one.relative_to(folder)): one.read_bytes() for one in paths}


@pytest.fixture
def run_file(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(Config.from_dict(TINY).to_toml())
    return path


def test_a_folder_that_is_no_checkpoint_refuses_the_run(tmp_path, run_file, command):
    """Whatever is in it; and one that is called like an old checkpoint is left alone."""
    for name in ("mine.checkpoint", "mine.checkpoint.old"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "thesis.tex").write_text("years of work")
    (tmp_path / "mine.partial.nc").write_text("years of work")
    before = contents(tmp_path)
    for more in ([], ["--resume"]):
        status, _, message = command("run", run_file, "-o", tmp_path / "mine.nc", *more)
        assert (status, message.count("\n")) == (2, 1)
        assert "mine.checkpoint: was not made by this program" in message
        assert contents(tmp_path) == before
    (tmp_path / "mine.checkpoint").rename(tmp_path / "kept")
    command.output("run", run_file, "-o", tmp_path / "mine.nc")
    after = contents(tmp_path)
    assert after.pop("mine.nc")
    assert after.pop("kept/thesis.tex")
    assert after == {name: one for name, one in before.items() if "checkpoint/" not in name}


def test_a_link_to_itself_is_no_checkpoint(tmp_path, run_file, command):
    """It is refused before the run, which would otherwise fail when its output is there."""
    (tmp_path / "mine.checkpoint").symlink_to(tmp_path / "mine.checkpoint")
    status, _, message = command("run", run_file, "-o", tmp_path / "mine.nc")
    assert (status, message.count("\n")) == (2, 1)
    assert "mine.checkpoint: was not made by this program" in message
    assert not (tmp_path / "mine.nc").exists()


def stopped_run(config, output: Path, seed: int) -> None:
    """Have a run stopped as soon as it has started."""
    from mesoslip.simulation.checkpoint import Checkpoint
    from mesoslip.simulation.run_realizations import run_realizations

    config, stop = config.replace({"run.seed": seed}), Stop()

    def stop_soon(part):
        if part > 0:
            stop.set()

    with Checkpoint(checkpoint_folder(output), config) as checkpoint:
        run_realizations(config, checkpoint=checkpoint, stop=stop, progress=stop_soon)


def test_checkpoints_of_stopped_runs_are_kept_until_one_is_complete(tmp_path, run_file, command):
    """The first of three is there when the third has been stopped."""
    config = Config.from_dict(klein_tables(run__duration=10_000.0))
    output = tmp_path / "out.nc"
    for seed in (1, 2, 3):
        stopped_run(config, output, seed)
    folders = [tmp_path / f"out.checkpoint{end}" for end in ("", ".old", ".old2")]
    seeds = []
    for folder in folders:
        with np.load(folder / "state.npz") as file:
            seeds.append(json.loads(str(file["header"]))["configuration"])
    found = [Config.from_toml(one).run.seed for one in seeds]
    assert found == [3, 1, 2]
    command.messages("run", run_file, "-o", output)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["out.nc", "run.toml"]


def test_replacing_another_output_is_reported_before(tmp_path, run_file, command):
    output = tmp_path / "out.nc"
    assert command("run", run_file, "-o", output)[0] == 0
    before = output.read_bytes()
    # A run that fails leaves the old output, and has said what would have become of it.
    (tmp_path / "out.checkpoint").mkdir()
    (tmp_path / "out.checkpoint" / "theirs").write_text("theirs")
    message = command.refusal("run", run_file, "-o", output, "--set", "run.seed=5")
    assert "the output of another configuration will be replaced" in message
    assert output.read_bytes() == before


def test_workers_take_no_module_from_the_current_folder(tmp_path):
    """Such as a json.py that somebody has left there."""
    for name in ("json", "numpy", "mesoslip", "multiprocessing", "threading"):
        (tmp_path / f"{name}.py").write_text(f"open('{tmp_path}/imported', 'w').close()\n")
    (tmp_path / "sweep.toml").write_text(
        Config.from_dict(TINY).to_toml()
        + '\n[sweep]\nmeasures = ["breaks"]\n[sweep.grid]\n"contacts.delay" = [1e-4]\n'
    )
    line = ("sweep", "sweep.toml", "--pool", "processes", "--workers", "1", "--quiet")
    status, _, errors = run_program(Path(sys.executable).with_name("mesoslip"), *line, cwd=tmp_path)
    assert (status, errors) == (0, "")
    assert not (tmp_path / "imported").exists()


def test_whole_numbers_of_a_range_are_exact():
    """Also those that no double is."""
    first = 9_007_199_254_740_993
    grid = {"run.seed": {"from": first, "to": first + 4, "points": 5}}
    plan = Plan.from_dict({**TINY, "sweep": {"measures": ["breaks"], "grid": grid}})
    seeds = [plan.config(number).run.seed for number in range(5)]
    assert seeds == [first + number for number in range(5)]
    data = mesoslip.sweep(plan, executor=1)
    assert data["run.seed"].values.tolist() == seeds
    wide = {"contacts.delay": {"from": 1e-18, "to": 1e18, "points": 3, "spacing": "logarithmic"}}
    plan = Plan.from_dict({**TINY, "sweep": {"measures": ["breaks"], "grid": wide}})
    np.testing.assert_allclose([row[0] for row in plan.axes[0].rows], [1e-18, 1, 1e18])


MANY = SIMPLE.replace("realizations = 2", "realizations = 1000000").replace(', "0.5 ms"', "")


@pytest.mark.parametrize("seconds", [0.5, long(8.0)])
def test_a_sweep_of_a_million_points_answers_at_once(seconds, tmp_path, sweep_file):
    """At any time after its start; in computing time, as others may use the machine as well."""
    output = tmp_path / "many.nc"
    process = subprocess.Popen(
        [sys.executable, "-m", "mesoslip", "sweep", str(sweep_file(MANY)), "-o", str(output)],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    while not (tmp_path / "many.points" / "lock").exists():
        time.sleep(0.05)
    time.sleep(seconds)
    before = cpu_seconds(process.pid)
    process.send_signal(signal.SIGTERM)
    after = now = before
    while now is not None:
        after, now = now, cpu_seconds(process.pid)
        time.sleep(0.02)
    _, message = process.communicate()
    assert process.returncode == 143, message
    assert "points are missing" in message
    assert after - before < 2.5
    done = xr.load_dataset(tmp_path / "many.partial.nc")
    assert (done["status"] == 0).sum() == len(Pieces(tmp_path / "many.points").names())


def cpu_seconds(process: int) -> float | None:
    """Computing time of a process so far [s]; None if it has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    if fields[0] in {"Z", "X"}:
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
