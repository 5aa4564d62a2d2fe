"""Fits of traces as they are measured: noise, several traces, misfits in words, predictions."""

import math
import re

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import klein_tables, long
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError
from mesoslip.execution.stop import Stop
from mesoslip.inference import apparatus, checks, likelihood, run_in
from mesoslip.inference.apparatus import Instrument, low_pass
from mesoslip.inference.checks import sentence
from mesoslip.inference.features import Feature
from mesoslip.inference.fit import prepare as prepare_all
from mesoslip.inference.fit import usable_summaries
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.fit_trace import as_plan
from mesoslip.inference.noise import Noise, cleaned
from mesoslip.inference.predict import _with_own_level
from mesoslip.inference.prior import FILTER, LEVEL
from mesoslip.inference.run_in import run_in_distance, run_in_samples
from mesoslip.inference.simulations import Simulations
from mesoslip.inference.traced_experiment import Sampling, prepare
from mesoslip.inference.wander import wandering
from test_fit import FREE, NOISE, SMALL, experiment, few_simulations, fit_tables

TRUTH = {"contacts.static_force": 18e-6, "contacts.delay": 1e-3}


STIFFNESS = {"slider.stiffness": {"from": 60, "to": 160, "prior": "logarithmic"}}


def measured(tree, **known):
    """The trace of a run as one that was measured, with the known part of the configuration."""
    import tomli_w

    root = tree.to_dataset()[["spring_force", "drive_displacement"]]
    root.attrs = {"origin": "measured", "configuration": tomli_w.dumps(known)}
    return xr.DataTree(root)


def test_noise_has_its_spectrum_and_its_steps():
    noise = Noise(1.0, coloured=2.0, correlation_time=5e-3, step=0.5)
    rng = np.random.default_rng(1)
    added = noise.added(np.zeros(400_000), 1e-3, rng)
    assert np.std(added) == pytest.approx(noise.deviation, rel=0.01)
    np.testing.assert_allclose(added / 0.5, np.round(added / 0.5))
    for lag in (1, 5, 20):
        expected = 4 * math.exp(-lag / 5)
        assert np.mean(added[lag:] * added[:-lag]) == pytest.approx(expected, abs=0.08)
    # Means over blocks, by the formula and by the numbers.
    means = added.reshape(-1, 8).mean(axis=1)
    assert np.std(means) == pytest.approx(noise.averaged(8, 1e-3), rel=0.01)
    levels = [
        np.std(Noise(1.0, uncertainty=0.3).added(np.zeros(2000), 1.0, rng)) for _ in range(400)
    ]
    assert np.std(np.log(levels)) == pytest.approx(0.3, rel=0.1)


def test_impulses_are_taken_off_a_measured_trace_only():
    rng = np.random.default_rng(2)
    time = 1e-3 * np.arange(5000)
    force = np.sin(np.arange(5000) / 200) + 0.01 * rng.standard_normal(5000)
    noisy = force.copy()
    noisy[rng.choice(5000, 50, replace=False)] += 0.3
    clean, noise, taken = cleaned(time, noisy, deviation=None, is_measured=True)
    assert np.max(np.abs(clean - force)) < 0.08
    assert "impulses in 1 % of the samples" in taken[0]
    assert noise.deviation == pytest.approx(0.01, rel=0.15)
    same, _, none = cleaned(time, noisy, deviation=None, is_measured=False)
    np.testing.assert_array_equal(same, noisy)
    assert none == ()


def test_summaries_that_see_only_noise_are_left_out():
    """The bands of high frequency, in which the noise is stronger than the trace."""
    plan = Plan.from_dict(fit_tables(noise=3e-7))
    tree = experiment()
    rng = np.random.default_rng(7)
    tree["spring_force"] = tree["spring_force"] + 3e-7 * rng.standard_normal((1, 2001))
    simulator = prepare_all([tree], ["a"], plan)
    observed, left_out = usable_summaries(simulator)
    names = [one.name for one, is_out in zip(simulator.features, left_out, strict=True) if is_out]
    assert "spectrum_11" in names
    assert not {"spectrum_0", "mean_peak", "slip_count", "mean_force", "loading_slope"} & set(names)
    assert np.isfinite(observed[left_out]).all()
    quiet = prepare_all([experiment()], ["a"], Plan.from_dict(fit_tables(noise=1e-9)))
    assert not usable_summaries(quiet)[1][: list(quiet.features).index(quiet.features[20])].any()


