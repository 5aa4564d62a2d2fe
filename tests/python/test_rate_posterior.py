"""The posterior of rates and states: its density, its draws, its table and its file."""

import json
import math
from dataclasses import replace

import mesoslip
import numpy as np
import pytest
from mesoslip import _core
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.law import RateAndState
from mesoslip.analysis.rate_and_state.noise import NoiseModel, estimated_noise
from mesoslip.analysis.rate_and_state.points import Loading, Points
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.rows import fit_rows
from mesoslip.analysis.rate_and_state.search import fit_laws
from mesoslip.execution.stop import Stop, StoppedError
from mesoslip.inference import rate_posterior, rate_tree, sampler
from mesoslip.inference.rate_posterior import NOISE, Density, RatePosterior, prior_of, sample_laws
from mesoslip.output import writing
from mesoslip.plots.views import rates
from test_measured_rates import LAW, UM, trace

# A short record, so that motions are cheap.
STAGES = [Loading(20, 3 * UM, 3 * UM), Loading(20, 10 * UM, 10 * UM)]
NAMES = ("a", "b", "slip_distance")


@pytest.fixture(scope="module")
def record():
    (one,) = records_of(Experiment(trace(stages=STAGES, noise=1e-4)))
    return replace(one, laws=("slip",))


@pytest.fixture(scope="module")
def fit(record):
    return fit_laws(record)["slip"]


