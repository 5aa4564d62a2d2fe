"""Fits: the machinery on problems whose posterior is known, and traces whose truth is."""

import json
import math
import re
import shutil
from concurrent.futures import Future
from contextlib import contextmanager
from types import SimpleNamespace

import mesoslip
import numpy as np
import pytest
import tomli_w
from conftest import drive_in_stages, klein_tables, long
from mesoslip.errors import ConfigError, FileError, WriteError
from mesoslip.execution.stop import Stop, StoppedError
from mesoslip.execution.store import Store
from mesoslip.inference import checks, fit_trace, likelihood, rounds, sampler
from mesoslip.inference.features import Feature
from mesoslip.inference.fit_plan import Plan
from mesoslip.inference.prior import FreeParameter, Prior
from mesoslip.inference.rounds import estimate_posterior
from mesoslip.inference.sampler import draw, r_hat
from mesoslip.inference.simulations import Simulations, Simulator
from mesoslip.inference.summaries import Summarizer
from mesoslip.inference.traced_experiment import prepare
from mesoslip.output.writing import write
from scipy.stats import kstest, norm

FREE = {
    "contacts.static_force": {"from": "5 uN", "to": "40 uN", "prior": "logarithmic"},
    "contacts.delay": {"from": "0.2 ms", "to": "4 ms", "prior": "logarithmic"},
}
# Few contacts, so that a simulation takes some milliseconds.
SMALL = {
    "run__duration": 4.0,
    "contacts__count": 150,
    "contacts__threshold__relative_width": 0.05,
    "contacts__delay": 1e-3,
    "output__interval": 2e-3,
}
NOISE = 5e-8
# Simulations of a whole fit.
FEW = 100


@contextmanager
def few_simulations():
    """Fits with few simulations, short chains and few predictions, for tests of whole fits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mesoslip.inference.fit_plan.MIN_SIMULATIONS", 100)
        patch.setattr(rounds, "MIN_FIRST", 50)
        patch.setattr(rounds, "MIN_NEXT", 30)
        patch.setattr(sampler, "BURN_IN", 60)
        patch.setattr(sampler, "THIN", 4)
        patch.setattr("mesoslip.inference.fit_plan.PREDICTIONS", 50)
        yield


def fit_tables(**changes):
    """What is known of the small experiment, and a fit of it."""
    tables = klein_tables(**SMALL)
    tables["fit"] = {"free": FREE, "simulations": 300, "noise": NOISE} | changes
    return tables


def experiment(**changes):
    """A trace of the small experiment, with noise."""
    tree = mesoslip.run(klein_tables(**SMALL | {"run__seed": 99} | changes))
    rng = np.random.default_rng(5)
    tree["spring_force"] = tree["spring_force"] + NOISE * rng.standard_normal(
        tree["spring_force"].shape
    )
    return tree


class Linear:
    """Simulations whose summaries are linear in the parameters, with normal noise."""

    def __init__(self, matrix, deviation, seed):
        self.simulator = SimpleNamespace(prior=range(matrix.shape[1]))
        self.has_coarse = False
        self.matrix, self.deviation = matrix, deviation
        self.rng = np.random.default_rng(seed)
        self.parameters = np.empty((0, matrix.shape[1]))
        self.summaries = np.empty((0, matrix.shape[0]))

    def __len__(self):
        return len(self.parameters)

    def simulate(self, points):
        noise = self.rng.standard_normal((len(points), len(self.matrix)))
        return points @ self.matrix.T + self.deviation * noise

    def add(self, points):
        self.parameters = np.concatenate([self.parameters, points])
        self.summaries = np.concatenate([self.summaries, self.simulate(points)])


def test_products_of_parameters_need_simulations():
    """The number that is stated is that from which on they are terms."""
    rng = np.random.default_rng(1)
    parameters = rng.random((200, 5))
    made = [likelihood.learn(parameters[:n], parameters[:n], parameters[:n]) for n in (167, 168)]
    assert [one.simulations_for_products for one in made] == [168, 0]
    alone = likelihood.learn(parameters[:20, :1], parameters[:20, :1], parameters[:20, :1])
    assert alone.simulations_for_products == 0


def linear_problem(seed, total=400):
    """The truth, the estimate, and mean and standard deviations of the exact posterior."""
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((12, 2))
    truth = rng.random(2)
    made = Linear(matrix, 0.1, seed)
    observed = made.simulate(truth[None])[0]
    estimate = estimate_posterior(made, observed, total, np.random.default_rng(seed))
    covariance = 0.1**2 * np.linalg.inv(matrix.T @ matrix)
    mean = np.linalg.lstsq(matrix, observed, rcond=None)[0]
    return truth, estimate, mean, np.sqrt(np.diag(covariance))


@pytest.fixture(scope="module", params=[(0, 1, 4, 5), long(range(14))])
def linear_problems(request):
    """Some of them, for what is tested of them together; of the few, three are far from bounds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampler, "BURN_IN", 80)
        patch.setattr(sampler, "THIN", 5)
        return [linear_problem(seed) for seed in request.param]


