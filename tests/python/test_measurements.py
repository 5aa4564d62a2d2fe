"""Files of measurements: every style of a laboratory, units, samples at any times, damages."""

import gzip
import tracemalloc
import zipfile
from functools import partial

import h5py
import measurements
import mesoslip
import nptdms
import numpy as np
import pytest
from conftest import ROOT, long
from mesoslip.measured.headers import read_header
from mesoslip.measured.reading.file import READERS, read_file
from mesoslip.measured.sampling import in_order, sampling_report, sampling_summary
from mesoslip.measured.understanding import understand
from mesoslip.measured.units import size_of
from scipy.io import netcdf_file, savemat

ROWS = "".join(f"{0.01 * n:.2f}\t{3 + np.sin(n):.6f}\n" for n in range(60))


def record_of(path, text, **options):
    path.write_text(text, encoding="utf-8")
    return understand(path, **options).record


def refusal(path, text, **options):
    with pytest.raises(mesoslip.MesoslipError) as found:
        record_of(path, text, **options)
    return str(found.value)


@pytest.mark.parametrize("number", range(60))
def test_files_in_many_styles_are_read_as_they_were_made(tmp_path, number):
    case = measurements.make(f"test {number}")
    assert measurements.check_whole(case, measurements.write(case, tmp_path)) == []


UNITS = {"time": "s", "force": "uN"}


def test_text_in_blocks_is_read_as_in_one(tmp_path, monkeypatch):
    """Irregular rows, repeated headers and a damaged number, wherever a block ends."""
    header = "time_s\tforce_N\n"
    rows = [f"{0.01 * n:.2f}\t{3 + np.sin(n):.6f}\n" for n in range(400)]
    rows[50] = "# restarted\n"
    rows[51] = header
    rows[120] = "1.20\t\n"
    rows[200] = "2.00\tOVER\n"
    whole = record_of(tmp_path / "a.txt", header + "".join(rows))
    assert len(whole.time) == 396
    monkeypatch.setattr("mesoslip.measured.reading.text.BLOCK", 101)
    blocks = record_of(tmp_path / "a.txt", header + "".join(rows)[:-1])
    np.testing.assert_array_equal(blocks.time, whole.time)
    np.testing.assert_array_equal(blocks.force, whole.force)
    assert blocks.report == whole.report
    assert "rows with fewer decimal signs" in "\n".join(blocks.report)


def test_a_long_text_takes_little_more_memory_than_its_numbers(tmp_path, monkeypatch):
    """Two columns of 8 bytes, their file, its places and its numbers in use: no line by itself."""
    monkeypatch.setattr("mesoslip.measured.reading.text.BLOCK", 2**15)
    count = 20_000
    text = "time_s\tforce_N\n" + "".join(f"{0.001 * n:.3f}\t{n % 7}.5\n" for n in range(count))
    record_of(tmp_path / "a.txt", text[:1000])
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    tracemalloc.start()
    try:
        understand(tmp_path / "a.txt")
        assert tracemalloc.get_traced_memory()[1] < 120 * count
    finally:
        tracemalloc.stop()


def test_samples_that_continue_their_neighbours_are_numbers(tmp_path):
    """A trace that passes a number that elsewhere stands for a missing one, in its range and in a
    short fall far below it."""
    experiment = understand(
        ROOT / "runs" / "fit" / "experiment.csv", rate="1 kHz", velocity="0.1 um/s"
    )
    assert "-999" not in "\n".join(experiment.record.report)
    force = np.full(400, 500.0) + np.arange(400) % 3
    fall = np.linspace(500, -1200, 18).round()
    fall[np.argmin(np.abs(fall + 999))] = -999
    force[200:218] = fall
    rows = [f"{0.01 * n:.2f}\t{one:g}\n" for n, one in enumerate(force)]
    record = record_of(tmp_path / "a.txt", "time_s\tforce_N\n" + "".join(rows))
    np.testing.assert_array_equal(record.force, force)
    assert "-999" not in "\n".join(record.report)
    for at in (60, 61, 300):
        rows[at] = f"{0.01 * at:.2f}\t-999\n"
    record = record_of(tmp_path / "a.txt", "time_s\tforce_N\n" + "".join(rows))
    assert len(record.force) == 397
    assert "-999 taken as missing in 3 lines" in "\n".join(record.report)


