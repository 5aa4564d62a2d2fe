"""Configurations: what is accepted, what is refused, and with which words."""

import contextlib
import math
import os
import re
import tomllib
from datetime import date

import mesoslip
import numpy as np
import pint
import pytest
import tomli_w
from conftest import ROOT, drive_in_stages, klein_tables, python
from hypothesis import given, settings
from hypothesis import strategies as st
from mesoslip import Config, ConfigError, FileError, MesoslipError, ThresholdLaw
from mesoslip.configuration.files import Merged, override
from mesoslip.configuration.messages import all_keys
from mesoslip.configuration.sliders import KINDS as SLIDER_KINDS
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.units import PREFIXES, SI, to_si
from mesoslip.simulation.memory import check_memory
from mesoslip.simulation.realization import Realization
from mesoslip.theory.derived import derived
from pydantic import ValidationError

KLEIN = ROOT / "runs" / "klein.toml"

LAYERED = {"kind": "layered", "mass": 1e-3, "stiffness": 97.0, "layers": 4}


def problems(tables) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        Config.from_dict(tables, source="case.toml")
    assert caught.value.exit_status == 2
    return [str(problem) for problem in caught.value.problems]


LATTICE = {"strength": 0.3, "columns": 60, "rows": 68}


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("slider__mass", "-1 g", ["slider.mass", "-1 g", "greater than 0"]),
        ("slider__mass", "97 N", ["slider.mass", "97 N", "1.47 g", "kg"]),
        ("slider__mass", "five", ["slider.mass", "five", "1.47 g"]),
        ("slider__mass", float("nan"), ["slider.mass", "finite"]),
        ("slider__mass", float("inf"), ["slider.mass", "finite"]),
        ("slider__mass", "nan kg", ["slider.mass", "finite"]),
        ("slider__mass", True, ["slider.mass", "1.47 g"]),
        ("slider__mass", None, ["slider.mass", "missing"]),
        ("slider__stiffness", 0, ["slider.stiffness", "greater than 0"]),
        ("slider__damping_ratio", -0.1, ["slider.damping_ratio", "greater than or equal to 0"]),
        ("slider__damping_ratio", 1e100, ["slider.damping_ratio", "between 1e-300 and 1e+12 in"]),
        ("slider__damping", 5.0, ["slider.damping", "not both"]),
        ("slider__stifness", 97, ["slider.stifness", "unknown key", "'stiffness'"]),
        ("slider__layers", 16, ["slider.layers", 'for slider.kind = "layered" only']),
        ("slider", {"kind": "quasistatic"}, ["slider.stiffness", "missing", "drive.force_rate"]),
        (
            "slider",
            {"kind": "quasistatic", "stiffness": 97.0, "mass": 1.0},
            ["slider.mass", '"rigid" or "layered" or "force" or "interface" only'],
        ),
        ("slider", LAYERED | {"layers": 0}, ["slider.layers", "greater than or equal to 1"]),
        (
            "slider",
            LAYERED | {"damping_ratio": 0.2},
            ["slider.damping_ratio", '"rigid" or "interface" only'],
        ),
        ("slider", LAYERED | {"base": {"mass": 1.0}}, ["slider.base.stiffness", "missing"]),
        (
            "slider",
            LAYERED | {"solver": {"metod": "bdf"}},
            ["slider.solver.metod", "unknown key", "'method'"],
        ),
        (
            "slider",
            LAYERED | {"solver": {"relative_tolerance": 1.0}},
            ["slider.solver.relative_tolerance", "less than or equal to 0.01"],
        ),
        (
            "slider",
            LAYERED | {"cantilever": {"length": 1.0, "radius": 0.1, "density": 1.0}},
            ["slider.cantilever.young_modulus", "missing"],
        ),
        ("output__layers", True, ["output.layers", 'for slider.kind = "layered" only']),
        ("slider__kind", "bouncy", ["slider.kind", "bouncy", "rigid", "prescribed"]),
        ("slider", 5, ["slider", "table"]),
        ("run__engine", "ab", ["run.engine", "ab", "eq", "me"]),
        ("run__resolution", 0.0, ["run.resolution", "greater than 0"]),
        ("run__resolution", 2.0, ["run.resolution", "less than or equal to 1"]),
        ("curve", {"length": -1}, ["curve.length", "greater than 0"]),
        ("curve", {"lengths": 1}, ["curve.lengths", "unknown key", "'length'"]),
        ("curve", {"tolerance": 0}, ["curve.tolerance", "greater than or equal"]),
        (
            "run",
            {"engine": "me", "resolution": 1e-3, "duration": 12.0},
            ["run.resolution", "populations"],
        ),
        ("curve", {"newborn_width": "9 nm"}, ["curve.newborn_width", "a quarter of"]),
        ("run__duration", "0 s", ["run.duration", "greater than 0"]),
        ("run__duration", None, ["run.duration", "needed"]),
        ("run__realizations", 0, ["run.realizations", "greater than or equal to 1"]),
        (
            "run",
            {"engine": "me", "realizations": 2, "duration": 12.0},
            ["must be 1", "no random numbers"],
        ),
        ("run__seed", -1, ["run.seed", "greater than or equal to 0"]),
        ("drive__velocity", "3 s", ["drive.velocity", "um/s"]),
        ("drive__velocity", None, ["drive.velocity", "either"]),
        ("drive__force_rate", "1 uN/s", ["drive.velocity", "either", "force_rate"]),
        ("drive", {"force_rate": "1 uN/s"}, ["drive.force_rate", '"quasistatic" or "force" only']),
        ("drive", {"force_rate": 0.0}, ["drive.force_rate", "must not be 0"]),
        ("run__drive_displacement", "1 um", ["run.drive_displacement", "run.duration"]),
        ("run__avalanches", 10, ["run.avalanches", "[interaction]", "quasistatic"]),
        (
            "drive",
            {"stage": [{"duration": -1, "velocity": 0}]},
            ["drive.stage[0].duration", "greater"],
        ),
        ("contacts__count", 0, ["contacts.count", "greater than or equal to 1"]),
        ("contacts__count", 2.5, ["contacts.count", "integer"]),
        ("contacts__area", None, ["contacts.area", "drag_rate"]),
        ("contacts__drag", "0.1 N s/m", ["contacts.drag", "either drag or drag_rate"]),
        ("contacts__drag", "0.1 N/m", ["contacts.drag", "N s/m"]),
        ("contacts__delay", "-1 ms", ["contacts.delay", "greater than or equal to 0"]),
        ("contacts__back_force_ratio", 1.0, ["contacts.back_force_ratio", "less than 1"]),
        ("contacts__coupling", "loose", ["contacts.coupling", "loose", "scaled"]),
        ("contacts__reattach", "yes", ["contacts.reattach", "boolean"]),
        ("contacts__ageing", {}, ["contacts.ageing.time", "missing"]),
        ("contacts__threshold__law", "cauchy", ["contacts.threshold.law", "gaussian"]),
        ("contacts__threshold__relative_width", 0, ["relative_width", "or equal to 0.000001"]),
        ("contacts__threshold__relative_width", 1e-8, ["relative_width", "or equal to 0.000001"]),
        (
            "contacts__thermal",
            {"temperature": 300.0},
            ["contacts.thermal.rate: missing, and so is activation_length"],
        ),
        ("interaction", {"strength": 0.3, "columns": 60}, ["interaction.rows", "missing"]),
        ("interaction", LATTICE | {"rows": 67}, ["interaction.rows", "even", "67"]),
        ("interaction", LATTICE | {"rows": 1}, ["interaction.rows", "greater than or equal to 2"]),
        (
            "interaction",
            LATTICE | {"rows": 60},
            ["interaction.columns", "contacts.count", "60 x 60 = 3600, not 4080"],
        ),
        (
            "interaction",
            LATTICE | {"strength": -0.1},
            ["interaction.strength", "negative", "attach", "-0.1"],
        ),
        (
            "interaction",
            LATTICE | {"strength": 1e9},
            ["interaction.strength", "attaches", "double precision", "at most 9.66e+05"],
        ),
        ("interaction", LATTICE | {"lattice": "cubic"}, ["interaction.lattice", "cubic", "square"]),
        ("interaction", LATTICE | {"xi": 1}, ["interaction.xi", "unknown key"]),
        ("output__snapshot_size", 100, ["output.snapshot_size", "[interaction]"]),
        ("output__avalanche_size", 2, ["output.avalanche_size", "[interaction]"]),
        ("output__interval", "20 s", ["output.interval", "duration"]),
        ("output__slip_interval", 0.1, ["output.slip_interval", "interval"]),
        ("title", "a\0b", ["title", "character"]),
        ("title", "\udcff", ["title", "UTF-8"]),
        ("output__snapshots", 5, ["output.snapshots", "must be a list"]),
        (
            "output__snapshots",
            [{"from": "1 s", "to": "2 m", "points": 3}],
            ["output.snapshots", "2 m", "0.5 ms"],
        ),
        (
            "output__snapshots",
            [{"from": "1 s", "to": "2 s", "step": "1 ms"}],
            ["output.snapshots", "points = 30"],
        ),
        (
            "output__snapshots",
            [{"from": "2 s", "to": "1 s", "points": 3}],
            ["output.snapshots", "ends after it begins"],
        ),
        ("outputs", {}, ["outputs", "unknown key", "'output'"]),
        ("delay", "2 ms", ["delay: unknown key; did you mean 'contacts.delay'?"]),
        ("run__delay", "2 ms", ["run.delay: unknown key; did you mean 'contacts.delay'?"]),
        ("contacts__rigid", 1, ["contacts.rigid: unknown key"]),
    ],
)
def test_what_is_wrong_is_reported(key, value, words):
    tables = klein_tables(**{key: value})
    (message,) = problems(tables)
    assert message.startswith("case.toml: ")
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"run__engine": "me", "interaction": LATTICE},
            ["interaction", 'engine "eq"', "no neighbours", "smaller"],
        ),
        (
            {"run__engine": "me", "slider": {"kind": "quasistatic", "stiffness": 97.0}},
            ["slider.kind", 'engine "eq"', "mesoslip curve"],
        ),
        (
            {"contacts__area": None, "contacts__drag_rate": None, "interaction": LATTICE},
            ["contacts.area", "distance between neighbours"],
        ),
        (
            {"slider": {"kind": "quasistatic", "stiffness": 1.0}, "drive": {"force_rate": 1.0}},
            ["slider.stiffness", "drive.force_rate"],
        ),
        (
            {"run__engine": "me", "output__snapshots": ["1 s"]},
            ["output.snapshots", 'engine "eq"', "one by one"],
        ),
        (
            {"interaction": LATTICE, "output__snapshots": [3.0, 2.0]},
            ["output.snapshots", "increase", "3"],
        ),
        ({"interaction": LATTICE, "output__snapshots": [13.0]}, ["output.snapshots", "duration"]),
        (
            {"run": {"drive_displacement": 1e-6}, "drive__velocity": 0.0},
            ["run.drive_displacement", "drive.velocity", "not 0"],
        ),
        (
            {"run": {"avalanches": 5}, "interaction": LATTICE, "drive__velocity": 0.0},
            ["drive.velocity", "must not be 0"],
        ),
        (
            {
                "slider": {"kind": "quasistatic"},
                "drive": {"force_rate": 1e-6},
                "run": {},
            },
            ["run.duration", "needed"],
        ),
    ],
)
def test_what_is_wrong_between_tables_is_reported(changes, words):
    (message,) = problems(klein_tables(**changes))
    for word in words:
        assert word in message


