"""One run that goes on as far as one wants."""

import gc
import time
from contextlib import suppress

import numpy as np
import pytest
from conftest import at_end, klein_tables
from kinds import KINDS, configuration
from mesoslip import Config, Realization, RunError
from mesoslip.execution.local import LocalPool
from mesoslip.execution.stop import Stop
from mesoslip.output import layout
from mesoslip.simulation import realization
from mesoslip.simulation import run_realizations as module
from mesoslip.simulation.checkpoint import Checkpoint
from mesoslip.simulation.kernel import TABLE_NAMES
from mesoslip.simulation.kernel_setup import tables_of
from mesoslip.simulation.recorded_tables import COLUMNS, TABLES
from mesoslip.simulation.run_realizations import run_realizations

SHORT = {"contacts__count": 200, "run__duration": 2.5, "output__slip_interval": 1e-3}


@pytest.fixture(scope="module")
def whole():
    return at_end(Realization(Config.from_dict(klein_tables(**SHORT))))


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
            np.testing.assert_array_equal(one.records(table), whole.records(table))
        assert one.energy_terms == whole.energy_terms
    assert not one.is_open


def test_the_first_segment_of_costly_populations_is_short(klein):
    """Ageing and activated, of 60 µs a unit of work: an interrupt waits for the segment."""
    config = klein(
        **{
            "run__engine": "me",
            "contacts__coupling": "equal",
            "contacts__ageing": {"law": "log", "time": 1e-3, "growth": 0.03},
            "contacts__thermal": {"rate": 10.0, "force_ratio": 0.1},
        }
    )
    with Realization(config, estimates_errors=False) as one:
        start = time.process_time()
        one.advance()
        assert time.process_time() - start < 1.0


def test_a_slip_does_not_carry_it_past_a_time(klein):
    # Advances in a slip are a thousand times shorter than those after it.
    config = klein(run__duration=2.0, contacts__delay=2e-3, slider__stiffness=141.0)
    with Realization(config, estimates_errors=False) as one:
        one.advance_to(1.3)
        one.advance_to(1.4)
        assert one.breaks > 0
        assert 1.4 <= one.time < 1.4 + 2 * config.output_interval
        one.advance_to(2.0)
        with pytest.raises(RunError, match="the run is over, so it has no twin"):
            one.twin(1e-12)


@pytest.mark.parametrize("name", [name for name, columns in COLUMNS.items() if columns])
def test_tables_have_the_columns_of_the_kernel(whole, name):
    table = whole.records(name)
    assert table.dtype.names == COLUMNS[name]
    rows = whole.rows(name).read()
    for number, column in enumerate(COLUMNS[name]):
        np.testing.assert_array_equal(table[column], rows[:, number])


def test_columns_are_what_their_names_say(whole):
    trace, slips = whole.records("trace"), whole.records("slips")
    assert np.all(np.diff(trace["time"]) > 0)
    spring = whole.config.spring_stiffness * (trace["drive_displacement"] - trace["displacement"])
    np.testing.assert_allclose(trace["spring_force"], spring, rtol=1e-9, atol=1e-18)
    assert len(slips) > 0
    assert np.all(slips["end_time"] > slips["start_time"])
    assert np.all(slips["force_after"] < slips["force_before"])


@pytest.mark.parametrize("name", [name for name, columns in COLUMNS.items() if columns])
def test_tables_are_datasets_with_units(whole, name):
    table, records = whole.table(name), whole.records(name)
    assert set(table.variables) == set(COLUMNS[name])
    assert len(table.dims) == 1
    for column, variable in table.variables.items():
        assert variable.attrs["long_name"]
        assert variable.attrs["units"], column
        np.testing.assert_array_equal(variable, records[column])
    if name == "trace":
        assert table["spring_force"].attrs["units"] == "N"
        assert float(table["displacement"].sel(time=1.0, method="nearest")) > 0


def test_counts_of_the_master_equation_are_real():
    tables = klein_tables(**SHORT, run__engine="me", contacts__initial="steady")
    with Realization(Config.from_dict(tables), estimates_errors=False) as one:
        one.advance_to(0.5)
        detached = one.table("trace")["detached_contacts"]
    assert detached.dtype == np.float64
    assert np.any(detached % 1 > 0)


@pytest.mark.parametrize("name", ["layers", "snapshots", "colours"])
def test_tables_without_named_columns_are_errors(whole, name):
    with pytest.raises(RunError, match="there are 'trace', "):
        whole.records(name)


@pytest.mark.parametrize("kind", list(KINDS))
def test_tables_that_are_not_drained_stay_empty(kind):
    run = Realization(configuration(kind))
    run.advance(500)
    kernel = run._open()
    drained = kernel.drain(*TABLE_NAMES)
    assert set(drained) == set(TABLE_NAMES) <= set(TABLES)
    for table in set(TABLE_NAMES) - set(tables_of(run.config)):
        assert not len(drained[table]), table