def test_unequal_intervals_are_evaluated_alike():
    """A trace at two rates with a gap: simulations are interpolated at the same times."""
    rng = np.random.default_rng(3)
    times = np.concatenate([np.arange(0, 1, 0.01), np.arange(1.2, 3, 0.001)])
    sampling = Sampling(times, start=0.5, block=4)
    signal = np.sin(3 * sampling.interval * np.arange(sampling.simulated_count))
    reduced = sampling.reduced(sampling.sampled(signal))
    assert len(reduced) == len(sampling.time)
    np.testing.assert_allclose(np.diff(sampling.time), 4e-3)
    at = 0.5 + sampling.time + 1.5e-3
    known = (at < 0.99) | (at > 1.21)
    np.testing.assert_allclose(reduced[known], np.sin(3 * at)[known], atol=5e-4)
    # The noise of samples that are interpolated is that of the fewer measured ones.
    noise = sampling.reduced(rng.standard_normal(len(times)))
    early = noise[sampling.time < 0.4]
    assert np.std(early) > 1.3 * np.std(noise[sampling.time > 0.8])


def test_a_wander_of_the_strength_has_its_correlation():
    rng = np.random.default_rng(4)
    drive = np.linspace(0, 1, 2000)
    drawn = np.array([wandering(drive, 0.1, rng, starts_at_zero=False) for _ in range(1500)])
    assert np.mean(drawn[:, 700] ** 2) == pytest.approx(1, rel=0.12)
    for distance in (0.05, 0.1, 0.2):
        index = 700 + round(distance * 1999)
        expected = math.exp(-(distance**2) / (2 * 0.1**2))
        assert np.mean(drawn[:, 700] * drawn[:, index]) == pytest.approx(expected, abs=0.08)
    assert wandering(drive, 0.1, rng, starts_at_zero=True)[0] == 0


def test_a_disagreement_has_numbers_and_units():
    feature = Feature(
        "mean_drop",
        "slips",
        "",
        "log force",
        "force drop",
        "slips are too deep",
        "slips are too shallow",
        factor=0.1,
    )
    predicted = np.log(np.linspace(0.31, 0.35, 101))
    text = sentence(feature, -9.0, math.log(0.24), predicted)
    assert text == "slips are too deep: force drop 31.2 to 34.8 mN, measured 24.0 mN"
    assert sentence(feature, 9.0, math.log(0.4), predicted).startswith("slips are too shallow")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"contacts__static_force": 30e-6}, "the first slip is too shallow"),
        long({"slider__damping_ratio": 2.0}, "the first slip is too fast"),
    ],
)
def test_a_misfit_is_described_by_what_is_seen(change, words):
    """Predictions with one value, and a trace with another."""
    plan = Plan.from_dict(fit_tables())
    simulator = prepare_all([experiment(**change)], ["a"], plan)
    points = np.tile(plan.prior.unit(np.array(list(TRUTH.values()))), (60, 1))
    made = Simulations(simulator, expected=60, executor=1)
    made.add(points)
    found = checks.compare(simulator.features, None, made.summaries, simulator.observed)
    assert found.is_rejected
    assert any(words in one for one in found.sentences)
    assert any("N, measured" in one for one in found.sentences)