def test_a_normal_problem_has_its_exact_posterior(linear_problems):
    """Where the bounds of the prior are far: mean and standard deviation of a linear regression."""
    shifts, widths = [], []
    for _, estimate, mean, deviation in linear_problems:
        if np.all((mean > 4 * deviation) & (mean < 1 - 4 * deviation)):
            shifts.append((estimate.draws.mean(axis=0) - mean) / deviation)
            widths.append(estimate.draws.std(axis=0) / deviation)
        assert np.max(r_hat(estimate.chains)) < 1.05
        # The likelihood knows how uncertain it is.
        assert estimate.coverage[0] == pytest.approx(0.5, abs=0.12)
        assert estimate.coverage[1] == pytest.approx(0.9, abs=0.06)
    assert len(shifts) >= 3
    assert np.max(np.abs(shifts)) < 0.6
    assert np.abs(np.mean(shifts)) < 0.2
    assert 0.95 < np.mean(widths) < 1.25


def test_ranks_of_the_truth_are_uniform(linear_problems):
    """Calibration by simulation, of a problem that takes no time; that of the model is a study."""
    ranks = []
    for truth, estimate, _, _ in linear_problems:
        ranks += list(np.mean(estimate.draws < truth, axis=0))
    assert kstest(ranks, "uniform").pvalue > 0.02
    assert 0.7 < np.mean(np.abs(np.array(ranks) - 0.5) < 0.45) <= 1


def test_draws_are_of_the_density():
    """A normal density cut off by the cube, against its moments."""

    def log_density(points):
        return -0.5 * np.sum(((points - [0.5, 0.0]) / [0.05, 0.2]) ** 2, axis=1)

    rng = np.random.default_rng(0)
    chains = draw(log_density, rng.random((40, 2)), rng, chains=4, draws=1000)
    assert chains.shape == (4, 1000, 2)
    draws = chains.reshape(-1, 2)
    assert np.mean(draws[:, 0]) == pytest.approx(0.5, abs=0.005)
    assert np.std(draws[:, 0]) == pytest.approx(0.05, rel=0.06)
    # A half-normal one.
    assert np.mean(draws[:, 1]) == pytest.approx(0.2 * np.sqrt(2 / np.pi), rel=0.06)
    assert np.max(r_hat(chains)) < 1.02


def test_r_hat_compares_the_scatter_between_chains_with_that_within():
    """Its square is 1 plus the variance of the means of half chains over the variance of each."""
    chains = 3.0 * np.random.default_rng(4).standard_normal((2, 40_000, 1))
    assert r_hat(chains) == pytest.approx([1.0], abs=1e-3)
    # The means of the four halves are 0, 0, 3, 3, whose variance is 3, that of each half is 9.
    chains[1] += 3.0
    assert r_hat(chains) == pytest.approx([math.sqrt(1 + 3 / 9)], rel=5e-3)


