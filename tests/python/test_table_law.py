"""Threshold laws of a table, such as measured areas of contacts."""

from pathlib import Path

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, long, problem_of
from mesoslip import Config, ConfigError, ThresholdLaw
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.contacts.plain_sliding import SteadySliding
from mesoslip.theory.force_curve import ForceCurve

pytestmark = pytest.mark.usefixtures("no_step_errors")

PLAIN = {
    "contacts__back_force_ratio": 0.0,
    "contacts__delay": 0.0,
    "contacts__drag_rate": 0.0,
    "slider": {"kind": "prescribed"},
}
FEW = {"law": "table", "samples": [0.5, 1.0, 2.0, 2.0, 3.5], "weights": [1, 3, 2, 0.5, 1]}


def quantiles_of_areas(number: int) -> list[float]:
    """Areas in square metres, as many quantiles of an exponential law."""
    return list(-2e-12 * np.log1p(-(np.arange(number) + 0.5) / number))


def exponential(number: int) -> dict[str, object]:
    return {"law": "table", "samples": quantiles_of_areas(number)}


def test_exponential_areas_bear_three_quarters_of_the_static_force(klein):
    """(1/2) Γ(5/2)/Γ(3/2) = 3/4, in theory, in the master equation and one by one."""
    config = klein(contacts__threshold=exponential(2000), **PLAIN)
    static = config.contacts.static_force
    assert mesoslip.derived(config)["F_steady"].value == pytest.approx(0.75 * static, rel=3e-4)
    changes = {"run__duration": None, "run__drive_displacement": 2e-7, "output": {}}
    me = mesoslip.run(
        config.replace(
            {
                "run.engine": "me",
                "run.duration": None,
                "run.drive_displacement": 2e-7,
                "output.interval": None,
            }
        )
    )
    assert float(me["spring_force"].values.ravel()[-1]) == pytest.approx(0.75 * static, rel=3e-4)
    eq = klein(
        contacts__threshold=exponential(2000),
        contacts__initial="steady",
        **PLAIN | changes | {"contacts__count": 20_000},
    )
    force = mesoslip.run(eq)["spring_force"].values
    # Its standard deviation is that of 20000 contacts, over some lives.
    assert force.mean() == pytest.approx(0.75 * static, rel=3e-3)


def test_the_law_is_that_of_its_quantiles():
    ours = ThresholdLaw("table", 1.0, 0.1, tuple(quantiles_of_areas(4000)))
    theirs = ThresholdLaw("exponential", 1.0, 0.1)
    probability = np.array([0.999, 0.9, 0.5, 0.1, 0.01])
    np.testing.assert_allclose(ours.quantile(probability), theirs.quantile(probability), rtol=2e-3)
    threshold = np.array([0.2, 1.0, 3.0])
    np.testing.assert_allclose(ours.survival(threshold), theirs.survival(threshold), rtol=1e-3)
    np.testing.assert_allclose(ours.density(threshold), theirs.density(threshold), rtol=1e-2)
    np.testing.assert_allclose(ours.quantile(ours.survival(threshold)), threshold, rtol=1e-12)


@pytest.mark.parametrize("coupling", ["equal", "scaled"])
def test_theory_agrees_with_that_of_the_exponential_law(klein, coupling):
    """Linear response and force curve, which average over lives in different ways."""
    both = [
        klein(
            contacts__threshold=law,
            contacts__coupling=coupling,
            drive={"velocity": 1e-5},
            curve={"length": 3e-8, "tolerance": 1e-4},
        )
        for law in (exponential(3000), {"law": "exponential", "relative_width": 1.0})
    ]
    ours, theirs = (SteadySliding(one) for one in both)
    assert ours.force == pytest.approx(theirs.force, rel=1e-3)
    rates = np.array([50j, 1e3j, 1e3 + 1e3j])
    scale = np.abs(theirs.response_at(rates))
    assert np.all(np.abs(ours.response_at(rates) - theirs.response_at(rates)) < 3e-3 * scale)
    displacement = np.linspace(0, 3e-8, 200)
    ours, theirs = (ForceCurve(one).force(displacement) for one in both)
    np.testing.assert_allclose(ours, theirs, atol=2e-3 * both[0].contacts.static_force)


