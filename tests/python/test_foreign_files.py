"""Outputs of others: nothing outside of them is read; and reading on many threads."""

import os
import shutil
import struct
import sys

import h5py
import mesoslip
import netCDF4
import numpy as np
import pytest
from conftest import ROOT, run_program

OLD = ROOT / "tests" / "reference" / "eq-rigid-scaled.nc"


@pytest.fixture
def output(tmp_path):
    path = tmp_path / "out.nc"
    shutil.copy(OLD, path)
    return path


def external_storage(file, folder):
    (folder / "secret").write_bytes(np.arange(4.0).tobytes())
    file.create_dataset("secret", (4,), float, external=[(folder / "secret", 0, 32)])


def virtual_data(file, folder):
    with h5py.File(folder / "secret.h5", "w") as other:
        other["numbers"] = np.arange(4.0)
    layout = h5py.VirtualLayout((4,), float)
    layout[:] = h5py.VirtualSource(folder / "secret.h5", "numbers", (4,))
    file.create_virtual_dataset("secret", layout)


def external_link(file, folder):
    with h5py.File(folder / "secret.h5", "w") as other:
        other["numbers"] = np.arange(4.0)
    file["slips"]["secret"] = h5py.ExternalLink(folder / "secret.h5", "numbers")


def link_to_a_pipe(file, folder):
    os.mkfifo(folder / "pipe")
    file["secret"] = h5py.ExternalLink(folder / "pipe", "numbers")


def soft_link(file, _):
    file["secret"] = h5py.SoftLink("/slips/force_drop")


def cycle(file, _):
    for name in ("a", "b", "c", "d"):
        file["slips"][name] = file["/"]


def two_names(file, _):
    file["secret"] = file["slips"]["force_drop"]


FOREIGN = (
    *(external_storage, virtual_data, external_link, link_to_a_pipe),
    *(soft_link, cycle, two_names),
)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("attack", FOREIGN, ids=lambda one: one.__name__)
def test_an_output_refers_to_nothing_outside_of_it(output, tmp_path, attack, command):
    with h5py.File(output, "r+") as file:
        attack(file, tmp_path)
    with pytest.raises(mesoslip.FileError, match=r"secret|slips/"):
        mesoslip.open_output(output)
    for arguments in (["slips", output], ["run", output, "-o", tmp_path / "again.nc"]):
        printed = command.refusal(*arguments)
        assert "damaged" not in printed
        assert printed.count("\n") == 1


