"""Records that go back and forth: strokes, and slips between reversals."""

import json
import math

import mesoslip
import numpy as np
import pytest
import tomli_w
import xarray as xr
from conftest import long
from mesoslip.analysis.strokes.catalogue import strokes_of
from mesoslip.analysis.strokes.cycles import overall
from mesoslip.analysis.strokes.friction_map import friction_map
from mesoslip.analysis.strokes.measure import Measured
from mesoslip.analysis.strokes.revolutions import found_period
from mesoslip.analysis.strokes.segments import monotone_pieces, pieces_of_force, record_pieces
from mesoslip.analysis.strokes.sliding import sliding_of
from mesoslip.analysis.strokes.slips import find_slips_between_reversals
from mesoslip.reports.content import Subject
from mesoslip.reports.sections.catalogues import strokes as report_section
from numpy.typing import NDArray
from stroke_records import made

Array = NDArray[np.float64]

# Cycles, samples of each, and the phases at which the drive turns [cycles].
CYCLES, SAMPLES = 6.4, 400
TURNS = np.arange(0.25, CYCLES, 0.5)


def phases() -> Array:
    """Phase of each sample of a record [cycles]."""
    return np.arange(round(CYCLES * SAMPLES)) / SAMPLES


def drive(shape: str, phase: Array) -> Array:
    """A drive between -1 and 1, from 0 on, that turns at `TURNS`."""
    sine = np.sin(2 * np.pi * phase)
    triangle = 2 / np.pi * np.arcsin(sine)
    return {
        "sine": sine,
        "triangle": triangle,
        "trapezoid": np.clip(1.25 * triangle, -1, 1),
    }[shape]


def elastic_sliding(x: Array, stiffness: float = 20.0) -> Array:
    """Force of a spring with a Coulomb slider of strength 1."""
    force, rows = 0.0, []
    for step in np.diff(x, prepend=x[0]):
        force = min(max(force + stiffness * step, -1.0), 1.0)
        rows.append(force)
    return np.array(rows)


def stick_slip(x: Array, stiffness: float = 8.0, drop: float = 0.4) -> Array:
    """Force of a spring with a slider that slips when it reaches 1 in either direction."""
    force, rows = 0.0, []
    for step in np.diff(x, prepend=x[0]):
        force += stiffness * step
        if abs(force) > 1:
            force -= np.sign(force) * drop
        rows.append(force)
    return np.array(rows)


@pytest.mark.parametrize("shape", ["sine", "triangle", "trapezoid"])
def test_pieces_end_at_reversals(shape: str) -> None:
    """Also with noise, an offset, and missing samples; at a rest, in its middle."""
    rng = np.random.default_rng(1)
    phase = phases()
    x = 3.0 + drive(shape, phase)
    x += 0.002 * rng.standard_normal(x.size)
    x[rng.integers(0, x.size, 50)] = np.nan
    pieces = monotone_pieces(x)
    assert pieces is not None
    assert [one.direction for one in pieces] == [(-1) ** n for n in range(len(TURNS) + 1)]
    found = phase[[one.first for one in pieces[1:]]]
    np.testing.assert_allclose(found, TURNS, atol=0.02)


def test_an_approach_is_no_measure_of_strokes() -> None:
    """The first motion may be far longer than the strokes, and the drive may tremble."""
    phase = phases()
    approach = np.linspace(-80, 0, 300)
    x = np.concatenate([approach, drive("triangle", phase)])
    x += 0.01 * np.sin(2 * np.pi * 37.3 * np.arange(x.size) / SAMPLES)
    pieces = monotone_pieces(x)
    assert pieces is not None
    assert len(pieces) == len(TURNS) + 1


def test_one_direction_has_no_pieces() -> None:
    """Steps, holds, noise, digital steps and play of the drive are no reversals."""
    rng = np.random.default_rng(2)
    time = np.linspace(0, 10, 3000)
    steps = np.interp(time, [0, 2, 4, 7, 10], [0, 1, 1, 9, 10])
    for x in (
        steps,
        steps + 0.01 * rng.standard_normal(time.size),
        np.round(steps, 1),
        steps - 0.1 * np.clip(time - 5, 0, 0.1),
        np.zeros(time.size),
    ):
        assert monotone_pieces(x) is None


def test_strokes_from_the_sign_of_a_force() -> None:
    """The guess has the reversals; stick-slip in one direction, also about 0, is none."""
    rng = np.random.default_rng(3)
    phase = phases()
    force = elastic_sliding(drive("triangle", phase)) + 0.3
    force += 0.05 * rng.standard_normal(force.size)
    pieces = pieces_of_force(phase, force)
    assert pieces is not None
    np.testing.assert_allclose(phase[[one.first for one in pieces[1:]]], TURNS, atol=0.03)
    for one in (stick_slip(phase), stick_slip(phase, drop=1.9), force[:500]):
        assert pieces_of_force(phase, one) is None
    # The load point is known to move in one direction.
    assert record_pieces(phase, force, phase)[0] is None


