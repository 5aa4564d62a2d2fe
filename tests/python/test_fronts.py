"""Fronts of an interface with a length: found in made ruptures, and in runs."""

import json
import re
from typing import Any

import mesoslip
import numpy as np
import pytest
from conftest import ROOT
from kinds import configuration
from mesoslip import Config, ConfigError, FileError
from mesoslip.analysis.fronts import (
    EVENTS,
    FRONT_TYPES,
    first_front,
    fronts_of,
    residual_of,
    static_balance,
)
from mesoslip.campaign.measures import MEASURES, RunView
from mesoslip.command_line.main import app
from mesoslip.plots.axis import time_since
from mesoslip.plots.draw import movie_of
from mesoslip.plots.style import canvas
from mesoslip.plots.views.base import Options
from mesoslip.plots.views.fronts import draw_fronts, picture_of
from mesoslip.simulation.fronts import (
    ARRESTS,
    CLOSED_AFTER,
    FRONT_COLUMNS,
    KINDS,
    FrontFinder,
    basins,
    front_speed,
)
from mesoslip.simulation.memory import output_bytes
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCKS, SPACING, BLOCK_TIME, QUIET, STRENGTH = 10, 0.5, 1e-3, 0.1, 2.0


def finder() -> FrontFinder:
    return FrontFinder(
        BLOCKS, SPACING, BLOCK_TIME, QUIET, lambda _, times: np.full(times.shape, STRENGTH)
    )


def ruptures(times: dict[int, float], before: float = 1.5, after: float = 0.5) -> Array:
    """Rows of ruptures, each of which lasts from 0.01 s before its time to 0.02 s after."""
    rows = [
        (block, time - 0.01, time, time + 0.02, before, after, 1e-6, 0.1, 5)
        for block, time in times.items()
    ]
    return np.array(sorted(rows, key=lambda row: row[3]), dtype=float)


def found(rows: Array, **how: Any) -> list[dict[str, float]]:
    """Fronts of ruptures by the names of their columns."""
    fronts = finder().add(rows, **{"is_last": True} | how)
    return [dict(zip(FRONT_COLUMNS, row, strict=True)) for row in fronts.tolist()]


def test_a_front_from_the_edge_is_one_arm_with_its_speed():
    (one,) = found(ruptures({block: 1 + 0.01 * block for block in range(1, 7)}))
    assert one["speed"] == pytest.approx(SPACING / 0.01)
    assert (one["start_position"], one["end_position"], one["length"]) == (0.0, 3.0, 3.0)
    assert (one["start_time"], one["end_time"]) == (1.01, 1.06)
    assert one["force_drop"] == pytest.approx(6.0)
    assert one["stress_ratio_before"] == pytest.approx(1.5 / STRENGTH)
    assert KINDS[int(one["kind"])] == "precursor"
    assert ARRESTS[int(one["arrest"])] == "arrested"


def test_a_nucleation_inside_sends_two_fronts_whose_lengths_add_up():
    left, right = found(ruptures({block: 1 + 0.01 * abs(block - 4) for block in range(1, 11)}))
    assert left["speed"] == pytest.approx(-50)
    assert right["speed"] == pytest.approx(50)
    assert left["start_position"] == right["start_position"] == pytest.approx(3.5 * SPACING)
    assert left["length"] + right["length"] == pytest.approx(BLOCKS * SPACING)
    assert {KINDS[int(one["kind"])] for one in (left, right)} == {"whole"}
    assert {ARRESTS[int(one["arrest"])] for one in (left, right)} == {"at_an_end"}


def test_fronts_that_meet_share_no_block():
    times = {block: 1 + 0.01 * min(block - 1, 10 - block) for block in range(1, 11)}
    first, second = found(ruptures(times))
    assert {ARRESTS[int(one["arrest"])] for one in (first, second)} == {"met_another"}
    assert first["length"] + second["length"] == pytest.approx(BLOCKS * SPACING)
    assert first["end_position"] == second["end_position"]