def test_statistics_of_a_simulation_come_from_all_others(monkeypatch):
    """Against regressions that leave it out."""
    rng = np.random.default_rng(6)
    scores, parameters = rng.standard_normal((30, 8)), rng.random((30, 2))
    parameters[:, 0] += scores[:, 0]
    monkeypatch.setattr(likelihood, "RIDGES", np.array([0.1]))
    left_out = likelihood._ridge(scores, parameters)[2]
    # The penalty grows with the number of simulations.
    monkeypatch.setattr(likelihood, "RIDGES", np.array([0.1 * 30 / 29]))
    for one in (0, 7, 29):
        weights, offset, _ = likelihood._ridge(
            np.delete(scores, one, axis=0), np.delete(parameters, one, axis=0)
        )
        np.testing.assert_allclose(left_out[one], scores[one] @ weights + offset)


def test_statistics_of_a_trace_scatter_as_those_of_simulations():
    """Of few simulations with many summaries, where what they are predicted by matters most."""
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        matrix = rng.standard_normal((60, 2))
        made = Linear(matrix, 4.0, seed)
        parameters, others = rng.random((120, 2)), rng.random((400, 2))
        projection, statistics = likelihood.project(
            made.simulate(parameters), parameters, np.zeros(60)
        )
        new = projection(made.simulate(others)) - others
        ratios.append(np.var(new, axis=0) / np.var(statistics - parameters, axis=0))
    assert np.mean(ratios) == pytest.approx(1, abs=0.04)


def test_the_likelihood_learns_means_widths_and_tails():
    rng = np.random.default_rng(3)
    parameters = rng.random((2000, 2))
    mean = np.stack([parameters[:, 0] ** 2, parameters[:, 0] * parameters[:, 1]], axis=1)
    width = 0.1 * np.exp(parameters[:, :1])
    for freedom in (4.0, np.inf):
        noise = rng.standard_normal((2000, 2))
        if np.isfinite(freedom):
            noise /= np.sqrt(rng.chisquare(freedom, (2000, 1)) / freedom)
        surrogate = likelihood.learn(mean + width * noise, parameters, parameters)
        at = np.array([[0.3, 0.7], [0.8, 0.2]])
        exact = np.stack([at[:, 0] ** 2, at[:, 0] * at[:, 1]], axis=1)
        np.testing.assert_allclose(surrogate.mean(at), exact, atol=0.03)
        deviations, _ = surrogate.standardized(exact + 0.1 * np.exp(at[:, :1]), at)
        np.testing.assert_allclose(deviations, 1, rtol=0.2)
        if np.isfinite(freedom):
            assert 3 <= surrogate.freedom <= 6
            continue
        assert surrogate.freedom > 20
        # Against the normal density itself, its width and all.
        statistics = np.array([0.3, 0.2])
        away = (statistics - exact) / (0.1 * np.exp(at[:, :1]))
        density = -0.5 * np.sum(away**2, axis=1) - 2 * at[:, 0]
        learnt = surrogate.log_likelihood(statistics, at)
        assert learnt[0] - learnt[1] == pytest.approx(density[0] - density[1], rel=0.2)


def test_the_uncertainty_of_the_mean_is_part_of_the_likelihood():
    """Of a straight line through few simulations, as in any table of regression: 1 + x (X'X)^-1 x
    times the variance, also far from the simulations."""
    known = np.array([-1.5, -0.5, 0.0, 0.5, 1.5])
    terms = np.stack([np.ones(5), known], axis=1)
    surrogate = likelihood.Surrogate(
        powers=((), (0,)),
        centre=np.zeros(1),
        spread=np.ones(1),
        coefficients=np.array([[2.0], [3.0]]),
        inverse=np.linalg.inv(terms.T @ terms),
        log_scale=np.array([[np.log(0.1)], [0.0]]),
        log_range=np.array([[-9.0], [9.0]]),
        root=np.eye(1),
        freedom=np.inf,
        validity=None,
    )
    at = np.array([0.0, 1.0, 4.0])
    width = 0.1 * np.sqrt(1 + 1 / 5 + at**2 / np.sum(known**2))
    expected = norm.logpdf(2.5, 2 + 3 * at, width)
    found = surrogate.log_likelihood(np.array([2.5]), at[:, None])
    np.testing.assert_allclose(found - found[0], expected - expected[0], rtol=1e-12)


