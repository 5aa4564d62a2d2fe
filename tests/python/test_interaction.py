"""Contacts that push their neighbours over, and the slider without inertia."""

import math

import numpy as np
import pytest
from conftest import at_end, drive_in_stages, long
from mesoslip import Config
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import AVALANCHE_COLUMNS
from oracles import assert_same_events, exact_events, quasistatic
from states import reals, saved, taken_up

# Few contacts under a fast drive; the area makes the bonds a few times as stiff as the contacts.
FAST = {
    "drive__velocity": 1e-5,
    "contacts__threshold__relative_width": 0.3,
    "contacts__stiffness": 200.0,
    "run__duration": 0.05,
    "output__interval": 1e-4,
}
QUASISTATIC = {
    "slider": {"kind": "quasistatic", "stiffness": 100.0},
    "contacts__stiffness": 200.0,
    "contacts__threshold__relative_width": 0.3,
    "run__duration": None,
}


def lattice(kind: str, columns: int, rows: int, bonds: float) -> dict:
    """An interaction with bonds, all of a contact together, as stiff as ``bonds`` contacts."""
    count = columns * rows
    stretch, spacing = 18e-6 / 200, math.sqrt(1e-10 / count)
    neighbours = {"triangular": 6, "square": 4}[kind]
    strength = bonds * spacing / (3 * neighbours * stretch)
    return {
        "contacts__count": count,
        "interaction": {"strength": strength, "lattice": kind, "columns": columns, "rows": rows},
    }


def finish(config: Config, segment: int | None = None) -> Realization:
    return at_end(Realization(config, 0), segment)


def column(realization: Realization, name: str) -> np.ndarray:
    return realization.avalanches[:, AVALANCHE_COLUMNS.index(name)]


@pytest.mark.parametrize(
    ("kind", "size", "changes"),
    [
        ("triangular", (2, 2), {}),
        ("triangular", (4, 4), {}),
        ("triangular", (3, 4), {"contacts__coupling": "equal", "contacts__delay": 3e-3}),
        ("square", (4, 4), {}),
        ("square", (2, 2), {"contacts__coupling": "equal"}),
        ("square", (3, 5), {"drive__velocity": -1e-5, "contacts__delay": 2e-3}),
        ("triangular", (4, 4), {"contacts__reattach": False}),
        ("triangular", (4, 4), {"contacts__delay": 0.0}),
    ],
)
@pytest.mark.parametrize("bonds", [0.3, long(3.0)])
def test_events_are_those_of_forces_recomputed_at_every_event(klein, kind, size, changes, bonds):
    config = klein(**FAST | lattice(kind, *size, bonds) | changes)
    oracle = exact_events(config, scan=1e-4)
    expected = [(time, sorted(contacts)) for time, contacts in oracle.avalanches]
    assert len(oracle.events) >= (3 if config.contacts.reattach else 0.5) * config.contacts.count
    assert max(len(contacts) for _, contacts in expected) > 1
    realization = Realization(config, 0)
    renewals = np.zeros(config.contacts.count)
    actual = []
    while not realization.finished:
        realization.advance(1)
        now = realization.contacts["renewals"]
        broken = np.repeat(np.arange(len(now)), (now - renewals).astype(int))
        if broken.size:
            actual.append((realization.time, broken.tolist()))
        renewals = now
    # What follows many breaks is sensitive to rounding; the first dozens must agree.
    first = min(len(expected), 25)
    assert_same_events(actual, expected, first)
    np.testing.assert_array_equal(
        column(realization, "size")[:first], [len(contacts) for _, contacts in expected[:first]]
    )


