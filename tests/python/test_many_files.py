"""Files that are parts of one test, and files that are read with one description."""

import csv

import mesoslip
import numpy as np
import pytest
from mesoslip import FileError
from mesoslip.measured.batch import COLUMNS
from mesoslip.measured.understanding import understand

STEP = 0.01
RISE, PERIOD = 0.05, 40


def text(first, count, *, header="time [s]\tforce [N]", clock=None):
    """A sawtooth from a sample on, whose times may start again."""
    start = first if clock is None else clock
    rows = [
        f"{STEP * (start + n):.2f}\t{2 + RISE * ((first + n) % PERIOD):.3f}" for n in range(count)
    ]
    return "\n".join([header, *rows, ""])


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "whole.txt").write_text(text(0, 600))
    (tmp_path / "a.txt").write_text(text(0, 250))
    (tmp_path / "b.txt").write_text(text(250, 350))
    (tmp_path / "again.txt").write_text(text(250, 350, clock=0))
    return tmp_path


@pytest.mark.parametrize("second", ["b.txt", "again.txt"])
def test_parts_are_the_whole(folder, second):
    """A clock that starts again goes on by an interval."""
    whole = understand(folder / "whole.txt").record
    parts = understand([folder / "a.txt", folder / second]).record
    np.testing.assert_allclose(parts.time, whole.time, atol=1e-9)
    np.testing.assert_array_equal(parts.force, whole.force)
    guessed = "guess: the clock of again.txt starts again" in "\n".join(parts.report)
    assert guessed == (second == "again.txt")


def test_dates_of_parts_have_the_time_between_them(folder):
    """A pause of an hour; in dates of one day each, whose order is not known, a guess."""
    for date, is_known in (("2026-03-04", True), ("04/03/2026", False)):
        for name, hour in (("c", 12), ("d", 13)):
            rows = [f"{date} {hour}:00:{n:02d}\t{2 + n % 3}" for n in range(40)]
            (folder / f"{name}.txt").write_text("\n".join(["time\tforce [N]", *rows, ""]))
        record = understand([folder / "c.txt", folder / "d.txt"]).record
        assert record.time[40] == (3600 if is_known else 40)
        assert ("guess: the clock of d.txt" in "\n".join(record.report)) != is_known


def test_clocks_without_dates_of_parts_have_the_time_between_them(folder):
    """Parts of an evening, over midnight, and of the day after."""
    for name, start in (("c", "22:58"), ("d", "23:59"), ("e", "00:30"), ("f", "00:20")):
        rows = [f"{start}:{n:02d}\t{2 + n % 3}" for n in range(40)]
        (folder / f"{name}.txt").write_text("\n".join(["time\tforce [N]", *rows, ""]))
    record = understand([folder / f"{name}.txt" for name in "cdef"]).record
    starts = 60 * np.array([0, 61, 92, 1440 + 82])
    np.testing.assert_array_equal(record.time.reshape(4, 40), starts[:, None] + np.arange(40))
    lines = [one for one in record.report if "no dates" in one]
    assert lines[0].startswith("guess: d.txt was recorded within a day after c.txt")
    assert len(lines) == 3


def test_a_description_names_parts_and_the_output_repeats_them(folder):
    description = folder / "test.toml"
    description.write_text('[trace]\nfile = ["a.txt", "b.txt"]\n')
    tree = mesoslip.read_trace(description)
    assert tree.attrs["measured_file"] == "a.txt, b.txt"
    description.write_text(tree.attrs["trace"])
    again = mesoslip.read_trace(description)
    np.testing.assert_array_equal(again["spring_force"], tree["spring_force"])
    np.testing.assert_array_equal(again["slips/start_time"], tree["slips/start_time"])


def test_parts_have_the_same_columns(folder):
    (folder / "b.txt").write_text(text(250, 350, header="time [s]\tforce [mN]"))
    with pytest.raises(FileError, match=r"b\.txt: has the columns .*'force \[mN\]'.*a\.txt has"):
        understand([folder / "a.txt", folder / "b.txt"])


