"""Steady forces, velocity steps and holds of records whose laws are known."""

import csv
import json
import math
import shutil

import mesoslip
import numpy as np
import pytest
import tomli_w
import xarray as xr
from conftest import ROOT, drive_in_stages, klein_tables
from matplotlib.figure import Figure
from mesoslip import Config, FileError
from mesoslip.analysis.rate_and_state.points import Loading
from mesoslip.analysis.rate_and_state.search import fit_laws
from mesoslip.analysis.response.dataset import rows_of, scalars_of
from mesoslip.analysis.response.line import line
from mesoslip.analysis.response.tables import force_scale, tables
from mesoslip.analysis.steady_force import steady_mean, transient
from mesoslip.theory.steady_sliding import sliding_of
from oracles import Friction, spring_slider
from response_coverage import autoregression, steady_coverage

# F_s = 18 uN and a mean breaking stretch of 9 nm.
FORCE = 18e-6
LAW = Friction(0.5 * FORCE, 1e-7, 0.01 * FORCE, 0.02 * FORCE, 3e-9, "slip")
STRETCH = 9e-9


def record(law, stages, stiffness, *, noise=0.0, realizations=1, sign=1.0, exact=True):
    """An output whose motion is that of a rate-and-state law, with its group of stages."""
    slider = (
        {"kind": "prescribed"}
        if math.isinf(stiffness)
        else {"kind": "rigid", "mass": 1e-6, "stiffness": stiffness}
    )
    duration = sum(one.duration for one in stages)
    drive = {
        "stage": [
            {"duration": one.duration, "velocity": sign * one.start_velocity} for one in stages
        ]
    }
    config = Config.from_dict(klein_tables(slider=slider, drive=drive, run={"duration": duration}))
    ends = np.cumsum([one.duration for one in stages])
    times = np.unique(np.concatenate([np.arange(0, duration, 1e-3), ends]).round(9))
    motion = spring_slider(law, stages, times, stiffness)
    clean = np.where(np.isfinite(motion.force), motion.force, motion.force[0])
    generator = np.random.default_rng(7)
    force = clean + noise * generator.standard_normal((realizations, times.size))
    moved = np.tile(motion.displacement, (realizations, 1))
    starts = np.append(0, ends[:-1])
    path = np.append(0, np.cumsum([one.duration * one.start_velocity for one in stages]))
    load = np.interp(times, np.append(0, ends), path)
    root = xr.Dataset(
        {
            "spring_force": (("realization", "time"), sign * force),
            "displacement": (("realization", "time"), sign * moved),
            "drive_displacement": (
                ("realization", "time"),
                np.tile(sign * load, (realizations, 1)),
            ),
        },
        coords={"time": times, "realization": np.arange(realizations)},
        attrs={"configuration": config.to_toml(), "title": "synthetic"},
    )
    groups = {"/": root}
    if exact:
        rows = []
        for realization in range(realizations):
            for number, (begin, end, one) in enumerate(zip(starts, ends, stages, strict=True)):
                inside = np.flatnonzero((times >= begin) & (times <= end))
                signed = sign * force[realization, inside]
                low, high = inside[np.argmin(signed)], inside[np.argmax(signed)]
                row = {
                    "realization_index": realization,
                    "stage_number": number,
                    "stage_start_time": begin,
                    "stage_end_time": end,
                    "drive_start_velocity": sign * one.start_velocity,
                    "drive_end_velocity": sign * one.end_velocity,
                }
                for which, place in (
                    ("start", inside[0]),
                    ("end", inside[-1]),
                    ("min", low),
                    ("max", high),
                ):
                    row[f"{which}_force"] = sign * force[realization, place]
                    row[f"{which}_force_time"] = times[place]
                    row[f"{which}_force_displacement"] = sign * moved[realization, place]
                    row[f"{which}_displacement"] = sign * moved[realization, place]
                rows.append(row)
        groups["/stages"] = xr.Dataset(
            {name: ("stage", np.array([row[name] for row in rows])) for name in rows[0]}
        )
    return xr.DataTree.from_dict(groups)


def moving(velocity, duration):
    return Loading(duration, velocity, velocity)