def test_lengths_of_a_run():
    """A distance replaces the duration of a base; avalanches end a run whatever its duration."""
    quasistatic = {"kind": "quasistatic", "stiffness": 97.0}
    tables = klein_tables(slider=quasistatic)
    assert Config.from_dict(tables).duration == 12
    text = Config.from_dict(tables).to_toml()
    by_avalanches = Config.from_dict(klein_tables(slider=quasistatic, run={"avalanches": 100}))
    assert by_avalanches.duration == math.inf
    # 18 uN/97 N/m at 0.1 um/s, and 100 avalanches of 1 + 2000/97 contacts.
    assert 1.8 < by_avalanches.expected_duration < 2.1
    assert by_avalanches.output_interval == 1e-3
    by_way = Config.from_toml(text, overrides=["run.drive_displacement=1 um"])
    assert by_way.duration == pytest.approx(10)
    both = Config.from_toml(text, overrides=["run.avalanches=5"])
    assert (both.duration, both.run.avalanches) == (12, 5)


@pytest.mark.parametrize(
    ("way", "duration"), [(1e-6, 1.0), (3e-6, 4.0), (4.5e-6, 5.25), (8e-6, 7.0), (10e-6, 8.0)]
)
def test_the_time_for_a_path_length_of_stages(klein, way, duration):
    """There, a hold, back, and on after the end of the last stage."""
    stages = [(2.0, 1e-6), (1.0, 0.0), (2.0, -1e-6), (2.0, 2e-6)]
    drive = drive_in_stages(*stages)
    config = klein(run={"drive_displacement": way}, drive=drive)
    assert config.duration == pytest.approx(duration)
    assert math.fsum(part.path_length for part in config.drive_parts) == pytest.approx(way)


def test_a_way_that_stages_do_not_go():
    stages = [{"duration": 2.0, "velocity": 1e-6}, {"duration": 2.0, "velocity": 0.0}]
    tables = klein_tables(run={"drive_displacement": 3e-6}, drive={"stage": stages})
    (message,) = problems(tables)
    assert "run.drive_displacement = 3e-06: is never reached" in message
    assert "by 2e-06 m, and the last one stands still" in message


