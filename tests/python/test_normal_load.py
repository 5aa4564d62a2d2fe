"""The normal load: sites that touch and separate, in both engines, against closed forms.

Units: F_s = 1 N and N k = 1 N/m, so that contacts break at a stretch of about 1 m; v = 1 mm/s.
"""

import math

import mesoslip
import numpy as np
import pytest
from conftest import at_end
from kinds import LOAD, VIBRATING, configuration
from mesoslip import Config, ConfigError, Realization
from mesoslip.analysis.response.dataset import write_csv
from mesoslip.analysis.slips import catalogue_of
from mesoslip.configuration.load import Load
from scipy.interpolate import CubicSpline

VELOCITY = 1e-3
WIDTH = 0.1
# Mean force of steady sliding for gaussian thresholds, <x^2>/(2 <x>).
STEADY = 0.5 * (1 + WIDTH**2)


def sliding(load, duration, engine="eq", count=4000, **changes):
    """Steady sliding of a prescribed slider under a load."""
    tables = {
        "run": {"duration": duration, "engine": engine, "seed": 3},
        "drive": {"velocity": VELOCITY},
        "slider": {"kind": "prescribed"},
        "contacts": {
            "count": count,
            "static_force": 1.0,
            "stiffness": 1.0,
            "drag_rate": 0.0,
            "delay": 0.0,
            "back_force_ratio": 0.0,
            "coupling": "equal",
            "initial": "steady",
            "threshold": {"law": "gaussian", "relative_width": WIDTH},
        },
        "output": {"interval": duration / 2000},
        "load": load,
    }
    return Config.from_dict({**tables, **changes})


def step(force):
    """A step of the load from 1 N in the middle of a time of 3000 s."""
    stages = [{"duration": 1500.0, "normal_force": one} for one in (1.0, force)]
    return {"normal_force": 1.0, "stage": stages}


def finished(config, **options):
    with Realization(config, estimates_errors=False, **options) as one:
        at_end(one)
        return one, one.records("trace")


def trace(config, number=0):
    rows = finished(config, number=number)[1]
    return rows["time"], rows["spring_force"]


@pytest.fixture(scope="module")
def relaxed():
    """Force curve from a relaxed start."""
    curve = mesoslip.curve(sliding(None, 1.0).replace({"contacts.initial": "relaxed"}))
    return CubicSpline(curve["displacement"].values, curve["contact_force"].values)


def expected_after_a_step(force, relaxed, time):
    """Force after a step, with the age of the step [s]."""
    if force < 1:
        return force * STEADY * np.ones_like(time)
    return STEADY + (force - 1) * relaxed(VELOCITY * time)


@pytest.mark.parametrize("force", [0.5, 1.5])
def test_a_step_is_met_by_new_contacts_only_after_sliding(force, relaxed):
    config = sliding(step(force), 3000.0, "me", run={"duration": 3000.0, "engine": "me"})
    errors = []
    for resolution in (0.05, 0.025):
        time, forces = trace(config.replace({"run.resolution": resolution}))
        after = time > 1500
        expected = expected_after_a_step(force, relaxed, time[after] - 1500)
        errors.append(np.max(np.abs(forces[after] - expected)))
    assert errors[1] < 2.5e-6
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("force", [0.5, 1.5])
def test_individual_contacts_follow_a_step_within_their_noise(force, relaxed):
    config = sliding(step(force), 3000.0)
    runs = [trace(config, number) for number in range(16)]
    time = runs[0][0]
    after = (time > 1500) & (np.arange(len(time)) % 100 == 0)
    forces = np.array([one[1][after] for one in runs])
    error = forces.std(axis=0, ddof=1) / math.sqrt(len(runs))
    expected = expected_after_a_step(force, relaxed, time[after] - 1500)
    deviates = (forces.mean(axis=0) - expected) / error
    assert np.all(np.abs(deviates) < 4.5)
    assert np.mean(np.abs(deviates) < 3) > 0.9


