"""Linear stability of steady sliding of contacts that age or break by thermal activation."""

import math

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import long
from matplotlib.figure import Figure
from mesoslip import Config, SteadySliding
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.rigid import RigidSlider
from mesoslip.theory import steady_curve
from mesoslip.theory.contacts.ageing_sliding import AgeingSliding
from mesoslip.theory.contacts.thermal_sliding import RateAndStateTheory
from mesoslip.theory.critical_spring import critical_spring
from mesoslip.theory.steady_sliding import sliding_of, stability_boundary, steady_sliding
from steady_sliding import shaken_response, tables

pytestmark = pytest.mark.usefixtures("no_step_errors")

LOG = {"law": "log", "time": 1e-3, "growth": 0.05}
RELAX = {"law": "relax", "time": 1e-2, "young_force_ratio": 0.6, "young_relative_width": 0.3}
HOT = {"rate": 1e4, "force_ratio": 0.03}
COLD = {"rate": 1e-6, "force_ratio": 0.02}


def sliding(klein, **changes):
    equal = {"contacts__coupling": "equal", "contacts__threshold__relative_width": 0.1}
    return klein(**equal | changes)


@pytest.mark.parametrize(
    ("ageing", "law", "velocity"),
    [
        *((LOG, "exponential", 1e-5), long(None, "fixed", 1e-7), long(RELAX, "fixed", 1e-7)),
        *(long(None, "fixed", 1e-5), long(LOG, "exponential", 1e-7), long(RELAX, "fixed", 1e-5)),
        *(long(None, "exponential", 1e-5), long(LOG, "fixed", 1e-5)),
        long(RELAX, "exponential", 1e-5),
    ],
)
def test_without_temperature_stability_is_that_of_contacts_without(klein, ageing, law, velocity):
    """Roots, their number, and the spring that makes sliding stable."""
    changes = {"contacts__delay_law": law} | ({"contacts__ageing": ageing} if ageing else {})
    cold = sliding(klein, **changes)
    warm = sliding(klein, **changes, contacts__thermal=COLD)
    expected, found = sliding_of(cold, velocity), sliding_of(warm, velocity)
    assert type(expected) is (SteadySliding if ageing is None else AgeingSliding)
    assert found.unstable_count == expected.unstable_count
    assert found.leading_root == pytest.approx(expected.leading_root, rel=1e-6)
    assert found.force == pytest.approx(expected.force, rel=1e-6)
    assert found.slope == pytest.approx(expected.slope, rel=1e-5)
    assert found.is_stable_dephased == expected.is_stable_dephased
    if ageing is None:
        assert found.critical_stiffness == pytest.approx(expected.critical_stiffness, rel=1e-4)


@pytest.mark.parametrize(("layers", "damping"), [(2, 1e-3), (4, 10.0), (16, 1e-3), (16, 10.0)])
def test_unstable_modes_of_layers_with_temperature(klein, layers, damping):
    """As many as without where there is hardly any; hot contacts feed the slowest mode alone."""
    chain = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": layers}
    changes = {"slider": chain | {"layer_damping": damping}, "drive__velocity": 1e-6}
    expected = sliding_of(sliding(klein, **changes)).unstable_count
    assert expected > 2
    assert sliding_of(sliding(klein, **changes, contacts__thermal=COLD)).unstable_count == expected
    hot = sliding_of(sliding(klein, **changes, contacts__thermal=HOT | {"force_ratio": 0.05}))
    assert hot.unstable_count == 2


@pytest.mark.parametrize(
    ("contacts", "velocity"),
    [
        long({"thermal": {"rate": 1e4, "force_ratio": 0.1}}, 1e-5),
        ({"thermal": {"rate": 1e4, "force_ratio": 0.1}, "delay_law": "exponential"}, 1e-5),
        ({"ageing": LOG, "delay": 0.0}, 1e-5),
    ],
    ids=["temperature", "exponential delays", "ageing"],
)
def test_the_engine_answers_as_the_theory(contacts, velocity):
    """The master equation under a slider that is shaken a little."""
    contacts = contacts | {"coupling": "equal"}
    config = Config.from_dict(
        {
            **tables(contacts=contacts),
            "run": {"engine": "me", "duration": 1.0},
            "drive": {"velocity": velocity},
        }
    )
    expected = complex(sliding_of(config).response(600.0))
    found = shaken_response(velocity, 600.0, 1e-9, 0.05, periods=4, contacts=contacts)
    assert abs(found - expected) < 0.01 * abs(expected)