@pytest.mark.parametrize(("law", "width"), [("uniform", 0.6), ("exponential", 1.01)])
def test_thresholds_are_not_negative(law, width):
    (message,) = problems(klein_tables(contacts__threshold={"law": law, "relative_width": width}))
    assert "relative_width" in message
    assert law in message
    edge = {"uniform": 1 / math.sqrt(3), "exponential": 1.0}[law]
    Config.from_dict(
        klein_tables(
            contacts__threshold={"law": law, "relative_width": edge}, contacts__back_force_ratio=0.0
        )
    )


def test_most_thresholds_are_above_the_back_force():
    (message,) = problems(
        klein_tables(
            contacts__threshold={"law": "lognormal", "relative_width": 2.0},
            contacts__back_force_ratio=0.5,
        )
    )
    assert "only 0.465 of the thresholds are above the back force" in message
    young = {"law": "relax", "time": 1e-3, "young_force_ratio": 0.5, "young_relative_width": 0.01}
    (message,) = problems(
        klein_tables(
            contacts__coupling="equal", contacts__ageing=young, contacts__back_force_ratio=0.9
        )
    )
    assert "back_force_ratio: only 0 of the thresholds of young contacts" in message


@pytest.mark.parametrize(
    ("law", "width", "mean"),
    [
        ("gaussian", 1.5, 1.6887207),
        # Without memory, and a lognormal one by its partial moment.
        ("exponential", 1.0, 1.1),
        ("lognormal", 1.0, 1.0087525),
        ("gaussian", 0.3, 1.0013314),
    ],
)
def test_the_mean_of_thresholds_that_can_attach_is_stated(law, width, mean):
    config = Config.from_dict(
        klein_tables(contacts__threshold={"law": law, "relative_width": width})
    )
    contacts = config.contacts
    assert contacts.threshold.above(0.1).accepted_mean == pytest.approx(mean, rel=3e-5)
    message = contacts.cut_thresholds
    if mean < 1.02:
        assert message is None
    else:
        assert f"{mean:.3g} f_s, {18 * mean:.3g} µN of all contacts" in message


def test_everything_wrong_is_reported_at_once():
    messages = problems(
        klein_tables(slider__mass="-1 g", contacts__count=0, drive__velocity="1 N", outputs={})
    )
    assert len(messages) == 4


@given(st.floats(1e-12, 1e12))
def test_units_are_converted(value):
    assert to_si(f"{value!r} uN", "N", "18 uN") == pytest.approx(value * 1e-6, rel=1e-12)
    assert to_si(value, "N", "18 uN") == value


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("0,5 ms", "s"),
        ("1,47 g", "kg"),
        ("\u22125 s", "s"),
        ("\u0661 s", "s"),
        ("1 ± 0.1 s", "s"),
        ("1.2.3 s", "s"),
        ("5 5 ms", "s"),
        ("18..5 uN", "N"),
        ("[1,2] g", "kg"),
        ("g", "kg"),
        ("1_000 g", "kg"),
        ("9**9**9 s", "s"),
        ("1 s**9**9", "s"),
        ("1 s^99", "s"),
        ("51/s", "1/s"),
        ("1 s*", "s"),
        ("1 (s)", "s"),
        ("3 dB", "1"),
        ("1 " + "m " * 10_000, "m"),
    ],
)
def test_a_quantity_is_one_number_and_one_unit(text, unit):
    with pytest.raises(ValueError, match="expected a quantity such as"):
        to_si(text, unit, "5 ms")


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("18 uN", "N", 18e-6),
        ("1ms", "s", 1e-3),
        ("-.5e1 m", "m", -5.0),
        ("51.4 1/s", "1/s", 51.4),
        ("51.4 Hz", "1/s", 51.4),
        ("51.4 s-1", "1/s", 51.4),
        ("956 kg/m^3", "kg/m^3", 956.0),
        ("956 kg m**-3", "kg/m^3", 956.0),
        ("0.956 g·cm⁻³", "kg/m^3", 956.0),
        ("2 J/m/m", "N/m", 2.0),
        ("2 J/m^2*m", "N", 2.0),
        ("2 J/s·s/m", "N", 2.0),
        ("20 %", "1", 0.2),
        ("2 minute", "s", 120.0),
        ("1 lbf", "N", pytest.approx(4.4482216152605)),
        ("1e-99999999999 s", "s", 0.0),
    ],
)
def test_units_that_are_known(text, unit, value):
    assert to_si(text, unit, "5 ms") == value


@pytest.mark.parametrize("unit", ["A", "mol", "cd", "K*mol", "K*A/mol"])
def test_units_of_dimensions_that_no_key_has_are_not_kelvins(unit):
    with pytest.raises(ValueError, match=re.escape(f"has the unit {unit}; expected")):
        to_si(f"300 {unit}", "K", "300 K")


def test_units_mean_what_they_mean_to_pint():
    """All our prefixes before all our units."""
    registry = pint.UnitRegistry(cache_folder=None)
    for unit in SI:
        for prefix in PREFIXES:
            theirs = registry.Quantity(1.0, prefix + unit).to_base_units()
            ours = to_si(f"1 {prefix}{unit}", f"{theirs.units:~C}", "1")
            assert ours == pytest.approx(theirs.magnitude, rel=1e-14, abs=0)


@settings(deadline=None, max_examples=50)
@given(st.text(st.sampled_from("abdehimnostuNPµ%_°"), min_size=1, max_size=6))
def test_no_name_of_a_unit_breaks_the_library(name):
    with contextlib.suppress(ValueError):
        to_si(f"1 {name}", "s", "5 ms")


def test_units_need_no_files(tmp_path):
    """A home folder that cannot be written to, and units that only pint knows."""
    environment = {**os.environ, "HOME": "/proc/none", "XDG_CACHE_HOME": "/proc/none"}
    code = (
        "import sys; from mesoslip.configuration.units import to_si; to_si('97 N/m', 'N/m', '');"
        "assert 'pint' not in sys.modules; print(to_si('1 minute', 's', ''))"
    )
    assert python(code, env=environment, cwd=tmp_path) == "60.0\n"


@given(st.text(max_size=12))
def test_no_text_breaks_the_parser(text):
    try:
        value = to_si(text, "kg", "1.47 g")
    except ValueError as error:
        value, message = 0.0, str(error)
    else:
        message = "1.47 g"
    assert math.isfinite(value)
    assert "1.47 g" in message


WORDS = {"threshold", "kind", "coupling", "delay_law", "initial", "renewal"}


def test_klein_file_is_kleins_case(klein):
    config = Config.load(ROOT / "runs" / "klein.toml")
    expected = klein(output__slip_interval=1e-5)
    assert config.slider.damping_rate == expected.slider.damping_rate
    for table in ("drive", "contacts", "slider"):
        ours, theirs = config.to_dict()[table], expected.to_dict()[table]
        assert ours.keys() == theirs.keys()
        for name in ours.keys() - WORDS:
            assert ours[name] == pytest.approx(theirs[name], rel=1e-12), name


