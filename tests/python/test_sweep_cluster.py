"""Sweeps and runs on a Dask cluster: a real scheduler and workers, as processes of their own."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, wait_until
from invariants import differences
from mesoslip import Config, FileError, RunError
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.execution.stop import Stop
from mesoslip.execution.store import Store
from mesoslip.output.tree import build_tree
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.run_realizations import run_realizations
from test_sweep import assert_same_numbers, tables

pytest.importorskip("distributed")

PROGRAM = Path(sys.executable).with_name("dask")
ENVIRONMENT = {
    **os.environ,
    "OPENBLAS_NUM_THREADS": "1",
    # A point may cost two workers.
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
    "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "10s",
}


class Cluster:
    """A scheduler and its workers, as processes."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", self.file
        )
        self.workers = [self.add_worker() for _ in range(workers)]
        wait_until(lambda: self.file.exists())
        self.address = json.loads(self.file.read_text())["address"]

    def _start(self, *arguments: object) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [PROGRAM, *map(str, arguments), "--no-dashboard"],
            env=ENVIRONMENT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def add_worker(self) -> subprocess.Popen[bytes]:
        # Two threads of a process, which must not disturb each other.
        return self._start(
            *("worker", "--scheduler-file", self.file, "--nthreads", 2, "--no-nanny"),
            *("--local-directory", self.folder),
        )

    def close(self) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    made = []

    def make(workers: int = 2) -> Cluster:
        made.append(Cluster(tmp_path, workers))
        return made[-1]

    yield make
    for one in made:
        one.close()


OWN = """
import os, signal, time

def slow(tree):
    time.sleep(0.1)
    return 1.0

def deadly(tree):
    if tree["realization"].values[0] == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return 1.0
"""


def own_tables(folder, function, realizations):
    (folder / "own.py").write_text(OWN)
    measures = ["mean_force", f"{folder}/own.py:{function}"]
    return tables(measures=measures, realizations=realizations)


def test_a_cluster_gives_the_same(cluster, tmp_path):
    """With outputs of points, whose files only one thread of a process may write."""
    started = cluster(1)
    plan = Plan.from_dict(tables(realizations=3, traces=True))
    expected = mesoslip.sweep(tables(realizations=3), executor=mesoslip.Threads())
    store = tmp_path / "points"
    data = mesoslip.sweep(plan, store=store, executor=mesoslip.Dask(started.address))
    assert_same_numbers(expected, data)
    assert len(list(store.glob("*.nc"))) == 18
    # Realizations of a run too; the time that they take is their own.
    config = Config.from_dict(klein_tables(contacts__count=50, run__realizations=4))
    here = mesoslip.run(config)
    there = mesoslip.run(config, executor=mesoslip.Dask(started.file))
    assert differences(here, there) == []


@pytest.mark.long
def test_lost_workers_and_a_lost_scheduler(cluster, tmp_path):
    """Workers that are killed lose nothing; without a scheduler the sweep ends, and goes on."""
    started = cluster(2)
    wanted = own_tables(tmp_path, "slow", 30)
    store = tmp_path / "points"
    done = []

    def progress(part):
        done.append(part)
        if len(done) == 20:
            started.workers[0].send_signal(signal.SIGKILL)
            started.workers.append(started.add_worker())
        if len(done) == 60:
            started.scheduler.send_signal(signal.SIGKILL)

    with pytest.raises(RunError, match="scheduler of the cluster is lost"):
        mesoslip.sweep(
            wanted, store=store, executor=mesoslip.Dask(started.address), progress=progress
        )
    with Store(store, "points") as opened:
        kept = len(opened.names())
    assert 55 <= kept < 180
    plan = Plan.from_dict(own_tables(tmp_path, "slow", 30))
    counted = []
    data = mesoslip.sweep(plan, store=store, executor=8, progress=counted.append)
    assert counted[0] == pytest.approx(kept / 180)
    assert not data["status"].any()


@pytest.mark.long
def test_a_point_that_costs_workers_fails_alone(cluster, tmp_path):
    started = cluster(3)
    wanted = own_tables(tmp_path, "deadly", 2)
    wanted["sweep"]["grid"] = {"contacts.delay": ["0.1 ms"]}
    data = mesoslip.sweep(wanted, executor=mesoslip.Dask(started.address))
    np.testing.assert_array_equal(data["status"], [[0, 1]])
    assert "KilledWorker" in data.attrs["failures"]


def test_no_scheduler_and_no_package(monkeypatch):
    for address in ("nonsense", "tcp://127.0.0.1:1", "there/is/none.json"):
        monkeypatch.setattr("mesoslip.execution.cluster.ANSWER_SECONDS", 0.5)
        with pytest.raises(FileError, match="there is no Dask scheduler"):
            mesoslip.sweep(tables(), executor=mesoslip.Dask(address))
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(FileError, match="pip install 'mesoslip\\[distributed\\]'"):
        mesoslip.sweep(tables(), executor=mesoslip.Dask("tcp://127.0.0.1:1"))


def test_a_checkpoint_keeps_realizations_that_are_complete(tmp_path):
    """On other executors than threads; those that are under way go on on threads only."""
    config = Config.from_dict(klein_tables(contacts__count=50, run__realizations=4))
    expected = mesoslip.run(config)
    stop = Stop()

    def stop_at_half(part):
        if part >= 0.5:
            stop.set()

    with Checkpoint(tmp_path / "done", config) as checkpoint:
        part = run_realizations(
            config,
            executor=mesoslip.Processes(1),
            checkpoint=checkpoint,
            progress=stop_at_half,
            stop=stop,
        )
    assert [one.finished for one in part.realizations] == [True, True, False, False]
    assert not part.complete
    with Checkpoint(tmp_path / "done", config, resume=True) as checkpoint:
        whole = run_realizations(config, checkpoint=checkpoint)
        assert (
            sum(
                one.kernel_seconds == part.realizations[0].kernel_seconds
                for one in whole.realizations
            )
            == 1
        )
        tree = build_tree(whole)
    assert differences(expected, tree) == []

    stop = Stop()

    def stop_early(part):
        if part > 0:
            stop.set()

    long = config.replace("run.duration=1000")
    with Checkpoint(tmp_path / "begun", long) as checkpoint:
        run_realizations(long, checkpoint=checkpoint, stop=stop, progress=stop_early)
    with (
        Checkpoint(tmp_path / "begun", long, resume=True) as checkpoint,
        pytest.raises(FileError, match="under way"),
    ):
        run_realizations(long, executor=mesoslip.Processes(1), checkpoint=checkpoint)
