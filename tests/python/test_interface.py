"""An interface with a length: exact checks of the model, and a plain code of the same contacts."""

from typing import Any

import numpy as np
import pytest
from conftest import ROOT, at_end, drive_in_stages, long
from mesoslip import Config, Realization
from numpy.typing import NDArray
from plain_interface import PlainInterface
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

# Units: blocks of mass 1 whose contacts have the stiffness 100 and break at a stretch of about 1.
BLOCK_MASS, NEIGHBOUR_SPRING, CONTACT_STIFFNESS = 1.0, 200.0, 100.0
OF_BLOCK = 10


def row(blocks: int, duration: float, **slider: Any) -> dict[str, Any]:
    """Tables of a row of blocks with contacts that keep their thresholds."""
    tables: dict[str, Any] = {
        "run": {"duration": duration, "seed": 5},
        "drive": {"velocity": 2.0},
        "slider": {
            "kind": "interface",
            "blocks": blocks,
            "mass": BLOCK_MASS * blocks,
            "length": float(blocks),
            "bar_stiffness": NEIGHBOUR_SPRING / blocks,
            "loading": "edge",
            "stiffness": 40.0,
            **slider,
        },
        "contacts": {
            "count": OF_BLOCK * blocks,
            "static_force": CONTACT_STIFFNESS * blocks,
            "stiffness": CONTACT_STIFFNESS * blocks,
            "coupling": "equal",
            "delay": 0.3,
            "back_force_ratio": 0.1,
            "renewal": "keep",
            "drag": 4.0 * blocks,
            "threshold": {"law": "uniform", "relative_width": 0.2},
        },
        "output": {"interval": 0.05},
    }
    tables["slider"] = {key: one for key, one in tables["slider"].items() if one is not None}
    return tables


def finished(tables: dict[str, Any]) -> Realization:
    """A realization at its end."""
    return at_end(Realization(Config.from_dict(tables)))


TOP = {"loading": "top", "stiffness": None, "top_stiffness": 40.0}
BOTH = {"loading": "both", "top_stiffness": 25.0, "neighbour_damping": 0.7, "damping": 0.4}


@pytest.mark.parametrize(
    ("blocks", "duration", "slider", "min_breaks"),
    [
        (1, 6.0, {"damping": 0.4}, 30),
        (4, 7.0, {"neighbour_damping": 0.5}, 100),
        (4, 5.0, BOTH, 100),
        long(16, 8.0, {"neighbour_damping": 0.5}, 130),
    ],
)
def test_a_plain_code_with_the_same_contacts_moves_alike(blocks, duration, slider, min_breaks):
    tables = row(blocks, duration, **slider)
    config = Config.from_dict(tables)
    with Realization(config) as start:
        stretches = start.contacts["break_stretch"]
    one = finished(tables)
    own = config.slider
    plain = PlainInterface(
        own.mass,
        own.neighbour_spring,
        own.edge_stiffness,
        own.total_top_stiffness,
        stretches.reshape(blocks, -1) * config.contacts.contact_stiffness,
        config.contacts.contact_stiffness,
        2.0,
        delay=config.contacts.delay,
        back_force_ratio=config.contacts.back_force_ratio,
        drag=config.contacts.contact_drag,
        neighbour_damping=own.neighbour_damping,
        damping=own.damping_rate,
    )
    trace, places = one.records("trace"), one.rows("blocks").read()[:, :blocks]
    for sample, expected in zip(trace, places, strict=True):
        plain.advance(float(sample["time"]), 0.005)
        # The plain code's error, which falls with the fourth power of its step.
        np.testing.assert_allclose(plain.place, expected, atol=2e-5)
    assert plain.breaks == one.breaks > min_breaks
    assert abs(one.energy_residual) < 1e-12


def pinned(blocks: int, duration: float, contact: float, **slider: Any) -> dict[str, Any]:
    """Tables of a row of blocks on contacts of a stiffness that never break."""
    tables = row(blocks, duration, **slider)
    tables["contacts"] |= {"stiffness": contact * blocks, "static_force": 1e6 * blocks}
    return tables


