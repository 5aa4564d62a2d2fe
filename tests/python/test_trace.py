"""Measured traces: read from tables, and the slips found in them against the exact catalogue."""

import functools
import json
import re

import mesoslip
import numpy as np
import pytest
from conftest import ROOT, klein_tables, long
from mesoslip.analysis.noise import noise_level
from mesoslip.analysis.sampled_slips import estimated_period, find_slips
from mesoslip.configuration.columns import Quantity, cells_of, find_columns, values_of

HIDDEN = {
    "slider__stiffness": 140.0,
    "contacts__static_force": 25e-6,
    "contacts__delay": 1.3e-3,
    "contacts__threshold__relative_width": 0.04,
}
CASES = {
    "Klein": {},
    "long delay": HIDDEN,
    "wide thresholds": {"contacts__threshold__relative_width": 0.1},
    "no delay": {"contacts__delay": 0.0},
    "stiff": {"slider__stiffness": 2000.0, "contacts__delay": 0.0, "run__duration": 2.0},
}
SINE = "time [s],force [uN]\n" + "".join(
    f"{0.001 * n:.3f},{5 + np.sin(0.01 * n):.5f}\n" for n in range(50)
)


@functools.cache
def run_of(case):
    """The run of a case."""
    return mesoslip.run(klein_tables(**CASES[case]))


def sampled(tree, noise: float, seed: int = 1):
    """Times and noisy forces of a run's first realization."""
    force = tree["spring_force"].values[0]
    rng = np.random.default_rng(seed)
    return tree["time"].values, force + noise * rng.standard_normal(force.size)


def missed(tree, slips):
    """Greatest second difference of the force about its least sample in each slip."""
    time, force = tree["time"].values, tree["spring_force"].values[0]
    found = []
    for start, end in zip(slips["start_time"].values, slips["end_time"].values, strict=True):
        first, after = np.searchsorted(time, (start, end + time[1]))
        least = first + int(np.argmin(force[first:after]))
        found.append(np.max(np.abs(np.diff(force[least - 2 : least + 3], 2))))
    return np.array(found)


def write(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("case", "relative_noise"),
    [(case, noise) for case in CASES for noise in (1e-3, 0.015)]
    + [("Klein", 0.0), *(long(case, 0.0) for case in CASES if case != "Klein")]
    + [("Klein", 5e-3), *(long(case, 5e-3) for case in CASES if case != "Klein")],
)
def test_slips_of_noisy_traces_are_those_of_the_exact_catalogue(case, relative_noise):
    """Found, missed, spurious; times within a quarter of a period, drops within some noise."""
    config = mesoslip.Config.from_dict(klein_tables(**CASES[case]))
    tree = run_of(case)
    exact = mesoslip.slips(tree)
    noise = relative_noise * config.contacts.static_force
    time, force = sampled(tree, noise)
    found = find_slips(time, force)
    # Of the same slip if they overlap.
    overlap = (found.start_time[:, None] < exact["end_time"].values) & (
        found.end_time[:, None] > exact["start_time"].values
    )
    drop = exact["force_drop"].values
    visible = drop > 12 * noise
    assert overlap.any(axis=0)[visible].all()
    assert overlap.any(axis=1).all()
    assert (overlap.sum(axis=1) == 1).all()
    which = overlap.argmax(axis=1)
    period = 2 * config.slider.quiet_time
    late = found.start_time - exact["start_time"].values[which]
    assert np.median(np.abs(late)) < period / 4 + 1e-3 + 4 * relative_noise
    error = found.force_before - found.force_after - drop[which]
    # Samples miss a smooth least force by up to an eighth of the second difference there. Five in a
    # period of the stiff setup do not tell it.
    if case == "stiff":
        sampling = 0.15 * np.abs(drop[which])
    else:
        sampling = 0.02e-6 + missed(tree, exact.isel(slip=which)) / 8
    assert (np.abs(error) < 4 * noise + sampling).all()


@pytest.mark.parametrize("noise", [1e-8, 1e-7, 1e-6])
def test_the_level_of_the_noise_is_found(noise):
    tree = mesoslip.run(klein_tables(**HIDDEN))
    assert noise_level(sampled(tree, noise)[1]) == pytest.approx(noise, rel=0.05)


def test_the_noise_of_a_digitized_trace_is_at_least_that_of_its_steps():
    force = np.round(np.linspace(0, 1, 3000), 2)
    assert noise_level(force) == pytest.approx(0.01 / np.sqrt(12), rel=0.3)


def test_the_period_of_the_setup_is_guessed():
    for case, changes in CASES.items():
        config = mesoslip.Config.from_dict(klein_tables(**changes))
        time, force = sampled(run_of(case), 2e-8)
        guessed = estimated_period(time, force, 2e-8)
        assert guessed == pytest.approx(2 * config.slider.quiet_time, rel=0.15)


