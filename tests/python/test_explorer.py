"""The explorer without a page: what was changed, runs that are shown, numbers to draw."""

import asyncio
import functools
import gc
import json
import re
import shlex
import threading
import time
import tomllib
import zlib
from base64 import urlsafe_b64encode
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import parse_qsl

import mesoslip
import numpy as np
import pytest
from conftest import ROOT, klein_tables, long, python
from jinja2 import Environment
from kinds import DIFFERENT, KINDS, configuration
from mesoslip import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.errors import ConfigError, FileError, MesoslipError
from mesoslip.examples import example_config
from mesoslip.execution.newest_job import NewestJob
from mesoslip.execution.stop import Stop
from mesoslip.explorer.controls import BY_KEY, CONTROLS, ROW_HEIGHTS, STEPS, lattice_size, values
from mesoslip.explorer.knobs import Knob
from mesoslip.explorer.links import Setting, link_of, presets
from mesoslip.explorer.live_run import Pace, explored, run_live, runnable
from mesoslip.explorer.movies import (
    around_slip,
    finished_run,
    movie_of,
    recorded_for_movie,
)
from mesoslip.explorer.pictures import (
    NOTHING,
    Axis,
    Line,
    Measured,
    Theories,
    curve_alone,
    motion,
    with_steady_sliding,
)
from mesoslip.explorer.session import Session
from mesoslip.explorer.stages import read_stages
from mesoslip.output.tree import build_tree
from mesoslip.plots.close_up import largest_slip, slip_window
from mesoslip.plots.movie import chosen_frames
from mesoslip.quantities import scale_for, with_unit
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import Results, run_realizations

KLEIN = str(ROOT / "runs" / "klein.toml")
RANGES = [one for one in CONTROLS if not one.choices and not one.is_text]
# Starts with keys that no choice brings.
THERMAL = ("contacts.coupling=equal", "contacts.thermal.rate=1e4 1/s")
AT_300_K = ("contacts.thermal.temperature=300 K", "contacts.thermal.activation_length=0.3 nm")
INTERFACE = (
    "slider.kind=interface",
    "slider.blocks=8",
    "slider.length=10 cm",
    "slider.bar_stiffness=2000 N/m",
)
STARTS = {
    "contacts.thermal.rate": (*THERMAL, "contacts.thermal.force_ratio=0.04"),
    "contacts.thermal.force_ratio": (*THERMAL, "contacts.thermal.force_ratio=0.04"),
    "contacts.thermal.temperature": (*THERMAL, *AT_300_K),
    "contacts.thermal.activation_length": (*THERMAL, *AT_300_K),
    "slider.layer_damping": ("slider.kind=layered", "slider.layers=4"),
    "contacts.drag": ("contacts.drag_rate=0", "contacts.drag=0.01 N s/m"),
    "slider.loading": INTERFACE,
    "slider.top_stiffness": (*INTERFACE, "slider.loading=both", "slider.top_stiffness=1 kN/m"),
    "run.drive_displacement": ("run.duration=none", "run.drive_displacement=0.4 um"),
    "drive.cycle.frequency": (
        "drive.velocity=none",
        "drive.cycle={amplitude = '0.4 um', frequency = '0.1 1/s', cycles = 2}",
    ),
    "slider.damping": ("slider.damping_ratio=none", "slider.damping=20 1/s"),
}


def link_file(text):
    """A file in a link."""
    return urlsafe_b64encode(zlib.compress(text)).decode().rstrip("=")


def drawn_of(config, measured=None):
    """What is drawn at the end of a live run."""
    seen = []
    run_live(config, Stop(), lambda results: seen.append(motion(results, measured)))
    return seen[-1]


def theory(config):
    return with_steady_sliding(config, curve_alone(config))


@pytest.fixture
def session():
    return Session(Config.load(KLEIN), KLEIN)


@pytest.mark.parametrize("control", CONTROLS, ids=lambda control: control.key)
def test_controls_are_keys_of_the_configuration(control):
    if control.is_switch:
        assert key_kind(f"{control.key}.{control.choices[1]}") is not None
        return
    kind = key_kind(control.key)
    assert kind is not None
    is_number = kind.unit is not None or kind.is_whole
    assert [bool(control.choices), control.is_text, is_number].count(True) == 1
    assert control.is_text == (not kind.is_single)


@pytest.mark.parametrize("control", RANGES, ids=str)
@pytest.mark.parametrize("start", [None, 0.0, 3.0])
def test_each_position_of_a_slider_has_a_value(control, start):
    """From end to end values grow, and lie at the positions that they are shown at."""
    scale = control.scale(start)
    found = [scale.value(position) for position in range(STEPS + 1)]
    assert np.all(np.diff(found) >= 0)
    assert scale.low == pytest.approx(found[0], abs=0.5 * control.is_whole)
    assert scale.high == pytest.approx(found[-1], abs=0.5 * control.is_whole)
    for position in (0, 17, STEPS):
        again = scale.value(scale.position(scale.value(position)))
        assert again == pytest.approx(scale.value(position), rel=1e-9)
    if start:
        assert scale.low <= start <= scale.high


def alone(test):
    """A test in a process of its own, where no other one has left memory or objects."""
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import test_explorer; "
        f"test_explorer.{test.__name__}.__wrapped__()"
    )

    @functools.wraps(test)
    def run_alone():
        python(code)

    return run_alone


def brought_by(key):
    """The control, and its choice, with which another one comes."""
    return next(
        (control.key, choice)
        for control in CONTROLS
        for choice, keys in control.required.items()
        if key in keys
    )


@pytest.mark.parametrize("control", CONTROLS, ids=lambda control: control.key)
def test_each_control_changes_the_configuration_as_the_command_line_does(control):
    start = STARTS.get(control.key, ())
    session = Session(Config.load(KLEIN, start), KLEIN)
    before = session.text(control.key)
    if control.is_text:
        text = "2 s at 0.1 um/s; hold 1 s"
    elif control.choices:
        text = next(one for one in control.choices[::-1] if one != before)
    else:
        text = control.text(control.scale(session.values.get(control.key)).value(0.7 * STEPS))
    if control.key not in session.shown:
        assert session.change(*brought_by(control.key))
    assert session.change(control.key, text), session.problems
    assert session.is_changed(control.key)
    words = shlex.split(session.command)
    assert words[:3] == ["mesoslip", "run", KLEIN]
    assert words[3::2] == ["--set"] * len(words[4::2])
    assert Config.load(KLEIN, (*start, *words[4::2])) == session.config
    assert Config.from_toml(session.config.to_toml()) == session.config


