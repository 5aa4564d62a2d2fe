"""Delays that are drawn from the exponential law, in both engines and in the linear response."""

import mesoslip
import numpy as np
import pytest
from mesoslip import SteadySliding
from mesoslip.simulation.realization import Realization
from oracles import uniforms
from steady_sliding import shaken_response, tables

EXPONENTIAL = {"contacts__delay_law": "exponential"}
# Delays of the order of lives, at a velocity at which a contact lives 0.8 ms.
SLIDING = {
    "slider": {"kind": "prescribed"},
    "drive": {"velocity": 1e-5},
    "run__duration": 0.03,
    "output__interval": 1e-5,
    "contacts__initial": "steady",
    "contacts__threshold__relative_width": 0.2,
    "contacts__drag_rate": 2e14,
}


def late(config):
    """The later half of the contact force of a run."""
    force = mesoslip.run(config)["contact_force"].values.ravel()
    return force[len(force) // 2 :]


@pytest.mark.parametrize("coupling", ["scaled", "equal"])
def test_the_steady_force_is_that_of_fixed_delays(klein, coupling):
    config = klein(**SLIDING | EXPONENTIAL, contacts__coupling=coupling)
    expected = mesoslip.derived(config)["F_steady_drive"].value
    fixed = mesoslip.derived(klein(**SLIDING, contacts__coupling=coupling))["F_steady_drive"].value
    assert expected == fixed == pytest.approx(SteadySliding(config).force, rel=1e-7)
    me = config.replace({"run.engine": "me", "run.resolution": 0.1})
    assert late(me)[-1] == pytest.approx(expected, rel=1e-4)
    # 4080 contacts over twenty lives.
    assert late(config).mean() == pytest.approx(expected, rel=4e-3)


def test_both_engines_and_the_error_of_steps(klein):
    """A jump of the velocity and a hold: the master equation is of second order, and N to infinity
    of contacts one by one."""
    stages = [
        {"duration": 2e-3, "velocity": 1e-5},
        {"duration": 1e-3, "hold": True},
        {"duration": 2e-3, "velocity": -2e-5},
    ]
    changes = SLIDING | EXPONENTIAL | {"drive": {"stage": stages}, "contacts__initial": "relaxed"}
    changes["run__duration"] = None
    runs = {
        resolution: mesoslip.run(klein(**changes, run__engine="me", run__resolution=resolution))
        for resolution in (0.2, 0.1, 0.05)
    }
    force = {one: tree["contact_force"].values.ravel() for one, tree in runs.items()}
    assert np.max(np.abs(force[0.1] - force[0.05])) < 1e-3 * 18e-6
    coarse, fine = (np.abs(force[one] - force[one / 2]).mean() for one in (0.2, 0.1))
    assert coarse > 2.5 * fine
    detached = runs[0.05]["detached_contacts"].values.ravel()
    many = mesoslip.run(klein(**changes | {"contacts__count": 160_000}))
    difference = many["contact_force"].values.ravel() - force[0.05]
    assert np.max(np.abs(difference)) < 5 / 400 * 18e-6
    waiting = many["detached_contacts"].values.ravel() / 160_000 - detached / 4080
    assert np.max(np.abs(waiting)) < 5 / 400


def test_each_delay_has_a_key_of_its_own(klein):
    """A contact attaches -tau_d ln d after it broke, d being the second deviate of its next birth;
    the first one is its threshold's, so that draws of thresholds do not move."""
    changes = {"contacts__initial": "relaxed", "contacts__count": 400, "run__duration": 2.2e-3}
    config = klein(**SLIDING | EXPONENTIAL | changes, contacts__coupling="equal")
    contacts = config.contacts
    law = mesoslip.ThresholdLaw("gaussian", 0.2, contacts.back_force_ratio)
    with Realization(config, 0) as run:
        while not run.ending:
            run.advance()
        found = run.contacts
    once = np.flatnonzero((found["renewals"] == 1) & (found["stiffness"] > 0))
    assert len(once) > 100
    broke = law.quantile([uniforms(1, 0, one, 0)[0] for one in once]) * contacts.break_stretch
    delay = -contacts.delay * np.log([uniforms(1, 0, one, 1)[1] for one in once])
    stretch = contacts.back_force_ratio * contacts.break_stretch
    expected = broke + 1e-5 * delay - stretch
    # Origins are relative to a displacement that moves along with the slider.
    origin = found["origin"][once]
    np.testing.assert_allclose(origin - origin[0], expected - expected[0], rtol=0, atol=1e-18)


def test_response_is_that_of_a_memoryless_delay(klein):
    """Against the response with fixed delays, averaged where it is linear in e^(-λ t)."""
    fixed = SteadySliding(klein(drive__velocity=2e-6))
    random = SteadySliding(klein(drive__velocity=2e-6, **EXPONENTIAL))
    # Slow perturbations see the slope of F(v) alone.
    assert complex(random.response_at(0.01)) == pytest.approx(
        complex(fixed.response_at(0.01)), rel=1e-3
    )
    assert random.slope == fixed.slope
    contacts = {"threshold": {"law": "gaussian", "relative_width": 0.3}, "delay_law": "exponential"}
    config = mesoslip.Config.from_dict(
        {
            **tables(contacts=contacts),
            "run": {"engine": "me", "duration": 1.0},
            "drive": {"velocity": 1e-6},
        }
    )
    expected = complex(SteadySliding(config).response(600.0))
    found = shaken_response(1e-6, 600.0, 1e-10, 0.1, periods=8, contacts=contacts)
    assert found == pytest.approx(expected, rel=0.02)