@pytest.fixture(scope="module", autouse=True)
def quick(fit):
    """Few draws, and least squares of the one record that were made before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rate_posterior, "fit_laws", lambda _: {"slip": fit})
        patch.setattr(rate_posterior, "CHAINS", 2)
        patch.setattr(sampler, "WALKERS", 40)
        patch.setattr(sampler, "BURN_IN", 40)
        patch.setattr(sampler, "THIN", 3)
        yield


@pytest.fixture(scope="module")
def sampled(record):
    return sample_laws(record, samples=800, seed=2)[0]


@pytest.mark.parametrize("time", [1e-3, 0.5, 30.0])
@pytest.mark.parametrize("share", [0.0, 0.4, 0.999])
@pytest.mark.parametrize("width", [1.0, 1.5])
def test_the_density_of_residuals_is_that_of_their_covariance(share, time, width):
    """Points of one to many samples, with gaps between them, or wider than their distance."""
    rng = np.random.default_rng(1)
    count = rng.integers(1, 40, 50).astype(float)
    at = np.cumsum(0.2 * count + rng.exponential(0.3, 50)) - 0.1 * count
    spread = width * 0.1 * np.sqrt((count**2 - 1) / 3)
    model = NoiseModel.of(Points((), at, spread, at, count.astype(int), count, 0.1))
    residual = 0.02 * rng.standard_normal((2, 50))
    deviation = np.array([0.01, 0.03])
    found = model.log_likelihood(residual, deviation, np.full(2, share), np.full(2, time))
    for one in range(2):
        covariance = model.covariance(deviation[one], share, time)
        assert np.linalg.eigvalsh(covariance).min() > 0
        size = np.linalg.slogdet(covariance)[1]
        square = residual[one] @ np.linalg.solve(covariance, residual[one])
        assert found[one] == pytest.approx(-0.5 * (size + square), rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_estimated_noise_is_the_likeliest(seed):
    """Also where the search begins at equal parts, of which the logarithm of the ratio is 0."""
    at = 0.05 * np.arange(400.0)
    count, spread = np.full(at.size, 3.0), np.full(at.size, 0.05 / 12**0.5)
    points = Points((), at, spread, at, count.astype(int), count, 0.05 / 3)
    model = NoiseModel.of(points)
    rng = np.random.default_rng(seed)
    factor = np.linalg.cholesky(model.covariance(1.0, 0.6, 0.4))
    residual = factor @ rng.standard_normal(at.size)
    # Without parameters the restricted likelihood is the likelihood.
    found = estimated_noise(points, residual, np.zeros((at.size, 1)))
    here = (found.deviation, found.share, found.time)
    best = model.log_likelihood(residual[None], *np.array(here)[:, None])[0]
    for index, (low, high) in enumerate([(0.97, 1.03), (0.9, 1.1), (0.8, 1.25)]):
        for change in (low, high):
            near = np.array(here)
            near[index] *= change
            assert model.log_likelihood(residual[None], *near[:, None])[0] < best + 0.1


def test_the_density_of_a_nearly_linear_law_is_that_of_least_squares(fit):
    """With their white noise: one standard error along each axis of the covariance costs 1/2."""
    density = Density(fit)
    assert fit.noise.time == 0
    variances, axes = np.linalg.eigh(fit.covariance)
    away = np.sqrt(variances)[:, None] * axes.T
    at = np.concatenate([fit.at[None], fit.at + away, fit.at - away])
    values = [fit.law.parameters(at)[name] for name in fit.law.names]
    noise = (fit.noise.deviation * fit.law.scale, 0.0, 1.0)
    values += [np.full(len(at), one) for one in noise]
    found = density(density.prior.unit(np.stack(values, axis=-1)))
    sides = (found[1:] - found[0]).reshape(2, -1)
    # Priors that are uniform in the logarithm do not change over an error.
    np.testing.assert_allclose(sides.mean(axis=0), -0.5, atol=0.02)
    np.testing.assert_allclose(sides, -0.5, atol=0.1)


def test_errors_of_motions_do_not_change_the_density(fit):
    """By the tolerance, which follows from the noise."""
    density = Density(fit)
    points = density.starts(np.random.default_rng(1))
    found = density(points)
    exact = Density(fit)
    exact.tolerance = 1e-9
    error = found - exact(points)
    assert 1e-6 < density.tolerance < 1e-4
    assert np.ptp(error - np.median(error)) < 0.3
    assert np.ptp(found) > 5


def test_draws_have_the_mean_and_the_width_of_least_squares(sampled):
    """Wider by the noise, whose correlation is not known."""
    fit, values = sampled.fit, sampled.values.reshape(-1, len(sampled.prior))
    for name, column in zip(sampled.prior.keys, values.T, strict=True):
        if name not in NOISE:
            assert abs(column.mean() - fit.value(name)) < 0.5 * fit.error(name), name
            assert 0.8 < column.std() / fit.error(name) < 1.5, name
    noise = values[:, sampled.prior.keys.index("noise")]
    assert abs(noise.mean() - 1e-4) < 3 * noise.std()
    for name in NAMES:
        low, high = np.percentile(values[:, sampled.prior.keys.index(name)], [0.2, 99.8])
        assert low < getattr(LAW, name) < high


def test_the_same_seed_gives_the_same_draws(record, sampled):
    again = sample_laws(record, samples=80, seed=2)[0]
    np.testing.assert_array_equal(again.chains[0, :40], sampled.chains[0, :40])
    other = sample_laws(record, samples=80, seed=3)[0]
    assert not np.array_equal(again.chains, other.chains)


def test_a_stop_ends_the_draws(record):
    stop, parts = Stop(), []

    def progress(part):
        parts.append(part)
        stop.set()

    with pytest.raises(StoppedError):
        sample_laws(record, samples=80, seed=1, progress=progress, stop=stop)
    assert len(parts) == 1
    assert 0 < parts[0] < 0.1


def test_two_state_variables_keep_their_order(record):
    fits = fit_laws(replace(record, laws=("slip", "slip, two states")))
    density = Density(fits["slip, two states"])
    names = density.prior.keys
    start = density.starts(np.random.default_rng(0))[:1]
    swapped = start.copy()
    for one, other in (("b", "b2"), ("slip_distance", "slip_distance2")):
        first, second = names.index(one), names.index(other)
        swapped[:, [first, second]] = start[:, [second, first]]
    assert np.isfinite(density(start))
    assert density(swapped) == -math.inf


def test_a_law_that_does_not_describe_the_record_is_in_every_line():
    """A record of two state variables: both tables say that one is not enough."""
    stages = [Loading(40, 3 * UM, 3 * UM), Loading(60, 10 * UM, 10 * UM)]
    tree = trace(stages=stages, noise=1e-4)
    parameters = np.array([[0.01, 0.008, 4 * UM, 0.006, 100 * UM, 1e3, 0.0]]).T
    durations, velocities = (
        np.array([getattr(one, name) for one in stages]) for name in ("duration", "start_velocity")
    )
    times = tree["time"].values
    force = _core.rate_and_state_motions(
        "slip",
        2,
        np.asfortranarray(parameters),
        3 * UM,
        durations,
        velocities,
        velocities,
        times,
        1e-8,
    )[0][:, 0]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(times.size)
    tree["friction_coefficient"][:] = 0.6 + force + noise
    experiment = Experiment(tree)
    rows = fit_rows(experiment, 0, laws=("slip", "slip, two states"))
    assert [one["verdict"] for one in rows] == ["not described", "described"]
    assert rows[0]["note"].startswith("does not describe the record: residuals exceed the noise")
    # The table of the posterior, with starting points as draws.
    (record,) = records_of(experiment)
    wrong = fit_laws(replace(record, laws=("slip", "slip, two states")))["slip"]
    density = Density(wrong)
    chains = density.starts(np.random.default_rng(0))[:100].reshape(2, 50, -1)
    found = RatePosterior(wrong, density.prior, chains, is_preferred=False, noise=density.own_noise)
    table = rate_tree.rate_table(rate_tree._build_tree([found], experiment, "", 1))
    assert {one[-1] for one in table.rows} == {"not described"}
    # Its residuals are not those of the better law, nor is its noise.
    own, best = found.noise_by_squares[0], wrong.noise.deviation * wrong.law.scale
    assert own > 1.5 * best
    (printed,) = (
        row
        for row in rate_tree.rows_of_posterior(rate_tree._build_tree([found], experiment, "", 1))
        if row["parameter"] == "noise"
    )
    assert printed["least_squares"] == pytest.approx(own)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The trace in a file."""
    path = tmp_path_factory.mktemp("rates") / "step.nc"
    writing.write(trace(stages=STAGES, noise=1e-4), path)
    return path