def test_a_value_as_at_the_start_is_no_change(session):
    assert session.change("contacts.delay", "1 ms")
    assert session.is_changed("contacts.delay")
    assert session.change("contacts.delay", "500us")
    assert session.changes == {}
    assert session.config == session.start


def test_a_refused_change_is_reported_at_its_control_and_taken_back(session):
    assert session.change("slider.stiffness", "90 N/m")
    good, command = session.config, session.command
    assert not session.change("contacts.delay", "1 kg")
    assert "“1 kg” refused" in session.problems["contacts.delay"]
    assert "expected a quantity" in session.problems["contacts.delay"]
    assert session.text("contacts.delay") == "500 µs"
    assert session.config is good
    assert session.command == command
    assert session.is_runnable
    assert session.change("slider.stiffness", "100 N/m")
    assert session.problems == {}
    assert session.config.slider.spring_stiffness == 100.0


@pytest.mark.parametrize("control", CONTROLS, ids=lambda control: control.key)
def test_what_a_control_refuses_leaves_everything_as_it_was(control):
    """Whatever keys a change would have brought, or dropped."""
    session = Session(Config.load(KLEIN, STARTS.get(control.key, ())), KLEIN)
    assert session.change("contacts.delay", "0.4 ms")
    if control.key not in session.shown:
        assert session.change(*brought_by(control.key))
    before = (session.config, dict(session.changes), dict(session.values), session.command)
    assert not session.change(control.key, "nonsense")
    assert session.problems[control.key]
    assert (session.config, session.changes, session.values, session.command) == before


def test_a_change_whose_run_fails_is_taken_back(session):
    assert session.change("contacts.delay", "0.4 ms")
    command, config = session.command, session.config
    assert session.change("slider.kind", "layered")
    assert session.take_back("the solver failed")
    assert session.problems == {"slider.kind": "the solver failed"}
    assert session.command == command
    assert session.config == config
    # There is nothing more to take back, nor a step of it in the history.
    assert not session.take_back("again")
    assert not session.can_redo
    assert session.undo()
    assert session.changes == {}


def test_a_combination_is_reported_at_the_control_that_brought_it_about(session):
    assert session.change("interaction.lattice", "triangular")
    assert not session.change("run.engine", "me")
    assert "no neighbours" in session.problems["run.engine"]
    assert session.text("run.engine") == "eq"
    assert not session.change("interaction.rows", "7")
    assert "even" in session.problems["interaction.rows"]


def test_a_problem_of_a_key_without_a_control_is_reported_at_the_one_that_was_changed(session):
    """A duration below the interval of the trace, which has no control."""
    assert not session.change("run.duration", "0.1 ms")
    assert session.problems["run.duration"].startswith("“0.1 ms” refused: output.interval")


@pytest.mark.parametrize("text", ["", "'", "1\nx = 2", "[1]", "{}", "nan", "1e999", "\x00", "∞"])
@pytest.mark.parametrize("key", ["contacts.delay", "contacts.count", "slider.kind"])
def test_nonsense_is_reported(session, key, text):
    before = session.text(key)
    assert not session.change(key, text)
    assert session.problems[key]
    assert session.text(key) == before


@pytest.mark.parametrize("lattice", ["triangular", "square"])
@pytest.mark.parametrize("count", [2, 7, 10, 48, 997, 1000, 4080, 4093, 100_000, 1_000_003])
def test_a_lattice_keeps_n_or_says_what_it_makes_of_it(lattice, count):
    columns, rows = lattice_size(count, lattice)
    assert min(columns, rows) >= 2
    assert lattice == "square" or rows % 2 == 0
    if count >= 48:
        # A lattice of the model, not a chain; N within a per cent.
        assert 0.45 < columns / (rows * ROW_HEIGHTS[lattice]) < 2.3
        assert abs(columns * rows - count) < 0.01 * count + 1
    if count in {48, 1000, 4080, 100_000}:
        assert columns * rows == count
    session = Session(Config.load(KLEIN, [f"contacts.count={count}"]), KLEIN)
    assert session.change("interaction.lattice", lattice)
    assert session.config.contacts.count == columns * rows
    note = session.notes["interaction.lattice"]
    assert note.startswith(f"{columns} columns × {rows} rows")
    assert ("N is kept" in note) == (columns * rows == count)
    assert str(columns * rows) in note or "kept" in note


def test_damping_is_as_the_file_gives_it():
    rate = ["slider.damping_ratio=none", "slider.damping=20 1/s"]
    for start, shown in (([], "slider.damping_ratio"), (rate, "slider.damping")):
        session = Session(Config.load(KLEIN, start), KLEIN)
        assert [one for one in session.shown if one.startswith("slider.damping")] == [shown]
    session = Session(Config.load(KLEIN, rate[:1]), KLEIN)
    assert session.text("slider.damping_ratio") == "0"
    assert session.change("slider.damping_ratio", "0.1")
    assert session.config.slider.damping_ratio == 0.1


STAGES = "2 s at 100 nm/s; hold 1 s; 200 nm at 1 µm/s; 1 s from 1 µm/s to -2 µm/s"


def test_a_drive_has_stages_and_one_velocity_again(session):
    assert session.change("drive.stage", STAGES)
    assert "drive.velocity" not in session.shown
    assert session.text("drive.stage") == STAGES
    parts = session.config.drive.parts
    assert [one.duration for one in parts] == pytest.approx([2, 1, 0.2, 1])
    assert [one.start_velocity for one in parts] == pytest.approx([1e-7, 0, 1e-6, 1e-6])
    assert parts[-1].end_velocity == pytest.approx(-2e-6)
    assert not session.change("drive.stage", "2 s at 1 kg")
    assert not session.change("drive.stage", "quickly")
    assert "stages are such as" in session.problems["drive.stage"]
    assert session.text("drive.stage") == STAGES
    assert session.change("drive.stage", "")
    assert session.changes == {}
    assert session.config == session.start


def test_stages_of_a_file_are_written_as_they_are_read():
    for name in ("steady-force", "velocity-step", "slide-hold-slide"):
        start = Config.load(ROOT / "runs" / f"{name}.toml")
        session = Session(start, "file.toml")
        words = session.text("drive.stage")
        assert words.count(";") == len(start.drive.stage) - 1
        tables = tomllib.loads(f"stage = {read_stages(words)}")["stage"]
        again = start.replace({"drive.stage": tables}).drive.parts
        for ours, theirs in zip(again, start.drive.parts, strict=True):
            assert ours == pytest.approx(theirs, rel=1e-5)


