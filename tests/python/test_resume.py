"""Runs that are stopped and taken up again are the same to the bit."""

import errno
import gc
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import tomli_w
import xarray as xr
from conftest import at_end, drive_in_stages, klein_tables, long
from invariants import differences
from kinds import COARSE, KINDS, RANDOM, THERMAL, configuration, pairwise
from mesoslip import Config, FileError, RunError
from mesoslip.errors import NoMemoryError
from mesoslip.execution.store import Folder
from mesoslip.output.tree import build_tree
from mesoslip.simulation import realization
from mesoslip.simulation.checkpoint import Checkpoint, checkpoint_folder
from mesoslip.simulation.kernel import Kernel
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import TABLES
from mesoslip.simulation.run_realizations import Results, run_realizations

ONCE = {}


# For master equations, whose runs take most of the time: one slip and a reversal.
SHORT = {"drive": drive_in_stages((0.025, 1e-5), (0.002, 0.0), (0.025, -1e-5))}


def short_configuration(kind: str) -> Config:
    """The short run of a kind; of a master equation in long steps, mostly with a shorter drive."""
    if ", me" not in kind:
        return configuration(kind)
    return configuration(kind, **COARSE | ({} if "drive" in KINDS[kind] else SHORT))


def whole(kind: str) -> xr.DataTree:
    """The output of a run that was never stopped."""
    if kind not in ONCE:
        ONCE[kind] = build_tree(run_realizations(short_configuration(kind), executor=1))
    return ONCE[kind]


def assert_same(one: xr.DataTree, other: xr.DataTree) -> None:
    """Every byte but that of wall times."""
    assert differences(one, other) == []


def advanced(config: Config, folder: Path, advances: int | None, printed: list[str]) -> Results:
    """Go on from the checkpoint in a folder for some advances and keep another, or to the end."""
    realizations = [Realization(config, number) for number in range(config.run.realizations)]
    with Checkpoint(folder, config, resume=True, report=printed.append) as checkpoint:
        checkpoint.restore(realizations)
        for one in realizations:
            while not one.finished:
                one.advance(advances)
                if advances is not None:
                    break
        if advances is not None:
            assert checkpoint.write(realizations)
    return Results(config, realizations, advances is None, 0.0)


@pytest.mark.parametrize("seed", [0, *map(long, range(1, 10))])
@pytest.mark.parametrize("kind", pairwise(KINDS))
def test_a_run_cut_anywhere_is_the_same(kind, seed, tmp_path):
    """Several cuts, each at any event, also within a slip, a cascade, or a cut of a cut."""
    random = np.random.default_rng([seed, *kind.encode()])
    config, printed = short_configuration(kind), []
    for most in random.permutation([3, 30, 100, 400]):
        advanced(config, tmp_path, int(random.integers(1, most)), printed)
    results = advanced(config, tmp_path, None, printed)
    assert len(printed) == 1
    assert "no checkpoint" in printed[0]
    assert_same(whole(kind), build_tree(results))


@pytest.mark.parametrize(
    ("ageing", "force_ratio", "advances"),
    [
        ({"law": "log", "time": 1e-3, "growth": 0.05}, 0.05, 7),
        (
            {"law": "relax", "time": 5e-3, "young_force_ratio": 0.6, "young_relative_width": 0.05},
            0.1,
            300,
        ),
    ],
)
def test_cuts_between_reversals_keep_contacts_that_break_next(klein, ageing, force_ratio, advances):
    """Thresholds that grew in one stroke bound breaks in the next one of the same direction."""
    thermal = {"rate": 1e4, "force_ratio": force_ratio}
    config = klein(
        contacts__count=300,
        contacts__delay=3e-4,
        contacts__coupling="equal",
        contacts__ageing=ageing,
        contacts__thermal=thermal,
        run__duration=0.088,
        drive={
            "stage": [
                {"duration": 0.012, "velocity": 1e-5},
                {"duration": 0.010, "velocity": -1e-5},
            ],
            "repeat": 4,
        },
    )
    whole_run, cut = Realization(config, 0), Realization(config, 0)
    at_end(whole_run)
    cut.advance(advances)
    while not cut.finished:
        before, cut = cut, Realization(config, 0)
        cut.restore(before.save(), dict(before.waiting))
        cut.advance(advances)
    assert cut.advances == whole_run.advances
    np.testing.assert_array_equal(cut.trace[:], whole_run.trace[:])