@pytest.mark.parametrize(("amplitude", "expected"), [(0.4, 0.3268), (0.2, 0.4159)])
def test_a_fast_vibration_lubricates(amplitude, expected):
    """(1 - A) F_ss + A N k v T (pi^2 - 4)/(2 pi^2), with v T = 0.2."""
    period = 0.2 / VELOCITY
    closed = (1 - amplitude) * STEADY + amplitude * 0.2 * (math.pi**2 - 4) / (2 * math.pi**2)
    assert closed == pytest.approx(expected, abs=5e-5)
    load = {"normal_force": 1.0, "cycle": {"amplitude": amplitude, "frequency": 1 / period}}
    time, forces = trace(sliding(load, 8 * period, "me"))
    assert np.mean(forces[time >= 3 * period][:-1]) == pytest.approx(closed, abs=2e-4)
    runs = [trace(sliding(load, 20 * period, count=2000), number) for number in range(8)]
    means = [np.mean(forces[time >= 5 * period][:-1]) for time, forces in runs]
    error = np.std(means, ddof=1) / math.sqrt(len(means))
    assert abs(np.mean(means) - closed) < 3 * error < 0.01


def test_a_slow_vibration_is_followed():
    load = {"normal_force": 1.0, "cycle": {"amplitude": 0.4, "frequency": VELOCITY / 200}}
    config = sliding(load, 1e5, "me").replace({"run.resolution": 0.5})
    time, forces = trace(config)
    assert forces == pytest.approx(config.normal_load.force_at(time) * STEADY, abs=0.01)


def test_both_engines_agree_on_a_ramp_and_a_vibration_with_delay():
    load = {
        "normal_force": 1.0,
        "history": {"time": [0.0, 500.0, 900.0, 1500.0], "normal_force": [1.0, 1.4, 0.3, 0.9]},
    }
    changes = {"contacts.delay": 100.0, "contacts.delay_law": "exponential"}
    forces = trace(sliding(load, 1500.0, "me").replace(changes))[1]
    runs = [trace(sliding(load, 1500.0).replace(changes), number)[1] for number in range(8)]
    error = np.std(runs, axis=0, ddof=1) / math.sqrt(len(runs))
    deviates = ((np.mean(runs, axis=0) - forces) / error)[::50]
    assert np.sqrt(np.mean(deviates**2)) < 2


def test_the_reference_load_is_none():
    plain = finished(configuration("rigid"))[0]
    for load in (
        {"normal_force": 3.0},
        {"normal_force": 3.0, "stage": [{"duration": 0.02, "normal_force": 3.0}]},
    ):
        loaded = finished(configuration("rigid", load=load))[0]
        for table in ("trace", "slips"):
            assert np.array_equal(getattr(plain, table), getattr(loaded, table))


def test_a_constant_load_has_as_many_contacts_as_it_carries():
    stages = [{"duration": 1.0, "normal_force": 1.5}]
    half = configuration("rigid", load={"normal_force": 1.0, "stage": stages})
    given = configuration(
        "rigid", contacts__count=72, contacts__static_force=2.7e-5, contacts__stiffness=3000.0
    )
    # The drag of a contact is that of the area of one.
    given = given.replace({"contacts.area": 1.5 * half.contacts.area})
    assert finished(half)[1]["spring_force"] == pytest.approx(
        finished(given)[1]["spring_force"], rel=1e-9
    )


def test_sites_in_contact_follow_the_load():
    stages = [{"duration": 100.0, "normal_force": one} for one in (1.0, 0.3, 1.5, 0.0, 0.8)]
    snapshots = [99.0, 199.0, 299.0, 399.0, 499.0]
    config = sliding({"normal_force": 1.0, "stage": stages}, 500.0).replace(
        {"output.snapshots": snapshots}
    )
    pinned = mesoslip.run(config)["snapshots"]["pinned"].values
    seen = [np.flatnonzero(one) for one in pinned]
    counts = np.array([len(pinned) for pinned in seen])
    expected = 4000 * np.array([1.0, 0.3, 1.5, 0.0, 0.8])
    spread = np.sqrt(expected * (1 - expected / 6000))
    assert np.all(np.abs(counts - expected) <= 4 * spread)
    assert counts[2] == 6000
    assert counts[3] == 0
    # The heights of sites never change.
    assert set(seen[1]) < set(seen[4]) < set(seen[0]) < set(seen[2])


