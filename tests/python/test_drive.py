"""The drive as an experimenter gives it, and what its stages came to."""

import itertools
import math

import mesoslip
import numpy as np
import pytest
import tomli_w
from conftest import at_end, drive_in_stages, klein_tables, long, problem_of
from kinds import KINDS, RAMPS, configuration, pairwise
from mesoslip import Config, ConfigError
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import AVALANCHE_COLUMNS
from scipy.integrate import solve_ivp

RAMP = [stage for stage in RAMPS["drive"]["stage"] if "start_velocity" in stage]


def staircase(steps):
    """The ramps as so many steps of constant velocity."""
    stages = []
    for stage in RAMPS["drive"]["stage"]:
        if "hold" in stage:
            stages.append(stage)
            continue
        start, end = stage["start_velocity"], stage["end_velocity"]
        stages += [
            {
                "duration": stage["duration"] / steps,
                "velocity": start + (end - start) * (step + 0.5) / steps,
            }
            for step in range(steps)
        ]
    return {"stage": stages}


def stages_of(tree):
    return tree["stages"].to_dataset(inherit=False)


@pytest.mark.parametrize(
    ("kind", "floor"),
    [
        ("rigid", 1e-12),
        ("rigid, me", 1e-12),
        ("rigid, lattice", 1e-12),
        ("rigid, ageing", 1e-12),
        ("layered", 1e-12),
        ("quasistatic", 1e-12),
        ("prescribed", 1e-12),
        long("layered, adams", 1e-6),
        long("prescribed, ageing", 1e-12),
    ],
)
def test_a_ramp_is_the_limit_of_a_staircase(kind, floor):
    """Of second order in the length of the steps, until events come in another order."""
    force = mesoslip.run(configuration(kind, **RAMPS))["spring_force"].values[0]
    errors = [
        np.max(np.abs(one["spring_force"].values[0] - force)[:20]) / 18e-6
        for one in (
            mesoslip.run(configuration(kind, drive=staircase(steps))) for steps in (400, 1600)
        )
    ]
    assert errors[1] < max(errors[0] / 12, floor)
    assert errors[1] < 1e-6 + floor


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_energy_of_closed_cycles_is_balanced(engine):
    """Without breaks and damping they return the work of the drive: its sum is of rounding errors,
    and the residual is one of what has flowed."""
    time = 0.5
    stages = [{"duration": time, "velocity": one} for one in (1e-8, -1e-8)]
    slider = {"mass": 1.47e-3, "stiffness": 1e5, "damping_ratio": 0.0}
    tables = {"run": {"duration": 2 * time, "engine": engine}, "slider": slider}
    tree = mesoslip.run(
        klein_tables(
            **tables, drive={"stage": stages}, output={"interval": 0.1}, contacts__count=99
        )
    )
    assert tree.attrs["break_count"] == 0
    # That into the springs of drive and contacts in series, and back.
    flow = 2 * 0.5 / (1 / 1e5 + 1 / 2000) * (1e-8 * time) ** 2
    assert abs(float(tree["energy/drive_work"].values[0])) < 1e-6 * flow
    assert abs(float(tree["energy_residual"].values[0])) < 1e-12
    assert tree.attrs["audit"] == "passed"


def energy_bound(kind):
    """Maximum residual of the energy balance of a short run, relative to the work of the drive."""
    words = set(kind.split(", "))
    return 1e-4 if {"adams", "bdf"} & words else 1e-8 if "me" in words else 1e-12


@pytest.mark.usefixtures("no_step_errors")
@pytest.mark.parametrize("kind", pairwise(kind for kind in KINDS if "force" not in kind))
def test_energy_of_ramps_is_balanced(kind):
    has_steps = ", me" in kind
    steps = {"run__resolution": 1.0} if has_steps else {}
    tree = mesoslip.run(configuration(kind, **RAMPS | steps))
    # Steps of a radian: the work on contacts that attach is by a polynomial of fourth order.
    bound = (3 if has_steps else 1) * energy_bound(kind)
    assert np.all(np.abs(tree["energy_residual"].values) < bound)
    assert tree.attrs["audit"] == "passed"


