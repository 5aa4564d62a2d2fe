"""Workbooks, files of LabVIEW and time stamps, as laboratories have them."""

import datetime

import nptdms
import numpy as np
import openpyxl
import pandas
import pytest
from mesoslip import ConfigError, FileError
from mesoslip.measured.reading import blocks
from mesoslip.measured.reading.file import read_file
from mesoslip.measured.reading.stamps import Chosen, chosen_order
from mesoslip.measured.understanding import understand

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
        ("%Y/%m/%d %H:%M:%S.{}", ",", "."),
        ("%d.%m.%Y %H:%M:%S,{}", ";", ","),
        ("%d.%m.%y %H.%M.%S,{}", ";", ","),
        ("%d-%b-%y %H:%M:%S.{}", ",", "."),
        ("%d. %B %Y %H:%M:%S.{}", "\t", "."),
        ("%b %d %Y %H:%M:%S:{}", "\t", "."),
        ("%m/%d/%Y, %I:%M:%S.{} %p", ";", "."),
        ("%d/%m/%Y %H:%M:%S.{} UTC", "\t", "."),
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


def dated(path, form, step, count=12, start=START):
    """A file with a row after each step of time, and its times."""
    stamps = [start + n * step for n in range(count)]
    rows = [f"{one.strftime(form)},{n % 4}.5" for n, one in enumerate(stamps)]
    path.write_text("Timestamp,Force [N]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    dates = pandas.to_datetime([row.split(",")[0] for row in rows], format=form)
    return (dates - dates[0]).total_seconds().to_numpy()


SHORT, LONG = datetime.timedelta(minutes=1), datetime.timedelta(days=2)


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M", "%m/%d/%y %H:%M:%S"])
def test_the_order_of_a_date_is_that_of_the_only_possible_one(form, tmp_path):
    """A day above 12, or the only order in which times increase."""
    times = dated(tmp_path / "a.csv", form, LONG)
    np.testing.assert_array_equal(understand(tmp_path / "a.csv").record.time, times)
    # From April to May; in the other order from November back to August.
    assert chosen_order(["11/04/2026", "08/05/2026"]) == Chosen("dmy")
    assert chosen_order(["04/11/2026", "05/08/2026"]) == Chosen("mdy")
    # A damaged date is named where it is read.
    assert chosen_order(["99/99/2026", "04/11/2026", "05/08/2026"]) == Chosen("mdy")


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M", "%y-%m-%d %H:%M"])
def test_a_guessed_order_of_dates_is_printed_and_overruled(form, tmp_path):
    """Dates before the 13th, past midnight: the guess is the shortest record."""
    path, start = tmp_path / "a.csv", datetime.datetime(2026, 3, 4, 23, 55)
    times = dated(path, form, SHORT, start=start)
    record = understand(path).record
    np.testing.assert_array_equal(record.time, times)
    order = form.replace("%", "")[:5].lower().replace("/", "").replace("-", "")
    words = "/".join({"d": "day", "m": "month", "y": "year"}[one] for one in order)
    assert f"dates as {words} (--dates)" in "\n".join(record.report)
    assert "guess: column 1" in "\n".join(record.report)
    assert "guess: column 1" not in report_of(path, dates=order)
    other = {"dmy": "mdy", "mdy": "dmy", "ymd": "dmy"}[order]
    np.testing.assert_array_less(
        times[-1] + 20 * 86400, understand(path, dates=other).record.time[-1]
    )
    # A column of one day has the same times in any order.
    dated(path, form, SHORT, start=start.replace(hour=12))
    assert "guess: column 1" not in report_of(path)


def test_a_date_that_the_order_does_not_have_is_named(tmp_path):
    path = tmp_path / "a.csv"
    dated(path, "%m/%d/%Y %H:%M", LONG, start=datetime.datetime(2026, 3, 11, 12))
    with pytest.raises(FileError, match=r"line 3: .*'03/13/2026 12:00', is not a number, nor a da"):
        understand(path, dates="dmy")
    with pytest.raises(ConfigError, match="--dates = 'day': must be 'dmy', 'mdy' or 'ymd'"):
        understand(path, dates="day")


def test_the_line_of_units_has_the_order_of_dates(tmp_path):
    path = tmp_path / "a.csv"
    dated(path, "%m/%d/%Y %H:%M", SHORT, start=datetime.datetime(2026, 3, 4, 23, 55))
    _, *rows = path.read_text().splitlines()
    for form, size in (("dd/mm/yyyy hh:mm", 29 * 86400 + 660), ("mm/dd/yyyy hh:mm", 660)):
        path.write_text("\n".join(["Time,Force", f"{form},N", *rows]) + "\n")
        record = understand(path).record
        assert record.time[-1] == size
        assert "guess: column 1" not in "\n".join(record.report)


def test_blocks_of_a_file_have_one_order_of_dates(tmp_path, monkeypatch):
    """Found in the first block; a block below, with other dates only, is read alike."""
    monkeypatch.setattr(blocks, "BLOCK", 400)
    path, start = tmp_path / "a.csv", datetime.datetime(2026, 3, 4, 23, 55)
    times = dated(path, "%m/%d/%Y %H:%M:%S", datetime.timedelta(seconds=5), 300, start)
    record = understand(path, rate=0.2).record
    np.testing.assert_array_equal(record.time, times)
    assert "\n".join(record.report).count("dates as month/day/year (--dates)") == 1


def test_blocks_of_a_clock_without_dates_pass_midnight(tmp_path, monkeypatch):
    """Each block has a few minutes of three days."""
    monkeypatch.setattr(blocks, "BLOCK", 400)
    path, step = tmp_path / "a.csv", datetime.timedelta(seconds=500.5)
    start = datetime.datetime(2026, 3, 4, 10, 5)
    stamps = [(start + n * step).strftime("%H:%M:%S.%f") for n in range(500)]
    rows = [f"{one},{n % 4}.5" for n, one in enumerate(stamps)]
    path.write_text("Clock,Force [N]\n" + "\n".join(rows) + "\n")
    for options in ({}, {"rate": 1 / 500.5}):
        record = understand(path, **options).record
        np.testing.assert_array_equal(record.time, 500.5 * np.arange(500))


ROWS = (
    # Days and hours with one digit and two, months, halves of the day, quotes and blanks.
    ("9 Mar 2026 9:59:59.5 PM", 0.0),
    ("9 Mar 2026 10:00:00 PM", 0.5),
    ('"9 Mar 2026 11:59:59.25 PM"', 7199.75),
    (" 10 Mar 2026 12:00:00.125 AM ", 7200.625),
    ("31 Mar 2026 12:00:00 pm", 1864800.5),
    ("1 Apr 2026 1:00:00.000000001 a.m.", 1911600.500000001),
)


def test_time_stamps_of_many_forms_in_a_column(tmp_path):
    """Also where another column has words; lines without a number are left out."""
    path = tmp_path / "a.csv"
    rows = [f"{one};{n},5;{'ok' if n % 2 else ''}" for n, (one, _) in enumerate(ROWS * 4)]
    rows.insert(9, "10 Mar 2026 2:00:00 AM;;")
    rows.insert(5, ";7,5;")
    path.write_text("Time;Force [N];State\n" + "\n".join(rows) + "\n")
    table = read_file(path)
    np.testing.assert_array_equal(np.delete(table.values[0], 5), [one for _, one in ROWS * 4])
    assert np.isnan(table.values[0, 5])
    np.testing.assert_array_equal(np.delete(table.values[1], 5), np.arange(24) + 0.5)
    assert table.bad == {2: table.bad[2]}


@pytest.mark.parametrize("wrong", ["24:00:00", "12:60:00", "12:00", "1.5", "12:00:00 XM"])
def test_a_cell_that_is_no_time_stamp_is_named(wrong, tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"12:00:{n:02d},{n}" for n in range(30)]
    rows[20] = f"{wrong},20"
    path.write_text("Time,Force [N]\n" + "\n".join(rows) + "\n")
    table = read_file(path)
    assert [(one.line, one.text) for one in table.bad[0]] == [(22, wrong)]
    np.testing.assert_array_equal(np.delete(table.values[0], 20), np.delete(np.arange(30), 20))


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
