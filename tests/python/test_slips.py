"""The catalogue of slips: what a person would mark in the trace, and nothing else."""

import csv
import json

import mesoslip
import numpy as np
import pytest
from conftest import drive_in_stages, long

STATIC_FORCE = 18e-6
STIFF = {"slider__stiffness": 2000.0, "contacts__delay": 0.0}
# Half a period of the setup.
QUIET = np.pi / np.sqrt(97 / 1.47e-3)
LAYERED = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 16}


def catalogue(tree):
    return mesoslip.slips(tree)


def drop_of_mean(tree, start: float, end: float) -> float:
    """How much the elastic force, averaged over a period of the setup, fell over a slip [N]."""
    time = tree["time"].values
    name = "elastic_force" if "elastic_force" in tree else "spring_force"
    force = tree[name].values[0]
    before = (time > start - 2 * QUIET) & (time < start)
    after = (time > end) & (time < end + 2 * QUIET)
    return force[before].mean() - force[after].mean()


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_a_stiff_spring_slips_once_in_each_life_of_the_contacts(klein, engine):
    """Contacts break together each time that the drive has gone their stretch (1 - f_b) f_s/k."""
    tree = mesoslip.run(klein(run__engine=engine, run__duration=1.0, **STIFF))
    slips = catalogue(tree)
    life = 0.9 * STATIC_FORCE / 2000 / 1e-7
    np.testing.assert_allclose(slips["waiting_time"].values[1:], life, rtol=0.05)
    np.testing.assert_array_equal(slips["waiting_time"][1:], np.diff(slips["start_time"]))
    np.testing.assert_allclose(slips["contacts_broken"], 4080, rtol=0.05)
    assert slips.sizes["slip"] == 11


def test_a_realization_waits_for_no_slip_of_another(klein):
    """The first slip of each has no slip before it."""
    slips = catalogue(mesoslip.run(klein(run__realizations=3, run__duration=0.5, **STIFF)))
    owners, starts = slips["realization_index"].values, slips["start_time"].values
    is_first = np.diff(owners, prepend=-1) != 0
    assert is_first.sum() == 3
    assert np.isnan(slips["waiting_time"].values[is_first]).all()
    expected = np.diff(starts, prepend=np.nan)[~is_first]
    np.testing.assert_array_equal(slips["waiting_time"].values[~is_first], expected)


def test_a_reversed_drive_has_the_same_statistics(klein):
    """Those of the mirrored motion."""
    from mesoslip.analysis.slips import catalogue_of

    changes = {"run__duration": 4.0, "contacts__count": 200}
    trees = [mesoslip.run(klein(drive__velocity=v, **changes)) for v in (1e-7, -1e-7)]
    forth, back = (catalogue_of(one).statistics for one in trees)
    assert forth.keys() == back.keys()
    for name, values in forth.items():
        assert back[name] == pytest.approx(values, rel=1e-9), name


def test_both_engines_have_one_catalogue(klein):
    """As long as their traces agree, of many contacts and of infinitely many."""
    changes = {"run__duration": 0.5, "contacts__count": 100_000, **STIFF}
    finite, infinite = (
        catalogue(mesoslip.run(klein(run__engine=engine, **changes))) for engine in ("eq", "me")
    )
    assert finite.sizes["slip"] == infinite.sizes["slip"] == 4
    np.testing.assert_allclose(finite["start_time"], infinite["start_time"], atol=2e-3)
    np.testing.assert_allclose(
        finite["force_drop"], infinite["force_drop"], atol=0.03 * STATIC_FORCE
    )


@pytest.mark.parametrize("slider", [{}, {"slider": LAYERED}])
def test_a_film_that_breaks_as_a_whole_slips(klein, slider):
    """Its only break is just before the maximum of the force, and none follows in the fall."""
    film = {"contacts__count": 1, "contacts__threshold__relative_width": 1e-6}
    changes = {"contacts__coupling": "equal", "contacts__delay": 20e-3, "output__interval": 1e-4}
    tree = mesoslip.run(klein(run__duration=2.1, **changes, **film, **slider))
    slips = catalogue(tree)
    name = "elastic_force" if "elastic_force" in tree else "spring_force"
    time, force = tree["time"].values, tree[name].values[0]
    assert slips.sizes["slip"] == 1
    assert slips["start_time"].values[0] == pytest.approx(time[force.argmax()], abs=2e-4)
    assert slips["end_time"].values[0] == pytest.approx(time[force.argmin()], abs=2e-4)
    np.testing.assert_allclose(slips["force_drop"], np.ptp(force), rtol=2e-3)
    np.testing.assert_array_equal(slips["contacts_broken"], 1)