STEP = (moving(1e-7, 1.0), moving(1e-6, 0.3), moving(1e-7, 1.0))
HOLDS = (
    moving(1e-7, 1.0),
    *(one for hold in (0.1, 1.0, 10.0) for one in (Loading(hold, 0.0, 0.0), moving(1e-7, 1.0))),
)


@pytest.mark.parametrize(
    ("realizations", "count", "repeat", "transient"),
    [(1, 1000, 0.9, 0.0), (4, 250, 0.5, 0.0), (1, 2000, 0.0, 0.0), (1, 10_000, 0.0, 5.0)],
)
def test_errors_of_means_cover(realizations, count, repeat, transient):
    """Of 120 means, 95 % within four standard errors of that part; more in docs/response.md."""
    covers, ratio, _, among = steady_coverage(realizations, count, repeat, transient, samples=120)
    assert covers > 0.95 - 4 * math.sqrt(0.95 * 0.05 / 120)
    assert among >= covers - 0.02
    assert 0.75 < ratio < 1.3


def test_errors_of_means_allow_for_correlated_blocks():
    """Blocks on the plateau are short: by themselves their errors are 4 % too small."""
    cases = ((2000, 0.8), (1000, 0.8), (500, 0.6), (400, 0.5))
    ratios = [steady_coverage(1, *one, samples=200)[1] for one in cases]
    assert 0.98 < np.mean(ratios) < 1.04


def test_a_transient_is_left_out():
    decay = 5 * np.exp(-np.arange(2000) / 60)
    series = 3 + decay + autoregression(1, 2000, 0.5, 1)[0]
    assert 60 < transient(series) < 600
    mean = steady_mean(series[None, :])
    assert abs(mean.mean - 3) < 3 * mean.error
    assert mean.is_steady
    # Not so if it never ends.
    assert not steady_mean((3 + np.linspace(0, 9, 2000) + 0.1 * series)[None, :]).is_steady
    assert steady_mean(series[None, :10]) is None
    flat = steady_mean(np.full((2, 100), 0.1))
    assert (flat.mean, flat.error, flat.is_steady) == (pytest.approx(0.1), 0.0, True)


def test_a_short_record_is_not_resolved():
    found = [steady_mean(autoregression(1, 200, 0.98, seed)) for seed in range(20)]
    assert sum(one.is_resolved for one in found) <= 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("exact", [True, False])
def test_a_step_of_the_slip_law_is_measured_exactly(sign, exact):
    """Where the slider follows the drive, that law decays exponentially with D_c."""
    tree = mesoslip.response(record(LAW, STEP, math.inf, sign=sign, exact=exact), fit=False)
    up, down = rows_of(tree, "steps")
    logarithm = math.log(10)
    # The first sample after the step is 1 ms, that is 1 nm or 0.1 nm, later.
    for row, factor, lag in ((up, 1, 1e-9), (down, -1, 1e-10)):
        late = math.exp(-lag / LAW.slip_distance)
        direct = (LAW.a - LAW.b * (1 - late)) * logarithm * factor
        assert row["net_change"] == pytest.approx(-0.01 * FORCE * logarithm * factor, rel=1e-3)
        assert row["direct_change"] == pytest.approx(direct, rel=2e-3, abs=1e-4 * FORCE)
        assert row["evolution_change"] == pytest.approx(
            -LAW.b * late * logarithm * factor, rel=2e-3
        )
        assert row["relaxation_displacement"] == pytest.approx(LAW.slip_distance, rel=5e-3)
        assert row["integral_displacement"] == pytest.approx(LAW.slip_distance, rel=5e-2)
        assert math.isnan(row["overshoot"])
        assert row["rate_dependence_ratio"] == pytest.approx(-0.01, rel=1e-3)
        # a and b of the law itself, whatever the ratio of the velocities and the direction.
        assert row["apparent_a"] == pytest.approx(LAW.a - LAW.b * (1 - late), rel=1e-2)
        assert row["apparent_b"] == pytest.approx(LAW.b * late, rel=2e-3)
    assert up["velocity_before"] == sign * 1e-7