def test_touching_contacts_bear_nothing():
    config = sliding(step(1.5), 3000.0)
    with Realization(config) as one:
        one.advance_to(1500.0)
        contacts = one.contacts
        there, force = one.displacement, one.records("trace")["spring_force"][-1]
        stretch = there - contacts["origin"][contacts["stiffness"] > 0]
    assert len(stretch) == 6000
    assert force == pytest.approx(STEADY, abs=0.02)
    assert np.count_nonzero(np.abs(stretch) < 1e-4) > 1900


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_separated_contacts_lose_their_energy(engine):
    one, _ = finished(sliding(step(0.5), 3000.0, engine))
    energy = one.energy_terms
    # Half of <k x^2/2> of steady sliding, <x^3>/(6 <x>).
    assert energy["separation_loss"] == pytest.approx((1 + 3 * WIDTH**2) / 12, rel=0.03)
    assert abs(one.energy_residual) < 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_energy_is_conserved_in_any_motion_under_a_load(seed):
    """Random combinations without a false warning."""
    random = np.random.default_rng(seed)
    contacts = (
        {},
        {"contacts__delay_law": "exponential", "contacts__newborn_width": 0.05},
        {"contacts__delay": 0.0},
        {
            "contacts__coupling": "equal",
            "contacts__ageing": {"law": "log", "time": 1e-4, "growth": 0.03},
        },
        {"contacts__coupling": "equal", "contacts__thermal": {"rate": 1e4, "force_ratio": 0.05}},
    )
    sliders = ("rigid", "prescribed", "quasistatic", "force", "layered")
    for _ in range(12):
        forces = random.uniform(0, 2, 6) * (random.uniform(size=6) > 0.2)
        load = {
            "normal_force": 1.0,
            "stage": [
                {"duration": 0.02, "start_normal_force": first, "end_normal_force": last}
                for first, last in zip(forces[::2], forces[1::2], strict=True)
            ],
        }
        if not np.any(forces):
            continue
        changes = {**contacts[random.integers(len(contacts))], "load": load}
        config = configuration(sliders[random.integers(len(sliders))], **changes)
        one, _ = finished(config)
        assert abs(one.energy_residual) < 1e-12


def test_outputs_have_the_load_and_the_coefficient(tmp_path):
    tree = mesoslip.run(configuration("rigid", **LOAD))
    force, normal = tree["spring_force"].values[0], tree["normal_force"].values[0]
    assert normal == pytest.approx(
        configuration("rigid", **LOAD).normal_load.force_at(tree["time"].values)
    )
    loaded = normal > 0
    assert 0 < np.count_nonzero(~loaded) < 10
    coefficient = tree["friction_coefficient"].values[0]
    assert coefficient[loaded] == pytest.approx(force[loaded] / normal[loaded])
    assert np.all(np.isnan(coefficient[~loaded]))
    slips = tree["slips"].to_dataset()
    assert slips["friction_coefficient"].values == pytest.approx(
        slips["force_before"].values / slips["normal_force"].values
    )
    catalogue = catalogue_of(tree)
    catalogue.write_csv(tmp_path / "slips.csv")
    head, first, *_ = (tmp_path / "slips.csv").read_text().splitlines()
    assert head.endswith(",normal_force [N],friction_coefficient [1]")
    assert float(first.rpartition(",")[2]) == slips["friction_coefficient"].values[0]
    assert {"normal force (N)", "coefficient"} <= set(catalogue.printed().head)
    assert "normal_force" in catalogue.statistics
    assert tree["energy"]["separation_loss"].item() > 0
    assert {"normal_force", "friction_coefficient"} <= set(tree["slip_traces"].data_vars)


def test_contacts_that_touch_or_separate_are_counted_before_a_run(tmp_path, command, monkeypatch):
    """As often as the load passes the force of each; a run whose load changes for hours says so,
    and populations do not follow contacts."""
    for changes in (LOAD, VIBRATING):
        config = configuration("rigid", **changes)
        times = np.linspace(0, config.duration, 200_001)
        path = np.abs(np.diff(config.pressing.force_at(times))).sum()
        expected = config.contacts.count * path / config.pressing.normal_force
        assert config.contact_kind.load_changes(config) == pytest.approx(expected, rel=0.02)
    assert config.replace({"run.engine": "me"}).contact_kind.load_changes(config) == 0
    path = tmp_path / "case.toml"
    path.write_text(config.to_toml())
    changes = config.contact_kind.load_changes(config)
    printed = command("info", path)[1]
    found = next(line for line in printed.splitlines() if line.startswith("load_changes"))
    assert float(found.split()[1]) == pytest.approx(changes, rel=0.01)
    # Two realizations take as long as is reported.
    monkeypatch.setattr("mesoslip.command_line.run.LONG", 1.5e-7 * changes)
    for count in (1, 2):
        more = ("-o", tmp_path / "run.nc", "--set", f"run.realizations={count}")
        said = f"contacts will touch or separate about {count * changes:.1g} times"
        assert (said in command("run", path, *more)[2]) == (count == 2)