def test_a_block_that_breaks_early_by_less_than_sound_needs_is_no_nucleation():
    times = {block: 1 + 0.01 * block for block in range(1, 11)}
    (one,) = found(ruptures(times | {6: times[5] - 0.9 * BLOCK_TIME}))
    assert one["speed"] == pytest.approx(50, rel=0.05)
    assert len(found(ruptures(times | {6: times[5] - 5 * BLOCK_TIME}))) == 2


def test_slips_apart_by_the_quiet_time_or_a_block_are_other_events():
    rows = ruptures({1: 1.0, 3: 1.05, 6: 1.05, 7: 1.06, 10: 2.0})
    assert [one["event"] for one in found(rows)] == [0, 1, 2]
    later = ruptures({1: 1.0, 2: 1.0 + 0.03 + 1.01 * QUIET})
    assert [one["event"] for one in found(later)] == [0, 1]
    within = ruptures({1: 1.0, 2: 1.0 + 0.03 + 0.99 * QUIET})
    assert [one["event"] for one in found(within)] == [0]


def test_a_rupture_that_comes_late_joins_events():
    rows = np.vstack([ruptures({1: 1.0, 4: 1.0}), ruptures({2: 1.02})])
    (first, *others) = found(rows)
    assert {one["event"] for one in (first, *others)} == {0.0}


def test_a_second_passage_over_blocks_has_fronts_of_its_own():
    rows = np.vstack(
        [
            ruptures({block: 1 + 0.01 * block for block in range(1, 11)}),
            ruptures({block: 1.3 - 0.01 * block for block in range(5, 11)}),
        ]
    )
    first, second = found(rows)
    assert (first["passage"], second["passage"]) == (0, 1)
    assert second["speed"] == pytest.approx(-50)
    assert second["length"] == pytest.approx(6 * SPACING)


def test_blocks_that_break_at_once_are_a_front_without_a_speed():
    (one,) = found(ruptures(dict.fromkeys(range(1, 11), 1.0)))
    assert np.isnan(one["speed"])
    assert one["length"] == pytest.approx(BLOCKS * SPACING)


@pytest.mark.parametrize("seed", range(5))
def test_basins_cover_a_row_once_and_start_at_its_minima(seed):
    times = np.random.default_rng(seed).random(60)
    parts = basins(times, 0.0)
    assert [one.first for one in parts] == [0, *(one.last + 1 for one in parts[:-1])]
    assert parts[-1].last == times.size - 1
    padded = np.concatenate([[np.inf], times, [np.inf]])
    minima = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] < padded[2:]))
    assert [one.nucleus for one in parts] == minima.tolist()
    assert len(basins(times, 2.0)) == 1


@pytest.mark.parametrize(("right", "last"), [(2.0, 2), (0.6, 1)])
def test_the_last_block_between_two_fronts_belongs_to_the_one_that_came_first(right, last):
    left, other = basins(np.array([0.0, 1.0, 3.0, right, 0.5]), 0.1)
    assert (left.nucleus, left.last, other.first, other.nucleus) == (0, last, last + 1, 4)


def test_the_speed_is_that_of_most_blocks():
    positions = np.arange(20) * SPACING
    times = positions / 30
    times[[3, 11]] += 0.3
    assert front_speed(times, positions) == pytest.approx(30, rel=1e-9)


def test_fronts_do_not_depend_on_segments_or_a_resume():
    rng = np.random.default_rng(3)
    rows = np.vstack(
        [
            ruptures({block: start + 0.02 * rng.random() for block in range(1, 11)})
            for start in (1.0, 30.0, 60.0)
        ]
    )
    whole = finder().add(rows, is_last=True)
    one, parts = finder(), []
    for row in rows:
        parts.append(one.add(row[None]))
        saved = json.loads(json.dumps(one.save()))
        one = finder()
        one.restore(saved)
    parts.append(one.add(rows[:0], is_last=True))
    np.testing.assert_array_equal(np.vstack(parts), whole)
    # Ruptures of events that are over are forgotten.
    assert sum(map(len, parts[:-1])) > 0
    assert 29 > CLOSED_AFTER * QUIET