def test_a_lattice_counts_its_contacts_and_goes_again(session):
    assert session.change("interaction.lattice", "square")
    assert "contacts.count" not in session.shown
    assert session.change("interaction.columns", "10")
    assert session.change("interaction.rows", "7")
    assert session.config.contacts.count == 70
    assert session.change("interaction.lattice", "none")
    assert session.changes == {}
    assert session.config == session.start


def test_the_drive_goes_back_and_forth_and_one_way_again(session):
    """With strokes in which contacts break; so does a start that has them."""
    assert session.change("drive.stage", STAGES)
    assert session.change("drive.cycle", "amplitude")
    cycle = session.config.drive.cycle
    assert cycle.velocity == 1e-7
    loading = 18e-6 / 97 + session.config.contacts.break_stretch
    assert cycle.amplitude == pytest.approx(2 * loading, rel=0.05)
    assert {"drive.velocity", "drive.stage"}.isdisjoint(session.shown)
    assert session.change("drive.cycle.cycles", "1")
    assert session.change("drive.cycle", "none")
    assert session.changes == {}
    there = Session(Config.load(KLEIN, STARTS["drive.cycle.frequency"]), KLEIN)
    assert there.change("drive.cycle", "none")
    assert there.config.drive.velocity == pytest.approx(4 * 0.4e-6 * 0.1)
    assert there.change("drive.cycle", "amplitude")
    assert there.changes == {}


def test_an_interface_is_pulled_at_its_edge_and_from_above(session):
    assert session.change("slider.kind", "interface")
    before = dict(session.changes)
    for loading, edge, top in (("both", 97, 97), ("top", None, 97), ("both", 97, 97)):
        assert session.change("slider.loading", loading), session.problems
        slider = session.config.slider
        assert (slider.stiffness, slider.top_stiffness) == (edge, top)
    assert session.change("slider.loading", "edge")
    assert session.changes == before | {"slider.loading": "edge"}
    assert session.change("slider.blocks", "21")
    assert session.config.contacts.count == 4074
    assert session.notes["slider.blocks"] == "N is 4074, a multiple of the blocks"
    assert not session.change("contacts.count", "4080")
    assert session.change("slider.blocks", "20")
    assert session.change("contacts.count", "4080")
    assert session.change("slider.kind", "rigid")
    assert session.changes == {}
    both = Session(example_config("fronts"), "fronts.toml")
    assert both.change("slider.loading", "edge")
    assert both.config.slider.top_stiffness is None
    assert both.change("slider.loading", "both")
    assert both.changes == {}


def test_an_interface_is_drawn_in_space_and_time():
    """Ruptures are where and when blocks break, and the stress falls there."""
    config = example_config("interface-me").replace({"run.drive_displacement": "0.02 mm"})
    whole = drawn_of(runnable(config))
    drawn = whole.interface
    assert drawn.stress.shape[0] == config.slider.blocks
    # The first block is pulled, and bears more than the last one; none more than its strength.
    assert drawn.stress[0].max() > 2 * drawn.stress[-1].max()
    assert drawn.stress.max() < 1.2
    assert drawn.duration == pytest.approx(whole.end)
    assert drawn.length == pytest.approx(25)
    assert drawn.ruptures.y_label == "position (mm)"


def test_contacts_begin_to_age_and_cease_to(session):
    """With what a law needs, and without what another one needed."""
    assert session.change("contacts.ageing.law", "log")
    assert session.config.contacts.coupling == "equal"
    assert session.change("contacts.ageing.growth", "0.1")
    assert session.change("contacts.ageing.time", "3 ms")
    assert session.change("contacts.ageing.law", "relax")
    assert "contacts.ageing.growth" not in session.shown
    assert session.config.contacts.ageing.time == pytest.approx(3e-3)
    assert session.change("contacts.ageing.law", "none")
    assert session.changes == {}
    assert session.config == session.start


def test_temperature_is_switched_on_and_off(session):
    """By a force or a temperature of the same size; a file that has it can be without."""
    for choice in ("force_ratio", "temperature"):
        assert session.change("contacts.thermal", choice)
        contacts = session.config.contacts
        assert contacts.thermal.ratio(contacts.contact_static_force) == pytest.approx(0.04, rel=0.1)
        assert session.is_changed("contacts.thermal")
        assert session.text("contacts.thermal") == choice
    assert "contacts.thermal.force_ratio" not in session.shown
    assert session.change("contacts.thermal.temperature", "200 K")
    # Ageing needs the same coupling, and keeps it.
    assert session.change("contacts.ageing.law", "log")
    assert session.change("contacts.thermal", "none")
    assert session.config.contacts.coupling == "equal"
    assert session.change("contacts.ageing.law", "none")
    assert session.changes == {}
    assert session.config == session.start

    warm = Session(Config.load(KLEIN, STARTS["contacts.thermal.rate"]), KLEIN)
    assert warm.text("contacts.thermal") == "force_ratio"
    assert warm.change("contacts.thermal", "none")
    assert warm.config.contacts.thermal is None
    assert "contacts.thermal=none" in warm.command
    assert warm.change("contacts.thermal", "temperature")
    assert warm.config.contacts.thermal.temperature == 300
    assert warm.change("contacts.thermal", "force_ratio")
    assert warm.changes == {}


def test_what_the_kernel_refuses_is_reported_too(session):
    """Such as a law of which no threshold is above the back force."""
    for key, text in (
        ("contacts.ageing.law", "relax"),
        ("contacts.ageing.young_relative_width", "0.01"),
        ("contacts.back_force_ratio", "0.9"),
    ):
        session.change(key, text)
    assert list(session.problems) == ["contacts.back_force_ratio"]
    assert session.text("contacts.back_force_ratio") == "0.1"
    assert session.change("contacts.back_force_ratio", "0.1")


def test_a_kind_takes_the_keys_with_it_that_only_it_has(session):
    assert session.change("slider.damping_ratio", "0.5")
    assert session.change("slider.kind", "layered")
    assert "slider.damping_ratio" not in session.shown
    assert session.config.slider.layer_count == 8
    assert session.change("slider.layers", "3")
    assert session.change("slider.kind", "rigid")
    assert "slider.layers" not in session.shown
    assert session.config == session.start


def test_a_page_of_many_changes_can_be_taken_back(session):
    session.change("slider.kind", "quasistatic")
    session.change("contacts.delay", "what?")
    assert session.reset()
    assert session.config == session.start
    assert session.problems == {}


def test_a_run_is_shown_soon_and_at_its_end():
    config = explored(Config.load(KLEIN))
    parts, times, start = [], [], time.thread_time()

    def show(results):
        times.append(time.thread_time() - start)
        parts.append(motion(results).part_done)

    run_live(config, Stop(), show)
    assert parts[-1] == 1.0
    assert parts == sorted(parts)
    # Of computing time, as others may use the machine as well.
    assert times[0] < 0.5


