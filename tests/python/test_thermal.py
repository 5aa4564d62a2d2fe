"""Thermally activated breaking: closed forms, a fixed step, limits, configuration."""

import math
from typing import Any

import mesoslip
import numpy as np
import pytest
from conftest import at_end, changed, drive_in_stages, long
from kinds import configuration
from mesoslip import Config, ConfigError
from mesoslip.simulation.realization import Realization
from mesoslip.theory.contacts import contact_theory
from oracles import aged, assert_same_events, fixed_step, frozen_law, uniforms
from scipy import integrate, special, stats
from test_events import breaks


def unit_tables(count: int = 1000, **changes: Any) -> dict[str, Any]:
    """A prescribed slider in units of f_s, k and ω_0; a double underscore separates tables."""
    tables: dict[str, Any] = {
        "run": {"engine": "eq", "duration": 1000.0},
        "drive": {"velocity": 1e-2},
        "slider": {"kind": "prescribed"},
        "contacts": {
            "count": count,
            "static_force": float(count),
            "stiffness": float(count),
            "coupling": "equal",
            "threshold": {"law": "gaussian", "relative_width": 0.05},
            "thermal": {"rate": 1.0, "force_ratio": 0.04},
        },
        "output": {"interval": 1.0},
    }
    return changed(tables, **changes)


def unit(count: int = 1000, **changes: Any) -> Config:
    return Config.from_dict(unit_tables(count, **changes))


@pytest.mark.parametrize(("velocity", "force"), [(1e-4, 0.3721068), (1e-2, 0.4634253)])
def test_theory_has_the_known_steady_forces(velocity, force):
    assert contact_theory(unit(1)).steady_force(velocity) == pytest.approx(force, abs=5e-8)


def test_theory_has_the_known_force_of_a_hold():
    held = contact_theory(unit(1)).hold_force(1e-2, [0.0, 10.0])
    np.testing.assert_allclose(held, [0.4634253, 0.4148345], atol=5e-8)


@pytest.mark.parametrize("law", ["gaussian", "uniform", "lognormal", "weibull", "exponential"])
@pytest.mark.parametrize("ratio", [0.02, 0.3])
def test_steady_force_is_that_of_a_plain_quadrature(law, ratio):
    width, back, delay, velocity = 0.2, 0.1, 3.0, 1e-3
    config = unit(
        1,
        contacts__threshold={"law": law, "relative_width": width},
        contacts__back_force_ratio=back,
        contacts__delay=delay,
        contacts__thermal={"rate": 1.0, "force_ratio": ratio},
    )
    frozen = frozen_law(law, width)
    point, weight = np.polynomial.legendre.leggauss(60)

    def life(threshold: float, power: int) -> float:
        """∫ x^power S dx of contacts of a threshold, on panels of which S is smooth."""
        edges = np.linspace(back, threshold, 41)
        half = np.diff(edges)[:, None] / 2
        stretch = edges[:-1, None] + half * (1 + point)
        grown = np.exp((stretch - threshold) / ratio) - np.exp((back - threshold) / ratio)
        return float(np.sum(half * weight * stretch**power * np.exp(-ratio / velocity * grown)))

    upper = frozen.isf(1e-14)
    work, mean = (
        integrate.quad(
            lambda one, power=power: life(one, power) * frozen.pdf(one),
            max(back, frozen.ppf(1e-14)),
            upper,
            epsrel=1e-6,
            limit=200,
        )[0]
        / frozen.sf(back)
        for power in (1, 0)
    )
    assert contact_theory(config).steady_force(velocity) == pytest.approx(
        work / (mean + velocity * delay), rel=1e-5
    )


def test_slope_is_the_derivative_of_the_force():
    config = unit(1, contacts__delay=3.0, contacts__back_force_ratio=0.05)
    change = 1e-4
    for velocity in (1e-8, 1e-3, 1.0):
        around = [
            contact_theory(config).steady_force(velocity * math.exp(s * change)) for s in (-1, 1)
        ]
        slope = (around[1] - around[0]) / (2 * change)
        assert contact_theory(config).steady_slope(velocity) == pytest.approx(slope, abs=1e-8)


