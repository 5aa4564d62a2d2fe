"""A slider under a force: closed forms, conservation, and the force curve."""

import math
import tomllib

import mesoslip
import numpy as np
import pytest
from conftest import ROOT, long
from mesoslip import Config, ConfigError

pytestmark = pytest.mark.usefixtures("no_step_errors")

MASS = 1.47e-3
FORCE = {"kind": "force", "mass": MASS, "damping": 40.0}
# Contacts of one stiffness: pinned ones together have Nk exactly.
EQUAL = {"contacts__coupling": "equal", "output": {"interval": 1e-4}}


def test_pinned_contacts_are_a_damped_spring(klein):
    """Until a contact breaks: M X" + M eta X' + Nk X = F after a jump of the force."""
    config = klein(**EQUAL, slider=FORCE, drive={"force": 5e-6}, run={"duration": 0.1})
    tree = mesoslip.run(config)
    time = tree["time"].values
    decay = 20.0
    frequency = math.sqrt(config.contacts.stiffness / MASS - decay**2)
    still = 5e-6 / config.contacts.stiffness
    exact = still * (
        1
        - np.exp(-decay * time)
        * (np.cos(frequency * time) + decay / frequency * np.sin(frequency * time))
    )
    assert tree.attrs["break_count"] == 0
    np.testing.assert_allclose(tree["displacement"].values[0], exact, atol=1e-12 * still)
    np.testing.assert_array_equal(tree["spring_force"].values, 5e-6)


def test_a_ramp_of_pinned_contacts(klein):
    """X = r t/k - ... with undamped ringing of the amplitude r/(k w)."""
    config = klein(
        **EQUAL,
        slider=FORCE | {"damping": 0.0},
        drive={"force_rate": 1e-6},
        run={"duration": 0.5},
    )
    tree = mesoslip.run(config)
    time = tree["time"].values
    frequency = math.sqrt(config.contacts.stiffness / MASS)
    exact = 1e-6 / config.contacts.stiffness * (time - np.sin(frequency * time) / frequency)
    np.testing.assert_allclose(tree["displacement"].values[0], exact, atol=1e-11 * exact[-1])


def test_a_freed_slider_falls(klein):
    """Without contacts to attach again: M X" + (C + M eta) X' = F, X in closed form."""
    config = klein(
        **EQUAL,
        slider=FORCE,
        drive={"stage": [{"duration": 0.01, "force": 1e-3}, {"duration": 0.2, "force": 4e-4}]},
        run={"duration": 0.2},
        contacts__reattach=False,
    )
    tree = mesoslip.run(config)
    time, velocity = tree["time"].values, tree["velocity"].values[0]
    assert tree.attrs["break_count"] == config.contacts.count
    late = time > 0.011
    rate = 40.0 + config.contacts.drag_rate * tree_mass(config) / MASS
    limit = 4e-4 / MASS / rate
    start = np.flatnonzero(late)[0]
    exact = limit + (velocity[start] - limit) * np.exp(-rate * (time[late] - time[start]))
    np.testing.assert_allclose(velocity[late], exact, rtol=1e-10)


def tree_mass(config):
    """Mass of all contacts, whose drag is theirs times the drag rate."""
    contacts = config.contacts
    return contacts.film_density * contacts.area * contacts.film_thickness


@pytest.mark.parametrize("sign", [long(1.0), -1.0])
def test_static_friction_is_the_peak_of_the_force_curve(klein, sign):
    """Under a slow ramp the slider starts to slide at F_peak, up to the noise of N contacts."""
    config = klein(
        slider=FORCE,
        drive={"force_rate": sign * 1e-6},
        contacts__count=20_000,
        run={"duration": 20.0, "stop": {"displacement": sign * 1e-7}},
    )
    tree = mesoslip.run(config)
    peak = float(mesoslip.curve(config).attrs["F_peak"])
    assert tree.attrs["ending"] == "displacement of the slider reached"
    assert abs(1e-6 * tree["time"].values[-1] - peak) < 4e-3 * peak
    assert np.sign(tree["spring_force"].values[0, -1]) == sign