ROW = {"slider__blocks": 6, "contacts__count": 60}


@pytest.fixture(scope="module")
def tree():
    return mesoslip.run(configuration("interface", **ROW, run__realizations=2))


def test_blocks_add_up_to_the_trace(tree):
    root, blocks = tree.to_dataset(), tree["blocks"]
    assert blocks["block_displacement"].dims == ("realization", "time", "block")
    scale = float(abs(root["contact_force"]).max())
    np.testing.assert_allclose(
        blocks["block_contact_force"].sum("block"), root["contact_force"], atol=1e-9 * scale
    )
    np.testing.assert_array_equal(
        blocks["block_detached_contacts"].sum("block"), root["detached_contacts"]
    )
    for name in ("displacement", "velocity"):
        np.testing.assert_allclose(
            blocks[f"block_{name}"].mean("block"),
            root[name],
            atol=1e-9 * float(abs(root[name]).max()),
        )
    np.testing.assert_allclose(blocks["position"], (np.arange(6) + 0.5) * 1e-2 / 6)


def test_catalogues_of_an_output_belong_together(tree):
    ruptures, fronts = tree["ruptures"].to_dataset(), tree["fronts"].to_dataset()
    assert ruptures.sizes["rupture"] > 10
    assert set(ruptures["block_number"].values.tolist()) <= set(range(1, 7))
    is_within = (ruptures["start_time"] <= ruptures["rupture_time"]) & (
        ruptures["rupture_time"] <= ruptures["end_time"]
    )
    assert is_within.all()
    # Every rupture is in one front, which may pass a block that broke in part.
    lengths = float(fronts["length"].sum()) / (1e-2 / 6)
    assert ruptures.sizes["rupture"] <= lengths * (1 + 1e-9)
    assert lengths < 1.3 * ruptures.sizes["rupture"]
    assert fronts["kind"].attrs["flag_meanings"] == "precursor whole"
    assert fronts["kind"].attrs["flag_values"].tolist() == [0, 1]


def test_the_function_and_its_tables_agree(tree, tmp_path):
    found = fronts_of(tree)
    assert set(found.events) == set(EVENTS)
    result = mesoslip.fronts(tree)
    assert result["fronts"].sizes["front"] == found.fronts["event"].size
    assert result.attrs["sound_velocity"] == pytest.approx(1e-2 * np.sqrt(2000 / 1.47e-3))
    own = found.events["realization_index"] == 1
    assert found.events["event"][own].tolist() == list(range(int(own.sum())))
    blocks = found.events["block_count"]
    assert np.all((found.events["kind"] == 1) <= (blocks == 6))
    assert 0 < np.sum(found.events["kind"] == 1) < blocks.size
    mesoslip.write_table(result, tmp_path / "fronts.csv")
    head, *rows = (tmp_path / "fronts.csv").read_text().splitlines()
    assert head.startswith("realization_index [1],event [1],start_time [s]")
    assert len(rows) == found.fronts["event"].size + 2 + found.events["event"].size
    answer = json.loads(json.dumps(found.to_json()))
    assert sum(one["events"] for one in answer["statistics"].values()) == len(answer["events"])


def test_types_of_fronts_are_those_of_their_speeds(tree):
    columns = fronts_of(tree).fronts
    names = np.array(FRONT_TYPES)[columns["front_type"]]
    arrested = columns["arrest"] == ARRESTS.index("arrested")
    np.testing.assert_array_equal(names == "arrested", arrested)
    known = np.isfinite(columns["speed_ratio"])
    np.testing.assert_array_equal(names == "unresolved", ~known & ~arrested)
    for name, low, high in (("slow", 0, 0.1), ("subsonic", 0.1, 1), ("supersonic", 1, np.inf)):
        ratio = columns["speed_ratio"][names == name]
        assert np.all((ratio >= low) & (ratio < high))
    # A sweep takes the longest front of the first event.
    front = first_front(tree)
    assert front["event"] == 0
    assert front["length"] == columns["length"][columns["event"] == 0].max()
    view = RunView(tree, 0.0)
    assert MEASURES["front_type"].function(view) == front["front_type"]
    np.testing.assert_array_equal(
        MEASURES["front_speed_ratio"].function(view), front["speed_ratio"]
    )


