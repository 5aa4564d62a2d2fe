"""Rate-and-state friction: the motion of a spring and slider, and parameters fitted to records."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesoslip import RunError
from mesoslip.analysis import rate_and_state as fitting
from mesoslip.analysis.rate_and_state import LAWS, Loading, RateAndState, spring_slider
from response_coverage import NOISE, STAGES, STIFFNESS, TRUTH, departure, synthetic_fit
from scipy.integrate import solve_ivp
from scipy.special import lambertw

STEP = (Loading(10, 1e-6, 1e-6), Loading(50, 1e-5, 1e-5))


def law_of(name, **changes):
    return RateAndState(**{**TRUTH.__dict__, "law": name, **changes})


def test_the_motion_after_a_velocity_step_is_that_of_others():
    """Published benchmark numbers of the ageing law, k twice the critical stiffness."""
    times = np.array([11.0, 13.0, 40.0])
    force = spring_slider(law_of("ageing"), STEP, times, 1e3).force
    np.testing.assert_allclose(force, [0.60720485, 0.58400910, 0.58848708], rtol=0, atol=5.1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_the_motion_solves_the_equations_as_they_are_written(name):
    """Against the equations in force and θ themselves, through steps, a hold and a ramp."""
    law, stiffness = law_of(name), 6e3
    stages = (
        Loading(5, 1e-6, 1e-6),
        Loading(6, 1e-5, 1e-5),
        Loading(4, 1e-5, 2e-6),
        Loading(30, 0.0, 0.0),
        Loading(20, 1e-6, 1e-6),
    )
    times = np.linspace(0, 65, 400)
    found = spring_slider(law, stages, times, stiffness)

    def velocity(force, state):
        evolved = law.b * np.log(law.reference_velocity * state / law.slip_distance)
        return law.reference_velocity * np.exp((force - law.reference_force - evolved) / law.a)

    def derivative(time, at, stage):
        v = velocity(*at)
        ratio = v * at[1] / law.slip_distance
        change = 1 - ratio if name == "ageing" else -ratio * math.log(ratio)
        load = stage.start_velocity + (
            (stage.end_velocity - stage.start_velocity) * time / stage.duration
        )
        return [stiffness * (load - v), change]

    at, begin = [law.reference_force, law.slip_distance / 1e-6], 0.0
    for stage in stages:
        inside = (times > begin) & (times <= begin + stage.duration)
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
        force, state = solved.sol(np.minimum(times[inside] - begin, stage.duration))
        np.testing.assert_allclose(found.force[inside], force, atol=3e-7)
        np.testing.assert_allclose(found.state[inside], state, rtol=1e-5)
        at, begin = solved.y[:, -1], begin + stage.duration
    # What the spring lost, the slider went.
    load = np.interp(times, [0, 5, 11, 15, 45, 65], np.cumsum([0, 5, 60, 24, 0, 20]) * 1e-6)
    load[(times > 11) & (times < 15)] = np.nan
    moved = load - (found.force - law.reference_force) / stiffness
    good = np.isfinite(moved)
    np.testing.assert_allclose(found.displacement[good], moved[good], atol=1e-11)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("mass", [0.0, 100.0])
def test_damping_is_a_force_of_the_velocity(name, mass):
    """Against V from F = F_0 + a ln V/V_0 + b ln V_0 θ/D_c + η V by Lambert's function, and with a
    mass against Newton's law in V."""
    law, stiffness, damping = law_of(name), 6e3, 2e3
    stages = (Loading(3, 1e-6, 1e-6), Loading(4, 1e-5, 1e-5))
    times = np.linspace(0, 7, 200)

    def friction(velocity, state):
        ratio = velocity / law.reference_velocity
        evolved = law.b * np.log(law.reference_velocity * state / law.slip_distance)
        return law.reference_force + law.a * np.log(ratio) + evolved + damping * velocity

    def velocity_of(force, state):
        evolved = law.b * np.log(law.reference_velocity * state / law.slip_distance)
        driven = (force - law.reference_force - evolved) / law.a
        scale = damping * law.reference_velocity / law.a
        return law.a / damping * lambertw(scale * np.exp(driven)).real

    def derivative(_, at, load):
        force, state = at[:2]
        v = at[2] if mass else velocity_of(force, state)
        ratio = v * state / law.slip_distance
        change = 1 - ratio if name == "ageing" else -ratio * np.log(ratio)
        rates = [stiffness * (load - v), change]
        return [*rates, (force - friction(v, state)) / mass] if mass else rates

    force = law.reference_force + damping * 1e-6
    at = [force, law.slip_distance / 1e-6, *([1e-6] if mass else [])]
    at[0] = friction(1e-6, at[1])
    found = spring_slider(law, stages, times, stiffness, damping=damping, mass=mass)
    for begin, stage in zip((0.0, 3.0), stages, strict=True):
        inside = (times > begin) & (times <= begin + stage.duration)
        solved = solve_ivp(
            derivative,
            (0, stage.duration),
            at,
            "Radau",
            dense_output=True,
            args=(stage.start_velocity,),
            rtol=1e-9,
            atol=[1e-11, 1e-9, 1e-15][: len(at)],
        )
        expected = solved.sol(times[inside] - begin)[0]
        np.testing.assert_allclose(found.force[inside], expected, atol=1e-6)
        at = solved.y[:, -1]


