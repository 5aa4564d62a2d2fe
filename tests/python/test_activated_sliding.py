"""Friction of activated contacts: creep, holds, restarts, and the stability of steady sliding."""

import math
import re

import mesoslip
import numpy as np
import pytest
import tomli_w
from conftest import drive_in_stages, long
from mesoslip import Config, MesoslipError, SteadySliding
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.contacts.narrow_thresholds import rate_and_state_of_narrow_thresholds
from mesoslip.theory.steady_sliding import sliding_of
from oracles import aged
from test_thermal import aged_force, unit

LOG = {"law": "log", "time": 1.0, "growth": 0.05}
SLOW_LOG = LOG | {"growth": 0.02}
RELAX = {"law": "relax", "time": 20.0, "young_force_ratio": 0.6, "young_relative_width": 0.3}


@pytest.mark.parametrize("ageing", [LOG, RELAX], ids=["log", "relax"])
def test_steady_force_of_ageing_contacts_is_that_of_a_plain_quadrature(ageing):
    config = unit(
        1,
        contacts__threshold__relative_width=0.2,
        contacts__ageing=ageing,
        contacts__thermal__force_ratio=0.1,
    )
    assert contact_theory(config).steady_force(config.drive_speed) == pytest.approx(
        aged_force(config), rel=1e-3
    )


@pytest.mark.parametrize(("ageing", "ratio"), [(LOG, 0.04), (RELAX, 0.1)], ids=["log", "relax"])
def test_ageing_contacts_in_uniform_motion_bear_the_steady_force(ageing, ratio):
    """One by one, from the state of contacts that do not age, which is forgotten."""
    config = unit(
        2000,
        contacts__ageing=ageing,
        contacts__thermal__force_ratio=ratio,
        contacts__initial="steady",
    )
    force = mesoslip.run(config)["contact_force"].values[0, 200:]
    steady = contact_theory(config).steady_force(config.drive_speed)
    # The scatter of the mean is 5e-4.
    assert np.mean(force) == pytest.approx(steady, rel=2e-3)


@pytest.mark.parametrize("law", ["uniform", *map(long, ["gaussian", "weibull"])])
def test_creep_is_the_inverse_of_the_steady_force(law):
    config = unit(1, contacts__threshold={"law": law, "relative_width": 0.2})
    for velocity in (1e-6, 1e-2):
        force = contact_theory(config).steady_force(velocity)
        assert contact_theory(config).creep_velocity(force) == pytest.approx(velocity, rel=1e-8)
    assert math.isnan(contact_theory(config).creep_velocity(2.0))


def test_damping_of_a_slider_under_a_force_slows_its_creep():
    slider = {"kind": "force", "mass": 2.0, "damping": 3.0}
    config = unit(1, slider=slider, drive={"force": 0.3})
    velocity = 1e-2
    force = contact_theory(config).steady_force(velocity) + 6.0 * velocity
    assert contact_theory(config).creep_velocity(force) == pytest.approx(velocity, rel=1e-8)


@pytest.mark.parametrize("delay", [long(0.0), 4.0])
def test_hold_and_restart_are_those_of_contacts_one_by_one(delay):
    """N contacts slide, stand still and go on; within the noise of N."""
    count, velocity, hold = 20_000, 1e-2, 300.0
    config = unit(
        count,
        run__duration=None,
        drive=drive_in_stages((800.0, velocity), (hold, 0.0), (120.0, velocity)),
        contacts__threshold={"law": "uniform", "relative_width": 0.3},
        contacts__back_force_ratio=0.05,
        contacts__delay=delay,
    )
    tree = mesoslip.run(config)
    time, force = tree["time"].values, tree["spring_force"].values[0] / count
    error = 0.5 / math.sqrt(count)
    assert abs(
        force[(time > 700) & (time < 800)].mean()
        - contact_theory(config).steady_force(velocity) / count
    ) < (3 * error)
    held = time[(time > 800) & (time <= 1100)]
    expected = contact_theory(config).hold_force(velocity, held[9::140] - 800) / count
    np.testing.assert_allclose(force[np.isin(time, held[9::140])], expected, atol=4 * error)
    predicted = contact_theory(config).restart(velocity, hold)
    again = (time >= 1100) & (time <= 1200)
    at = np.interp(velocity * (time[again] - 1100), predicted.displacement, predicted.force / count)
    np.testing.assert_allclose(force[again], at, atol=4 * error)
    # What stands in the hold goes on together: the peak stands out of the noise of its mean.
    window = np.abs(velocity * (time - 1100) - predicted.peak_displacement) < 0.05
    height = (
        force[window].mean()
        - np.interp(
            velocity * (time[window] - 1100), predicted.displacement, predicted.force / count
        ).mean()
    )
    assert abs(height) < 2 * error
    assert (
        predicted.peak / count - contact_theory(config).steady_force(velocity) / count > 4 * error
    )