def test_slope_is_half_the_force_scale_where_no_contact_comes_to_its_threshold():
    config = unit(1, contacts__threshold__relative_width=1e-3)
    config = config.replace({"contacts.thermal.force_ratio": 0.01})
    assert contact_theory(config).steady_slope(1e-8) == pytest.approx(0.005, rel=0.02)


def hazard_of(
    ratio: float, threshold: float, stretch: float, velocity: float, duration: float
) -> float:
    """Hazard of a contact in a uniform motion that begins at a stretch."""
    if velocity == 0:
        return math.exp((abs(stretch) - threshold) / ratio) * duration
    first, last = (
        math.copysign(math.exp((abs(one) - threshold) / ratio) - math.exp(-threshold / ratio), one)
        for one in (stretch, stretch + velocity * duration)
    )
    return ratio * (last - first) / velocity


@pytest.mark.parametrize(
    ("ratio", "velocities"),
    [
        (0.01, [0.03]),
        (0.04, [-0.3]),
        (1.0, [0.3]),
        (0.04, [0.3, 0.0, -0.1]),
        (0.1, [3.0, -0.1, 0.0]),
        (1.0, [0.3, -0.3]),
    ],
)
def test_hazards_between_breaks_are_exponential(ratio, velocities):
    """In motions with both signs of the force. The hazard of a contact that breaks at its threshold
    continues with that of its next life, or of the next contact."""
    count, duration, stages = 40, 6.0, 60
    config = unit(
        count,
        run__duration=None,
        drive={
            "stage": [
                {"duration": duration, "velocity": velocities[stage % len(velocities)]}
                for stage in range(stages)
            ]
        },
        contacts__thermal={"rate": 1.0, "force_ratio": ratio},
        contacts__threshold__relative_width=0.2,
        output__interval=duration,
    )
    law = frozen_law("gaussian", 0.2)
    events = breaks(config)
    hazards, hazard = [], 0.0
    for contact in range(count):
        ends = [time for time, one in events if one == contact] + [duration * stages]
        now = 0.0
        for renewal, end in enumerate(ends):
            threshold = law.isf(uniforms(1, 0, contact, renewal)[0] * law.sf(0))
            stretch = 0.0
            while now < end - 1e-12:
                stage = int((now + 1e-12) // duration)
                velocity = velocities[stage % len(velocities)]
                step = min(end, (stage + 1) * duration) - now
                hazard += hazard_of(ratio, threshold, stretch, velocity, step)
                stretch += velocity * step
                now += step
            if abs(stretch) < threshold * (1 - 1e-9) and end < duration * stages:
                hazards.append(hazard)
                hazard = 0.0
    assert len(hazards) > 50
    assert stats.kstest(hazards, "expon").pvalue > 1e-3


@pytest.mark.parametrize("ratio", [2e-3, 0.05, 1.0])
@pytest.mark.parametrize("changes", [{}, {"contacts__delay_law": "exponential"}])
def test_uniform_motion_breaks_contacts_as_candidates_do(ratio, changes):
    """Where a velocity grows by a rounding error, candidates are drawn instead."""
    velocities = [0.3, -0.1, 0.0, 0.02, 3.0, -1e-3]
    times = []
    for growth in (0.0, 1e-13):
        stages = [
            {"duration": 10.0, "start_velocity": one, "end_velocity": one * (1.0 + growth)}
            for one in velocities
        ]
        config = unit(
            400,
            run__duration=None,
            drive={"stage": stages},
            contacts__thermal={"rate": 1.0, "force_ratio": ratio},
            contacts__delay=0.1,
            contacts__newborn_width=0.25,
            **changes,
        )
        times.append([time for time, _ in breaks(config)])
    uniform, drawn = (np.histogram(one, bins=10.0 * np.arange(7))[0] for one in times)
    # Renewals scatter at most as the numbers of Poisson's law.
    assert np.all(np.abs(uniform - drawn) < 4 * np.sqrt(uniform + drawn + 1))
    assert stats.ks_2samp(*times).pvalue > 1e-3


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"contacts__newborn_width": 0.25},
        {"contacts__ageing": {"law": "log", "time": 1.0, "growth": 0.1}},
    ],
    ids=["one force", "newborn width", "ageing"],
)
def test_uniform_motion_does_not_depend_on_segments(changes):
    """The bits of a run in segments of one advance are those of a run in one piece."""
    config = unit(
        200,
        run__duration=None,
        drive={"stage": [{"duration": 4.0, "velocity": one} for one in (0.3, -0.1, 3.0)]},
        contacts__thermal={"rate": 1.0, "force_ratio": 1.0},
        contacts__delay=0.1,
        contacts__back_force_ratio=0.1,
        **changes,
    )
    origins = []
    for advances in (1, 100_000):
        realization = at_end(Realization(config, 0), advances)
        origins.append(realization.contacts["origin"])
    np.testing.assert_array_equal(*origins)


