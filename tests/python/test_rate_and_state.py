"""Rate-and-state friction: motions of a spring and slider, and laws fitted to records of runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import long
from mesoslip import _core
from mesoslip.analysis.rate_and_state.law import RateAndState
from mesoslip.analysis.rate_and_state.points import Loading, Points
from mesoslip.analysis.rate_and_state.search import fit_laws
from oracles import Friction, spring_slider
from response_coverage import (
    NOISE,
    STAGES,
    STIFFNESS,
    TRUTH,
    departure,
    record_of,
    synthetic_fit,
)
from scipy.integrate import solve_ivp

STEP = (Loading(10, 1e-6, 1e-6), Loading(50, 1e-5, 1e-5))
# Steps, a ramp and a hold.
VARIED = (
    Loading(5, 1e-6, 1e-6),
    Loading(6, 1e-5, 1e-5),
    Loading(4, 1e-5, 2e-6),
    Loading(30, 0.0, 0.0),
    Loading(20, 1e-6, 1e-6),
)
LAWS = ("ageing", "slip")


def motion(law, stages, times, stiffness, tolerance=1e-10):
    """Force and displacement by the integrator of the package; NaN if it fails."""
    parameters = [law.a, law.b, law.slip_distance, 0.0, 1.0, stiffness, 0.0]
    force, displacement, failed, _, _ = _core.rate_and_state_motions(
        law.law,
        1,
        np.asfortranarray(np.array([parameters]).T),
        law.reference_velocity,
        *(
            np.array([getattr(one, name) for one in stages])
            for name in ("duration", "start_velocity", "end_velocity")
        ),
        times,
        tolerance,
    )
    scale = math.nan if failed[0] else 1.0
    return law.reference_force + scale * force[:, 0], scale * displacement[:, 0]


def along(law, stages, times, force, stiffness):
    """A law of the package along a record whose points are samples, and its parameters scaled."""
    count = np.ones(times.size)
    points = Points(stages, times, 0 * count, force, np.arange(times.size), count, 1.0)
    found = RateAndState(points, law.law, stiffness, (0.1 * law.slip_distance, law.slip_distance))
    values = {
        "reference_force": (law.reference_force - found.level) / found.scale,
        "a": math.log(law.a / found.scale),
        "b": law.b / found.scale,
        "slip_distance": math.log(law.slip_distance),
    }
    return found, np.array([values[name] for name in found.names])


def test_the_motion_after_a_velocity_step_is_that_of_others():
    """Published benchmark numbers of the ageing law, k twice the critical stiffness."""
    force, _ = motion(TRUTH, STEP, np.array([11.0, 13.0, 40.0]), 1e3)
    np.testing.assert_allclose(force, [0.60720485, 0.58400910, 0.58848708], rtol=0, atol=5.1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_the_motion_solves_the_equations_as_they_are_written(name):
    """Against the equations in force and θ themselves, through steps, a hold and a ramp."""
    law, stiffness = replace(TRUTH, law=name), 6e3
    times = np.linspace(0, 65, 400)
    found, displacement = motion(law, VARIED, times, stiffness)

    def derivative(time, at, stage):
        force, state = at
        evolved = law.b * np.log(law.reference_velocity * state / law.slip_distance)
        v = law.reference_velocity * np.exp((force - law.reference_force - evolved) / law.a)
        ratio = v * state / law.slip_distance
        change = 1 - ratio if name == "ageing" else -ratio * math.log(ratio)
        load = stage.start_velocity + (
            (stage.end_velocity - stage.start_velocity) * time / stage.duration
        )
        return [stiffness * (load - v), change]

    at, begin, moved = [law.reference_force, law.slip_distance / 1e-6], 0.0, 0.0
    for stage in VARIED:
        inside = (times > begin) & (times <= begin + stage.duration)
        since = np.minimum(times[inside] - begin, stage.duration)
        solved = solve_ivp(
            derivative,
            (0, stage.duration),
            at,
            "Radau",
            dense_output=True,
            args=(stage,),
            rtol=1e-9,
            atol=[1e-11, 1e-9],
        )
        force, _ = solved.sol(since)
        np.testing.assert_allclose(found[inside], force, atol=3e-7)
        # The slider moves as the load point less the stretch of the spring.
        change = stage.end_velocity - stage.start_velocity
        load = moved + (stage.start_velocity + 0.5 * change * since / stage.duration) * since
        stretch = (found[inside] - law.reference_force) / stiffness
        np.testing.assert_allclose(displacement[inside], load - stretch, atol=1e-11)
        at, begin = solved.y[:, -1], begin + stage.duration
        moved += 0.5 * (stage.start_velocity + stage.end_velocity) * stage.duration


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("is_rigid", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_motion_is_that_of_another_integrator(name, is_rigid, seed):
    """Over decades of the parameters, as residuals of a record by LSODA."""
    rng = np.random.default_rng(seed)
    a, distance = 10 ** rng.uniform(-3, -1), 10 ** rng.uniform(-6, -4)
    law = Friction(0.6, 1e-6, a, a * rng.uniform(0.2, 1.8), distance, name)
    stiffness = math.inf if is_rigid else 2 * a / distance * 10 ** rng.uniform(0, 2)
    times = np.sort(rng.uniform(0, 65, 200))
    force = spring_slider(law, VARIED, times, stiffness).force
    # A prescribed slider at rest has no force.
    times, force = times[np.isfinite(force)], force[np.isfinite(force)]
    assert np.ptp(force) > a
    found, at = along(law, VARIED, times, force, stiffness)
    np.testing.assert_allclose(found.residuals(at) * found.scale / a, 0, atol=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_a_slider_that_follows_the_load_point_evolves_in_closed_form(name):
    law = replace(TRUTH, law=name)
    times = np.linspace(10.01, 30, 50)
    way = 1e-5 * (times - 10) / law.slip_distance
    if name == "ageing":
        evolved = np.log(1 + (10 - 1) * np.exp(-way)) - math.log(10)
    else:
        evolved = -math.log(10) * (1 - np.exp(-way))
    force = law.reference_force + law.a * math.log(10) + law.b * evolved
    found, at = along(law, STEP, times, force, math.inf)
    np.testing.assert_allclose(found.residuals(at) * found.scale, 0, atol=1e-9)


@pytest.mark.parametrize("within", [1.0, 0.5])
@pytest.mark.parametrize("name", LAWS)
def test_the_integrator_is_of_fourth_order(name, within):
    """At the ends of stages and within its steps: steps are fractions of stages, into which the
    motion is cut, if no error is too large."""
    law, errors = replace(TRUTH, law=name), []
    for parts in (1, 2, 4):
        size = 0.1 / parts
        stages = (Loading(1, 1e-6, 1e-6), *(40 * parts * [Loading(size, 3e-6, 3e-6)]))
        times = 1 + 0.1 * np.arange(40) + within * size
        found, exact = (motion(law, stages, times, 2e3, one)[0] for one in (1e9, 1e-13))
        errors.append(np.abs(found - exact).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 4, atol=0.3)


def test_an_unstable_motion_fails():
    times = np.linspace(0, 60, 50)
    soft = 0.2 * (TRUTH.b - TRUTH.a) / TRUTH.slip_distance
    assert np.isnan(motion(TRUTH, STEP, times, soft)[1]).all()
    found, at = along(TRUTH, STEP, times, 0.6 + 1e-3 * times, soft)
    assert found.forces(at[None, :])[2].all()
    assert np.abs(found.residuals(at)).min() >= 10
    assert not found.jacobian(at).any()


@pytest.mark.parametrize(("name", "length"), [long("ageing", 0.0), ("ageing", 2e-6), ("slip", 0.0)])
def test_parameters_are_found_again_within_their_errors(name, length):
    """The number of traces is small; tests/studies/response_coverage.py has hundreds."""
    found = [synthetic_fit(name, length, seed) for seed in range(5)]
    apart = np.array([departure(one) for one in found])
    assert np.abs(apart).max() < 4
    # Mean squares of 20 departures of the size of their errors, not all independent.
    assert 0.2 < np.mean(apart**2) < 3
    assert all(one.p_value > 1e-3 and one.is_determined for one in found)
    # Errors of parameters that the record states well.
    assert np.median([one.error("a") / one.value("a") for one in found]) < 0.1


def test_the_wrong_law_is_reported_from_the_right_one():
    right, wrong = (synthetic_fit("ageing", 0.0, 3, name) for name in LAWS)
    assert right.p_value > 0.01 > wrong.p_value
    assert wrong.information_criterion > right.information_criterion + 100


def test_a_record_without_noise_gives_the_law_back_with_the_stiffness():
    times = np.arange(0, sum(one.duration for one in STAGES), 0.1)
    motion = spring_slider(TRUTH, STAGES, times, STIFFNESS)
    record = record_of(times, motion.force, motion.displacement, 1.3 * STIFFNESS, 0.0)
    found = fit_laws(replace(record, stiffness=math.nan), ["ageing"])["ageing"]
    assert found.noise.deviation == 0
    assert found.value("stiffness") == pytest.approx(STIFFNESS, rel=0.02)
    assert found.value("a") == pytest.approx(TRUTH.a, rel=0.02)
    assert found.value("slip_distance") == pytest.approx(TRUTH.slip_distance, rel=0.02)
    held = fit_laws(record, ["ageing"])["ageing"]
    assert np.std(held.residual) > 3 * np.std(found.residual)


def test_what_a_record_does_not_report_is_said():
    """Sliding at one velocity, as in a record whose hold is too short to do anything."""
    stages = (Loading(20, 1e-6, 1e-6), Loading(20, 1.0001e-6, 1.0001e-6))
    times = np.arange(0, 40, 0.05)
    force = 0.6 + NOISE * np.random.default_rng(1).standard_normal(times.size)
    found = fit_laws(record_of(times, force, 1e-6 * times, 1e3, NOISE, stages=stages), ["ageing"])
    names = ("a", "b", "slip_distance")
    relative = [found["ageing"].error(one) / abs(found["ageing"].value(one)) for one in names]
    assert found["ageing"].undetermined or max(relative) > 1