def test_few_contacts_are_corrected_to_all():
    """Simulations with four times the variance and a shifted mean, against the exact posterior."""
    rng = np.random.default_rng(5)
    parameters = rng.random((800, 1))
    few = parameters + 0.1 + 0.2 * rng.standard_normal((800, 1))
    surrogate = likelihood.learn(few, parameters, parameters)
    more = rng.random((80, 1))
    corrected = surrogate.corrected(more + 0.1 * rng.standard_normal((80, 1)), more)
    at = np.array([[0.3], [0.5], [0.7]])
    np.testing.assert_allclose(corrected.mean(at), at, atol=0.04)
    deviations = corrected.standardized(at + 0.1, at)[0]
    np.testing.assert_allclose(deviations, 1, rtol=0.4)
    assert surrogate.corrected(more[:5], more[:5]) is surrogate


def test_large_interfaces_are_simulated_with_fewer_contacts():
    plan = Plan.from_dict(fit_tables(simulated_contacts=100))
    assert plan.coarse_count is None
    tables = fit_tables(simulated_contacts=100)
    tables["contacts"]["count"] = 400
    plan = Plan.from_dict(tables)
    assert plan.coarse_count == 100
    simulator = prepare_all([experiment()], ["a"], plan)
    unit = np.full(2, 0.4)
    few, whole = (simulator.forces((1, unit, one), Stop())[0] for one in (True, False))
    # The loading is the same, and later slips are not.
    assert np.max(np.abs(few - whole)[:200]) < 12 * NOISE
    assert np.max(np.abs(few - whole)) > 50 * NOISE
    tables["fit"]["free"] = {**FREE, "contacts.count": {"from": 100, "to": 900}}
    assert Plan.from_dict(tables).coarse_count is None


def test_a_trace_from_the_middle_of_an_experiment():
    """Its start is not used, and simulations run before it."""
    tree = measured(experiment(), drive={"velocity": 1e-7}, slider={"stiffness": 97.0})
    assert prepare(tree, Plan.from_dict(fit_tables())).summarizer.has_start
    later = xr.DataTree(tree.to_dataset().isel(time=slice(900, None)))
    one = prepare(later, Plan.from_dict(fit_tables()))
    assert not one.summarizer.has_start
    assert one.needs_run_in
    assert one.run_in > 0
    plan = Plan.from_dict(fit_tables())
    simulator = prepare_all([later], ["a"], plan)
    force = simulator.forces((1, plan.prior.unit(np.array(list(TRUTH.values()))), False), Stop())
    assert len(force[0]) == len(one.force)
    assert np.abs(force[0][0]) > 20 * NOISE


def test_a_simulation_runs_in_over_a_distance():
    """The loading, some breaking stretches and the track, at any velocity of the drive."""
    config = Config.from_dict(klein_tables(**SMALL))
    stretch = config.contacts.break_stretch
    track = {"contacts.track": {"spread": 0.1, "length": 5 * stretch}}
    on_track = config.replace(track)
    assert run_in_distance(on_track, 0.0) - run_in_distance(config, 0.0) == pytest.approx(
        run_in.TRACK_LENGTHS * 5 * stretch
    )
    loaded = run_in_distance(config, 2 * config.contacts.static_force)
    more = run_in.LOADINGS * config.contacts.static_force / config.spring_stiffness
    assert loaded - run_in_distance(config, 0.0) == pytest.approx(more)
    slow = run_in_samples(on_track, 0.0, 1e-3, 10**9)
    fast = run_in_samples(on_track.replace({"drive.velocity": 1e-6}), 0.0, 1e-3, 10**9)
    assert slow == pytest.approx(10 * fast, abs=10)
    rushed = run_in_samples(on_track.replace({"drive.velocity": 1.0}), 0.0, 1e-3, 10**9)
    assert rushed == pytest.approx(5 * 2e3 * config.slider.quiet_time, abs=1)
    assert run_in_samples(on_track, 0.0, 1e-3, 7) == 7


def test_a_trace_is_used_from_a_displacement_on():
    """The same of each trace, whatever its velocity."""
    tables = fit_tables(after="50 nm")
    one = prepare(experiment(), Plan.from_dict(tables))
    assert one.sampling.start == pytest.approx(0.5)
    fast = experiment(drive__velocity=2e-7)
    tables["drive"] = {"velocity": 2e-7}
    assert prepare(fast, Plan.from_dict(tables)).sampling.start == pytest.approx(0.25)
    with pytest.raises(ConfigError, match=r"fit\.after.*must not be negative"):
        Plan.from_dict(fit_tables(after="-50 nm"))