def test_mean_force_at_breaking_is_an_exponential_integral():
    """⟨f⟩ = f_T e^z E_1(z), of thresholds that are never reached: the work of breaking is ½k⟨f²⟩;
    the mean life is ⟨f⟩/k."""
    velocity, ratio, count, length = 1e-6, 0.05, 2000, 12.0
    config = unit(
        count,
        run__duration=length / velocity,
        drive__velocity=velocity,
        contacts__threshold__relative_width=1e-3,
        contacts__thermal={"rate": 1.0, "force_ratio": ratio},
        output__interval=length / velocity / 10,
    )
    z = ratio / velocity * math.exp(-1 / ratio)
    mean = ratio * math.exp(z) * special.exp1(z)
    number = int(mesoslip.run(config)["breaks"].values[0])
    expected = count * length / mean
    # Renewals: their variance goes with that of a life, here some (f_T/f)².
    assert abs(number - expected) < 4 * math.sqrt(expected) * ratio / mean + count


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"drive__velocity": 1e-4, "run__duration": 4e5, "output__interval": 400.0},
        {"contacts__delay": 20.0},
        {"contacts__back_force_ratio": 0.1},
        {"contacts__threshold": {"law": "exponential", "relative_width": 1.0}},
        {"contacts__threshold": {"law": "uniform", "relative_width": 0.3}},
    ],
    ids=["", "slow", "delay", "back force", "exponential", "uniform"],
)
def test_steady_sliding_has_the_force_of_the_theory(changes):
    """After twelve stretches, within four standard errors of the means of blocks."""
    common = {
        "run__duration": 4000.0,
        "contacts__threshold__relative_width": 0.3,
        "output__interval": 4.0,
    }
    config = unit(2000, **common | changes)
    force = mesoslip.run(config)["spring_force"].values[0]
    blocks = force[-700:].reshape(7, 100).mean(axis=1)
    error = blocks.std(ddof=1) / math.sqrt(7)
    assert error < 5e-3 * 2000
    expected = contact_theory(config).steady_force(config.drive_speed)
    assert abs(blocks.mean() - expected) < 4 * error


def aged_force(config: Config) -> float:
    """F(v) of contacts that age, by a plain quadrature over thresholds and stretches."""
    contacts, speed = config.contacts, config.drive_speed
    law = frozen_law("gaussian", contacts.threshold.relative_width)
    stretch = np.linspace(0.0, 2.5, 10_001)
    mean, spread = aged(config, stretch / speed)
    work = life = 0.0
    for threshold in law.isf((np.arange(200) + 0.5) / 200 * law.sf(0.0)):
        limit = mean + spread * (threshold - 1) / contacts.threshold.relative_width
        rate = contacts.thermal.rate * np.exp((stretch - limit) / contacts.thermal.force_ratio)
        hazard = integrate.cumulative_trapezoid(rate, stretch / speed, initial=0)
        survival = np.where(np.cumsum(stretch >= limit) > 0, 0.0, np.exp(-hazard))
        work += integrate.trapezoid(stretch * survival, stretch) / 200
        life += integrate.trapezoid(survival, stretch) / 200
    return contacts.count * work / (life + speed * contacts.delay)


