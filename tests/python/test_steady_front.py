"""Steady fronts along a row of blocks: closed forms, a plain chain, and runs."""

import re
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
import pytest
from conftest import long
from kinds import configuration
from mesoslip import Config, ConfigError, SteadyFront
from mesoslip.analysis.fronts import FRONT_TYPES, first_front
from scipy.optimize import brentq

RUN = Path(__file__).parents[2] / "runs" / "front-types.toml"
# Of the run, in SI: spring of neighbours, frequency of neighbours, velocity of sound.
SPRING, RATE, SOUND = 1e7, 1e5, 1e3
UNDAMPED = {
    "contacts.drag": 0.0,
    "slider.damping": 0.0,
    "slider.loading": "edge",
    "slider.top_stiffness": None,
}


def front(**scaled: float) -> SteadyFront:
    """Steady fronts with a contact stiffness, drag and damping in units of the chain."""
    return SteadyFront(
        Config.load(RUN).replace(
            {
                **UNDAMPED,
                "contacts.stiffness": 100 * SPRING * scaled.get("contacts", 1e8),
                "contacts.drag": 1e4 * scaled.get("drag", 0.0),
                "slider.neighbour_damping": RATE * scaled.get("viscosity", 0.0),
            }
            | (
                {"slider.loading": "both", "slider.top_stiffness": 100 * SPRING * scaled["top"]}
                if "top" in scaled
                else {}
            )
        )
    )


def test_stiff_contacts_without_drag_have_the_speed_of_amundsen():
    ratios = np.array([0.1, 0.5, 0.9, 0.98])
    stiff = front()
    np.testing.assert_allclose(stiff.speed(ratios) / SOUND, (1 - ratios**2) ** -0.5, rtol=1e-6)
    assert np.isnan(stiff.stress_ratio([0.99 * SOUND, 0.0, -1.0])).all()
    assert np.isnan(stiff.speed([0.0, 1.0, 1.5])).all()


@pytest.mark.parametrize("contacts", [0.5, 25.0])
def test_soft_contacts_slow_a_front_down_by_the_closed_form(contacts):
    time = np.array([0.5, 0.9])
    roots = [
        brentq(lambda w, t=t: w**2 - contacts - 4 * np.sin(w * t / 2) ** 2, 1e-3, 10) for t in time
    ]
    expected = np.array(roots) * np.sqrt((1 - time**2) / contacts)
    ratios = front(contacts=contacts).stress_ratio(SOUND / time)
    np.testing.assert_allclose(ratios, expected, rtol=1e-7)
    assert np.all(ratios > np.sqrt(1 - time**2))


def test_a_front_without_inertia_is_in_balance_of_the_springs_from_above():
    """The springs κ_t hold block -n behind the front, u = (τ/κ_t)(1 - λⁿ), λ + 1/λ = 2 + κ_t; the
    first pinned block bears τ + u."""
    top = 0.01
    decay = brentq(lambda one: one + 1 / one - 2 - top, 0.5, 1 - 1e-9)
    balance = 1 / (1 + (1 - decay) / top)
    slow = front(drag=1.0, top=top).stress_ratio(SOUND / 5000)
    assert slow == pytest.approx(balance, rel=1e-4)


def plain_front(
    stress: float, drag: float = 0, viscosity: float = 0, contacts: float = 0, top: float = 0
) -> float:
    """Speed of a front in a plain chain, in units of sound; without a stiffness contacts are rigid.
    Steps by Runge and Kutta end where a block breaks."""
    blocks, step = 40, 0.1
    # The first block is pushed at once with all that its contacts bore.
    broken = np.arange(blocks) == 0
    moved = np.zeros((2, blocks))
    times = [0.0]

    def pull(state: Any) -> Any:
        place = np.concatenate([state[0, :1], state[0], state[0, -1:]])
        speed = np.concatenate([state[1, :1], state[1], state[1, -1:]])
        bonds = np.diff(place + viscosity * speed, n=2)
        bonds[0] += 1 - stress
        return bonds - top * state[0]

    def slope(state: Any) -> Any:
        held = stress + (contacts * state[0] if contacts else pull(state))
        bent = stress + pull(state) - np.where(broken, drag * state[1], held)
        return np.stack([state[1], bent])

    def ahead(state: Any) -> float:
        next_one = int(broken.sum())
        borne = contacts * state[0] if contacts else pull(state)
        return float(stress + borne[next_one] - 1)

    def advanced(state: Any, length: float) -> Any:
        first = slope(state)
        second = slope(state + length / 2 * first)
        third = slope(state + length / 2 * second)
        return state + length / 6 * (first + 2 * second + 2 * third + slope(state + length * third))

    now = 0.0
    while len(times) < blocks:
        later = advanced(moved, step)
        if ahead(later) < 0:
            moved, now = later, now + step
            continue
        part = brentq(lambda length, at=moved: ahead(advanced(at, length)), 0, step, xtol=1e-4)
        moved, now = advanced(moved, part), now + part
        broken[len(times)] = True
        times.append(now)
    # Before the free end has an effect.
    return 14 / (times[-6] - times[-20])