@pytest.mark.parametrize(("shape", "sensor"), [("triangle", -1), ("trapezoid", 1), long("sine", 1)])
def test_reversals_are_no_slips(shape: str, sensor: int) -> None:
    """Every slip of stick-slip in strokes is found, and none without it."""
    rng = np.random.default_rng(4)
    phase = np.arange(round(CYCLES * 1600)) / 1600
    x = drive(shape, phase)
    pieces, name = record_pieces(phase, x, x)
    assert name == "load point"
    smooth = sensor * elastic_sliding(x) + 0.2 + 0.005 * rng.standard_normal(x.size)
    assert len(find_slips_between_reversals(pieces, phase, smooth)) == 0
    exact = stick_slip(x)
    noisy = sensor * exact + 0.2 + 0.005 * rng.standard_normal(x.size)
    found = find_slips_between_reversals(pieces, phase, noisy)
    falls = np.flatnonzero(np.abs(np.diff(exact)) > 0.2)
    # One may be lost before each reversal.
    assert falls.size - len(TURNS) <= len(found) <= falls.size
    near = [np.min(np.abs(phase[falls] - one)) for one in found.start_time]
    assert max(near) < 2.5e-3
    along = sensor * np.sign(np.interp(found.start_time, phase, np.gradient(x)))
    np.testing.assert_allclose(along * (found.force_before - 0.2), 1.0, atol=0.05)
    np.testing.assert_allclose(along * (found.force_after - 0.2), 0.6, atol=0.05)


def test_a_fall_over_reversals_is_no_period_of_the_setup() -> None:
    """The only fall that stands out, of Coulomb friction, is over many strokes."""
    time = np.arange(60_000) * 1e-3
    angle = 2 * np.pi * time / 7
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    force = 0.3 * np.sign(np.cos(angle)) + noise
    pieces, _ = record_pieces(time, force, None, 1e-4 * np.sin(angle))
    found = find_slips_between_reversals(pieces, time, force)
    assert len(found) == 0
    assert np.isinf(found.period)
    given = find_slips_between_reversals(pieces, time, force, period=0.1)
    assert given.period == 0.1


def test_sliding_parts_have_no_reversals() -> None:
    """Put one after the other, the sliding parts of friction in strokes are constant."""
    x = drive("sine", phases())
    pieces = monotone_pieces(x)
    assert pieces is not None
    sliding = sliding_of(elastic_sliding(x), pieces)
    assert sliding.samples.size > 0.7 * x.size
    whole = sliding.piece < len(pieces) - 1
    np.testing.assert_allclose(sliding.unfolded()[whole], 1.0, atol=1e-12)


@pytest.mark.parametrize("with_load_point", [True, False])
def test_a_reciprocating_file_is_smooth(tmp_path, with_load_point: bool) -> None:  # type: ignore[no-untyped-def]
    """Catalogue and regime of a measured trace without slips; the guess is reported."""
    rng = np.random.default_rng(6)
    time = 10 * phases()
    x = drive("triangle", phases())
    columns = [time, elastic_sliding(x) + 0.02 * rng.standard_normal(x.size)]
    columns += [x] if with_load_point else []
    file = tmp_path / "strokes.csv"
    header = "time [s],force [N]" + (",load point [mm]" if with_load_point else "")
    np.savetxt(file, np.transpose(columns), delimiter=",", header=header, comments="")
    tree = mesoslip.read_trace(file)
    assert mesoslip.slips(tree).sizes["slip"] == 0
    assert int(mesoslip.regime(tree)["regime"][0]) == 0
    guess = "" if with_load_point else "guess, by the sign of the force: "
    assert tree.attrs["comment"].startswith(f"{guess}goes back and forth, with 13 reversals")


def record_tree(time: Array, force: Array, **others: Array) -> xr.DataTree:
    """A measured record in memory."""
    variables = {"spring_force": force, **others}
    root = xr.Dataset(
        {name: (("realization", "time"), row[np.newaxis]) for name, row in variables.items()},
        {"time": time, "realization": [0]},
        {"origin": "measured", "configuration": ""},
    )
    return xr.DataTree(root)