@pytest.mark.parametrize(
    "ageing",
    [
        {"law": "log", "time": 1.0, "growth": 0.05},
        {"law": "relax", "time": 20.0, "young_force_ratio": 0.6, "young_relative_width": 0.3},
        {"law": "relax", "time": 20.0, "young_force_ratio": 1.3, "young_relative_width": 0.3},
    ],
    ids=["log", "relax", "weaker"],
)
def test_steady_sliding_of_ageing_contacts(ageing):
    """Where neither ageing nor activation is fast or slow."""
    config = unit(
        1000,
        run__duration=4000.0,
        contacts__threshold__relative_width=0.2,
        contacts__ageing=ageing,
        contacts__delay=2.0,
        output__interval=4.0,
    )
    force = mesoslip.run(config)["spring_force"].values[0]
    blocks = force[-700:].reshape(7, 100).mean(axis=1)
    error = blocks.std(ddof=1) / math.sqrt(7)
    assert abs(blocks.mean() - aged_force(config)) < 4 * error + 1e-3 * 1000


def test_a_hold_of_a_million_seconds():
    """A contact breaks every hour or so in the end; the force falls with the logarithm."""
    count = 4000
    config = unit(
        count,
        run__duration=None,
        drive=drive_in_stages((1e3, 1e-2), (1e6, 0.0)),
        contacts__threshold__relative_width=0.3,
        output__interval=100.0,
    )
    tree = mesoslip.run(config)
    time = tree["time"].values - 1e3
    for wanted in (100.0, 1e4, 1e6 - 1e3):
        at = int(np.argmin(np.abs(time - wanted)))
        force = tree["spring_force"].values[0, at] / count
        expected = float(contact_theory(config).hold_force(1e-2, time[at])) / count
        assert abs(force - expected) < 4 * 0.3 / math.sqrt(count)
    assert abs(float(tree["energy_residual"].values[0])) < 1e-12


def test_a_long_hold_of_a_rigid_slider(klein):
    """A slider that settles between two breaks goes from one to the next in one step."""
    config = klein(
        run__duration=None,
        drive=drive_in_stages((2.0, 1e-7), (1e6, 0.0)),
        contacts__count=20,
        contacts__coupling="equal",
        contacts__threshold__relative_width=0.1,
        contacts__thermal={"rate": 1e3, "force_ratio": 0.05},
        output__interval=1e3,
    )
    tree = mesoslip.run(config)
    force = tree["spring_force"].values[0]
    assert 0 < force[-1] < 0.7 * force[1]
    assert int(tree["breaks"].values[0]) > 20
    assert tree.attrs["advance_count"] < 1e7
    assert abs(float(tree["energy_residual"].values[0])) < 1e-10


def test_a_rigid_slider_moves_on_after_a_long_hold(klein):
    """It starts in balance but for rounding, which the drive outweighs before the time can grow."""
    config = klein(
        run__duration=None,
        drive=drive_in_stages((0.2, -1e-6), (1e6, 0.0), (0.2, 1e-6)),
        contacts__count=500,
        contacts__coupling="equal",
        contacts__delay_law="exponential",
        contacts__threshold__relative_width=0.05,
        contacts__thermal={"rate": 1e3, "force_ratio": 0.02},
        output__interval=2e3,
    )
    tree = mesoslip.run(config)
    # Hardly anything is left of the force before the last stage, which begins at 0.
    expected = config.contacts.stiffness * 0.2e-6
    assert 0 < float(tree["contact_force"].values[0, -1]) <= 1.001 * expected
    # The time has five digits less than that of a run without the hold.
    assert abs(float(tree["energy_residual"].values[0])) < 1e-7


@pytest.mark.parametrize(
    ("kind", "rate", "force_ratio"),
    [
        ("rigid", 1e-6, 1e-3),
        ("quasistatic", 1e-17, 0.05),
        long("layered", 1e-17, 0.05),
        long("prescribed", 1e-6, 1e-3),
        long("rigid", 1e-17, 0.05),
        long("layered", 1e-6, 1e-3),
        long("prescribed", 1e-17, 0.05),
        long("quasistatic", 1e-6, 1e-3),
    ],
)
def test_without_temperature_it_is_the_model_without(kind, rate, force_ratio):
    """The same contacts break in the same order; only the last digits of times may differ."""
    cold = configuration(kind, contacts__coupling="equal", run__duration=None)
    thermal = {"thermal": {"rate": rate, "force_ratio": force_ratio}}
    tables = cold.to_dict()
    warm = Config.from_dict(tables | {"contacts": tables["contacts"] | thermal})
    expected, actual = breaks(cold), breaks(warm)
    assert len(expected) == len(actual)
    assert_same_events(actual, expected, 300)