def test_the_critical_spring_of_rate_and_state_is_that_of_rice_and_ruina():
    """Exactly, with the response of one state, at three masses."""
    law, velocity = RateAndStateTheory(0.2e-6, 0.5e-6, 3e-9), 1e-7

    def response(frequency):
        rate = 1j * frequency / velocity
        return rate * (law.a - law.b / (1 + rate * law.slip_distance))

    for mass in (1e-9, 1e-2, 10.0):
        slider = RigidSlider(mass=mass, stiffness=97.0, damping=0.0)
        found = critical_spring(slider, response, np.geomspace(1e-2, 1e4, 40))
        assert found is not None
        assert found[0] == pytest.approx(law.critical_stiffness(velocity, mass), rel=1e-4)
        frequency = math.sqrt((law.b - law.a) / law.a) * velocity / law.slip_distance
        assert found[1] == pytest.approx(frequency, rel=1e-4)
        # One layer is a rigid slider; light layers are one spring, heavy ones need a stiffer one.
        for layers in (1, 4):
            chain = LayeredSlider(kind="layered", mass=mass, stiffness=97.0, layers=layers)
            same = critical_spring(chain, response, np.geomspace(1e-2, 1e4, 40))
            assert same is not None
            assert same[1] == pytest.approx(frequency, rel=1e-4)
            if layers == 1 or mass < 1e-8:
                assert same[0] == pytest.approx(found[0], rel=1e-4)


def test_a_critical_spring_between_the_frequencies_of_the_path_is_found():
    """A dip below zero, narrower than the parabola through three frequencies, which stays above."""
    middle = 20.0

    def response(frequency):
        return 1j * (1 - 1.2 * np.exp(-((frequency - middle) ** 2)))

    path = middle + 0.45 + 1.5 * np.arange(-3, 4)
    assert np.all(response(path).imag > 0)
    found = critical_spring(RigidSlider(mass=1e-3, stiffness=97.0, damping=0.0), response, path)
    assert found is not None
    frequency = middle + math.sqrt(math.log(1.2))
    assert found == pytest.approx((1e-3 * frequency**2, frequency), rel=1e-6)


@pytest.mark.parametrize(("layers", "damping"), [(2, 300.0), long(8, 500.0)])
def test_the_critical_spring_of_layers_is_where_stability_ends(klein, layers, damping):
    """By counting roots; with much stiffer springs as well."""
    changes = {
        "contacts__delay": 0.0,
        "contacts__coupling": "equal",
        "contacts__ageing": LOG | {"growth": 0.05},
        "contacts__threshold__relative_width": 0.2,
        "drive__velocity": 3e-6,
    }
    slider = {"kind": "layered", "mass": 1.47e-3, "layers": layers, "layer_damping": damping}
    config = klein(slider=slider | {"stiffness": 97.0}, **changes)
    found = sliding_of(config).critical_stiffness
    assert found is not None
    for factor, is_stable in ((0.97, False), (1.03, True), (10.0, True)):
        other = config.replace({"slider.stiffness": factor * found[0]})
        assert sliding_of(other).is_stable == is_stable
    on_base = slider | {"stiffness": 97.0, "base": {"mass": 1.0, "stiffness": 1e5}}
    assert not sliding_of(klein(slider=on_base, **changes)).has_critical_stiffness
    delayed = config.replace({"contacts.delay": 1e-4})
    assert not sliding_of(delayed).has_critical_stiffness


@pytest.mark.parametrize(
    ("damping", "delay", "velocity", "width", "drag", "law"),
    [
        (0.0, 0.0274, 2e-5, 0.3, 4e11, "fixed"),
        (1.0, 2e-5, 1e-5, 0.02, 8e10, "exponential"),
        long(1.0, 2e-4, 2e-6, 0.1, 2e9, "fixed"),
    ],
)
def test_the_critical_spring_with_delay_is_the_stiffest_one(
    klein, damping, delay, velocity, width, drag, law
):
    """No growth with stiffer springs, also of a slider with hardly any damping of its own."""
    config = sliding(
        klein,
        slider={"mass": 1.47e-3, "stiffness": 97.0, "damping": damping},
        contacts__delay=delay,
        contacts__delay_law=law,
        contacts__drag_rate=drag,
        contacts__threshold__relative_width=width,
        drive__velocity=velocity,
    )
    found = sliding_of(config)
    assert found.critical_stiffness is not None
    for factor in (1.1, 1.5, 3.0, 10.0, 100.0):
        stiffness = factor * found.critical_stiffness[0]
        assert sliding_of(config.replace({"slider.stiffness": stiffness})).is_stable
    # Softer springs have ranges of stability, one between two turns of the response.
    near = config.replace({"slider.stiffness": 0.9995 * found.critical_stiffness[0]})
    assert not sliding_of(near).is_stable


