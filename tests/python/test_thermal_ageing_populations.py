"""Infinitely many contacts that age and break by thermal activation: closed forms and limits."""

import math
from typing import Any

import numpy as np
import pytest
from conftest import at_end, drive_in_stages, long
from kinds import RELAX, configuration
from mesoslip import Config, Realization
from mesoslip.theory.contacts import contact_theory
from test_thermal import unit
from test_thermal_populations import COUNT, extrapolated_force, finished

LOG = {"law": "log", "time": 1.0, "growth": 0.05}
YOUNG = {"law": "relax", "time": 30.0, "young_force_ratio": 0.6, "young_relative_width": 0.2}


@pytest.mark.parametrize(
    ("threshold", "ageing", "ratio", "velocity"),
    [
        ({"law": "gaussian", "relative_width": 0.2}, LOG, 0.02, 1e-4),
        long({"law": "gaussian", "relative_width": 0.1}, YOUNG, 0.04, 1e-1),
        long({"law": "uniform", "relative_width": 0.3}, LOG, 0.08, 1e-1),
        ({"law": "weibull", "relative_width": 0.2}, YOUNG, 0.04, 1e-1),
    ],
)
def test_steady_force_is_that_of_the_theory(threshold, ageing, ratio, velocity):
    changes: dict[str, Any] = {
        "contacts__threshold": threshold,
        "contacts__ageing": ageing,
        "contacts__thermal": {"rate": 1.0, "force_ratio": ratio},
    }
    expected = contact_theory(unit(COUNT, **changes)).steady_force(velocity) / COUNT
    assert extrapolated_force(velocity, 12.0, **changes) == pytest.approx(expected, rel=5e-4)


@pytest.mark.parametrize(
    "ageing",
    [
        pytest.param({"law": "log", "time": 1e-4, "growth": 0.03}, id="log"),
        pytest.param(RELAX, id="relax", marks=pytest.mark.long),
    ],
)
def test_many_contacts_come_to_the_populations(ageing):
    """With slips, a hold and a reversal."""
    many = 5000
    changes = {"contacts__ageing": ageing, "contacts__back_force_ratio": 0.1}
    exact = finished(
        configuration("rigid, thermal", run__engine="me", run__resolution=0.5, **changes)
    )
    assert abs(exact.energy_residual) < 1e-8
    drawn = finished(configuration("rigid, thermal", contacts__count=many, **changes))
    difference = drawn.trace[:, 5] - exact.trace[:, 5]
    assert np.sqrt(np.mean(difference**2)) < 1.5 / math.sqrt(many) * 18e-6


def test_thresholds_that_do_not_grow_are_the_model_without_ageing():
    """By nodes over the thresholds, and by tables."""

    def force(**changes):
        kind = "prescribed, thermal"
        common = {"run__engine": "me", "run__resolution": 1.0}
        return finished(configuration(kind, **common, **changes)).trace[:, 5]

    same = force(contacts__ageing={"law": "log", "time": 1e6, "growth": 0.0})
    np.testing.assert_allclose(same, force(), rtol=0, atol=1e-8 * 18e-6)


@pytest.mark.long
def test_without_temperature_it_is_the_model_without():
    """The difference falls with f_T, to the errors of both."""

    def force(**changes):
        kind = "prescribed, me"
        common = {"contacts__coupling": "equal", "contacts__ageing": RELAX, "run__resolution": 0.5}
        return finished(configuration(kind, **common, **changes)).trace[:, 5]

    plain = force()
    differences = [
        np.max(np.abs(force(contacts__thermal={"rate": 1e3, "force_ratio": ratio}) - plain))
        for ratio in (4e-2, 2e-2)
    ]
    assert differences[0] < 0.015 * 18e-6
    assert differences[1] < 0.45 * differences[0]


@pytest.mark.parametrize("delay", [1e-8, 1e-6])
def test_steps_of_a_hold_are_not_as_short_as_the_delay(delay):
    """Few contacts break in a delay then: what waits to attach leaves no gaps that end steps."""
    config = Config.from_dict(
        {
            "run": {"engine": "me"},
            "drive": drive_in_stages((3.0, 1.0), (1.0, 0.0), (2.0, -1.0), (1.0, 0.0)),
            "slider": {"kind": "rigid", "mass": 0.01, "stiffness": 0.5, "damping_ratio": 0.3},
            "contacts": {
                "count": 300,
                "static_force": 1.0,
                "stiffness": 1.0,
                "drag_rate": 0.0,
                "delay": delay,
                "coupling": "equal",
                "threshold": {"law": "gaussian", "relative_width": 0.05},
                "ageing": {
                    "law": "relax",
                    "time": 0.1,
                    "young_force_ratio": 0.9,
                    "young_relative_width": 0.3,
                },
                "thermal": {"rate": 10.0, "force_ratio": 0.05},
            },
            "output": {"interval": 0.05},
        }
    )
    with Realization(config, estimates_errors=False, resolution=0.5) as run:
        while not run.finished and run.advances < 3000:
            run.advance(500)
        assert run.finished
        assert run.advances < 1000


def test_the_error_at_resolution_one_is_seen():
    """Of a creeping slider, by a run with steps a fourth as long: the coarse run by which a run
    estimates its error has longer steps than that of resolution 1."""
    runs = [
        Realization(
            configuration(
                "rigid, thermal",
                run={"engine": "me", "duration": 0.1, "resolution": resolution},
                drive={"velocity": 1.538e-6},
                contacts__delay=0.0,
                contacts__back_force_ratio=0.1,
                contacts__threshold={"law": "gaussian", "relative_width": 0.212},
                contacts__thermal={"rate": 342.0, "force_ratio": 0.0778},
                contacts__ageing={
                    "law": "relax",
                    "time": 0.05,
                    "young_force_ratio": 0.7,
                    "young_relative_width": 0.2,
                },
                output={"interval": 1e-3},
            )
        )
        for resolution in (1.0, 0.25)
    ]
    for one in runs:
        at_end(one)
    starts = [one.slips[:, 1].min(initial=math.inf) for one in runs]
    before = runs[0].trace[:, 0] < min(starts)
    error = np.max(np.abs(runs[0].trace[before, 5] - runs[1].trace[before, 5]))
    assert error / 5 < runs[0].force_error < 5 * error
