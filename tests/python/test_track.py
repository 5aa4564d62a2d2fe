"""Strength along the track of the slider (model section 18)."""

from __future__ import annotations

import math

import mesoslip
import numpy as np
import pytest
from mesoslip import Config
from mesoslip.configuration.contacts.tables import Track
from oracles import relative_strength

CORRELATIONS = {
    "gaussian": lambda distance: np.exp(-0.5 * distance**2),
    "exponential": lambda distance: np.exp(-distance),
}


def unit_tables(**changes):
    """Contacts with f_s = k = 1 under a slider that moves at the velocity 1; keys of [contacts]."""
    contacts = {
        "count": 2000,
        "static_force": 1.0,
        "stiffness": 1.0,
        "coupling": "equal",
        "threshold": {"law": "gaussian", "relative_width": 0.1},
    }
    return {
        "run": {"duration": 10.0, "seed": 3},
        "drive": {"velocity": 1.0},
        "slider": {"kind": "prescribed"},
        "contacts": contacts | changes,
        "output": {"interval": 0.02},
    }


def track(spread=0.1, length=1.0, correlation="gaussian"):
    return {"spread": spread, "length": length, "correlation": correlation}


def forces(tables, **changes):
    """Displacements and forces of all realizations."""
    tree = mesoslip.run(Config.from_dict(tables).replace(changes))
    return tree["displacement"].values, tree["contact_force"].values


@pytest.mark.parametrize("correlation", CORRELATIONS)
def test_strength_is_gaussian_with_its_correlation(correlation):
    """Means over 20 000 lengths, within three standard deviations of them."""
    one = Track(spread=0.1, length=0.5, correlation=correlation)
    distance = np.array([0.0, 1 / 512, 1 / 96, 0.1, 0.37, 1.0, 2.2])
    start = 2.0 * np.arange(-15_000, 15_000) + 0.217
    g = relative_strength(one, 5, 0, (0.5 * (start[:, None] + distance)).ravel())
    g = g.reshape(-1, len(distance))
    found = np.mean(g[:, :1] * g, axis=0)
    assert np.max(np.abs(found - CORRELATIONS[correlation](distance))) < 3 * math.sqrt(2 / 3e4)
    assert abs(np.mean(g[:, 0])) < 3 * math.sqrt(1.5 / 3e4)
    assert np.mean(g[:, 0] ** 4) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("correlation", CORRELATIONS)
def test_neighbouring_places_differ_as_the_correlation_says(correlation):
    """The mean squared difference at a small distance, which no large scale enters."""
    one = Track(spread=0.1, length=1.0, correlation=correlation)
    start = np.arange(0, 600, 0.317)
    for distance in (1 / 32, 1 / 8):
        here, there = (relative_strength(one, 6, 0, start + far) for far in (0.0, distance))
        expected = 2 * (1 - CORRELATIONS[correlation](distance))
        assert np.mean((there - here) ** 2) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("correlation", CORRELATIONS)
def test_strength_depends_on_the_place_alone(correlation):
    """Not on where the slider was before; and it is another one for each seed and realization."""
    one = Track(spread=0.1, length=0.3, correlation=correlation)
    x = np.random.default_rng(1).uniform(-20, 20, 500)
    g = relative_strength(one, 7, 2, x)
    assert np.array_equal(relative_strength(one, 7, 2, x[::-1])[::-1], g)
    for seed, realization in ((7, 3), (8, 2), (7 + 2**40, 2)):
        other = relative_strength(one, seed, realization, x)
        assert abs(np.corrcoef(g, other)[0, 1]) < 0.35
    # No step where blocks of the table meet.
    edge = 0.3 * (np.arange(-50, 50) + 0.5)
    below, above = (relative_strength(one, 7, 2, edge + far) for far in (-1e-9, 1e-9))
    assert np.max(np.abs(above - below)) < 1e-5