def test_a_step_on_a_spring_with_noise_is_measured_within_its_errors():
    law, stiffness = Friction(**{**LAW.__dict__, "law": "ageing", "a": 0.02 * FORCE}), 3000.0
    tree = mesoslip.response(
        record(law, STEP, stiffness, noise=2e-3 * FORCE, realizations=5), fit=False
    )
    clean = record(law, STEP, stiffness)
    up = rows_of(tree, "steps")[0]
    assert abs(up["net_change"]) < 4 * up["net_change_error"]
    inside = (clean["time"].values > 1) & (clean["time"].values < 1.3)
    peak = clean["spring_force"].values[0, inside].max()
    # The greatest of a noisy force is that of the noise on it.
    assert peak - 1e-3 * FORCE < up["peak_force"] < peak + 8e-3 * FORCE
    assert up["peak_is_exact"] == 1
    assert up["direct_change"] < law.a * math.log(10)
    # The state of the ageing law comes to a higher velocity more slowly than exponentially.
    assert 1 < up["relaxation_displacement"] / law.slip_distance < 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_holds_have_drops_peaks_and_healing(sign):
    law, stiffness = Friction(**{**LAW.__dict__, "law": "ageing"}), 4000.0
    tree = record(law, HOLDS, stiffness, sign=sign)
    found = mesoslip.response(tree, fit=False)
    rows = rows_of(found, "holds")
    np.testing.assert_allclose([row["hold_time"] for row in rows], [0.1, 1, 10])
    times, force = tree["time"].values, sign * tree["spring_force"].values[0]
    begin = 1.0
    for row in rows:
        held = (times >= begin) & (times <= begin + row["hold_time"])
        after = (times >= begin + row["hold_time"]) & (times <= begin + row["hold_time"] + 1)
        assert row["drop"] == pytest.approx(0.5 * FORCE - force[held].min(), rel=1e-2)
        assert row["relaxation"] == pytest.approx(force[held][0] - force[held][-1])
        assert row["peak_force"] == pytest.approx(force[after].max())
        assert row["healing"] == pytest.approx(force[after].max() - 0.5 * FORCE, rel=1e-2)
        at = np.flatnonzero(after)[np.argmax(force[after])]
        moved = sign * tree["displacement"].values[0]
        assert row["slip_to_peak"] == pytest.approx(moved[at] - moved[held][-1], rel=1e-6)
        assert row["load_to_peak"] == pytest.approx(
            1e-7 * (times[at] - begin - row["hold_time"]), rel=1e-6
        )
        begin += row["hold_time"] + 1
    healing = [row["healing"] for row in rows]
    slope = np.polyfit([-1, 0, 1], healing, 1)[0]
    assert scalars_of(found, "holds")["healing_per_decade"] == pytest.approx(slope, rel=0.1)
    # Less than b per e-fold of the hold, as the spring lets the slider creep.
    assert 0.3 < (healing[2] - healing[1]) / (law.b * math.log(10)) < 1


def test_the_exact_peak_is_taken_if_it_belongs_to_the_restart():
    tree = record(LAW, HOLDS, 4000.0)
    stages = tree["stages"].to_dataset()
    rows = np.flatnonzero(stages["stage_number"].values == 2)
    before = rows_of(mesoslip.response(tree, fit=False), "holds")[0]["peak_force"]
    stages["max_force"][rows] = before + 1e-7
    tree["stages"] = xr.DataTree(stages)
    row = rows_of(mesoslip.response(tree, fit=False), "holds")[0]
    assert row["peak_force"] == pytest.approx(before + 1e-7)
    assert row["peak_is_exact"] == 1
    # One far from the restart is a fluctuation of the sliding after it.
    stages["max_force_displacement"][rows] += 4 * STRETCH
    tree["stages"] = xr.DataTree(stages)
    row = rows_of(mesoslip.response(tree, fit=False), "holds")[0]
    assert row["peak_force"] == pytest.approx(before)
    assert row["peak_is_exact"] == 0


def test_the_law_of_a_record_is_found():
    law = Friction(**{**LAW.__dict__, "law": "ageing"})
    tree = record(law, STEP[:2] + HOLDS[:3], 4000.0, noise=1e-3 * FORCE)
    ageing, slip = rows_of(mesoslip.response(tree), "rate_and_state")
    for name in ("a", "b", "slip_distance"):
        assert abs(ageing[name] - getattr(law, name)) < 4 * ageing[f"{name}_error"], name
    assert ageing["a_ratio"] == pytest.approx(ageing["a"] / FORCE)
    assert ageing["is_described"] == 1
    assert slip["is_described"] == 0
    assert "times the noise" in slip["note"]
    assert ageing["information_criterion"] < slip["information_criterion"]