def test_theories_of_lives_agree_with_that_of_the_exponential_law(klein):
    """Ageing and activation have a quadrature of their own."""
    ageing = {"law": "log", "time": 1e-3, "growth": 0.05}
    thermal = {"rate": 1e3, "force_ratio": 0.05}
    for key, table in (("contacts__ageing", ageing), ("contacts__thermal", thermal)):
        changes = {"contacts__coupling": "equal", key: table}
        ours, theirs = (
            contact_theory(klein(contacts__threshold=law, **changes)).steady_force(1e-6)
            for law in (exponential(3000), {"law": "exponential", "relative_width": 1.0})
        )
        assert ours == pytest.approx(theirs, rel=2e-3)


def test_engines_agree_for_few_samples(klein):
    """Cells of a few samples, with steps in the density: slip of ten thousand contacts."""
    changes = PLAIN | {
        "contacts__threshold": FEW,
        "contacts__coupling": "equal",
        "run__duration": None,
        "run__drive_displacement": 6e-8,
        "output": {},
    }
    me = mesoslip.run(klein(**changes, run__engine="me"))["spring_force"].values.ravel()
    many = mesoslip.run(klein(**changes | {"contacts__count": 40_000}))["spring_force"].values
    assert np.max(np.abs(me - many.ravel())) < 0.02 * np.max(me)


def test_only_ratios_matter_and_equal_samples_share_a_cell():
    one = ThresholdLaw("table", 1.0, 0.0, (1.0, 2.0, 4.0), (1.0, 2.0, 1.0))
    other = ThresholdLaw("table", 1.0, 0.0, (4e-6, 2e-6, 1e-6, 2e-6))
    probability = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(one.quantile(probability), other.quantile(probability), rtol=1e-12)
    # Mean 1, by the midpoint rule over quantiles that are straight in each of three cells.
    fine = (np.arange(400_000) + 0.5) / 400_000
    assert np.mean(one.quantile(fine)) == pytest.approx(1, abs=1e-6)
    with pytest.raises(mesoslip.MesoslipError, match="samples must"):
        ThresholdLaw("table", 1.0)


def test_more_samples_than_cells(klein):
    config = klein(contacts__threshold=exponential(30_000), **PLAIN)
    force = mesoslip.derived(config)["F_steady"].value
    assert force == pytest.approx(0.75 * config.contacts.static_force, rel=1e-3)


def test_a_file_and_what_an_output_keeps(tmp_path):
    """Outputs have the samples; a change of the file drops them."""
    (tmp_path / "areas.csv").write_text("area [um^2], weight\n1.0, 2\n2.5, 1\n4, 1\n")
    (tmp_path / "other.csv").write_text("threshold\n1\n3\n")
    tables = klein_tables(run__duration=0.1)
    tables["contacts"]["threshold"] = {"law": "table", "file": str(tmp_path / "areas.csv")}
    config = Config.from_dict(tables)
    threshold = config.contacts.threshold
    assert (threshold.samples, threshold.weights) == ((1, 2.5, 4), (2, 1, 1))
    assert Config.from_toml(config.to_toml()) == config
    output = mesoslip.run(config)
    assert "areas.csv" not in output.attrs["configuration"]
    again = config.replace({"contacts.threshold.file": str(tmp_path / "other.csv")})
    assert (again.contacts.threshold.samples, again.contacts.threshold.weights) == ((1, 3), None)
    back = config.replace({"contacts.threshold": {"law": "gaussian", "relative_width": 0.1}})
    assert back.contacts.threshold.samples is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("threshold\n1\n-2\n", "line 3: the threshold must be positive (is -2)"),
        ("area [um^2]\n1\n0\n", "line 3: the area must be positive (is 0)"),
        ("threshold\n", "must have at least two rows of numbers (has 0)"),
        ("threshold\n1\n", "must have at least two rows of numbers (has 1)"),
        ("threshold\n1\n1\n", "at least two different values"),
        ("threshold,weight\n1,0\n2,0\n", "the column weight must not all be 0"),
        ("threshold,weight\n1,1\n2,-1\n", "line 3: the weight must not be negative (is -1)"),
        ("threshold,weight\n1,1\n2,\n", "line 3: the weight is missing"),
        ("size\n1\n2\n", "there is no column threshold or area"),
        ("1\n2\n", "there is no header"),
        ("threshold,area\n1,1\n2,2\n", "remove one of them"),
        ("threshold,threshold\n1,1\n2,2\n", "two columns threshold"),
        ("threshold\n1e308\n1.5e308\n", "must have a finite sum"),
        ("threshold,weight\n1,1e308\n2,1e308\n", "weight must have a finite sum"),
        ("threshold\n1\nx\n", "line 3"),
        ("", "is empty"),
    ],
)
def test_what_is_wrong_with_a_file_is_reported_once(tmp_path, text, words):
    path = tmp_path / "areas.csv"
    path.write_text(text)
    threshold = {"law": "table", "file": str(path)}
    problem = problem_of(klein_tables(contacts__threshold=threshold))
    assert problem.key == "contacts.threshold.file"
    assert words in problem.message