@pytest.mark.parametrize("back", [long(0.0), 0.2])
@pytest.mark.parametrize(
    "changes",
    [
        {"contacts__count": 40},
        {"contacts__count": 40, "contacts__coupling": "equal", "contacts__delay": 0.1},
        lattice("triangular", 4, 4, 1.0),
        lattice("square", 5, 3, 3.0),
        {"contacts__count": 40, "contacts__reattach": False},
        lattice("triangular", 4, 4, 1.0) | {"contacts__reattach": False},
    ],
)
def test_quasistatic_avalanches_are_those_of_forces_recomputed_at_every_event(klein, changes, back):
    changes = QUASISTATIC | changes | {"contacts__back_force_ratio": back, "run__avalanches": 100}
    config = klein(**changes)
    expected, oracle = quasistatic(config, 100)
    realization = finish(config)
    expected = np.array(expected)
    if config.contacts.reattach:
        assert len(expected) == 100
    else:
        assert sum(expected[:, 2]) == config.contacts.count
        assert realization.ending == "all contacts are broken"
    names = ("time", "displacement", "size", "force_drop", "slip")
    actual = np.stack([column(realization, name) for name in names], axis=1)
    actual[:, 0] *= 1e-7
    assert len(actual) == len(expected)
    assert expected[:, 2].max() > 1
    np.testing.assert_array_equal(actual[:, 2], expected[:, 2])
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-19)
    np.testing.assert_array_equal(realization.contacts["renewals"].sum(), len(oracle.events))
    assert abs(realization.energy_residual) < 1e-13


def test_a_bundle_under_a_force(klein):
    """Force-controlled bursts, contact by contact, up to the failure of the whole."""
    config = klein(
        slider={"kind": "quasistatic"},
        drive={"force_rate": 1e-6},
        run={},
        contacts__count=60,
        contacts__reattach=False,
        contacts__threshold={"law": "uniform", "relative_width": 1 / math.sqrt(3)},
        contacts__back_force_ratio=0.0,
        contacts__coupling="equal",
    )
    expected, _ = quasistatic(config, 1000)
    expected = np.array(expected)
    realization = finish(config)
    assert realization.ending == "all contacts are broken"
    np.testing.assert_array_equal(column(realization, "size"), expected[:, 2])
    np.testing.assert_allclose(1e-6 * column(realization, "time"), expected[:, 0], rtol=1e-10)
    np.testing.assert_allclose(column(realization, "force_before"), expected[:, 0], rtol=1e-10)
    # The strength of the bundle, from its thresholds alone: max of (N - i) k x_i.
    thresholds = np.sort(quasistatic(config, 0)[1].u)
    strength = np.max((60 - np.arange(60)) * thresholds) * 18e-6 / 60
    np.testing.assert_allclose(column(realization, "force_before").max(), strength, rtol=1e-12)


def traces(realization: Realization) -> list[np.ndarray]:
    return [realization.trace, realization.slip_trace, realization.slips, realization.energy]


def test_no_strength_is_no_interaction(klein):
    """To the bit, ringing and reversals included."""
    changes = {"run__duration": 4.0, "output__slip_interval": 1e-4, "contacts__delay": 5e-4}
    places = {"strength": 0.0, "columns": 60, "rows": 68}
    alone, placed = finish(klein(**changes)), finish(klein(**changes, interaction=places))
    for one, other in zip(traces(alone), traces(placed), strict=True):
        np.testing.assert_array_equal(one, other)
    assert placed.avalanche_count == placed.breaks > 10_000
    assert len(alone.avalanches) == 0
    assert column(placed, "area").max() == column(placed, "width").max() == 1