def test_round_trip(klein):
    config = klein(title="A title", run__realizations=3)
    assert Config.from_dict(config.to_dict()) == config
    assert Config.from_toml(config.to_toml()) == config


def test_the_name_of_a_file_is_no_text():
    with pytest.raises(ConfigError, match=r"Config\.load reads"):
        Config.from_toml("runs/klein.toml")


def test_every_run_in_the_tree_is_valid():
    for path in (ROOT / "runs").glob("*.toml"):
        Config.load(path)


def test_overrides():
    path = ROOT / "runs" / "klein.toml"
    config = Config.load(
        path,
        [
            "contacts.delay=1ms",
            "contacts.threshold.law=weibull",
            "slider.damping=3 1/s",
            "run.seed=5",
            "contacts.reattach=false",
            "title = another",
        ],
    )
    assert config.contacts.delay == 1e-3
    assert config.contacts.threshold.law == "weibull"
    assert config.slider.damping_rate == 3
    assert config.run.seed == 5
    assert config.contacts.reattach is False
    assert config.title == "another"
    with pytest.raises(ConfigError, match=r"did you mean 'contacts\.delay'"):
        Config.load(path, ["delay=1ms"])
    with pytest.raises(ConfigError, match=r"base: names the base of a file"):
        Config.load(path, ["base=klein.toml"])
    with pytest.raises(ConfigError, match="did you mean 'delay'"):
        Config.load(path, ["contacts.delays=1ms"])
    with pytest.raises(ConfigError, match="must look like"):
        Config.load(path, ["contacts.delay"])


def test_a_base_is_laid_under(tmp_path):
    (tmp_path / "base.toml").write_text((ROOT / "runs" / "klein.toml").read_text())
    (tmp_path / "over.toml").write_text(
        'base = "base.toml"\n[contacts]\ndelay = "2 ms"\n[slider]\ndamping = 7\n'
        '[[drive.stage]]\nduration = 3\nvelocity = "1 um/s"\n'
        '[[drive.stage]]\nduration = "1 s"\nvelocity = 0\n[run]\nduration = 10\n'
    )
    config = Config.load(tmp_path / "over.toml")
    assert config.contacts.delay == 2e-3
    assert config.contacts.count == 4080
    assert config.slider.damping_rate == 7
    # The last stage lasts until the end of the run.
    assert config.drive_parts == ((3, 1e-6, 1e-6, 0), (7, 0, 0, 1))
    (tmp_path / "block.toml").write_text('base = "base.toml"\n[slider]\nkind = "prescribed"\n')
    assert Config.load(tmp_path / "block.toml").slider.kind == "prescribed"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (["kind=quasistatic"], {"kind": "quasistatic", "stiffness": 97.0}),
        (["kind=prescribed"], {"kind": "prescribed"}),
        (["layers=3", "kind=layered"], {"mass": 1.47e-3, "stiffness": 97.0, "layers": 3}),
        (["kind=layered", "layers=3", "mass=2 g"], {"mass": 2e-3, "layers": 3}),
    ],
)
def test_another_kind_keeps_what_it_has_too(changes, expected, tmp_path):
    """Klein's damping is unknown to all other kinds of sliders."""
    path = ROOT / "runs" / "klein.toml"
    changed = Config.load(path, [f"slider.{change}" for change in changes])
    assert changed.to_dict()["slider"].items() >= expected.items()
    lines = "\n".join(re.sub("=([a-z]+|2 g)$", r'="\1"', change) for change in changes)
    (tmp_path / "over.toml").write_text(f'base = "{path}"\n[slider]\n{lines}\n')
    assert Config.load(tmp_path / "over.toml") == changed


def test_another_kind_refuses_what_was_set_beside_it():
    path = ROOT / "runs" / "klein.toml"
    for changes in (["kind=quasistatic", "mass=1 g"], ["mass=1 g", "kind=quasistatic"]):
        with pytest.raises(ConfigError, match=r'slider\.mass.*"rigid" or "layered" or "force"'):
            Config.load(path, [f"slider.{change}" for change in changes])


def test_another_kind_hides_no_mistake_of_the_base(tmp_path):
    text = (ROOT / "runs" / "klein.toml").read_text().replace("damping_ratio", "damping_ratios")
    (tmp_path / "base.toml").write_text(text)
    with pytest.raises(ConfigError, match=r"slider\.damping_ratios: unknown key"):
        Config.load(tmp_path / "base.toml", ["slider.kind=quasistatic"])


def test_a_base_need_not_name_the_default_kind(tmp_path):
    text = (ROOT / "runs" / "klein.toml").read_text().replace('kind = "rigid"', "")
    (tmp_path / "base.toml").write_text(text)
    (tmp_path / "over.toml").write_text('base = "base.toml"\n[slider]\nmass = "3 g"\n')
    slider = Config.load(tmp_path / "over.toml").slider
    assert (slider.mass, slider.stiffness) == (3e-3, 97)
    slider = Config.load(tmp_path / "base.toml", ["slider.mass=3 g"]).slider
    assert (slider.mass, slider.stiffness) == (3e-3, 97)


def test_a_long_chain_of_bases_is_refused(tmp_path):
    for number in range(600):
        (tmp_path / f"{number}.toml").write_text(f'base = "{number + 1}.toml"')
    with pytest.raises(ConfigError, match="more than 50 files"):
        Config.load(tmp_path / "0.toml")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        Config.load(tmp_path / "none.toml")
    with pytest.raises(FileError, match="is a directory"):
        Config.load(tmp_path)
    broken = tmp_path / "broken.toml"
    broken.write_text("[run]\nduration = \n")
    with pytest.raises(ConfigError, match=r"not valid TOML.*line 2"):
        Config.load(broken)
    (tmp_path / "a.toml").write_text('base = "b.toml"')
    (tmp_path / "b.toml").write_text('base = "a.toml"')
    with pytest.raises(ConfigError, match="based on each other"):
        Config.load(tmp_path / "a.toml")


def test_a_configuration_with_changes(klein):
    config = klein()
    for changed in (
        config.replace("contacts.delay=1ms", "run.seed=5"),
        config.replace({"contacts.delay": "1 ms", "run": {"seed": 5}}),
        config.replace(contacts={"delay": 1e-3}, run={"seed": 5}),
        config.replace("contacts.delay=3ms", {"contacts.delay": 1e-3}, run={"seed": 5}),
    ):
        assert changed == klein(contacts__delay=1e-3, run__seed=5)
    assert config == klein()
    assert config.replace() == config
    assert config.replace("slider.damping=3 1/s").slider.damping_rate == 3.0
    assert config.replace("slider.kind=quasistatic").spring_stiffness == 97.0
    by_stages = config.replace(drive={"stage": [{"duration": 1.0, "velocity": 1e-6}]})
    assert by_stages.drive.velocity is None
    for change in ("contacts.delay=-1ms", "contacts.delays=1ms", "output.interval=20 s", "delay"):
        with pytest.raises(ConfigError):
            config.replace(change)