def test_noise_alone_has_no_slips():
    rng = np.random.default_rng(2)
    time = 1e-3 * np.arange(200_000)
    assert len(find_slips(time, 1e-5 + 1e-7 * rng.standard_normal(time.size))) == 0
    loading = 1e-6 * time + 1e-7 * rng.standard_normal(time.size)
    assert len(find_slips(time, loading, period=0.02)) == 0


def test_ringing_is_no_slip():
    time = 1e-3 * np.arange(4000)
    ringing = 1e-5 + 2e-6 * np.exp(-time) * np.cos(2 * np.pi * time / 0.0245)
    assert len(find_slips(time, ringing, noise=0.0, period=0.0245)) == 0


def test_the_other_direction_is_the_same():
    time, force = sampled(mesoslip.run(klein_tables(**HIDDEN)), 5e-8)
    forward = find_slips(time, force)
    backward = find_slips(time, -force, direction=-1)
    np.testing.assert_array_equal(forward.start_time, backward.start_time)
    np.testing.assert_allclose(forward.force_before, -backward.force_before)


@pytest.mark.usefixtures("quick_pictures")
def test_a_table_becomes_an_output(tmp_path, command):
    """On which commands work like on that of a run."""
    run = mesoslip.run(klein_tables(**HIDDEN))
    time, force = sampled(run, 5e-8)
    table, output = tmp_path / "trace.csv", tmp_path / "trace.nc"
    rows = "".join(f"{t:.4f};{1e6 * f:.4f}\n" for t, f in zip(time, force, strict=True))
    write(table, "# made up\ntime [s];Force (uN)\n" + rows.replace(".", ","))
    known = ("--velocity", "0.1 um/s", "--stiffness", "140 N/m")
    printed = command.messages("trace", table, "-o", output, *known)
    assert "7 slips" in printed
    tree = mesoslip.open_output(output)
    np.testing.assert_allclose(tree["spring_force"].values[0], force, atol=1e-10)
    # Displacements follow from the spring, which sticks to the run's but for noise over stiffness.
    error = tree["displacement"].values[0] - run["displacement"].values[0]
    assert np.std(error) < 2 * 5e-8 / 140
    assert abs(np.mean(error)) < 3 * 5e-8 / 140
    np.testing.assert_allclose(
        mesoslip.slips(tree)["peak_velocity"], mesoslip.slips(run)["peak_velocity"], rtol=0.15
    )
    shown = command.output("slips", output, "--json")
    assert json.loads(shown)["slips"][0]["contacts_broken"] is None
    assert command("slips", output)[0] == 0
    assert command("plot", output, "-o", tmp_path / "trace.png")[0] == 0
    bare = mesoslip.read_trace(table)
    assert not {"displacement", "velocity", "contact_force"} & bare.data_vars.keys()
    assert mesoslip.slips(bare).sizes["slip"] == 7
    mesoslip.plot(bare, tmp_path / "bare.png")
    both = mesoslip.plot([bare, tree])
    assert len(both.axes) == 2
    with pytest.raises(mesoslip.FileError, match="has no displacement"):
        mesoslip.plot(bare, x="displacement")


def test_the_noise_of_a_trace_is_estimated_or_given(tmp_path):
    """Impulses are no motion. If the noise is given, they are kept, and slips are above it."""
    run = mesoslip.run(klein_tables(**HIDDEN))
    time, force = sampled(run, 1e-7)
    force[1000] += 5e-6

    def trace(**options):
        rows = "".join(f"{t:.4f},{1e6 * f:.4f}\n" for t, f in zip(time, force, strict=True))
        table = write(tmp_path / "trace.csv", f"time [s],force [uN]\n{rows}")
        return mesoslip.read_trace(table, velocity="0.1 um/s", stiffness="140 N/m", **options)

    tree = trace()
    assert tree.attrs["noise"] == pytest.approx(1e-7, rel=0.05)
    assert tree["noise"]["deviation"].item() == tree.attrs["noise"]
    assert tree["noise"]["impulse_time"].values == pytest.approx([time[1000]])
    few, more = (trace(noise=f"{size} uN") for size in (0.2, 0.4))
    assert few.attrs["noise"] == pytest.approx(2e-7)
    assert "noise" not in few.children
    assert tree.attrs["min_fall"] < few.attrs["min_fall"] < more.attrs["min_fall"]
    # The impulse would be a stretch of the spring within some samples.
    around = slice(990, 1010)
    speed, wrong = (np.abs(one["velocity"].values[0, around]).max() for one in (tree, few))
    assert speed < 0.3 * wrong