def test_a_restart_without_a_hold_is_steady():
    config = unit(1, contacts__delay=5.0, contacts__ageing=LOG)
    force = contact_theory(config).restart(1e-2, 0.0).force
    np.testing.assert_allclose(force, contact_theory(config).steady_force(1e-2), rtol=2e-3)


def test_holds_in_which_newborn_contacts_break_are_refused():
    config = unit(1, contacts__back_force_ratio=0.5)
    with pytest.raises(MesoslipError, match="attach in it with the back force"):
        contact_theory(config).hold_force(1e-2, 1e6)


def test_a_newborn_width_is_refused():
    config = unit(1, contacts__newborn_width=0.05)
    theory = contact_theory(config)
    for function in (theory.steady_force, theory.steady_slope, theory.creep_velocity):
        with pytest.raises(MesoslipError, match="newborn_width"):
            function(0.1)


def klein_activated(rate: float, ratio: float, ageing: dict | None = None, **changes) -> Config:
    tables = Config.load("runs/klein.toml").to_dict()
    contacts = tables["contacts"]
    contacts |= {"coupling": "equal", "drag_rate": 2e14, "delay": 2e-3}
    contacts["threshold"]["relative_width"] = 0.2
    contacts["thermal"] = {"rate": rate, "force_ratio": ratio}
    if ageing is not None:
        contacts["ageing"] = ageing
    tables["drive"] = {"velocity": 1e-6}
    return Config.from_dict(tables).replace(changes)


def test_without_temperature_the_response_is_that_of_contacts_without():
    warm = klein_activated(1e-3, 0.02)
    tables = warm.to_dict()
    del tables["contacts"]["thermal"]
    cold = SteadySliding(Config.from_dict(tables))
    frequency = np.array([10.0, 100.0, 400.0])
    np.testing.assert_allclose(
        sliding_of(warm).response(frequency), cold.response(frequency), rtol=1e-5
    )


def test_a_slow_change_has_the_steady_slope():
    sliding = sliding_of(klein_activated(1e4, 0.1, {"law": "log", "time": 1e-3, "growth": 0.02}))
    slope = contact_theory(sliding.config).steady_slope(1e-6) / 1e-6
    assert complex(sliding.response_at(1e-3)).real / 1e-3 == pytest.approx(slope, rel=1e-4)


def test_fast_motion_joins_slower_motion():
    sliding = sliding_of(klein_activated(1e4, 0.2))
    lives = sliding.lives
    limit = 20 * lives.speed / lives.scale
    below, above = sliding.response(np.array([0.999, 1.001]) * limit)
    assert abs(above / below - 1) < 0.01


def cohort_force(config: Config, step: float, path: np.ndarray, thresholds: int) -> np.ndarray:
    """Force over F_s of the master equation in small steps, at displacements x_s a step apart.

    Uniform thresholds; contacts slide steadily before, and attach with no force. The contacts of
    one threshold that attached in one step are a cohort, spread evenly over a step; they break at
    the rate of its middle, and where they come to their threshold. Errors are of second order.
    """
    velocity, late = config.drive_speed, round(config.contacts.delay / step)
    law = config.contacts.threshold
    deviate = 2 * (np.arange(thresholds) + 0.5) / thresholds - 1
    threshold = 1 + law.relative_width * math.sqrt(3) * deviate
    count = math.ceil(1.6 * max(threshold) / (velocity * step))
    ages = step * (np.arange(count) + 0.5)
    limit = np.broadcast_to(threshold[:, None], (thresholds, count))
    if config.contacts.ageing:
        limit = np.array([aged(config, ages)[0] * one for one in threshold])
    thermal = config.contacts.thermal
    rates = thermal.rate * np.exp((velocity * ages - limit) / thermal.force_ratio)
    hazard = np.cumsum(rates, axis=1) * step - rates * step / 2
    below = np.clip((limit / velocity - ages) / step + 0.5, 0.0, 1.0)
    survival = below * np.exp(-hazard)
    births = 1 / (survival.sum(axis=1).mean() * step + late * step)
    number = survival * births * step / thresholds
    stretch = np.tile(velocity * ages, (thresholds, 1))
    waiting, newborn = [births * step] * late, np.ones((thresholds, 1))
    force = []
    for moved in np.diff(path):
        before, stretch = stretch, stretch + moved
        rate = thermal.rate * np.exp(((before + stretch) / 2 - limit) / thermal.force_ratio)
        last, below = below, np.clip((limit - stretch) / moved + 0.5, 0.0, 1.0)
        left = number * np.exp(-rate * step) * below / np.maximum(last, 1e-300)
        waiting.append(1 - left.sum() - sum(waiting))
        number = np.concatenate([newborn * waiting[0] / thresholds, left[:, :-1]], axis=1)
        stretch = np.concatenate([newborn * moved / 2, stretch[:, :-1]], axis=1)
        below = np.concatenate([newborn, below[:, :-1]], axis=1)
        waiting = waiting[1:]
        force.append(np.sum(number * stretch))
    return np.array(force)


