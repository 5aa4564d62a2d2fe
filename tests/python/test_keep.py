"""Contacts that keep their thresholds in all their lives (model section 19)."""

import itertools
import math

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables
from mesoslip import Config, ConfigError
from mesoslip.simulation.realization import Realization
from oracles import frozen_law, uniforms

COUNT, SEED = 300, 5


def cycled(law, width, amplitude, **changes):
    """Contacts with f_s = k = 1 under a slider that goes back and forth three times."""
    return Config.from_dict(
        {
            "run": {"seed": SEED},
            "drive": {"cycle": {"amplitude": amplitude, "velocity": 1.0, "cycles": 3}},
            "slider": {"kind": "prescribed"},
            "contacts": {
                "count": COUNT,
                "static_force": float(COUNT),
                "stiffness": float(COUNT),
                "coupling": "equal",
                "renewal": "keep",
                "threshold": {"law": law, "relative_width": width},
            }
            | changes,
            "output": {"interval": amplitude / 500},
        }
    )


def thresholds(law, width):
    """The thresholds that the contacts draw first."""
    drawn = [uniforms(SEED, 0, contact, 0)[0] for contact in range(COUNT)]
    frozen = frozen_law(law, width)
    return frozen.isf(np.array(drawn) * frozen.sf(0.0))


def loops(tree, amplitude):
    """Energy of each cycle, from one end of the path to the next [J]."""
    x, force = (tree[name].values[0] for name in ("displacement", "contact_force"))
    ends = np.flatnonzero(np.isclose(x, amplitude, rtol=1e-9))
    return [
        float(np.trapezoid(force[first : last + 1], x[first : last + 1]))
        for first, last in itertools.pairwise(ends)
    ]


@pytest.mark.parametrize(
    ("law", "width", "amplitude"),
    [("uniform", 0.55, 0.3), ("uniform", 0.2, 1.5), ("gaussian", 0.2, 1.1), ("weibull", 0.4, 0.8)],
)
def test_loops_are_those_of_iwan(law, width, amplitude):
    """Close to its threshold, a contact that slips costs k x_s over each distance: the loop is
    4 Σ k x_s (A - x_s), in each cycle, and Masing's rule holds."""
    tree = mesoslip.run(cycled(law, width, amplitude, back_force_ratio=0.998))
    x_s = thresholds(law, width)
    expected = 4 * np.sum(np.where(x_s < amplitude, x_s * (amplitude - x_s), 0.0))
    found = loops(tree, amplitude)
    assert len(found) == 2
    assert found == pytest.approx([expected] * 2, rel=5e-3)
    assert found[1] == pytest.approx(found[0], rel=1e-3)

    x, force = (tree[name].values[0] for name in ("displacement", "contact_force"))
    first = np.sum(np.minimum(x_s, np.linspace(0, amplitude, 501)[:, None]), axis=1)
    back = force[500] - 2 * np.interp(
        (amplitude - x[500:1501]) / 2, np.linspace(0, amplitude, 501), first
    )
    scale = np.max(np.abs(force))
    assert np.max(np.abs(force[:501] - first)) < 2e-3 * scale
    assert np.max(np.abs(force[500:1501] - back)) < 4e-3 * scale


def test_loops_shake_down_if_thresholds_are_drawn_again():
    """Contacts that are drawn stronger stay."""
    changes = {"back_force_ratio": 0.04}
    drawn = loops(mesoslip.run(cycled("uniform", 0.55, 0.3, renewal="redraw", **changes)), 0.3)
    kept = loops(mesoslip.run(cycled("uniform", 0.55, 0.3, **changes)), 0.3)
    assert drawn[0] < 0.4 * kept[0]
    assert drawn[1] < 0.05 * drawn[0]
    assert kept[1] == pytest.approx(kept[0], rel=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"contacts__coupling": "scaled"},
        {"contacts__newborn_width": 0.1, "contacts__delay_law": "exponential"},
        {"contacts__ageing": {"law": "log", "time": 1e-4, "growth": 0.03}},
        {"contacts__thermal": {"rate": 1e4, "force_ratio": 0.05}},
        {"slider": {"kind": "prescribed"}, "contacts__initial": "steady"},
    ],
    ids=["plain", "scaled", "newborn width", "ageing", "thermal", "prescribed, steady"],
)
def test_a_contact_keeps_its_threshold(changes):
    """The limit in all lives is that of the first draw; other draws go on."""
    tables = {
        "run__duration": 0.05,
        "drive": {"velocity": 1e-5},
        "contacts__count": 40,
        "contacts__coupling": "equal",
        "contacts__back_force_ratio": 0.3,
        "contacts__renewal": "keep",
        "contacts__threshold__relative_width": 0.3,
        "output__interval": 1e-3,
    }
    config = Config.from_dict(klein_tables(**tables | changes))
    realization = Realization(config, 0)
    lives = np.zeros(40)
    found = {}
    while not realization.finished:
        realization.advance(20)
        state = realization.contacts
        pinned = state["stiffness"] > 0
        strength = state["break_stretch"] * state["stiffness"]
        if config.contacts.ageing is not None:
            pinned &= state["renewals"] == 0
        for contact in np.flatnonzero(pinned):
            found.setdefault(contact, []).append(strength[contact])
        lives = state["renewals"]
    assert np.min(lives) >= 2
    law = frozen_law("gaussian", 0.3)
    u = law.isf(np.array([uniforms(1, 0, one, 0)[0] for one in found]) * law.sf(0.0))
    for expected, values in zip(u, found.values(), strict=True):
        limit = expected * config.contacts.contact_static_force
        if config.contacts.ageing is None:
            assert values == pytest.approx([limit] * len(values), rel=1e-9)


def test_the_steady_start_is_stationary():
    """Each contact is as often at any stretch from f_b to its threshold: F = F_s (1 + f_b/f_s)/2
    for equal contacts, more than with redraws, where weak contacts are rare."""
    count = 20_000
    config = cycled("gaussian", 0.3, 1.0, count=count, back_force_ratio=0.2, initial="steady")
    config = config.replace(
        {"drive": {"velocity": 1.0}, "run.duration": 3.0, "contacts.static_force": 1.0},
        {"contacts.stiffness": 1.0},
    )
    force = mesoslip.run(config)["contact_force"].values[0]
    assert np.max(np.abs(force - 0.6)) < 4.5 * 0.4 / math.sqrt(count)


def test_what_does_not_know_kept_thresholds_refuses_them(klein):
    with pytest.raises(ConfigError, match=r'contacts\.renewal = .keep.: must be "redraw"'):
        klein(contacts__renewal="keep", run__engine="me")
    with pytest.raises(ConfigError, match=r"contacts\.renewal"):
        klein(contacts__renewal="again")
    config = klein(contacts__renewal="keep")
    for theory in (mesoslip.curve, mesoslip.derived, mesoslip.onset):
        with pytest.raises(ConfigError, match=r"contacts\.renewal"):
            theory(config)