def test_the_direction_of_the_drive_decides_what_is_in_reach(klein):
    def message(target, *stages, **more):
        tables = {"run": {"stop": {"displacement": target}, **more}}
        return klein(
            **tables, drive={"stage": list(stages)} if stages else {"velocity": -1e-7}
        ).unreachable_stop

    assert "does not move in this direction" in message(1e-6, duration=20.0)
    assert message(-1e-6, duration=20.0) is None
    there_and_back = {"velocity": 1e-6, "duration": 1.0}, {"velocity": -1e-6, "duration": 3.0}
    assert message(0.9e-6, *there_and_back) is None
    assert message(-2.1e-6, *there_and_back) is None
    assert "the drive moves 1 µm in" in message(1.5e-6, *there_and_back)
    # A ramp stands after 1 s, 0.5 µm away.
    ramp = {"start_velocity": 1e-6, "end_velocity": -1e-6, "duration": 2.0}
    assert "the drive moves 500 nm in" in message(0.9e-6, ramp)
    assert "does not move" in message(-0.9e-6, ramp)


def test_a_ramp_of_a_prescribed_slider():
    """While no contact breaks the force is the stiffness times the way, a parabola."""
    start, end, duration = 1e-6, -2e-6, 3e-3
    acceleration = (end - start) / duration
    tree = mesoslip.run(
        klein_tables(
            run__duration=None,
            slider={"kind": "prescribed"},
            contacts__coupling="equal",
            output__interval=1e-5,
            drive={"stage": [{"duration": duration, "start_velocity": start, "end_velocity": end}]},
        )
    )
    time = tree["time"].values
    way = start * time + 0.5 * acceleration * time**2
    assert tree["breaks"].values == 0
    assert tree["displacement"].values[0] == pytest.approx(way, abs=1e-24)
    assert tree["velocity"].values[0] == pytest.approx(start + acceleration * time, abs=1e-20)
    assert tree["spring_force"].values[0] == pytest.approx(2000 * way, abs=1e-19)
    stage = stages_of(tree).isel(stage=0)
    turn = -start / acceleration
    assert stage["max_force_time"] == pytest.approx(turn, rel=1e-12)
    assert stage["max_force_displacement"] == pytest.approx(0.5 * start * turn, rel=1e-12)
    assert stage["max_force"] == pytest.approx(1000 * start * turn, rel=1e-10)
    assert stage["min_force"] == pytest.approx(2000 * way[-1], rel=1e-10)
    mean = start * duration / 2 + acceleration * duration**2 / 6
    assert stage["mean_force"] == pytest.approx(2000 * mean, rel=1e-10)
    assert (stage["drive_start_velocity"], stage["drive_end_velocity"]) == (start, end)
    assert tree["energy/drive_work"].values[0] == pytest.approx(1000 * way[-1] ** 2, rel=1e-10)


def test_extremes_of_a_spring_under_ramps():
    """A slider on contacts that do not break, against a solver of differential equations."""
    stages = [
        {"duration": 0.02, "start_velocity": 0.0, "end_velocity": 3e-6},
        {"duration": 0.03, "start_velocity": -2e-6, "end_velocity": 1e-6},
        {"duration": 0.01, "hold": True},
    ]
    tree = mesoslip.run(
        klein_tables(
            run__duration=None,
            contacts__coupling="equal",
            contacts__static_force=1e-3,
            drive={"stage": stages},
        )
    )
    assert tree["breaks"].values == 0
    mass, spring, contacts = 1.47e-3, 97.0, 2000.0
    damping = 0.2 * math.sqrt(spring / mass)
    state, ends = np.zeros(4), []
    for number, stage in enumerate(stages):
        start = stage.get("start_velocity", 0.0)
        rate = (stage.get("end_velocity", 0.0) - start) / stage["duration"]

        def move(time, state, start=start, rate=rate):
            place, velocity, mean, drive = state
            pull = spring * (drive - place) - contacts * place
            slow = damping * (velocity - mean)
            return [velocity, pull / mass - slow, slow, start + rate * time]

        solved = solve_ivp(
            move, (0, stage["duration"]), state, "DOP853", rtol=1e-12, atol=1e-22, dense_output=True
        )
        fine = solved.sol(np.linspace(0, stage["duration"], 200_001))
        force = spring * (fine[3] - fine[0])
        row = stages_of(tree).isel(stage=number)
        size = np.max(np.abs(force))
        assert row["max_force"] == pytest.approx(np.max(force), abs=1e-9 * size)
        assert row["min_force"] == pytest.approx(np.min(force), abs=1e-9 * size)
        place = fine[0, np.argmax(force)]
        assert row["max_force_displacement"] == pytest.approx(place, abs=1e-6 * size / spring)
        assert row["mean_force"] == pytest.approx(
            np.trapezoid(force, dx=stage["duration"] / 200_000) / stage["duration"],
            abs=1e-8 * size,
        )
        state = solved.y[:, -1]
        ends.append(state[0])
    assert stages_of(tree)["end_displacement"].values == pytest.approx(ends, rel=1e-8)