@pytest.mark.parametrize("name", LAWS)
def test_a_slider_that_follows_the_load_point_evolves_in_closed_form(name):
    law = law_of(name)
    times = np.linspace(10.01, 30, 50)
    force = spring_slider(law, STEP, times, math.inf).force
    way = 1e-5 * (times - 10) / law.slip_distance
    if name == "ageing":
        evolved = np.log(1 + (10 - 1) * np.exp(-way)) - math.log(10)
    else:
        evolved = -math.log(10) * (1 - np.exp(-way))
    np.testing.assert_allclose(
        force, law.reference_force + law.a * math.log(10) + law.b * evolved, atol=1e-9
    )


def test_little_mass_and_damping_change_little_and_much_change_much():
    law, times = law_of("ageing"), np.linspace(9, 30, 60)
    plain = spring_slider(law, STEP, times, 1e3).force
    light = spring_slider(law, STEP, times, 1e3, mass=1e-6).force
    np.testing.assert_allclose(light, plain, atol=1e-6)
    damped = spring_slider(law, STEP, times, 1e3, damping=1.0).force
    heavy = spring_slider(law, STEP, times, 1e3, mass=1e-1 * 1e3).force
    # Steady sliding bears the damping too.
    assert damped[0] - plain[0] == pytest.approx(1e-6, rel=1e-3)
    assert np.abs(heavy - plain).max() > 1e-3


def test_what_cannot_be_followed_is_said():
    times = np.linspace(0, 60, 50)
    soft = 0.2 * law_of("ageing").critical_stiffness
    with pytest.raises(RunError, match="unstable"):
        spring_slider(law_of("ageing"), STEP, times, soft)
    # With a mass it is stick-slip.
    moving = spring_slider(law_of("ageing"), STEP, times, soft, mass=1e-6)
    assert np.isfinite(moving.force).all()
    with pytest.raises(ValueError, match="must slide"):
        spring_slider(law_of("ageing"), STAGES[3:], times, 1e3)
    with pytest.raises(ValueError, match="go back"):
        spring_slider(law_of("ageing"), (STEP[0], Loading(1, -1e-6, 0)), times, 1e3)
    with pytest.raises(ValueError, match="positive"):
        spring_slider(law_of("ageing", a=0.0), STEP, times, 1e3)


@pytest.mark.parametrize(("name", "length"), [("ageing", 0.0), ("ageing", 2e-6), ("slip", 0.0)])
def test_parameters_are_found_again_within_their_errors(name, length):
    """The number of traces is small; tests/studies/response_coverage.py has hundreds."""
    found = [synthetic_fit(name, length, seed) for seed in range(5)]
    apart = np.array([departure(one) for one in found])
    assert np.abs(apart).max() < 4
    # Mean squares of 20 departures of the size of their errors, not all independent.
    assert 0.2 < np.mean(apart**2) < 3
    assert all(one.p_value > 1e-3 and not one.at_bounds for one in found)
    # Errors of parameters that the record states well.
    assert np.median([one.errors[1] / one.law.a for one in found]) < 0.1


def test_the_wrong_law_is_reported_from_the_right_one():
    right, wrong = (synthetic_fit("ageing", 0.0, 3, name) for name in LAWS)
    assert right.p_value > 0.01 > wrong.p_value
    assert wrong.information_criterion > right.information_criterion + 100


def test_a_record_without_noise_gives_the_law_back_with_the_stiffness():
    times = np.arange(0, sum(one.duration for one in STAGES), 0.1)
    motion = spring_slider(TRUTH, STAGES, times, STIFFNESS)
    record = fitting.make_record(
        STAGES,
        times,
        motion.force,
        motion.displacement,
        fitting.Noise(0.0, 0.0),
        1.3 * STIFFNESS,
        2e-5,
    )
    found = fitting.fit(record, "ageing", free_stiffness=True)
    assert not record.has_noise
    assert found.stiffness == pytest.approx(STIFFNESS, rel=0.02)
    assert found.law.a == pytest.approx(TRUTH.a, rel=0.02)
    assert found.law.slip_distance == pytest.approx(TRUTH.slip_distance, rel=0.02)
    held = fitting.fit(record, "ageing")
    assert np.std(held.residual) > 3 * np.std(found.residual)


def test_what_a_record_does_not_report_is_said():
    """Sliding at one velocity, as in a record whose hold is too short to do anything."""
    stages = (Loading(20, 1e-6, 1e-6), Loading(20, 1.0001e-6, 1.0001e-6))
    times = np.arange(0, 40, 0.05)
    force = 0.6 + NOISE * np.random.default_rng(1).standard_normal(times.size)
    record = fitting.make_record(
        stages, times, force, 1e-6 * times, fitting.Noise(NOISE, 0.0), 1e3, 2e-5
    )
    found = fitting.fit(record, "ageing")
    relative = found.errors[1:4] / [found.law.a, found.law.b, found.law.slip_distance]
    assert found.at_bounds or np.max(relative) > 1