def test_what_is_explored_moves_as_what_is_run():
    """Samples and snapshots do not change the motion."""
    config = Config.load(KLEIN, ["run.duration=3 s"])
    seen = []
    run_live(explored(config), Stop(), seen.append)
    (mine,), (theirs,) = seen[-1].realizations, run_realizations(config).realizations
    assert mine.breaks == theirs.breaks
    assert mine.slips == pytest.approx(theirs.slips)


@pytest.mark.parametrize("kind", [kind if kind in DIFFERENT else long(kind) for kind in KINDS])
def test_every_kind_of_run_is_drawn(kind):
    config = configuration(kind)
    drawn = drawn_of(explored(config))
    # Contacts without a delay are never detached.
    detached = () if drawn.detached.is_empty else (drawn.detached,)
    for line in (drawn.force, drawn.velocity, *detached):
        assert len(line.x) == len(line.y) > 1
        assert np.all(np.isfinite(line.y))
        assert line.x_label.startswith("time")
        assert line.description
    assert (drawn.lattice is not None) == (config.interaction is not None)
    assert drawn.regime


def test_pictures_are_as_long_as_a_picture_is_wide():
    config = explored(Config.load(KLEIN))
    drawn = drawn_of(config)
    assert len(drawn.force.x) < 4000
    assert drawn.detached.y.max() == config.contacts.count
    # The first spike of Klein's case: 18 uN less the spread of the thresholds.
    assert 17.0 < np.max(drawn.force.y) < 18.0
    assert drawn.force.y_label == "spring force (µN)"
    assert "ms" in drawn.slip_force.x_label
    # In the slip all contacts let go, and the force falls to zero.
    assert np.min(np.abs(drawn.slip_contact_force.y)) < 0.1


def test_strokes_are_loops_whose_area_is_the_work_of_the_drive():
    """Whole cycles of a prescribed slider; one direction has no loop."""
    config = example_config("pre-sliding")
    seen = []
    run_live(explored(config), Stop(), lambda results: seen.append((results, motion(results))))
    results, drawn = seen[-1]
    assert (drawn.loop.x_label, drawn.loop.y_label) == ("displacement (nm)", "driving force (µN)")
    assert drawn.loop.x.max() == pytest.approx(2.7, rel=1e-3)
    area = np.trapezoid(drawn.loop.y, drawn.loop.x) * 1e-15
    (realization,) = results.realizations
    tree = build_tree(results)
    work = float(np.trapezoid(tree["spring_force"].values[0], tree["drive_displacement"].values[0]))
    assert realization.finished
    assert area == pytest.approx(work, rel=0.01)
    assert drawn.loop.description.startswith("driving force from -")


def test_stages_that_end_before_the_run_are_reported():
    with page_of() as (page, _):
        ask(page, "set", "drive.stage", "2 s at 0.1 um/s; hold 1 s")
        assert page.elements["notes"]["text"].startswith("the stages end after 3 s")
        ask(page, "undo")
        assert page.elements["notes"]["text"] == ""


def test_a_slider_that_moves_with_the_drive_is_not_said_to_slip_or_to_slide_smoothly():
    """The beginning of a run is not judged but by its slips."""

    def drawn_with(*changes):
        return drawn_of(explored(Config.load(KLEIN, changes)))

    drawn = drawn_with("slider.kind=prescribed", "run.duration=2 s")
    assert drawn.regime.startswith("the slider moves with the drive: force amplitude 3")
    assert drawn.is_judged
    assert drawn.velocity.is_empty
    assert drawn.slip_force.is_empty
    assert drawn.force.up.quantity == "driving force"
    ramp = ["slider.kind=force", "drive.velocity=none", "drive.force_rate=1 uN/s"]
    drawn = drawn_with(*ramp, "run.duration=1 s")
    assert drawn.regime == "in its last stage the slider does not slide up to 1 µN"
    assert drawn.is_judged
    assert "longer" not in drawn_with("slider.kind=prescribed", "run.duration=0.1 s").regime
    drawn = drawn_with("run.duration=1 s")
    assert "longer duration" in drawn.regime
    assert not drawn.is_judged
    realization = Realization(explored(Config.load(KLEIN)), 0)
    realization.advance(work=5_000)
    drawn = motion(Results(realization.config, [realization], False, 1.0))
    realization.close()
    assert (drawn.regime, drawn.is_judged) == ("", False)


def test_curves_of_other_units_lie_on_the_axes_of_the_run():
    """Forces in the largest unit, times in that of the run; also where the run has no curve."""
    Plot = pytest.importorskip("mesoslip.explorer.figures").Plot  # noqa: N806
    from mesoslip.explorer.elements import Elements

    elements = Elements(lambda *_: None)
    plot = Plot(elements, "force", "", {"this run": "black", "pinned": "red"})
    along, slow = Axis("time", scale_for(1.0, "s")), Axis("time", scale_for(1e-3, "s"))
    weak, strong = (Axis("force", scale_for(size, "N")) for size in (1e-6, 1.0))
    mine = Line(np.array([0.0, 2.0]), np.array([0.0, 3.0]), along, weak)
    other = Line(np.array([0.0, 500.0]), np.array([0.0, 4.0]), slow, strong)
    plot.show("", {"this run": mine, "pinned": other}, along)
    assert list(plot.sources["pinned"].data["x"]) == [0, 0.5]
    assert list(plot.sources["pinned"].data["y"]) == [0, 4]
    assert list(plot.sources["this run"].data["y"]) == pytest.approx([0, 3e-6])
    assert plot.figure.yaxis[0].axis_label == "force (N)"
    plot.show("", {"this run": NOTHING, "pinned": other}, along)
    assert list(plot.sources["pinned"].data["x"]) == [0, 0.5]
    assert len(plot.sources["this run"].data["x"]) == 0
    assert not elements["panel:force"]["hidden"]
    plot.show("", {"this run": NOTHING}, along)
    assert elements["panel:force"]["hidden"]


def test_the_line_of_the_spring_touches_the_curve():
    shown = theory(Config.load(KLEIN))
    x, y = shown.critical
    assert np.interp(x, shown.curve.x, shown.curve.y) == pytest.approx(y, rel=1e-6)
    assert np.interp(x, shown.spring.x, shown.spring.y) == pytest.approx(y, rel=1e-6)
    # In µN and nm, so that the slope is in 1000 N/m.
    slope = np.diff(shown.spring.y) / np.diff(shown.spring.x)
    assert slope == pytest.approx(-0.097)
    assert "K < K*" in shown.summary