@pytest.mark.usefixtures("no_step_errors")
@pytest.mark.parametrize("kind", pairwise(KINDS))
def test_stages_are_what_fine_samples_show(kind):
    """Extremes are not less than those of samples, and near them; means are those of samples."""
    tree = mesoslip.run(configuration(kind, output__interval=1e-5, output__slip_interval=1e-5))
    # Some master equations have steps four times as long as by default.
    assert np.all(np.abs(tree["energy_residual"].values) < 10 * energy_bound(kind))
    stages = stages_of(tree)
    time, sampled = tree["time"].values, tree["spring_force"].values
    assert np.all(np.diff(stages["realization_index"]) >= 0)
    for row in range(stages.sizes["stage"]):
        stage = stages.isel(stage=row)
        force = sampled[int(stage["realization_index"])]
        start, end = float(stage["stage_start_time"]), float(stage["stage_end_time"])
        inside = (time >= start) & (time <= end) & np.isfinite(force)
        # Of a prescribed slider the force jumps with the drive's velocity, by the drag.
        within = force[inside][1:-1]
        greatest, least = float(stage["max_force"]), float(stage["min_force"])
        size = max(abs(greatest), abs(least))
        slack = 1e-12 * size
        assert least - slack <= within.min() <= within.max() <= greatest + slack
        assert least <= stage["start_force"] <= greatest
        assert least <= stage["end_force"] <= greatest
        assert greatest - within.max() < 0.2 * size
        assert within.min() - least < 0.2 * size
        if not {"prescribed", "quasistatic"} & set(kind.split(", ")):
            assert greatest - within.max() < 1e-2 * size
            assert within.min() - least < 1e-2 * size
            for which in ("max", "min"):
                at = float(stage[f"{which}_force_time"])
                place = np.interp(at, time[inside], force[inside])
                assert float(stage[f"{which}_force"]) == pytest.approx(place, abs=5e-3 * size)
        mean = np.trapezoid(force[inside], time[inside]) / (time[inside][-1] - time[inside][0])
        assert stage["mean_force"] == pytest.approx(mean, abs=2e-2 * size)
        assert (
            stage["drive_start_displacement"]
            == pytest.approx(
                np.interp(start, time, tree["drive_displacement"].values[0]), abs=1e-12
            )
            or tree.sizes["realization"] > 1
        )
    ends = stages["stage_end_time"].values
    assert np.array_equal(
        stages["stage_start_time"].values[1:][np.diff(stages["realization_index"]) == 0],
        ends[:-1][np.diff(stages["realization_index"]) == 0],
    )


def assert_equal(one, other, groups=("", "slips", "stages")):
    for group in groups:
        first, second = (
            tree[group].to_dataset(inherit=False) if group else tree for tree in (one, other)
        )
        for name in first.data_vars:
            if name != "kernel_seconds":
                values = first[name].values
                assert np.array_equal(values, second[name].values, equal_nan=True), (group, name)


def run_drive(drive, kind="rigid", **changes):
    return mesoslip.run(configuration(kind, drive=drive, **changes))


def test_repeated_stages_are_stages_to_the_bit():
    stages = [{"duration": 0.02, "velocity": 1e-5}, {"duration": 0.01, "velocity": -5e-6}]
    assert_equal(run_drive({"stage": stages, "repeat": 3}), run_drive({"stage": 3 * stages}))


@pytest.mark.parametrize("speed", [{"velocity": "10 um/s"}, {"frequency": "10 Hz"}])
def test_a_cycle_is_stages_to_the_bit(speed):
    fast = 4 * 2.5e-7 * 10 if "frequency" in speed else 1e-5
    way, forth, back = (2.5e-7 / fast, fast), (5e-7 / fast, fast), (5e-7 / fast, -fast)
    strokes = [way, back, forth, back, way]
    stages = [{"duration": time, "velocity": velocity} for time, velocity in strokes]
    cycle = {"amplitude": "0.25 um", "cycles": 2, **speed}
    assert_equal(run_drive({"cycle": cycle}), run_drive({"stage": stages}))