def _damage_heap(path, values):
    """Write an object's number, uses and size over those of the free space of the heap."""
    data = path.read_bytes()
    start = data.index(b"GCOL")
    at = start + 16
    while data[at : at + 2] != bytes(2):
        at += 16 + -(-int.from_bytes(data[at + 8 : at + 16], "little") // 8) * 8
    assert at + int.from_bytes(data[at + 8 : at + 16], "little") == start + 4096
    path.write_bytes(data[:at] + struct.pack("<HHIQ", *values) + data[at + 16 :])


# Of nothing; of a size that the library counts as nothing; and of less than its header.
@pytest.mark.parametrize(
    "values",
    [
        (0, 0, 0, 0),
        pytest.param((9, 1, 0, 2**64 - 16), marks=pytest.mark.long),
        pytest.param((0, 0, 0, 8), marks=pytest.mark.long),
    ],
)
def test_a_damaged_heap_is_not_read_without_end(output, values, tmp_path):
    """The library would not return, nor answer Ctrl-C: hence programs of their own.

    That of the measurement is in the midst of 32 MiB.
    """
    table = tmp_path / "measured.h5"
    with h5py.File(table, "w") as file:
        for name, unit in (("time", "s"), ("force", "N")):
            file[name] = np.arange(2.0**21)
            file[name].attrs["units"] = unit
    commands = (["slips", output], ["trace", table, "-o", tmp_path / "new.nc"])
    for arguments, words in zip(commands, ("netCDF-4 file", "file of HDF5"), strict=True):
        _damage_heap(arguments[1], values)
        line = (sys.executable, "-m", "mesoslip", *arguments)
        status, _, errors = run_program(*line, timeout=60)
        assert status == 2
        assert f"{arguments[1]}: a damaged {words}" in errors


@pytest.mark.parametrize("block", [64, 700, 5000, 2**23])
def test_sound_heaps_are_read_wherever_they_are(block, output, monkeypatch):
    """Also those of which a block has a part; the library is not asked."""
    monkeypatch.setattr("mesoslip.output.hdf5.BLOCK_BYTES", block)
    monkeypatch.delattr("mesoslip.output.hdf5._can_be_read")
    mesoslip.open_output(output)


def test_a_heap_that_is_not_used_may_be_damaged(output):
    """As where the place of an old one was taken by other data."""
    with h5py.File(output, "r+") as file:
        old = b"GCOL\1\0\0\0" + (4096).to_bytes(8, "little") + bytes(range(240)) * 17
        file["slips"]["force_drop"].attrs["old"] = np.frombuffer(old, "u1")
    data = output.read_bytes()
    assert data.count(b"GCOL") == 2
    assert mesoslip.open_output(output)["slips"].sizes["slip"] > 0


def test_a_configuration_of_an_output_reads_no_file(output, tmp_path, command):
    secret = tmp_path / "secret.csv"
    secret.write_text("password\n12345\n")
    history = f"[drive.history]\nfile = '{secret}'\n"
    for name in ("configuration", "base_configuration"):
        shutil.copy(OLD, output)
        with netCDF4.Dataset(output, "r+") as file:
            text = mesoslip.Config.load(ROOT / "runs" / "klein.toml").to_toml()
            file.setncattr(name, text.replace("[drive]\n", f"{history}[drive]\n", 1))
        status, shown, printed = command("run", output, "-o", tmp_path / "again.nc")
        assert status == 2
        assert "drive.history.file" in printed
        assert "an output must not name a file" in printed
        assert "password" not in shown + printed
    # Who repeats a run may give a file.
    table = tmp_path / "history.csv"
    table.write_text("time [s],displacement [um]\n0,0\n20,2\n")
    text = mesoslip.Config.load(ROOT / "runs" / "klein.toml").to_toml()
    again = mesoslip.Config.from_toml(
        text, overrides=["drive.velocity=none", f"drive.history.file={table}"]
    )
    assert again.drive.history is not None


def _first_becomes_last(values):
    values[0] = values[-1]


def _one_twice(values):
    values[1] = values[0]


def _of_none(values):
    values[-1] = 1


def _before_the_first(values):
    values[0] = -1


def _unknown(values):
    values[-1] = np.nan


WRONG_ROWS = (
    ("slips/realization_index", _of_none),
    ("slips/realization_index", _before_the_first),
    ("stages/realization_index", _of_none),
    ("slip_traces/realization_index", _of_none),
    ("slip_traces/sample_time", _first_becomes_last),
    ("slips/start_time", _unknown),
    ("slips/end_time", lambda values: values.fill(0.0)),
    ("time", _first_becomes_last),
    ("time", _one_twice),
    ("time", _unknown),
)
READERS = {
    **{name: getattr(mesoslip, name) for name in ("open_output", "slips", "regime", "response")},
    "plot": mesoslip.plot,
    "report": lambda path: mesoslip.report(path, path.with_suffix(".html")),
    "export": lambda path: mesoslip.export(path, path.with_suffix(".xml")),
    "fit": lambda path: mesoslip.fit(path, ROOT / "runs" / "klein.toml"),
}


@pytest.mark.parametrize("rows", [3, 2**20])
@pytest.mark.parametrize(("where", "damage"), WRONG_ROWS)
def test_rows_and_times_that_cannot_be_right_are_refused(output, where, damage, rows, monkeypatch):
    monkeypatch.setattr("mesoslip.output.validity.MAX_ROWS", rows)
    with h5py.File(output, "r+") as file:
        values = file[where][...]
        damage(values)
        file[where][...] = values
    name = where.rpartition("/")[2]
    for reader in ("open_output", "plot"):
        with pytest.raises(mesoslip.FileError, match=f"damaged output.*{name}.* row "):
            READERS[reader](output)


@pytest.mark.parametrize("reader", READERS)
def test_no_reader_takes_rows_of_unknown_realizations(output, reader):
    with netCDF4.Dataset(output, "r+") as file:
        file["slips/realization_index"][-1] = 7
    with pytest.raises(mesoslip.FileError, match="realization_index is 7 in row"):
        READERS[reader](output)


def test_outputs_in_memory_are_checked_as_files_are(output):
    tree = mesoslip.open_output(output)
    parts = {
        "realization_index is 0 in row": tree.isel(realization=slice(0)),
        "dimension realization, of rows in slips, is missing": tree.isel(realization=0),
        "time is": tree.isel(time=slice(None, None, -1)),
    }
    for message, part in parts.items():
        for reader in ("slips", "regime", "plot"):
            with pytest.raises(mesoslip.FileError, match=message):
                READERS[reader](part)


THREADS = """
import sys, threading
import mesoslip
from mesoslip.output.files import opened, read
path, errors = sys.argv[1], []
def work(number):
    try:
        for turn in range(12):
            if number % 2:
                mesoslip.slips(path)
            else:
                with opened(path) as tree:
                    tree["spring_force"].values
                    tree["slips"]["force_drop"].values
    except Exception as error:
        errors.append(error)
threads = [threading.Thread(target=work, args=(one,)) for one in range(8)]
[one.start() for one in threads]
[one.join() for one in threads]
print(errors)
"""


@pytest.mark.long
def test_outputs_are_read_on_many_threads(output):
    done = run_program(sys.executable, "-c", THREADS, output, timeout=120)
    assert done == (0, "[]\n", "")