def places_of(one: Realization) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times, and displacements and velocities of blocks, shape (2, times, blocks)."""
    rows, blocks = one.rows("blocks").read(), one.config.slider.block_count
    return one.records("trace")["time"], np.array([rows[:, :blocks], rows[:, blocks : 2 * blocks]])


def test_the_pinned_row_has_the_dispersion_of_a_chain():
    blocks, weak = 8, 1e-5
    tables = pinned(blocks, 20.0, CONTACT_STIFFNESS, stiffness=weak)
    times, (places, _) = places_of(finished(tables))
    middles = np.arange(blocks) + 0.5
    for mode in range(blocks):
        wave = mode * np.pi / blocks
        square = (4 * NEIGHBOUR_SPRING * np.sin(wave / 2) ** 2 + CONTACT_STIFFNESS) / BLOCK_MASS
        shape = np.cos(wave * middles)
        amplitude = places @ shape

        def moved(frequency: float, times: NDArray[np.float64] = times) -> NDArray[np.float64]:
            """The motion under a force that grows with time, up to a factor."""
            found: NDArray[np.float64] = times - np.sin(frequency * times) / frequency
            return found

        def misfit(frequency: float, wanted: NDArray[np.float64] = amplitude) -> float:
            own = moved(frequency)
            return float(np.sum((wanted - own * (own @ wanted) / (own @ own)) ** 2))

        near = np.sqrt(square)
        fit = minimize_scalar(
            misfit, bracket=(0.9999 * near, 1.0001 * near), tol=1e-10, method="brent"
        )
        assert fit.x == pytest.approx(near, rel=1e-6)


@pytest.mark.parametrize("loading", ["edge", "both"])
def test_a_pinned_row_moves_as_its_matrix_exponential(loading):
    blocks, top = 5, 15.0 if loading == "both" else 0.0
    slider = {"neighbour_damping": 0.3, "loading": loading}
    tables = pinned(blocks, 3.0, CONTACT_STIFFNESS, **slider, top_stiffness=top or None)
    tables["output"]["interval"] = 0.5
    times, (places, speeds) = places_of(finished(tables))
    chain = 2 * np.eye(blocks) - np.eye(blocks, k=1) - np.eye(blocks, k=-1)
    chain[0, 0] = chain[-1, -1] = 1.0
    edge = np.zeros(blocks)
    edge[0] = 40.0
    drive = edge + top / blocks
    stiffness = NEIGHBOUR_SPRING * chain + CONTACT_STIFFNESS * np.eye(blocks) + np.diag(drive)
    matrix = np.zeros((2 * blocks + 2, 2 * blocks + 2))
    matrix[:blocks, blocks:-2] = np.eye(blocks)
    matrix[blocks:-2, :blocks] = -stiffness / BLOCK_MASS
    matrix[blocks:-2, blocks:-2] = -0.3 * chain
    matrix[blocks:-2, -2] = drive / BLOCK_MASS
    matrix[-2, -1] = 1.0
    start = np.zeros(2 * blocks + 2)
    start[-1] = 2.0
    for time, place, speed in zip(times, places, speeds, strict=True):
        expected = expm(matrix * time) @ start
        np.testing.assert_allclose(place, expected[:blocks], atol=1e-11)
        np.testing.assert_allclose(speed, expected[blocks:-2], atol=1e-10)


def test_a_static_load_at_the_edge_decays_exponentially():
    blocks, contact = 60, 2.0
    tables = pinned(blocks, 400.0, contact, neighbour_damping=2.0, damping=0.5)
    tables["drive"] = {
        "stage": [{"duration": 1.0, "velocity": 1.0}, {"duration": 399.0, "hold": True}]
    }
    tables["output"]["interval"] = 100.0
    _, (places, _) = places_of(finished(tables))
    places = places[-1]
    # Springs to both sides balance the contacts: k_b (r - 2 + 1/r) = k'.
    half = contact / NEIGHBOUR_SPRING / 2
    ratio = 1 + half - np.sqrt(half * (2 + half))
    from_end = blocks - np.arange(blocks) - 0.5
    expected = ratio ** (-from_end) + ratio**from_end
    np.testing.assert_allclose(places / places[0], expected / expected[0], rtol=1e-6)
    # The discrete row decays as the continuous one for a decay length of many blocks.
    assert -1 / np.log(ratio) == pytest.approx(np.sqrt(NEIGHBOUR_SPRING / contact), rel=1e-3)


def test_a_pulse_runs_at_the_velocity_of_sound():
    blocks = 64
    tables = pinned(blocks, 4.0, 1e-4, stiffness=NEIGHBOUR_SPRING)
    tables["contacts"]["static_force"] = CONTACT_STIFFNESS * blocks
    tables["output"]["interval"] = 0.01
    times, (_, speeds) = places_of(finished(tables))
    sound = np.sqrt(NEIGHBOUR_SPRING / BLOCK_MASS)
    arrivals = [times[np.argmax(speeds[:, block] > 1.0)] for block in (19, 39)]
    assert 20 / np.diff(arrivals)[0] == pytest.approx(sound, rel=0.02)


@pytest.mark.parametrize("loading", ["edge", "both"])
def test_one_block_is_the_rigid_slider(loading):
    tables = row(1, 8.0, bar_stiffness=None, damping=0.4, loading=loading)
    tables["slider"] |= {"stiffness": 15.0, "top_stiffness": 25.0} if loading == "both" else {}
    one = finished(tables)
    tables["slider"] = {"kind": "rigid", "mass": BLOCK_MASS, "stiffness": 40.0, "damping": 0.4}
    rigid = finished(tables)
    assert one.breaks == rigid.breaks > 30
    for name in ("displacement", "spring_force", "contact_force"):
        mine, theirs = one.records("trace")[name], rigid.records("trace")[name]
        np.testing.assert_allclose(mine, theirs, atol=1e-10 * abs(theirs).max())
    np.testing.assert_allclose(one.slips[:, :2], rigid.slips[:, :2], rtol=1e-4)


@pytest.mark.parametrize(
    ("duration", "slider", "residual"), [(8.0, {"damping": 0.4}, 1e-13), (5.0, BOTH, 5e-13)]
)
def test_many_contacts_of_a_block_balance_the_energy(duration, slider, residual):
    """Several break before its neighbours have to know of it: what they do is exact to first order,
    with the force of the neighbours on theirs."""
    tables = row(6, duration, **slider)
    tables["contacts"] |= {"count": 6 * 500, "threshold": {"law": "uniform", "relative_width": 0.1}}
    one = finished(tables)
    assert one.breaks > 2000
    assert abs(one.energy_residual) < residual


def test_a_rupture_is_the_break_of_half_of_the_pinned_contacts():
    """Also if all have broken before the block is fast: the force is that before."""
    tables = row(1, 4.0, bar_stiffness=None)
    tables["contacts"] |= {"delay": 10.0, "drag": 0.0}
    tables["contacts"]["threshold"]["relative_width"] = 0.001
    one = finished(tables)
    (rupture,) = one.records("ruptures")
    assert one.breaks == OF_BLOCK
    assert rupture["breaks"] >= OF_BLOCK - 2
    assert rupture["force_before"] == pytest.approx(CONTACT_STIFFNESS, rel=0.25)
    assert rupture["start_time"] <= rupture["rupture_time"] <= rupture["end_time"]


def test_a_row_at_rest_ruptures_and_balances_the_energy_of_many_equal_steps():
    """A block breaks after a step of 1000 s. Then the row rings in steps of 1 us at a time of which
    that is not a multiple, and moves by ever smaller parts of its displacement."""
    changes = {
        "run.drive_displacement": 2.025e-5,
        "slider.blocks": 10,
        "slider.mass": 0.01,
        "slider.length": 0.1,
        "slider.bar_stiffness": 1e6,
        "slider.stiffness": 4.99e4,
        "slider.top_stiffness": 1e3,
        "slider.damping": 3e3,
        "contacts.count": 10,
        "contacts.static_force": 10.0,
        "contacts.stiffness": 1e10,
        "contacts.drag": 1e4,
    }
    config = Config.load(ROOT / "runs" / "front-types.toml").replace(changes)
    one = Realization(config)
    while not one.finished:
        one.advance()
    assert one.breaks == one.table("ruptures").sizes["rupture"] == 1
    assert abs(one.energy_residual) < 1e-15


def test_a_block_that_slides_without_a_slip_does_not_rupture():
    """Most of its contacts break one by one, long before its only slip."""
    tables = row(1, 6.0, bar_stiffness=None, damping=40.0, **TOP | {"top_stiffness": 1000.0})
    tables["contacts"] |= {"delay": 10.0, "drag": 0.0}
    tables["contacts"]["threshold"]["relative_width"] = 0.5
    del tables["run"]["duration"]
    tables["output"]["slip_velocity"] = 3.0
    tables["drive"] = drive_in_stages((4.2, 0.4), (2.0, 20.0))
    one = finished(tables)
    assert one.breaks == OF_BLOCK
    assert not one.table("ruptures").sizes["rupture"]


def test_a_rupture_is_at_the_break_of_half_of_the_contacts_pinned_before_it():
    """Without attachment, the contacts that are detached count the breaks."""
    tables = row(1, 6.0, bar_stiffness=None, damping=6.0, stiffness=10.0)
    tables["contacts"] |= {"delay": 10.0, "drag": 0.0}
    tables["contacts"]["threshold"]["relative_width"] = 0.5
    tables["output"]["interval"] = 1e-3
    one = finished(tables)
    (rupture,) = one.records("ruptures")
    trace = one.records("trace")
    pinned = rupture["breaks"]
    assert pinned >= OF_BLOCK / 2
    detached = OF_BLOCK - pinned / 2
    first = trace["time"][np.flatnonzero(trace["detached_contacts"] >= detached)[0]]
    assert first - 1e-3 <= rupture["rupture_time"] <= first


@pytest.mark.parametrize("drag", [300.0, 3e4])
def test_blocks_that_detach_into_a_large_drag_move_exactly(drag):
    """The fastest rate grows within a step, far beyond that at its start."""
    tables = row(1, 12.0, bar_stiffness=None, damping=0.2)
    tables["contacts"]["drag"] = drag
    one = finished(tables)
    tables["slider"] = {"kind": "rigid", "mass": BLOCK_MASS, "stiffness": 40.0, "damping": 0.2}
    rigid = finished(tables)
    assert one.breaks == rigid.breaks > 5
    mine, theirs = one.records("trace")["contact_force"], rigid.records("trace")["contact_force"]
    np.testing.assert_allclose(mine, theirs, atol=1e-9 * abs(theirs).max())
    several = row(3, 12.0, damping=0.2)
    several["contacts"]["drag"] = 3 * drag
    for run in (one, finished(several)):
        assert abs(run.energy_residual) < 1e-12


def test_alike_contacts_under_springs_from_above_are_a_rigid_slider():
    tables = row(3, 4.0, **TOP, damping=0.4)
    tables["run"]["engine"] = "me"
    tables["contacts"]["renewal"] = "redraw"
    tables["contacts"]["threshold"] = {"law": "gaussian", "relative_width": 0.2}
    blocks = finished(tables)
    tables["slider"] = {"kind": "rigid", "mass": 3 * BLOCK_MASS, "stiffness": 40.0, "damping": 0.4}
    rigid = finished(tables)
    places = places_of(blocks)[1][0]
    assert np.ptp(places, axis=1).max() < 1e-9
    mine, theirs = blocks.records("trace")["spring_force"], rigid.records("trace")["spring_force"]
    # Each block has steps of its own, to the accuracy of the master equation.
    assert theirs.max() > 100
    np.testing.assert_allclose(mine, theirs, atol=5e-4 * theirs.max())


@pytest.mark.parametrize("damping", [0.42, 0.44667, 0.46])
def test_populations_of_a_block_are_those_of_a_rigid_slider(damping):
    """Also where it turns round: contacts that attached before are stretched against the motion
    before the turn."""
    tables = row(1, 6.0, bar_stiffness=None, damping=damping, **TOP | {"top_stiffness": 20.0})
    tables["run"] |= {"engine": "me", "resolution": 0.0625}
    tables["contacts"] |= {"stiffness": 150.0, "static_force": 150.0, "drag": 6.0}
    tables["contacts"] |= {
        "renewal": "redraw",
        "threshold": {"law": "gaussian", "relative_width": 0.2},
    }
    block = finished(tables)
    tables["slider"] = {"kind": "rigid", "mass": BLOCK_MASS, "stiffness": 20.0, "damping": damping}
    rigid = finished(tables)
    mine, theirs = (one.records("trace")["contact_force"] for one in (block, rigid))
    np.testing.assert_allclose(mine, theirs, atol=3e-4 * theirs.max())