def test_no_copy_is_unchecked(klein):
    """Neither a table nor the whole; pydantic's own copy checks nothing."""
    config = klein()
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        config.contacts.model_copy(update={"delay": -1e-3})
    with pytest.raises(ConfigError, match=r"output\.interval"):
        config.model_copy(update={"output": config.output.model_copy(update={"interval": 20.0})})
    with pytest.raises(ConfigError, match=r"contacts\.delay"):
        config.model_copy(update={"contacts": config.to_dict()["contacts"] | {"delay": -1}})
    slower = config.contacts.model_copy(update={"delay": "1 ms"})
    assert config.model_copy(update={"contacts": slower}) == klein(contacts__delay=1e-3)
    assert config.model_copy() == config.model_copy(deep=True) == config


def test_a_cantilever_that_changes_takes_mass_and_stiffness_along(klein):
    rod = {"length": 0.05, "radius": 1e-3, "density": 7800.0, "young_modulus": "200 GPa"}
    slider = {"kind": "layered", "layers": 8, "cantilever": rod}
    longer = klein(slider=slider).replace("slider.cantilever.length=10 cm").slider
    assert longer == klein(slider=slider | {"cantilever": rod | {"length": 0.1}}).slider
    heavier = klein(slider=slider | {"mass": 1.0}).replace("slider.cantilever.length=10 cm").slider
    assert heavier.mass == 1.0


def test_notebooks_show_a_short_table(klein):
    shown = klein(
        title="<b>", drive={"stage": 9 * [{"duration": 1.0, "velocity": 1e-6}]}
    )._repr_html_()
    assert "&lt;b&gt;" in shown
    assert "delay = 0.0005" in shown
    assert "(9 in total)" in shown
    assert shown.count("<tr>") == 6
    assert len(shown) < 2000
    assert str(klein()) == klein().to_toml()


def test_marks_at_the_start_of_texts_are_read_over(tmp_path):
    """As editors of Windows write them, in a configuration and in a history that it names."""
    table = "time [s],displacement [um]\n0,0\n1,0.1\n"
    (tmp_path / "drive.csv").write_text(table, encoding="utf-8-sig")
    path = tmp_path / "case.toml"
    tables = klein_tables(drive={"history": {"file": "drive.csv"}}, run__duration=None)
    path.write_text(tomli_w.dumps(tables), encoding="utf-8-sig")
    assert Config.load(path).drive.history.displacement == pytest.approx((0, 1e-7))


def links_in_a_loop(path):
    path.symlink_to(path)


def much_too_long(path):
    path.touch()
    os.truncate(path, 2**27)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (os.mkfifo, "not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
        (links_in_a_loop, "Too many levels"),
        (much_too_long, "128 MiB is too large"),
        (lambda path: path.write_bytes(b"title = '\xff'"), "text in UTF-8"),
        (lambda path: path.write_text('base = "a\\u0000b"'), "name of a file"),
        (lambda path: path.write_text('base = ""'), "name of a file"),
        (lambda path: path.write_text("base = 5"), "name of a file"),
        (lambda path: path.write_text('base = "' + 300 * "a" + '"'), "name too long"),
        (lambda path: path.write_text('base = "case.toml"'), "based on each other"),
        (lambda path: path.write_text("a = " + 2000 * "["), "nested too deeply"),
        (lambda path: path.write_text("a = " + 5000 * "9"), "not valid TOML"),
    ],
)
@pytest.mark.parametrize("as_base", [False, True])
def test_no_file_breaks_the_reader(make, words, as_base, tmp_path):
    """Devices and pipes without end, loops, and what no parser can hold."""
    path = tmp_path / "case.toml"
    make(path)
    if as_base:
        path = tmp_path / "over.toml"
        path.write_text('base = "case.toml"')
    with pytest.raises(MesoslipError, match=words) as caught:
        Config.load(path)
    assert caught.value.exit_status == 2
    assert "\n" not in str(caught.value)


def test_names_that_are_no_text(tmp_path):
    with pytest.raises(FileError, match=r"\\udcff\.toml: no such file") as caught:
        Config.load(tmp_path / os.fsdecode(b"\xff.toml"))
    str(caught.value).encode()
    with pytest.raises(FileError, match="not the name of a file"):
        Config.load(tmp_path / "a\0b.toml")


@pytest.mark.parametrize(
    "value",
    [10**400, 10**5000, "1" * 400 + " kg"],
    ids=["more than doubles", "more than Python writes", "text"],
)
def test_numbers_of_many_digits(value):
    (message,) = problems(klein_tables(slider__mass=value))
    assert message.startswith("case.toml: slider.mass = ")
    assert len(message) < 300
    (message,) = problems(klein_tables(contacts__count=value))
    assert message.startswith("case.toml: contacts.count = ")
    assert len(message) < 300


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contacts__count": 2_000_000_000}, ["contacts.count", "GiB"]),
        ({"output__interval": 1e-12}, ["output.interval", "GiB"]),
        (
            {"interaction": LATTICE, "output__snapshot_size": 1},
            ["output.snapshot_size = 1", "may need", "GiB"],
        ),
        (
            {"output__slip_interval": "1 ns"},
            ["output.slip_interval = 1e-09", "may need", "GiB"],
        ),
        (
            {
                "interaction": LATTICE | {"columns": 40_000, "rows": 10_000},
                "contacts__count": 400_000_000,
            },
            ["contacts.count", "GiB"],
        ),
        (
            {
                "interaction": LATTICE | {"columns": 1000, "rows": 1000},
                "contacts__count": 1_000_000,
                "output__snapshots": [0.001 * number for number in range(12_000)],
            },
            ["output.snapshots", "12000 times", "GiB"],
        ),
    ],
)
def test_too_much_for_the_memory(klein, changes, words):
    """A configuration is valid on every machine; the start of a run is refused."""
    config = klein(**changes)
    with pytest.raises(ConfigError) as caught:
        Realization(config, 0)
    (problem,) = caught.value.problems
    for word in words:
        assert word in str(problem)


def test_snapshots_at_the_times_of_a_range(klein):
    span = {"from": "1.9 s", "to": "1.93 s", "points": 4}
    times = klein(output__snapshots=["1.5 s", span, 3.0]).output.snapshots
    assert times == pytest.approx((1.5, 1.9, 1.91, 1.92, 1.93, 3.0), rel=1e-15)