@pytest.mark.parametrize("view", ["fronts", "precursors", "front-speeds", "interface-stress"])
def test_views_of_an_interface_are_drawn(tree, view):
    figure = mesoslip.plot(tree, view=view, realization=1)
    (axes, *_) = figure.axes
    low, high = axes.get_ylim()
    drawn = [
        (line, line.get_ydata())
        for line in axes.lines
        if line.get_label()[0] != "_" and len(line.get_ydata())
    ]
    assert drawn
    for line, values in drawn:
        inside = np.mean((np.asarray(values) >= low) & (np.asarray(values) <= high))
        assert inside > 0.5, line.get_label()


@pytest.mark.parametrize(("limit", "is_labelled"), [(0, True), (-1, False)])
def test_fronts_without_a_speed_do_not_count_towards_the_limit_of_labels(
    tree, monkeypatch, limit, is_labelled
):
    picture = picture_of(tree, Options())
    fronts = picture.found.fronts
    fronts["speed_ratio"][0] = np.nan
    low, high = picture.window
    known = np.isfinite(fronts["speed_ratio"])
    known &= (fronts["end_time"] >= low) & (fronts["start_time"] <= high)
    assert 0 < known.sum() < known.size
    monkeypatch.setattr("mesoslip.plots.views.fronts.MAX_SPEEDS", known.sum() + limit)
    figure = canvas(None, (6.5, 5.6))
    draw_fronts(figure.subplots(), tree, picture, time_since(picture.window))
    labels = [one.get_text() for one in figure.axes[0].texts if one.get_text().endswith(" c")]
    assert len(labels) == (known.sum() if is_labelled else 0)


def test_the_window_of_an_event_starts_with_its_first_slip(tree):
    """A tenth of it at most is before the first rupture."""
    picture = picture_of(tree, Options())
    times, (low, high) = picture.ruptures["rupture_time"], picture.window
    first = times[(times >= low) & (times <= high)].min()
    assert (first - low) < 0.1 * (high - low)


def test_the_precursors_drawn_are_the_events(tree):
    figure = mesoslip.plot(tree, view="precursors")
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    events = fronts_of(tree).events
    for label, kind in (("precursors", 0), ("whole events", 1)):
        assert len(lines[label].get_xdata()) == int(np.sum(events["kind"] == kind))


def test_a_movie_shows_an_event(tree):
    movie = movie_of(tree, "fronts", Options())
    assert movie.count > 5
    shown = []
    for number in (0, movie.count - 1):
        movie.show(number)
        shown.append(np.array(movie.figure.axes[0].lines[0].get_ydata()))
    assert np.any(shown[0] != shown[1])


def test_the_command_prints_all_tables(tree, tmp_path, capsys):
    tree.to_netcdf(tmp_path / "row.nc")
    for arguments, text in (
        ((), "Medians of first passages"),
        (("--latex",), r"\toprule"),
        (("--json",), '"stress_ratio_before_75"'),
    ):
        app(["fronts", str(tmp_path / "row.nc"), *arguments], standalone_mode=False)
        assert text in capsys.readouterr().out