def test_with_a_configuration_it_is_an_output_of_that(tmp_path):
    table = write(tmp_path / "trace.csv", SINE)
    tree = mesoslip.read_trace(table, config=ROOT / "runs" / "klein.toml")
    config = mesoslip.Config.from_toml(tree.attrs["configuration"])
    assert config.run.duration == pytest.approx(0.049)
    assert config.output.interval == pytest.approx(1e-3)
    drive = tree["drive_displacement"].values[0]
    np.testing.assert_allclose(np.diff(drive), 1e-10, rtol=1e-6)
    assert tree["displacement"].values[0, 0] == 0


@pytest.mark.usefixtures("quick_pictures")
def test_analyses_of_a_trace_with_and_without_configuration(tmp_path, command):
    run = mesoslip.run(klein_tables(run__duration=6.0))
    lines = zip(run["time"].values, 1e6 * run["spring_force"].values[0], strict=True)
    rows = "".join(f"{time:.6f},{force:.6f}\n" for time, force in lines)
    table = write(tmp_path / "trace.csv", f"time [s],force [uN]\n{rows}")
    tree = mesoslip.read_trace(table, config=klein_tables(run__duration=6.0))
    judged, exact = mesoslip.regime(tree), mesoslip.regime(run)
    assert judged["regime"].item() == exact["regime"].item()
    assert judged["slips"].item() == exact["slips"].item()
    measured, known = (mesoslip.response(one)["steady"]["steady_force"] for one in (tree, run))
    np.testing.assert_allclose(measured, known, rtol=0.02)
    mesoslip.report(tree, tmp_path / "trace.html")
    page = (tmp_path / "trace.html").read_text()
    assert "Regime" in page
    assert "Energy" not in page
    bare = tmp_path / "bare.nc"
    assert command("trace", table, "-o", bare)[0] == 0
    assert mesoslip.regime(bare)["regime"].item() == exact["regime"].item()
    message = command.refusal("response", bare)
    assert re.search(r"\bbare\.nc: neither the load point nor its velocity is known", message)


def test_the_drive_of_a_trace_follows_ramps(tmp_path):
    """Against the quadrature of the velocity; after its stages it goes on."""
    stages = [
        {"duration": 0.01, "velocity": 1e-7},
        {"duration": 0.02, "start_velocity": 1e-7, "end_velocity": 5e-7},
    ]
    tables = klein_tables(run__duration=None, drive={"stage": stages})
    tree = mesoslip.read_trace(write(tmp_path / "trace.csv", SINE), config=tables)
    time = tree["time"].values
    velocity = np.interp(time, [0.01, 0.03], [1e-7, 5e-7])
    way = np.concatenate([[0], np.cumsum(0.5 * np.diff(time) * (velocity[1:] + velocity[:-1]))])
    drive = tree["drive_displacement"].values[0]
    np.testing.assert_allclose(drive - drive[0], way, rtol=1e-9, atol=1e-16)


def test_rates_and_columns(tmp_path):
    plain = write(tmp_path / "plain.txt", "1 9 2\n2 9 3\n3 9 4\n4 9 5\n5 9 6\n")
    tree = mesoslip.read_trace(plain, columns="force [mN], -, displacement [nm]", rate=1e3)
    np.testing.assert_allclose(tree["time"], [0, 1e-3, 2e-3, 3e-3, 4e-3])
    np.testing.assert_allclose(tree["spring_force"].values[0], [1e-3, 2e-3, 3e-3, 4e-3, 5e-3])
    np.testing.assert_allclose(tree["displacement"].values[0], [2e-9, 3e-9, 4e-9, 5e-9, 6e-9])


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (SINE.replace("force [uN]", "channel [uN]"), [], "no column of the force"),
        (SINE.replace("force [uN]", "force [uM]"), [], "unit 'uM'"),
        (SINE.replace("force [uN]", "force"), [], "has no unit"),
        (SINE.replace("time [s]", "clock"), [], "--rate"),
        (SINE.replace("time [s]", "force [nN]"), [], "two columns of force"),
        (
            SINE.replace("0.010,", "0.0x0,"),
            [],
            "line 12: column 'time [s]': the time, '0.0x0', is not",
        ),
        ("", [], "is empty"),
        ("1,2\n2,3\n", [], "line 1: has no header"),
        ("time [s],force [N]\n0,1\n", [], "1 samples"),
        (SINE, ["--columns", "force [N]"], "names 1 columns, the file has 2"),
        (SINE, ["--stiffness", "3 kg"], "--stiffness"),
        (SINE, ["--noise", "-1 uN"], "--noise = '-1 uN': must be at least 0"),
        (SINE, ["--config", "no.toml"], "no such file"),
    ],
)
def test_what_is_wrong_is_reported_with_the_line(tmp_path, command, text, options, said):
    table = write(tmp_path / "trace.csv", text)
    printed = command.refusal("trace", table, "-o", tmp_path / "out.nc", *options)
    assert said in printed
    assert not (tmp_path / "out.nc").exists()


