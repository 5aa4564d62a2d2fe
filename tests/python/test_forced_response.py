"""The response of a slider under a force: creep, static friction, the motion in words."""

import json
import math

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables
from mesoslip import Config
from mesoslip.analysis.response.dataset import rows_of, scalars_of
from mesoslip.theory.contacts import contact_theory

SLIDER = {"kind": "force", "mass": 1.47e-3, "damping": 500.0}


@pytest.fixture(scope="module")
def creep():
    """Thermally activated contacts under two constant forces."""
    tables = klein_tables(
        slider=SLIDER,
        drive={"stage": [{"duration": 8.0, "force": 7.6e-6}, {"duration": 8.0, "force": 8.2e-6}]},
        run={"duration": 16.0},
        output={"interval": 5e-3},
        contacts__coupling="equal",
        contacts__count=2000,
        contacts__delay=0.0,
        contacts__back_force_ratio=0.0,
        contacts__threshold__relative_width=0.3,
        contacts__thermal={"rate": 1e4, "force_ratio": 0.04},
    )
    return Config.from_dict(tables)


@pytest.fixture(scope="module")
def creeping(creep):
    return mesoslip.run(creep)


def test_creep_velocities_are_those_of_the_theory(creep, creeping):
    found = mesoslip.response(creeping)
    rows = rows_of(found, "creep")
    assert [row["force"] for row in rows] == pytest.approx([7.6e-6, 8.2e-6])
    for row in rows:
        expected = contact_theory(creep).creep_velocity(row["force"])
        assert contact_theory(creep).creep_force(expected) == pytest.approx(row["force"])
        assert abs(row["velocity"] - expected) < 4 * row["velocity_error"] < 0.4 * expected
    # Over each stage, with the elastic stretch at the jump of the force before its first sample.
    time, moved = creeping["time"].values, creeping["displacement"].values[0]
    ends = np.interp([0.0, 8.0, 16.0], time, moved)
    assert [row["displacement"] for row in rows] == pytest.approx(np.diff(ends), rel=1e-3)
    slope = scalars_of(found, "creep")["creep_rate_dependence"]
    assert slope == pytest.approx(contact_theory(creep).steady_slope(rows[0]["velocity"]), rel=0.2)
    for name in ("steady", "steps", "holds", "ramps", "rate_and_state"):
        assert not rows_of(found, name)


def test_one_force_has_no_slope_of_the_velocity(creep):
    """Of two stages under one force, whose velocities differ by their noise."""
    stages = [{"duration": 2.0, "force": 7.6e-6} for _ in range(2)]
    changes = {"drive.stage": stages, "run.duration": 4.0, "contacts.count": 500}
    found = mesoslip.response(mesoslip.run(creep.replace(changes)))
    assert all(row["velocity"] > 2 * row["velocity_error"] for row in rows_of(found, "creep"))
    assert math.isnan(scalars_of(found, "creep")["creep_rate_dependence"])
    assert not rows_of(found, "restarts")


def test_a_restart_takes_longer_after_a_longer_hold(creep):
    """Thresholds have grown by g ln t, and rates are less by t^(-g/f_T)."""
    force, stages = 7.5e-6, [{"duration": 3.0, "force": 7.5e-6}]
    for hold in (0.1, 1.0, 10.0):
        stages += [{"duration": hold, "force": 1e-6}, {"duration": 3.0, "force": force}]
    changes = {
        "drive.stage": stages,
        "run.duration": sum(one["duration"] for one in stages),
        "run.realizations": 2,
        "contacts.count": 500,
        "contacts.threshold.relative_width": 0.2,
        "contacts.thermal": {"rate": 1e4, "force_ratio": 0.06},
        "contacts.ageing": {"law": "log", "time": 1e-2, "growth": 0.03},
    }
    config = creep.replace(changes)
    tree = mesoslip.run(config)
    found = mesoslip.response(tree)
    rows = rows_of(found, "restarts")
    assert [row["hold_time"] for row in rows] == pytest.approx([0.1, 1.0, 10.0])
    assert [row["force"] for row in rows_of(found, "creep")] == [force, *3 * [1e-6, force]]
    assert {row["hold_force"] for row in rows} == {1e-6}
    times = [row["restart_time"] for row in rows]
    assert np.polyfit(np.log([0.1, 1.0, 10.0]), np.log(times), 1)[0] == pytest.approx(0.5, abs=0.1)
    moved = [
        np.interp(rows[0]["stage_start_time"] + times[0], tree["time"], one)
        - np.interp(rows[0]["stage_start_time"], tree["time"], one)
        for one in tree["displacement"].values
    ]
    assert np.mean(moved) == pytest.approx(config.contacts.break_stretch, rel=0.1)


def test_the_regime_of_creep_is_smooth_and_said_in_words(creeping, tmp_path, command):
    found = mesoslip.regime(creeping)
    assert found["regime"].item() == 0
    assert found.attrs["motion"].startswith("creeps at")
    path = tmp_path / "creep.nc"
    creeping.to_netcdf(path)
    _, printed, _ = command("regime", path)
    assert "creeps at" in printed
    assert "stick-slip" not in printed
    _, printed, _ = command("response", path, "--json")
    assert len(json.loads(printed)["creep"]) == 2


def test_static_friction_is_the_maximum_of_the_force_curve(klein):
    """Of contacts without temperature, at any slow rate; the second ramp stays below it."""
    stages = [
        {"duration": 0.5, "start_force": 0.0, "end_force": 2e-6},
        {"duration": 0.3, "force": 1e-6},
        {"duration": 1.6, "start_force": 1e-6, "end_force": 1.46e-5},
    ]
    config = klein(
        slider=SLIDER,
        drive={"stage": stages},
        run={"duration": 2.4, "realizations": 2},
        contacts__coupling="equal",
        contacts__threshold__relative_width=0.2,
    )
    tree = mesoslip.run(config)
    found = mesoslip.response(tree)
    below, above = rows_of(found, "ramps")
    assert "does not slide" in below["note"]
    assert math.isnan(below["static_friction"])
    peak = mesoslip.curve(config).attrs["F_peak"]
    assert above["static_friction"] == pytest.approx(peak, rel=0.01)
    assert above["hold_time"] == pytest.approx(0.3)
    assert above["force_rate"] == pytest.approx(8.5e-6)
    regime = mesoslip.regime(tree)
    assert regime.attrs["motion"].startswith("slides from")
    assert set(regime["regime"].values) == {3}


def test_the_picture_shows_displacement_and_creep(creeping, tmp_path):
    path = tmp_path / "creep.svg"
    figure = mesoslip.plot(creeping, path, view="response")
    force = figure.axes[1]
    assert force.get_ylabel() == "force over $F_s$"
    # The right axis is drawn, and starts at no force.
    assert force.spines["right"].get_visible()
    low, high = force.get_ylim()
    assert low == 0 < force.lines[0].get_ydata().max() < high
    assert path.stat().st_size > 10_000
