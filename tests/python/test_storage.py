"""Outputs that are locked, of a newer version, or where the file system has no locks."""

import errno
import fcntl
import shutil

import mesoslip
import netCDF4
import pytest
from conftest import ROOT
from mesoslip import FileError
from mesoslip.output import files, targets

OLD = ROOT / "tests" / "reference" / "eq-rigid-scaled.nc"


@pytest.fixture
def output(tmp_path):
    path = tmp_path / "out.nc"
    shutil.copy(OLD, path)
    return path


def test_a_locked_output_is_not_called_damaged(output, command):
    with output.open("rb+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        printed = command.refusal("slips", output)
        assert "is locked by a program that writes to it" in printed
    assert mesoslip.open_output(output)["time"].size


def test_a_file_system_without_locks_is_reported(output, monkeypatch):
    """As the library states it: an error of HDF5, whatever it is."""

    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    def fail(*_, **__):
        raise OSError(-101, "NetCDF: HDF error")

    monkeypatch.setattr(fcntl, "flock", refuse)
    monkeypatch.setattr(files, "_built", fail)
    with pytest.raises(FileError, match=r"no locks \(No locks available\).*LOCKING=FALSE"):
        mesoslip.open_output(output)
    before = output.read_bytes()
    with (
        pytest.raises(FileError, match=r"no locks \(No locks available\).*LOCKING=FALSE"),
        targets.written_whole(output, is_output=True),
    ):
        fail()
    assert output.read_bytes() == before
    assert list(output.parent.iterdir()) == [output]


@pytest.mark.parametrize(("version", "printed"), [("99.0", "is of mesoslip 99.0, which is newer")])
def test_a_newer_output_that_cannot_be_read_is_reported(version, printed, output):
    with netCDF4.Dataset(output, "a") as file:
        file.program_version = version
    # What is understood is read.
    assert mesoslip.open_output(output)["time"].size
    with netCDF4.Dataset(output, "a") as file:
        file.renameVariable("velocity", "speed")
    with pytest.raises(FileError, match=printed):
        mesoslip.open_output(output)
    with netCDF4.Dataset(output, "a") as file:
        file.program_version = "0.0.1"
    with pytest.raises(FileError, match="damaged"):
        mesoslip.open_output(output)