@pytest.mark.parametrize(
    ("stress", "scaled"),
    [
        long(0.5, {}),
        (0.4, {"viscosity": 0.3}),
        long(0.5, {"drag": 1.0}),
        (0.3, {"drag": 0.3, "contacts": 5.0}),
        (0.5, {"drag": 1.0, "viscosity": 0.2, "contacts": 5.0, "top": 0.1}),
    ],
)
def test_a_plain_chain_has_the_same_speed(stress, scaled):
    speed = float(front(**scaled).speed(stress)) / SOUND
    assert plain_front(stress, **scaled) == pytest.approx(speed, rel=3e-3)


@pytest.mark.parametrize(
    ("drag", "front_type", "tolerance"),
    [("100 N s/m", "supersonic", 6e-3), ("10 kN s/m", "subsonic", 2e-3)],
)
def test_a_run_has_the_speed_and_the_prestress(drag, front_type, tolerance):
    config = Config.load(RUN).replace(
        {
            "slider.blocks": 30,
            "slider.mass": "30 g",
            "slider.length": "30 cm",
            "slider.bar_stiffness": SPRING / 30,
            "slider.top_stiffness": "30 kN/m",
            "slider.stiffness": "1 kN/m",
            "slider.damping": "3e3 1/s",
            "contacts.count": 30,
            "contacts.static_force": "30 N",
            "contacts.stiffness": 30 * 20 * SPRING,
            "contacts.drag": drag,
            "contacts.threshold.relative_width": 1e-6,
            "run.drive_displacement": "0.6 mm",
            "run.stop.displacement": "50 um",
        }
    )
    tree = mesoslip.run(config)
    found = first_front(tree)
    theory = SteadyFront(config)
    assert found["speed"] == pytest.approx(float(theory.speed(theory.prestress)), rel=tolerance)
    far = 30e3 / (30 * 20 * SPRING + 30e3)
    pulled = found["start_time"] * config.drive_speed * far * 20 * SPRING
    assert pulled == pytest.approx(theory.prestress, rel=1e-5)
    assert FRONT_TYPES[int(found["front_type"])] == front_type


def test_contacts_that_attach_again_are_refused():
    with pytest.raises(ConfigError, match="contacts that attach again have no steady fronts"):
        SteadyFront(Config.load(RUN).replace({"contacts.reattach": True}))


@pytest.mark.parametrize(
    ("key", "table"),
    [
        ("contacts.thermal", {"rate": 1e4, "force_ratio": 0.05}),
        ("contacts.ageing", {"law": "log", "time": 1e-4, "growth": 0.03}),
        ("contacts.track", {"spread": 0.2, "length": 0.1}),
    ],
)
def test_contacts_without_one_strength_are_refused(key, table):
    config = Config.load(RUN).replace({key: table})
    with pytest.raises(ConfigError, match=f"{key}: has no theory of steady fronts"):
        SteadyFront(config)


def test_speeds_are_sought_between_limits():
    theory = front(drag=1.0)
    slow, fast = theory.stress_ratio([0.9e-4 * theory.sound_velocity, 99 * theory.sound_velocity])
    assert np.isnan(slow)
    assert np.isfinite(fast)
    assert np.isnan(theory.speed(1 - 1e-9))


def test_a_row_is_needed():
    message = re.escape('fronts run along the blocks of slider.kind = "interface", two or more')
    with pytest.raises(ConfigError, match=message):
        SteadyFront(configuration("rigid"))
