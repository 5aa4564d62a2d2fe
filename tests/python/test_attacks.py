"""Damaged files, odd streams, outputs in the place of inputs: one message, nothing destroyed."""

import functools
import os
import pydoc
import re
import subprocess
import sys
import warnings
from pathlib import Path

import mesoslip
import netCDF4
import numpy as np
import pytest
import tomli_w
from apart import result_of
from conftest import ROOT, klein_tables, long, python
from mesoslip.output import targets

OLD = ROOT / "tests" / "reference" / "old.nc"


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    tables = klein_tables(contacts__count=50, run__duration=0.2)
    path.write_text(tomli_w.dumps(tables))
    return path


def test_functions_are_seen():
    """By dir, completion and help, though they are imported late; docstrings name what exists."""
    code = "import mesoslip, sys; assert 'numpy' not in sys.modules; print(dir(mesoslip))"
    printed = python(code)
    for name in ("run", "slips", "avalanche_summary", "Config", "plot"):
        assert f"'{name}'" in printed
        assert name in dir(mesoslip)
    assert "Simulate a configuration." in pydoc.render_doc(mesoslip.run)
    package = Path(mesoslip.__file__).parent
    named = {
        name
        for path in package.rglob("*.py")
        for name in re.findall(r"`(mesoslip\.[\w.]+)`", path.read_text())
    }
    assert named
    for name in named:
        assert pydoc.locate(name) is not None, name


def test_history_is_what_was_typed(short, tmp_path, command):
    output = tmp_path / "out with space.nc"
    assert command("run", short, "-o", output, "--set", "contacts.delay=1 ms")[0] == 0
    history = mesoslip.open_output(output).attrs["history"]
    assert f"mesoslip run {short} -o '{output}' --set 'contacts.delay=1 ms'" in history
    assert "in Python" in mesoslip.run(short).attrs["history"]


def test_statistics_are_in_the_units_of_the_table(command):
    printed = command("slips", OLD)[1]
    assert "SI" not in printed
    catalogue = mesoslip.slips(OLD)
    head, rows = "mean  standard deviation", printed.splitlines()
    start = next(number for number, line in enumerate(rows) if line.strip().startswith(head))
    row = next(line for line in rows[start:] if line.strip().startswith("force drop (µN)"))
    mean = float(row.split("(µN)")[1].split()[0])
    assert mean == pytest.approx(1e6 * catalogue["force_drop"].values.mean(), rel=1e-4)


