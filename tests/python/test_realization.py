"""One run that goes on as far as one wants."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
from mesoslip import Realization, RunError
from mesoslip.simulation.recorded_tables import COLUMNS

SHORT = {"contacts__count": 200, "run__duration": 2.5, "output__slip_interval": 1e-3}


@pytest.fixture(scope="module")
def whole():
    from conftest import klein_tables
    from mesoslip import Config

    one = Realization(Config.from_dict(klein_tables(**SHORT)))
    while not one.finished:
        one.advance()
    return one


def test_it_comes_to_a_time_and_no_farther_than_the_next_event(klein, whole):
    config = klein(**SHORT)
    with Realization(config) as one:
        for time in (0.0, 0.4, 1.0, 1.9):
            one.advance_to(time)
            assert time <= one.time <= time + 500 * config.output_interval
            assert not one.finished
        one.advance_to(100.0)
        assert one.finished
        assert one.time == config.duration
        for table in ("trace", "slips", "slip_trace", "stages"):
            np.testing.assert_array_equal(one.table(table), whole.table(table))
        assert one.energy_terms == whole.energy_terms
    assert not one.is_open


@pytest.mark.parametrize("name", [name for name, columns in COLUMNS.items() if columns])
def test_tables_have_the_columns_of_the_kernel(whole, name):
    table = whole.table(name)
    assert table.dtype.names == COLUMNS[name]
    rows = whole.rows(name).read()
    for number, column in enumerate(COLUMNS[name]):
        np.testing.assert_array_equal(table[column], rows[:, number])


def test_columns_are_what_their_names_say(whole):
    trace, slips = whole.table("trace"), whole.table("slips")
    assert np.all(np.diff(trace["time"]) > 0)
    spring = whole.config.spring_stiffness * (trace["drive_displacement"] - trace["displacement"])
    np.testing.assert_allclose(trace["spring_force"], spring, rtol=1e-9, atol=1e-18)
    assert len(slips) > 0
    assert np.all(slips["end_time"] > slips["start_time"])
    assert np.all(slips["force_after"] < slips["force_before"])


@pytest.mark.parametrize("name", ["layers", "snapshots", "colours"])
def test_tables_without_named_columns_are_errors(whole, name):
    with pytest.raises(RunError, match="there are 'trace', "):
        whole.table(name)


def test_the_example_of_its_documentation_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    finder = doctest.DocTestFinder(recurse=False)
    (example,) = finder.find(Realization, "Realization")
    assert doctest.DocTestRunner().run(example).failed == 0