def test_what_is_no_table_is_reported(tmp_path, command):
    assert "no such file" in command("trace", tmp_path / "none.csv", "-o", tmp_path / "a.nc")[2]
    assert "directory" in command("trace", tmp_path, "-o", tmp_path / "a.nc")[2]
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    assert (
        "no columns of numbers"
        in command("trace", tmp_path / "binary.csv", "-o", tmp_path / "a.nc")[2]
    )


def test_a_cell_that_counts_the_other_way(tmp_path, klein, command):
    """The same slips with the sign of the drive; a word where they do not go together."""
    run = mesoslip.run(klein(run__duration=4.0)).to_dataset()
    time, force = run["time"].values, run["spring_force"].values[0]
    table = tmp_path / "force.csv"
    found = {}
    for sign in (1, -1):
        rows = zip(time, sign * force * 1e6, strict=True)
        table.write_text("time [s],force [uN]\n" + "".join(f"{t:.6f},{f:.5f}\n" for t, f in rows))
        for velocity in (1, -1):
            tree = mesoslip.read_trace(table, velocity=velocity * 1e-7)
            comment = tree.attrs.get("comment", "")
            found[sign, velocity] = tree["slips"]["start_time"].values, comment
    assert len(found[1, 1][0]) >= 2
    np.testing.assert_array_equal(found[1, 1][0], found[-1, -1][0])
    assert found[1, 1][1] == found[-1, -1][1] == ""
    for pair in ((1, -1), (-1, 1)):
        assert "against the drive most of the time" in found[pair][1]
    table.write_text("time [s],force [uN]\n" + "".join(f"{t},1\n" for t in range(100)))
    printed = command("trace", table, "-o", tmp_path / "flat.nc")[2]
    assert "no slips stand out of the noise" in printed
    assert "inf" not in printed
    # A rate beside times thins them, here to no fewer.
    tree = mesoslip.read_trace(table, rate=100.0)
    assert tree.sizes["time"] == 100
    assert "not thinned: recorded at 1 Hz" in tree.attrs["understood"]


# Rows of which the numbers can be read in two ways, or are written otherwise than with 0 to 9.
AMBIGUOUS = [
    (",", "1,5,08", "line 3: has 3 cells under 2 headers"),
    (",", "1_50,2", "the time, '1_50', is not a number"),
    (",", "١,2", "the time, '١', is not a number"),
    (",", "0x1p3,2", "is not a number"),
    ("\t", "1,500\t2", "'1,500' may be 1.500 or 1500; give --decimal ','"),
    ("\t", "1,500,000\t2", "write 1500000 if its commas group digits"),
    (";", "1,500;2", "'1,500' may be 1.500 or 1500; give --decimal ','"),
    (";", "1,5;2.5", "write 1.5 if its comma is a decimal one"),
    (",", "5" * 200_000 + "x,2", "is not a number"),
    (",", '"' + "5" * 200_000 + 'x",2', "larger than field limit"),
    (",", '"1,2', "line 3: cannot be read"),
]


@pytest.mark.parametrize(("delimiter", "row", "wanted"), AMBIGUOUS)
def test_numbers_are_read_in_one_way(tmp_path, command, delimiter, row, wanted):
    table = tmp_path / "table.csv"
    table.write_text(f"time [ms]{delimiter}force [uN]\n0{delimiter}1\n{row}\n", encoding="utf-8")
    errors = command.refusal("trace", table, "-o", tmp_path / "out.nc")
    assert wanted in errors
    assert len(errors) < 600


def test_a_minus_sign_is_a_hyphen(tmp_path):
    table = tmp_path / "table.csv"
    rows = [f"{number},{-number - 1}\n" for number in range(40)]
    texts = ["time [s],force [uN]\n" + "".join(rows), "".join(rows).replace("-", "\u2212")]
    table.write_text(texts[0])
    usual = mesoslip.read_trace(table, velocity="-1 um/s")["spring_force"].values
    table.write_text("time [s],force [uN]\n" + texts[1], encoding="utf-8")
    found = mesoslip.read_trace(table, velocity="-1 um/s")["spring_force"].values
    np.testing.assert_array_equal(found, usual)


def test_decimal_commas_that_can_be_nothing_else():
    known = {name: Quantity(name, si, "") for name, si in (("time", "s"), ("force", "N"))}
    cells = cells_of("time [ms];force [uN]\n0,5;1,500\n2;-3,25\n", "table")
    places = find_columns(cells.first, known, "table")
    assert values_of(cells, cells.first, places)["force"] == pytest.approx([1.5e-6, -3.25e-6])