def test_memory_of_slips_and_snapshots_that_fit(klein):
    """As much as a run without trouble has: a slip in two seconds, avalanches through it all."""
    check_memory(klein(run__duration=1e4, output__slip_interval="10 us"))
    check_memory(klein(interaction=LATTICE, output__snapshot_size=1000))
    check_memory(klein(slider={"kind": "prescribed"}, output__slip_interval="1 ns"))
    check_memory(klein(interaction=LATTICE, contacts__reattach=False, output__snapshot_size=2))


BOUNDED = [
    ("run__duration", "s"),
    ("drive__velocity", "m/s"),
    ("slider__mass", "kg"),
    ("slider__stiffness", "N/m"),
    ("contacts__static_force", "N"),
    ("contacts__stiffness", "N/m"),
    ("contacts__area", "m^2"),
    ("contacts__film_thickness", "m"),
    ("contacts__film_density", "kg/m^3"),
    ("contacts__drag", "N s/m"),
    ("contacts__drag_rate", "1/s"),
    ("contacts__delay", "s"),
]


@pytest.mark.parametrize(("key", "unit"), BOUNDED)
@pytest.mark.parametrize("value", [5e-324, 1e-100, 1e100, 1e300])
def test_quantities_are_of_a_size_that_means_something(key, unit, value):
    (message,) = problems(klein_tables(**{key: value}))
    assert message.startswith(f"case.toml: {key.replace('__', '.')} = {value}: must be between")
    assert f"{unit} in size" in message


@given(st.lists(st.sampled_from(BOUNDED), unique=True), st.data())
@settings(deadline=None, max_examples=50)
def test_nothing_overflows_within_the_bounds(keys, data):
    """Klein's case with keys anywhere in their ranges is refused, or has finite quantities."""
    exponents = {key: data.draw(st.integers(-28, 25)) for key, _ in keys}
    exponents["slider__mass"] = data.draw(st.integers(-28, 25))
    tables = klein_tables(**{key: 10.0**exponent for key, exponent in exponents.items()})
    tables["contacts"]["threshold"]["law"] = data.draw(st.sampled_from(sorted(LAWS)))
    tables["contacts"]["threshold"]["relative_width"] = 10.0 ** data.draw(st.integers(-16, 2))
    tables["slider"] |= data.draw(st.sampled_from([{}, {"kind": "layered", "layers": 3}]))
    if "kind" in tables["slider"]:
        del tables["slider"]["damping_ratio"]
    try:
        config = Config.from_dict(tables)
    except ConfigError:
        return
    quantities = derived(config)
    assert {"contact_stiffness", "omega_s", "mean_life", "F_steady"} <= quantities.keys()
    for name, value in config.slider.kernel_parameters(config).items():
        assert isinstance(value, str) or math.isfinite(value), name
    for name, value in config.contact_kind.kernel_parameters(config).items():
        assert isinstance(value, str) or math.isfinite(value), name


ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from([10**400, "5 ms", "kind", b"a", date(2026, 1, 1), np.int64(3)]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["kind", "mass", "duration", "velocity", "law", "base", "x"]), inner
        )
    ),
    max_leaves=5,
)


@given(st.sampled_from(sorted(all_keys(Config))), ANYTHING, st.sampled_from([{}, LAYERED]))
@settings(deadline=None, max_examples=100)
def test_nothing_breaks_the_checks(key, value, slider):
    """Anything at any key is taken, or refused in words."""
    changes = {"slider": slider} if slider else {}
    for config in (
        lambda: Config.from_dict(klein_tables(**changes)).replace({key: value}),
        lambda: Config.from_dict(override(Merged(klein_tables(**changes)), [{key: value}]).tables),
    ):
        with contextlib.suppress(ConfigError):
            checked = config()
            assert Config.from_toml(checked.to_toml()) == checked
            checked._repr_html_()


def test_numbers_of_numpy(klein):
    config = klein(
        run__seed=np.int64(5),
        contacts__count=np.uint16(4080),
        contacts__delay=np.float32(0.5),
        slider__layers=np.int8(3),
        slider__kind="layered",
        slider__damping_ratio=None,
    )
    assert (config.run.seed, config.contacts.count, config.contacts.delay) == (5, 4080, 0.5)
    assert all(type(value) is int for value in (config.run.seed, config.slider.layers))
    assert Config.from_toml(config.to_toml()) == config
    (message,) = problems(klein_tables(contacts__count=np.float64(2.5)))
    assert "integer" in message


@pytest.mark.parametrize("law", sorted(LAWS.keys() - {"table"}))
@pytest.mark.parametrize("width", [1e-6, 1e-3, 0.3])
def test_narrow_laws_have_their_quantities(klein, law, width):
    """The steady force over that of no width is 1 + width^2/(1 - f_b^2), at first order of it."""
    config = klein(
        contacts__threshold={"law": law, "relative_width": width}, contacts__coupling="equal"
    )
    quantities = derived(config)
    assert quantities["threshold_acceptance"].value == pytest.approx(1, abs=0.05)
    if width < 0.1:
        expected = 0.5 * (1 + 0.1) * 18e-6 * (1 + width**2 / (1 - 0.1**2))
        assert quantities["F_steady"].value == pytest.approx(expected, rel=1e-9)


def test_what_a_law_does_not_have():
    law = ThresholdLaw("gaussian", 0.1)
    for probability in (2, 0.0, 1.0, math.nan, [0.5, -1]):
        with pytest.raises(MesoslipError, match="above 0 and below 1"):
            law.quantile(probability)
    assert law.quantile(0.5) == pytest.approx(1.0)
    with pytest.raises(MesoslipError, match=r"'cauchy'.*gaussian"):
        ThresholdLaw("cauchy", 0.1)


def test_tables_on_a_base(tmp_path, monkeypatch):
    """The base of nested tables is in the current folder, that of a file beside it."""
    (tmp_path / "klein.toml").write_text((ROOT / "runs" / "klein.toml").read_text())
    monkeypatch.chdir(tmp_path)
    config = Config.from_dict({"base": "klein.toml", "contacts": {"delay": "2 ms"}})
    assert config == Config.load("klein.toml", ["contacts.delay=2 ms"])
    with pytest.raises(FileError, match=r"base = .klain\.toml.: there is no such file"):
        Config.from_dict({"base": "klain.toml"})


@pytest.mark.parametrize(
    ("stages", "duration", "expected"),
    [
        ([(2.0, 1e-6), (3.0, 0.0)], None, ((2.0, 1e-6), (3.0, 0.0))),
        ([(2.0, 1e-6), (3.0, 0.0)], 1.5, ((1.5, 1e-6),)),
        ([(2.0, 1e-6), (3.0, 0.0)], 8.0, ((2.0, 1e-6), (6.0, 0.0))),
    ],
)
def test_stages_and_duration(stages, duration, expected):
    tables = klein_tables(
        run__duration=duration,
        drive=drive_in_stages(*stages),
    )
    parts = Config.from_dict(tables).drive_parts
    assert tuple((part.duration, part.start_velocity) for part in parts) == expected