@pytest.mark.parametrize(
    "slider",
    [
        long(LAYERED),
        LAYERED | {"layers": 4, "base": {"mass": 0.02, "stiffness": 500.0, "damping": 5.0}},
    ],
    ids=["undamped", "on a soft base"],
)
def test_slips_of_a_block_that_rings_for_ever(klein, slider):
    """Each slip lowers the force for good, and each large and lasting fall is a slip."""
    tree = mesoslip.run(klein(slider=slider, run__duration=6.0, output__interval=1e-4))
    slips = catalogue(tree)
    start, end = slips["start_time"].values, slips["end_time"].values
    assert 5 < len(start) < 40
    assert np.all(slips["contacts_broken"] >= 1)
    assert np.all(slips["force_drop"] > 0)
    assert np.all(end > start)
    assert np.all(start[1:] >= end[:-1])
    # A slip that another follows at once shares its windows with it.
    alone = np.diff(start, append=np.inf) > 6 * QUIET
    alone[1:] &= np.diff(start) > 6 * QUIET
    falls = np.array([drop_of_mean(tree, *times) for times in zip(start, end, strict=True)])
    assert np.all(falls[alone] > 0)
    for centre in np.arange(1.0, 5.9, QUIET):
        if drop_of_mean(tree, centre - QUIET / 2, centre + QUIET / 2) > 0.1 * STATIC_FORCE:
            assert np.any((start < centre + 2 * QUIET) & (end > centre - 2 * QUIET)), centre


def test_force_of_a_slip_is_an_extremum_whatever_the_base_does(klein):
    base = {"mass": 0.005, "stiffness": 1e4, "damping": 10.0}
    tree = mesoslip.run(
        klein(slider=LAYERED | {"base": base}, run__duration=4.0, output__interval=2e-5)
    )
    slips = catalogue(tree)
    time, force = tree["time"].values, tree["elastic_force"].values[0]
    assert slips.sizes["slip"] > 3
    for number in range(slips.sizes["slip"]):
        one = slips.isel(slip=number)
        inside = (time >= one["start_time"].item()) & (time <= one["end_time"].item())
        assert force[inside].max() <= one["force_before"].item() + 1e-12
        assert force[inside].min() >= one["force_after"].item() - 1e-12
        assert force[inside].min() == pytest.approx(one["force_after"].item(), abs=1e-8)


def deep_falls(force, depth: float) -> int:
    """Number of falls deeper than a depth between alternating extremes of a force."""
    count, extreme, falls = 0, force[0], False
    for value in force:
        extreme = min(extreme, value) if falls else max(extreme, value)
        if abs(value - extreme) > depth:
            falls = not falls
            extreme = value
            count += falls
    return count


@pytest.mark.parametrize("velocity", [0.3e-6, 3e-6, 15e-6, 20e-6])
def test_a_fast_drive_leaves_no_deep_fall_out(klein, velocity):
    """The block sticks for less than a period of the setup, which is no ringing all the same."""
    tree = mesoslip.run(
        klein(
            run__duration=max(0.5, 1e-6 / velocity),
            drive__velocity=velocity,
            contacts__delay=1e-3,
            contacts__threshold={"law": "gaussian", "relative_width": 0.05},
            output__interval=1e-4,
        )
    )
    slips, force = catalogue(tree), tree["spring_force"].values[0]
    # A fall at the end of the run is not over.
    assert slips.sizes["slip"] == pytest.approx(deep_falls(force, 0.2 * STATIC_FORCE), abs=1)
    assert np.argmax(slips["force_drop"].values) == 0
    assert slips["force_drop"].values.min() > 0.2 * STATIC_FORCE


@pytest.mark.parametrize(
    ("velocity", "damping_ratio"), [(2e-5, 0.02), (5e-5, 0.2), long(2e-5, 0.2), long(5e-5, 0.02)]
)
def test_ringing_about_fast_smooth_sliding_is_no_slip(klein, velocity, damping_ratio):
    tree = mesoslip.run(
        klein(
            run__duration=0.5,
            drive__velocity=velocity,
            slider__damping_ratio=damping_ratio,
            contacts__count=1000,
            contacts__delay=0.0,
            contacts__initial="steady",
            contacts__threshold={"law": "gaussian", "relative_width": 0.3},
            output__interval=1e-4,
        )
    )
    assert deep_falls(tree["spring_force"].values[0], 0.2 * STATIC_FORCE) > 1
    assert catalogue(tree).sizes["slip"] == 0