@pytest.mark.parametrize("seed", [2, 44, 61])
def test_contacts_reach_their_thresholds_after_a_reversal(seed):
    """Where the rate is negligible and its dependence on the force weak, forces change their sign
    without a step of their own; their contacts still break at their thresholds."""
    tables = unit_tables(
        2,
        run={"engine": "eq", "seed": seed},
        drive={
            "stage": [
                {"duration": 1e-3, "start_velocity": -890.0, "end_velocity": -900.0},
                {"duration": 1e-2, "start_velocity": 1100.0, "end_velocity": 1110.0},
            ]
        },
        contacts__threshold__relative_width=0.5,
        contacts__initial="uniform",
        contacts__reattach=False,
        output__interval=0.011,
    )
    thermal = {"rate": 1e-17, "force_ratio": 2.0}
    warm = tables | {"contacts": tables["contacts"] | {"thermal": thermal}}
    cold = tables | {"contacts": tables["contacts"] | {"thermal": None}}
    actual, expected = (mesoslip.run(one)["energy"] for one in (warm, cold))
    for term in ("drive_work", "break_loss"):
        assert float(actual[term].values[0]) == pytest.approx(
            float(expected[term].values[0]), rel=1e-12
        )


@pytest.mark.parametrize(
    "changes",
    [
        long({"run__duration": 0.02, "drive__velocity": 1e-5}),
        {
            "run__duration": None,
            "drive": drive_in_stages((0.025, 1e-5), (0.005, 0.0), (0.04, -1e-5)),
            "contacts__back_force_ratio": 0.0,
        },
    ],
    ids=["slips", "reversal"],
)
def test_breaks_have_the_distribution_of_a_fixed_step(klein, changes):
    """A rigid slider that slips, rings and turns round: forces of both signs."""
    expected, actual = [], []
    for seed in range(12):
        config = klein(
            run__seed=seed,
            contacts__count=12,
            contacts__coupling="equal",
            contacts__threshold__relative_width=0.1,
            contacts__thermal={"rate": 1e4, "force_ratio": 0.05},
            output__interval=1e-4,
            **changes,
        )
        _, contacts = fixed_step(config, 8e-6)
        expected += [time for time, _ in contacts.events]
        actual += [time for time, _ in breaks(config)]
    assert abs(len(actual) / len(expected) - 1) < 0.05
    assert stats.ks_2samp(expected, actual).pvalue > 1e-3


@pytest.mark.parametrize(
    ("changes", "key", "text"),
    [
        ({"contacts__thermal__temperature": "300 K"}, "thermal.temperature", "give either"),
        ({"contacts__thermal__activation_length": 1e-9}, "thermal.activation_length", "either"),
        ({"contacts__thermal": {"rate": 1.0}}, "thermal.force_ratio", "needed"),
        (
            {"contacts__thermal": {"rate": 1.0, "temperature": 300.0}},
            "thermal.activation_length",
            "needed",
        ),
        ({"contacts__thermal__force_ratio": 0.0}, "thermal.force_ratio", "greater than 0"),
        ({"contacts__thermal__force_ratio": -0.1}, "thermal.force_ratio", "greater than 0"),
        ({"contacts__thermal__rate": 0.0}, "thermal.rate", "greater than 0"),
        ({"contacts__thermal__rate": 1e20}, "thermal.rate", "break at once"),
        (
            {"contacts__thermal__force_ratio": 1e6, "contacts__thermal__rate": 1e9},
            "rate",
            "at once",
        ),
        (
            {
                "contacts__thermal__rate": 1e5,
                "contacts__ageing": {
                    "law": "relax",
                    "time": 100.0,
                    "young_force_ratio": 0.1,
                    "young_relative_width": 0.1,
                },
                "run__duration": 1e6,
            },
            "thermal.rate",
            "break at once",
        ),
        ({"contacts__coupling": "scaled"}, "contacts.coupling", '"equal"'),
    ],
)
def test_what_makes_no_sense_is_one_clear_message(changes, key, text):
    with pytest.raises(ConfigError) as error:
        unit(10, **changes)
    (problem,) = error.value.problems
    assert problem.key.endswith(key)
    assert text in problem.message