def write_hdf5(path, columns, userblock=0):
    with h5py.File(path, "w", userblock_size=userblock) as file:
        file.update(columns)
    if userblock:
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file")


def write_netcdf(path, columns, version):
    with netcdf_file(path, "w", version=version) as file:
        file.createDimension("row", 60)
        for name, values in columns.items():
            file.createVariable(name, "f8", ("row",))[:] = values


def write_tdms(path, columns):
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject("", *one) for one in columns.items()])


WRITERS = {
    b"TDSm": write_tdms,
    b"PK\x03\x04": lambda path, columns: np.savez(path, **columns),
    b"\x93NUMPY": lambda path, columns: np.save(
        path, np.rec.fromarrays([*columns.values()], names=[*columns])
    ),
    b"MATLAB 5.0": savemat,
    b"MATLAB 7.3": partial(write_hdf5, userblock=512),
    b"\x89HDF\r\n\x1a\n": write_hdf5,
    b"CDF\x01": partial(write_netcdf, version=1),
    b"CDF\x02": partial(write_netcdf, version=2),
}


@pytest.mark.parametrize("reader", READERS, ids=lambda one: one.kind)
def test_every_format_is_read(tmp_path, reader):
    """By the reader that its first bytes choose, whatever the name of the file ends with."""
    columns = {"time_s": 0.01 * np.arange(60), "force_N": 3 + np.sin(np.arange(60))}
    stem = tmp_path / "run.npy" if reader.kind == "NumPy (.npy)" else tmp_path / "run.npz"
    WRITERS[reader.start](stem, columns)
    path = stem.rename(tmp_path / "run.data")
    assert path.read_bytes().startswith(reader.start)
    record = understand(path).record
    np.testing.assert_allclose(record.force, columns["force_N"])
    assert f"{reader.kind}: 2 columns" in " ".join(read_file(path).notes)