def test_the_law_starts_where_sliding_has_become_steady():
    """A first stage that is all transient is left out."""
    law = Friction(**{**LAW.__dict__, "law": "ageing"})
    tree = record(law, STEP[:2] + HOLDS[:3], 4000.0, noise=1e-3 * FORCE)
    inside = tree["time"].values <= 1.0
    early = np.where(inside, 1 - tree["time"].values, 0.0)
    tree["spring_force"] = tree["spring_force"] - 0.3 * FORCE * early
    found = mesoslip.response(tree)
    assert not rows_of(found, "steady")[0]["is_steady"]
    ageing = rows_of(found, "rate_and_state")[0]
    assert ageing["reference_velocity"] == pytest.approx(1e-6)
    assert abs(ageing["b"] - law.b) < 4 * ageing["b_error"]


def test_lines_have_errors():
    generator = np.random.default_rng(3)
    x, error = np.arange(8.0), np.full(8, 0.1)
    found = [line(x, 2 * x + 0.1 * generator.standard_normal(8), error) for _ in range(200)]
    apart = np.array([(one.slope - 2) / one.slope_error for one in found])
    assert 0.7 < apart.std() < 1.1
    # What is not on a line has larger errors than its points say.
    bent = line(x, x**2, error)
    assert bent.slope_error > 10 * found[0].slope_error
    assert bent.chi_square > 1000
    assert line(x[:1], x[:1], error[:1]) is None
    assert line(x, 2 * x, 0 * error).slope == pytest.approx(2)


@pytest.fixture(scope="module")
def sliding():
    """Contacts without delay under a prescribed slider, 4 realizations."""
    config = klein_tables(
        slider={"kind": "prescribed"},
        contacts__coupling="equal",
        contacts__delay=0.0,
        contacts__back_force_ratio=0.0,
        contacts__count=400,
        contacts__threshold={"law": "uniform", "relative_width": 0.3},
        drive=drive_in_stages((2.0, 1e-7), (0.4, 5e-7)),
        run={"duration": 2.4, "realizations": 4},
        output={"interval": 1e-3},
    )
    return mesoslip.run(config)


@pytest.fixture(scope="module")
def sliding_response(sliding):
    return mesoslip.response(sliding)


def test_steady_forces_of_a_run_are_those_of_theory(sliding_response):
    """F/F_s = (1 + δ²)/2 at any velocity, without delay and back force."""
    found = sliding_response
    for row in rows_of(found, "steady"):
        assert abs(row["steady_force_ratio"] - 0.5 * 1.09) < 4 * row["steady_force_ratio_error"]
        assert row["steady_force_ratio_error"] < 5e-3
        assert row["is_steady"]
    line = scalars_of(found, "steady")
    assert abs(line["rate_dependence"]) < 4 * line["rate_dependence_error"]
    # Neither does its law: nothing in it depends on the velocity.
    assert not any(
        row["is_described"] and row["b"] > 3 * row["b_error"]
        for row in rows_of(found, "rate_and_state")
    )


def test_tables_have_one_unit_a_column_and_the_digits_of_errors(sliding, sliding_response):
    steady, steps, _ = tables(sliding_response)
    assert steady.head[1] == "velocity (nm/s)"
    assert [row[1] for row in steady.rows] == ["100.0", "500.0"]
    assert steps.head[1:3] == ("from (nm/s)", "to (nm/s)")
    for row in steady.rows:
        value, error = row[2].split(" ± ")
        assert len(value.partition(".")[2]) == len(error.partition(".")[2])
        assert len(error.removeprefix("0.").lstrip("0")) == 2
    assert steady.line.startswith("rate dependence a - b")
    assert "± " in steady.line
    # Outputs of different static forces have theirs in newtons.
    other = mesoslip.run(
        Config.from_toml(sliding.attrs["configuration"]).replace(
            {"contacts.static_force": 9e-6, "run.realizations": 1}
        )
    )
    steady = tables(mesoslip.response([sliding, other], fit=False))[0]
    assert steady.head[3] == "steady force (µN)"
    assert steady.line.endswith("µN") or "µN (" in steady.line or "nN (" in steady.line