def test_strokes_of_a_spring_and_coulomb_friction() -> None:
    """Closed forms: strength 1, K = 20, strokes of 2: loops of 4 - 4/K, a reversal of 2/K."""
    time = 10 * phases()
    x = drive("triangle", phases())
    force = elastic_sliding(x) + 0.3
    found = mesoslip.strokes(
        record_tree(time, force, drive_displacement=x, normal_force=np.full(x.size, 4.0))
    )
    assert found.attrs["source"] == "load point"
    strokes, cycles = found["strokes"], found["cycles"]
    np.testing.assert_allclose(strokes["start_time"], 10 * TURNS[:-1], atol=0.03)
    np.testing.assert_allclose(strokes["length"], 2, rtol=0.01)
    np.testing.assert_allclose(strokes["velocity"], 0.4, rtol=0.01)
    # The sensor's offset is in the mean of each direction, and not in the mean of a cycle.
    along = 1 + 0.3 * strokes["direction"]
    np.testing.assert_allclose(strokes["mean_friction"], along, rtol=1e-9)
    np.testing.assert_allclose(strokes["max_friction"], along, rtol=1e-9)
    np.testing.assert_allclose(strokes["mean_friction_coefficient"], along / 4, rtol=1e-9)
    np.testing.assert_allclose(strokes["stiffness"], 20, rtol=1e-6)
    np.testing.assert_allclose(cycles["mean_friction"], 1, rtol=1e-9)
    np.testing.assert_allclose(cycles["offset"], 0.3, rtol=1e-9)
    np.testing.assert_allclose(cycles["loop_energy"], 4 - 4 / 20, rtol=2e-3)
    np.testing.assert_allclose(cycles["stiffness"], 20, rtol=1e-6)
    assert (strokes["slides"] == 1).all()
    # The force on the specimen has the other sign.
    against = mesoslip.strokes(record_tree(time, -force, drive_displacement=x))
    np.testing.assert_allclose(against["cycles"]["mean_friction"], 1, rtol=1e-9)
    np.testing.assert_allclose(against["cycles"]["loop_energy"], cycles["loop_energy"])
    assert "against the motion" in against.attrs["notes"]
    # From the force alone, friction and offset are known.
    guess = mesoslip.strokes(record_tree(time, force))
    np.testing.assert_allclose(guess["cycles"]["mean_friction"], 1, rtol=1e-9)
    np.testing.assert_allclose(guess["cycles"]["offset"], 0.3, rtol=1e-9)
    assert not np.isfinite(guess["cycles"]["loop_energy"]).any()
    assert "guess" in guess.attrs["notes"]


def test_a_long_reversal_is_left_out() -> None:
    """Where it takes half of the stroke; with partial slip there is no sliding friction."""
    x = drive("triangle", phases())
    time = phases()
    found = mesoslip.strokes(record_tree(time, elastic_sliding(x, 2.1), drive_displacement=x))
    np.testing.assert_allclose(found["strokes"]["mean_friction"], 1, rtol=1e-6)
    elastic = mesoslip.strokes(record_tree(time, elastic_sliding(x, 0.9), drive_displacement=x))
    assert (elastic["strokes"]["slides"] == 0).all()
    np.testing.assert_allclose(elastic["cycles"]["mean_friction"], 0, atol=2e-3)
    np.testing.assert_allclose(elastic["cycles"]["loop_energy"], 0, atol=1e-9)
    assert "partial slip" in elastic.attrs["notes"]


def test_drift_and_running_in_over_cycles() -> None:
    """Friction that grows from cycle to cycle has a drift; a first decay is a running-in."""
    rng = np.random.default_rng(7)
    values = [
        Measured(1 + 0.5 * np.exp(-n / 2) + 0.001 * n + 0.01 * rng.standard_normal(), 0.01)
        for n in range(60)
    ]
    found = overall(values)
    assert found is not None
    assert 4 <= found.running_in <= 20
    assert found.drift == pytest.approx(0.001, abs=3 * found.drift_error)
    assert found.drift_error < 0.0003


@pytest.mark.parametrize("number", [70, 74, 100])
def test_made_records(number: int) -> None:
    """Friction, loop energy, offset and stiffness are within three errors of the truth.

    The study has two hundred, in which 95 % are within the stated errors.
    """
    record = made(number)
    others = {} if record.position is None else {"drive_displacement": record.position}
    found = strokes_of(record_tree(record.time, record.force, **others)).overall
    truth = {
        "mean_friction": record.friction,
        "loop_energy": record.loop_energy,
        "offset": record.offset,
        "stiffness": record.stiffness,
    }
    for name, value in truth.items():
        if np.isfinite(value):
            assert abs(found[name].mean - value) < 3 * found[name].error, name


