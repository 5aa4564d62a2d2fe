"""Thermally activated breaking of infinitely many contacts: closed forms, order, limits."""

import math
from typing import Any

import mesoslip
import numpy as np
import pytest
from conftest import at_end, long
from kinds import configuration
from mesoslip import Config, ConfigError, Realization
from mesoslip.theory.contacts import contact_theory
from test_thermal import unit

# Units of f_s, k and ω_0.
COUNT = 1000
TABLE = {"law": "table", "samples": [0.8, 0.9, 1.0, 1.05, 1.1, 1.15]}


def finished(config: Config) -> Realization:
    one = at_end(Realization(config, estimates_errors=False))
    one.close()
    return one


def sliding(velocity: float, resolution: float, distance: float, **changes: Any) -> Config:
    """Sliding at a velocity from the steady state of slow sliding."""
    duration = distance / velocity
    return unit(
        COUNT,
        run={"engine": "me", "duration": duration, "resolution": resolution},
        drive__velocity=velocity,
        output__interval=duration / 50,
        **{"contacts__initial": "steady"} | changes,
    )


def last_force(config: Config) -> float:
    return float(finished(config).trace[-1, 5])


def extrapolated_force(velocity: float, distance: float, **changes: Any) -> float:
    """From two resolutions, the error being of second order; over F_s."""
    coarse, fine = (
        last_force(sliding(velocity, resolution, distance, **changes)) for resolution in (0.5, 0.25)
    )
    return (4 * fine - coarse) / 3 / COUNT


@pytest.mark.parametrize(("velocity", "force"), [long(1e-4, 0.3721068), (1e-2, 0.4634253)])
def test_steady_force_is_the_closed_form_to_six_digits(velocity, force):
    assert extrapolated_force(velocity, 90.0) == pytest.approx(force, abs=1e-6)


@pytest.mark.parametrize(
    ("threshold", "ratio", "velocity"),
    [
        ({"law": "uniform", "relative_width": 0.3}, 0.04, 1e-3),
        long({"law": "weibull", "relative_width": 0.4}, 0.04, 1e-2),
        ({"law": "exponential", "relative_width": 1.0}, 0.01, 1e-2),
        long({"law": "lognormal", "relative_width": 0.2}, 1.0, 1.0),
        (TABLE, 0.02, 1e-5),
        ({"law": "gaussian", "relative_width": 0.2}, 1e-3, 1e-4),
    ],
)
def test_steady_force_of_other_laws_with_delay_and_back_force(threshold, ratio, velocity):
    changes = {
        "contacts__threshold": threshold,
        "contacts__thermal": {"rate": 1.0, "force_ratio": ratio},
        "contacts__back_force_ratio": 0.1,
        "contacts__delay": 0.1 / velocity,
    }
    expected = contact_theory(unit(COUNT, **changes)).steady_force(velocity) / COUNT
    assert extrapolated_force(velocity, 12.0, **changes) == pytest.approx(expected, rel=5e-4)


def test_hold_relaxes_as_the_closed_form_over_five_decades():
    velocity, slide = 1e-2, 1500.0
    times = 10.0 ** np.arange(1, 6)
    stages = [{"duration": slide, "velocity": velocity}]
    stages += [{"duration": one, "velocity": 0.0} for one in np.diff([0.0, *times])]
    config = unit(
        COUNT,
        run={"engine": "me", "resolution": 0.25},
        drive={"stage": stages},
        contacts__initial="steady",
        contacts__threshold__relative_width=0.2,
        output__interval=10.0,
    )
    trace = finished(config).trace
    held = trace[np.searchsorted(trace[:, 0], slide + times - 1.0)]
    np.testing.assert_allclose(held[:, 0] - slide, times)
    np.testing.assert_allclose(
        held[:, 5], contact_theory(config).hold_force(velocity, times), rtol=3e-4
    )