def test_summaries_that_few_simulations_have_lower_the_likelihood_where_they_have_not():
    rng = np.random.default_rng(4)
    parameters = rng.random((500, 1))
    has = rng.random(500) < parameters[:, 0]
    order = np.argsort(~has, kind="stable")
    statistics = rng.standard_normal((int(has.sum()), 1))
    surrogate = likelihood.learn(statistics, parameters[has], parameters[order])
    low, high = surrogate.log_likelihood(np.zeros(1), np.array([[0.1], [0.9]]))
    assert low < high - 1


def test_priors_go_to_the_unit_cube_and_back():
    prior = Prior(
        (
            FreeParameter("a", 1e-6, 1e-4, True),
            FreeParameter("b", -1.0, 3.0),
            FreeParameter("c", 1, 9, False, "1", True),
        )
    )
    unit = np.random.default_rng(0).random((5, 3))
    values = prior.values(unit)
    np.testing.assert_allclose(prior.unit(values)[:, :2], unit[:, :2])
    np.testing.assert_allclose(prior.values(np.array([0.5, 0.5, 0.5])), [1e-5, 1.0, 5])
    assert prior.changes(values[0])["c"] == round(values[0, 2])


def summarizer(tree, **changes):
    time = tree["time"].values
    known = {"noise": NOISE, "period": 0.0245, "scale": 18e-6} | changes
    return Summarizer(time, **known)


def test_summaries_do_not_depend_on_direction_or_later_phase():
    tree = experiment()
    force = tree["spring_force"].values[0]
    one = summarizer(tree)
    values = one(force)
    assert len(one.names) == len(set(one.names)) == values.size
    np.testing.assert_allclose(summarizer(tree, direction=-1.0)(-force), values)
    # Without its start, a trace moved by some slips has nearly the same statistics.
    moved = summarizer(tree, has_start=False)
    kept = np.flatnonzero(np.isin(moved.names, ["mean_peak", "mean_drop", "waveform_+0.50"]))
    whole = moved(force)[kept]
    tail = Summarizer(tree["time"].values[:-500], NOISE, 0.0245, 18e-6, has_start=False)
    np.testing.assert_allclose(tail(force[500:])[kept], whole, rtol=0.25, atol=0.05)


def test_a_trace_without_slips_has_no_summaries_of_slips():
    tree = experiment()
    one = summarizer(tree)
    values = dict(zip(one.names, one(1e-5 * (1 - np.exp(-tree["time"].values))), strict=True))
    assert np.isnan(values["mean_drop"])
    assert np.isnan(values["first_waveform_+0.50"])
    assert np.isfinite(values["mean_force"])
    assert values["slip_count"] == np.log(0.5)


@pytest.fixture(scope="module")
def small_fit(tmp_path_factory):
    """The trace of the small experiment, its posterior, and a folder with the simulations."""
    folder = tmp_path_factory.mktemp("fit")
    trace = folder / "trace.nc"
    write(experiment(), trace)
    with few_simulations():
        posterior = mesoslip.fit(
            trace, fit_tables(simulations=FEW), store=folder / "kept", executor=1
        )
    return trace, posterior, folder


def test_the_truth_lies_in_the_posterior(small_fit):
    _, posterior, _ = small_fit
    truth = {"contacts.static_force": 18e-6, "contacts.delay": 1e-3}
    for key, value in truth.items():
        draws = posterior["posterior"][key]
        assert draws.dims == ("chain", "draw")
        low, high = np.percentile(draws, [0.5, 99.5])
        assert low < value < high
        assert high < 1.7 * low
    assert posterior["posterior"]["contacts.static_force"].attrs["units"] == "N"
    assert not posterior.attrs["warnings"] or "describe" not in posterior.attrs["warnings"]
    assert posterior.attrs["simulation_count"] == FEW