def test_forces_of_a_trace_are_not_divided_by_the_static_force_of_a_run(sliding, tmp_path):
    """Which is unknown for the trace; neither is the same output taken for two."""
    path = tmp_path / "trace.csv"
    time = np.arange(0, 20, 0.01)
    force = 5 + 0.01 * np.random.default_rng(1).standard_normal(time.size)
    np.savetxt(path, np.stack([time, force], 1), delimiter=",", header="time [s],force [N]")
    trace = mesoslip.read_trace(path, columns="time [s], force [N]", velocity=1e-6)
    for place, outputs in enumerate(([trace, sliding], [sliding, trace])):
        tree = mesoslip.response(outputs, fit=False)
        assert force_scale(tree).startswith("Forces are not divided by a static force")
        of_trace = tree["steady"]["output_index"].values == place
        assert tree["steady"]["steady_force"].values[of_trace] == pytest.approx([5], rel=1e-3)
    for one in (sliding, trace):
        with pytest.raises(mesoslip.FileError, match="input 1: is given twice"):
            mesoslip.response([one, one], fit=False)


def test_stick_slip_is_stated_and_not_fitted():
    tree = mesoslip.run(
        klein_tables(
            contacts__count=200,
            drive=drive_in_stages((3.0, 1e-7), (0.5, 0.0), (3.0, 1e-7)),
            run={"duration": 6.5},
        )
    )
    found = mesoslip.response(tree)
    first, second = rows_of(found, "steady")
    # The only slip of the first stage has no other to rest before.
    assert first["note"].startswith("stick-slip")
    assert math.isnan(first["slip_share"])
    assert second["slip_share"] == pytest.approx(1.0, abs=0.1)
    (hold,) = rows_of(found, "holds")
    assert "stick-slip" in hold["note"]
    assert math.isnan(hold["healing"])
    # The peak is that from which the first slip after the hold starts.
    slips = mesoslip.slips(tree)
    first = np.flatnonzero(slips["start_time"].values > 3.5)[0]
    assert hold["peak_force"] == slips["force_before"].values[first]
    (law,) = rows_of(found, "rate_and_state")
    assert "describes no slips" in law["note"]


def test_the_command(tmp_path, command, monkeypatch):
    path, table = tmp_path / "holds.nc", tmp_path / "table.csv"
    tables = klein_tables(
        contacts__count=50,
        slider={"kind": "prescribed"},
        drive=drive_in_stages((0.3, 1e-6), (0.1, 0.0), (0.3, 1e-6), (0.1, 3e-6)),
        run={"duration": 0.8},
    )
    (tmp_path / "run.toml").write_text(tomli_w.dumps(tables))
    assert command("run", tmp_path / "run.toml", "-o", path, "--quiet")[0] == 0
    # Fits of several laws take seconds, and have tests of their own.
    for module in ("analysis.rate_and_state.rows", "plots.views.response"):
        monkeypatch.setattr(
            f"mesoslip.{module}.fit_laws", lambda record, *_: fit_laws(record, ("slip",))
        )
    answer = json.loads(
        command.output("response", path, "--json", "--csv", table, "--normal-force", "36 uN")
    )
    assert answer["normal_force"] == 36e-6
    steady = answer["steady"][0]
    assert steady["steady_force_coefficient"] == pytest.approx(steady["steady_force"] / 36e-6)
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["stage_number [1]"] for row in rows] == ["0", "1", "2", "3"]
    assert rows[1]["hold_time [s]"]
    assert not rows[1]["steady_force [N]"]
    assert rows[3]["net_change [N]"]
    again = shutil.copy(path, tmp_path / "again.nc")
    out = command.output("response", path, again, "--no-fit")
    assert out.count("Holds") == 1
    assert "Rate and state" not in out
    figure = mesoslip.plot(path, tmp_path / "a.png", view="response", width="8.6 cm")
    figure.draw_without_rendering()
    record = figure.axes[0]
    legend, whole = record.get_legend().get_window_extent(), figure.bbox
    # Above the curves, and in the figure.
    assert legend.y0 > record.get_window_extent().y1
    assert (legend.x0, legend.x1, legend.y1) == pytest.approx(
        (max(legend.x0, 0), min(legend.x1, whole.x1), min(legend.y1, whole.y1))
    )