def test_derived_quantities_of_klein(klein):
    """Model sections 1 and 7, the second column: what the source's own formulas give."""
    quantities = {name: one.value for name, one in derived(klein()).items()}
    expected = {
        "omega_s": 257,
        "setup_period": 0.0245,
        "omega_l": 1.17e3,
        "D1": 2.10e-3,
        "alpha": 14.2,
        "K_star_estimate": 1.8e5,
        "break_stretch": 9e-9,
    }
    for name, value in expected.items():
        assert quantities[name] == pytest.approx(value, rel=5e-3)
    prescribed = derived(klein(slider={"kind": "prescribed"}))
    assert "omega_s" not in prescribed
    assert "alpha" not in derived(klein(drive__velocity=0.0))


QUASISTATIC = {"kind": "quasistatic", "stiffness": 97.0}
SCALE = math.sqrt(97 / 1.47e-3) * 18e-6 / 97


def test_what_the_kernel_is_reported_of_sliders(klein):
    rigid = klein()
    assert rigid.slider.kernel_kind == "rigid"
    assert rigid.slider.kernel_parameters(rigid) == {
        "mass": 1.47e-3,
        "stiffness": 97.0,
        "damping": pytest.approx(0.2 * math.sqrt(97 / 1.47e-3)),
    }
    layered = klein(slider=LAYERED | {"layer_damping": 3.0, "solver": {"method": "bdf"}})
    assert layered.slider.kernel_parameters(layered) == {
        "layers": 4,
        "mass": 1e-3,
        "stiffness": 97.0,
        "damping": 3.0,
        "base_mass": 0.0,
        "base_stiffness": 0.0,
        "base_damping": 0.0,
        "solver": "bdf",
        "relative_tolerance": 1e-8,
        "absolute_tolerance": pytest.approx(1e-14 * 18e-6 / 97),
    }
    on_base = klein(slider=LAYERED | {"base": {"mass": 1.0, "stiffness": 2.0, "damping": 3.0}})
    printed = on_base.slider.kernel_parameters(on_base)
    assert [printed[f"base_{name}"] for name in ("mass", "stiffness", "damping")] == [1, 2, 3]
    block = klein(slider={"kind": "prescribed"})
    assert (block.slider.kernel_kind, block.slider.kernel_parameters(block)) == ("prescribed", {})
    quasistatic = klein(slider=QUASISTATIC)
    assert quasistatic.slider.kernel_parameters(quasistatic) == {"stiffness": 97.0}
    by_force = klein(slider={"kind": "quasistatic"}, drive={"force_rate": 1e-6})
    assert by_force.slider.kernel_kind == "quasistatic_force"
    assert by_force.slider.kernel_parameters(by_force) == {}


@pytest.mark.parametrize(
    ("slider", "slip_velocity", "spring", "traces", "solver"),
    [
        ({"mass": 1.47e-3, "stiffness": 97.0}, 0.02 * SCALE, 97.0, (), None),
        (
            LAYERED | {"mass": 1.47e-3, "base": {"mass": 1.0, "stiffness": 2.0}},
            0.02 * SCALE,
            97.0,
            ("elastic_force", "base_displacement"),
            "series",
        ),
        (LAYERED | {"mass": 1.47e-3}, 0.02 * SCALE, 97.0, ("elastic_force",), "series"),
        ({"kind": "prescribed"}, 0.0, math.inf, (), None),
        (QUASISTATIC, 0.0, 97.0, (), None),
    ],
)
def test_what_sliders_answer(klein, slider, slip_velocity, spring, traces, solver):
    config = klein(slider=slider)
    assert config.slider.slip_velocity(config) == pytest.approx(slip_velocity)
    assert config.slider.spring_stiffness == spring
    assert config.slider.extra_traces == traces
    assert config.slider.solver_name(config) == solver
    period = 2 * math.pi / math.sqrt(97 / 1.47e-3)
    quiet = period / 2 if slip_velocity else 1.0
    if "base" in slider:
        quiet = math.pi * math.sqrt((1.0 + 1.47e-3) / 2.0)
    assert config.slider.quiet_time == pytest.approx(quiet)
    assert config.slider.jumps == config.slider.ignores_delay == config.has_avalanches
    wanted = klein(slider=slider, output__slip_velocity=1e-8)
    assert wanted.slider.slip_velocity(wanted) == (1e-8 if slip_velocity else 0.0)


def test_what_the_kernel_is_reported_of_contacts(klein):
    common = {
        "count": 4080,
        "static_force": pytest.approx(18e-6 / 4080),
        "stiffness": pytest.approx(2000 / 4080),
        # rho (A/N) h eta
        "drag": pytest.approx(956 * 1e-10 / 4080 * 3.5e-9 * 2e11),
        "delay": 5e-4,
        "delay_law": "fixed",
        "back_force_ratio": 0.1,
        "newborn_width": 0.0,
        "coupling": "scaled",
        "reattach": 1,
        "threshold_law": "gaussian",
        "relative_width": 0.01,
    }
    config = klein()
    kind = config.contact_kind
    assert (kind.kernel_kind, kind.is_discrete, kind.on_lattice) == ("ensemble", True, False)
    assert kind.kernel_parameters(config) == common | {"columns": 0, "rows": 0}

    config = klein(interaction=LATTICE | {"strength": 0.0})
    kind = config.contact_kind
    assert (kind.kernel_kind, kind.is_discrete, kind.on_lattice) == ("ensemble", True, True)
    assert kind.kernel_parameters(config) == common | {"columns": 60, "rows": 68}

    config = klein(interaction=LATTICE | {"lattice": "square"})
    kind = config.contact_kind
    assert (kind.kernel_kind, kind.is_discrete, kind.on_lattice) == ("lattice", True, True)
    bond = 3 * 0.3 * 18e-6 / 4080 / math.sqrt(1e-10 / 4080)
    places = {"bond": pytest.approx(bond), "lattice": "square", "columns": 60, "rows": 68}
    assert kind.kernel_parameters(config) == common | places

    config = klein(run__engine="me")
    kind = config.contact_kind
    assert (kind.kernel_kind, kind.is_discrete, kind.on_lattice) == ("populations", False, False)
    assert kind.kernel_parameters(config) == common | {"resolution": 0.25}

    # N m eta without a film
    given = 4080 * common["drag"].expected
    film = dict.fromkeys(("area", "film_thickness", "film_density", "drag_rate"))
    config = klein(contacts=klein().to_dict()["contacts"] | film | {"drag": f"{given!r} N s/m"})
    assert config.contact_kind.kernel_parameters(config) == common | {"columns": 0, "rows": 0}

    config = klein(slider=QUASISTATIC)
    printed = config.contact_kind.kernel_parameters(config)
    assert (printed["drag"], printed["delay"]) == (0.0, 0.0)