@pytest.mark.parametrize(
    ("threshold", "key", "words"),
    [
        ({"law": "table"}, "file", 'needed for law = "table"'),
        ({"law": "table", "file": "none.csv"}, "file", f"no such file in {Path.cwd()}"),
        ({"law": "table", "file": "a.csv", "samples": [1, 2]}, "file", "give either"),
        ({"law": "table", "samples": [1, 2], "weights": [1]}, "weights", "as many values"),
        ({"law": "table", "samples": [1, -2]}, "samples", "must be positive: a threshold is -2"),
        (FEW | {"relative_width": 0.3}, "relative_width", "leave it out"),
        ({"law": "uniform", "relative_width": 0.1, "samples": [1, 2]}, "samples", 'law = "table"'),
    ],
)
def test_what_is_wrong_with_the_keys(threshold, key, words):
    problem = problem_of(klein_tables(contacts__threshold=threshold))
    assert problem.key == f"contacts.threshold.{key}"
    assert words in problem.message


def two_peaks(number: int, seed: int) -> dict[str, object]:
    """Samples of half N(0.6, 0.05) and half N(1.4, 0.05)."""
    rng = np.random.default_rng(seed)
    peak = np.where(rng.random(number) < 0.5, 0.6, 1.4)
    return {"law": "table", "samples": rng.normal(peak, 0.05).tolist()}


# K* over Nk by cells of the law itself, of 4000 cells of equal width.
@pytest.mark.parametrize(("back", "exact"), [long(0.0, 4.606), (0.2, 4.022)])
def test_the_critical_stiffness_of_samples_is_that_of_their_law(klein, back, exact):
    """The slope of F needs a density, which the gaps between samples do not give: it was 38.9."""
    config = klein(
        contacts__coupling="equal",
        contacts__back_force_ratio=back,
        contacts__threshold=two_peaks(4000, seed=3),
        curve={"length": 3e-8},
    )
    curve = ForceCurve(config)
    unit = config.contacts.stiffness
    error = curve.K_star_error / unit
    assert error < 0.6
    assert abs(curve.K_star[0] / unit - exact) < error
    assert curve.error < 0.03


def test_the_force_of_many_samples_becomes_that_of_steady_sliding(klein):
    """The rough density of 4000 samples was sampled at points, and lost a sixth of the force."""
    config = klein(
        contacts__coupling="equal",
        contacts__back_force_ratio=0.0,
        contacts__threshold=two_peaks(2000, seed=1),
        curve={"length": 3e-7},
    )
    curve = ForceCurve(config)
    assert curve.force(curve.samples[-1]) == pytest.approx(curve.steady_force, rel=5e-3)


@pytest.fixture(scope="module")
def few_samples():
    """The force curve of some samples of two peaks."""
    law = two_peaks(150, seed=2)
    tables = klein_tables(contacts__threshold=law, curve={"length": 1.6e-8})
    return ForceCurve(Config.from_dict(tables))


def test_samples_have_no_derivatives_of_a_density(few_samples):
    summary = few_samples.summary()
    assert summary["X_c"] is not None
    assert summary["D2"] is None
    assert summary["D3"] is None
    with pytest.raises(ConfigError, match="samples do not give"):
        mesoslip.onset(few_samples.config)


def test_a_spring_within_the_error_of_the_critical_stiffness_is_left_open(few_samples):
    near = few_samples.config.replace({"slider.stiffness": 1.01 * few_samples.K_star[0]})
    assert "less than the error of K*" in ForceCurve(near).verdict
    assert "less than the error of K*" not in few_samples.verdict