def test_mistakes_are_errors(tmp_path, command):
    missing = tmp_path / "none.nc"
    status, _, message = command("response", missing)
    assert (status, message.count("\n")) == (2, 1)
    old = ROOT / "tests" / "reference" / "old.nc"
    for force in ("0 N", "-1 N", "3 m", "nan", "much"):
        message = command.refusal("response", old, "--normal-force", force)
        assert "--normal-force" in message
        assert "Traceback" not in message
    message = command.refusal("response", old, "--csv", old)
    pulled = mesoslip.run(
        klein_tables(
            slider={"kind": "quasistatic"},
            drive={"force_rate": 1e-6},
            contacts__reattach=False,
            contacts__count=50,
        )
    )
    with pytest.raises(FileError, match="driven by a force"):
        mesoslip.response(pulled)


def test_an_output_with_one_velocity_has_a_steady_force_and_no_more():
    """Also one of an earlier version, without stages."""
    found = mesoslip.response(ROOT / "tests" / "reference" / "old.nc")
    assert found["steps"].sizes["step"] == found["holds"].sizes["hold"] == 0
    assert "no data for a, b and D_c" in rows_of(found, "rate_and_state")[0]["note"]


def test_forces_beyond_all_bounds_are_refused():
    tree = mesoslip.open_output(ROOT / "tests" / "reference" / "old.nc")
    tree["spring_force"].values[0, 3] = -1e308
    with pytest.raises(FileError, match=r"a damaged output: its force reaches 1e\+308"):
        mesoslip.response(tree)


def test_the_picture_of_a_step_shows_its_peak_and_two_steady_forces(sliding):
    """The law is below the record; two points determine no line."""
    figure = mesoslip.plot(sliding, view="response")
    data, law = figure.axes[0].lines[0], figure.axes[0].get_legend().get_lines()[0]
    assert law.get_linewidth() > data.get_linewidth()
    drawn = next(one for one in figure.axes[0].lines if "law" in str(one.get_label()))
    assert drawn.get_zorder() < data.get_zorder()
    assert "from two velocities" in figure.axes[1].get_title("left")
    assert not [one for one in figure.axes[1].lines if one.get_linestyle() == "-"]


def test_pictures(sliding):
    whole = mesoslip.plot(sliding, view="response")
    assert isinstance(whole, Figure)
    assert len(whole.axes) == 2
    axes = Figure().subplots()
    mesoslip.plot(sliding, view="response", ax=axes)
    holds = mesoslip.plot(record(LAW, HOLDS, 4000.0), view="response")
    assert len(holds.axes) == 2
    for drawn in (axes, whole.axes[0], holds.axes[0]):
        assert len(drawn.lines) >= 2
        assert "law" in drawn.get_legend().texts[0].get_text()
    assert "slip law" in holds.axes[0].get_legend().texts[0].get_text()


def test_contacts_are_the_spring_of_a_prescribed_slider():
    """The direct effect of activated contacts comes as they are loaded, with the stiffness N k."""
    config = Config.load(ROOT / "runs" / "velocity-step.toml").replace(
        {
            "run.duration": 0.135,
            "run.realizations": 1,
            "contacts.count": 8000,
            "contacts.thermal.force_ratio": 0.04,
            "drive.stage": [
                {"velocity": 1e-6, "displacement": 60e-9},
                {"velocity": 1e-5, "displacement": 75e-9},
            ],
            "output.interval": 2e-5,
            "output.slip_interval": None,
        }
    )
    known = sliding_of(config, math.sqrt(1e-11)).rate_and_state
    found = rows_of(mesoslip.response(mesoslip.run(config), free_stiffness=True), "rate_and_state")[
        0
    ]
    assert found["stiffness"] == pytest.approx(config.contacts.stiffness, rel=0.2)
    assert found["a"] == pytest.approx(known.a, rel=0.2)
    assert found["b"] == pytest.approx(known.b, rel=0.2)