def test_a_history_is_stages_to_the_bit(tmp_path):
    """But for slips, which its points do not end, and for the stages themselves."""
    points = [(2.0, 5e-23), (2.03, 3e-7), (2.04, 3e-7), (2.1, -4e-7)]
    lines = [f"{time},x,{place}" for time, place in points]
    (tmp_path / "moved.csv").write_text("\n".join(["time [s],note,displacement [m]", *lines, ""]))
    case = tmp_path / "case.toml"
    tables = configuration("rigid").to_dict()
    case.write_text(tomli_w.dumps(tables | {"drive": {"history": {"file": "moved.csv"}}}))
    measured = Config.load(case)
    stages = [
        {
            "duration": after[0] - before[0],
            "velocity": (after[1] - before[1]) / (after[0] - before[0]),
        }
        for before, after in itertools.pairwise(points)
    ]
    one, other = mesoslip.run(measured), run_drive({"stage": stages})
    assert_equal(one, other, [""])
    # One stage, of which the extremes are those of all.
    assert stages_of(one)["max_force"].values == [stages_of(other)["max_force"].max()]
    # The points go with the output: the file is not needed to repeat the run.
    (tmp_path / "moved.csv").unlink()
    assert_equal(one, mesoslip.run(Config.from_toml(one.attrs["configuration"])))
    other_file = tmp_path / "other.csv"
    other_file.write_text("time [ms],displacement [nm]\n0,0\n50,500\n")
    changed = Config.from_toml(
        one.attrs["configuration"], overrides=[f"drive.history.file={other_file}"]
    )
    assert changed.drive.history.time == pytest.approx((0, 0.05))
    assert changed.drive.history.displacement == pytest.approx((0, 5e-7))


def test_a_drive_that_is_over_ends_the_run(klein):
    """A loop and a history; stages go on at their last velocity, a ramp as one more stage."""
    cycle = {"amplitude": 1e-6, "velocity": 1e-6, "cycles": 1}
    assert klein(drive={"cycle": cycle}).duration == 4
    assert klein(drive={"cycle": cycle}, run__duration=1.5).duration == 1.5
    ramp = {"duration": 2.0, "start_velocity": 0.0, "end_velocity": 1e-6}
    parts = klein(drive={"stage": [ramp]}).drive_parts
    assert parts == ((2, 0, 1e-6, 0), (10, 1e-6, 1e-6, 1))
    parts = klein(drive={"stage": [ramp]}, run__duration=0.5).drive_parts
    assert parts == ((0.5, 0, 2.5e-7, 0),)


@pytest.mark.parametrize("way", [1e-7, 2.4e-6, 2.6e-6, 3.5e-6, 3.9e-6, 5e-6])
def test_a_way_of_ramps(klein, way):
    """The time in which the drive goes a way, there and back both counted, is that of its parts."""
    stages = [
        {"duration": 1.0, "start_velocity": 0.0, "end_velocity": 5e-6},
        {"duration": 1.0, "start_velocity": 2e-6, "end_velocity": -2e-6},
        {"displacement": 1e-6, "start_velocity": -1e-6, "end_velocity": 0.0},
        {"duration": 2.0, "velocity": 1e-6},
    ]
    config = klein(run={"drive_displacement": way}, drive={"stage": stages})
    assert math.fsum(part.path_length for part in config.drive_parts) == pytest.approx(way)
    fine = []
    for part in config.drive_parts:
        middle = (np.arange(10_000) + 0.5) / 10_000
        velocity = part.start_velocity + (part.end_velocity - part.start_velocity) * middle
        fine.append(np.mean(np.abs(velocity)) * part.duration)
    assert math.fsum(fine) == pytest.approx(way, rel=1e-6)


