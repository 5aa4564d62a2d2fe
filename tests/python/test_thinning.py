"""Records that are thinned on reading, block by block."""

import gzip

import h5py
import mesoslip
import nptdms
import numpy as np
import pytest
from mesoslip.errors import ConfigError, FileError
from mesoslip.measured import measured_record, thinning
from mesoslip.measured.reading import blocks
from mesoslip.measured.reading.source import bytes_of

RATE, COUNT = 1000.0, 30000
TIME = np.arange(COUNT) / RATE


def written(path, force, time=TIME):
    lines = [f"{one:.6f},{two:.6f}" for one, two in zip(time, force, strict=True)]
    text = "\n".join(["time [s],force [N]", *lines]) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def written_hdf5(path, force):
    """Two arrays, or for MATLAB one of two columns after the 512 bytes of a header."""
    is_matlab = path.suffix == ".mat"
    with h5py.File(path, "w", userblock_size=512 * is_matlab) as file:
        if is_matlab:
            file["data"] = np.stack([TIME, force])
        else:
            file.create_dataset("time", data=TIME, chunks=(7000,)).attrs["units"] = "s"
            file.create_dataset("force", data=force).attrs["units"] = "N"
    if is_matlab:
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file")
    return path


def written_tdms(path, force):
    with nptdms.TdmsWriter(path) as file:
        for part in np.array_split(force, 7):
            properties = {"wf_increment": 1 / RATE, "unit_string": "N"}
            file.write_segment([nptdms.ChannelObject("Untitled", "force", part, properties)])
    return path


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK", 2**16)


def amplitude(tree, frequency):
    """Amplitude of a sine in a record, away from its ends."""
    time, force = tree["time"].values, tree["spring_force"].values[0]
    inside = (time > 3) & (time < 27)
    phase = 2 * np.pi * frequency * time[inside]
    design = np.stack([np.cos(phase), np.sin(phase), np.ones(phase.size)], axis=1)
    fit = np.linalg.lstsq(design, force[inside], rcond=None)[0]
    return float(np.hypot(*fit[:2]))


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
def test_slow_signals_stay_and_fast_ones_do_not_alias(name, tmp_path):
    """Up to a quarter of the new rate nothing changes; a tone above half of it would be folded."""
    force = 5 + np.sin(2 * np.pi * 2.0 * TIME) + np.sin(2 * np.pi * 18.0 * TIME)
    tree = mesoslip.read_trace(written(tmp_path / name, force), rate="20 Hz")
    assert np.diff(tree["time"].values) == pytest.approx(np.full(599, 0.05), rel=1e-6)
    assert amplitude(tree, 2.0) == pytest.approx(1.0, abs=2e-3)
    # 18 Hz at 20 Hz would look like 2 Hz: without it, the record is the slow sine alone.
    slow = 5 + np.sin(2 * np.pi * 2.0 * tree["time"].values)
    assert tree["spring_force"].values[0][50:-50] == pytest.approx(slow[50:-50], abs=2e-3)
    assert "thinned: one of every 50 of 30000 lines, 20 Hz" in tree.attrs["understood"]


def test_blocks_make_no_difference(monkeypatch, tmp_path):
    """The same from one block and from many; lines of errors are those of the file."""
    path = written(tmp_path / "a.csv", 5 + np.random.default_rng(1).standard_normal(COUNT))
    whole = mesoslip.read_trace(path, rate="20 Hz")["spring_force"].values
    monkeypatch.setattr(blocks, "BLOCK", 40000)
    assert np.array_equal(mesoslip.read_trace(path, rate="20 Hz")["spring_force"].values, whole)
    lines = path.read_text().splitlines()
    lines[20000] = "19.999,hello"
    path.write_text("\n".join(lines))
    with pytest.raises(FileError, match=r"line 20001.*'hello', is not a number"):
        mesoslip.read_trace(path, rate="20 Hz")


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.tdms"])
def test_binary_files_are_read_block_by_block(name, tmp_path, monkeypatch):
    """The same record as from a text; a block of 4000 rows is thinned before the next is read."""
    force = np.round(5 + np.random.default_rng(1).standard_normal(COUNT), 6)
    expected = mesoslip.read_trace(written(tmp_path / "a.csv", force), rate="20 Hz")
    steps = []
    read, feed = measured_record.blocks_of, thinning._Thinner.feed

    def observed(*arguments, **options):
        for table in read(*arguments, **options):
            steps.append(table.values.shape)
            yield table

    def fed(self, table):
        steps.append("thinned")
        return feed(self, table)

    monkeypatch.setattr(blocks, "BLOCK", 16 * 4000)
    monkeypatch.setattr(measured_record, "blocks_of", observed)
    monkeypatch.setattr(thinning._Thinner, "feed", fed)
    write = written_tdms if name.endswith("tdms") else written_hdf5
    path = write(tmp_path / name, force)
    known = {"columns": "time [s], force [N]"} if name.endswith("mat") else {}
    tree = mesoslip.read_trace(path, rate="20 Hz", **known)
    assert steps[:-2] == [(2, 4000), "thinned"] * 7
    for one in ("time", "spring_force"):
        np.testing.assert_allclose(tree[one].values, expected[one].values, rtol=1e-9, atol=1e-9)
    assert "thinned: one of every 50 of 30000 rows, 20 Hz" in tree.attrs["understood"]


