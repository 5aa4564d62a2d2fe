"""Strength along the track of the slider (model section 18)."""

import math

import mesoslip
import numpy as np
import pytest
from mesoslip import Config, ConfigError, SteadySliding, TrackResponse, track_strength
from mesoslip.configuration.contacts.tables.track import Track
from oracles import relative_strength, stationary_force

CORRELATIONS = {
    "gaussian": lambda distance: np.exp(-0.5 * distance**2),
    "exponential": lambda distance: np.exp(-distance),
}


# A ramp up and a step down.
LOAD = {
    "normal_force": 1.0,
    "stage": [
        {"duration": 2.0, "start_normal_force": 1.0, "end_normal_force": 1.6},
        {"duration": 1.0, "normal_force": 1.6},
        {"duration": 3.0, "normal_force": 0.7},
    ],
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


def linear_force(config, x, spacing):
    """F + w ∫ χ(q) ĝ(q) e^(iqX) dq at displacements of a run from the linear theory."""
    theory = TrackResponse(config)
    around = np.arange(-20.0, x[-1] + 20.0, spacing)
    g = (track_strength(config, around) - 1) / theory.track.spread
    q = 2 * np.pi * np.fft.rfftfreq(len(around), spacing)
    # Shorter waves average out.
    response = np.where(q < 60, theory.response(np.minimum(q, 60)), 0)
    change = np.fft.irfft(np.fft.rfft(g) * response, len(around))
    steady = stationary_force(config, config.drive.velocity)
    return steady + theory.track.spread * np.interp(x, around, change)


@pytest.mark.parametrize(
    "changes",
    [
        {"contacts.track": track(0.01, 0.7)},
        {"contacts.track": track(0.01, 1.0, "exponential")},
        {"contacts.coupling": "scaled", "contacts.back_force_ratio": 0.2},
        {"contacts.delay": 0.4},
        {"contacts.delay": 0.3, "contacts.delay_law": "exponential"},
    ],
    ids=["gaussian", "exponential", "scaled, back force", "delay", "exponential delays"],
)
def test_the_force_is_that_of_the_linear_theory(changes):
    """At each place, from the strength there and before."""
    tables = unit_tables(
        track=track(0.01, 0.7), threshold={"law": "gaussian", "relative_width": 0.2}
    )
    config = Config.from_dict(tables).replace(
        {"run.engine": "me", "run.duration": 50.0, "contacts.initial": "steady"}, changes
    )
    x, force = (one[0] for one in forces(config.to_dict()))
    expected = linear_force(config, x, 1 / 32)
    settled = x > 30
    deviation = np.std(expected[settled])
    assert deviation > 0.0025
    assert np.std((force - expected)[settled]) < 0.06 * deviation
    assert np.mean((force - expected)[settled]) == pytest.approx(0.0, abs=0.04 * deviation)


@pytest.mark.parametrize(("spread", "length", "expected"), [(0.03, 0.3, 0.0261), (0.1, 1, 0.0673)])
def test_the_deviation_of_the_force(spread, length, expected):
    """Known values; that of the spectrum, and that of `info`."""
    config = Config.from_dict(unit_tables(track=track(spread, length, "exponential")))
    theory = TrackResponse(config)
    assert theory.force_deviation == pytest.approx(expected, abs=5e-5)
    assert mesoslip.derived(config)["track_force_deviation"].value == theory.force_deviation
    q = np.linspace(0, 80, 4001)
    spectrum = theory.force_spectrum(q)
    assert math.sqrt(2 * np.trapezoid(spectrum, q)) == pytest.approx(expected, rel=1e-3)
    tree = mesoslip.curve(config)
    assert tree["track"].attrs["force_deviation"] == theory.force_deviation
    # chi(0) is the force: a uniform strength multiplies it.
    assert tree["track"]["response"].values[0] == pytest.approx(tree.attrs["F_steady"], rel=1e-6)


def test_forces_vary_along_the_track_as_the_linear_theory_says():
    """The variance over 16 tracks of 40 breaking stretches each, within three standard errors."""
    tables = unit_tables(track=track(0.03, 0.3, "exponential"), initial="steady")
    _, force = forces(tables, **{"run.engine": "me", "run.duration": 50.0, "run.realizations": 16})
    squares = np.mean((force[:, 500:] - 0.505) ** 2, axis=1)
    error = np.std(squares) / math.sqrt(len(squares) - 1)
    assert error < 0.2 * 0.0261**2
    assert np.mean(squares) == pytest.approx(0.0261**2, abs=3 * error)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"contacts.coupling": "scaled"},
        # Many contacts are too weak for the back force at some places.
        {"contacts.back_force_ratio": 0.6},
        {"contacts.newborn_width": 0.2, "contacts.back_force_ratio": 0.3},
        {"contacts.ageing": {"law": "log", "time": 0.3, "growth": 0.1}},
        {
            "contacts.back_force_ratio": 0.4,
            "contacts.ageing": {
                **{"law": "relax", "time": 0.3, "young_force_ratio": 0.7},
                "young_relative_width": 0.3,
            },
        },
        {"contacts.initial": "steady", "contacts.back_force_ratio": 0.2},
        {"load": LOAD, "contacts.back_force_ratio": 0.2},
    ],
    ids=["equal", "scaled", "weak places", "newborn width", "log", "relax", "steady", "load"],
)
def test_both_engines_feel_the_same_track(changes):
    count = 20_000
    tables = unit_tables(
        count=count,
        track=track(0.3, 0.6),
        threshold={"law": "gaussian", "relative_width": 0.2},
    )
    each, all_ = (
        forces(tables, **{"run.engine": engine, "run.duration": 6.0, **changes})[1][0]
        for engine in ("eq", "me")
    )
    assert np.std(all_[150:]) > 0.05
    assert np.max(np.abs(each - all_)) < 4.5 * 0.35 / math.sqrt(count)


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_the_slider_meets_the_same_strength_in_each_stroke(engine):
    """Forces of later strokes repeat, and differ from those of another realization."""
    tables = unit_tables(
        track=track(0.3, 1.0), threshold={"law": "gaussian", "relative_width": 0.2}
    )
    tables["drive"] = {"cycle": {"amplitude": 6.0, "velocity": 1.0, "cycles": 3}}
    tables["run"] = {"engine": engine, "seed": 3, "realizations": 2}
    _, force = forces(tables, **{"contacts.count": 20_000})
    # The end of the stroke back, in each cycle of 24 s.
    second, third = (force[:, 50 * end - 300 : 50 * end] for end in (42, 66))
    noise = 8 * 0.35 / math.sqrt(20_000) if engine == "eq" else 2e-3
    assert np.max(np.abs(third - second)) < noise
    assert np.max(np.abs(second[0] - second[1])) > 0.07