def stage(**keys):
    return {"stage": [{"duration": 1.0, "velocity": 1e-6}, keys]}


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        (stage(duration=1.0), ["drive.stage[1].velocity", "give a velocity", "hold = true"]),
        (
            stage(duration=1.0, velocity=1e-6, start_velocity=0.0),
            ["drive.stage[1].velocity", "only one of"],
        ),
        (stage(duration=1.0, hold=True, velocity=1e-6), ["only one of"]),
        (stage(duration=1.0, start_velocity=1e-6), ["drive.stage[1].end_velocity", "missing"]),
        (stage(velocity=1e-6), ["drive.stage[1].duration", "either a duration or a displacement"]),
        (stage(duration=1.0, displacement=1e-6, velocity=1e-6), ["either a duration"]),
        (stage(duration=0.0, velocity=1e-6), ["drive.stage[1].duration", "greater than 0"]),
        (stage(displacement=1e-6, hold=True), ["displacement", "never reached"]),
        (stage(displacement=1e-6, start_velocity=-1e-6, end_velocity=1e-6), ["of one sign"]),
        ({"velocity": 1e-6, "repeat": 2}, ["drive.repeat", "needs [[drive.stage]]"]),
        (
            {"stage": [{"duration": 1.0, "velocity": 1e-6}] * 2, "repeat": 600_000},
            ["drive.repeat", "more than 1000000"],
        ),
        ({"velocity": 1e-6, "cycle": {"amplitude": 1e-6, "cycles": 1, "frequency": 1}}, ["either"]),
        ({"cycle": {"amplitude": 1e-6, "cycles": 1}}, ["drive.cycle.velocity", "frequency"]),
        ({"cycle": {"amplitude": 0, "cycles": 1, "frequency": 1}}, ["drive.cycle.amplitude"]),
        ({"cycle": {"amplitude": 1, "cycles": 1, "frequency": 1, "shape": "sine"}}, ["triangle"]),
        ({"history": {}}, ["drive.history.file", "missing"]),
        ({"history": {"time": [0, 1], "displacement": [0]}}, ["as many values"]),
        ({"history": {"time": [0], "displacement": [0]}}, ["two values"]),
        ({"history": {"time": [0, 1, 1], "displacement": [0, 1, 2]}}, ["time", "must increase"]),
        ({"history": {"time": [0, 1e-9], "displacement": [0, 1]}}, ["moves at 1e+09 m/s"]),
        ({"history": {"file": "nowhere.csv"}}, ["nowhere.csv: no such file"]),
    ],
)
def test_what_is_wrong_with_a_drive_is_reported(drive, words):
    printed = str(problem_of(klein_tables(drive=drive)))
    assert all(word in printed for word in words), printed


HEADER = "time [s],displacement [um]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        (HEADER, "two rows of numbers"),
        (HEADER + "0,0\n", "two rows of numbers"),
        (HEADER + "0,0\n1,\n2,1\n", "line 3: the displacement is missing"),
        (HEADER + "0,0\n,1\n2,1\n", "line 3: the time is missing"),
        (HEADER + "0,0\n1,5,08\n", "line 3: has 3 cells under 2 headers"),
        (HEADER + "0,0\n1_0,1\n", "line 3: the time, '1_0', is not a number"),
        (HEADER + "0,0\n" + 200_000 * "1" + ",1\n", "line 3: the time, '111"),
        (HEADER + "0,0\n1\n2,1\n", "line 3: the displacement is missing"),
        (HEADER + "0,0\n1,nan\n", "line 3: the displacement, 'nan', is not a finite number"),
        (HEADER + "0,0\n1,one\n", "line 3: the displacement, 'one', is not a number"),
        (HEADER + "0,0\n1,1\n0.5,2\n", "line 4: the time must increase"),
        (HEADER + "0,0\n1,1\n1,2\n", "line 4: the time must increase"),
        ("time,displacement [um]\n0,0\n1,1\n", "column 'time' has no unit"),
        ("time [s],displacement\n0,0\n1,1\n", "column 'displacement' has no unit"),
        ("time [s],displacement [furlongs]\n0,0\n1,1\n", None),
        ("time [s],displacement [s]\n0,0\n1,1\n", "not a unit of displacement"),
        ("time [s],displacement [wide]\n0,0\n1,1\n", "not a unit of displacement"),
        ("displacement [m],time [s]\n0,0\n1,1\n", "first column must be the time"),
        ("time [s],place [m]\n0,0\n1,1\n", "no column displacement"),
        ("time [s],displacement [m],displacement [m]\n0,0,0\n1,1,1\n", "two columns"),
        ("\ufefftime [ms],displacement [nm]\n0,0\n1,1\n\n", None),
    ],
)
def test_what_is_wrong_with_a_history_is_reported(tmp_path, text, words):
    path = tmp_path / "moved.csv"
    path.write_text(text, encoding="utf-8")
    tables = klein_tables(drive={"history": {"file": str(path)}})
    if words is None:
        assert len(Config.from_dict(tables).drive.history.time) == 2
        return
    printed = str(problem_of(tables))
    assert str(path) in printed
    assert words in printed