def test_loads_at_times():
    stages = Load.model_validate(LOAD["load"])
    times = [0.0, 0.01, 0.03, 0.05, 0.07, 0.072, 0.075, 0.1, 0.2]
    expected = [3.0, 3.0, 3.0, 1.9, 0.8, 0.0, 0.0, 2.4, 2.4]
    assert stages.force_at(times) == pytest.approx(expected, abs=1e-9)
    wave = Load.model_validate(VIBRATING["load"])
    assert wave.force_at([0.0, 0.0025, 0.005]) == pytest.approx([1.0, 1.6, 1.0])
    assert np.array_equal(Load(normal_force="2 N").force_at([0.0, 1.0]), [2.0, 2.0])


@pytest.mark.parametrize(
    ("load", "key", "message"),
    [
        ({"stage": [{"duration": 1.0, "normal_force": 1.0}]}, "load.normal_force", "missing"),
        ({"normal_force": -1.0}, "load.normal_force", "greater than 0"),
        (
            {"normal_force": 1.0, "cycle": {"amplitude": 1.1, "frequency": 1.0}},
            "load.cycle.amplitude",
            "must not be below 0",
        ),
        (
            {"normal_force": 1.0, "stage": [{"duration": 1.0, "normal_force": "-2 mN"}]},
            "load.stage",
            "fall to -0.002 N",
        ),
        (
            {"normal_force": 1.0, "stage": [{"duration": 1.0, "start_normal_force": 1.0}]},
            "load.stage[0].end_normal_force",
            "missing",
        ),
        (
            {"normal_force": 1.0, "history": {"time": [0, 1], "normal_force": [1.0]}},
            "load.history.normal_force",
            "as many values",
        ),
        (
            {
                "normal_force": 1.0,
                "cycle": {"amplitude": 0.1, "frequency": 1.0},
                "stage": [{"duration": 1.0, "normal_force": 1.0}],
            },
            "load.stage",
            "only one of",
        ),
    ],
)
def test_bad_loads_are_refused_in_words(load, key, message):
    with pytest.raises(ConfigError) as caught:
        sliding(load, 10.0)
    (problem,) = caught.value.problems
    assert problem.key == key
    assert message in problem.message


def test_a_load_of_neighbours_must_be_constant():
    with pytest.raises(ConfigError, match="must be constant, with normal_force alone"):
        configuration("rigid, lattice", **LOAD)
    configuration("rigid, lattice", load={"normal_force": 1.0})


def test_what_ends_early_and_what_separates_is_said():
    notes = configuration("rigid", **LOAD).notes
    assert notes == ["the normal force falls to 0, where all contacts are separated"]
    stages = [{"duration": 0.05, "normal_force": 2.0}]
    config = configuration("rigid", load={"normal_force": 1.0, "stage": stages})
    assert config.notes == [
        "the load ends after 50 ms: its last normal force, 2 N, holds for another 50 ms"
    ]
    assert configuration("rigid", **VIBRATING).notes == []


def test_a_history_is_read_from_a_file(tmp_path):
    (tmp_path / "load.csv").write_text("time [s],normal force [mN]\n0,1000\n0.02,1500\n0.05,200\n")
    (tmp_path / "run.toml").write_text(
        'base = "klein.toml"\n[load]\nnormal_force = "1 N"\n[load.history]\nfile = "load.csv"\n'
    )
    (tmp_path / "klein.toml").write_text(configuration("rigid").to_toml())
    config = Config.load(tmp_path / "run.toml")
    assert config.normal_load.force_at([0.01, 0.035]) == pytest.approx([1.25, 0.85])
    assert Config.from_toml(config.to_toml()) == config
    (tmp_path / "load.csv").write_text("time [s],displacement [um]\n0,1\n1,2\n")
    with pytest.raises(ConfigError, match="there is no column normal_force"):
        Config.load(tmp_path / "run.toml")


def test_theory_is_that_of_the_reference_load():
    from mesoslip.theory.contacts import contact_theory

    plain, loaded = configuration("rigid"), configuration("rigid", **LOAD)
    assert contact_theory(plain).caveat == ""
    assert contact_theory(loaded).caveat == "computed at the constant normal force 2 N"
    assert mesoslip.derived(loaded)["F_steady"] == mesoslip.derived(plain)["F_steady"]


@pytest.fixture(scope="module")
def steps_up_and_down():
    """A run with a step of the load up and one down, without noise."""
    # Long enough for the force after the step to settle.
    stages = [{"duration": 2e4, "normal_force": one} for one in (1.0, 1.5, 1.0)]
    config = sliding({"normal_force": 1.0, "stage": stages}, 6e4, "me")
    return mesoslip.run(config.replace({"output.interval": 10.0}))