@pytest.mark.long
def test_precursors_of_20_seeds_grow_along_the_static_balance():
    """Their number, lengths and forces, and those of the first whole event, are those of the page:
    inertia carries precursors beyond the balance."""
    run = Config.load(ROOT / "runs" / "precursors.toml")
    changes = {"run.realizations": 20, "run.drive_displacement": 5.5e-4, "contacts.count": 640}
    tree = mesoslip.run(run.replace(changes))
    balance = static_balance(run, residual_of(tree))
    assert balance is not None
    top = int(balance.argmax())
    measured = []
    for _, own in mesoslip.fronts(tree)["events"].to_dataset().groupby("realization_index"):
        force, blocks, kind = (own[name].values for name in ("spring_force", "block_count", "kind"))
        whole = int(np.argmax(kind))
        assert kind[whole] == 1, "no whole event"
        longest = np.maximum.accumulate(np.append(2, blocks[:whole]))
        longer = np.flatnonzero(blocks[:whole] > longest[:-1])
        steps = np.arange(top + 1)
        beyond = blocks[longer] - np.interp(force[longer], balance[: top + 1], steps)
        measured.append((force[0], force[whole], whole, longer.size, beyond.mean()))
    means, spreads = np.mean(measured, axis=0), np.std(measured, axis=0, ddof=1)
    # Motion is chaotic: other digits are other seeds, and a spread has an error of a sixth.
    expected = np.array([3.24, 13.68, 18.4, 4.8, 2.8]), np.array([0.049, 0.52, 4.2, 1.0, 0.78])
    assert np.all(np.abs(means - expected[0]) < 4 * spreads / np.sqrt(20)), means
    assert np.all(np.abs(np.log(spreads / expected[1])) < 4 / 6), spreads
    assert 0 < means[1] - balance[top] < 2 * spreads[1]
    # Behind them the stress is lower than where they start.
    ruptures = tree["ruptures"]
    assert float(ruptures["force_after"].mean()) < 0.8 * float(ruptures["force_before"].mean())


def test_other_outputs_have_no_fronts():
    with pytest.raises(FileError, match=r'slider.kind = "interface"'):
        mesoslip.fronts(mesoslip.run(configuration("prescribed")))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"stiffness": None},
            'slider.stiffness: missing: loading = "edge" has springs at the first',
        ),
        (
            {"loading": "both"},
            'slider.top_stiffness: missing: loading = "both" has springs from above',
        ),
        ({"top_stiffness": 9.0}, 'slider.top_stiffness = 9.0: is not for loading = "edge"'),
        ({"bar_stiffness": None}, "slider.bar_stiffness: missing: it joins the blocks"),
        ({"blocks": 7}, "contacts.count = 48: must be a multiple of slider.blocks = 7, such as 49"),
        ({"damping": 1.0}, "give either damping or damping_ratio"),
    ],
)
def test_what_cannot_be_is_refused_in_words(changes, message):
    slider = configuration("interface").to_dict()["slider"] | changes
    slider = {key: value for key, value in slider.items() if value is not None}
    with pytest.raises(ConfigError, match=re.escape(message)):
        configuration("interface", slider=slider)


def test_a_lattice_and_snapshots_are_refused():
    with pytest.raises(ConfigError, match="interaction: is not for an interface"):
        configuration("interface", interaction={"strength": 0.3, "columns": 8, "rows": 6})
    with pytest.raises(ConfigError, match=r"output\.snapshots"):
        configuration("interface", output__snapshots=[0.01])


def test_a_single_block_needs_no_bar():
    slider = configuration("interface").to_dict()["slider"] | {"blocks": 1}
    del slider["bar_stiffness"]
    config = configuration("interface", slider=slider)
    assert config.slider.kernel_parameters(config)["neighbour_spring"] == 0
    rigid = configuration("rigid")
    assert config.slider.slip_velocity(config) == rigid.slider.slip_velocity(rigid)


def test_notes_say_what_may_not_be_meant():
    text = " ".join(configuration("interface", output__interval=1e-3).notes)
    assert "sound crosses the interface" in text
    undamped = {"slider__damping_ratio": 0.0, "slider__neighbour_damping": 0.0}
    assert "rings" in " ".join(configuration("interface", **undamped).notes) or "ring without" in (
        " ".join(configuration("interface", **undamped).notes)
    )
    stiff = configuration("interface", slider__neighbour_damping=1e7)
    assert "overdamped" in " ".join(stiff.notes)
    assert not configuration("rigid").notes