def test_a_drive_laid_over_another_replaces_it():
    """What is laid over one way to give a drive replaces it, with what belongs to it."""
    stages = {"stage": [{"duration": 1.0, "velocity": 1e-6}], "repeat": 2}
    config = Config.from_dict(klein_tables(drive=stages))
    assert config.replace("drive.repeat=3").drive.repeat == 3
    assert config.replace("drive.velocity=1 um/s").drive.repeat is None
    cycle = config.replace(drive={"cycle": {"amplitude": 1e-6, "velocity": 1e-6, "cycles": 2}})
    assert cycle.replace("drive.cycle.cycles=5").drive.cycle.amplitude == 1e-6
    assert cycle.replace("drive.cycle.frequency=2").drive.cycle.velocity is None


FAR = ["rigid", "rigid, me", "rigid, lattice", "rigid, ageing", "rigid, ramps", "prescribed"]
FAR += ["prescribed, me", "layered", "layered, adams", "layered, me"]


@pytest.mark.parametrize("kind", FAR)
@pytest.mark.parametrize("way", [long(3.0000001e-8), 2.01e-7])
def test_a_run_ends_at_a_displacement_to_the_bit(kind, way):
    """For the first time, and until then it is the run that goes on."""
    tree = mesoslip.run(configuration(kind, run__stop={"displacement": way}))
    assert tree.attrs["ending"] == "displacement of the slider reached"
    assert stages_of(tree)["end_displacement"].values[-1] == way
    assert np.all(tree["displacement"].values < way)
    whole = mesoslip.run(configuration(kind))
    end = stages_of(tree)["stage_end_time"].values[-1]
    until = whole["time"].values <= end
    assert np.max(whole["displacement"].values[0, until]) <= way
    assert np.max(whole["displacement"].values[0, : until.sum() + 1]) > way
    bound = 1e-7 if {"adams", "me"} & set(kind.split(", ")) else 1e-12
    assert tree["spring_force"].values[0] == pytest.approx(
        whole["spring_force"].values[0, until], abs=bound
    )


def test_a_run_ends_at_a_displacement_where_forces_change_their_sign():
    """With little temperature, forces change their sign without a step of their own. Where only
    such changes are scheduled before the displacement, the slider must not move past it."""
    distance = 601.02042e-9
    config = klein_tables(
        run={"duration": 0.08, "stop": {"displacement": distance}},
        drive__velocity=1e-5,
        contacts__count=60,
        contacts__threshold__relative_width=0.1,
        contacts__coupling="equal",
        contacts__initial="steady",
        contacts__thermal={"rate": 1e3, "force_ratio": 0.01},
    )
    tree = mesoslip.run(config)
    assert stages_of(tree)["end_displacement"].values[-1] == distance


# Forward first, so that the contacts are scheduled for that direction; a short wave back and forth.
BACKWARDS = {
    "after a slide": {},
    "at once": {"drive": {"velocity": -1e-5}, "run__duration": 0.1},
    "in a wave": {
        "drive": {"cycle": {"amplitude": 2e-7, "frequency": 50.0, "cycles": 3}},
        "run__duration": None,
    },
    "after a jerk": {"drive": drive_in_stages((1e-3, 1e-5), (0.05, -1e-4))},
}


@pytest.mark.parametrize("name", BACKWARDS)
@pytest.mark.parametrize("distance", [1e-9, 4e-9, 1.5e-8])
def test_a_run_ends_at_a_displacement_backwards(name, distance):
    config = configuration("rigid", **BACKWARDS[name], run__stop={"displacement": -distance})
    tree = mesoslip.run(config)
    stages = stages_of(tree)
    assert tree.attrs["ending"] == "displacement of the slider reached"
    assert stages["end_displacement"].values[-1] == -distance
    assert stages["stage_number"].values.tolist() == list(range(stages.sizes["stage"]))
    assert np.all(tree["displacement"].values > -distance)
    # It is there for the first time.
    end = stages["stage_end_time"].values[-1]
    whole = mesoslip.run(configuration("rigid", **BACKWARDS[name]))
    early = whole["displacement"].values[0, whole["time"].values < end]
    assert np.min(early) > -distance