@pytest.mark.usefixtures("small_blocks")
def test_gaps_and_missing_numbers_stay(tmp_path):
    """A gap is not filled in; a few missing samples do not spread."""
    force = 5 + 0 * TIME
    force[10000:10003] = np.nan
    kept = (TIME < 12) | (TIME > 17)
    tree = mesoslip.read_trace(
        written(tmp_path / "a.csv", force[kept], TIME[kept]), rate="20 Hz", noise="0.1 N"
    )
    time = tree["time"].values
    assert not ((time > 12.01) & (time < 16.99)).any()
    assert time.size == pytest.approx(500, abs=2)
    assert tree["spring_force"].values == pytest.approx(5.0)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("more", [b"", b"40.0,0\n"], ids=["shorter", "longer"])
def test_a_file_that_changes_while_it_is_read_is_refused(tmp_path, more, monkeypatch):
    """Cut short by its program, or longer; read in blocks, and at once."""
    path = written(tmp_path / "a.csv", np.sin(TIME))
    whole = path.read_bytes()
    found = blocks.blocks_of(path)
    next(found)
    path.write_bytes(whole + more if more else whole[: 2**16])
    with pytest.raises(FileError, match="changed while it was read"):
        list(found)
    monkeypatch.setattr("pathlib.Path.read_bytes", lambda _: whole)
    with pytest.raises(FileError, match="changed while it was read"):
        bytes_of(path)


def test_what_cannot_be_thinned(tmp_path):
    """Uneven times are refused, and a rate above that of the file changes nothing."""
    rng = np.random.default_rng(1)
    uneven = np.cumsum(rng.exponential(1e-3, COUNT))
    with pytest.raises(FileError, match="the times are uneven"):
        mesoslip.read_trace(
            written(tmp_path / "a.csv", 1 + rng.random(COUNT), uneven), rate="20 Hz"
        )
    path = written(tmp_path / "b.csv", 1 + rng.random(COUNT))
    with pytest.raises(FileError, match=r"has \d samples at 0.01 Hz; a trace needs at least 4"):
        mesoslip.read_trace(path, rate="0.01 Hz")
    for key, wrong in (("period", "1e308 s"), ("rate", "1e-200 Hz"), ("rate", 1e-308)):
        with pytest.raises(ConfigError, match=rf"{key} = .* between 1e-30 and 1e\+30 .* in size"):
            mesoslip.read_trace(path, **{key: wrong})
    for low in ("1e-4 Hz", "1e-30 Hz"):
        with pytest.raises(FileError, match=r"--rate is too low .* at least 0\.001 Hz"):
            mesoslip.read_trace(path, rate=low)
    for key, extreme in (("period", 1e30), ("period", 1e-30), ("rate", 1e30)):
        assert mesoslip.read_trace(path, **{key: extreme}).sizes["time"] == COUNT
    empty = written(tmp_path / "c.csv", np.full(9, np.nan), TIME[:9])
    with pytest.raises(FileError, match="has 0 samples beside 9 without time or force"):
        mesoslip.read_trace(empty)
    tree = mesoslip.read_trace(path, rate="900 Hz")
    assert tree.sizes["time"] == COUNT
    assert "not thinned: recorded at 1000 Hz" in tree.attrs["understood"]