def test_data_sets_take_bounded_memory(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time"], file["force"] = np.arange(50.0), np.sin(np.arange(50.0))
        for name, unit in UNITS.items():
            file[name].attrs["units"] = unit
        for number in range(12):
            file.create_dataset(f"empty{number}", (230_000_000,), float, chunks=(10_000,))
        # Not a column.
        video = file.create_dataset("video", (200, 300, 500_000), "f4", chunks=(1, 1, 10))
        video[0, 0, 0] = 1
    assert mesoslip.read_trace(path).sizes["time"] == 50
    monkeypatch.setattr("mesoslip.measured.reading.binary.MAX_BYTES", 500)
    with pytest.raises(mesoslip.FileError, match="take more than"):
        mesoslip.read_trace(path)


def zipped(path, arrays):
    """An archive of headers of NumPy alone, which state shapes of any size."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, shape in arrays.items():
            with archive.open(f"{name}.npy", "w") as file:
                header = {"descr": "<f8", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, header)


def packed(path, arrays):
    """A file of MATLAB with zeros, compressed to a thousandth."""
    savemat(path, {name: np.zeros(shape) for name, shape in arrays.items()}, do_compression=True)


@pytest.mark.parametrize(("make", "ending"), [(zipped, "npz"), (packed, "mat")])
def test_what_unpacks_to_more_than_memory_is_refused(make, ending, tmp_path, monkeypatch):
    """Before anything is unpacked: a small archive may state any size."""
    path = tmp_path / f"run.{ending}"
    make(path, {"time_s": (500_000,), "force_uN": (500_000,)})
    monkeypatch.setattr("mesoslip.measured.reading.binary.MAX_BYTES", 6_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(mesoslip.FileError, match="take more than"):
            mesoslip.read_trace(path)
        assert tracemalloc.get_traced_memory()[1] < 4_000_000
    finally:
        tracemalloc.stop()


def test_arrays_that_are_not_columns_are_not_read(tmp_path):
    path = tmp_path / "run.npz"
    time = np.arange(50.0)
    np.savez(path, time_s=time, force_uN=np.sin(time), table=np.zeros((50, 3)))
    with zipfile.ZipFile(path, "a") as archive, archive.open("more.npy", "w") as file:
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
        np.lib.format.write_array_header_1_0(file, header)
    read = mesoslip.read_trace(path)
    np.testing.assert_allclose(read["spring_force"][0], 1e-6 * np.sin(time))
    assert len(read["recorded"].data_vars) == 5


@pytest.mark.parametrize("number", [*range(100), *map(long, range(100, 200))])
def test_damaged_files_give_no_wrong_numbers(tmp_path, number):
    case, changed, how = measurements.damage(f"test {number}")
    path = measurements.write(case, tmp_path)
    assert measurements.check(case, path, changed, how)[1] == []


@pytest.mark.parametrize(
    ("header", "quantity", "unit"),
    [
        ("Time(s)", "time", "s"),
        ("time_s", "time", "s"),
        ("t / ms", "time", "ms"),
        ("Displ(microns)", "either", "microns"),
        ("lp_disp_um", "load_point", "um"),
        ("Load point {µm}", "load_point", "um"),
        ("Force, N", "force", "N"),
        ("Force / N", "force", "N"),
        ("Normal_stress(MPa)", "normal_stress", "MPa"),
        ("Shear stress [MPa] (filtered)", "shear_stress", "MPa"),
        ("F_over_mg", "friction", None),
        ("F/N", "friction", None),
        ("µ", "friction", None),
        ("CH3 [V]", None, "V"),
        ("F_N", None, None),
        ("F_N [mN]", "normal_force", "mN"),
        ("load [N]", None, "N"),
        # The unit decides, and names of groups stand before names.
        ("Friction [uN]", "force", "uN"),
        ("Normal [uN]", "normal_force", "uN"),
        ("Shear [N]", "force", "N"),
        ("Normal stress (kN)", "normal_force", "kN"),
        ("COF [%]", "friction", "%"),
        ("DAQ.Fx (N)", "force", "N"),
        ("Ff (N)", "force", "N"),
        ("DAQ.COF", "friction", None),
        ("F_lat(µN)", "force", "uN"),
        ("Piezo position (nm)", "load_point", "nm"),
        ("angle (°)", "revolutions", "°"),
        ("angle", None, None),
    ],
)
def test_headers_of_the_field(header, quantity, unit):
    assert read_header(header)[:2] == (quantity, unit)


@pytest.mark.parametrize(
    ("text", "unit", "size"),
    [
        ("µm", "m", 1e-6),
        ("μm", "m", 1e-6),
        ("Âµm", "m", 1e-6),
        ("\ufffdm", "m", 1e-6),
        ("msec", "s", 1e-3),
        ("kgf", "N", 9.80665),
        ("g", "N", 9.80665e-3),
        ("N/mm^2", "Pa", 1e6),
        ("psi", "Pa", 6894.757293168361),
        ("MPa", "N", None),
    ],
)
def test_units_of_the_field(text, unit, size):
    found = size_of(text, unit)
    assert (found and found.size) == (size and pytest.approx(size))


def test_options_that_a_record_cannot_have_are_refused(tmp_path):
    table = tmp_path / "a.csv"
    rows = "".join(f"{0.01 * at:.2f},{at % 50}\n" for at in range(500))
    table.write_text("time [s],force [uN]\n" + rows)
    with pytest.raises(mesoslip.FileError, match="'time \\[parsec\\]': 'parsec' is not a unit"):
        mesoslip.read_trace(table, columns="time [parsec], force [uN]")
    with pytest.raises(mesoslip.ConfigError, match="below half of the sampling rate, 50 Hz"):
        mesoslip.read_trace(table, hum="51 Hz")


def test_volts_have_a_factor_and_an_offset(tmp_path):
    table = "t_s\tCH3 [V]\n" + ROWS
    description = tmp_path / "run.toml"
    (tmp_path / "run.txt").write_text(table)
    column = '{ column = "CH3", factor = "12.4 mN/V", offset = "300 mV" }'
    description.write_text(f'[trace]\nfile = "run.txt"\ncolumns = {{ force = {column} }}\n')
    record = understand(description).record
    raw = 3 + np.sin(np.arange(60))
    np.testing.assert_allclose(record.force, (raw - 0.3) * 12.4e-3, atol=1e-8)
    # Volts alone are no force.
    assert "--columns" in refusal(tmp_path / "run.txt", table)
    message = refusal(tmp_path / "x.txt", table.replace("CH3", "force"))
    assert "has the unit 'V'" in message
    assert "factor" in message
    description.write_text(description.read_text().replace("mN/V", "mm/V"))
    with pytest.raises(mesoslip.ConfigError, match=r"trace\.columns\.force.*expected a quantity"):
        understand(description)


def test_all_mistakes_of_a_description_at_once(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text('[trace]\nfile = "run.txt"\nstifness = "1 N/m"\narea = "3 m"\n')
    with pytest.raises(mesoslip.ConfigError) as found:
        understand(path)
    assert "trace.stifness: unknown key; did you mean 'stiffness'?" in str(found.value)
    assert "trace.area = '3 m': has the unit m" in str(found.value)
    assert len(found.value.problems) == 2


def test_the_output_repeats_its_reading(tmp_path, command):
    for name in ("basalt-step.toml", "basalt-step.txt.gz"):
        (tmp_path / name).write_bytes((ROOT / "runs" / "measured" / name).read_bytes())
    tree = mesoslip.read_trace(tmp_path / "basalt-step.toml", start="11650 s")
    (tmp_path / "again.toml").write_text(tree.attrs["trace"])
    again = mesoslip.read_trace(tmp_path / "again.toml")
    np.testing.assert_array_equal(tree["friction_coefficient"], again["friction_coefficient"])
    np.testing.assert_array_equal(tree["drive_displacement"], again["drive_displacement"])
    assert again.attrs["trace"] == tree.attrs["trace"]
    assert tree["recorded"].sizes["row"] == 5849
    assert tree["recorded"]["Displ_microns"].attrs["units"] == "microns"
    assert "spring_force" not in tree
    (tmp_path / "out").mkdir()
    raw = tmp_path / "basalt-step.txt.gz"
    raw = raw.rename(tmp_path / "raw.nc")
    text = (tmp_path / "again.toml").read_text().replace("basalt-step.txt.gz", "raw.nc")
    (tmp_path / "again.toml").write_text(text)
    # The data are not written over.
    assert command("trace", tmp_path / "again.toml", "-o", raw)[0] == 2
    printed = command.output(
        "trace", tmp_path / "again.toml", "--dry-run", "-o", tmp_path / "out" / "o.nc"
    )
    assert "samples: 10 Hz from 11650 s to 11674.2 s (243)" in printed
    assert not any((tmp_path / "out").iterdir())


def test_coefficients_become_forces_with_a_normal_force(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,F_over_mg\n" + ROWS.replace("\t", ","))
    bare = mesoslip.read_trace(path, stiffness="1.6e-3 1/um", velocity="1 um/s")
    assert "friction_coefficient" in bare
    force = mesoslip.read_trace(path, normal_force="0.5 N", stiffness="1.6e-3 1/um")
    np.testing.assert_allclose(force["spring_force"], 0.5 * bare["friction_coefficient"])
    assert "stiffness = 800.0" in force.attrs["configuration"]
    with pytest.raises(mesoslip.ConfigError, match="give the normal force too"):
        mesoslip.read_trace(path, stiffness="1002 N/m")
    record_of(tmp_path / "f.csv", "time_s,force_N\n" + ROWS.replace("\t", ","))
    with pytest.raises(mesoslip.ConfigError, match="is for friction coefficients"):
        understand(tmp_path / "f.csv", stiffness="1.6e-3 1/um")


def test_stresses_need_an_area_or_each_other(tmp_path):
    text = "time_s\tshear stress (MPa)\n" + ROWS
    record = record_of(tmp_path / "a.txt", text, area="1 cm^2")
    assert record.force_name == "spring_force"
    assert record.force[0] == pytest.approx(300.0)
    record = record_of(tmp_path / "a.txt", text, normal_stress="6 MPa")
    assert (record.force_name, record.force[0]) == ("friction_coefficient", pytest.approx(0.5))
    assert "give --area" in refusal(tmp_path / "a.txt", text)


def test_a_model_with_a_fit_beside_it_is_accepted(tmp_path):
    text = (ROOT / "runs" / "klein.toml").read_text() + '\n[fit.free]\n"contacts.delay" = 1\n'
    (tmp_path / "fit.toml").write_text(text)
    (tmp_path / "a.txt").write_text("time_s\tforce_uN\n" + ROWS)
    tree = mesoslip.read_trace(tmp_path / "a.txt", config=tmp_path / "fit.toml")
    assert mesoslip.Config.from_toml(tree.attrs["configuration"]).spring_stiffness == 97.0


@pytest.mark.parametrize(("name", "words"), [("revs", "revolutions"), ("slip um", "slider disp")])
def test_missing_numbers_of_any_quantity_are_reported(tmp_path, name, words):
    rows = [f"{n},{n % 3},{'' if n == 4 else n}\n" for n in range(9)]
    record = record_of(tmp_path / "a.csv", f"time [s],force [N],{name}\n" + "".join(rows))
    assert any(
        one.startswith(words) and one.endswith("missing in 1 samples") for one in record.report
    )


def test_units_have_a_row_with_a_form_of_time_stamps(tmp_path):
    """A preamble, names above units, decimal commas, European dates, a temperature."""
    rows = [f"03.04.2026 14:05:0{n},5;{n},25;{3 * n},0;23,4\n" for n in range(9)]
    names = "Bench 3;12\n\nDate time;Force;Load point;Temp\n"
    text = names + "dd.mm.yyyy hh:mm:ss;mN;µm;°C\n" + "".join(rows)
    record = record_of(tmp_path / "a.csv", text)
    np.testing.assert_allclose(record.time, np.arange(9))
    np.testing.assert_allclose(record.force, 1e-3 * (np.arange(9) + 0.25))
    np.testing.assert_allclose(record.load_point, 3e-6 * np.arange(9))


def test_time_stamps_of_twelve_hours_pass_noon_and_midnight(tmp_path):
    stamps = ("11:59:58.5 AM", "11:59:59.5 AM", "12:00:00.5 PM", "12:00:01.5PM", "1:00:00.5 pm")
    rows = [f"{one}|{n}.5\n" for n, one in enumerate(stamps)]
    record = record_of(tmp_path / "a.txt", "Time|Force [N]\n" + "".join(rows))
    np.testing.assert_allclose(record.time, [0, 1, 2, 3, 3602])
    stamps = ("11:59:58 PM", "11:59:59 PM", "12:00:00 AM", "12:00:01 AM")
    rows = [f"{one}|{n}.5\n" for n, one in enumerate(stamps)]
    record = record_of(tmp_path / "a.txt", "Time|Force [N]\n" + "".join(rows))
    np.testing.assert_allclose(record.time, np.arange(4))


def ordered(time, force=None, **options):
    time = np.asarray(time, dtype=float)
    force = np.arange(len(time)) * 1.0 if force is None else np.asarray(force, dtype=float)
    lines = np.arange(2, len(time) + 2)
    found = in_order("a.txt", time, force[np.newaxis], lines, options.get("part"), "line")
    return found.time, force[found.rows], " ".join(found.notes)


def test_blocks_written_twice_are_used_once():
    time = [0, 1, 2, 3, 2, 3, 4, 5]
    found, force, notes = ordered(time, time)
    np.testing.assert_array_equal(found, np.arange(6))
    np.testing.assert_array_equal(force, np.arange(6))
    assert "2 lines written twice, used once: line 6, 7" in notes


def test_rows_of_a_clock_that_starts_again_are_no_repeats():
    """Coarse values are equal to earlier ones by chance."""
    time = np.r_[0:100, 0:120]
    force = np.random.default_rng(1).integers(0, 3, time.size)
    found, values, notes = ordered(time, force)
    np.testing.assert_array_equal(found, np.arange(120))
    np.testing.assert_array_equal(values, force[100:])
    assert "written twice" not in notes
    assert "2 parts" in notes


def test_a_late_block_goes_where_it_belongs():
    time = np.r_[0:10, 20:30, 10:20, 30:40]
    found, force, notes = ordered(time, time)
    np.testing.assert_array_equal(found, np.arange(40))
    np.testing.assert_array_equal(force, np.arange(40))
    assert "put in order" in notes


def test_all_columns_of_a_late_block_go_where_it_belongs(tmp_path):
    order = np.r_[0:10, 20:30, 10:20, 30:40]
    rows = [f"{0.1 * n:.1f}\t{n + 0.25}\t{2 * n}\n" for n in order]
    record = record_of(tmp_path / "a.txt", "time_s\tforce_N\tload_point_um\n" + "".join(rows))
    np.testing.assert_allclose(record.time, 0.1 * np.arange(40))
    np.testing.assert_array_equal(record.force, np.arange(40) + 0.25)
    np.testing.assert_allclose(record.load_point, 2e-6 * np.arange(40))


def test_one_time_out_of_order_is_left_out():
    found, _, notes = ordered([0, 1, 2, 900, 3, 4, 5, 6, 7])
    np.testing.assert_array_equal(found, np.arange(8))
    assert "line 5: the time is out of order, left out" in notes


def test_a_clock_that_starts_again_makes_parts():
    time = np.r_[0:10, 0:20] * 0.1
    _, force, notes = ordered(time)
    np.testing.assert_array_equal(force, np.arange(10, 30))
    assert "part 2 is used" in notes
    assert len(ordered(time, part=1)[0]) == 10
    with pytest.raises(mesoslip.FileError, match="there is no part 3"):
        ordered(time, part=3)
    with pytest.raises(mesoslip.FileError, match="has 1 part; there is no part 2"):
        ordered(np.arange(9.0), part=2)


def test_rounded_times_are_spread():
    found, _, notes = ordered(np.floor(np.arange(400) / 4) * 1e-3)
    np.testing.assert_allclose(found, np.arange(400) * 0.25e-3, atol=1e-12)
    assert "guess: times are rounded to 1 ms" in notes


def test_named_columns_need_no_unit_beside_their_name(tmp_path):
    """As those that are found: seconds are a guess. A factor may be a number, and a column that
    never changes is no load point."""
    rows = "".join(f"{0.1 * n:.1f},{0.5 + 0.01 * (n % 7):.2f},3\n" for n in range(40))
    (tmp_path / "a.csv").write_text("Time / s,DAQ.COF,x [mm]\n" + rows)
    (tmp_path / "b.csv").write_text("t,DAQ.COF,x [mm]\n" + rows)
    column = '{ column = "DAQ.COF", factor = 1 }'
    for name, time in (("a", "Time"), ("b", "t")):
        text = f'file = "{name}.csv"\ncolumns = {{ time = "{time}", friction = {column} }}\n'
        (tmp_path / "run.toml").write_text("[trace]\n" + text)
        record = understand(tmp_path / "run.toml").record
        np.testing.assert_allclose(record.time, 0.1 * np.arange(40))
        assert record.force.max() == pytest.approx(0.56)
        assert record.load_point is None
        report = "\n".join(record.report)
        assert ("guess: 't' has no unit: taken as seconds" in report) == (name == "b")
        assert "'x [mm]' (constant" in report


def test_many_rates_are_one_line(tmp_path, command):
    """Of rates, and of noise; each rate only when asked for, and in the file."""
    steps = np.repeat([0.01, *np.tile([0.1, 0.01], 4)], 50)
    time = np.concatenate([[0], np.cumsum(steps)])
    rng = np.random.default_rng(5)
    force = 1 + 0.01 * rng.standard_normal(time.size)
    (tmp_path / "a.csv").write_text(
        "time_s,force_N\n" + "".join(f"{t:.2f},{f:.5f}\n" for t, f in zip(time, force, strict=True))
    )
    (line,) = sampling_summary(time)
    assert line == (
        "samples: 451 from 0 s to 22.5 s, unevenly, at 10 to 100 Hz (median 100), 0 gaps; "
        "nothing is filled in"
    )
    assert len(sampling_report(time)) == 9
    short, long = (
        command("trace", tmp_path / "a.csv", "--dry-run", *options)[1]
        for options in ((), ("--verbose",))
    )
    assert (short.count("samples: "), long.count("samples: ")) == (1, 9)


def test_rates_and_gaps_are_reported():
    time = np.concatenate([np.arange(0, 50, 0.1), np.arange(50, 60, 0.01), np.arange(62, 70, 0.01)])
    lines = sampling_report(time)
    assert lines[0] == "samples: 10 Hz from 0 s to 50 s (501)"
    assert lines[1].startswith("samples: 100 Hz from 50 s to 69.99 s")
    assert lines[2] == "gaps: 2.01 s after 59.99 s; nothing is filled in"


def test_a_million_times_in_disorder_are_refused():
    time = np.random.default_rng(1).uniform(size=10_000)
    with pytest.raises(mesoslip.FileError, match="is it the column of the time"):
        ordered(time)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,force_N\n0,001,1,2\n0,002,1,3\n", "another delimiter is needed in the file"),
        ("time_s\tforce_N\n1,500\t2\n2,500\t3\n", "give --decimal ','"),
        ("time_s;force_N\n0,5;1.5\n0,6;1.7\n0,7;1.8\n", "column"),
        ("time_s\tforce_N\n0.1\t5\n0.2\t7x\n0.3\t5\n0.4\t6\n0.5\t6\n", "line 3: column 'force_N'"),
        ("time_s\tforce_N\n0.1\t5\n0.2\t1e999\n0.3\t5\n0.4\t6\n0.5\t6\n", "is too large"),
        ("a b\n1 2 3\n2 3 4\n", "line 1: 'a b' is no header of the 3 columns"),
        ("time_s\tforce\n" + ROWS, "column 'force' has no unit"),
        ("time_s\tforce_N\tForce [mN]\n" + ROWS.replace("\n", "\t1\n"), "two columns of force"),
        ("stopped\nnothing here\n", "no columns of numbers"),
    ],
)
def test_what_is_not_clear_is_one_message(tmp_path, text, said):
    message = refusal(tmp_path / "a.txt", text)
    assert said in message
    assert "\n" not in message


def test_guesses_are_reported(tmp_path):
    record = record_of(tmp_path / "a.txt", "time\tF/N\n" + ROWS)
    report = "\n".join(record.report)
    assert "guess: 'time' has no unit: taken as seconds" in report
    assert "guess: 'F/N' taken as" in report
    record = record_of(tmp_path / "a.txt", "time_s\tforce [g]\n" + ROWS)
    assert "taken as a weight" in "\n".join(record.report)
    record = record_of(tmp_path / "a.txt", "time_s\tforce_N\tPump\n" + ROWS.replace("\n", "\t1\n"))
    assert "not used: column 3 'Pump'" in record.report


def test_a_displacement_is_the_slider_s_if_it_moves_in_slips(tmp_path):
    saw = np.arange(200) % 20
    slider = (np.arange(200) - saw) * 1.0
    for values, name in ((slider, "displacement"), (np.arange(200.0), "load_point")):
        rows = zip(np.arange(200) * 0.01, saw, values, strict=True)
        text = "time_s\tforce_N\tdisp_um\n" + "".join(f"{t:.2f}\t{f}\t{x}\n" for t, f, x in rows)
        record = record_of(tmp_path / "a.txt", text)
        np.testing.assert_allclose(getattr(record, name), 1e-6 * values)
        assert "taken as the displacement" in "\n".join(record.report)


def test_matlab_structures_and_hdf5_units(tmp_path):
    time, force = np.arange(50) * 0.01, np.sin(np.arange(50))
    savemat(tmp_path / "a.mat", {"run": {"time_ms": 1e3 * time, "force_mN": force}, "fs": 100.0})
    record = understand(tmp_path / "a.mat").record
    np.testing.assert_allclose(record.time, time)
    np.testing.assert_allclose(record.force, 1e-3 * force)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/time"], file["run/ch1"] = time, (force * 1000).astype("i2")
        file["run/time"].attrs["units"] = "seconds since 2020-01-01"
        file["run/ch1"].attrs.update(
            {"units": "mN", "scale_factor": 1e-3, "long_name": "shear force", "_FillValue": 0}
        )
        file["other"] = h5py.ExternalLink("secret.h5", "/time")
    record = understand(tmp_path / "a.h5").record
    assert len(record.time) == 49
    np.testing.assert_allclose(record.force, 1e-3 * force[1:], atol=1e-6)


def test_what_lies_in_other_files_is_not_read(tmp_path):
    (tmp_path / "secret").write_bytes(np.arange(50.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force_N"] = np.arange(50.0)
        outside = [(str(tmp_path / "secret"), 0, 400)]
        file.create_dataset("time_s", (50,), "f8", external=outside)
    with pytest.raises(mesoslip.FileError, match="time_s has its data in another file"):
        understand(tmp_path / "a.h5")
    np.savez(tmp_path / "a.npz", time_s=np.array([{}], dtype=object))
    with pytest.raises(mesoslip.FileError, match="damaged file of NumPy"):
        understand(tmp_path / "a.npz")


def test_a_compressed_file_that_is_cut_is_refused(tmp_path):
    data = gzip.compress(("time_s\tforce_N\n" + ROWS).encode())
    (tmp_path / "a.txt.gz").write_bytes(data[:-20])
    with pytest.raises(mesoslip.FileError, match="cut short"):
        understand(tmp_path / "a.txt.gz")