@pytest.mark.parametrize(
    ("ageing", "delay"),
    [(None, 20.0), (LOG, 0.0), long(None, 0.0), long(LOG, 20.0)],
    ids=["delay", "log", "plain", "log, delay"],
)
def test_response_is_that_of_cohorts_in_small_steps(ageing, delay):
    """The master equation in small steps of time, under a slider that oscillates a little."""
    velocity, amplitude, frequency = 1e-2, 1e-3, 0.15
    period = 2 * math.pi / frequency
    step = period / 200
    config = unit(
        1,
        contacts__threshold={"law": "uniform", "relative_width": 0.1},
        contacts__thermal__force_ratio=0.1,
        contacts__ageing=ageing,
        contacts__delay=round(delay / step) * step,
    )
    times = step * np.arange(2201)
    path = velocity * times + amplitude * np.sin(frequency * times)
    force, times = cohort_force(config, step, path, 6), times[1:]
    last = times > times[-1] - 2 * period + step / 2
    found = 2j * np.mean(force[last] * np.exp(-1j * frequency * times[last])) / amplitude
    expected = complex(sliding_of(config).response(frequency))
    assert abs(found - expected) < 0.02 * abs(expected)


@pytest.mark.parametrize(
    ("velocity", "ageing", "thresholds"),
    [(3e-2, LOG, 20), (1e-3, SLOW_LOG, 12), long(1e-3, LOG, 12), long(1e-3, None, 12)],
    ids=["thresholds reached", "strengthening", "ageing", "no ageing"],
)
def test_rate_and_state_are_those_of_a_velocity_step_of_cohorts(velocity, ageing, thresholds):
    """a: the evolution continued back to the step; a - b: the end; D_c: the area between."""
    ratio = 0.03
    config = unit(
        1,
        drive={"velocity": velocity},
        contacts__threshold={"law": "uniform", "relative_width": 0.2},
        contacts__thermal={"rate": 1.0, "force_ratio": ratio},
        contacts__ageing=ageing,
    )
    logarithm = 0.04
    step = ratio / 6 / velocity
    times = step * np.arange(math.ceil(8 / (velocity * step)))
    up, down = (
        cohort_force(config, step, velocity * math.exp(sign * logarithm / 2) * times, thresholds)
        for sign in (1, -1)
    )
    change = (up - down) / logarithm
    displacement = velocity * times[1:]
    found = sliding_of(config).rate_and_state
    early = (displacement > 6 * ratio) & (displacement < 0.5)
    direct = np.polyfit(displacement[early], change[early], 3)[-1]
    assert found.a == pytest.approx(direct, rel=0.03)
    net = change[displacement > 6].mean()
    assert found.a - found.b == pytest.approx(net, rel=0.02, abs=2e-4)
    area = np.trapezoid(change - net, displacement) + ratio * found.a
    assert found.slip_distance == pytest.approx(area / (found.a - net), rel=0.04)


@pytest.mark.parametrize(("ratio", "velocity"), [(0.1, 1e-18), (1.0, 1e-12), (1e6, 1e-9)])
def test_steady_force_far_below_thresholds_is_that_of_constant_rates(ratio, velocity):
    """Contacts break at ω_0 exp(-f_s/f_T) each, with a normal law of thresholds."""
    none = dict.fromkeys(("contacts.delay", "contacts.drag_rate", "contacts.back_force_ratio"), 0.0)
    width = {"contacts.threshold.relative_width": 0.01}
    config = klein_activated(1e2, ratio, None, **none, **width)
    contacts = config.contacts
    life = math.exp(1 / ratio) / 1e2 * math.exp(1.5 * (0.01 / ratio) ** 2)
    force = contacts.static_force / contacts.break_stretch * velocity * life
    assert contact_theory(config).steady_force(velocity) == pytest.approx(force, rel=1e-5)
    slope = contact_theory(config).steady_slope(velocity)
    assert slope == pytest.approx(force, rel=1e-5)