def test_a_bad_cell_of_a_part_is_named_with_its_file(folder):
    path = folder / "b.txt"
    path.write_text(path.read_text().replace("\n2.60\t", "\n2.60\tx"))
    with pytest.raises(FileError, match=r"line 12: .*'x3.*\(of b\.txt\)"):
        understand([folder / "a.txt", path])


def rows_of(path):
    with path.open() as file:
        return list(csv.reader(file))


def test_each_file_of_a_batch_has_an_output_and_a_row(folder, command):
    (folder / "broken.txt").write_text("nothing\n")
    table = folder / "table.csv"
    names = ["whole", "a", "broken", "again"]
    status, _, messages = command(
        "trace", *(folder / f"{name}.txt" for name in names), "--batch", table, "-o", folder / "out"
    )
    assert status == 1
    assert "3 files read, 1 failed" in messages
    assert "broken.txt" in messages
    head, *rows = rows_of(table)
    assert [one.partition(" ")[0] for one in head] == list(COLUMNS)
    found = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
    assert [row["samples"] for row in found] == ["600", "250", "", "350"]
    assert not (folder / "out" / "broken.nc").exists()
    assert "no columns of numbers" in found[2]["message"]
    # The first rise is cut, as the last fall may be.
    assert int(found[0]["slips"]) == pytest.approx(600 / PERIOD, abs=1)
    assert float(found[0]["mean_force_drop"]) == pytest.approx(RISE * (PERIOD - 1), rel=0.05)
    assert float(found[0]["mean_waiting_time"]) == pytest.approx(STEP * PERIOD, rel=0.01)
    alone = mesoslip.read_trace(folder / "a.txt")
    saved = mesoslip.open_output(folder / "out" / "a.nc")
    np.testing.assert_array_equal(saved["spring_force"], alone["spring_force"])


def test_a_description_of_a_batch_holds_for_all(folder, command):
    description = folder / "all.toml"
    description.write_text('[trace]\nfile = "-"\nnormal_force = "10 N"\n')
    table = folder / "table.csv"
    status, _, messages = command(
        *("trace", description, folder / "a.txt", folder / "b.txt"),
        *("--batch", table, "-o", folder / "out", "--workers", 1),
    )
    assert status == 0, messages
    assert [row[list(COLUMNS).index("mean_normal_force")] for row in rows_of(table)[1:]] == [
        "10.0",
        "10.0",
    ]


def test_wrong_batches_are_one_message(folder, command):
    other = folder / "other"
    other.mkdir()
    (other / "a.txt").write_text(text(0, 100))
    description = folder / "all.toml"
    description.write_text("[trace]\n")
    for arguments, said in (
        ((folder / "a.txt", other / "a.txt"), "have the same output"),
        ((description,), "needs the files"),
        ((folder / "a.txt", "--dry-run"), "leave out --batch"),
    ):
        messages = command.refusal(
            "trace", *arguments, "--batch", folder / "t.csv", "-o", folder / "out"
        )
        assert said in messages
        assert not (folder / "t.csv").exists()
    first = folder / "first.csv"
    first.write_text(text(0, 100))
    messages = command.refusal("trace", "--batch", first, folder / "a.txt", "-o", folder / "out")
    assert "first.csv: exists, and is no table of a batch" in messages
    assert first.read_text() == text(0, 100)
    (folder / "there").write_text("")
    for table, outputs in (("t.csv", "there"), ("t.csv", "t.csv")):
        messages = command.refusal(
            "trace", folder / "a.txt", "--batch", folder / table, "-o", folder / outputs
        )
        assert "is a file; outputs of a batch need the name of a folder" in messages
    messages = command.refusal("trace", description, folder / "a.txt", "--dry-run")
    assert "--batch" in messages