@pytest.mark.parametrize("kind", ["rigid, lattice", "layered, bdf", "rigid, three realizations"])
def test_a_chain_of_ten_resumes(kind, tmp_path):
    config, printed = configuration(kind), []
    for advances in range(10, 110, 10):
        advanced(config, tmp_path, advances, printed)
    assert_same(whole(kind), build_tree(advanced(config, tmp_path, None, printed)))


def test_workers_and_stops_do_not_matter(tmp_path):
    """Stopped again and again by another thread, on two threads and on one."""
    config, expected = configuration("rigid, three realizations"), None
    config = Config.from_dict(config.to_dict() | {"output": {"interval": 1e-5}})
    expected = build_tree(run_realizations(config, executor=1))
    for attempt in range(100):
        stop = threading.Event()
        timer = threading.Timer(0.02, stop.set)
        timer.start()
        with Checkpoint(tmp_path / "c", config, interval=0.005, resume=True) as checkpoint:
            results = run_realizations(
                config, executor=1 + attempt % 2, stop=stop, checkpoint=checkpoint
            )
        timer.cancel()
        if results.complete:
            break
    assert results.complete
    assert_same(expected, build_tree(results))
    checkpoint.remove()
    assert not (tmp_path / "c").exists()


def test_what_was_recorded_waits_in_files(tmp_path, monkeypatch):
    """Rows do not stay in memory, and come back in their order."""
    from mesoslip.simulation import checkpoint as module

    monkeypatch.setattr(module, "MAX_WAITING_BYTES", 1000.0)
    monkeypatch.setattr(module, "MAX_WAITING_IF_SCARCE", 1000.0)
    config = configuration("rigid, lattice")
    one = Realization(config, 0)
    with Checkpoint(tmp_path, config, interval=0.0) as checkpoint:
        while not one.finished:
            one.advance(100)
            checkpoint.visit(one)
            checkpoint.update([one])
            assert sum(rows.waiting_bytes for _, rows in one.waiting) <= 1000
    assert_same(whole("rigid, lattice"), build_tree(Results(config, [one], True, 0.0)))


def test_fewer_rows_wait_in_memory_where_it_is_scarce(monkeypatch):
    from mesoslip.simulation import checkpoint as module

    for free, expected in ((8e9, module.MAX_WAITING_BYTES), (1e9, module.MAX_WAITING_IF_SCARCE)):
        monkeypatch.setattr(module, "free_memory", lambda free=free: free)
        assert module.max_waiting_bytes() == expected
    monkeypatch.setattr(module, "free_memory", lambda: 8e9)
    monkeypatch.setattr(module, "is_memory_short", lambda _: True)
    assert module.max_waiting_bytes() == module.MAX_WAITING_IF_SCARCE


def test_a_full_disk_does_not_stop_a_run(tmp_path, monkeypatch):
    """It says so, once, goes on, and what cannot be put into files stays in memory."""
    config, printed = configuration("rigid"), []

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with Checkpoint(tmp_path, config, interval=1e-9, report=printed.append) as checkpoint:
        checkpoint.restore([])
        monkeypatch.setattr(Folder, "open", full)
        results = run_realizations(config, checkpoint=checkpoint)
        assert not checkpoint.write(results.realizations)
        assert len(printed) == 1
        assert "No space left" in printed[0]
        assert_same(whole("rigid"), build_tree(results))
        # Once there is room again, there is a checkpoint.
        monkeypatch.undo()
        assert checkpoint.write(results.realizations)
    assert (tmp_path / "state.npz").exists()