def test_a_force_that_does_not_evolve_has_no_slip_distance(monkeypatch):
    config = klein_activated(1e2, 0.1)
    sliding = sliding_of(config)
    monkeypatch.setattr(type(sliding), "slope", sliding.rate_and_state.a / sliding.velocity)
    found = sliding_of(config).rate_and_state
    assert found.b == 0
    assert math.isnan(found.slip_distance)
    assert "slip_distance" not in {one.name for one in contact_theory(config).quantities()}


def test_the_critical_stiffness_divides_stable_from_unstable_springs():
    config = klein_activated(
        1e4, 0.1, {"law": "log", "time": 1e-3, "growth": 0.2}, **{"contacts.delay": 0.0}
    )
    limit = sliding_of(config).critical_stiffness
    assert limit is not None
    stiffness, _ = limit
    for factor, is_stable in ((0.97, False), (1.03, True)):
        sliding = sliding_of(config.replace({"slider.stiffness": factor * stiffness}))
        assert sliding.is_stable == is_stable


@pytest.mark.parametrize("velocity", [1e-9, 1e-8, 1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize(("ratio", "growth", "back"), [(0.01, 0.02, 0.0), (0.02, 0.05, 0.2)])
def test_rate_and_state_of_narrow_thresholds(velocity, ratio, growth, back):
    """In closed form to the first order in f_T, also where contacts come to their thresholds."""
    config = klein_activated(1e4, ratio, {"law": "log", "time": 1e-3, "growth": growth})
    config = config.replace(
        {
            "contacts.delay": 0.0,
            "contacts.threshold.relative_width": 0.01,
            "contacts.back_force_ratio": back,
        }
    )
    found = sliding_of(config, velocity).rate_and_state
    narrow = rate_and_state_of_narrow_thresholds(config, velocity)
    assert found.a == pytest.approx(narrow.a, rel=0.03)
    assert found.b == pytest.approx(narrow.b, rel=0.01)
    assert found.a - found.b == pytest.approx(narrow.a - narrow.b, rel=0.01)
    length = config.contacts.break_stretch
    assert abs(found.slip_distance - narrow.slip_distance) < 0.5 * ratio * length


def test_run_prints_the_velocity_of_creep_under_a_force(tmp_path, command):
    """Two stages: that of the last one, which the theory gives to the noise of N contacts."""
    tables = klein_activated(1e4, 0.04, **{"contacts.delay": 0.0}).to_dict()
    tables["run"]["duration"] = 12.0
    tables["slider"] = {"kind": "force", "mass": 1.47e-3, "damping": 50.0}
    tables["drive"] = {
        "stage": [{"duration": 4.0, "force": 7.6e-6}, {"duration": 8.0, "force": 7.8e-6}]
    }
    tables["contacts"] |= {"back_force_ratio": 0.0, "count": 2000}
    tables["contacts"]["threshold"]["relative_width"] = 0.3
    path = tmp_path / "creep.toml"
    path.write_text(tomli_w.dumps(tables))
    _, _, printed = command("run", path, "-o", tmp_path / "creep.nc")
    assert "stick-slip" not in printed
    found = re.search(r"mean velocity in the last stage: ([\d.]+) nm/s", printed)
    assert found is not None
    expected = contact_theory(Config.from_dict(tables)).creep_velocity(7.8e-6)
    assert float(found[1]) * 1e-9 == pytest.approx(expected, rel=0.15)


def test_drag_is_part_of_the_direct_effect():
    """The force of the master equation jumps by it at a step of the velocity."""
    wide = {
        "contacts.drag_rate": 2e15,
        "contacts.delay": 5e-4,
        "contacts.threshold.relative_width": 0.3,
        "contacts.back_force_ratio": 0.0,
    }
    config = klein_activated(1e4, 0.02, **wide)
    velocity, logarithm = 1e-5, 0.02
    found = sliding_of(config, velocity).rate_and_state
    length = config.contacts.break_stretch
    jumps = []
    for sign in (1, -1):
        after = velocity * math.exp(sign * logarithm / 2)
        tables = config.to_dict()
        tables["run"] = {"engine": "me"}
        tables["slider"] = {"kind": "prescribed"}
        before = (14 * length / velocity, velocity)
        tables["drive"] = drive_in_stages(before, (0.1 * length / after, after))
        tables["output"] = {"interval": 1e-3 * length / velocity}
        tree = mesoslip.run(tables)
        moved = tree["displacement"].values[0] - 14 * length
        jumps.append(np.interp(2e-3 * length, moved, tree["contact_force"].values[0]))
    direct = (jumps[0] - jumps[1]) / logarithm
    assert found.a == pytest.approx(direct, rel=0.02)
    assert found.slip_distance > 0