def test_a_load_cell_filters_exactly():
    """A ramp lags by the time constant, and a slow sine is weaker by (1 + (omega tau)^2)^1/2."""
    step = 0.3
    time = step * np.arange(4000)
    np.testing.assert_allclose(low_pass(time, step), time - 1 + np.exp(-time), atol=1e-12)
    omega = 0.05
    filtered = low_pass(np.sin(omega * time), step)[2000:]
    assert np.max(filtered) == pytest.approx(1 / math.hypot(1, omega), rel=1e-4)
    np.testing.assert_array_equal(low_pass(np.full(9, 3.0), 0.01), np.full(9, 3.0))


def test_a_level_multiplies_the_forces():
    """Those of all contacts, which a prescribed slider feels, or the record."""
    config = Config.from_dict(klein_tables(**SMALL)).replace(
        {
            "slider.kind": "prescribed",
            "run.duration": 0.5,
            "contacts.drag": 0.1,
            "contacts.drag_rate": 0,
        }
    )
    force = mesoslip.run(config)["contact_force"].values
    contacts = Instrument(LEVEL)
    more = mesoslip.run(contacts.levelled(config, {LEVEL: 1.25}))["contact_force"].values
    np.testing.assert_allclose(more, 1.25 * force, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(contacts.read(force[0], 1e-3, {LEVEL: 1.25}), force[0])
    record = Instrument(LEVEL, "record", filter_time=1e-6)
    assert record.levelled(config, {LEVEL: 1.25}) is config
    read = record.read(force[0], 1e-3, {LEVEL: 1.25})
    np.testing.assert_allclose(read, 1.25 * force[0], rtol=2e-3)
    free = record.read(force[0], 1e-3, {FILTER: 0.1})
    assert np.std(np.diff(free)) < 0.1 * np.std(np.diff(force[0]))


def test_levels_have_a_prior_of_their_own():
    """One for each trace, normal in its logarithm; that of a predicted trace is unknown."""
    plan = Plan.from_dict(fit_tables(level={"width": 0.1}, filter={"from": "0 s", "to": "1 ms"}))
    two = plan.of_traces(2)
    assert two.prior.keys[-3:] == ("fit.filter", "fit.level.1", "fit.level.2")
    assert two.of_traces(2) is not None
    assert two.of_traces(2).prior == two.prior
    assert set(two.prior.changes(np.ones(5))) == set(FREE)
    (level,) = [one for one in plan.of_traces(1).prior.free if one.key == LEVEL]
    quantiles = np.linspace(0, 1, 10_001)
    values = level.value(quantiles)
    np.testing.assert_allclose(level.quantile(values), quantiles, atol=1e-12)
    assert values[[0, -1]] == pytest.approx([level.low, level.high])
    # A normal law that ends at three standard deviations has 0.9866 of its deviation.
    assert np.std(np.log(values)) == pytest.approx(0.09866, rel=1e-3)
    points = np.random.default_rng(1).random((4000, 5))
    points[:, -2:] = 0.99
    prior, own = _with_own_level(two.prior, points, np.random.default_rng(2))
    assert prior.keys == ("fit.level.1", *FREE, "fit.filter")
    assert np.std(np.log(prior.values(own)[:, 0])) == pytest.approx(0.0987, rel=0.05)
    np.testing.assert_array_equal(own[:, 1:], points[:, :3])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"level": {"width": 2}}, r"fit\.level\.width = 2: must be a number above 0, at most 1"),
        ({"level": {"of": "spring"}}, r"fit\.level\.of.*must be 'contacts' or 'record'"),
        ({"level": {"widht": 0.1}}, r"fit\.level\.widht: unknown key; did you mean 'width'"),
        ({"level": 3}, r"fit\.level.*must be true or false"),
        ({"filter": "-1 ms"}, r"fit\.filter.*must not be negative"),
        ({"filter": {"from": "2 ms", "to": "1 ms"}}, r"fit\.filter\.to.*greater than 'from'"),
        ({"filter": {"from": "-2 ms", "to": "1 ms"}}, r"fit\.filter\.from.*not be negative"),
        ({"shared_track": True}, r"fit\.shared_track.*there is no \[contacts\.track\]"),
    ],
)
def test_wrong_keys_of_records_are_named(change, message):
    with pytest.raises(ConfigError, match=message):
        Plan.from_dict(fit_tables(**change))