@pytest.mark.usefixtures("quick_pictures")
def test_the_command_prints_and_writes_a_posterior(command, stored, monkeypatch):
    """Each line of the table has the verdict; the file opens as those of fits do."""
    path, table = stored.with_name("step.rates.nc"), stored.with_suffix(".csv")
    given = ("--samples", "100", "-o", path, "--table", table, "--quiet")
    out = command.output("response", stored, "--posterior", *given)
    lines = [one for one in out.splitlines() if one.lstrip().startswith("slip  ")]
    assert len(lines) == 9
    assert all(one.endswith("described") and "not" not in one for one in lines)
    assert "the stiffness is known: 1000 1/m" in out
    tree = mesoslip.open_output(path)
    draws = tree["posterior"].to_dataset()
    assert dict(draws.sizes) == {"chain": 2, "draw": 50}
    assert draws["a"].attrs["units"] == "1"
    assert draws["trend"].attrs["units"] == "m-1"
    low, high = np.percentile(draws["slip_distance"], [0, 100])
    assert low < LAW.slip_distance < high
    assert "a_minus_b" in tree["parameters"]["parameter"].values
    assert table.read_text().startswith("law [1],parameter [1],unit [1],least_squares [see unit]")
    picture, page = stored.with_suffix(".png"), stored.with_suffix(".html")
    assert command("plot", path, "-o", picture)[0] == 0
    # Pairs take seconds to draw.
    monkeypatch.setattr(rates, "draw_pairs", lambda *_: None)
    assert command("report", path, "-o", page)[0] == 0
    assert "Rates and states" in page.read_text()
    assert command("fit", path, "--predict", stored)[0] == 2
    # Forces are those of the record within the noise.
    predicted = tree["posterior_predictive"]["friction_coefficient"].values[0]
    residual = tree["observed_data"]["friction_coefficient"].values - predicted.mean(axis=0)
    assert np.sqrt(np.mean(residual**2)) < 2e-4


def test_a_posterior_as_json(command, stored):
    path = stored.with_name("json.nc")
    given = ("--samples", "100", "-o", path, "--json", "--law", "slip")
    found = json.loads(command.output("response", stored, "--posterior", *given))
    rows = {one["parameter"]: one for one in found["rate_and_state_posterior"]}
    assert rows["trend"]["unit"] == "m-1"
    assert rows["a"]["percentile_5"] < LAW.a < rows["a"]["percentile_95"]
    assert rows["a"]["prior"] == "logarithmic"
    assert {one["verdict"] for one in rows.values()} == {"described"}
    (assessment,) = found["assessments"]
    assert assessment.startswith("slip law: describes the record within the noise; preferred")


def test_an_unknown_stiffness_has_a_prior(record, fit):
    law = RateAndState(record.points, "slip", math.nan, record.distances, with_trend=True)
    at = np.append(fit.at, math.log(1e3))
    free = prior_of(replace(fit, law=law, at=at)).free
    (stiffness,) = (one for one in free if one.key == "stiffness")
    assert stiffness.is_logarithmic
    assert stiffness.low < 1e3 < stiffness.high


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--samples", "100"), "needs --posterior"),
        (("--posterior", "--no-fit"), "does not go with --posterior"),
        (("--posterior", "--normal-force", "1 N"), "does not go with --posterior"),
        (("--posterior", "--samples", "3"), "must be a whole number of at least 100"),
        (("--posterior", "--law", "sleep"), "must be one of 'ageing', 'slip', "),
        (("--posterior", "-o", "a.csv"), "an output is netCDF"),
    ],
)
def test_wrong_options_are_refused(command, stored, given, message):
    error = command.refusal("response", stored, *given)
    assert message in error


def test_what_has_no_step_has_no_posterior(command, tmp_path):
    path = tmp_path / "still.nc"
    writing.write(trace(stages=[STAGES[0], STAGES[0]]), path)
    error = command.refusal("response", path, "--posterior", "-o", tmp_path / "a.nc")
    assert "no step and no hold" in error
    assert not (tmp_path / "a.nc").exists()