def test_wrong_tracks_are_refused(klein):
    wrong = [
        ({"spread": 0.0, "length": 1e-8}, {}, ["contacts.track.spread", "greater than 0"]),
        ({"spread": 1.5, "length": 1e-8}, {}, ["contacts.track.spread", "less than or equal to 1"]),
        ({"spread": 0.2, "length": 1e-10}, {}, ["contacts.track.length", "at least 900 pm"]),
        ({"spread": 0.2}, {}, ["contacts.track.length", "missing"]),
        (
            {"spread": 0.2, "length": 1e-8, "correlation": "white"},
            {},
            ["contacts.track.correlation", "gaussian", "exponential"],
        ),
        (
            {"spread": 0.2, "length": 1e-8},
            {
                "run__engine": "me",
                "contacts__coupling": "equal",
                "contacts__thermal": {"rate": 1e4, "force_ratio": 0.05},
            },
            ["contacts.track", "one strength", 'run.engine = "eq"'],
        ),
    ]
    for table, changes, words in wrong:
        with pytest.raises(ConfigError) as raised:
            klein(contacts__track=table, **changes)
        assert all(word in str(raised.value) for word in words), str(raised.value)


def test_theories_that_do_not_know_a_track_refuse_it(klein):
    config = klein(contacts__track={"spread": 0.2, "length": 1e-8}, run__engine="me")
    for theory in (mesoslip.cycle, SteadySliding):
        with pytest.raises(ConfigError, match=r"contacts\.track"):
            theory(config)
    with pytest.raises(ConfigError, match=r"contacts\.track: missing"):
        TrackResponse(klein())
    with pytest.raises(ConfigError, match=r"contacts\.newborn_width"):
        TrackResponse(config.replace({"contacts.newborn_width": 0.05}))
    with pytest.raises(ConfigError, match=r"contacts\.track"):
        track_strength(klein(), 0.0)
    # Each of two tables has a theory, both together have none.
    hot = config.replace({"run.engine": "eq", "contacts.coupling": "equal"})
    hot = hot.replace({"contacts.thermal": {"rate": 1e4, "force_ratio": 0.05}})
    with pytest.raises(ConfigError, match=r"thermal: .* with contacts\.track: leave one of them"):
        mesoslip.derived(hot)
    for one in ("track", "thermal"):
        mesoslip.derived(hot.replace({f"contacts.{one}": None}))


def test_a_track_that_is_cut_off_is_reported(klein):
    assert klein(contacts__track={"spread": 0.2, "length": 1e-8}).contacts.weak_track is None
    message = klein(contacts__track={"spread": 0.5, "length": 1e-8}).contacts.weak_track
    # The floor is f_b over a strong threshold: P(1 + 0.5 g < 0.1/1.023) = 0.0358
    assert "on 3.6 % of the track" in message
    assert "0.0977 of its mean" in message
