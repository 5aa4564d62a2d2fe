"""Sweeps that are killed, stopped, or meet a disk that fails: nothing is lost."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import long, wait_until
from kill_sweep import Study, is_alive, points_of, workers_of
from test_sweep import SIMPLE, sweep_file, tables

__all__ = ["sweep_file"]


def test_kills_lose_nothing_and_repeat_nothing(tmp_path):
    """A short version of tests/resume/kill_sweep.py."""
    study = Study(tmp_path, 2, np.random.default_rng(3))
    whole = study.expected()
    # A sweep may be over before it is killed twice.
    for attempt in range(5):
        if (kills := study.sweep_kills + study.worker_kills) < 2:
            study.attack(f"killed{attempt}", whole, 2 - kills)
    assert study.wrong == []
    assert study.sweep_kills + study.worker_kills == 2


# States by a file that a point is computed, which then does not end.
ENDLESS = """
import os, pathlib, time
def slow(tree):
    pathlib.Path(__file__).with_name(f"{os.getpid()}.begun").touch()
    time.sleep(100)
"""


def test_workers_end_with_their_sweep_in_the_midst_of_a_point(tmp_path, sweep_file):
    (tmp_path / "own.py").write_text(ENDLESS)
    path = sweep_file(SIMPLE.replace("mean_force", "own.py:slow"))
    process = begin(path, tmp_path / "sweep.nc", "--pool", "processes", "--workers", "2")
    wait_until(lambda: len(list(tmp_path.glob("*.begun"))) >= 2)
    children = workers_of(process.pid)
    assert {f"{one}.begun" for one in children} == {one.name for one in tmp_path.glob("*.begun")}
    process.kill()
    process.wait()
    wait_until(lambda: not any(map(is_alive, children)), 10)
    # Workers have it too, and it would be waited for them.
    process.communicate()


def begin(path: Path, output: Path, *more: str) -> subprocess.Popen[str]:
    """Start the command as a group of processes of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "mesoslip", "sweep", str(path), "-o", str(output), *more],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


SLOW = """
    [sweep]
    realizations = 20
    measures = ["mean_force", "own.py:slow"]
    [sweep.grid]
    "contacts.delay" = ["0.1 ms", "0.5 ms"]
"""
# While a file is there, points beyond the first take so long that no signal comes too late.
OWN = """
import pathlib, time
def slow(tree):
    is_slow = pathlib.Path(__file__).with_name("slow").exists()
    time.sleep(0.5 if is_slow and tree["realization"].values[0] > 3 else 0.01)
    return 1
"""