def test_sliding_under_a_force_is_the_inverse_of_the_force_over_the_velocity(klein):
    """Where drag makes the friction grow with the velocity, a constant force has one velocity."""
    common = {
        "contacts__count": 200,
        "contacts__threshold__relative_width": 0.3,
        "contacts__drag_rate": 2e15,
        "contacts__coupling": "equal",
    }
    velocity = 5e-4
    driven = mesoslip.run(
        klein(
            **common,
            slider={"kind": "prescribed"},
            contacts__initial="steady",
            drive__velocity=velocity,
            run={"duration": 0.02},
            output={"interval": 1e-6},
        )
    )
    force = float(driven["contact_force"].values[0, 2000:].mean())
    pushed = mesoslip.run(
        klein(
            **common,
            slider=FORCE | {"damping": 0.0},
            drive={
                "stage": [{"duration": 0.01, "force": 5e-5}, {"duration": 0.19, "force": force}]
            },
            run={"duration": 0.2},
            output={"interval": 1e-4},
        )
    )
    time, displacement = pushed["time"].values, pushed["displacement"].values[0]
    late = time > 0.1
    mean = np.polyfit(time[late], displacement[late], 1)[0]
    assert abs(mean / velocity - 1) < 0.05
    assert abs(pushed["energy_residual"].values[0]) < 1e-9


def test_a_hold_takes_one_step(klein):
    """A slider that has come to rest needs no steps for a million seconds."""
    config = klein(
        contacts__coupling="equal",
        slider=FORCE,
        drive={"force": 5e-6},
        run={"duration": 1e6},
        output={"interval": 1e5},
    )
    tree = mesoslip.run(config)
    assert tree["displacement"].values[0, -1] == pytest.approx(2.5e-9, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"slider": FORCE}, ["drive", "must be a force"]),
        ({"drive": {"force": 1e-6}}, ["drive.force", "force"]),
        ({"slider": {"kind": "prescribed"}, "drive": {"force": 1e-6}}, ["drive.force", '"force"']),
        (
            {"slider": FORCE, "drive": {"force": 1e-6}, "contacts__initial": "steady"},
            ["contacts.initial", "relaxed"],
        ),
        (
            {
                "slider": FORCE,
                "drive": {
                    "stage": [{"duration": 1.0, "force": 1e-6}, {"duration": 1, "hold": True}]
                },
            },
            ["drive.stage", "must all have forces"],
        ),
        (
            {"slider": FORCE, "drive": {"stage": [{"displacement": 1e-6, "force": 1e-6}]}},
            ["displacement", "is not for a force"],
        ),
        (
            {"slider": FORCE, "drive": {"stage": [{"duration": 1.0, "start_force": 1e-6}]}},
            ["end_force", "missing"],
        ),
        (
            {"slider": FORCE, "drive": {"force": 1e-6}, "run": {"drive_displacement": 1e-6}},
            ["run.drive_displacement", "is not for a force"],
        ),
    ],
)
def test_errors_name_the_key(klein, changes, expected):
    with pytest.raises(ConfigError) as caught:
        klein(**changes)
    for part in expected:
        assert part in str(caught.value)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_slider_at_rest_up_to_rounding_follows_a_growing_force(seed):
    """It turns within the resolution of the time, which used to end the run without progress."""
    config = Config.load(ROOT / "runs" / "static-friction-rate.toml")
    tables = tomllib.loads(config.to_toml())
    tables["drive"]["stage"] = [
        {"duration": 2.0, "force": 0.0},
        {"duration": 1.0, "start_force": 0.0, "end_force": 10.8e-6},
        {"duration": 2.0, "force": 0.0},
        {"duration": 0.1, "start_force": 0.0, "end_force": 13e-6},
    ]
    del tables["run"]["duration"]
    tables["run"] |= {"realizations": 1, "seed": seed}
    tree = mesoslip.run(tables)
    assert tree["time"].values[-1] == pytest.approx(5.1)
    assert tree["contact_force"].values[0, 5000:].max() > 0.6 * config.contacts.static_force