def test_free_keys_are_removed_by_changes(tmp_path):
    path = tmp_path / "fit.toml"
    import tomli_w

    path.write_text(tomli_w.dumps(fit_tables()))
    assert Plan.load(path).prior.keys == tuple(FREE)
    plan = Plan.load(path, ["fit.free.contacts.delay=none", "fit.level=true"])
    assert plan.of_traces(1).prior.keys == ("contacts.static_force", LEVEL)


def test_traces_may_share_their_track():
    tables = fit_tables(shared_track=True)
    tables["contacts"]["track"] = {"spread": 0.2, "length": 2e-8}
    trees, piece = [experiment(), experiment()], (5, np.full(2, 0.5), False)
    shared = prepare_all(trees, ["a", "b"], Plan.from_dict(tables))
    one, other = shared.forces(piece, Stop())
    assert 0 < np.max(np.abs(one - other)) < 12 * NOISE
    tables["fit"]["shared_track"] = False
    one, other = prepare_all(trees, ["a", "b"], Plan.from_dict(tables)).forces(piece, Stop())
    assert np.max(np.abs(one - other)) > 50 * NOISE
    tables["fit"]["shared_track"] = True
    later = xr.DataTree(measured(experiment()).to_dataset().isel(time=slice(900, None)))
    with pytest.raises(FileError, match="at an unknown place on the track"):
        prepare_all([later], ["a"], Plan.from_dict(tables))


def test_predictions_alone_reject_as_often_as_stated():
    """The covariance of few predictions with many summaries, which the trace is no part of."""
    rng = np.random.default_rng(3)
    features = [Feature(f"{number}", "slips", "") for number in range(30)]
    mixed = np.eye(30) + 0.3 * rng.standard_normal((30, 30))
    found, wrong = np.array(
        [
            [
                checks.compare(features, None, drawn[1:], observed).probability
                for observed in (drawn[0], drawn[0] + 10 * mixed[0])
            ]
            for drawn in (rng.standard_normal((61, 30)) @ mixed for _ in range(100))
        ]
    ).T
    assert np.mean(found < 0.02) <= 0.06
    assert np.mean(found < 0.2) == pytest.approx(0.2, abs=0.1)
    assert np.median(wrong) < 0.05


def test_the_apparatus_comes_from_the_trace():
    """Velocity, stiffness and duration; a mass that nobody gave is fitted."""
    tree = measured(experiment(), drive={"velocity": 1e-7}, slider={"stiffness": 97.0})
    tables = fit_tables()
    for name in ("run", "drive"):
        del tables[name]
    del tables["slider"]["mass"], tables["slider"]["stiffness"]
    plan = as_plan(tables, [tree])
    assert plan.config.slider.stiffness == 97.0
    assert plan.config.drive.velocity == 1e-7
    assert plan.config.duration == pytest.approx(4.0)
    (mass,) = [one for one in plan.prior.free if one.key == "slider.mass"]
    assert mass.low < 1.47e-3 < mass.high
    assert "the mass is not given" in plan.assumed[0]
    with pytest.raises(ConfigError, match="mass"):
        Plan.from_dict(tables)


def test_strokes_need_a_drive_in_strokes():
    """A velocity would simulate another motion, and reject every model after an hour."""
    drive = {"cycle": {"amplitude": 1e-7, "frequency": 0.5, "cycles": 2}}
    tree = experiment(drive__velocity=None, drive=drive, run__duration=None)
    with pytest.raises(FileError, match=r"a.nc: the load point .* back and forth.*drive.cycle"):
        prepare(tree, Plan.from_dict(fit_tables()), "a.nc")
    tables = fit_tables()
    tables["drive"] = drive
    del tables["run"]["duration"]
    assert prepare(tree, Plan.from_dict(tables)).summarizer.pieces is not None


