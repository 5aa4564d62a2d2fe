"""The event-driven run against independent models of the same contacts."""

import mesoslip
import numpy as np
import pytest
from conftest import drive_in_stages, long
from mesoslip.simulation.realization import Realization
from oracles import assert_same_events, exact_events, fixed_step

# Fast loading, so that a slip comes within some ten milliseconds.
FAST = {
    "drive__velocity": 1e-5,
    "contacts__count": 12,
    "contacts__threshold__relative_width": 0.1,
    "run__duration": 0.03,
    "output__interval": 1e-4,
}


TRACK = {"spread": 0.3, "length": 1e-8}


def breaks(config) -> list[tuple[float, int]]:
    """Time and contact of each break, by advancing one event at a time."""
    realization = Realization(config, 0)
    renewals = np.zeros(config.contacts.count)
    events = []
    while not realization.finished:
        realization.advance(1)
        now = realization.contacts["renewals"]
        events += [(realization.time, int(contact)) for contact in np.flatnonzero(now > renewals)]
        renewals = now
    return events


@pytest.mark.parametrize(
    "changes",
    [
        {"contacts__count": 1, "contacts__coupling": "equal", "slider__damping_ratio": 0.0},
        {"contacts__count": 1, "contacts__reattach": False, "contacts__drag_rate": 2e16},
        {"contacts__count": 3, "contacts__delay": 0.0},
        {"contacts__count": 5, "contacts__delay": 2e-3, "contacts__drag_rate": 2e16},
        {"contacts__count": 5, "drive__velocity": -1e-5},
        {"contacts__count": 5, "contacts__track": TRACK},
        {"contacts__count": 5, "contacts__renewal": "keep", "contacts__coupling": "equal"},
        {"contacts__count": 5, "contacts__renewal": "keep", "contacts__track": TRACK},
    ],
    ids=[
        *("one undamped", "one bundle", "no delay", "strong drag", "backward", "track"),
        *("keep", "keep, track"),
    ],
)
def test_events_are_those_of_matrix_exponentials(klein, changes):
    config = klein(**FAST | changes)
    expected = exact_events(config, scan=2e-5).events
    actual = breaks(config)
    assert len(expected) >= (1 if not config.contacts.reattach else 5)
    # What follows many breaks is sensitive to rounding; the first dozens must agree.
    first = min(len(expected), 40)
    assert_same_events(actual, expected, first)


@pytest.mark.parametrize("coupling", ["scaled", long("equal")])
def test_fixed_step_converges_to_events(klein, coupling):
    config = klein(**FAST, contacts__coupling=coupling)
    events = breaks(config)
    tree = mesoslip.run(config)
    force = tree["spring_force"].values[0]
    # Up to the end of the first slip; later, the order of breaks at a coarse step may differ.
    times = tree["time"].values
    errors = []
    steps = np.array([4e-6, 2e-6, 1e-6])
    for step in steps:
        trace, contacts = fixed_step(config, step)
        before = times < 0.022
        errors.append(np.max(np.abs(trace[:, 4] - force)[before]))
        count = 12
        same_order = [one for _, one in contacts.events[:count]] == [
            one for _, one in events[:count]
        ]
        delays = [
            time - event for (time, _), (event, _) in zip(contacts.events, events, strict=False)
        ]
        assert same_order
        assert np.max(np.abs(delays[:count])) < 20 * step
    assert errors[-1] < 2e-4 * config.contacts.static_force
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 0.7 < slope < 1.6


def test_prescribed_with_reversals_and_holds(klein):
    """Forward, a hold, back beyond the start, forward again: breaks in both directions."""
    stages = [(0.02, 1e-6), (0.005, 0.0), (0.05, -1e-6), (0.03, 1e-6)]
    config = klein(
        run__duration=None,
        drive=drive_in_stages(*stages),
        slider={"kind": "prescribed"},
        contacts__count=20,
        contacts__threshold__relative_width=0.2,
        contacts__delay=2e-3,
        output__interval=1e-3,
    )
    tree = mesoslip.run(config)
    trace, contacts = fixed_step(config, 1e-6)
    assert int(tree["breaks"].values[0]) == len(contacts.events) > 100
    difference = np.abs(tree["contact_force"].values[0] - trace[:, 5])
    # At a sample beside an event the two models may be on different sides of it.
    assert np.sort(difference)[: int(0.9 * difference.size)].max() < 2e-3 * 18e-6
    assert np.min(trace[:, 5]) < -0.5 * 18e-6


def test_driving_backward_mirrors_driving_forward(klein):
    """The two directions use different sides of the contacts' bounds, and the same numbers."""
    changes = FAST | {"contacts__count": 300, "run__duration": 0.1}
    forward = mesoslip.run(klein(**changes))
    backward = mesoslip.run(klein(**changes | {"drive__velocity": -1e-5}))
    for name in ("displacement", "velocity", "spring_force", "contact_force"):
        np.testing.assert_array_equal(forward[name].values, -backward[name].values)
    for name in ("breaks", "detached_contacts"):
        np.testing.assert_array_equal(forward[name].values, backward[name].values)
    np.testing.assert_array_equal(
        forward["slips/force_drop"].values, -backward["slips/force_drop"].values
    )
    assert forward["slips"].sizes["slip"] > 1