def test_a_report_reports_the_parameters(small_fit, tmp_path):
    _, posterior, _ = small_fit
    mesoslip.report(posterior, tmp_path / "fit.html")
    page = (tmp_path / "fit.html").read_text()
    assert "contacts.static_force" in page
    assert "Agreement of the model with the trace" in page
    # Free keys are marked, with their ranges in place of values that are not used.
    assert page.count('<tr class="marked">') == 2
    assert "<td>contacts.delay (ms)</td><td>free, 0.2 to 4</td>" in page
    median = float(posterior["posterior"]["contacts.delay"].median())
    value, unit = re.search(r"τ_d = ([\d.]+) (µs|ms)", page).groups()
    assert float(value) * {"µs": 1e-6, "ms": 1e-3}[unit] == pytest.approx(median, rel=0.01)
    with pytest.raises(FileError, match="shows one output at a time"):
        mesoslip.plot([posterior, posterior])


@pytest.mark.usefixtures("quick_pictures")
def test_the_same_seed_gives_the_same_posterior(small_fit, tmp_path, command, monkeypatch):
    """By the command, with any number of workers, and after a stop at any time."""
    trace, posterior, _ = small_fit
    stop = Stop()
    done = []

    def watch(part):
        done.append(part)
        if part > 0.4:
            stop.set()

    config, output = tmp_path / "fit.toml", tmp_path / "posterior.nc"
    config.write_text(tomli_w.dumps(fit_tables(simulations=FEW)))
    store = tmp_path / "posterior.simulations"
    with few_simulations(), pytest.raises(StoppedError):
        mesoslip.fit(trace, config, store=store, executor=2, progress=watch, stop=stop)
    assert store.exists()
    again = []
    line = ("fit", trace, config, "-o", output, "--quiet", "--workers", 2)
    with few_simulations(), pytest.MonkeyPatch.context() as patch:
        simulated = Simulator.forces
        patch.setattr(Simulator, "forces", lambda *of: again.append(1) or simulated(*of))
        status, printed, _ = command(*line)
    assert status == 0
    assert len(again) < 0.85 * len(again + done)
    assert "contacts.static_force" in printed
    assert "µN" in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fit.toml", "posterior.nc"]
    resumed = mesoslip.open_output(output)
    for key in FREE:
        np.testing.assert_array_equal(resumed["posterior"][key], posterior["posterior"][key])
    picture = tmp_path / "posterior.png"
    assert command("plot", output, "-o", picture)[0] == 0
    assert picture.stat().st_size > 3000
    # The same posterior, which is not computed again.
    monkeypatch.setattr(fit_trace, "fit", lambda *_, **__: resumed)
    with few_simulations():
        status, printed, _ = command(*line, "--json")
    assert status == 0
    row = json.loads(printed)["parameters"]["contacts.delay"]
    assert row["interval_90"][0] < row["median"] < row["interval_90"][1]
    # Without room for it, the simulations are kept.
    with Store(store, "simulations") as kept:
        kept.write("000000", {})

    def full(*_):
        raise WriteError("no space left on the disk")

    monkeypatch.setattr("mesoslip.output.writing.write", full)
    with few_simulations():
        status, _, err = command(*line)
    assert status == 1
    assert "no space left on the disk; 1 simulation is stored: the same command continues" in err
    assert (store / "000000.json").exists()


@pytest.mark.parametrize("damage", ["brackets", "digits", "number", "none", "cut"])
def test_damaged_simulations_are_made_again(damage, small_fit, tmp_path):
    """Once more to the bit; those of the fit that are whole are read."""
    _, _, folder = small_fit
    shutil.copytree(folder / "kept", tmp_path / "kept")
    path = tmp_path / "kept" / "00000007.json"
    body = json.loads(path.read_bytes())
    point = np.array([float(one) for one in body["parameters"]])
    with Store(tmp_path / "kept", "simulations") as store:
        simulations = Simulations(None, expected=1, store=store, executor=1)
        assert simulations._read(7, point) is not None
        body.pop("checksum")
        if damage == "brackets":
            path.write_bytes(b"[" * 200_000)
        elif damage == "cut":
            path.write_bytes(path.read_bytes()[:100])
        else:
            changed = {"digits": [10**400], "number": 7, "none": None}[damage]
            store.write("00000007", body | {"summaries": changed})
            assert store.read("00000007") is not None
        assert simulations._read(7, point) is None