def test_coefficients_need_a_normal_force():
    tree = measured(experiment())
    tree = xr.DataTree(tree.to_dataset().rename(spring_force="friction_coefficient"))
    with pytest.raises(FileError, match="has friction coefficients, and a fit needs forces"):
        prepare(tree, Plan.from_dict(fit_tables()), "a.nc")


@pytest.fixture(scope="module")
def two_traces(tmp_path_factory):
    """Traces of one interface on two springs, their files, and their fit with a free stiffness."""
    folder = tmp_path_factory.mktemp("two")
    paths = []
    for stiffness in (97.0, 150.0):
        tree = experiment(slider__stiffness=stiffness, run__duration=3.0)
        paths.append(folder / f"spring{stiffness:.0f}.nc")
        from mesoslip.output.writing import write

        write(tree, paths[-1])
    with few_simulations():
        tables = fit_tables(free=FREE | STIFFNESS, simulations=140)
        return paths, mesoslip.fit(paths, tables, executor=1)


def test_several_traces_share_their_free_parameters(two_traces):
    """Each has the spring that it was recorded with."""
    _, posterior = two_traces
    assert posterior.attrs["traces"] == "spring97\nspring150"
    assert (
        "slider.stiffness is that of spring97, and 1.546 times that in spring150, as declared"
        in posterior.attrs["notes"]
    )
    # Traces with one and two slips say little of the delay.
    ratios = {"contacts.static_force": 1.2, "contacts.delay": 2.5, "slider.stiffness": 1.3}
    for key, value in (TRUTH | {"slider.stiffness": 97.0}).items():
        low, high = np.percentile(posterior["posterior"][key], [0.5, 99.5])
        assert low < value < high
        assert high < ratios[key] * low
    assert posterior.attrs["agreement_probability"] > checks.REJECTED
    groups = {str(one) for one in posterior["summaries"]["group"].values}
    assert {"slips of spring97", "slips of spring150"} <= groups
    slopes = posterior["summaries"].to_dataset()
    chosen = slopes.sel(summary=["1.loading_slope", "2.loading_slope"])
    rates = np.exp(chosen["predicted_50"].values) * chosen["factor"].values
    # Spring and contacts in series.
    expected = [1e-7 * one * 2000 / (one + 2000) for one in (97.0, 150.0)]
    np.testing.assert_allclose(rates, expected, rtol=0.02)


@pytest.mark.usefixtures("quick_pictures")
def test_a_fit_of_two_traces_is_drawn_and_reported(two_traces, tmp_path):
    _, posterior = two_traces
    figure = mesoslip.plot(posterior, tmp_path / "fit.png")
    for axes in figure.axes:
        assert not axes.xaxis.get_major_formatter().get_offset().startswith("+")
    mesoslip.plot(posterior, tmp_path / "misfit.png", view="misfit")
    assert (tmp_path / "misfit.png").stat().st_size > 3000
    mesoslip.report(posterior, tmp_path / "fit.html")
    page = (tmp_path / "fit.html").read_text()
    assert "free, 5 to 40" in page
    # As many digits as the interval has, and no duration of the base.
    force = re.search(r"F_s = ([\d.]+) µN", page)[1]
    assert len(force.replace(".", "")) <= 4
    assert "µm/s for" not in page