def test_there_is_no_critical_spring_beyond_what_can_be_resolved(klein):
    """Without damping, and with hardly any drag, fixed delays feed any stiff spring."""
    config = sliding(
        klein,
        slider={"mass": 1.47e-3, "stiffness": 97.0, "damping": 0.0},
        contacts__delay=1.5e-2,
        contacts__drag_rate=3.4e7,
        contacts__threshold__relative_width=0.3,
        drive__velocity=3.75e-7,
    )
    found = sliding_of(config)
    assert not found.has_critical_stiffness
    assert found.critical_stiffness is None
    assert found.limit is None


@pytest.mark.parametrize(
    ("growth", "mass"), [(0.05, 1.0), *map(long, [0.05, 0.02, 0.02], [1e-9, 1e-9, 1.0])]
)
def test_the_critical_spring_of_contacts_is_near_that_of_rate_and_state(klein, growth, mass):
    """Within a third while the limit grows a hundredfold with the mass; one state is not all."""
    config = sliding(
        klein,
        contacts__delay=0.0,
        contacts__back_force_ratio=0.0,
        contacts__ageing=LOG | {"growth": growth},
        contacts__thermal={"rate": 1e4, "force_ratio": 0.01},
        slider={"mass": mass, "stiffness": 97.0, "damping": 0.0},
    )
    found = sliding_of(config)
    expected = found.rate_and_state.critical_stiffness(config.drive_speed, mass)
    assert found.critical_stiffness is not None
    assert 0.75 < found.critical_stiffness[0] / expected < 1.35


# The ends of a uniform law turn the response at frequencies far above those of contacts in step.
UNIFORM = {"law": "uniform", "relative_width": 0.5}
LIGHT = {"slider__mass": 7e-4, "slider__damping_ratio": 0.021}


@pytest.mark.parametrize(
    ("delay", "velocity", "changes"),
    [
        (1e-4, 1e-6, {}),
        (2e-3, 1e-7, {}),
        (5.9e-5, 1.24e-6, {"contacts__threshold": UNIFORM} | LIGHT),
    ],
)
def test_the_critical_spring_is_where_stability_ends(klein, delay, velocity, changes):
    """With a damping that is a ratio, and grows with the spring: by counting roots instead."""
    config = klein(
        contacts__delay=delay,
        drive__velocity=velocity,
        contacts__threshold__relative_width=0.2,
        **changes,
    )
    found = SteadySliding(config).critical_stiffness
    assert found is not None
    # No softer or stiffer spring above it is unstable.
    counted = stability_boundary(config, "slider.stiffness", 0.9 * found[0], 16 * found[0])
    assert found[0] == pytest.approx(counted, rel=2e-3)


def test_curve_and_info_report_stability_over_velocity(klein, tmp_path, command, monkeypatch):
    monkeypatch.setattr(steady_curve, "DECADES", 1)
    config = sliding(
        klein,
        drive__velocity=3e-6,
        contacts__delay=0.0,
        contacts__back_force_ratio=0.0,
        contacts__ageing=LOG | {"growth": 0.1},
        contacts__thermal=HOT,
    )
    file, output = tmp_path / "creep.toml", tmp_path / "curve.nc"
    file.write_text(config.to_toml())
    printed = command.output("curve", file, "-o", output)
    assert "stable above" in printed
    assert "is linearly unstable, with temperature and ageing" in printed
    printed = command("info", file)[1]
    assert "stable with springs stiffer than" in printed
    assert "mesoslip curve computes K*" not in printed.splitlines()[-1]
    with xr.open_datatree(output) as tree:
        assert isinstance(mesoslip.plot(tree), Figure)
        velocity, force, slope, stiffness = (
            tree[one].values
            for one in ("velocity", "steady_force", "steady_slope", "critical_stiffness")
        )
        boundary = float(tree.attrs["boundaries"])
    np.testing.assert_array_equal(stiffness > config.spring_stiffness, velocity < boundary)
    stable = [sliding_of(config, factor * boundary).is_stable for factor in (0.95, 1.05)]
    assert stable == [False, True]
    # The slope is that of F(v).
    np.testing.assert_allclose(
        np.diff(force), np.diff(np.log(velocity)) * (slope[1:] + slope[:-1]) / 2, rtol=0.1
    )


def test_sweeps_measure_the_growth_of_creep(klein):
    config = sliding(klein, contacts__thermal=HOT, drive__velocity=1e-6)
    found = steady_sliding(config, 10**6)
    assert found is not None
    assert found.growth_rate == sliding_of(config).growth_rate
    assert found.work < 10**4