def test_without_inertia_a_run_ends_where_it_comes_to_rest():
    tree = mesoslip.run(configuration("quasistatic", run__stop={"displacement": 1e-7}))
    assert tree.attrs["ending"] == "displacement of the slider reached"
    assert 1e-7 <= tree["end_displacement"].values[0] < 1.3e-7


@pytest.mark.parametrize("distance", [3.0000001e-9, -3e-9])
def test_without_inertia_a_run_ends_at_a_displacement_between_breaks(distance):
    """To the bit, while nothing breaks: no contact bears less than 0.6 of 9 nm."""
    stage = {"duration": 0.1, "velocity": math.copysign(1e-5, distance)}
    changes = {"drive": {"stage": [stage]}, "run__stop": {"displacement": distance}}
    tree = mesoslip.run(configuration("quasistatic", **changes))
    assert tree.attrs["ending"] == "displacement of the slider reached"
    assert tree["end_displacement"].values[0] == distance
    assert tree["breaks"].values[0] == 0


SLOW = {
    "drive": {"velocity": 1e-6},
    "run": {"duration": 4.0, "stop": {"slips": 3}},
    "contacts__threshold__relative_width": 0.01,
}


@pytest.mark.parametrize("count", [1, 3])
def test_a_run_ends_with_a_slip(count):
    """As soon as the last slip is over: half a period after its least force, or at the next."""
    tables = SLOW | {"run": {"duration": 4.0, "stop": {"slips": count}}}
    tree = mesoslip.run(configuration("rigid", **tables))
    whole = mesoslip.run(configuration("rigid", **SLOW | {"run": {"duration": 4.0}}))
    assert tree.attrs["ending"] == "number of slips reached"
    slips, all_slips = (
        tree["slips"].to_dataset(inherit=False),
        whole["slips"].to_dataset(inherit=False),
    )
    assert slips.sizes["slip"] == count < all_slips.sizes["slip"]
    assert np.array_equal(slips["end_time"], all_slips["end_time"][:count])
    end = stages_of(tree)["stage_end_time"].values[-1]
    assert slips["end_time"].values[-1] < end < all_slips["end_time"].values[count]
    samples = tree.sizes["time"]
    assert np.array_equal(tree["spring_force"], whole["spring_force"][:, :samples])


@pytest.mark.parametrize("kind", ["prescribed", "prescribed, me", "rigid", "quasistatic"])
def test_a_run_ends_in_a_steady_state(kind):
    """Not before the rule of the documentation is met, computed here from the stages of a run whose
    stages are the blocks."""
    way = 2e-8 if "prescribed" in kind else 2e-7
    blocks, speed = 6, 1e-5
    run = {"engine": "me" if "me" in kind else "eq", "duration": 10.0}
    steady = {"displacement": way, "blocks": blocks, "tolerance": 0.0}
    tree = mesoslip.run(
        configuration(kind, drive={"velocity": speed}, run=run | {"stop": {"steady": steady}})
    )
    assert tree.attrs["ending"] == "steady state reached"
    end = stages_of(tree)["stage_end_time"].values[-1]
    number = round(end * speed / way)
    assert end == pytest.approx(number * way / speed, rel=1e-12)
    stages = [{"duration": way / speed, "velocity": speed}] * number
    means = stages_of(
        mesoslip.run(configuration(kind, drive={"stage": stages}, output__slip_interval=1e-3))
    )["mean_force"].values
    for last in range(2 * blocks, number + 1):
        early, late = means[last - 2 * blocks : last - blocks], means[last - blocks : last]
        scatter = np.std(late, ddof=1)
        is_steady = abs(late.mean() - early.mean()) <= scatter * math.sqrt(2 / blocks)
        is_steady &= np.std(early, ddof=1) <= 2 * scatter
        assert is_steady == (last == number)