def test_simulations_of_another_fit_are_refused(small_fit):
    trace, _, folder = small_fit
    with pytest.raises(FileError, match="of another configuration, trace or version"):
        mesoslip.fit(trace, fit_tables(seed=2), store=folder / "kept")
    (folder / "file").write_bytes(b"PK\x03\x04")
    with pytest.raises(FileError, match="was not made by this program"):
        mesoslip.fit(trace, fit_tables(), store=folder / "file")


def test_another_mass_is_no_part_of_the_model():
    """The waveform of slips of a trace of four times the mass disagrees."""
    tree = experiment(slider__mass=4 * 1.47e-3)
    with few_simulations():
        posterior = mesoslip.fit(tree, fit_tables(simulations=100), executor=1)
    assert posterior.attrs["agreement_probability"] < checks.REJECTED
    assert "no parameters in the ranges describe the trace" in posterior.attrs["warnings"]


def test_what_predictions_never_have_is_reported():
    rng = np.random.default_rng(1)

    def drawn(count):
        return rng.standard_normal((count, 1)) + 0.2 * rng.standard_normal((count, 5))

    features = [Feature(f"s{one}", "gh"[one % 2], "a summary") for one in range(5)]
    usual = [
        checks.compare(features, drawn(100), drawn(100), drawn(1)[0]).probability
        for _ in range(200)
    ]
    assert kstest(usual, "uniform").pvalue > 0.01
    simulated, predicted = drawn(200), drawn(200)
    # Each summary of a group is as usual, but not together with the others.
    unlikely = np.array([1.0, 0, -1.0, 0, 0])
    assert checks.compare(features, simulated, predicted, unlikely).is_rejected
    off = checks.compare(features, simulated, predicted, np.array([0, 0, 30.0, 0, 0]))
    assert off.is_rejected
    assert np.nanargmax(np.abs(off.scores)) == 2
    assert off.disagreeing == ("g",)
    lacking = checks.compare(features, simulated, predicted, np.array([0, np.nan, 0, 0, 0]))
    assert lacking.is_rejected
    assert "but not for the trace" in lacking.sentences[0]
    predicted[:, 3] = np.nan
    extra = checks.compare(features, simulated, predicted, np.zeros(5))
    assert extra.is_rejected
    assert "hardly any prediction" in extra.sentences[0]