def test_a_configuration_is_no_output(short, command):
    printed = command.refusal("slips", short)
    assert "is a configuration, not an output" in printed
    assert f"mesoslip run {short}" in printed


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "short.toml", "-o", "short.toml"),
        ("run", "short.toml", "-o", "other.toml"),
        ("curve", "short.toml", "-o", "short.toml"),
        ("onset", "short.toml", "-o", "link.nc"),
        ("run", "in.nc", "-o", "in.nc"),
        ("slips", "in.nc", "--csv", "in.nc"),
        ("avalanches", "in.nc", "--csv", "./in.nc"),
        ("plot", "in.nc", "-o", "in.nc"),
        ("run", "short.toml", "-o", "fifo"),
        ("slips", "in.nc", "--csv", "/dev/full"),
        ("plot", "in.nc", "-o", "/dev/null"),
        ("plot", "."),
        ("plot", "in.nc", "-o", "."),
        ("slips", "fifo"),
        ("plot", "/dev/zero"),
        ("run", "short.toml", "-o", "loop/out.nc"),
        ("run", "short.toml", "-o", "/proc/nowhere/out.nc"),
        ("run", "short.toml", "-o", "/proc/out.nc"),
        ("plot", "in.nc", "-o", "picture"),
        ("plot", "in.nc", "-o", "picture.tex"),
    ],
)
def test_inputs_and_devices_are_not_overwritten(arguments, short, tmp_path, command, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.toml").write_text("title = 'mine'\n")
    (tmp_path / "in.nc").write_bytes(OLD.read_bytes())
    (tmp_path / "link.nc").symlink_to(short)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "fifo")
    before = {path: path.lstat().st_mode for path in tmp_path.rglob("*")}
    held = {path: path.read_bytes() for path in tmp_path.glob("*.[nt]*")}
    printed = command.refusal(*arguments)
    assert printed.startswith("mesoslip: ")
    assert ("ends in one of" in printed) == ("picture" in arguments[-1])
    assert {path: path.lstat().st_mode for path in tmp_path.rglob("*")} == before
    assert {path: path.read_bytes() for path in held} == held
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("name", ["other", "other.nc", "new.nc"])
@pytest.mark.parametrize("arguments", [("slips", "in.nc", "--csv"), ("report", "in.nc", "-o")])
def test_no_table_or_page_takes_the_place_of_an_output(
    arguments, name, tmp_path, command, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for one in ("in.nc", "other", "other.nc"):
        Path(one).write_bytes(OLD.read_bytes())
    printed = command.refusal(*arguments, name)
    assert "is an output of mesoslip" in printed or "is the name of an output" in printed
    assert {one.read_bytes() for one in tmp_path.iterdir()} == {OLD.read_bytes()}


def test_links_of_outputs_are_followed(short, tmp_path, command):
    """Also to an earlier output, which is replaced; to no other file, not even to a new one that
    another program may execute."""
    link, real = tmp_path / "out.nc", tmp_path / "store" / "real.nc"
    real.parent.mkdir()
    link.symlink_to(real)
    for seed in (1, 2):
        assert command("run", short, "-o", link, "--set", f"run.seed={seed}")[0] == 0
        assert link.is_symlink()
        assert mesoslip.open_output(real).attrs["seed"] == seed


@pytest.mark.parametrize(
    ("arguments", "name", "target"),
    [
        (("run", "short.toml", "-o"), "l.nc", "precious"),
        (("run", "short.toml", "-o"), "l", "precious"),
        (("run", "short.toml", "-o"), "precious.nc", ""),
        (("curve", "short.toml", "-o"), "l.nc", "precious.nc"),
        (("slips", "in.nc", "--csv"), "l.csv", "precious.csv"),
        (("slips", "in.nc", "--table"), "l.tex", "precious.tex"),
        (("plot", "in.nc", "-o"), "l.png", "precious.png"),
        (("report", "in.nc", "-o"), "l.html", "precious.html"),
        (("report", "in.nc", "-o"), "l.html", ".profile"),
        (("run", "short.toml", "-o"), "l.nc", ".profile"),
        (("run", "short.toml", "-o"), "l", ".profile"),
    ],
)
@pytest.mark.usefixtures("short")
def test_files_of_others_are_not_replaced(arguments, name, target, tmp_path, command, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("in.nc").write_bytes(OLD.read_bytes())
    if target:
        Path(name).symlink_to(target)
    is_there = target != ".profile"
    if is_there:
        Path(name).write_text("precious")
    printed = command.refusal(*arguments, name)
    assert printed.count("\n") == 1
    assert ("is a link to" if target else "is not an output of mesoslip") in printed
    assert (Path(name).read_text() if is_there else "precious") == "precious"
    assert Path(target or name).exists() == is_there


def test_a_full_disk_keeps_the_table_that_was_there(tmp_path, monkeypatch):
    """Half a table does not appear, and the old one stays."""
    table = tmp_path / "slips.csv"
    table.write_text("old")

    def fill():
        with targets.written_whole(table) as part:
            part.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(mesoslip.MesoslipError, match="no space") as printed:
        fill()
    assert printed.value.exit_status == 1
    # netCDF says other things of a full disk.
    monkeypatch.setattr(targets.shutil, "disk_usage", lambda _: Free())
    with pytest.raises(mesoslip.MesoslipError, match="no space"), targets.written_whole(table):
        raise PermissionError(13, "Permission denied")
    assert table.read_text() == "old"
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize("moment", ["mkdir", "clear"])
def test_an_interrupt_leaves_no_folder_behind(moment, tmp_path, monkeypatch):
    """While a folder is made, and while it is cleared, which take long on a slow disk."""
    place = targets.os if moment == "mkdir" else targets.PrivateFolder
    own = getattr(place, moment)

    def interrupted(*arguments, **options):
        if moment == "mkdir":
            own(*arguments, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(place, moment, interrupted)
    with pytest.raises(KeyboardInterrupt), targets.written_whole(tmp_path / "a.csv") as part:
        part.write_text("half")
    assert list(tmp_path.iterdir()) == ([] if moment == "mkdir" else [tmp_path / "a.csv"])


class Free:
    free, total = 0, 4096


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device here")
def test_a_stream_that_takes_nothing():
    with Path("/dev/full").open("w") as full:
        line = [sys.executable, "-m", "mesoslip", "info", str(ROOT / "runs" / "klein.toml")]
        result = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, check=False)
    assert result.returncode == 1
    assert result.stderr.decode() == (
        "mesoslip: the output cannot be written: No space left on device\n"
    )


@pytest.mark.parametrize("closed", [*map(long, ["0<&-", "1>&-", "2>&-"]), "0<&- 1>&- 2>&-"])
def test_closed_streams(closed, short, tmp_path):
    output = tmp_path / "out.nc"
    line = f"{sys.executable} -m mesoslip run {short} -o {output} {closed}"
    assert subprocess.run(["sh", "-c", line], check=False).returncode == 0
    assert mesoslip.open_output(output)["time"].size


def test_names_that_are_not_utf_8(short, tmp_path, command):
    strange = os.fsdecode(bytes(tmp_path) + b"/\xff.toml")
    Path(strange).write_bytes(short.read_bytes())
    assert command("run", strange, "-o", tmp_path / "out.nc")[0] == 0
    # Before the run, whose results could not be written.
    output = Path(strange).with_suffix(".nc")
    reason = "the name of an output must be UTF-8 for netCDF\n"
    printed = command.refusal("run", strange, "-o", output)
    assert printed.endswith(f": {reason}")
    assert printed.count("\n") == 1
    assert not list(tmp_path.glob("*.checkpoint"))
    (tmp_path / "out.nc").rename(output)
    printed = command.refusal("slips", output)
    assert printed.endswith(f": {reason}")
    assert command("slips", strange)[0] == 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda file: file.setncattr("configuration", 7),
        lambda file: file.renameGroup("slips", "slops"),
        lambda file: file["slips"].renameVariable("force_drop", "force_dropped"),
        lambda file: file.renameVariable("time", "tome"),
        lambda file: file["slip_traces"].renameVariable("velocity", "v"),
        lambda file: file.renameVariable("velocity", "v"),
    ],
)
def test_a_file_that_lacks_what_is_needed(damage, tmp_path):
    path = tmp_path / "in.nc"
    path.write_bytes(OLD.read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        damage(file)
    for use in (mesoslip.slips, mesoslip.plot, mesoslip.avalanches):
        with pytest.raises(mesoslip.FileError, match=r"in\.nc"):
            use(path)


def use_damaged(path: Path, seed: int, count: int) -> int:
    """Use files with a flipped bit each; the number of errors."""
    warnings.simplefilter("ignore")
    data, generator, errors = OLD.read_bytes(), np.random.default_rng(seed), 0
    for _ in range(count):
        flipped = bytearray(data)
        flipped[generator.integers(len(data))] ^= 1 << generator.integers(8)
        path.write_bytes(flipped)
        for use in (mesoslip.open_output, mesoslip.slips, mesoslip.plot, mesoslip.derived):
            try:
                use(path)
            except mesoslip.MesoslipError:
                errors += 1
    return errors


@pytest.mark.parametrize("count", [4, long(200)])
def test_flipped_bits(count, tmp_path):
    """Each use of a damaged file gives numbers or one message, and no library crashes."""
    use = functools.partial(use_damaged, tmp_path / "in.nc", 5, count)
    is_over, errors = result_of(use, 250.0, tmp_path / "log")
    assert is_over, errors
    assert errors <= 4 * count