@pytest.mark.parametrize(
    "slider",
    [
        {"slider": {"kind": "prescribed"}, "run__duration": 0.4, "drive__velocity": 1e-6},
        {"slider": {"kind": "quasistatic", "stiffness": 97.0}, "run__avalanches": 20_000},
    ],
    ids=["prescribed", "quasistatic"],
)
@pytest.mark.parametrize("kind", ["triangular", long("square")])
def test_the_lattice_without_a_pull_is_the_queue_to_the_bit(klein, slider, kind):
    """Bonds of 1e-300 of a contact: two orders of breaking, a tree and a queue, agree."""
    changes = slider | {"contacts__threshold__relative_width": 0.2, "run__duration": 0.4}
    if "run__avalanches" in slider:
        changes["run__duration"] = None
    places = {"lattice": kind, "columns": 60, "rows": 68}
    without = finish(klein(**changes, interaction=places | {"strength": 0.0}))
    almost = finish(klein(**changes, interaction=places | {"strength": 1e-300}))
    assert without.breaks > 50_000
    for one, other in zip(traces(without), traces(almost), strict=True):
        np.testing.assert_array_equal(one, other)
    for name in ("time", "displacement", "size", "area", "width", "height", "generations"):
        np.testing.assert_array_equal(column(without, name), column(almost, name))


@pytest.mark.parametrize(
    ("kind", "shift"), [("triangular", (7, 4)), ("square", (5, 3)), ("square", (0, 1))]
)
@pytest.mark.parametrize("slider", ["rigid", "quasistatic"])
def test_a_shifted_lattice_gives_a_shifted_result(klein, kind, shift, slider):
    """The contacts of a run, moved along the lattice before it starts, do the same elsewhere."""
    changes = FAST | lattice(kind, 20, 12, 1.0) | {"contacts__reattach": False}
    if slider == "quasistatic":
        changes |= QUASISTATIC | {"run__avalanches": 1000, "drive__velocity": 1e-5}
        changes["slider"] = {"kind": "quasistatic", "stiffness": 1e4}
    time = 0.02 if slider == "rigid" else 0.0055
    config = klein(**changes, output__snapshots=(time,))

    def moved(values: np.ndarray, right: int, up: int) -> np.ndarray:
        on_lattice = values.reshape(*values.shape[:-1], 12, 20)
        return np.roll(on_lattice, (up, right), axis=(-2, -1)).reshape(values.shape)

    here, start = Realization(config, 0), Realization(config, 0)
    here.advance(1)
    start.advance(1)
    state = saved(start)
    for name in ("record", "surroundings"):
        values = reals(state, name)
        values[:] = moved(values.T, *shift).T
    there = taken_up(config, state, start)
    for one in (here, there):
        at_end(one)
    assert here.breaks == there.breaks > 150
    assert column(here, "size").max() > 3
    for name in AVALANCHE_COLUMNS:
        np.testing.assert_allclose(column(here, name), column(there, name), rtol=1e-9, atol=1e-18)
    stretch = here.snapshots[0, :, 0]
    assert 5 < np.isnan(stretch).sum() < 235
    np.testing.assert_allclose(
        moved(stretch, *shift), there.snapshots[0, :, 0], rtol=1e-9, atol=1e-18
    )
    assert not np.allclose(stretch, there.snapshots[0, :, 0], rtol=1e-9, equal_nan=True)