def test_what_has_no_curve_says_so():
    ageing = {"law": "log", "time": "1 ms", "growth": 0.02}
    tables = klein_tables(contacts__coupling="equal", contacts__ageing=ageing)
    shown = theory(Config.from_dict(tables))
    assert shown.curve.is_empty
    assert "age" in shown.summary


def test_a_lattice_is_shown_in_motion():
    config = Config.load(ROOT / "runs" / "source" / "S25d.toml", ["run.duration=2 s"])
    lattice = drawn_of(explored(config)).lattice
    assert lattice.loads.shape[1:] == (68, 60)
    assert len(lattice.times) == len(lattice.loads) > 50
    # Loads grow until the avalanche through the whole system, and are small after it.
    largest = int(np.argmax(lattice.avalanches))
    assert lattice.avalanches[largest] > 3000
    before, after = (np.nanmean(lattice.loads[place]) for place in (largest - 1, largest + 1))
    assert after < 0.5 * before


def test_a_run_is_cut_off_by_the_next_one():
    """A long run ends within a segment; of those that waited only the last one is done."""
    long = explored(
        Config.load(
            KLEIN, ["run.duration=1e5 s", "output.interval=1 s", "output.slip_interval=10 ms"]
        )
    )
    worker, begun, done = NewestJob(), threading.Event(), []

    def hour(stop):
        begun.set()
        run_live(long, stop, lambda _: None)
        done.append("hour")

    worker.submit(hour)
    assert begun.wait(30)
    worker.submit(lambda _: done.append("skipped") or time.sleep(0))
    worker.submit(lambda _: done.append("last"))
    end = time.monotonic() + 30
    while "last" not in done and time.monotonic() < end:
        time.sleep(0.01)
    assert done[0] == "hour"
    assert done[-1] == "last"
    worker.close()
    end = time.monotonic() + 30
    while worker.is_alive and time.monotonic() < end:
        time.sleep(0.01)
    assert not worker.is_alive


def test_the_first_picture_comes_though_the_next_change_is_there():
    """So that the picture follows a knob that is being turned."""
    stop, seen = Stop(), []
    stop.set()
    run_live(explored(Config.load(KLEIN, ["run.duration=1000 s"])), stop, seen.append)
    assert len(seen) == 1
    assert not seen[0].complete


def test_a_job_that_fails_does_not_end_the_thread(monkeypatch):
    reported, done = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", lambda args: reported.append(args.exc_value))
    worker = NewestJob()
    worker.submit(lambda _: 1 / 0)
    while not reported:
        time.sleep(0.01)
    worker.submit(lambda _: done.set())
    assert done.wait(30)
    assert isinstance(reported[0], ZeroDivisionError)
    worker.close()


def test_a_worker_that_rests_does_the_newest_only():
    done, finished = [], threading.Event()
    worker = NewestJob(delay=0.5)
    for number in range(5):
        worker.submit(lambda _, number=number: done.append(number))
    worker.submit(lambda _: finished.set())
    assert finished.wait(30)
    assert done == []
    worker.close()


def test_a_picture_waits_for_the_one_before_it():
    pace = Pace()
    pace.wait()
    pace.sent()
    threading.Timer(0.1, pace.drawn).start()
    start = time.monotonic()
    pace.wait()
    assert 0.05 < time.monotonic() - start
    # A tab in the background draws nothing, and stops nothing.
    pace.sent()
    pace.wait()


def test_theory_is_computed_once():
    """Also of configurations that it cannot distinguish; the curve alone comes first."""
    theories, config = Theories(), Config.load(KLEIN)
    assert theories.known(config) is None
    first, last = theories.compute(config)
    assert "steady sliding" not in first.summary
    assert "steady sliding" in last.summary
    assert theories.known(config) is last
    assert theories.known(Config.load(KLEIN, ["run.seed=7", "run.duration=3 s"])) is last
    assert theories.known(Config.load(KLEIN, ["slider.stiffness=98 N/m"])) is None
    assert theory(config).summary == last.summary


def test_a_slip_has_both_forces_in_one_unit():
    """Though the spring force is above 1 mN, and the contact force is not."""
    # Klein's case with all forces and masses larger: its forces are 17.709 and 17.691 µN.
    larger = 1e3 / 17.7
    changes = {
        "slider.mass": 1.47e-3,
        "slider.stiffness": 97,
        "contacts.static_force": 18e-6,
        "contacts.stiffness": 2000,
        "contacts.film_density": 956,
    }
    config = Config.load(
        KLEIN, ["run.duration=2.5 s", *(f"{key}={larger * one}" for key, one in changes.items())]
    )
    drawn = drawn_of(explored(config))
    spring, contact = drawn.slip_force, drawn.slip_contact_force
    assert spring.y_label == contact.y_label == "force (mN)"
    assert np.max(contact.y) < 1 < np.max(spring.y)
    assert np.max(contact.y) == pytest.approx(np.max(spring.y), rel=0.01)


def test_a_long_run_says_how_long_it_takes():
    changes = ["run.duration=1e4 s", "output.interval=1 s", "output.slip_interval=1 s"]
    config = explored(Config.load(KLEIN, changes))
    realization = Realization(config, 0)
    while realization.part_done < 1e-3:
        realization.advance(work=5_000)
    # As if this had taken a minute of computing time for each per mille.
    drawn = motion(Results(config, [realization], False, 6e4 * realization.part_done))
    part = realization.part_done
    realization.close()
    assert part < 0.1
    left = 6e4 * (1 - part) / 3600
    assert drawn.progress == f"{100 * part:.2g} % of the run, about {left:.2g} h to go"
    # The time axis ends near the samples there are.
    assert drawn.force.x[-1] == pytest.approx(0.2 * drawn.end, rel=0.05)


def test_values_are_those_that_have_a_meaning(klein):
    there = values(klein(slider={"kind": "prescribed"}))
    assert "slider.mass" not in there
    assert "contacts.count" in there
    assert there["interaction.lattice"] == "none"


def test_a_missing_library_is_named(command, monkeypatch):
    monkeypatch.setattr("mesoslip.command_line.explore.find_spec", lambda _: None)
    status, out, errors = command("explore", KLEIN, "--no-browser")
    assert (status, out) == (2, "")
    assert "mesoslip[explore]" in errors
    assert len(errors.splitlines()) == 1