def test_warnings_report_what_is_not_determined():
    prior = Prior(
        (
            FreeParameter("a", 0, 1),
            FreeParameter("b", 0, 1),
            FreeParameter("c", 0, 1),
            FreeParameter("d", 0, 1),
        )
    )
    rng = np.random.default_rng(2)
    first = 0.5 + 0.02 * rng.standard_normal(4000)
    draws = np.stack(
        [
            first,
            first + 0.002 * rng.standard_normal(4000),
            rng.random(4000),
            1 - np.abs(0.05 * rng.standard_normal(4000)),
        ],
        axis=1,
    )
    fine = checks.Agreement(0.5, np.zeros(1), {}, ())
    printed = "\n".join(checks.warnings(prior, draws, fine, np.ones(4), {}))
    assert "c is not determined" in printed
    assert "a and b are only determined together (correlation +" in printed
    assert "d lies at the end of its range: widen fit.free.d.to" in printed
    assert "a is not" not in printed
    assert "describe the trace" not in printed


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"free": None}, "fit.free: must be a table of free keys"),
        ({"free": {"contacts.dely": {"from": 0, "to": 1}}}, "did you mean 'contacts.delay'"),
        ({"free": {"contacts.delay": {"from": "1 ms"}}}, "fit.free.contacts.delay.to: missing"),
        ({"free": {"contacts.delay": {"from": "2 ms", "to": "1 ms"}}}, "greater than 'from'"),
        ({"free": {"contacts.delay": {"from": "1 N", "to": "2 N"}}}, "has the unit N"),
        (
            {"free": {"contacts.delay": {"from": 0, "to": 1, "prior": "logarithmic"}}},
            "greater than 0 with a logarithmic prior",
        ),
        ({"free": {"contacts.delay": {"from": 0, "to": 1, "prior": "flat"}}}, "'uniform' or"),
        ({"free": {"contacts.delay": {"from": 0, "to": 1, "prio": "x"}}}, "did you mean 'prior'"),
        (
            {"free": {"contacts.back_force_ratio": {"from": 0.1, "to": 1.5}}},
            "contacts.back_force_ratio.to = 1.5: cannot be run",
        ),
        ({"free": {"run.seed": {"from": 1, "to": 5}}}, "no key that can be fitted"),
        ({"free": {"contacts": {"delay": [0.1, 1]}}}, "fit.free.contacts.delay = [0.1, 1]: must"),
        ({"simulations": 10}, "at least 300"),
        ({"noise": "-1 uN"}, "must not be negative"),
        ({"smulations": 1000}, "did you mean 'simulations'"),
    ],
)
def test_what_is_wrong_with_a_fit_is_reported(change, said):
    tables = fit_tables(**change)
    with pytest.raises(ConfigError, match=re.escape(said)):
        Plan.from_dict(tables)


def test_changes_of_free_keys_are_refused(tmp_path):
    """They had no effect: free keys are drawn."""
    path = tmp_path / "fit.toml"
    path.write_text(tomli_w.dumps(fit_tables()))
    free = Plan.load(path).prior.free[0].key
    with pytest.raises(ConfigError, match=rf"{free}: cannot be changed, as .* sets it"):
        Plan.load(path, [f"{free}=1"])
    assert Plan.load(path, ["fit.seed=7"]).seed == 7


def test_a_fit_needs_a_table_and_a_trace(tmp_path, command):
    with pytest.raises(ConfigError, match="name the free keys"):
        Plan.from_dict(klein_tables())
    tree = experiment()
    plan = Plan.from_dict(fit_tables(after="3.99 s"))
    with pytest.raises(FileError, match=r"after 3\.99 s; a fit needs at least"):
        prepare(tree, plan)
    printed = command.refusal("fit", tmp_path / "none.nc", tmp_path / "none.toml")
    assert "no such file" in printed


def test_a_configuration_that_contradicts_the_trace_is_refused():
    tree = experiment(slider__stiffness=140.0)
    with pytest.raises(ConfigError, match="is 140 in the trace"):
        prepare(tree, Plan.from_dict(fit_tables()))
    free = FREE | {"slider.stiffness": {"from": 50, "to": 300}}
    assert prepare(tree, Plan.from_dict(fit_tables(free=free))).noise.deviation == NOISE


def test_a_trace_may_count_from_a_time_on():
    """Then its start is not summed up, and simulations are cut as well."""
    plan = Plan.from_dict(fit_tables(after="1 s"))
    one = prepare(experiment(), plan)
    assert len(one.force) == 1501
    assert not one.summarizer.has_start
    assert "first_peak" not in one.summarizer.names
    made = Simulations(Simulator((one,), plan.prior, 1), expected=4, executor=1)
    made.add(np.full((2, 2), 0.5))
    assert np.isfinite(made.summaries[:, :3]).all()