def test_steps_of_smooth_sliding_are_no_slips(klein):
    drive = drive_in_stages((0.3, 1e-6), (0.3, 1e-5), (0.3, 2e-5), (0.3, 1e-5))
    tree = mesoslip.run(
        klein(
            run__duration=None,
            drive=drive,
            contacts__delay=0.0,
            contacts__initial="steady",
            contacts__threshold={"law": "gaussian", "relative_width": 0.3},
        )
    )
    # The drive's steps swing the force by far more than a slip velocity.
    assert np.ptp(tree["spring_force"].values[:, 100:]) > 0.3 * STATIC_FORCE
    assert not np.any(catalogue(tree)["start_time"] > 0.1)


@pytest.mark.parametrize("slider", [pytest.param(None, id="rigid"), long(LAYERED)])
def test_no_slip_crosses_a_stage(klein, slider):
    """The first stage ends in the midst of a slip."""
    changes = {} if slider is None else {"slider": slider}
    alone = catalogue(mesoslip.run(klein(drive__velocity=1e-6, run__duration=0.5, **changes)))
    middle = float((alone["start_time"][0] + alone["end_time"][0]) / 2)
    drive = drive_in_stages((middle, 1e-6), (0.5, -1e-6), (0.3, 0.0), (1.0, 2e-6), (1.0, -5e-7))
    tree = mesoslip.run(klein(run__duration=None, drive=drive, **changes))
    slips = catalogue(tree)
    ends = np.cumsum([0, middle, 0.5, 0.3, 1.0, 1.0])
    stage = np.searchsorted(ends, slips["start_time"].values, side="right")
    assert np.all(slips["end_time"].values <= ends[stage])
    assert stage[0] == 1
    sign = np.array([1, -1, -1, 1, -1])[stage - 1]
    assert np.all(sign * slips["force_drop"].values >= 0)
    assert {1, 4, 5} <= set(stage)


def test_finer_traces_begin_with_their_slips(klein):
    """Also where the block still rings from the slip before."""
    tree = mesoslip.run(
        klein(slider=LAYERED, run__duration=4.5, output__slip_interval=1e-4, output__interval=0.1)
    )
    slips, fine = tree["slips"].to_dataset(), tree["slip_traces"].to_dataset()
    number = fine["slip"].values
    assert np.all(np.diff(number) >= 0)
    assert np.all(np.diff(fine["sample_time"].values) > 0)
    first = np.searchsorted(number, np.arange(slips.sizes["slip"]))
    np.testing.assert_array_equal(fine["sample_time"].values[first], slips["start_time"].values)
    assert set(number) == set(range(slips.sizes["slip"]))
    assert slips.sizes["slip"] > 4


def test_times_are_in_the_table(tmp_path, command):
    from conftest import klein_tables
    from mesoslip.output import writing

    output, table = tmp_path / "out.nc", tmp_path / "slips.csv"
    writing.write(mesoslip.run(klein_tables(drive__velocity=1e-6, run__duration=1.0)), output)
    printed = command.output("slips", output, "--csv", table, "--json")
    with table.open() as file:
        rows = list(csv.DictReader(file))
    slips = catalogue(output)
    assert len(rows) > 1
    assert rows[0]["waiting_time [s]"] == ""
    waiting = [float(row["waiting_time [s]"]) for row in rows[1:]]
    np.testing.assert_array_equal(waiting, slips["waiting_time"].values[1:])
    lasting = [float(row["duration [s]"]) for row in rows]
    np.testing.assert_array_equal(lasting, slips["duration"].values)
    assert json.loads(printed)["slips"][0]["waiting_time"] is None


def test_contacts_that_broke_in_a_slip_make_no_other():
    """A bundle breaks as a whole; a reversed drive then swings the free slider back and forth."""
    fast = 1.46e-8
    ends = ((fast, fast), (fast / 10, fast / 10), (-fast, fast), (fast, -fast), (fast, -fast))
    tables = {
        "slider": {"stiffness": 4.93, "mass": 1.69e-3},
        "contacts": {
            "count": 120,
            "static_force": 3.03e-8,
            "stiffness": 5.14,
            "reattach": False,
            "area": 6.25e-14,
            "threshold": {"relative_width": 1.15e-4},
        },
        "run": {},
        "interaction": {"strength": 1.07, "lattice": "triangular", "columns": 12, "rows": 10},
        "drive": {
            "stage": [
                {"duration": duration, "start_velocity": start, "end_velocity": end}
                for duration, (start, end) in zip((0.72, 0.45, 1.28, 0.96, 0.57), ends, strict=True)
            ]
        },
        "output": {"interval": 0.05},
    }
    tree = mesoslip.run(tables)
    assert tree["breaks"].item() == 120
    assert catalogue(tree)["contacts_broken"].values.tolist() == [120]