def test_a_trace_that_was_not_in_the_fit_is_predicted(two_traces, tmp_path, command):
    """One of the same interface on a third spring, and one of another interface."""
    from mesoslip.output.writing import write

    _, posterior = two_traces
    same = experiment(slider__stiffness=120.0, run__duration=3.0, run__seed=7)
    other = experiment(
        slider__stiffness=120.0, run__duration=3.0, contacts__static_force=24e-6, run__seed=8
    )
    with few_simulations():
        predicted = mesoslip.predict(posterior, same, executor=1)
    assert predicted.attrs["agreement_probability"] > 0.02
    assert "1.237 times that of the fit: the trace declares 120 N/m" in predicted.attrs["notes"]
    files = [tmp_path / "fit.nc", tmp_path / "other.nc", tmp_path / "predicted.nc"]
    write(posterior, files[0])
    write(other, files[1])
    line = ("fit", files[0], "--predict", files[1], "-o", files[2], "--quiet")
    with few_simulations():
        status, printed, _ = command(*line)
    assert status == 0
    assert "warning: In the model" in printed
    assert "the trace declares 120 N/m" in printed
    refused = command.refusal("fit", files[0], "fit.toml", "--predict", files[1])
    assert f"leave this one out: mesoslip fit {files[0]} --predict {files[1]}" in refused
    refused = command.refusal("slips", files[0])
    assert "fit.nc: not an output of mesoslip run but a fit" in refused
    # Before a fit of another trace, whose configuration is not read.
    for wrong, words in (("nowhere.nc", "no such file"), (files[0], "run but a fit")):
        refused = command.refusal("fit", files[1], "fit.toml", "--predict", wrong)
        assert words in refused
    status, printed, _ = command("fit", "--compare", files[0], files[2])
    assert status == 2


def test_a_free_key_of_the_apparatus_is_that_of_each_trace():
    """The same everywhere, in the declared ratio, or as the predicted trace declares it."""
    key, free = "slider.stiffness", ("slider.stiffness", "drive.velocity")
    same = apparatus.of_several("ab", [{key: 97.0}, {}], free)
    assert [one.values({key: 90.0}) for one in same] == [{key: 90.0}] * 2
    with pytest.raises(FileError, match=r"c: has no slider\.stiffness, and the other traces have"):
        apparatus.of_several("abc", [{key: 97.0}, {key: 150.0}, {}], free)
    unknown = apparatus.of_predicted({key: 120.0, "drive.velocity": 1e-6}, {}, free)
    assert unknown.values({key: 90.0, "contacts.delay": 1.0}) == {"contacts.delay": 1.0}
    sentences = apparatus.predicted_sentences(unknown)
    assert sentences[1] == (
        "slider.stiffness is the 120 N/m that the trace declares, not that of the fit"
    )
    fitted = apparatus.of_predicted({}, {key: 97.0}, free)
    assert fitted.values({key: 90.0}) == {key: 90.0}
    assert not apparatus.predicted_sentences(fitted)


def test_the_better_model_has_the_higher_score(two_traces):
    """Predictions around the traces against those of a model that is off, and the same one."""
    _, posterior = two_traces
    worse = posterior.copy(deep=True)
    data = worse["summaries"].to_dataset()
    shift = 2 * data["drawn"].std("prediction")
    worse["summaries"] = xr.DataTree(data.assign(drawn=data["drawn"] + shift))
    first, second = mesoslip.compare_fits([posterior, worse])
    assert first.difference == 0
    assert second.difference > 3 * second.error > 0
    same = mesoslip.compare_fits([posterior, posterior])
    assert same[0].difference == same[1].difference == 0
    with pytest.raises(FileError, match="needs two fits"):
        mesoslip.compare_fits([posterior])


def test_a_fit_needs_its_arguments(tmp_path, command):
    (tmp_path / "fit.toml").write_text("")
    printed = command.refusal("fit", tmp_path / "fit.toml")
    assert "needs an output with a trace" in printed


def test_simulations_of_klein_are_unchanged_by_names():
    """The first of several traces has the random numbers of a fit of it alone."""
    plan = Plan.from_dict(klein_tables(**SMALL) | {"fit": fit_tables()["fit"]})
    trees = [experiment(), experiment()]
    one, two = (prepare_all(trees[:count], ["a", "b"][:count], plan) for count in (1, 2))
    piece = (5, np.full(2, 0.5), False)
    alone, both = one.forces(piece, Stop()), two.forces(piece, Stop())
    np.testing.assert_array_equal(alone[0], both[0])
    assert np.any(both[1] != both[0])