FEW = {"contacts__count": 2, "run__duration": 2e-3, "output__interval": 1e-3}


def test_realizations_that_share_their_setting_are_those_made_alone():
    config = configuration("rigid, three realizations")
    for number, one in enumerate(Realization.all_of(config)):
        alone = Realization(config, number)
        for run in (one, alone):
            run.advance(500)
        np.testing.assert_array_equal(one.trace, alone.trace)
        np.testing.assert_array_equal(one.contacts["origin"], alone.contacts["origin"])


@pytest.mark.parametrize("kind", [one for one in KINDS if " me" not in one])
def test_realizations_run_together_are_those_made_alone(kind):
    """To the bit, unless they are too long for that."""
    config = configuration(kind)
    (together,) = Realization.all_of(config, [1])
    if not Realization.run_together([together]):
        assert not together.advances
        return
    alone = at_end(Realization(config, 1))
    for one in (alone, together):
        one.kernel_seconds = 0.0
    assert together.save() == alone.save()
    for table in TABLES:
        np.testing.assert_array_equal(together.rows(table).read(), alone.rows(table).read(), table)


def test_realizations_run_together_end_with_the_first_that_is_long_or_has_started(monkeypatch):
    config = Config.from_dict(klein_tables(run__realizations=60, **FEW | {"contacts__count": 9}))
    alone = [Realization(config, number) for number in range(60)]
    for one in alone:
        at_end(one)
    work = sorted(one.advances + one.breaks for one in alone)[30]
    monkeypatch.setattr(realization, "SHORT_WORK", work)
    some = Realization.all_of(config)
    some[1].advance(1)
    assert Realization.run_together(some) <= 1
    assert some[1].advances <= 2
    results = run_realizations(config, executor=2)
    assert results.complete
    for one, other in zip(results.realizations, alone, strict=True):
        np.testing.assert_array_equal(one.trace, other.trace)


def test_rows_of_one_realization_keep_no_others_in_memory():
    config = Config.from_dict(klein_tables(run__realizations=20, **FEW | {"contacts__count": 9}))
    some = Realization.all_of(config)
    assert Realization.run_together(some) == 20
    pieces = [piece for one in some for piece in one.rows("trace").pieces]
    assert len(pieces) == 20
    assert all(piece.base is None for piece in pieces)


def test_many_short_realizations_are_set_up_once_and_handed_over_in_batches(monkeypatch):
    submitted, checked = [], []
    submit, check = LocalPool.submit, realization.check_memory
    monkeypatch.setattr(
        LocalPool, "submit", lambda *given: submitted.append(given[2]) or submit(*given)
    )
    monkeypatch.setattr(realization, "check_memory", lambda one: checked.append(one) or check(one))
    monkeypatch.setattr(module, "MANY", 999)
    config, collects = Config.from_dict(klein_tables(run__realizations=1000, **FEW)), []
    results = run_realizations(
        config, executor=2, progress=lambda _: collects.append(gc.isenabled())
    )
    assert results.complete
    assert not any(collects)
    assert gc.isenabled()
    assert len(checked) == 1
    assert sum(map(len, submitted)) == 1000
    assert len(submitted) < 200


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_the_search_for_garbage_goes_on_whatever_ends_a_run(error, monkeypatch):
    def fail(_: float) -> None:
        raise error

    monkeypatch.setattr(module, "MANY", 0)
    config = Config.from_dict(klein_tables(run__realizations=3, **FEW))
    with suppress(error):
        run_realizations(config, executor=1, progress=fail)
    assert gc.isenabled()


def test_an_interrupted_run_counts_its_realizations():
    config = Config.from_dict(klein_tables(run__realizations=300, **FEW))
    stop = Stop()
    results = run_realizations(
        config, executor=1, progress=lambda part: part and stop.set(), stop=stop
    )
    done = sum(one.finished for one in results.realizations)
    assert 0 < done < 300
    assert layout.interruption(results.realizations) == (
        f"interrupted; {done} of 300 realizations are complete, 0 under way"
    )
    for one in results.realizations:
        one.advance(1)
    assert "all others reached" in layout.interruption(results.realizations)


def test_rows_in_memory_are_counted_as_they_come(tmp_path):
    """Not summed up over all realizations each time."""
    config = Config.from_dict(klein_tables(run__realizations=5, **FEW))
    with Checkpoint(tmp_path / "run.checkpoint", config) as checkpoint:
        realizations = Realization.all_of(config)
        for one in realizations[:3]:
            for _ in range(3):
                one.advance(2)
                checkpoint.visit(one)
        expected = sum(rows.waiting_bytes for one in realizations for _, rows in one.waiting)
        assert checkpoint._waiting_bytes == expected > 0
        assert checkpoint.write(realizations)
        assert checkpoint._waiting_bytes == 0