@pytest.mark.parametrize("pool", [long("threads"), "processes"])
def test_ctrl_c_keeps_what_is_done(pool, tmp_path, sweep_file, command):
    """It ends at once, with all its workers, and what there is can be looked at."""
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "slow").touch()
    output = tmp_path / "out" / "sweep.nc"
    process = begin(sweep_file(SLOW), output, "--pool", pool, "--workers", "2")
    wait_until(lambda: len(points_of(output)) >= 4)
    children = workers_of(process.pid)
    # As a terminal does it: to all of them.
    os.killpg(process.pid, signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in printed
    assert "the same command computes them" in printed
    assert not any(map(is_alive, children))
    kept = len(points_of(output))
    partial = xr.load_dataset(tmp_path / "out" / "sweep.partial.nc")
    assert np.sum(partial["status"].values == 0) == kept
    assert np.sum(partial["status"].values == 2) == 40 - kept
    assert not output.exists()
    (tmp_path / "slow").unlink()
    _, _, printed = command(
        "sweep", sweep_file(SLOW), "-o", output, "--pool", "threads", "--workers", "2"
    )
    assert f"{40 - kept} points computed, {kept} read from the store" in printed
    assert not (tmp_path / "out" / "sweep.partial.nc").exists()


def test_a_point_that_ends_its_workers_fails_alone(tmp_path, sweep_file, command):
    own = (
        "import os\ndef deadly(tree):\n"
        "    if tree['realization'].values[0] == 1:\n        os.kill(os.getpid(), 9)\n"
        "    return 1\n"
    )
    (tmp_path / "own.py").write_text(own)
    output = tmp_path / "sweep.nc"
    text = SIMPLE.replace("mean_force", "own.py:deadly").replace('"0.1 ms", ', "")
    path = sweep_file(text)
    status, _, printed = command(
        "sweep", path, "-o", output, "--pool", "processes", "--workers", "1"
    )
    assert status == 1
    assert printed.count("3 workers died; the last one was ended by signal 9") == 1
    np.testing.assert_array_equal(xr.load_dataset(output)["status"], [[0, 1]])


def test_workers_that_cannot_start_end_the_sweep(tmp_path, sweep_file, monkeypatch, command):
    monkeypatch.setattr("mesoslip.execution.local.PROCESS", "raise SystemExit(7)")
    arguments = ("-o", tmp_path / "sweep.nc", "--pool", "processes", "--workers", "1")
    status, _, printed = command("sweep", sweep_file(SIMPLE), *arguments)
    assert status == 1
    assert "ended with status 7" in printed


@pytest.fixture
def small_disk(tmp_path):
    """A folder on a disk that takes some points, and no more."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=160k", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("no disk can be mounted here")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def test_a_full_disk_keeps_earlier_points(small_disk, sweep_file, command):
    """One message; with room again, the sweep goes on from what is there."""
    output = small_disk / "sweep.nc"
    path = sweep_file(SIMPLE.replace("realizations = 2", "realizations = 50"))
    status, _, printed = command("sweep", path, "-o", output, "--pool", "threads", "--quiet")
    assert status == 1
    assert printed.count("\n") == 1
    assert "no space left on the disk" in printed
    kept = points_of(output)
    assert 5 < len(kept) < 60
    assert f"{len(kept)} points are stored: the same command continues" in printed
    assert not output.exists()
    assert not list(small_disk.rglob(".*"))
    remount = ["mount", "-o", "remount,size=4m", str(small_disk)]
    subprocess.run(remount, check=True)
    printed = command.messages("sweep", path, "-o", output, "--pool", "threads")
    assert f"{100 - len(kept)} points computed, {len(kept)} read from the store" in printed


def test_a_folder_that_vanishes_keeps_no_result_from_the_dataset(tmp_path):
    store = tmp_path / "points"

    def away(_):
        shutil.rmtree(store, ignore_errors=True)

    data = mesoslip.sweep(tables(), store=store, executor=mesoslip.Threads(), progress=away)
    assert not data["status"].any()
    assert np.isfinite(data["mean_force"]).all()


def earlier_output(path):
    """Write an output; its content."""
    xr.Dataset(attrs={"configuration": "", "program_version": "1"}).to_netcdf(path)
    return path.read_bytes()


def test_a_folder_that_is_none_is_reported(tmp_path, sweep_file, command):
    output = tmp_path / "sweep.nc"
    earlier = earlier_output(output)
    output.with_name("sweep.points").write_text("a file")
    printed = command.refusal("sweep", sweep_file(SIMPLE), "-o", output)
    assert "sweep.points: was not made by this program" in printed
    assert output.read_bytes() == earlier
    printed = command.refusal("sweep", sweep_file(SIMPLE), "-o", output / "in" / "sweep.nc")
    assert "cannot be written: Not a directory" in printed


def test_an_earlier_output_outlives_a_sweep_that_is_stopped(tmp_path, sweep_file):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "slow").touch()
    output = tmp_path / "sweep.nc"
    earlier = earlier_output(output)
    process = begin(sweep_file(SLOW), output, "--pool", "threads", "--workers", "2")
    wait_until(lambda: points_of(output))
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 143
    assert output.read_bytes() == earlier