def test_the_command_of_a_page_has_the_changes_of_its_start(command, monkeypatch, tmp_path):
    path = tmp_path / "my run.toml"
    path.write_text(Path(KLEIN).read_text())
    served = []
    monkeypatch.setattr("mesoslip.explorer.server.serve", lambda *one, **_: served.append(one))
    command.output("explore", path, "--set", "contacts.delay=1 ms", "--no-browser")
    session = Session(*served[0])
    assert session.change("contacts.count", "500")
    mesoslip_, run, name, *changes = shlex.split(session.command)
    assert (mesoslip_, run, name) == ("mesoslip", "run", str(path))
    assert Config.load(name, changes[1::2]) == session.config
    assert link_of(Setting(*served[0], {})).startswith("?toml=")


def test_what_cannot_be_explored_is_reported(command):
    errors = command.refusal("explore", KLEIN, "--no-browser", "--set", "contacts.delay=1kg")
    assert "contacts.delay" in errors


@contextmanager
def page_of(*changes, query=()):
    """A page without a browser, and its document."""
    document = pytest.importorskip("bokeh.document").Document()
    from mesoslip.explorer.view import Page

    page = Page(document, Config.load(KLEIN, changes), KLEIN, None, query)
    try:
        yield page, document
    finally:
        page.close()


def ask(page, action, name="", value=None):
    """Ask for something as the browser does."""
    number, *_ = page.elements.requests.tags or [0]
    page.elements.requests.tags = [number + 1, action, name, value]


def work(document, is_done):
    """Do what the server and the browser do, until something is done."""
    drawn, end = document.get_model_by_name("drawn"), time.monotonic() + 60
    while not is_done():
        assert time.monotonic() < end
        for callback in document.session_callbacks:
            document.remove_next_tick_callback(callback)
            callback.callback()
        drawn.tags = [drawn.tags[0] + 1, "run"]
        time.sleep(0.001)


def is_drawn(page):
    """Whether the run of the last change is drawn to its end."""
    status = page.elements["status"]
    return status.get("turn", 0) >= page._turn and status["part"] >= 1


def test_the_page_is_of_every_control():
    """It is made without a browser, and takes changes as its elements give them."""
    with page_of() as (page, _):
        shown = page.elements
        ask(page, "set", "contacts.delay", "1 ms")
        # The slider follows without a change of its own.
        assert page.session.changes == {"contacts.delay": "1 ms"}
        assert shown["contacts.delay"]["position"] > STEPS / 2
        assert shown["contacts.delay"]["was"] == "● was 500 µs"
        ask(page, "move", "contacts.delay", STEPS)
        assert page.session.config.contacts.delay == pytest.approx(0.05)
        ask(page, "set", "contacts.delay", "what?")
        assert shown["contacts.delay"]["isError"]
        assert shown["contacts.delay"]["value"] == "50 ms"
        ask(page, "move", "contacts.delay", STEPS - 1)
        assert not shown["contacts.delay"]["message"]
        for control in CONTROLS:
            assert control.meaning.endswith(".")
            assert shown[control.key]["hidden"] == (control.key not in page.session.shown)


def test_every_element_has_a_name_and_what_is_shown_has_its_element():
    """Those that a keyboard reaches; names of knobs are their labels, values are with units."""
    from html.parser import HTMLParser

    from mesoslip.explorer.server import ENVIRONMENT

    class Reader(HTMLParser):
        def __init__(self):
            super().__init__()
            self.ids, self.labelled, self.named, self.fields, self.within = set(), set(), [], [], []

        def handle_starttag(self, tag, attributes):
            given = dict(attributes)
            self.ids.add(given.get("id"))
            self.labelled.add(given.get("for") if tag == "label" else None)
            self.within += [tag] if tag in {"label", "button"} else []
            if tag in {"input", "select"}:
                self.fields.append((given, "label" in self.within))

        def handle_endtag(self, tag):
            if tag in self.within:
                self.within.remove(tag)

    with page_of() as (page, document):
        page._update()
        # Without the frame of Bokeh around it.
        source = (ROOT / "python/mesoslip/explorer/page.html").read_text("utf-8")
        body = source.split("{% block contents %}")[1].rpartition("{% endblock %}")[0]
        given = document.template_variables
        context = {"embed": lambda _: "", "roots": dict.fromkeys(given["figures"], "")}
        text = ENVIRONMENT.from_string(body).render(given | context)
    reader = Reader()
    reader.feed(text)
    for given, is_in_label in reader.fields:
        is_named = is_in_label or "aria-label" in given or given["id"] in reader.labelled
        assert is_named or given["aria-labelledby"] in reader.ids, given
        for one in given.get("aria-describedby", "").split():
            assert one in reader.ids
    for control in CONTROLS:
        assert control.key in reader.labelled
    assert "η<sub>S</sub>/Ω<sub>S</sub>" in text
    assert set(json.loads(page.elements.state.tags[0])["elements"]) <= reader.ids


def test_a_link_is_the_setting(session):
    assert session.link == ""
    assert session.change("contacts.delay", "1 ms")
    assert session.change("slider.kind", "layered")
    assert session.change("drive.stage", STAGES)
    assert session.link.startswith("?run=klein&contacts.delay=1+ms&")
    with page_of(query=parse_qsl(session.link[1:])) as (page, _):
        assert page.session.config == session.config
        assert page.session.changes == session.changes
        assert not page.elements._shown.get("error")
    # A configuration of one's own is in the link as a whole.
    mine = Session(Config.load(KLEIN, ["title=mine", "contacts.delay_law=exponential"]), "my.toml")
    assert mine.change("contacts.count", "1000")
    assert len(mine.link) < 1000
    session.follow(parse_qsl(mine.link[1:]))
    assert session.config == mine.config
    assert session.text("contacts.count") == "1000"
    # Of a ready run without changes too.
    assert session.begin(example_config("track"), "track.toml")
    assert session.link == "?run=track"


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("contacts.delay=1+kg", "contacts.delay: has the unit kg; expected a quantity"),
        ("contacts.delai=1+ms", "“contacts.delai” is no key that a link may change"),
        ("drive.history.file=/etc/passwd", "no key that a link may change"),
        ("run=kleine", "there is no ready run “kleine”"),
        ("toml=abc", "its file is damaged"),
        ("toml=" + link_file(b"[contacts.threshold]\nfile = 'x'"), "must not name a file"),
        ("toml=" + link_file(b"#" * 1_000_000), "cut off, or too long"),
        ("contacts.count=100000000", "contacts.count: more than"),
    ],
)
def test_a_bad_link_says_what_is_wrong_and_starts_with_the_default(session, query, message):
    before = session.config
    with pytest.raises(MesoslipError, match=re.escape(message)):
        session.follow(parse_qsl(query))
    assert session.config == before
    assert session.link == ""


