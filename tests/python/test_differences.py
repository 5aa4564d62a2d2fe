"""Units in which numbers are read, and what configurations change of each other."""

import mesoslip
import pytest
import tomli_w
from conftest import ROOT, klein_tables
from mesoslip.configuration import differences
from mesoslip.configuration.units import cf_units, from_cf_units
from mesoslip.cycles.cycle import master_equation, started

KLEIN = ROOT / "runs" / "klein.toml"


@pytest.mark.parametrize(
    ("unit", "units"),
    [("N/m", "N m-1"), ("1/s", "s-1"), ("kg/m^3", "kg m-3"), ("m^2", "m2"), ("1", "1"), ("s", "s")],
)
def test_units_of_files_are_those_of_configurations(unit, units):
    assert cf_units(unit) == units
    assert from_cf_units(units) == unit


def test_a_configuration_knows_what_it_was_laid_over(tmp_path):
    plain = mesoslip.Config.load(KLEIN)
    assert plain.base is None
    changed = mesoslip.Config.load(KLEIN, ["contacts.delay=2 ms"])
    assert changed.base == plain
    assert differences.changes(changed, plain) == [("contacts.delay", ("2 ms", "500 µs"))]
    (tmp_path / "mine.toml").write_text(f'base = "{KLEIN}"\n[slider]\nmass = "2 g"\n')
    mine = mesoslip.Config.load(tmp_path / "mine.toml", ["run.seed=7"])
    assert mine.base == plain
    assert differences.changes(mine, plain) == [
        ("slider.mass", ("2 g", "1.47 g")),
        ("run.seed", ("7", "1")),
    ]
    assert plain.replace("run.seed=3").base == plain
    # What it was laid over is of no consequence.
    assert plain.replace("run.seed=3") == mesoslip.Config.load(KLEIN, ["run.seed=3"])
    assert plain.replace("run.seed=3").replace("run.seed=1") == plain
    assert len({plain, plain.replace("run.seed=1"), mine}) == 2


def test_a_base_that_cannot_be_run_by_itself_is_none(tmp_path):
    (tmp_path / "part.toml").write_text("[run]\nduration = 1\n")
    tables = klein_tables()
    del tables["run"]
    (tmp_path / "whole.toml").write_text('base = "part.toml"\n' + tomli_w.dumps(tables))
    assert mesoslip.Config.load(tmp_path / "whole.toml").base is None


def test_an_output_reports_what_its_run_changes(tmp_path, command):
    config = mesoslip.Config.load(KLEIN, ["run.duration=1 ms", "output.interval=1 ms"])
    tree = mesoslip.run(config)
    assert mesoslip.Config.from_toml(tree.attrs["base_configuration"]) == config.base
    # Also when it is run again, unless something is changed then.
    first, again, other = (tmp_path / f"{name}.nc" for name in ("first", "again", "other"))
    changes = ("--set", "run.duration=1 ms", "--set", "output.interval=1 ms")
    assert command("run", KLEIN, "-o", first, "--quiet", *changes)[0] == 0
    assert command("run", first, "-o", again, "--quiet")[0] == 0
    assert command("run", first, "-o", other, "--quiet", "--set", "run.seed=2")[0] == 0
    bases = [
        mesoslip.open_output(path).attrs["base_configuration"] for path in (first, again, other)
    ]
    assert bases[0] == bases[1] == tree.attrs["base_configuration"]
    assert bases[2] == tree.attrs["configuration"]


def test_labels_name_what_differs(klein):
    slow, fast = klein(contacts__delay=1e-3), klein(contacts__delay=1e-4, run__seed=2)
    assert differences.labels([slow, fast], ["a", "b"]) == [
        "contacts.delay = 1 ms",
        "contacts.delay = 100 µs",
    ]
    # What is computed counts where nothing else differs, names where nothing does.
    assert differences.labels([klein(), klein(run__seed=2)], ["a", "b"]) == [
        "run.seed = 1",
        "run.seed = 2",
    ]
    assert differences.labels([klein(), klein()], ["a", "b"]) == ["a", "b"]
    labels = differences.labels([slow, fast, fast], ["a", "b", "c"])
    assert labels == [
        "contacts.delay = 1 ms",
        "b: contacts.delay = 100 µs",
        "c: contacts.delay = 100 µs",
    ]


def test_stages_are_reported(klein):
    stages = [{"duration": 4, "velocity": 1e-7}, {"duration": 1, "velocity": 0}]
    turned = klein(drive={"stage": stages})
    (change,) = differences.changes(turned, klein())
    assert change == ("drive.stage", ("[(4 s, 100 nm/s), (1 s, 0 m/s)]", differences.MISSING))


def test_changes_of_the_program_are_none_of_the_user(tmp_path):
    """A cycle, which is of the master equation, and a trace with its own duration, differ from
    their bases in what was set."""
    (tmp_path / "mine.toml").write_text(f'base = "{KLEIN}"\n[slider]\nstiffness = "300 N/m"\n')
    changed = mesoslip.Config.load(KLEIN, ["slider.stiffness=300 N/m"])
    for config in (changed, mesoslip.Config.load(tmp_path / "mine.toml")):
        cycle = master_equation(config)
        measured = config.adapted(lambda one: one.replace({"run.duration": 14.0}))
        stiffer = ("slider.stiffness", ("300 N/m", "97 N/m"))
        for one in (cycle, started(cycle, "steady")):
            assert differences.changes(one, one.base) == [stiffer]
        assert differences.changes(measured, measured.base) == [stiffer]
    assert master_equation(mesoslip.Config.load(KLEIN)).base is None


def test_a_title_of_the_base_is_none_of_ones_own(tmp_path):
    (tmp_path / "mine.toml").write_text(f'base = "{KLEIN}"\n')
    mine = mesoslip.Config.load(tmp_path / "mine.toml")
    assert mine.own_title is None
    assert mine.title == mesoslip.Config.load(KLEIN).own_title
    assert mine.replace("title=Mine").own_title == "Mine"