def test_interaction_is_refused():
    tables = unit_tables(16, contacts__area=1e-10)
    lattice = {"lattice": "square", "columns": 4, "rows": 4}
    Config.from_dict(tables | {"interaction": lattice | {"strength": 0.0}})
    with pytest.raises(ConfigError, match="which neither engine follows"):
        Config.from_dict(tables | {"interaction": lattice | {"strength": 0.3}})


def test_temperature_and_length_are_a_force():
    config = unit(
        10, contacts__thermal={"rate": 1.0, "temperature": "300 K", "activation_length": "0.3 nm"}
    )
    thermal = config.contacts.thermal
    assert thermal.ratio(1e-9) == pytest.approx(1.380649e-23 * 300 / 0.3e-9 / 1e-9, rel=1e-14)


def test_a_contact_without_a_force_breaks_at_the_rate_of_none():
    """It has one sign of force, not both."""
    count, ratio, duration = 2000, 0.2, 20.0
    config = unit(
        count,
        run__duration=duration,
        drive__velocity=0.0,
        contacts__initial="relaxed",
        contacts__threshold__relative_width=1e-3,
        contacts__thermal={"rate": 1.0, "force_ratio": ratio},
    )
    expected = count * duration * math.exp(-1 / ratio)
    assert abs(len(breaks(config)) - expected) < 5 * math.sqrt(expected)


def test_contacts_whose_rates_are_tiny_at_the_start_relax_in_a_hold():
    """Loaded far below their thresholds; at the start the largest rate is e^-980 ω_0."""
    count, stretch, rate, ratio, hold = 20_000, 0.9, 1e6, 1e-3, 0.1
    config = unit(
        count,
        run__duration=None,
        drive={
            "stage": [{"duration": stretch, "velocity": 1.0}, {"duration": hold, "velocity": 0}]
        },
        contacts__initial="relaxed",
        contacts__threshold__relative_width=0.05,
        contacts__thermal={"rate": rate, "force_ratio": ratio},
        output__interval=stretch + hold,
    )
    thresholds = np.linspace(0.8, 1.2, 40_001)
    weights = frozen_law("gaussian", 0.05).pdf(thresholds) * (thresholds[1] - thresholds[0])
    gap = np.maximum(thresholds - stretch, 0.0)
    # While loading the hazard is that of a time f_T/(k v) at the end.
    broken = 1 - np.exp(-rate * np.exp(-gap / ratio) * (hold + ratio))
    expected = count * float(weights @ np.where(thresholds > stretch, broken, 1.0))
    assert expected > 600
    assert abs(len(breaks(config)) - expected) < 5 * math.sqrt(expected)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {
            "contacts__ageing": {
                "law": "relax",
                "time": 0.1,
                "young_force_ratio": 0.9,
                "young_relative_width": 0.1,
            }
        },
        {"contacts__ageing": {"law": "log", "time": 0.1, "growth": 0.05}},
    ],
    ids=["thresholds", "relax", "log"],
)
@pytest.mark.parametrize("velocity", [0.01, -0.01])
def test_a_run_stops_at_its_displacement(changes, velocity):
    config = unit(
        200,
        run__duration=1000.0,
        run__realizations=40,
        run__stop={"displacement": math.copysign(0.9973, velocity)},
        drive__velocity=velocity,
        **changes,
    )
    for number in range(40):
        realization = at_end(Realization(config, number))
        assert realization.time == pytest.approx(99.73, rel=1e-12)


def test_a_run_ends_when_all_contacts_are_broken():
    config = unit(
        20,
        run__duration=None,
        run__avalanches=100,
        contacts__reattach=False,
        contacts__initial="relaxed",
        slider={"kind": "quasistatic", "stiffness": 100.0},
    )
    realization = at_end(Realization(config, 0))
    assert realization.breaks == 20
