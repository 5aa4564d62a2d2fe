"""A profile of the normal load along an interface: each block has contacts as it is pressed."""

import re

import mesoslip
import numpy as np
import pytest
from conftest import at_end
from kinds import configuration
from mesoslip import Config, ConfigError, Realization
from mesoslip.analysis.fronts import static_balance
from mesoslip.simulation.realization import front_finder
from mesoslip.theory.contacts import contact_theory
from test_interface import BLOCK_MASS, CONTACT_STIFFNESS, OF_BLOCK, TOP, finished, row

RAMP = {"stage": [{"duration": 3.0, "start_normal_force": 2.0, "end_normal_force": 3.0}]}


def records(one):
    """Everything recorded of the blocks."""
    return [one.rows("blocks").read(), one.records("ruptures"), one.energy]


@pytest.mark.parametrize("further", [{}, RAMP])
def test_a_flat_profile_is_none(further):
    tables = row(4, 3.0)
    load = {"normal_force": 2.0, **further}
    plain = records(finished({**tables, "load": load}))
    flat = records(finished({**tables, "load": {**load, "profile": [0.1] * 4}}))
    for mine, theirs in zip(flat, plain, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    if not further:
        for mine, theirs in zip(records(finished(tables)), plain, strict=True):
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_blocks_that_hardly_feel_each_other_are_rigid_sliders_of_their_loads(engine):
    tables = row(2, 7.0, **TOP, bar_stiffness=1e-12, damping=0.4)
    tables["run"]["engine"] = engine
    if engine == "me":
        # Fine steps: those of a row and of a rigid slider are not the same.
        tables["run"]["resolution"] = 0.0625
        tables["contacts"] |= {
            "renewal": "redraw",
            "threshold": {"law": "gaussian", "relative_width": 0.2},
        }
    tables["load"] = {"normal_force": 2.0, "profile": [1.5, 0.5]}
    both = finished(tables)
    forces = both.rows("blocks").read()[:, 4:6]
    rigid = {key: one for key, one in tables.items() if key != "load"}
    rigid["slider"] = {"kind": "rigid", "mass": BLOCK_MASS, "stiffness": 20.0, "damping": 0.4}
    breaks = 0.0
    for block, share in enumerate((1.5, 0.5)):
        force = share * CONTACT_STIFFNESS
        own = {"count": round(share * OF_BLOCK), "static_force": force, "stiffness": force}
        rigid["contacts"] = {**tables["contacts"], **own, "drag": 4.0 * share}
        # The random numbers of block 2 are those of another realization.
        one = Realization(Config.from_dict(rigid))
        one.number = block << 40 if engine == "eq" else 0
        at_end(one)
        breaks += one.breaks
        theirs = one.records("trace")["contact_force"]
        scale = abs(theirs).max()
        assert scale > 0.6 * force
        error = 1e-9 if engine == "eq" else 2e-4
        np.testing.assert_allclose(forces[:, block], theirs, atol=error * scale)
    assert both.breaks == pytest.approx(breaks, rel=1e-3)
    if engine == "eq":
        assert abs(both.energy_residual) < 1e-12


@pytest.fixture(scope="module")
def pressed():
    """A run whose edge bears most, under a load that falls."""
    profile = [1.4, 1.4, 1.0, 0.8, 0.8, 0.6]
    load = {"normal_force": 2.0, "profile": profile}
    load |= {"stage": [{"duration": 0.02, "start_normal_force": 3.0, "end_normal_force": 2.0}]}
    changes = {"slider__blocks": 6, "contacts__count": 60, "load": load}
    return configuration("interface", **changes)


def test_the_output_has_the_load_of_each_block(pressed):
    tree = mesoslip.run(pressed)
    load, trace = tree["blocks"]["block_normal_force"], tree.to_dataset()["normal_force"]
    assert load.dims == ("realization", "time", "block")
    np.testing.assert_allclose(load.sum("block"), trace, rtol=1e-12)
    ratios = np.array([21, 21, 15, 12, 12, 9]) / 90
    np.testing.assert_allclose(load.isel(realization=0, time=0), 3.0 * ratios, rtol=1e-12)
    assert abs(float(tree["energy_residual"][0])) < 1e-12
    # Stress over strength before a front is that of its own blocks.
    finder = front_finder(pressed)
    strength = finder._strength(np.array([1, 6]), np.array([0.0, 1.0]))
    static = pressed.contacts.static_force
    np.testing.assert_allclose(strength, static * ratios[[0, 5]] * [1.5, 1.0])
    constant = pressed.replace({"load.stage": None})
    load = mesoslip.run(constant)["blocks"]["block_normal_force"]
    assert load.dims == ("block",)
    np.testing.assert_allclose(load, 2.0 / 6 * np.array([1.4, 1.4, 1.0, 0.8, 0.8, 0.6]))


def test_a_resumed_run_is_equal_to_the_bit(pressed):
    whole = at_end(Realization(pressed))
    part = Realization(pressed)
    for _ in range(3):
        part.advance(60)
    assert not part.finished
    again = Realization(pressed)
    again.restore(part.save(), {name: part.rows(name) for name in part.counts})
    at_end(again)
    for mine, theirs in zip(records(again), records(whole), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_counts_add_up_and_follow_the_profile(pressed):
    load = pressed.pressing
    counts = load.block_counts(61, 6)
    assert counts.sum() == 61
    assert np.all(abs(counts - 61 * np.array(load.profile) / 6) < 1)
    np.testing.assert_allclose(pressed.block_shares.mean(), 1)
    np.testing.assert_allclose(pressed.block_strengths.sum(), pressed.contacts.static_force)


def test_the_static_balance_has_the_strength_of_each_block():
    profile = {"normal_force": 1.0, "profile": [1.0, 0.5, 1.5]}
    config = configuration("interface", slider__blocks=3, contacts__count=60, load=profile)
    strengths, spring = config.block_strengths, config.slider.neighbour_spring
    pinned = config.contacts.stiffness / 3 * config.block_shares
    # The first block, and the two ahead of it as springs in a row.
    ahead = pinned[0] + 1 / (1 / spring + 1 / (pinned[1] + 1 / (1 / spring + 1 / pinned[2])))
    forces = static_balance(config, 0.4)
    assert forces[0] == pytest.approx(strengths[0] / pinned[0] * ahead)
    assert forces[2] == pytest.approx(0.4 * strengths[:2].sum() + strengths[2])


def test_a_profile_is_read_from_a_file(tmp_path):
    mesoslip.Config.load(_written(tmp_path, "position [mm],normal force [mN]\n1,3\n2,6\n3,3\n"))
    config = mesoslip.Config.load(tmp_path / "run.toml")
    assert config.pressing.profile == (3.0, 6.0, 3.0)
    np.testing.assert_array_equal(config.block_shares, [0.75, 1.5, 0.75])
    for text, message in (
        ("load [N]\n1\n", "the header must name one column normal_force"),
        ("1\n2\n3\n", "the header must name one column normal_force"),
        ("normal_force\n1\nx\n3\n", "line 3: the normal force"),
    ):
        with pytest.raises(ConfigError, match=re.escape(message)):
            mesoslip.Config.load(_written(tmp_path, text))
    with pytest.raises(ConfigError, match=r"load\.profile.*nothing\.csv"):
        mesoslip.Config.load(tmp_path / "run.toml", ["load.profile=nothing.csv"])


def _written(folder, text):
    (folder / "profile.csv").write_text(text)
    row = configuration("interface", slider__blocks=3, contacts__count=60)
    (folder / "run.toml").write_text(
        row.to_toml() + '\n[load]\nnormal_force = "1 N"\nprofile = "profile.csv"\n'
    )
    return folder / "run.toml"


@pytest.mark.parametrize(
    ("kind", "profile", "message"),
    [
        ("interface", [1.0, 1.0, 2.0], "has 3 values, and slider.blocks = 4"),
        ("interface", [1.0, 0.0, 1.0, 1.0], "must be positive; block 2 has 0"),
        ("interface", [1.0, -1.0, 1.0, 1.0], "must be positive; block 2 has -1"),
        ("interface", [1.0, 1.0, 1.0, 1e-3], "leaves block 4 without a contact"),
        ("rigid", [1.0, 1.0], 'load.profile: is for slider.kind = "interface" only'),
    ],
)
def test_what_cannot_be_is_refused_in_words(kind, profile, message):
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        configuration(kind, load={"normal_force": 1.0, "profile": profile})
    assert len(caught.value.problems) == 1


def test_theory_is_for_blocks_that_bear_the_same():
    load = {"normal_force": 1.0, "profile": [1.0, 2.0, 2.0, 1.0]}
    config = configuration("interface", load=load)
    with pytest.raises(ConfigError, match=r"load\.profile"):
        mesoslip.SteadyFront(config)
    above = {"loading": "top", "top_stiffness": 97.0, "stiffness": None}
    top = config.replace({"slider": above, "drive": {"velocity": 1e-5}, "run.duration": 0.1})
    with pytest.raises(ConfigError, match=r"load\.profile"):
        mesoslip.SteadySliding(top)
    assert mesoslip.SteadySliding(top.replace({"load.profile": None})).velocity == 1e-5
    assert "not for load.profile" in contact_theory(top).caveat