def test_a_bad_link_is_reported_until_the_next_change():
    with page_of(query=[("run", "kleine")]) as (page, _):
        page._show_controls()
        assert "“kleine”" in page.elements["error"]["text"]
        assert page.elements["error"]["text"].endswith("This is the default.")
        ask(page, "set", "contacts.delay", "1 ms")
        assert page.elements["error"]["text"] == ""


def test_changes_are_undone_and_done_again(session, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("mesoslip.explorer.session.time.monotonic", lambda: clock[0])
    assert not session.can_undo
    for delay in ("0.6 ms", "0.7 ms", "0.8 ms"):
        # One move of a slider.
        assert session.change("contacts.delay", delay)
    assert session.change("slider.kind", "layered")
    assert not session.change("contacts.delay", "what?")
    assert session.undo()
    assert session.changes == {"contacts.delay": "0.8 ms"}
    assert session.undo()
    assert session.changes == {}
    assert not session.can_undo
    assert session.redo()
    assert session.redo()
    assert session.config.slider.layer_count == 8
    assert not session.can_redo
    assert session.begin(example_config("track"), "track.toml")
    assert session.reset()
    for _ in range(2):
        assert session.undo()
    assert session.source == KLEIN
    assert session.changes["contacts.delay"] == "0.8 ms"
    # A new change forgets what was undone.
    clock[0] = 10.0
    assert session.change("contacts.delay", "0.9 ms")
    assert not session.can_redo


@pytest.mark.parametrize("name", presets())
def test_every_ready_run_of_the_page_is_drawn(name):
    stop, seen = Stop(), []
    stop.set()
    run_live(runnable(example_config(name)), stop, lambda results: seen.append(motion(results)))
    assert len(seen) == 1
    assert Session(example_config(name), f"{name}.toml").is_runnable


@pytest.mark.long
@alone
def test_changes_leave_nothing_behind():
    """After many changes there is one run, and as many objects as after a few."""
    small = ["run.duration=0.5 s", "contacts.count=400", "output.slip_interval=100 us"]
    with page_of(*small) as (page, document):
        page._update()

        def count_after(numbers):
            for number in numbers:
                ask(page, "set", "contacts.delay", f"{1 + number} ms")
                work(document, lambda: is_drawn(page))
            page._workers["theory"].cancel()
            gc.collect()
            objects = gc.get_objects()
            kept = sum(isinstance(one, (Results, Realization)) for one in objects)
            return kept, len(objects), threading.active_count()

        few, many = count_after(range(5)), count_after(range(5, 17))
        # The run that is shown, with its one realization.
        assert few[0] == many[0] <= 2
        # Less than ten an added change.
        assert many[1] - few[1] < 120
        assert many[2] == few[2]


def test_a_run_too_large_for_a_page_is_refused_at_its_control(session, monkeypatch):
    """With one sentence, and the configuration stays as it was."""
    before = session.config
    assert not session.change("contacts.count", "100000000")
    message = session.problems["contacts.count"]
    assert "too long to start" in message
    assert message.count(".") == 0
    assert session.config is before
    assert session.change("contacts.count", "4000")
    monkeypatch.setattr("mesoslip.explorer.live_run.free_memory", lambda: 1e6)
    assert not session.change("contacts.count", "100000")
    assert "GiB" in session.problems["contacts.count"]
    assert session.config.contacts.count == 4000
    # Also through what counts the contacts of a lattice.
    monkeypatch.undo()
    assert session.change("contacts.count", "4080")
    assert session.change("interaction.lattice", "square")
    assert not session.change("interaction.columns", "1000000")
    assert "too long to start" in session.problems["interaction.columns"]


def test_a_start_too_large_for_a_page_is_not_run():
    session = Session(Config.load(KLEIN, ["contacts.count=100000000"]), KLEIN)
    assert "contacts.count" in session.problems
    assert session.change("contacts.count", "4080")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not say")
@alone
def test_memory_of_a_run_that_was_replaced_is_returned():
    def resident():
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    large = explored(Config.load(KLEIN, ["contacts.count=1000000", "run.duration=1000 s"]))
    small = explored(Config.load(KLEIN, ["run.duration=0.1 s"]))
    worker, peaks, done = NewestJob(), [], threading.Event()
    before = resident()
    try:
        worker.submit(lambda stop: run_live(large, stop, lambda _: peaks.append(resident())))
        end = time.monotonic() + 60
        while not peaks and time.monotonic() < end:
            time.sleep(0.01)
        worker.submit(lambda stop: run_live(small, stop, lambda _: None))
        worker.submit(lambda _: done.set())
        assert done.wait(60)
    finally:
        worker.close()
    assert peaks[0] - before > 50
    end = time.monotonic() + 30
    while resident() - before > 0.3 * (peaks[0] - before) and time.monotonic() < end:
        time.sleep(0.05)
    assert resident() - before < 0.3 * (peaks[0] - before)


def test_a_refused_change_leaves_the_run_as_it_was():
    """It continues to its end, and its output can be downloaded."""
    with page_of("run.duration=1 s") as (page, document):
        page._update()
        ask(page, "set", "contacts.count", "100000000")
        assert "red" in page.elements["status"]["text"]
        assert page.elements["contacts.count"]["isError"]
        work(document, lambda: page._results is not None)
        assert page._results.config.contacts.count == 4080
        # What is wrong is still reported.
        assert "red" in page.elements["status"]["text"]


def test_a_slider_goes_back_from_what_is_refused(session):
    """One of a key that applies, and one that a hand moves as its key ceases to apply."""
    knob = Knob(BY_KEY["slider.stiffness"], session)
    assert knob.state["position"] == STEPS / 2
    assert session.change("slider.stiffness", knob.text_at(148))
    assert session.change("slider.kind", "layered")
    assert knob.state["position"] == 148
    assert session.change("slider.kind", "prescribed")
    assert knob.state["position"] == 148
    assert not session.change("slider.stiffness", knob.text_at(20))
    assert session.reset()
    assert knob.state["position"] == STEPS / 2


def test_a_page_is_built_beside_the_pages_that_are_open(monkeypatch):
    """On another thread: the server's own goes on."""
    document = pytest.importorskip("bokeh.document").Document()
    from mesoslip.explorer import server

    answered, waited = threading.Event(), []
    monkeypatch.setattr(server, "Page", lambda *_: waited.append(answered.wait(5)))

    class Context:
        id = "first"

        async def with_locked_document(self, build):
            await build(document)

    async def serve():
        building = asyncio.create_task(
            server.Pages(Config.load(KLEIN), KLEIN).on_session_created(Context())
        )
        await asyncio.sleep(0.1)
        answered.set()
        await building

    asyncio.run(serve())
    assert waited == [True]


def test_pages_are_limited_and_idle_ones_make_room(monkeypatch):
    """Each has its runs; the next one need not wait for those of a program that asks for many."""
    pytest.importorskip("bokeh")
    from bokeh.util.token import generate_jwt_token, generate_session_id
    from mesoslip.explorer import server
    from tornado.httpclient import AsyncHTTPClient, HTTPRequest
    from tornado.websocket import websocket_connect

    made, closed = [], []

    class Page:
        def __init__(self, *_):
            self.last_change = time.monotonic()
            made.append(self)

        def close(self):
            closed.append(self)

    monkeypatch.setattr(server, "Page", Page)
    monkeypatch.setattr(server, "TEMPLATE", Environment(autoescape=True).from_string("page"))

    async def serve():
        one = server.make_server(Config.load(KLEIN), KLEIN, 0)
        one.start()
        host = f"127.0.0.1:{one.port}"
        client = AsyncHTTPClient(max_clients=40)

        async def connect():
            token = generate_jwt_token(generate_session_id())
            asked = HTTPRequest(f"ws://{host}/ws", headers={"Origin": f"http://{host}"})
            socket = await websocket_connect(asked, subprotocols=["bokeh", token])
            await asyncio.wait_for(socket.read_message(), 5)
            return socket

        # Connections keep their sessions.
        sockets = [await connect() for _ in range(server.MAX_PAGES + 4)]
        assert len(made) == server.MAX_PAGES
        got = await client.fetch(f"http://{host}/", raise_error=False)
        assert (got.code, got.reason) == (503, server.FULL)
        made[3].last_change -= 2 * server.IDLE_SECONDS
        got = await asyncio.gather(
            *(client.fetch(f"http://{host}/", raise_error=False) for _ in range(10))
        )
        assert sorted(answer.code for answer in got) == [200, *9 * [503]]
        assert closed == [made[3]]
        await read_to_end(sockets[3])
        for socket in sockets:
            socket.close()
        await asyncio.gather(*(read_to_end(one) for one in sockets if one is not sockets[3]))
        client.close()
        one.stop()

    async def read_to_end(socket):
        while await asyncio.wait_for(socket.read_message(), 5) is not None:
            pass

    asyncio.run(serve())


def test_the_models_of_a_page_are_collected_once(monkeypatch):
    """Not for each of its figures."""
    document = pytest.importorskip("bokeh.document").Document()
    from mesoslip.explorer.view import Page

    collected = []
    collect = type(document.models).recompute
    monkeypatch.setattr(
        type(document.models), "recompute", lambda self: collected.append(collect(self))
    )
    Page(document, Config.load(KLEIN), KLEIN).close()
    assert len(document.roots) > 5
    assert len(collected) <= 2


FAST_MOVIE = ("run.duration=2.2 s", "contacts.count=400")


@pytest.mark.parametrize(
    ("changes", "view"),
    [
        ((), "contacts"),
        (("slider.kind=layered", "slider.layers=3"), "layers"),
        (
            (
                "interaction.lattice=square",
                "interaction.columns=20",
                "interaction.rows=20",
                "interaction.strength=0.1",
            ),
            "lattice",
        ),
        (INTERFACE, "fronts"),
    ],
)
def test_a_run_is_recorded_for_its_movie(changes, view):
    """The motion is that of the run, and most snapshots of contacts lie in the largest slip."""
    config = Config.load(KLEIN, (*FAST_MOVIE, *changes))
    found, wanted = recorded_for_movie(config)
    assert found == view
    results = finished_run(wanted, Stop())
    assert results.realizations[0].breaks == run_realizations(config).realizations[0].breaks > 400
    if view == "contacts":
        around = around_slip(wanted, results)
        (slip,) = [largest_slip(build_tree(results))]
        low, high = slip_window(slip)
        times = np.array(around.output.snapshots)
        assert np.sum((times >= low) & (times <= high)) >= 70
        assert len(times) <= 100
    if view == "layers":
        (slip,) = [largest_slip(build_tree(results))]
        low, high = slip_window(slip)
        assert around_slip(wanted, results).output.interval <= 1.01 * (high - low) / 100


def test_a_movie_is_made_or_the_key_is_named(monkeypatch):
    monkeypatch.setattr(chosen_frames, "__defaults__", (10,))
    said = []
    movie = movie_of(
        Config.load(KLEIN, (*FAST_MOVIE, "slider.kind=layered", "slider.layers=3")),
        Stop(),
        said.append,
    )
    assert movie.startswith(b"GIF8")
    assert said[0] == "the movie: running …"
    assert [one for one in said[1:] if one.endswith(" % drawn")] == said[1:]
    assert said[-1] == "the movie: 100 % drawn"
    with pytest.raises(ConfigError, match=r"run.engine.*movie"):
        movie_of(Config.load(KLEIN, (*FAST_MOVIE, "run.engine=me")), Stop(), said.append)


def test_a_stop_ends_the_drawing_of_a_movie(monkeypatch):
    monkeypatch.setattr(chosen_frames, "__defaults__", (10,))
    stop, said = Stop(), []

    def report(message):
        said.append(message)
        if message.endswith(" % drawn"):
            stop.set()

    assert movie_of(Config.load(KLEIN, FAST_MOVIE), stop, report) is None
    assert len(said) == 2


def test_a_measured_trace_lies_beside_the_model():
    """In one unit, with the means over its slips."""
    config = explored(Config.load(KLEIN, ["run.duration=6 s"]))
    stronger = ["run.duration=8 s", "contacts.static_force=1.8 mN", "drive.velocity=10 um/s"]
    trace = run_realizations(Config.load(KLEIN, stronger))
    measured = Measured(build_tree(trace))
    alone, beside = drawn_of(config), drawn_of(config, measured)
    assert alone.measured.is_empty
    assert beside.force.y_label == beside.measured.y_label == "spring force (mN)"
    assert 1e3 * np.max(beside.force.y) == pytest.approx(np.max(alone.force.y))
    assert np.max(beside.measured.y) == pytest.approx(
        1e3 * measured.tree["spring_force"].sel(time=slice(0, 6)).max().item(), rel=1e-3
    )
    # Not longer than the axis.
    assert beside.measured.x[-1] <= beside.end
    numbers = dict(beside.numbers)
    drop = float(mesoslip.slips(measured.tree)["force_drop"].mean())
    assert numbers["mean force drop"].endswith(f"(measured {with_unit(drop, 'N', 3)})")
    with pytest.raises(FileError):
        Measured(mesoslip.curve(Config.load(KLEIN)))