def test_a_kind_of_slider_is_named_once():
    """The message of a kind that does not exist names those that do, and so do the others."""
    (message,) = problems(klein_tables(slider__kind="bouncy"))
    for kind in SLIDERS:
        assert f"'{kind}'" in message
    for table in SLIDER_KINDS:
        kind = table.model_fields["kind"].default
        assert SLIDERS[kind] is table
        numbers = ("mass", "stiffness", "layers", "blocks", "length", "bar_stiffness")
        keys = {"kind": kind} | dict.fromkeys(numbers, 1)
        keys = {key: value for key, value in keys.items() if key in table.model_fields}
        drive = {"force": 1e-6} if table.takes_forces else {"velocity": 1e-7}
        assert type(Config.from_dict(klein_tables(slider=keys, drive=drive)).slider) is table


def test_a_configuration_is_checked_however_it_is_made():
    tables = klein_tables(output__interval="20 s")
    message = r"configuration: output\.interval = 20\.0: must not exceed the duration"
    for make in (lambda: Config(**tables), lambda: Config.model_validate(tables)):
        with pytest.raises(ConfigError, match=message):
            make()
    with pytest.raises(ConfigError, match=r"^mine: output\.interval"):
        Config.from_dict(tables, "mine")
    assert Config(**klein_tables()) == Config.from_dict(klein_tables())


def test_a_new_kind_names_the_keys_that_it_drops(command):
    config = Config.load(KLEIN, ["slider.kind=layered", "slider.layers=4"])
    assert config.dropped == ("slider.damping_ratio",)
    assert Config.load(KLEIN, ["contacts.delay=1ms"]).dropped == ()
    assert Config.load(KLEIN).replace("slider.kind=prescribed").dropped == (
        "slider.mass",
        "slider.stiffness",
        "slider.damping_ratio",
    )
    changes = ["--set", "slider.kind=layered", "--set", "slider.layers=4"]
    _, _, printed = command("info", KLEIN, *changes)
    assert printed == 'not used with slider.kind = "layered": slider.damping_ratio\n'


def test_slips_are_recorded_finely_by_default(klein):
    """50 samples in a period of ringing, 5 in a delay; in all as many as the trace, or 20 000."""
    ringing = klein(contacts__delay="1 s")
    period = 2 * math.pi * math.sqrt(1.47e-3 / (97 + 2000))
    assert ringing.slip_interval == pytest.approx(period / 50)
    assert klein(contacts__delay="0.2 ms").slip_interval == pytest.approx(0.04e-3)
    # A slip takes two periods of the setup of the 1.86 s in which the spring is loaded.
    in_slips = 4 * math.pi * math.sqrt(1.47e-3 / 97) / (18e-6 / 97 / 1e-7)
    bounded = {"contacts__delay": "1 us", "run__duration": 12.0}
    assert klein(**bounded).slip_interval == pytest.approx(12 * in_slips / 20_000)
    bounded["output__interval"] = 0.2e-3
    assert klein(**bounded).slip_interval == pytest.approx(0.2e-3 * in_slips)
    # Slips without a pause.
    fast = {"drive__velocity": "1 mm/s", "run__duration": 10.0}
    assert klein(**fast, output__interval="1 ms").slip_interval == pytest.approx(0.5e-3)
    assert klein(**fast, output__interval="0.5 ms").slip_interval is None
    assert klein(output__interval="10 us").slip_interval is None
    assert klein(output__slip_interval=0).slip_interval is None
    assert klein(slider={"kind": "prescribed"}).slip_interval is None
    assert klein(output__slip_interval=1e-5).slip_interval == 1e-5


def test_none_removes_a_key():
    old = Config.load(KLEIN)
    assert old.output.slip_interval is not None
    assert Config.load(KLEIN, ["output.slip_interval=none"]).output.slip_interval is None
    assert old.replace({"output.slip_interval": None}).output.slip_interval is None
    # What is set after it counts; of keys that exclude each other the other one stays.
    changes = ["slider.damping_ratio=0.1", "slider.damping=none"]
    assert Config.load(KLEIN, changes).slider.damping_ratio == 0.1
    changes = ["run.seed=none", "run.seed=7"]
    assert Config.load(KLEIN, changes).run.seed == 7
    assert Config.load(KLEIN, ["run.seed=none"]).run.seed == 1
    assert Config.load(KLEIN, ["contacts.back_force_ratio=none"])
    with pytest.raises(ConfigError, match="unknown key; did you mean 'delay'"):
        Config.load(KLEIN, ["contacts.dely=none"])
    with pytest.raises(ConfigError, match=r"contacts\.count: missing"):
        Config.load(KLEIN, ["contacts.count=none"])


def test_bounds_are_distinguished_from_what_exceeds_them(klein):
    with pytest.raises(ConfigError) as error:
        klein(output__interval=0.001, output__slip_interval=math.nextafter(0.001, 1))
    value, bound = re.search(
        r"= (\S+): must not exceed the interval, (\S+) s", str(error.value)
    ).groups()
    assert float(bound) < float(value)


def test_control_characters_are_escaped(tmp_path, command):
    path = tmp_path / "case.toml"
    path.write_text('title = "x"\n"\\u001b[31mred\\u202e" = 1\n', encoding="utf-8")
    _, _, printed = command("info", path)
    assert "\\x1b[31mred\\u202e: unknown key" in printed
    assert all(one.isprintable() or one == "\n" for one in printed)


@pytest.mark.parametrize("stiffness", [97.0, 2000.0])
def test_the_expected_duration_of_a_run_that_avalanches_end(stiffness):
    """With a soft spring a break sets off others: the drive has to go so much farther."""
    tables = klein_tables(
        run={"avalanches": 3000},
        slider={"kind": "quasistatic", "stiffness": stiffness},
        contacts__count=100,
        contacts__threshold__relative_width=0.2,
        contacts__delay=0.0,
        output__interval=1e-3,
    )
    config = Config.from_dict(tables)
    tree = mesoslip.run(config)
    assert tree.attrs["ending"] == "number of avalanches reached"
    duration = float(tree["stages/stage_end_time"].values[-1])
    assert 0.5 < config.expected_duration / duration < 2


def test_many_mistakes_are_counted(tmp_path, monkeypatch):
    """Of thousands the first are described, and the file is parsed once."""
    parsed = []
    loads = tomllib.loads
    monkeypatch.setattr(tomllib, "loads", lambda text: parsed.append(text) or loads(text))
    path = tmp_path / "many.toml"
    path.write_text("".join(f"[t{number}]\n" for number in range(2000)))
    with pytest.raises(ConfigError) as raised:
        Config.load(path)
    *described, last = raised.value.problems
    assert len(described) == 50
    # Four tables are missing.
    assert last.message == f"{2004 - 50} more errors"
    assert len(parsed) == 1


def test_configurations_are_equal_whichever_derived_quantities_were_read(klein):
    one, other = klein(), klein()
    assert one.drive_parts
    assert one == other
    assert one != klein(contacts__delay="1 ms")