@pytest.mark.parametrize("slider", ["rigid", "quasistatic", "layered", "prescribed"])
def test_segments_and_snapshots_do_not_change_a_run(klein, slider):
    """A segment may even end within an avalanche; energy is balanced, contacts are conserved."""
    changes: dict = {
        "contacts__stiffness": 200.0,
        "contacts__threshold__relative_width": 0.3,
        "run__duration": 2.0,
        "interaction": {"strength": 0.1, "columns": 60, "rows": 68},
        "contacts__initial": "steady",
        "drive": drive_in_stages((0.15 if slider == "prescribed" else 1, 5e-7), (1, -5e-7)),
    }
    changes["slider"] = {
        "rigid": {"mass": 1.47e-3, "stiffness": 97.0, "damping_ratio": 0.2},
        "layered": {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 3},
        "quasistatic": {"kind": "quasistatic", "stiffness": 97.0},
        "prescribed": {"kind": "prescribed"},
    }[slider]
    if slider == "prescribed":
        changes["run__duration"] = 0.3
    config = klein(**changes)
    times = (0.0, 0.1, 0.2, 0.2000001, config.duration)
    whole = finish(config)
    watched = finish(
        klein(**changes, output__snapshots=times, output__snapshot_size=20), segment=997
    )
    assert whole.breaks > 5000
    for one, other in zip(traces(whole), traces(watched), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(whole.avalanches, watched.avalanches)
    assert column(whole, "size").max() >= 20
    assert abs(whole.energy_residual) < 1e-12

    places, snapshots = watched.snapshot_events, watched.snapshots
    assert tuple(places[places[:, 2] == 0, 0]) == times
    sizes = column(whole, "size")
    np.testing.assert_array_equal(places[places[:, 2] > 0, 2], sizes[sizes >= 20])
    # The force of the contacts at a chosen time, from their stretches alone.
    sampled = np.flatnonzero(whole.trace[:, 0] == 0.1)[0]
    stretch = snapshots[np.flatnonzero(places[:, 0] == 0.1)[0], :, 0]
    if slider != "prescribed":
        assert np.isnan(stretch).sum() == whole.trace[sampled, 6]
    # Broken contacts of an avalanche are those with a generation.
    for place, snapshot in zip(places, snapshots, strict=True):
        generation = snapshot[:, 2]
        if place[2] == 0:
            assert np.all(generation == 0)
            continue
        match = (column(whole, "time") == place[0]) & (sizes == place[2])
        assert np.count_nonzero(generation) in column(whole, "area")[match]
        assert generation.max() == column(whole, "generations")[match][0]
        assert set(np.unique(generation)) - {0} == set(range(1, int(generation.max()) + 1)) or (
            slider == "quasistatic"
        )


def test_the_load_of_a_snapshot_is_the_force_that_breaks(klein):
    """With contacts detached and attached, against the oracle's forces at the oracle's state."""
    changes = FAST | lattice("triangular", 4, 4, 0.3) | {"contacts__delay": 4e-3}
    oracle = exact_events(klein(**changes), scan=1e-4)
    time = 0.5 * (oracle.events[20][0] + oracle.events[21][0])
    changes["run__duration"] = time
    oracle = exact_events(klein(**changes), scan=1e-4)
    config = klein(**changes, output__snapshots=(time,))
    stretch, load, _ = finish(config).snapshots[0].T
    pinned = oracle.pinned
    np.testing.assert_array_equal(np.isnan(stretch), ~pinned)
    assert 0 < np.count_nonzero(pinned) < 16
    x = (stretch + oracle.origin)[pinned]
    np.testing.assert_allclose(x, x[0], rtol=1e-9)
    expected = oracle.breaking_force(x[0]) / (oracle.u * config.contacts.contact_static_force)
    np.testing.assert_allclose(load[pinned], expected[pinned], rtol=1e-7)


def test_segments_have_the_length_that_is_asked_for(klein):
    realization = Realization(klein(**QUASISTATIC, run__avalanches=10**6), 0)
    for segment in range(1, 200):
        realization.advance(100)
        assert realization.advances == 100 * segment


def test_contacts_let_go_at_the_start_are_counted(klein):
    places = {"strength": 0.3, "columns": 60, "rows": 68}
    config = klein(
        contacts__initial="uniform",
        contacts__stiffness=200.0,
        interaction=places,
        run__duration=0.1,
    )
    realization = finish(config)
    assert realization.trace[0, 6] > 1000
    # They attach after the delay, half a sample later.
    assert realization.trace[1, 6] < 100


def test_segments_end_after_many_breaks(klein):
    """However many contacts break in an advance."""
    config = klein(**QUASISTATIC | lattice("triangular", 20, 12, 3.0), run__avalanches=2000)
    realization = Realization(config, 0)
    while not realization.finished:
        breaks = realization.breaks
        realization.advance(work=10.0)
        assert realization.breaks - breaks <= 10 + 3 * 240
    assert realization.breaks > 20 * realization.avalanche_count