def test_the_expected_size_has_the_blocks():
    row, rigid = configuration("interface"), configuration("rigid")
    samples = row.expected_duration / row.output_interval + 1
    sizes = [output_bytes(one, has_finer=False) for one in (row, rigid)]
    assert sizes[0] - sizes[1] == pytest.approx(8 * 4 * 4 * samples)


def test_theory_of_a_rigid_slider_holds_for_springs_from_above():
    rigid = configuration("rigid")
    tables = rigid.to_dict()
    tables["slider"] = {
        **{key: tables["slider"][key] for key in ("mass", "damping_ratio")},
        **{"kind": "interface", "blocks": 4, "length": 1e-2, "bar_stiffness": 2000.0},
        **{"loading": "top", "top_stiffness": tables["slider"]["stiffness"]},
    }
    tables["drive"] = {"velocity": 1e-5}
    tables["run"]["duration"] = 0.1
    row = Config.from_dict(tables)
    alike = Config.from_dict(tables | {"slider": rigid.to_dict()["slider"]})
    mine, theirs = mesoslip.SteadySliding(row), mesoslip.SteadySliding(alike)
    assert mine.leading_root == theirs.leading_root
    assert mesoslip.derived(row)["omega_s"].value == mesoslip.derived(alike)["omega_s"].value
    edge = row.replace(
        {"slider.loading": "edge", "slider.stiffness": 97.0, "slider.top_stiffness": None}
    )
    with pytest.raises(ConfigError, match=r"slider\.loading"):
        mesoslip.SteadySliding(edge)
    for command in (mesoslip.onset, mesoslip.cycle):
        with pytest.raises(ConfigError, match=r"slider\.kind"):
            command(row)


def test_derived_quantities_are_those_of_the_chain():
    config = configuration("interface")
    values = {name: one.value for name, one in mesoslip.derived(config).items()}
    contacts, slider = config.contacts, config.slider
    assert values["sound_velocity"] == pytest.approx(values["block_spacing"] / values["block_time"])
    assert values["decay_length"] == pytest.approx(
        slider.length * np.sqrt(slider.bar_stiffness / contacts.stiffness)
    )
    chain = np.diag(np.full(4, values["neighbour_spring"] * 2.0 + contacts.stiffness / 4))
    chain -= values["neighbour_spring"] * (np.eye(4, k=1) + np.eye(4, k=-1))
    chain[0, 0] -= values["neighbour_spring"]
    chain[3, 3] -= values["neighbour_spring"]
    frequencies = np.sqrt(np.linalg.eigvalsh(chain) / values["block_mass"])
    assert frequencies[0] == pytest.approx(values["omega_l"])
    assert frequencies[-1] < values["pinned_frequency_highest"]


def test_the_static_balance_is_that_of_a_pinned_row():
    slider = configuration("interface").to_dict()["slider"] | {"blocks": 12}
    config = configuration("interface", slider=slider)
    forces = static_balance(config, 0.4)
    spring, contact = config.slider.neighbour_spring, config.contacts.stiffness / 12
    for ruptured in (0, 5, 11):
        ahead = 12 - ruptured
        chain = 2 * np.eye(ahead) - np.eye(ahead, k=1) - np.eye(ahead, k=-1)
        chain[0, 0] -= 1
        chain[-1, -1] -= 1 if ahead > 1 else 0
        load = np.zeros(ahead)
        load[0] = 1.0
        places = np.linalg.solve(spring * chain * (ahead > 1) + contact * np.eye(ahead), load)
        # The first pinned block bears its static force.
        tension = config.contacts.static_force / 12 / (contact * places[0])
        behind = 0.4 * ruptured * config.contacts.static_force / 12
        assert forces[ruptured] == pytest.approx(behind + tension, rel=1e-9)
    above = slider | {"loading": "top", "top_stiffness": 9.0}
    del above["stiffness"]
    assert static_balance(configuration("interface", slider=above), 0.4) is None