def test_strokes_command(command, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """JSON, tables and messages; a cycled run has strokes too."""
    output, table = tmp_path / "out.nc", tmp_path / "strokes.tex"
    tables = {
        "run": {"engine": "eq"},
        "drive": {"cycle": {"amplitude": "1 um", "velocity": "1 um/s", "cycles": 3}},
        "slider": {"mass": "1 g", "stiffness": "2000 N/m", "damping_ratio": 1.0},
        "contacts": {
            "count": 100,
            "area": "1e-10 m^2",
            "film_thickness": "3.5 nm",
            "film_density": "956 kg/m^3",
            "static_force": "18 uN",
            "stiffness": "2000 N/m",
            "drag_rate": "2e11 1/s",
            "delay": "1 us",
            "threshold": {"law": "gaussian", "relative_width": 0.3},
        },
        "output": {"interval": "2 ms"},
    }
    config = tmp_path / "cycled.toml"
    config.write_text(tomli_w.dumps(tables))
    command("run", config, "-o", output, "--quiet")
    found = json.loads(command.output("strokes", output, "--json", "--table", table))
    assert [one["direction"] for one in found["strokes"]] == [-1, 1, -1, 1, -1]
    assert found["strokes"][0]["mean_friction_coefficient"] is None
    assert {"loop_energy", "offset", "stiffness"} <= found["cycles"][0].keys()
    # Spring and contacts in series.
    assert found["cycles"][0]["stiffness"] == pytest.approx(1000, rel=0.15)
    assert "booktabs" in table.read_text()
    mesoslip.write_table(mesoslip.strokes(output), tmp_path / "strokes.csv")
    assert "loop_energy [J]" in (tmp_path / "strokes.csv").read_text()
    assert "mean friction" in command("strokes", output, "--latex")[1]
    assert "Means over cycles" in command("strokes", output)[1]
    status, _, message = command("strokes", output, "--middle", "120 %")
    assert (status, "--middle" in message) == (2, True)


def test_one_direction_has_no_strokes() -> None:
    time = np.arange(100.0)
    with pytest.raises(mesoslip.FileError, match="the load point has no reversals"):
        mesoslip.strokes(record_tree(time, np.ones(100), drive_displacement=time))
    with pytest.raises(mesoslip.FileError, match="sign of the force"):
        mesoslip.strokes(record_tree(time, np.ones(100)))
    for name, wrong in (("middle", 80), ("middle", "all"), ("period", [0]), ("period", "long")):
        with pytest.raises(mesoslip.ConfigError, match=f"{name} = .* must be"):
            mesoslip.strokes(record_tree(time, np.ones(100)), **{name: wrong})
    for function, name in ((mesoslip.events, "catalogue"), (mesoslip.plateaus, "signal")):
        with pytest.raises(mesoslip.ConfigError, match=f"{name} = .* must be one of"):
            function(record_tree(time, np.ones(100)), **{name: np.zeros(2)})


def test_the_sign_of_a_column_of_friction_is_by_its_unit(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Friction in micronewtons is a force, a position that turns is the drive's."""
    x = drive("triangle", phases())
    columns = [10 * phases(), np.full(x.size, 4e6), x, -1e6 * elastic_sliding(x)]
    file = tmp_path / "rig.txt"
    header = "Time [s]\tNormal [uN]\tPosition [mm]\tFriction [uN]"
    np.savetxt(file, np.transpose(columns), delimiter="\t", header=header, comments="")
    tree = mesoslip.read_trace(file)
    assert {"spring_force", "normal_force", "drive_displacement"} <= set(tree.data_vars)
    assert "as it goes back and forth" in tree.attrs["understood"]
    found = mesoslip.strokes(tree)["cycles"]
    np.testing.assert_allclose(found["mean_friction_coefficient"], 0.25, rtol=1e-6)


def test_view_and_report_of_strokes() -> None:
    """The picture has loops, strokes and two maps; the page has the tables."""
    x = drive("sine", phases())
    tree = record_tree(phases(), elastic_sliding(x), drive_displacement=x)
    figure = mesoslip.plot(tree, view="strokes")
    panels = [one for one in figure.axes if one.get_label() != "<colorbar>"]
    assert len(panels) == 4
    # Every loop is closed about the same area.
    assert len(panels[0].lines) == 6
    maps = [one.collections[0].get_array() for one in panels[2:]]
    assert all(float(np.nanmax(one)) == pytest.approx(1.0) for one in maps)
    strokes = friction_map(strokes_of(tree).records[0], strokes_of(tree).strokes[0], 1)
    assert strokes.friction.shape[1] == 6
    section = report_section([Subject("made", tree)])
    assert section is not None
    assert section.title == "Strokes"
    assert report_section([Subject("made", record_tree(phases(), x + 2))]) is None


def test_revolutions_are_drawn_one_by_one() -> None:
    """Without a line from the end of a revolution back to the start of the next one."""
    time = np.arange(0, 12.2, 0.01)
    force = 2 + 0.5 * np.sin(2 * np.pi * 0.8 * time)
    figure = mesoslip.plot(record_tree(time, force, revolutions=0.8 * time), view="strokes")
    for line in figure.axes[0].lines:
        steps = np.diff(line.get_xdata())
        assert (steps[np.isfinite(steps)] >= 0).all()


def test_maxima_are_drawn_where_no_mean_is_known(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """In partial slip without a load point."""
    found, record = strokes_of_made(1151, tmp_path)
    tree = record_tree(record.time, record.force)
    axes = mesoslip.plot(tree, view="strokes").axes[1]
    assert axes.get_ylabel() == "maximum friction (mN)"
    drawn = sum(len(one.get_children()[0].get_xdata()) for one in axes.containers)
    assert drawn == len(found.columns["strokes"]["max_friction"])


def test_colours_of_a_map_are_those_of_sliding() -> None:
    """A reversal of a tenth of the stroke, beside friction that varies by 4 %."""
    x = np.sin(2 * np.pi * phases())
    force = elastic_sliding(x, 10.0) * (1 + 0.04 * x)
    figure = mesoslip.plot(record_tree(phases(), force, drive_displacement=x), view="strokes")
    low, high = figure.axes[2].collections[0].get_clim()
    assert 0.95 < low < high < 1.05


def test_revolutions_of_a_disc() -> None:
    """Means of friction that varies with the angle; the angle from a count, a speed or a period."""
    time = np.arange(0, 12.2, 0.01)
    force = 2 + 0.5 * np.sin(2 * np.pi * 0.8 * time) + 0.01 * time
    normal = np.full(time.size, 5.0)
    trees = [
        record_tree(time, force, normal_force=normal, revolutions=0.8 * time),
        record_tree(time, force, normal_force=normal, rotation_speed=np.full(time.size, 0.8)),
    ]
    for tree, period in [*((one, None) for one in trees), (record_tree(time, force), 1.25)]:
        found = mesoslip.strokes(tree, period=period)
        rows = found["strokes"]
        assert rows.sizes["stroke"] == 9
        middle = 0.5 * (rows["start_time"] + rows["end_time"])
        np.testing.assert_allclose(rows["mean_friction"], 2 + 0.01 * middle, atol=2e-3)
        assert "125 samples in each" in found.attrs["notes"]
        assert "means of rows" not in found.attrs["notes"]
    np.testing.assert_allclose(
        mesoslip.strokes(trees[0])["cycles"]["mean_friction_coefficient"], 0.4, atol=0.03
    )
    # A load cell that was set to zero again.
    shifted = np.where(time < 6, 5.0, 4.8)
    tree = record_tree(time, force, normal_force=shifted, revolutions=0.8 * time)
    notes = mesoslip.strokes(tree).attrs["notes"]
    assert "on average; means of rows are from 4.8 N to 5 N" in notes
    # A row is a stroke and a cycle.
    heads = [one.title for one in strokes_of(tree).tables]
    assert heads == ["Revolutions", "Means over rows"]
    # With a few samples in a revolution, rows are of several.
    slow = record_tree(time[::25], force[::25], revolutions=0.8 * time[::25])
    found = mesoslip.strokes(slow)
    assert "groups of 4 revolutions" in found.attrs["notes"]
    with pytest.raises(mesoslip.FileError, match="whole revolutions"):
        mesoslip.strokes(record_tree(time[::300], force[::300], revolutions=0.8 * time[::300]))
    # Of a gap there are no rows, nor of parts beside it; the force may be against the motion.
    kept = (time < 4.3) | (time > 8.1)
    found = mesoslip.strokes(record_tree(time[kept], -force[kept], revolutions=0.8 * time[kept]))
    rows = found["strokes"]
    assert rows.sizes["stroke"] == 5
    assert (rows["mean_friction"].values > 1.9).all()
    assert (rows["end_time"] - rows["start_time"]).values.max() < 1.3
    for period in (1e-30, 0.0199):
        with pytest.raises(mesoslip.FileError, match="shorter than two samples, 20 ms"):
            mesoslip.strokes(record_tree(time, force), period=period)


def test_falls_of_the_track_of_a_disc_are_no_slips(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Two waves in a revolution, at a speed that is recorded with an error of 1 %; slips between
    which the disc turns by any angle are slips."""
    rng = np.random.default_rng(5)
    time = np.arange(0, 200, 0.02)
    turn = math.tau * 1.99 * time
    waves = 2 + 0.1 * np.sin(turn + 1) + 0.3 * np.sin(2 * turn)
    saw = 2 - 0.3 * ((time / 0.7123) % 1 > 0.9) + 0.5 * ((time / 0.7123) % 1)
    for force, is_track in ((waves, True), (saw, False)):
        table = np.transpose([time, force + 0.05 * rng.standard_normal(time.size)])
        rows = "".join(f"{at:.2f},{one:.4f},{60 * 1.99 * 1.01:.2f}\n" for at, one in table)
        file = tmp_path / "disc.csv"
        file.write_text("time [s],force [N],rotation speed [rpm]\n" + rows)
        tree = mesoslip.read_trace(file)
        text = "falls keep the phase of the rotation, and are those of the track"
        assert (text in tree.attrs.get("comment", "")) == is_track
        assert (tree["slips"].sizes["slip"] == 0) == is_track
    assert mesoslip.read_trace(file, min_fall=0.3)["slips"].sizes["slip"] > 0
    # An angle that hardly turns, as of a plane that is tilted, keeps any phase.
    saw = 2 + 0.5 * np.interp((time / 1.3) % 1, [0, 0.8, 1], [0, 1, 0])
    table = np.transpose([time, saw + 0.01 * rng.standard_normal(time.size), 0.2 * time])
    header = "time [s],force [N],angle [deg]"
    np.savetxt(file, table, delimiter=",", header=header, comments="", fmt="%.4f")
    assert mesoslip.read_trace(file)["slips"].sizes["slip"] > 100


def test_a_file_of_a_disc(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A clock beside a time, forces without unit beside a coefficient, and revolutions."""
    rows = [f"16:10:{at:02d}\t{at}\t{0.5 * at}\t9,5\t0,{200 + at % 3}" for at in range(60)]
    header = "Time\tTest Time\tTOTAL REVOLUTIONS\tFriction Force\tFriction Coefficient"
    file = tmp_path / "disc.txt"
    file.write_text("\n".join([header, *rows]).replace(".", ","))
    tree = mesoslip.read_trace(file)
    assert {"friction_coefficient", "revolutions"} <= set(tree.data_vars)
    found = mesoslip.strokes(tree)
    np.testing.assert_allclose(found["cycles"]["mean_friction"], 0.201, atol=1e-3)


@pytest.mark.parametrize(("unit", "size"), [("deg", 360.0), ("rad", math.tau), ("rev", 1.0)])
def test_a_disc_that_turns_back_and_forth_has_strokes(tmp_path, unit, size) -> None:  # type: ignore[no-untyped-def]
    """Along the path at the radius, by an angle in any unit; without a radius by the force."""
    rng = np.random.default_rng(1)
    x = drive("triangle", phases())
    force = elastic_sliding(x) + 0.01 * rng.standard_normal(x.size)
    rows = np.transpose([phases(), 0.25 * size * x, force])
    file = tmp_path / "disc.csv"
    header = f"time [s],angle [{unit}],friction force [N]"
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    tree = mesoslip.read_trace(file, radius="20 mm")
    found = strokes_of(tree)
    lengths = found.columns["strokes"]["length"]
    np.testing.assert_allclose(lengths, 0.5 * math.tau * 0.02, rtol=1e-3)
    # The angle of 0.25 revolutions is the unit of the drive.
    unit_length = 0.25 * math.tau * 0.02
    stiffness = found.overall["stiffness"]
    assert stiffness.mean == pytest.approx(20 / unit_length, abs=4 * stiffness.error)
    # By the speed of rotation, whose sign changes.
    speed = np.gradient(0.25 * x, phases())
    header = "time [s],rotation speed [rev/s],friction force [N]"
    rows = np.transpose([phases(), speed, force])
    np.savetxt(tmp_path / "speed.csv", rows, delimiter=",", header=header, comments="")
    found = strokes_of(mesoslip.read_trace(tmp_path / "speed.csv", radius="20 mm"))
    np.testing.assert_allclose(found.columns["strokes"]["length"], lengths, rtol=0.01)
    guessed = mesoslip.read_trace(file)
    assert "strokes by it need a --radius" in guessed.attrs["understood"]
    assert strokes_of(guessed).source == "sign of the force"


def test_an_angle_that_starts_again_counts_revolutions(tmp_path) -> None:  # type: ignore[no-untyped-def]
    time = np.arange(0, 20, 0.01)
    rows = np.transpose([time, 360 * (0.8 * time % 1), 2 + 0.1 * np.sin(math.tau * 0.8 * time)])
    header = "time [s],angle [deg],friction force [N]"
    np.savetxt(tmp_path / "disc.csv", rows, delimiter=",", header=header, comments="")
    found = mesoslip.strokes(mesoslip.read_trace(tmp_path / "disc.csv"))
    assert found["strokes"].sizes["stroke"] == 15


def test_a_given_motion_overrules_the_guess() -> None:
    """A force that never changes its sign is cut into strokes if it is said to; and the reverse."""
    time = np.arange(0, 20, 0.01)
    wave = np.clip(4 * np.sin(math.tau * time / 2), -1, 1)
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    assert pieces_of_force(time, 3 + wave + noise) is None
    forced = pieces_of_force(time, 3 + wave + noise, is_given=True)
    assert forced is not None
    assert len(forced) == pytest.approx(20, abs=1)
    assert record_pieces(time, wave + noise, None)[0] is not None
    assert record_pieces(time, wave + noise, None, motion="one-way")[0] is None
    x = np.sin(math.tau * time / 2)
    assert record_pieces(time, wave + noise, x, motion="one-way")[0] is None


def test_the_motion_is_that_of_every_command(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """The output keeps it; a record without levels is refused."""
    time = np.arange(0, 20, 0.02)
    rng = np.random.default_rng(1)
    force = 3 + np.clip(4 * np.sin(math.tau * time / 2), -1, 1) + 0.01 * rng.standard_normal(1000)
    path = tmp_path / "a.csv"
    header = "time [s],force [N]"
    np.savetxt(path, np.c_[time, force], delimiter=",", header=header, comments="")
    tree = mesoslip.read_trace(path, motion="strokes")
    assert mesoslip.strokes(tree)["cycles"]["mean_friction"].values == pytest.approx(1, abs=0.02)
    assert tree["slips"].sizes["slip"] == 0
    with pytest.raises(mesoslip.FileError, match="was read as one-way; read it again with"):
        mesoslip.strokes(mesoslip.read_trace(path, motion="one-way"))
    np.savetxt(path, np.c_[time, 3 + rng.random(1000)], delimiter=",", header=header, comments="")
    with pytest.raises(mesoslip.ConfigError, match="no reversals that stand out"):
        mesoslip.read_trace(path, motion="strokes")


def test_the_period_of_revolutions_is_found() -> None:
    """A force that repeats itself with harmonics and noise; noise alone does not."""
    rng = np.random.default_rng(1)
    time = np.arange(0, 60, 0.01)
    phase = math.tau * time / 0.9234
    force = 5 + 0.02 * time + 0.1 * np.sin(phase) + 0.2 * np.sin(2 * phase + 1)
    force += 0.1 * rng.standard_normal(time.size)
    assert found_period(time, force) == pytest.approx(0.9234, rel=1e-3)
    assert found_period(time, rng.standard_normal(time.size)) is None
    # Of a few samples, with a strong second harmonic, over many periods.
    turn = math.tau * 1.99 * np.arange(0, 200, 0.02)
    wave = 0.1 * np.sin(turn + 1) + 0.3 * np.sin(2 * turn) + 0.05 * rng.standard_normal(turn.size)
    assert found_period(np.arange(0, 200, 0.02), wave) == pytest.approx(1 / 1.99, rel=1e-4)
    found = strokes_of(record_tree(time, force), period="auto")
    assert found.notes[0].startswith("guess: a revolution takes 923")
    # A running-in is larger than what repeats itself.
    worn = force + 3 * np.ptp(force) * np.exp(-time / (0.1 * time[-1]))
    found = strokes_of(record_tree(time, worn), period="auto")
    assert found.notes[0].startswith("guess: a revolution takes 92")
    with pytest.raises(mesoslip.FileError, match="does not repeat"):
        mesoslip.strokes(record_tree(time, rng.standard_normal(time.size)), period="auto")


def test_the_track_is_no_error_of_whole_revolutions() -> None:
    """The mean over a revolution has no part of its run-out, however large."""
    rng = np.random.default_rng(4)
    time = np.arange(0, 100, 0.02)
    turn = math.tau * time / 0.733
    force = 5 + 0.5 * np.sin(turn) + 0.2 * np.sin(2 * turn + 1)
    force += 0.02 * rng.standard_normal(time.size)
    rows = strokes_of(record_tree(time, force), period=0.733).columns["strokes"]
    errors = rows["mean_friction_error"]
    assert np.median(errors) < 0.015
    assert np.mean(np.abs(rows["mean_friction"] - 5) < 1.96 * errors) > 0.9
    # The picture has as many revolutions, by the same period or as found.
    for period in ("733 ms", "auto"):
        figure = mesoslip.plot(record_tree(time, force), view="strokes", period=period)
        places = figure.axes[1].containers[0].lines[0].get_xdata()
        assert len(places) == len(rows["mean_friction"])
    for wrong in (math.nan, -1.0):
        with pytest.raises(mesoslip.ConfigError, match=r"period = .*: must be positive"):
            mesoslip.plot(record_tree(time, force), view="strokes", period=wrong)


def strokes_of_made(number: int, tmp_path):
    """The strokes of a record of the study, and its truth."""
    record = made(number)
    record.write(tmp_path / "a.csv")
    return strokes_of(mesoslip.read_trace(tmp_path / "a.csv")), record


@pytest.mark.parametrize("number", [25, 178])
def test_a_few_slips_at_the_end_of_a_stroke_are_sliding(number, tmp_path):
    """The reversal takes more than half of a stroke, and few slips are left after it."""
    found, record = strokes_of_made(number, tmp_path)
    friction = found.overall["mean_friction"]
    assert abs(friction.mean - record.friction) < max(3 * friction.error, 0.05 * record.friction)
    assert friction.error < 0.05 * record.friction
    assert found.columns["strokes"]["slides"].all()


def test_a_force_of_one_sign_may_be_partial_slip_in_strokes() -> None:
    """With an offset, also in noise of a tenth; the force of slips in one direction is not."""
    for number in (1031, 1441, 1129, 1316, 5014):
        record = made(number)
        pieces = pieces_of_force(record.time, record.force)
        assert pieces is not None
        found = record.time[[one.first for one in pieces[1:]]]
        period = 2 * float(np.median(np.diff(record.turns)))
        for turn in record.turns[1:-1]:
            assert np.abs(found - turn).min() < 0.12 * period
    phase = phases()
    for force in (stick_slip(phase), stick_slip(phase, drop=1.9)):
        assert pieces_of_force(phase, force - force.min()) is None


def test_slips_through_zero_in_one_direction_are_no_strokes() -> None:
    """Behind a slow filter the force of irregular slips rises nearly as fast as it falls."""
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.5, 1.5, 30))
    time = np.arange(0, times[-1], 0.02)
    force = (time - times[np.searchsorted(times, time)]) / 0.75 + 0.6
    force = np.convolve(force, np.full(17, 1 / 17), "same")
    assert np.quantile(force, 0.1) < -0.6
    assert np.quantile(force, 0.9) > 0.25
    assert pieces_of_force(time, force) is None


@pytest.mark.parametrize("number", [1151, 1335])
def test_friction_of_partial_slip_without_a_load_point_has_a_lower_limit(number, tmp_path):
    """A rest at its end, and the extremes of a sine in noise, are not taken for sliding."""
    found, record = strokes_of_made(number, tmp_path)
    assert "mean_friction" not in found.overall
    limit = found.min_friction
    assert limit is not None
    # Loops are closed after the first strokes.
    closed = record.force[record.time > record.turns[2]]
    swing = 0.5 * float(np.diff(np.quantile(closed, [0.01, 0.99]))[0])
    assert 0.75 * swing < limit.value < 1.01 * swing
    assert limit.error < 0.02 * swing
    assert "of sliding is at least" in "\n".join(found.notes)
    assert found.to_json()["min_friction"]["mean"] == limit.value


@pytest.mark.parametrize("number", [1001, 1226])
def test_a_fall_or_two_among_thousands_of_samples_are_noise(number, tmp_path):
    """Many minimum falls are tried, and the ratios of few rises and falls are not normal."""
    made(number).write(tmp_path / "a.csv")
    assert mesoslip.read_trace(tmp_path / "a.csv")["slips"].sizes["slip"] == 0


@pytest.mark.parametrize("number", [3050, 3101, 6079, 6136])
def test_partial_slip_has_no_slips(number, tmp_path):
    """Its force bends, and reversals are found late without a load point, as at the last one."""
    made(number).write(tmp_path / "a.csv")
    assert mesoslip.read_trace(tmp_path / "a.csv")["slips"].sizes["slip"] == 0


@pytest.mark.parametrize("number", [3191, 6103])
def test_slips_in_strokes_are_those_of_the_slider(number, tmp_path):
    """Neither noise at rests nor reversals, of which the last is at the end of the record."""
    record = made(number)
    record.write(tmp_path / "a.csv")
    slips = mesoslip.slips(mesoslip.read_trace(tmp_path / "a.csv"))
    near = 4 * record.time[1]
    spans = zip(slips["start_time"].values - near, slips["end_time"].values + near, strict=True)
    assert all(((record.slips >= one) & (record.slips <= two)).any() for one, two in spans)
    assert slips.sizes["slip"] > 0.8 * record.slips.size


def test_statistics_of_slips_are_along_the_motion(tmp_path, command):
    """Slips back and forth are alike; none waits for one in the other direction."""
    stiffness, drop, phase = 3.0, 0.4, phases()
    x = drive("triangle", phase)
    force = stick_slip(x, stiffness, drop)
    rows = np.transpose([phase, x, force + 1e-3 * np.random.default_rng(1).standard_normal(x.size)])
    header = "time [s],load point [m],force [N]"
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=header, comments="")
    tree = mesoslip.read_trace(tmp_path / "a.csv", stiffness=stiffness)
    slips = mesoslip.slips(tree)
    back = slips["force_drop"].values < 0
    assert 0.3 < back.mean() < 0.7
    assert ((slips["peak_velocity"].values < 0) == back).all()
    turned = np.flatnonzero(np.diff(back)) + 1
    assert np.isnan(slips["waiting_time"].values[turned]).all()
    tree.to_netcdf(tmp_path / "a.nc")
    answer = json.loads(command.output("slips", tmp_path / "a.nc", "--json"))["statistics"]
    speed = np.abs(np.diff(x)).mean() * SAMPLES
    # A slip is loaded by one sample.
    fall = drop - stiffness * speed / SAMPLES
    assert answer["force_drop"]["mean"] == pytest.approx(fall, rel=0.03)
    assert answer["force_drop"]["standard_deviation"] < 0.05 * drop
    assert answer["force_before"]["minimum"] == pytest.approx(1, abs=0.05)
    assert answer["loading_rate"]["mean"] == pytest.approx(stiffness * speed, rel=0.02)
    period = drop / (stiffness * speed)
    assert answer["waiting_time"]["maximum"] == pytest.approx(period, rel=0.1)
    assert "backwards" in command.output("slips", tmp_path / "a.nc")
    found = mesoslip.regime(tree)
    assert found["period"][0] == pytest.approx(period, rel=0.03)
    assert found["period_variation"][0] < 0.05


def test_slips_before_a_rest_are_found(tmp_path):
    """The force rises faster after a reversal than it falls at rest: that is no mirrored slip."""
    record = made(3041)
    record.write(tmp_path / "a.csv")
    tree = mesoslip.read_trace(tmp_path / "a.csv")
    assert tree["slips"].sizes["slip"] > 0.65 * record.slips.size
    assert tree["slip_counts"]["mirrored_count"].values.max() == 0


def test_the_sign_of_a_force_in_partial_slip_is_by_the_energy(tmp_path):
    """Nearly elastic strokes, whose mean force along the motion is hardly positive."""
    found, record = strokes_of_made(1018, tmp_path)
    assert found.records[0].sign == 1
    energy = found.overall["loop_energy"]
    assert abs(energy.mean - record.loop_energy) < 3 * energy.error


def test_rest_at_the_end_of_partial_slip_is_no_sliding(tmp_path):
    """A bend of the force, where the drive comes to rest, is no slip."""
    found, _ = strokes_of_made(47, tmp_path)
    assert not found.columns["strokes"]["slides"].any()
    assert "mean_friction" not in found.overall


@pytest.mark.parametrize("late", [0.0, 0.25, 0.5])
def test_offsets_of_partial_slip_have_the_error_of_the_reversals(late: float) -> None:
    """Of an odd number of samples a cycle, so that both reversals differ, in all cycles alike."""
    phase = (np.arange(41 * 12) + late) / 41
    x = drive("triangle", phase)
    found = strokes_of(record_tree(10 * phase, elastic_sliding(x, 0.9) + 0.3, drive_displacement=x))
    offset, friction = (found.overall[one] for one in ("offset", "mean_friction"))
    # The spring is relaxed where the record starts. A quarter of a step of 0.1 is the maximum.
    assert abs(offset.mean - (0.3 - 0.9 * x[0])) < 2.5 * offset.error
    assert 0.005 < offset.error < 0.02
    assert friction.error < 0.2 * offset.error