def test_rows_that_a_full_disk_refused_still_count(tmp_path, monkeypatch):
    """Also those of a realization that is over, which is never visited again."""
    from mesoslip.simulation import checkpoint as module

    monkeypatch.setattr(module, "max_waiting_bytes", lambda: 0)
    monkeypatch.setattr(module, "RETRY_SECONDS", 0.0)
    one = Realization(configuration("rigid"), 0)
    with Checkpoint(tmp_path, one.config, interval=0) as checkpoint:
        checkpoint.restore([])
        one.advance(10**6)
        checkpoint.visit(one)
        with monkeypatch.context() as full:
            full.setattr(
                Folder, "open", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, ""))
            )
            checkpoint.update([one])
        checkpoint.update([one])
        assert sum(path.stat().st_size for path in tmp_path.glob("*.rows")) > 1000


@pytest.mark.parametrize("stage", [1, 2])
def test_what_was_computed_before_memory_ran_out_is_kept(stage, tmp_path, monkeypatch):
    """The realizations that are over, and of the one that failed its last state before."""
    config, take = configuration("rigid, three realizations"), Realization._take
    taken = []

    def short_of_memory(self, kernel):
        taken.append(self.number)
        if taken.count(2) == stage:
            raise MemoryError
        take(self, kernel)

    monkeypatch.setattr(Realization, "run_together", staticmethod(lambda _: 0))
    monkeypatch.setattr(realization, "FIRST_WORK", 500.0)
    with Checkpoint(tmp_path, config, interval=1e-9) as checkpoint:
        with monkeypatch.context() as scarce:
            scarce.setattr(Realization, "_take", short_of_memory)
            with pytest.raises(NoMemoryError, match="not enough memory"):
                run_realizations(config, executor=1, checkpoint=checkpoint)
        assert checkpoint.is_written
    with Checkpoint(tmp_path, config, resume=True) as checkpoint:
        again = [Realization(config, number) for number in range(3)]
        checkpoint.restore(again)
    assert [one.finished for one in again[:2]] == [True, True]
    assert_same(
        whole("rigid, three realizations"), build_tree(advanced(config, tmp_path, None, []))
    )


def test_a_realization_may_end_while_a_checkpoint_is_written(tmp_path, monkeypatch):
    """Its last rows, of which some are in no file yet, belong to the next checkpoint."""
    config, printed = configuration("rigid"), []
    one = Realization(config, 0)
    one.advance(100)
    with Checkpoint(tmp_path, config, interval=0.0) as checkpoint:
        flush = checkpoint._flush

        def end_after_flush(realizations):
            flush(realizations)
            at_end(one, 100)
            checkpoint.visit(one)

        monkeypatch.setattr(checkpoint, "_flush", end_after_flush)
        assert checkpoint.write([one])
    results = advanced(config, tmp_path, None, printed)
    assert printed == []
    assert_same(whole("rigid"), build_tree(results))


