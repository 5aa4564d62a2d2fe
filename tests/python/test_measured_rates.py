"""Rates and states of measured traces, against motions of another integrator."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import xarray as xr
from conftest import long
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.law import RateAndState
from mesoslip.analysis.rate_and_state.noise import estimated_noise
from mesoslip.analysis.rate_and_state.points import Loading, Points, points_of_trace
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.rows import _row, fit_rows
from mesoslip.analysis.rate_and_state.search import fit_laws, preferred_law
from mesoslip.analysis.response import dataset
from mesoslip.analysis.response.dataset import rows_of
from mesoslip.analysis.response.tables import tables
from mesoslip.measured.load_point import drive_stages
from mesoslip.measured.output_groups import stage_group
from mesoslip.output import writing
from mesoslip.output.arrays import in_xarray
from mesoslip.plots import measured_response
from oracles import Friction, spring_slider

UM = 1e-6
LAW = Friction(0.6, 3 * UM, 0.01, 0.012, 20 * UM, "slip")
STEP = [Loading(60, 3 * UM, 3 * UM), Loading(60, 10 * UM, 10 * UM)]
STIFFNESS = 1e-3 / UM


def trace(law=LAW, stages=STEP, noise=3e-4, rate=5.0, *, trend=0.0, known=True, seed=0):
    """A measured trace of friction coefficients."""
    duration = sum(one.duration for one in stages)
    # Two sampling rates in one file.
    first = stages[0].duration - 5
    time = np.concatenate([np.arange(0, first, 1 / rate), np.arange(first, duration, 0.2 / rate)])
    force = spring_slider(law, stages, time, STIFFNESS).force
    edges = np.cumsum([0, *(one.duration for one in stages)])
    moved = np.cumsum([0, *(one.duration * one.start_velocity for one in stages)])
    load = np.interp(time, edges, moved)
    rng = np.random.default_rng(seed)
    force = force + trend * load + noise * rng.standard_normal(time.size)
    root = xr.Dataset(
        {
            "friction_coefficient": (("realization", "time"), force[None]),
            "drive_displacement": (("realization", "time"), load[None]),
        },
        {"realization": [0], "time": time},
        {
            "origin": "measured",
            "title": "a step",
            "configuration": f"[slider]\nstiffness = {STIFFNESS}\n" if known else "",
        },
    )
    group = stage_group(drive_stages(time, load))
    return xr.DataTree.from_dict({"/": root, "/stages": group})


def row_of(tree, law, **options):
    (row,) = fit_rows(Experiment(tree), 0, laws=(law,), **options)
    return row


def check(row, law=LAW):
    """Within three errors, which are small."""
    for name, value in (("a", law.a), ("b", law.b), ("slip_distance", law.slip_distance)):
        assert abs(row[name] - value) < 3 * row[f"{name}_error"]
        assert row[f"{name}_error"] < 0.25 * value


@pytest.mark.parametrize(
    ("evolution", "slip_distance"),
    [
        *(("ageing", 1 * UM), ("slip", 60 * UM)),
        *(long("slip", 1 * UM), long("ageing", 60 * UM)),
    ],
)
def test_a_step_is_found_over_decades(evolution, slip_distance):
    """With its law, which the record prefers."""
    law = Friction(0.6, 3 * UM, 0.01, 0.009, slip_distance, evolution)
    laws = ("ageing", "slip") if slip_distance > 10 * UM else (evolution,)
    rows = fit_rows(Experiment(trace(law, trend=1e-6 / UM)), 0, laws=laws)
    row = next(one for one in rows if one["law"] == evolution)
    check(row, law)
    assert row["is_described"]
    if slip_distance > 10 * UM:
        assert row["is_preferred"]
        other = next(one for one in rows if one["law"] != evolution)
        assert other["information_criterion"] > row["information_criterion"] + 10


def test_no_point_reaches_beyond_its_stage():
    """Where the rate of sampling changes within a point, just before a step."""
    time = np.concatenate([np.arange(0, 59.99, 0.1), np.arange(59.95, 120, 0.001)])
    time = np.unique(time)
    points = points_of_trace(STEP, time, 0 * time)
    before = points.time <= STEP[0].duration
    assert (points.time + points.spread)[before].max() <= STEP[0].duration
    assert (points.time - points.spread)[~before].min() > STEP[0].duration


def test_an_unknown_stiffness_is_fitted():
    row = row_of(trace(known=False), "slip")
    check(row)
    assert abs(row["stiffness"] - STIFFNESS) < 3 * row["stiffness_error"]
    assert 0 < row["stiffness_error"] < 0.2 * STIFFNESS


def test_what_does_not_stand_out_gets_no_numbers():
    """Much noise; and a law without evolution."""
    for law, noise in ((LAW, 0.05), (Friction(0.6, 3 * UM, 0.01, 0, 20 * UM, "slip"), 3e-4)):
        row = row_of(trace(law, noise=noise), "slip")
        assert math.isnan(row["a"])
        assert math.isnan(row["slip_distance"])
        assert row["note"].startswith("not determined")
        assert not row["is_described"]


def test_a_constant_force_has_no_evolution():
    tree = trace(noise=0.0)
    tree["friction_coefficient"][:] = 0.6
    (row,) = fit_rows(Experiment(tree), 0)
    assert row["note"] == "the force is constant, so that nothing evolves"
    assert math.isnan(row["a"])


def test_numbers_beyond_the_friction_are_refused():
    """A fit with b of twice the friction, whatever its error."""
    (record,) = records_of(Experiment(trace()))
    fits = fit_laws(record, ["slip"])
    at = fits["slip"].at.copy()
    at[fits["slip"].law.names.index("b")] = -2 * 0.6 / fits["slip"].law.scale
    wrong = replace(fits["slip"], at=at, covariance=1e-6 * fits["slip"].covariance)
    assert fits["slip"].is_determined
    assert not wrong.is_determined
    assert preferred_law({"slip": wrong}) == ""
    row = _row(0, wrong, is_preferred=False)
    assert math.isnan(row["b"])
    assert row["note"] == "not determined: b exceeds the friction itself"


def test_a_stage_of_one_interval_holds_no_step():
    """A false stage in the load point: the record ends before it."""
    experiment = Experiment(trace(rate=10.0))
    first, second = experiment.stages
    experiment.stages = (
        first,
        replace(second, end=100.0),
        replace(second, number=2, start=100.0, end=100.02, start_velocity=1e-2, end_velocity=1e-2),
        replace(second, number=3, start=100.02),
    )
    inside = experiment.samples(experiment.stages[2])
    assert inside.stop - inside.start == 1
    (row,) = fit_rows(experiment, 0, laws=["slip"])
    check(row)
    assert row["note"].endswith("without stage 2 and later ones: it is too short for a step")


def test_a_hold_and_steps_together_and_by_themselves():
    stages = [*STEP, Loading(40, 0, 0), Loading(40, 10 * UM, 10 * UM), Loading(60, UM, UM)]
    tree = trace(stages=stages, noise=1e-4)
    experiment = Experiment(tree)
    assert [one.first_stage for one in records_of(experiment)] == [0, 0, 1, 3]
    rows = fit_rows(experiment, 0, laws=("slip",))
    assert [one["stage_number"] for one in rows] == [-1, 1, 2, 4]
    for row in rows:
        check(row)
    # All of them together determine more.
    assert rows[0]["slip_distance_error"] < min(one["slip_distance_error"] for one in rows[1:])


def test_two_states_are_found_where_there_are_two():
    """The motion of two states is that of one for equal distances."""
    record = records_of(Experiment(trace(noise=1e-5)))[0]
    one = fit_laws(record, laws=("slip",))["slip"]
    both = RateAndState(
        record.points, "slip, two states", STIFFNESS, record.distances, with_trend=True
    )
    known = dict(zip(one.law.names, one.at, strict=True))
    known |= {"b": 0.3 * known["b"], "b2": 0.7 * known["b"]}
    known["slip_distance2"] = known["slip_distance"]
    at = np.array([known[name] for name in both.names])
    np.testing.assert_allclose(both.residuals(at), one.law.residuals(one.at), atol=1e-6)


def test_errors_know_of_correlated_noise():
    """A mean of correlated noise: its error is that of the process."""
    pulls, errors = [], []
    time = np.arange(200.0)
    column = np.ones((200, 1))
    points = Points((), time, 0 * time, time, np.arange(200), column[:, 0], 1.0)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noise, decay = np.zeros(200), math.exp(-1 / 5)
        noise[0] = rng.standard_normal()
        for index in range(1, 200):
            noise[index] = (
                decay * noise[index - 1] + math.sqrt(1 - decay**2) * rng.standard_normal()
            )
        found = estimated_noise(points, noise, column)
        whitened = found.whitened(np.column_stack([column[:, 0], noise]))
        precision = float(whitened[:, 0] @ whitened[:, 0])
        pulls.append(float(whitened[:, 0] @ whitened[:, 1]) / math.sqrt(precision))
        errors.append(1 / math.sqrt(precision))
    assert np.median(errors) == pytest.approx(math.sqrt(2 * 5 / 200), rel=0.25)
    assert 0.6 < np.std(pulls) < 1.5


def test_the_response_of_a_trace_of_coefficients(tmp_path, command, monkeypatch):
    """Names, units and tables; commands on the file."""
    path = tmp_path / "trace.nc"
    writing.write(trace(trend=2e-6 / UM), path)
    monkeypatch.setattr(
        "mesoslip.analysis.rate_and_state.rows.fit_laws",
        lambda record, _: fit_laws(record, ("ageing", "slip")),
    )
    arrays = dataset.response_arrays(path)
    found = in_xarray(arrays)
    rows = rows_of(found, "rate_and_state")
    assert {one["law"] for one in rows} == {"ageing", "slip"}
    assert found["rate_and_state"]["a_coefficient"].attrs["units"] == "1"
    assert found["rate_and_state"]["stiffness"].attrs["units"] == "m-1"
    assert "a" not in found["rate_and_state"].data_vars
    # The trend is removed: a - b of the steady friction is that of the law.
    step = rows_of(found, "steps")[0]
    difference = step["rate_dependence_coefficient"] - (LAW.a - LAW.b)
    assert abs(difference) < 3 * step["rate_dependence_coefficient_error"] + 5e-5
    assert {one.title for one in tables(found)} == {
        "Steady sliding",
        "Velocity steps",
        "Rate and state",
    }
    # Fits take seconds: the commands print those that were made, and one law is drawn.
    monkeypatch.setattr(dataset, "response_arrays", lambda *_, **__: arrays)
    monkeypatch.setattr(measured_response, "fit_laws", partial(fit_laws, laws=("slip",)))
    out = command.output("response", path, "--json")
    slip = next(one for one in json.loads(out)["rate_and_state"] if one["law"] == "slip")
    for name in ("a_coefficient", "b_coefficient", "slip_distance"):
        assert slip[name] > 0
        assert slip[f"{name}_error"] > 0
    assert command("plot", path, "--view", "response", "-o", tmp_path / "a.png")[0] == 0
    assert command("regime", path)[0] == 0
    for option, start in (("--latex", "\\begin{tabular}"), ("--markdown", "| law |")):
        out = command.output("response", path, option)
        assert out.startswith(start)
    # Differences of AIC from the best law, and bounds of small probabilities.
    (table,) = (one for one in tables(found) if one.title == "Rate and state")
    columns = dict(zip(table.head, zip(*table.rows, strict=True), strict=True))
    differences = [float(one) for one in columns["ΔAIC"]]
    assert min(differences) == 0 < max(differences)
    found["rate_and_state"]["fit_p_value"][:] = 6.8e-31
    found["rate_and_state"]["stiffness"][:] = math.inf
    (table,) = (one for one in tables(found) if one.title == "Rate and state")
    assert not any(one.startswith("stiffness") for one in table.head)
    assert {row[table.head.index("p")] for row in table.rows} == {"< 0.001"}


def test_what_has_no_step_says_so():
    tree = trace(stages=[STEP[0], Loading(60, 3 * UM, 3 * UM)])
    assert "no step and no hold" in fit_rows(Experiment(tree), 0)[0]["note"]