def test_a_loading_spring_is_not_steady():
    """A force that grows evenly never is, whatever the length of blocks."""
    for way in (1e-10, 1e-8):
        steady = {"displacement": way, "blocks": 2, "tolerance": 0.0}
        config = configuration(
            "rigid",
            drive={"velocity": 1e-7},
            run={"duration": 1.0, "stop": {"steady": steady}},
            contacts__static_force=1e-3,
        )
        assert mesoslip.run(config).attrs["ending"] == "end of the drive"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"run__stop": {"slips": 0}}, ["run.stop.slips"]),
        (
            {"run__stop": {"slips": 2}, "slider": {"kind": "prescribed"}},
            ["run.stop.slips", "needs"],
        ),
        ({"run__stop": {"displacement": 0}}, ["run.stop.displacement", "must not be 0"]),
        ({"run__stop": {"steady": 3}}, ["run.stop.steady", "must be a table"]),
        ({"run__stop": {"steady": True}, "drive": {"velocity": 0}}, ["constant velocity"]),
        ({"run__stop": {"steady": True}, **RAMPS, "run__duration": 0.1}, ["constant velocity"]),
        ({"run__stop": {"steady": {"blocks": 1}}}, ["run.stop.steady.blocks"]),
    ],
)
def test_what_is_wrong_with_an_end_is_reported(changes, words):
    with pytest.raises(ConfigError) as printed:
        Config.from_dict(klein_tables(**changes))
    for word in words:
        assert word in str(printed.value)


def test_info_knows_ramps_and_holds(klein):
    """Their stages, duration, path length, and the speed that represents them elsewhere."""
    derived = mesoslip.derived(klein(run__duration=None, **RAMPS))
    values = {name: derived[name].value for name in derived if name.startswith("drive_")}
    expected = {"stages": 3, "duration": 0.1, "path_length": 4e-7 + 0.05 * (1e-10 + 4e-10) / 6e-5}
    for name, value in expected.items():
        assert values[f"drive_{name}"] == pytest.approx(value)
    assert values["drive_speed"] == 2e-5
    assert "drive_path_length" not in mesoslip.derived(klein())


def test_the_mean_force_of_a_ramp_without_inertia_is_that_of_its_parabola():
    """Before the first break springs in series: F = K Nk/(K + Nk) (v_0 t + a t^2/2)."""
    config = configuration(
        "quasistatic",
        drive={"stage": [{"duration": 0.02, "start_velocity": 2e-6, "end_velocity": 8e-6}]},
        contacts__coupling="equal",
        contacts__threshold__relative_width=0.01,
        output__interval=1e-3,
    )
    tree = mesoslip.run(config)
    assert tree["breaks"].values[0] == 0
    series = 97 * 2000 / (97 + 2000)
    mean = series * (2e-6 * 0.02 / 2 + (8e-6 - 2e-6) / 0.02 * 0.02**2 / 6)
    assert stages_of(tree)["mean_force"].values[0] == pytest.approx(mean, rel=1e-12)
    time = tree["time"].values
    force = series * (2e-6 * time + (8e-6 - 2e-6) / 0.02 * time**2 / 2)
    np.testing.assert_allclose(tree["spring_force"].values[0], force, rtol=1e-9, atol=1e-18)


def test_an_avalanche_at_the_end_of_the_drive_comes_to_its_end():
    """At the very time at which the drive ends, and however short the segments of the run are."""

    def run(duration, advances=None):
        config = configuration(
            "quasistatic, lattice",
            run={"duration": duration},
            drive={"velocity": 1e-5},
            contacts__threshold__relative_width=0.002,
            output={"interval": 1e-3},
        )
        return at_end(Realization(config, 0), advances)

    # The shortest duration with a break, to the last bit.
    none, some = 0.0, 0.1
    assert run(some).breaks > 0
    while (middle := (none + some) / 2) not in (none, some):
        none, some = (none, middle) if run(middle).breaks else (middle, some)
    size = AVALANCHE_COLUMNS.index("size")
    later = run(some * (1 + 1e-9))
    first = later.avalanches[0]
    assert first[size] > 1
    for advances in (None, 1):
        ended = run(some, advances)
        assert ended.time == some
        assert ended.breaks == later.breaks == first[size]
        assert ended.avalanches[0][size] == first[size]
        assert ended.displacement == pytest.approx(later.displacement, rel=1e-6)
