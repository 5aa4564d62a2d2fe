"""What theory says of the runs of a sweep, as measures."""

from __future__ import annotations

import mesoslip
import pytest
from conftest import klein_tables
from mesoslip.campaign.measures import MEASURES, RunView

SHORT = {"run__duration": 0.3, "contacts__count": 100}


def measured(name, **changes):
    tree = mesoslip.run(klein_tables(**SHORT | changes))
    return MEASURES[name].function(RunView(tree, 0.0))


@pytest.mark.parametrize("delay", [1e-4, 1e-2])
def test_growth_is_that_of_steady_sliding(delay, klein):
    sliding = mesoslip.SteadySliding(klein(**SHORT, contacts__delay=delay))
    assert measured("growth_rate", contacts__delay=delay) == sliding.growth_rate
    stable = measured("stable_out_of_step", contacts__delay=delay)
    assert stable == sliding.is_stable_out_of_step
    # Where Klein's case slides smoothly in the end, and where it slips.
    assert stable == (delay < 1e-3)


def test_critical_stiffness_is_that_of_the_curve(klein):
    critical, _ = mesoslip.ForceCurve(klein(**SHORT)).K_star
    assert measured("critical_stiffness_ratio") == pytest.approx(critical / 97, rel=1e-9)
    assert measured("critical_stiffness_ratio", slider__stiffness=2 * critical) == pytest.approx(
        0.5
    )


def test_waiting_over_damping():
    """Klein's case slips every half second or so, and its ringing is damped at 51 1/s."""
    assert 10 < measured("waiting_over_damping", run__duration=8.0) < 100