@pytest.mark.parametrize("damage", ["cut", "changed", "empty", "no rows"])
def test_a_damaged_checkpoint_falls_back(damage, tmp_path):
    config, printed = configuration("rigid"), []
    advanced(config, tmp_path, 200, printed)
    advanced(config, tmp_path, 200, printed)
    printed.clear()
    state = tmp_path / "state.npz"
    data = state.read_bytes()
    if damage == "cut":
        state.write_bytes(data[: len(data) // 2])
    elif damage == "changed":
        state.write_bytes(data[:2000] + bytes([data[2000] ^ 1]) + data[2001:])
    elif damage == "empty":
        state.write_bytes(b"")
    else:
        (tmp_path / "trace.rows").write_bytes(b"")
    results = advanced(config, tmp_path, None, printed)
    assert "damaged" in printed[0]
    assert len(printed) == (3 if damage == "no rows" else 1)
    # Nothing is thrown away: what was damaged may be of use to somebody.
    kept = tmp_path.with_name(f"{tmp_path.name}.old") if damage == "no rows" else tmp_path
    assert (kept / "damaged.state.npz").exists()
    assert_same(whole("rigid"), build_tree(results))


def test_whatever_damage_a_state_has_the_one_before_is_taken(tmp_path):
    """Also to the headings of the archive, of which the libraries raise all kinds of errors."""
    config = configuration("rigid")
    folder = tmp_path / "c"
    advanced(config, folder, 50, [])
    advanced(config, folder, 50, [])
    data, before = (folder / "state.npz").read_bytes(), (folder / "state.previous.npz").read_bytes()
    random = np.random.default_rng(1)
    headings = [*range(120), *range(len(data) - 800, len(data))]
    for place in random.choice(headings, 60, replace=False):
        flipped = bytes([data[place] ^ (1 << int(random.integers(8)))])
        (folder / "state.npz").write_bytes(data[:place] + flipped + data[place + 1 :])
        (folder / "state.previous.npz").write_bytes(before)
        realization = Realization(config, 0)
        with Checkpoint(folder, config, resume=True) as checkpoint:
            checkpoint.restore([realization])
        assert realization.advances in {50, 100}


@pytest.mark.parametrize("what", ["number", "header", "missing", "rows", "words"])
def test_a_state_that_was_edited_is_damaged(what, tmp_path):
    """Whatever was written into it, also with the archive's own checksums right."""
    config, printed = configuration("rigid"), []
    advanced(config, tmp_path, 50, [])
    with np.load(tmp_path / "state.npz") as file:
        arrays = dict(file)
    if what == "number":
        arrays["realizations"] = arrays["realizations"] + 7
    elif what == "header":
        header = json.loads(str(arrays["header"]))
        del header["wall_seconds"]
        arrays["header"] = np.array(json.dumps(header))
    elif what == "missing":
        del arrays["scalars.energy"]
    elif what == "rows":
        arrays["pieces.trace"] = arrays["pieces.trace"] + [3, 0, 0, 0, 0]
    else:
        arrays["words.0"][-1] += 1
    np.savez(tmp_path / "state.npz", **arrays)
    realization = Realization(config, 0)
    with Checkpoint(tmp_path, config, resume=True, report=printed.append) as checkpoint:
        checkpoint.restore([realization])
    assert "state.npz: damaged (it differs from what the run wrote)" in printed[0]
    assert realization.advances == 0


def test_what_cannot_be_read_is_not_taken_for_damaged(tmp_path):
    """Nor is the checkpoint touched: the disk may be there again in a moment."""
    config = configuration("rigid")
    advanced(config, tmp_path, 50, [])
    (tmp_path / "state.npz").rename(tmp_path / "kept")
    (tmp_path / "state.npz").mkdir()
    with (
        Checkpoint(tmp_path, config, resume=True) as checkpoint,
        pytest.raises(FileError, match="cannot be read"),
    ):
        checkpoint.restore([Realization(config, 0)])
    assert (tmp_path / "state.npz").exists()


def test_links_in_a_checkpoint_are_not_followed(tmp_path):
    """As in one out of an archive: new files take their places, and others are refused."""
    precious, folder = tmp_path / "precious", tmp_path / "c"
    precious.write_text("precious")
    config = configuration("rigid")
    folder.mkdir()
    (folder / "lock").write_text("mesoslip checkpoint\n")
    names = [f"{table}.rows" for table in TABLES]
    for name in (".state.npz.part", *names):
        (folder / name).symlink_to(precious)
    one = Realization(config, 0)
    with Checkpoint(folder, config) as checkpoint:
        one.advance(200)
        assert checkpoint.write([one])
    for name in ("trace.rows", "state.npz"):
        (folder / name).unlink()
        (folder / name).symlink_to(precious)
        with (
            Checkpoint(folder, config, resume=True) as checkpoint,
            pytest.raises(FileError, match=f"{name}: cannot be read: is a link"),
        ):
            checkpoint.restore([Realization(config, 0)])
    with Checkpoint(folder, config) as checkpoint:
        checkpoint.remove()
    assert not folder.exists()
    assert precious.read_text() == "precious"


@pytest.mark.parametrize("states", [1, 2])
def test_rows_that_were_changed_are_reported(states, tmp_path):
    """The state before is used if its rows are whole; otherwise the run starts from the beginning,
    and keeps the checkpoint."""
    config, printed = configuration("rigid"), []
    folder = tmp_path / "c"
    for _ in range(states):
        advanced(config, folder, 1000, printed)
    path = folder / "trace.rows"
    data = path.read_bytes()
    path.write_bytes(data[:-100] + bytes([data[-100] ^ 1]) + data[-99:])
    printed.clear()
    assert_same(whole("rigid"), build_tree(advanced(config, folder, None, printed)))
    assert "state.npz: damaged (trace.rows differs from the rows that the run wrote)" in printed[0]
    if states == 2:
        assert len(printed) == 1
        assert printed[0].endswith("the state before it is used, state.previous.npz")
    else:
        assert "starts from the beginning" in printed[1]
        assert (tmp_path / "c.old" / "damaged.state.npz").exists()


def test_no_realization_is_restored_from_a_damaged_state(tmp_path):
    """One that has started since the state before starts again."""
    config = configuration("rigid, three realizations")
    folder = tmp_path / "c"
    first = [Realization(config, number) for number in range(3)]
    with Checkpoint(folder, config) as checkpoint:
        for number in (0, 1):
            first[number].advance(200)
            assert checkpoint.write(first)
    path = folder / "trace.rows"
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    again = [Realization(config, number) for number in range(3)]
    with Checkpoint(folder, config, resume=True) as checkpoint:
        checkpoint.restore(again)
    assert [one.advances for one in again] == [first[0].advances, 0, 0]


def test_rows_that_are_damaged_while_the_run_continues_are_reported(tmp_path):
    config = configuration("rigid")
    one = Realization(config, 0)
    with Checkpoint(tmp_path, config) as checkpoint:
        one.advance(100)
        assert checkpoint.write([one])
        (tmp_path / "trace.rows").write_bytes(b"")
        with pytest.raises(RunError, match=r"trace\.rows: damaged"):
            _ = one.trace


def test_another_configuration_or_program_is_refused(tmp_path, monkeypatch):
    from mesoslip.simulation import checkpoint as module

    config, printed = configuration("rigid"), []
    advanced(config, tmp_path, 100, printed)
    other = configuration("rigid", contacts__delay=1e-3)
    with pytest.raises(FileError, match=r"contacts\.delay was 0\.0005, is 0\.001"):
        advanced(other, tmp_path, 100, printed)
    monkeypatch.setattr(module, "FORMAT", 0)
    with pytest.raises(FileError, match="format"):
        advanced(config, tmp_path, 100, printed)


def test_two_runs_of_one_output_are_refused(tmp_path):
    config = configuration("rigid")
    realization = Realization(config, 0)
    folder = tmp_path / "checkpoint"
    with Checkpoint(folder, config) as one, Checkpoint(folder, config, resume=True) as other:
        one.restore([realization])
        with pytest.raises(FileError, match="under way"):
            other.restore([Realization(config, 0)])
    assert not folder.exists()


def test_a_run_that_starts_anew_keeps_what_was_there(tmp_path):
    """Who forgot --resume, and stops the new run, has lost nothing."""
    config, printed = configuration("rigid"), []
    folder = tmp_path / "c"
    advanced(config, folder, 500, printed)
    with Checkpoint(folder, config, report=printed.append) as checkpoint:
        checkpoint.restore([Realization(config, 0)])
        assert not (folder / "state.npz").exists()
    assert "c.old" in printed[-1]
    (tmp_path / "c.old").rename(folder)
    printed.clear()
    assert_same(whole("rigid"), build_tree(advanced(config, folder, None, printed)))
    assert printed == []
    with Checkpoint(folder, config) as checkpoint:
        checkpoint.remove()
    assert list(tmp_path.iterdir()) == []


def test_realizations_that_wait_for_a_worker_do_not_hold_up_checkpoints(tmp_path):
    """Taken up by fewer workers than before."""
    config, printed = configuration("rigid, three realizations"), []
    advanced(config, tmp_path, 50, printed)
    with Checkpoint(tmp_path, config, interval=1e-9, resume=True) as checkpoint:
        realizations = [Realization(config, number) for number in range(3)]
        checkpoint.restore(realizations)
        before = (tmp_path / "state.npz").stat().st_ino
        for _ in range(3):
            realizations[0].advance(10)
            checkpoint.visit(realizations[0])
            checkpoint.update(realizations)
        assert (tmp_path / "state.npz").stat().st_ino != before


def test_whatever_ends_a_run_leaves_a_checkpoint(klein, tmp_path):
    """Such as a progress bar that finds no terminal any more."""
    config = klein(run__duration=10_000.0, output__interval=1.0)

    def no_terminal(part: float) -> None:
        if part > 0:
            raise BrokenPipeError

    with Checkpoint(tmp_path / "c", config) as checkpoint, pytest.raises(BrokenPipeError):
        run_realizations(config, progress=no_terminal, checkpoint=checkpoint)
    assert (tmp_path / "c" / "state.npz").exists()


def test_contacts_of_a_finished_run_are_gone():
    one = at_end(Realization(configuration("rigid"), 0))
    one.close()
    with pytest.raises(RunError, match="over"):
        _ = one.contacts


def test_states_are_whole_at_any_moment(tmp_path):
    """Whatever file operation a run is cut off at, one of two states can be taken up."""
    config, printed = configuration("rigid"), []
    advanced(config, tmp_path, 50, printed)
    advanced(config, tmp_path, 50, printed)
    # Between two renamings there is only the previous one; before them a part of the next.
    (tmp_path / "state.npz").rename(tmp_path / ".state.npz.part")
    printed.clear()
    results = advanced(config, tmp_path, None, printed)
    assert printed == []
    assert_same(whole("rigid"), build_tree(results))


def test_handles(klein):
    """Closed, shared and copied handles are clear errors."""
    import copy

    kernel = Kernel()
    with pytest.raises(RunError, match="lacks"):
        kernel.advance(1, 1.0)
    with pytest.raises(RunError, match="unknown kind of slider"):
        kernel.set_slider("round", {})
    with pytest.raises(RunError, match="'mass' is missing"):
        kernel.set_slider("rigid", {"stiffness": 1.0})
    with pytest.raises(RunError, match="unknown parameter 'colour'"):
        kernel.set_slider("prescribed", {"colour": 1.0})
    for duplicate in (copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="copied"):
            duplicate(kernel)
    kernel.close()
    kernel.close()
    with pytest.raises(RunError, match="closed"):
        kernel.advance(1, 1.0)

    busy = Realization(klein(run__duration=100.0), 0)
    busy.advance(1)
    thread = threading.Thread(target=busy.advance, kwargs={"work": 3e6})
    thread.start()
    wait_for(busy._kernel._lock.locked)
    with pytest.raises(RunError, match="another thread"):
        busy._kernel.ask()
    thread.join()
    assert busy._kernel.ask().time > 0


@pytest.fixture
def collections_as_usual():
    """Looks for cycles of objects as often as in any process."""
    before = gc.get_threshold()
    gc.set_threshold(700, 10, 10)
    yield
    gc.set_threshold(*before)


@pytest.mark.usefixtures("collections_as_usual")
def test_simulations_leave_no_memory_behind():
    """Thousands made and destroyed, of all kinds, some in the midst of a run."""
    configs = [configuration(kind) for kind in KINDS if "me" not in kind]

    def resident() -> float:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20

    def many(number: int) -> None:
        for count in range(number):
            one = Realization(configs[count % len(configs)], 0)
            if count % 10 == 0:
                one.advance(20)
            else:
                one._open()

    many(500)
    before = resident()
    many(2500)
    assert resident() - before < 2


# Runs that take some seconds, with both a trace and finer traces.
LONG = {"output__interval": 1e-2, "output__slip_interval": 1e-3}
LONG_RUNS = {
    "contacts": LONG | {"run__duration": 120.0, "run__realizations": 2, "contacts__count": 1000},
    "fewer contacts": LONG | {"run__duration": 400.0, "contacts__count": 500},
    "thermal populations": LONG
    | THERMAL
    | RANDOM
    | {"run__engine": "me", "run__duration": 12.0, "contacts__threshold__relative_width": 0.05},
}


@pytest.fixture
def long_run(request, tmp_path):
    path = tmp_path / "long.toml"
    path.write_text(tomli_w.dumps(klein_tables(**LONG_RUNS[request.param])))
    return path


# The command, which interrupts itself twice as soon as a file is there, however busy the machine.
INTERRUPTED = """
import os, signal, sys, threading, time
from mesoslip.command_line.main import main
def interrupt(path=sys.argv.pop(1)):
    while not os.path.exists(path):
        time.sleep(0.002)
    for _ in range(2):
        os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt, daemon=True).start()
sys.argv[0] = "mesoslip"
main()
"""


def start(path: Path, output: Path, *more: str, interrupt_at: Path | None = None):
    program = ["-m", "mesoslip"]
    if interrupt_at is not None:
        program = ["-c", INTERRUPTED, str(interrupt_at)]
    command = [sys.executable, *program, "run", str(path), "-o", str(output), *more]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


def wait_for(condition, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def read_whole(path: Path) -> xr.DataTree:
    with xr.open_datatree(path) as tree:
        return tree.load()


def inode(path):
    """Number of a file; 0 without one. The program may rename it at any time."""
    try:
        return path.stat().st_ino
    except FileNotFoundError:
        return 0


@pytest.mark.parametrize("long_run", ["contacts", long("thermal populations")], indirect=True)
def test_killed_runs_go_on(long_run, tmp_path):
    """SIGKILL and SIGTERM at moments of all kinds; tests/resume/kill_runs.py does it for hours."""
    expected, output = mesoslip.run(long_run), tmp_path / "killed.nc"
    folder = checkpoint_folder(output)
    random = np.random.default_rng(1)
    kills = 0
    # It may even be killed between the last renaming and the removal of its checkpoint.
    while not output.exists() or folder.exists():
        process = start(long_run, output, "--resume", "--checkpoint-interval", "0.05")
        state = folder / "state.npz"
        seen = inode(state)
        wait_for(
            lambda process=process, state=state, seen=seen: (
                process.poll() is not None or inode(state) not in {0, seen}
            )
        )
        time.sleep(float(random.uniform(0, 0.06)))
        if process.poll() is None and kills < 2:
            process.send_signal(signal.SIGTERM if kills == 1 else signal.SIGKILL)
            kills += 1
        _, printed = process.communicate()
        assert process.returncode in {0, -signal.SIGKILL, 128 + signal.SIGTERM}, printed
    assert kills == 2
    assert not folder.exists()
    assert_same(expected, read_whole(output))


@pytest.mark.parametrize("long_run", ["fewer contacts"], indirect=True)
def test_ctrl_c_reports_how_to_go_on(long_run, tmp_path, command):
    """A partial file to look at, a checkpoint to go on from, exit status 130; twice is no harm."""
    output = tmp_path / "stopped.nc"
    state = checkpoint_folder(output) / "state.npz"
    process = start(long_run, output, "--checkpoint-interval", "0.05", interrupt_at=state)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in printed
    assert "--resume" in printed
    assert not output.exists()
    partial = read_whole(tmp_path / "stopped.partial.nc")
    assert partial.attrs["complete"] == "false"
    mesoslip.plot(partial)
    again = start(long_run, output)
    assert again.stderr is not None
    assert "--resume" in again.stderr.readline()
    again.kill()
    again.communicate()
    printed = command.messages("run", long_run, "-o", output, "--resume")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["long.toml", "stopped.nc"]