def test_the_response_to_a_step_is_direct_or_transient(steps_up_and_down, relaxed):
    """Up: all of it after sliding, with alpha = mu (1 - L/L')/ln(L'/L). Down: all of it at once."""
    response = mesoslip.response(steps_up_and_down, fit=False)
    assert "several normal forces" in response["steady"]["note"].item()
    found = response["load_steps"].to_dataset()
    assert found["load_step_time"].values == pytest.approx([2e4, 4e4], abs=20)
    assert found["normal_force_after"].values == pytest.approx([1.5, 1.0])
    # Just after is the first sample, up to 10 s or a hundredth of a breaking stretch after.
    assert found["direct_change"].values == pytest.approx([0, -0.5 * STEADY], abs=0.01)
    assert found["transient_change"].values == pytest.approx([0.5 * STEADY, 0], abs=0.01)
    alpha = STEADY / 3 / math.log(1.5)
    assert found["alpha"].values == pytest.approx([alpha, 0], abs=1e-2)
    rise = found["rise_displacement"].values
    assert relaxed(rise[0]) == pytest.approx(STEADY, abs=0.02)
    assert np.isnan(rise[1])


def test_steps_of_the_load_are_in_the_table(steps_up_and_down, tmp_path):
    """A row each after that of the stage, with all columns."""
    path = tmp_path / "steps.csv"
    response = mesoslip.response(steps_up_and_down, fit=False)
    write_csv(response, path)
    head, *rows = [line.split(",") for line in path.read_text().splitlines()]
    names = [one.partition(" ")[0] for one in head]
    assert len(rows) == 3
    kept = [dict(zip(names, one, strict=True)) for one in rows]
    assert float(kept[0]["steady_force"]) > 0
    found = response["load_steps"].to_dataset()
    for name in ("load_step_time", "direct_change", "transient_change", "alpha"):
        assert kept[0][name] == ""
        assert [float(one[name]) for one in kept[1:]] == pytest.approx(found[name].values)
    assert [one["steady_force"] for one in kept[1:]] == ["", ""]


def test_the_response_of_a_measured_trace_has_steps_of_its_normal_force(
    steps_up_and_down, tmp_path
):
    root = steps_up_and_down.to_dataset()
    columns = ("time", "spring_force", "normal_force", "drive_displacement")
    values = np.array([np.ravel(root[name].values) for name in columns]).T
    noise = np.random.default_rng(1).normal(0, 1e-3, (len(values), 2))
    values[:, 1:3] += noise
    path = tmp_path / "trace.csv"
    header = "time [s],force [N],normal force [N],load point [m]"
    np.savetxt(path, values, delimiter=",", header=header, comments="")
    found = mesoslip.response(mesoslip.read_trace(path), fit=False)["load_steps"].to_dataset()
    assert found["normal_force_after"].values == pytest.approx([1.5, 1.0], abs=1e-3)
    assert found["alpha"].values == pytest.approx([STEADY / 3 / math.log(1.5), 0], abs=0.02)


def test_a_vibrating_load_has_no_steps():
    load = {"normal_force": 1.0, "cycle": {"amplitude": 0.4, "frequency": 1e-3}}
    tree = mesoslip.run(sliding(load, 3000.0, count=500))
    assert mesoslip.response(tree, fit=False)["load_steps"].sizes["load_step"] == 0


def test_reports_and_pictures_have_the_load():
    from mesoslip.plots.views.run import caption
    from mesoslip.reports.model_sentences import feature_sentence

    config = configuration("rigid", **VIBRATING)
    sentence = feature_sentence(config.contact_features["load"], "load", config)
    assert "between 400 mN and 1.6 N at 100 1/s" in sentence
    assert "normal force" in caption(mesoslip.run(config))
    assert "normal force" not in caption(mesoslip.run(configuration("rigid")))


def test_what_continues_or_repeats_needs_a_constant_load():
    config = configuration("rigid, me", **VIBRATING, drive={"velocity": 1e-5}, run__duration=0.1)
    with pytest.raises(ConfigError, match="load: has no settled cycle"):
        mesoslip.cycle(config)
    sweep = {"continue": "drive.velocity", "measures": ["mean_force"]}
    tables = config.to_dict() | {"sweep": sweep | {"grid": {"drive.velocity": [1e-5, 2e-5]}}}
    with pytest.raises(ConfigError, match=r"must be constant with sweep.continue"):
        mesoslip.sweep(tables)