def test_a_trace_of_several_stages_may_start_at_any_time():
    """Simulations follow the stages from the first sample on."""
    stages = drive_in_stages((2.0, 1e-7), (0.5, 0.0), (1.5, 2e-7))
    drive = {"run__duration": None, "drive": stages}
    tree = experiment(**drive)
    later = tree.copy()
    later.dataset = tree.to_dataset().assign_coords(time=tree["time"] + 100.0)
    tables = klein_tables(**SMALL | drive)
    tables["fit"] = fit_tables()["fit"]
    plan = Plan.from_dict(tables)
    one = prepare(later, plan)
    force = one.force
    np.testing.assert_array_equal(force, tree["spring_force"].values[0])
    np.testing.assert_allclose(one.summarizer.time, tree["time"], atol=1e-9)
    unit = plan.prior.unit(np.array([18e-6, 1e-3]))
    made = Simulator((one,), plan.prior, 1).forces((3, unit, False), Stop())[0]
    first = np.searchsorted(tree["time"], 0.95 * mesoslip.slips(tree)["start_time"].values[0])
    assert np.max(np.abs(made - force)[:first]) < 6 * NOISE
    # In the hold the force changes by ringing and noise only; before and after, by the drive.
    held = (tree["time"].values > 2.2) & (tree["time"].values < 2.5)
    assert np.ptp(made[held]) < 15 * NOISE
    with pytest.raises(FileError, match=r"has a duration of 5 s, the stages of \[drive\] only 4 s"):
        prepare(experiment(run__duration=5.0), plan)


def test_a_trace_without_noise_is_given_some():
    tables = fit_tables()
    del tables["fit"]["noise"]
    tree = mesoslip.run(klein_tables(**SMALL))
    one = prepare(tree, Plan.from_dict(tables))
    deviation = one.noise.deviation
    assert deviation == pytest.approx(5e-4 * np.max(np.abs(tree["spring_force"].values)))
    added = one.force - tree["spring_force"].values[0]
    assert np.std(added) == pytest.approx(deviation, rel=0.1)


def test_a_free_track_is_another_one_in_each_trace_and_simulation():
    """Spread and length may be free; simulations of one number repeat, all others differ."""
    track = {
        "contacts.track.spread": {"from": 0.05, "to": 0.4, "prior": "logarithmic"},
        "contacts.track.length": {"from": "20 nm", "to": "1 um", "prior": "logarithmic"},
    }
    tables = fit_tables(free=track, wander=True)
    plan = Plan.from_dict(tables)
    assert plan.prior.keys == (*track, "fit.wander")
    one = prepare(experiment(), plan)
    simulator = Simulator((one, one), plan.prior, 3)
    unit, stop = np.array([0.5, 0.5, 0.0]), Stop(None)
    first, again = (simulator.forces((7, unit, False), stop) for _ in range(2))
    other = simulator.forces((8, unit, False), stop)
    assert np.array_equal(first, again)
    # Far beyond noise and wander, of which the least is 0.2 %.
    for changed in (first[1], *other):
        assert np.std(changed - first[0]) > 0.05 * np.max(first[0])
    wrong = fit_tables(free=track | {"contacts.track.length": {"from": "0.1 nm", "to": "1 um"}})
    with pytest.raises(ConfigError, match=r"contacts\.track\.length\.from.*at least"):
        Plan.from_dict(wrong)


def test_without_emcee_it_is_reported_before_anything_is_simulated(monkeypatch):
    monkeypatch.setattr("mesoslip.inference.sampler.find_spec", lambda _: None)
    with pytest.raises(mesoslip.RunError, match="needs the package emcee"):
        mesoslip.fit(experiment(), fit_tables())


def test_predictions_report_their_progress(monkeypatch):
    """A fit goes on after its simulations, with predicted traces; a prediction has only those."""

    def completed(_, __, pieces, **___):
        for piece in pieces:
            future = Future()
            future.set_result([np.zeros(3)])
            yield piece, future

    monkeypatch.setattr(Simulations, "_completed", completed)
    simulator = SimpleNamespace(forces=None, coarse_count=None)
    parts = []
    simulations = Simulations(simulator, expected=4, progress=parts.append)
    assert len(list(simulations.forces(np.zeros((4, 1))))) == 4
    assert parts == [0.25, 0.5, 0.75, 1.0]
