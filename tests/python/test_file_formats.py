"""Workbooks, files of LabVIEW and time stamps, as laboratories have them."""

from __future__ import annotations

import datetime

import nptdms
import numpy as np
import openpyxl
import pytest
from mesoslip import FileError
from mesoslip.measured.trace import understand

COUNT = 300
SECONDS = 0.01 * np.arange(COUNT)
FORCE = 2.0 + np.arange(COUNT) % 40
# Passes midnight.
START = datetime.datetime(2024, 5, 1, 23, 59, 58)
STAMPS = [START + datetime.timedelta(milliseconds=10 * n) for n in range(COUNT)]


def report_of(path, **options):
    return "\n".join(understand(path, **options).record.report)


def check(path, size=1.0, **options):
    record = understand(path, **options).record
    np.testing.assert_allclose(record.time, SECONDS, atol=1e-9)
    np.testing.assert_allclose(record.force, size * FORCE)
    return record


def workbook(path, *sheets):
    """A workbook of sheets, each with a name and rows."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


DATA = [["Run 17"], [], ["Time", "Force", "Pump"], ["s", "mN", None]] + [
    [t, f, "on"] for t, f in zip(SECONDS.tolist(), FORCE.tolist(), strict=True)
]
OTHER = [["Time [s]", "Force [N]"], *([n, 5.0 + n % 3] for n in range(9))]


def test_a_workbook_is_read_from_its_sheet_of_numbers(tmp_path):
    path = workbook(tmp_path / "a.xlsx", ("Notes", [["Operator", "A"]]), ("Run", DATA))
    check(path, 1e-3)
    assert "guess: workbook: sheet 'Run', which has the most numbers" in report_of(path)


def test_the_sheet_of_a_workbook_can_be_chosen(tmp_path):
    path = workbook(tmp_path / "a.xlsx", ("Run", DATA), ("Short", OTHER))
    record = understand(path, sheet="Short").record
    np.testing.assert_array_equal(record.time, np.arange(9))
    assert "guess: workbook" not in "\n".join(record.report)
    with pytest.raises(FileError, match="no sheet 'Long'; its sheets are 'Run', 'Short'"):
        understand(path, sheet="Long")


def test_dates_of_a_workbook_are_times(tmp_path):
    rows = [["Date", "Force (N)"], *map(list, zip(STAMPS, FORCE.tolist(), strict=True))]
    path = workbook(tmp_path / "a.xlsx", ("Run", rows))
    check(path, headers="time, force [N]")


@pytest.mark.parametrize(
    ("form", "delimiter", "sign"),
    [
        ("%Y-%m-%dT%H:%M:%S.{}", ",", "."),
        ("%Y-%m-%d %H:%M:%S,{}+02:00", ";", ","),
        ("%d.%m.%Y %H:%M:%S.{}", "\t", "."),
        ("%H:%M:%S.{}", "\t", "."),
    ],
)
def test_time_stamps_are_seconds_from_the_first(form, delimiter, sign, tmp_path):
    stamps = [one.strftime(form).format(f"{one.microsecond // 1000:03d}") for one in STAMPS]
    rows = [
        one + delimiter + f"{f:.1f}".replace(".", sign)
        for one, f in zip(stamps, FORCE, strict=True)
    ]
    path = tmp_path / "a.txt"
    path.write_text(f"Timestamp{delimiter}Force [N]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    check(path)
    assert "time stamps, as seconds from" in report_of(path)
    assert "no unit" not in report_of(path)


def test_a_time_stamp_among_numbers_is_none(tmp_path):
    """And a number among time stamps: neither is guessed."""
    lines = [f"{t:.2f},{f:.1f}" for t, f in zip(SECONDS, FORCE, strict=True)]
    lines[7] = "00:00:01,5.0"
    path = tmp_path / "a.csv"
    path.write_text("time [s],force [N]\n" + "\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"line 9: column 'time .s.': the time, '00:00:01', is not"):
        understand(path)
    stamps = [one.isoformat() for one in STAMPS]
    stamps[7] = "0.07"
    rows = [f"{one},{f:.1f}" for one, f in zip(stamps, FORCE, strict=True)]
    path.write_text("time,force [N]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"line 9: .*'0.07', is not a number"):
        understand(path)


def labview(path, *channels):
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject(*one) for one in channels])
    return path


def test_channels_of_labview_have_units_and_the_times_of_waveforms(tmp_path):
    wave = {"wf_increment": 0.01, "wf_start_offset": 0.0, "unit_string": "mN"}
    path = labview(
        tmp_path / "a.tdms",
        ("Test", "Force", FORCE, wave),
        ("Test", "Normal force", np.full(COUNT, 10.0), wave | {"unit_string": "N"}),
        ("Test", "Marks", np.arange(3.0), {}),
    )
    record = check(path, 1e-3)
    assert record.mean_normal_force == 10.0
    assert "not used: Marks (3 numbers)" in report_of(path)


def test_time_stamps_of_labview_are_times(tmp_path):
    stamps = np.array(STAMPS, dtype="datetime64[us]")
    path = labview(
        tmp_path / "a.tdms",
        ("Test", "Time", stamps, {}),
        ("Test", "Force", FORCE, {"unit_string": "N"}),
    )
    check(path)


def test_a_file_of_labview_that_is_cut_short_says_so(tmp_path, capfd):
    path = labview(
        tmp_path / "a.tdms",
        ("Test", "Force", FORCE, {"wf_increment": 0.01, "unit_string": "N"}),
        ("Test", "More", FORCE, {"unit_string": "N"}),
    )
    path.write_bytes(path.read_bytes()[:-800])
    check(path)
    assert "less data than expected" in report_of(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("ending", ["xlsx", "tdms"])
def test_damaged_files_are_one_message(ending, tmp_path):
    path = tmp_path / f"a.{ending}"
    if ending == "xlsx":
        workbook(path, ("Run", DATA))
    else:
        labview(path, ("Test", "Force", FORCE, {"unit_string": "N"}))
    data = path.read_bytes()
    for size in (20, 100, len(data) // 2):
        path.write_bytes(data[:size])
        with pytest.raises(FileError):
            understand(path)


@pytest.mark.parametrize(("ending", "package"), [("xlsx", "openpyxl"), ("tdms", "nptdms")])
def test_a_missing_package_is_named(ending, package, tmp_path, monkeypatch):
    path = tmp_path / f"a.{ending}"
    if ending == "xlsx":
        workbook(path, ("Run", DATA))
    else:
        labview(path, ("Test", "Force", FORCE, {}))
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(FileError, match=r"pip install 'mesoslip\[files\]'"):
        understand(path)
