"""Contacts that attach with forces of a normal law."""

import functools

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, long, problem_of
from mesoslip import ConfigError, SteadySliding
from mesoslip.simulation.realization import Realization
from mesoslip.theory.force_curve import ForceCurve
from scipy import stats

pytestmark = pytest.mark.usefixtures("no_step_errors")

WIDTH = 0.08
SLIDING = {
    "slider": {"kind": "prescribed"},
    "drive": {"velocity": 1e-7},
    "run": {"drive_displacement": 1.2e-7},
    "output": {},
    "contacts__delay": 0.0,
    "contacts__drag_rate": 0.0,
    "contacts__newborn_width": WIDTH,
    "contacts__threshold__relative_width": 0.15,
}


def force_of(config):
    tree = mesoslip.run(config)
    return tree["displacement"].values.ravel(), tree["contact_force"].values.ravel()


@functools.cache
def steady(coupling):
    """⟨k (x_s² - x_b²)/2⟩/⟨x_s - x_b⟩ over thresholds and forces at attaching, by quadrature."""
    u, f = np.meshgrid(np.linspace(0.1, 2.5, 2001)[1:], np.linspace(-0.6, 0.8, 1401))
    weight = stats.norm.pdf(u, 1, 0.15) * stats.norm.pdf(f, 0.1, WIDTH) * (np.abs(f) < u)
    k = np.sqrt(u) if coupling == "scaled" else 1.0
    return np.sum(weight * (u**2 - f**2) / (2 * k)) / np.sum(weight * (u - f) / k)


@pytest.mark.parametrize("coupling", [long("equal"), "scaled"])
def test_the_steady_force_is_the_closed_form(klein, coupling):
    config = klein(**SLIDING | {"run": {"drive_displacement": 3e-7}}, contacts__coupling=coupling)
    expected = steady(coupling) * config.contacts.static_force
    me = config.replace({"run.engine": "me"})
    assert force_of(me)[1][-1] == pytest.approx(expected, rel=3e-4)
    many = config.replace({"contacts.count": 40_000})
    assert force_of(many)[1][-3000:].mean() == pytest.approx(expected, rel=2e-3)
    if coupling == "equal":
        quantities = mesoslip.derived(config)
        assert quantities["F_steady"].value == pytest.approx(expected, rel=1e-5)
    else:
        assert "F_steady" not in mesoslip.derived(config)


@pytest.mark.parametrize("coupling", ["equal", "scaled"])
def test_the_steady_start_is_stationary(klein, coupling):
    """The force is that of steady sliding, at the start and after some displacement."""
    count = 30_000
    config = klein(
        **SLIDING | {"run": {"drive_displacement": 2e-8}},
        contacts__coupling=coupling,
        contacts__initial="steady",
    )
    expected = steady(coupling) * config.contacts.static_force
    for resolution in (0.5, 0.25):
        me = force_of(config.replace({"run.engine": "me", "run.resolution": resolution}))[1]
        assert np.max(np.abs(me / expected - 1)) < 2e-2 * resolution**2
    force = force_of(config.replace({"contacts.count": count}))[1]
    assert np.max(np.abs(force / expected - 1)) < 4 * 0.3 / np.sqrt(count) / steady(coupling)


@pytest.mark.parametrize("coupling", ["equal", "scaled"])
def test_a_steady_start_has_the_law_of_sliding_contacts(klein, coupling):
    """Contacts of the threshold u that attach with b, in the number u - b, bear from b to u."""
    width, spread = 0.25, 0.3
    config = klein(
        contacts__count=30_000,
        contacts__coupling=coupling,
        contacts__initial="steady",
        contacts__newborn_width=width,
        contacts__threshold__relative_width=spread,
    )
    contacts = Realization(config, 0).contacts
    force = -contacts["origin"] * contacts["stiffness"] / config.contacts.contact_static_force
    u, b = np.meshgrid(np.linspace(0.1, 2.5, 601)[1:], np.linspace(-1.2, 1.4, 651))
    weight = stats.norm.pdf(u, 1, spread) * stats.norm.pdf(b, 0.1, width) * (np.abs(b) < u)
    weight *= (u - b) / (np.sqrt(u) if coupling == "scaled" else 1)
    grid = np.linspace(-1.2, 2.5, 149)
    share = [np.sum(weight * np.clip((one - b) / (u - b), 0, 1)) for one in grid]
    law = stats.kstest(force, lambda f: np.interp(f, grid, share / np.sum(weight)))
    assert law.pvalue > 1e-3


def test_engines_and_the_curve_agree_from_a_relaxed_start(klein):
    config = klein(**SLIDING | {"run": {"drive_displacement": 3e-8}}, contacts__coupling="equal")
    static = config.contacts.static_force
    place, force = force_of(config.replace({"run.engine": "me", "run.resolution": 0.1}))
    curve = ForceCurve(config.replace({"curve.length": 4e-8, "curve.tolerance": 1e-6}))
    assert np.max(np.abs(force - curve.force(place))) < 1e-3 * static
    _, many = force_of(config.replace({"contacts.count": 160_000}))
    assert np.max(np.abs(many - force)) < 4 / 400 * static


def test_newborns_have_the_law_and_thresholds_do_not_move(klein):
    """Force at attaching of contacts that attached once: normal around the back force."""
    config = klein(**SLIDING | {"run": {"drive_displacement": 1.1e-8}}, contacts__coupling="equal")
    plain = config.replace({"contacts.newborn_width": 0.0})
    found = []
    for one in (config, plain):
        with Realization(one, 0) as run:
            while not run.ending:
                run.advance()
            found.append(run.contacts)
    once = (found[0]["renewals"] == 1) & (found[1]["renewals"] == 1)
    assert np.count_nonzero(once) > 1000
    np.testing.assert_array_equal(*(one["break_stretch"][once] for one in found))
    stretch = found[1]["origin"][once] - found[0]["origin"][once]
    deviate = stretch / config.contacts.break_stretch / WIDTH
    assert stats.kstest(deviate, stats.norm.cdf).pvalue > 1e-3


def test_without_width_nothing_changes(klein):
    one, other = (
        mesoslip.run(klein(**SLIDING | {"contacts__newborn_width": width}, run__engine=engine))
        for engine in ("eq",)
        for width in (0.0, 1e-12)
    )
    np.testing.assert_allclose(one["contact_force"], other["contact_force"], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {
                "contacts__coupling": "equal",
                "contacts__ageing": {"law": "log", "time": 1.0, "growth": 0.1},
            },
            "with contacts.ageing",
        ),
        ({"run__engine": "me", "contacts__threshold__relative_width": 0.02}, "at most 0.06"),
        ({"contacts__newborn_width": 0.3}, "less than or equal to 0.25"),
        ({"contacts__newborn_width": -0.1}, "greater than or equal to 0"),
    ],
)
def test_what_is_refused(changes, words):
    tables = klein_tables(**{"contacts__newborn_width": WIDTH} | changes)
    problem = problem_of(tables)
    assert problem.key == "contacts.newborn_width"
    assert words in problem.message


def test_theory_that_is_refused(klein):
    config = klein(contacts__newborn_width=0.05)
    for theory in (ForceCurve, SteadySliding):
        with pytest.raises(ConfigError, match=r"contacts\.newborn_width"):
            theory(config)
    with pytest.raises(ConfigError, match=r"contacts\.initial .*stays at F_steady"):
        ForceCurve(config.replace({"contacts.initial": "steady", "contacts.coupling": "equal"}))