@pytest.mark.parametrize("force", [0.46, long(0.3)])
def test_creep_under_a_force_is_the_inverse_of_the_steady_force(force):
    changes: dict[str, Any] = {
        "slider": {"kind": "force", "mass": 1e3, "damping": 1.0},
        "drive": {"force": force * COUNT},
        "contacts__threshold__relative_width": 0.2,
    }
    velocity = contact_theory(unit(COUNT, **changes)).creep_velocity(force * COUNT)
    duration = 12 / velocity
    creep = []
    for resolution in (0.5, 0.25):
        run = {"engine": "me", "duration": duration, "resolution": resolution}
        one = finished(unit(COUNT, run=run, output__interval=duration / 12, **changes))
        (early, late) = one.trace[[-4, -1]]
        creep.append((late[2] - early[2]) / (late[0] - early[0]))
    coarse, fine = creep
    assert coarse == pytest.approx(velocity, rel=1e-2)
    assert (4 * fine - coarse) / 3 == pytest.approx(velocity, rel=1e-3)
    # Settled steps are as long as what breaks allows, not as an oscillation.
    assert one.advances < 2e4
    assert abs(one.energy_residual) < 1e-5


def test_a_long_hold_takes_few_steps():
    """Of 2·10⁷ delays."""
    config = configuration(
        "rigid, thermal, me",
        drive={"stage": [{"duration": 0.04, "velocity": 1e-5}, {"duration": 1e4, "hold": True}]},
        output={"interval": 100.0},
        run__resolution=0.5,
    )
    one = finished(config)
    assert one.advances < 1e4
    assert abs(one.energy_residual) < 1e-5
    force = one.trace[1:, 5]
    assert np.all(np.diff(force) < 0)
    assert 0 < force[-1] < 0.8 * force[0]


@pytest.mark.parametrize(
    "kind", ["rigid, thermal", *map(long, ["layered, thermal", "prescribed, thermal"])]
)
def test_errors_are_of_second_order_with_slips_and_reversals(kind):
    """Or smaller: with coarser steps slips come too early or too late."""
    coarse, middle, fine = (
        finished(configuration(kind, run__engine="me", run__resolution=resolution)).trace[:, 5]
        for resolution in (0.5, 0.25, 0.125)
    )
    ratio = np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine)
    assert ratio > 3


def test_many_contacts_come_to_the_populations():
    many = 20_000
    changes = {"contacts__count": many, "contacts__back_force_ratio": 0.1}
    exact = finished(configuration("rigid, thermal", run__engine="me", **changes)).trace[:, 5]
    drawn = finished(configuration("rigid, thermal", **changes)).trace[:, 5]
    assert np.sqrt(np.mean((drawn - exact) ** 2)) < 1.5 / math.sqrt(many) * 18e-6


def test_without_temperature_it_is_the_model_without():
    """The difference falls with f_T."""

    def force(**changes):
        kind = "prescribed, me"
        return finished(configuration(kind, contacts__coupling="equal", **changes)).trace[:, 5]

    plain = force()
    differences = [
        np.max(np.abs(force(contacts__thermal={"rate": 1e3, "force_ratio": ratio}) - plain))
        for ratio in (1e-2, 1e-3)
    ]
    assert differences[0] < 0.1 * np.max(np.abs(plain))
    assert differences[1] < 0.15 * differences[0]


@pytest.mark.parametrize(
    "changes",
    [
        long({}),
        {"contacts__delay_law": "exponential"},
        long({"contacts__newborn_width": 0.05}),
        {"contacts__newborn_width": 0.05, "contacts__initial": "steady"},
    ],
)
def test_energy_is_balanced(changes):
    config = configuration("rigid, thermal", run__engine="me", run__resolution=1.0, **changes)
    tree = mesoslip.run(config)
    # Steps of a radian: the work on contacts that attach is by a polynomial of fourth order.
    assert abs(float(tree["energy_residual"].item())) < 3e-8
    assert float(tree["detached_contacts"].max()) <= 48 * (1 + 1e-12)


def test_an_output_has_the_error_of_its_force():
    config = configuration("prescribed, thermal", run__engine="me", run__resolution=1.0)
    tree = mesoslip.run(config)
    fine = finished(config.replace({"run.resolution": 0.2})).trace[:, 5]
    error = np.max(np.abs(np.ravel(tree["contact_force"]) - fine))
    assert 0.2 * error < float(tree["force_error"].item()) < 5 * error


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("contacts__coupling", "scaled", 'must be "equal"'),
        ("contacts__initial", "uniform", '"relaxed" or "steady"'),
    ],
)
def test_what_is_refused(key, value, message):
    with pytest.raises(ConfigError, match=message):
        unit(**{"run__engine": "me", key: value})
