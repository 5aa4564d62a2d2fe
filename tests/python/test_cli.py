"""The command line: what it makes, and one clear message for every mistake."""

import contextlib
import csv
import json
import math
import os
import re
import signal
import sys

import mesoslip
import mesoslip.__main__ as program
import numpy as np
import pytest
import tomli_w
import xarray as xr
from conftest import ROOT, klein_tables, long, python, run_program
from mesoslip.analysis.regime import outputs
from mesoslip.command_line.main import COMMANDS, GROUPS, app
from mesoslip.command_line.progress import say
from mesoslip.errors import RunError
from mesoslip.output.writing import write
from typer.main import get_command

pytestmark = pytest.mark.usefixtures("quick_pictures")


# A run of no time, up to and beyond the first slip.
SHORT = klein_tables(contacts__count=50, run__duration=2.2, output__slip_interval=1e-3)


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(tomli_w.dumps(SHORT))
    return path


@pytest.fixture(scope="module")
def damaged(tmp_path_factory):
    """A folder with an output, part of one, and files that are none; commands leave it as it is."""
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "short.toml").write_text(tomli_w.dumps(SHORT))
    (folder / "broken.toml").write_text("[run]\nduration = = 3\n")
    xr.Dataset({"a": 1}).to_netcdf(folder / "other.nc")
    write(mesoslip.run(SHORT), folder / "good.nc")
    (folder / "truncated.nc").write_bytes((folder / "good.nc").read_bytes()[:20000])
    return folder


# Of a force curve that is computed soon.
WIDE = ("--set", "contacts.threshold.relative_width=0.1")


def test_run_writes_a_cf_file(short, tmp_path, command):
    output = tmp_path / "deep" / "short.nc"
    printed = command.messages("run", short, "-o", output, "--set", "run.realizations=2")
    assert str(output) in printed
    assert [path.name for path in output.parent.iterdir()] == ["short.nc"]
    with xr.open_datatree(output) as tree:
        tree = tree.load()
    assert tree.sizes == {"realization": 2, "time": 2201}
    for node in tree.subtree:
        for name, variable in node.variables.items():
            assert "units" in variable.attrs, name
    assert tree.attrs["Conventions"].startswith("CF")
    assert tree.attrs["seed"] == 1
    for name in ("configuration", "program_version", "commit", "compiler", "library_versions"):
        assert tree.attrs[name]
    assert set(tree["slips"].data_vars) == {
        "realization_index",
        "start_time",
        "end_time",
        "force_before",
        "force_after",
        "force_drop",
        "peak_velocity",
        "contacts_broken",
    }
    in_memory = mesoslip.run(
        {
            **klein_tables(
                contacts__count=50,
                run__duration=2.2,
                run__realizations=2,
                output__slip_interval=1e-3,
            )
        }
    )
    for name in tree.data_vars:
        if name != "kernel_seconds":
            np.testing.assert_array_equal(tree[name].values, in_memory[name].values)


def test_an_output_can_be_run_again(short, tmp_path, command):
    first, second = tmp_path / "first.nc", tmp_path / "second.nc"
    assert command("run", short, "-o", first, "--set", "contacts.delay=1ms")[0] == 0
    assert command("run", first, "-o", second, "--quiet") == (0, "", "")
    one, other = mesoslip.open_output(first), mesoslip.open_output(second)
    np.testing.assert_array_equal(one["spring_force"].values, other["spring_force"].values)
    assert one.attrs["configuration"] == other.attrs["configuration"]


def test_info(command):
    out = command.output("info", ROOT / "runs" / "klein.toml", "--json")
    assert json.loads(out)["omega_s"] == pytest.approx(256.88, rel=1e-4)
    out = command.output(
        "info",
        *(ROOT / "runs" / "klein.toml", "--all", "--set", "slider.mass=1kg"),
        *("--set", "output.slip_interval=10ps"),
    )
    assert "setup frequency" in out
    # A machine that cannot run it can still describe it.
    assert "output.slip_interval = 1e-11: the run may need" in out


def test_info_prints_the_overview_first(short, tmp_path, command):
    """Force, stiffness, times and breaks; the rest with --all. Sliding steadily, each contact
    breaks once in its mean life: prescribed motion has as many breaks as are estimated."""
    options = ("--set", "contacts.delay=0", "--set", "contacts.initial=steady")
    options += ("--set", "slider.kind=prescribed", "--set", "output.interval=0.1 s")
    brief, complete = (command("info", short, *options, *more)[1] for more in ((), ("--all",)))
    names = [line.split()[0] for line in brief.splitlines() if line[:1].isalpha()]
    assert names == ["static_force", "K_star_estimate", "F_steady_drive", "contact_breaks"]
    lines = {line.split()[0]: line.split() for line in complete.splitlines()}
    assert list(lines)[: len(names)] == names
    assert "mean_life" in lines
    assert f"{len(json.loads(command('info', short, *options, '--json')[1])) - 2} more" in brief
    assert "--all" not in complete
    assert command("run", short, *options, "-o", tmp_path / "steady.nc", "--quiet")[0] == 0
    counted = mesoslip.open_output(tmp_path / "steady.nc")["breaks"].values.sum()
    assert float(lines["contact_breaks"][1]) == pytest.approx(counted, rel=0.02)


@pytest.mark.parametrize("error", [MemoryError(), RunError("a table cannot be read")])
def test_whatever_prevents_the_output_the_results_are_kept(
    short, tmp_path, command, monkeypatch, error
):
    def fails(*_, **__):
        raise error

    path = tmp_path / "out.nc"
    with monkeypatch.context() as broken:
        broken.setattr("mesoslip.output.writing.write_results", fails)
        status, _, message = command("run", short, "-o", path, "--quiet")
    assert status == 2
    assert "with --resume writes the output" in message.replace("\n", " ")
    assert command("run", short, "-o", path, "--quiet", "--resume")[0] == 0
    assert mesoslip.open_output(path)["breaks"].values.sum() > 0


def test_the_help_groups_all_commands_and_cuts_no_description(monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    out = command.output("--help")
    titles = re.findall(r"^(\w[\w ]*):$", out, re.MULTILINE)
    assert titles == ["Options", *GROUPS]
    lines = [line.split() for line in out.partition("Simulate:")[2].splitlines()]
    listed = {words[0]: " ".join(words[1:]) for words in lines if len(words) > 2}
    assert listed.keys() == {one.__name__.replace("_", "-") for one in COMMANDS}
    assert not {name: text for name, text in listed.items() if not re.search(r"[^.]\.$", text)}
    assert max(map(len, out.splitlines())) <= 80


def test_slips(short, tmp_path, command):
    output, table = tmp_path / "out.nc", tmp_path / "slips.csv"
    command("run", short, "-o", output, "--quiet")
    catalogue = json.loads(command.output("slips", output, "--json", "--csv", table))
    assert len(catalogue["slips"]) >= 1
    with table.open() as file:
        rows = list(csv.reader(file))
    assert rows[0][1] == "start_time [s]"
    assert len(rows) == 1 + len(catalogue["slips"])
    assert "1 slip" in command("slips", output)[1]
    command("run", short, "-o", output, "--quiet", "--set", "run.duration=1s")
    assert command("slips", output)[1].endswith("0 slips\n")
    assert command("plot", output)[0] == 0


def test_of_many_rows_the_first_and_the_last_are_printed(tmp_path, command, monkeypatch):
    output = tmp_path / "run.nc"
    many = ("--set", "run.realizations=5", "--set", "contacts.count=100", "--quiet")
    assert command("run", ROOT / "runs" / "klein.toml", "-o", output, *many)[0] == 0
    limit = "mesoslip.command_line.catalogues."
    monkeypatch.setattr(f"{limit}MANY", 1000)
    all_lines = command("slips", output)[1].splitlines()
    count = next(one for one, line in enumerate(all_lines) if line.endswith("--csv FILE")) - 1
    regimes = command("regime", output)[1]
    assert all(f"realization {number}\n" in regimes for number in range(5))
    for name, value in (("MANY", 4), ("FIRST", 2), ("LAST", 1)):
        monkeypatch.setattr(limit + name, value)
    lines = command("slips", output)[1].splitlines()
    rows = [line.split() for line in lines]
    assert rows[1:3] == [line.split() for line in all_lines[1:3]]
    assert set(rows[3]) == {"…"}
    assert rows[4] == all_lines[count].split()
    assert lines[5] == f"{count} slips: the first 2 and the last 1; all with --csv FILE"
    regimes = command("regime", output)[1]
    assert [f"realization {one}\n" in regimes for one in range(5)] == [
        True,
        True,
        False,
        False,
        True,
    ]
    assert "… (2 others, all with --json)" in regimes


def test_a_table_for_a_paper_is_not_one_of_dashes(short, tmp_path, command):
    """A run in one stage has a steady force, and nothing that rate and state could fit."""
    output = tmp_path / "run.nc"
    assert command("run", short, "-o", output, "--quiet")[0] == 0
    assert "no data for a, b and D_c" in command("response", output)[1]
    printed = command("response", output, "--latex")[1]
    assert "steady force &" in printed
    assert "verdict" not in printed


def test_an_interrupt_after_the_output_is_written_is_answered_at_once(
    short, tmp_path, command, monkeypatch
):
    """Regimes of many short realizations take longer than their runs, and can be had later."""
    output, judged = tmp_path / "run.nc", []
    classify = outputs.classify

    def classify_once(*arguments):
        judged.append(arguments)
        os.kill(os.getpid(), signal.SIGINT)
        return classify(*arguments)

    monkeypatch.setattr(outputs, "classify", classify_once)
    many = ("--set", "run.realizations=20", "--set", "run.duration=0.1 s")
    err = command.messages("run", short, "-o", output, *many)
    assert len(judged) == 1
    assert f"{output}: complete; 'mesoslip regime {output}' prints the regime\n" in err
    assert list(tmp_path.glob("run.*")) == [output]
    monkeypatch.undo()
    assert command("regime", output)[1].count("realization ") == 20


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("strokes", "--json", "--latex"), "--latex: does not go with --json: give one format"),
        (("plateaus", "--latex", "--json"), "--json: does not go with --latex"),
        (("response", "--markdown", "--latex"), "--latex: does not go with --markdown"),
        (("response", "--posterior", "--json", "--markdown"), "--markdown: does not go with"),
    ],
)
def test_one_format_is_printed_at_a_time(arguments, message, command):
    """Before the output is read; twice the same is one."""
    status, printed, err = command(*arguments, "nowhere.nc")
    assert (status, printed) == (2, "")
    assert message in err
    assert "nowhere.nc: " in command(arguments[0], "--json", "--json", "nowhere.nc")[2]


def test_all_formats_are_refused_beside_others():
    """Flags of formats are those of `format_option`."""
    flags = [
        parameter
        for command in get_command(app).commands.values()
        for parameter in command.params
        if {"--json", "--latex", "--markdown"} & set(parameter.opts)
    ]
    assert len(flags) > 15
    assert all(one.callback is not None for one in flags)


def test_all_that_takes_a_while_reports_its_progress(tmp_path, command, monkeypatch):
    """Where there is no terminal too: writing after the run, measured traces, movies; and a large
    output before the run."""
    monkeypatch.setattr("mesoslip.command_line.progress.PATIENCE", -1.0)
    monkeypatch.setattr("mesoslip.command_line.run.LARGE", 1e5)
    # xarray has seen Dask in other tests.
    monkeypatch.setattr("mesoslip.command_line.pictures.hidden", contextlib.nullcontext)
    output, table = tmp_path / "run.nc", tmp_path / "a.csv"
    small = ("--set", "contacts.count=100", "--set", "run.duration=2 s")
    quick = (*small, "--set", "output.snapshots=['0 s', '1 s']")
    _, _, err = command("run", ROOT / "runs" / "klein.toml", "-o", output, *quick)
    assert "simulating: 100 % after 0 s\n" in err
    assert "writing: 100 % after 0 s\n" in err
    size = float(re.search(r"the output will take about (\S+) GB", err)[1])
    assert output.stat().st_size == pytest.approx(1e9 * size, rel=0.3)
    err = command("plot", output, "-o", tmp_path / "contacts.gif", "--view", "contacts")[2]
    assert "drawing: 50 %" in err
    assert "drawing: 100 %" in err
    rows = "".join(f"{0.01 * n:.2f},{3 + n % 9 / 9:.4f}\n" for n in range(300))
    table.write_text(f"time [s],force [N]\n{rows}")
    err = command("trace", table, "-o", tmp_path / "trace.nc")[2]
    steps = re.findall(r"after \d+ s: (.*)", err)
    assert steps == ["reading", "estimating the noise", "looking for slips", "writing"]


def test_start_up_is_quick():
    """No package that takes long is imported before it is needed."""
    python(
        "import sys, mesoslip.command_line.main, mesoslip.theory.derived\n"
        "slow = {'matplotlib', 'scipy', 'xarray', 'netCDF4', 'pint', 'rich'} & sys.modules.keys()\n"
        "assert not slow, slow"
    )


def test_commands_import_what_they_need(short, tmp_path, command):
    """Large packages that each of several commands adds to those imported before."""
    output = tmp_path / "short.nc"
    command("run", short, "-o", output, "--quiet")
    steps = tmp_path / "steps.nc"
    fewer = ("--set", "contacts.count=200", "--set", "output.interval=5 ms")
    command("run", ROOT / "runs" / "velocity-step.toml", *fewer, "-o", steps, "--quiet")
    study = tmp_path / "study.toml"
    study.write_text(
        'base = "short.toml"\n[sweep]\nmeasures = ["mean_force"]\n'
        '[sweep.grid]\n"run.seed" = [1, 2]\n'
    )
    commands = [
        ["info", str(short)],
        ["plot", "--help"],
        ["run", str(short), "-o", str(tmp_path / "again.nc"), "--quiet"],
        ["slips", str(output), "--json"],
        ["curve", str(short), "--set", "curve.length=10 nm"],
        ["slips", str(output)],
        ["regime", str(output)],
        ["plot", str(output), "-o", str(tmp_path / "short.png")],
        ["report", str(output), "-o", str(tmp_path / "short.html")],
        ["response", str(steps), "--no-fit"],
        ["sweep", str(study), "-o", str(tmp_path / "study.nc"), "--pool", "threads", "--quiet"],
    ]
    code = f"""
import json, sys
from mesoslip.analysis.regime import outputs
from mesoslip.command_line.main import main
large = ["dask", "matplotlib", "mpl_toolkits.mplot3d", "netCDF4", "pandas", "pint", "xarray"]
large += [f"scipy.{{one}}" for one in ("integrate", "interpolate", "optimize", "special", "stats")]
stdout, found = sys.stdout, []
for arguments in {commands}:
    before, sys.argv = set(sys.modules), ["mesoslip", *arguments]
    with open({str(tmp_path / "printed")!r}, "w") as sys.stdout:
        try:
            main()
        except SystemExit as end:
            assert not end.code, end.code
    found.append([one for one in large if one in sys.modules and one not in before])
import dask.array, pint
json.dump(found, stdout)
"""
    assert json.loads(python(code)) == [
        [],
        [],
        ["netCDF4"],
        [],
        ["scipy.interpolate", "scipy.optimize", "scipy.special"],
        [],
        [],
        ["matplotlib"],
        [],
        [],
        ["pandas", "xarray"],
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "none.toml"], ["none.toml", "no such file"]),
        (["run", "."], ["directory"]),
        (["run", "short.toml", "--set", "slider.stifness=1"], ["stifness", "stiffness"]),
        (["run", "short.toml", "--set", "slider.mass=97 N"], ["slider.mass", "1.47 g"]),
        (["run", "short.toml", "--set", "slider.mass=-1 g"], ["slider.mass", "greater than 0"]),
        (["run", "short.toml", "--set", "slider.mass=nan"], ["slider.mass", "finite"]),
        (["run", "short.toml", "--set", "contacts.count=0"], ["contacts.count"]),
        (["run", "short.toml", "-o", "."], ["directory"]),
        (["run", "short.toml", "-o", "short.toml/out.nc"], ["short.toml/out.nc", "written"]),
        (["run", "broken.toml"], ["broken.toml", "line 2"]),
        (["run", "short.toml", "--workers", "0"], ["--workers"]),
        (["run", "short.toml", "--fast"], ["--fast"]),
        (["runn", "short.toml"], ["runn"]),
        (["run"], ["CONFIG"]),
        (["info", "none.toml"], ["none.toml", "no such file"]),
        (["plot", "truncated.nc"], ["truncated.nc", "netCDF"]),
        (["plot", "short.toml"], ["short.toml", "netCDF"]),
        (["plot", "other.nc"], ["other.nc", "not an output"]),
        (["plot", "none.nc"], ["none.nc", "no such file"]),
        (["plot", "good.nc", "-o", "picture.xyz"], ["picture.xyz", "xyz"]),
        (["slips", "truncated.nc"], ["truncated.nc"]),
        (["run", "truncated.nc"], ["truncated.nc"]),
        (["slips", "good.nc", "--csv", "."], ["written"]),
        (["response", "good.nc", "./good.nc"], ["good.nc: is given twice"]),
        (["trace", "a.csv", "b.csv", "a.csv", "-o", "x.nc"], ["a.csv: is given twice"]),
        (["fit", "good.nc", "good.nc", "short.toml", "-o", "x.nc"], ["good.nc: is given twice"]),
    ],
)
def test_mistakes(arguments, words, damaged, command, monkeypatch):
    monkeypatch.chdir(damaged)
    before = sorted(damaged.rglob("*"))
    status, out, printed = command(*arguments)
    assert status == 2
    assert out == ""
    for word in words:
        assert word in printed
    assert sorted(damaged.rglob("*")) == before


def test_curve_reports_the_instability(short, tmp_path, command):
    output = tmp_path / "curve.nc"
    changes = ("--set", "curve.density_at=[3e-9]", "--set", "curve.drive_displacement=50 nm")
    summary = json.loads(command.output("curve", short, "-o", output, "--json", *changes))
    for name in ("K_star", "X_c", "F_peak", "F_steady", "D0", "D1", "D2", "D3", "stable", "digits"):
        assert name in summary
    tree = mesoslip.open_output(output)
    for node in tree.subtree:
        for name, variable in node.variables.items():
            assert "units" in variable.attrs, name
    assert tree.attrs["K_star"] == summary["K_star"]
    assert tree["critical"].sizes["point"] >= 2
    assert "potential" in tree.data_vars
    assert tree["stretch_density"]["unbroken_part"].values[0] == pytest.approx(1, abs=1e-9)
    printed = command.output("curve", short, *WIDE, "--set", "curve.length=27 nm")
    assert "K_star_estimate" in printed
    assert command("plot", output)[0] == 0
    assert output.with_suffix(".png").exists()


def test_a_stiff_spring_has_an_answer(short, command):
    summary = json.loads(
        command.output("curve", short, "--json", "--set", "slider.stiffness=1e6", *WIDE)
    )
    assert summary["stable"] is True
    assert summary["X_c"] is None
    printed = command.output("onset", short, "--set", "slider.stiffness=1e6", *WIDE)
    assert "no onset" in printed


def test_onset_writes_both_equations(short, tmp_path, command):
    output = tmp_path / "onset.nc"
    near = ("--set", "curve.length=27 nm")
    printed = command.output("onset", short, "-o", output, "--json", *near)
    assert json.loads(printed)["alpha"] == pytest.approx(14.2, abs=0.1)
    assert set(mesoslip.open_output(output).children) == {"sequential", "melting"}
    assert command("plot", output)[0] == 0


def test_the_master_equation_runs_like_contacts(short, tmp_path, command):
    output = tmp_path / "me.nc"
    printed = command.messages("run", short, "-o", output, "--set", "run.engine=me")
    assert "1 slip; " in printed
    assert command("slips", output)[0] == 0
    assert command("plot", output)[0] == 0
    detached = mesoslip.open_output(output)["detached_contacts"].values
    assert np.any(detached % 1 > 0)


def test_a_curve_has_no_slips(short, tmp_path, command):
    output = tmp_path / "curve.nc"
    assert command("curve", short, "-o", output, *WIDE)[0] == 0
    printed = command.refusal("slips", output)
    assert "not an output of mesoslip run" in printed


def test_json_has_no_number_that_is_not_finite(capsys):
    """Such as a verdict that cannot be computed: null, which every reader of JSON knows."""
    from mesoslip.command_line.options import print_json

    print_json({"a": [1.5, math.nan, (math.inf,)], "b": {"c": -math.inf, "d": None, "e": True}})
    printed = json.loads(capsys.readouterr().out)
    assert printed == {"a": [1.5, None, [None]], "b": {"c": None, "d": None, "e": True}}


def test_messages_name_what_would_be_right(short, tmp_path, command):
    table, output = tmp_path / "trace.csv", tmp_path / "out.nc"
    table.write_text("time [s],force [uN]\n0,0\n1,1\n2,2\n3,3\n")
    assert "mesoslip trace" in command("slips", table)[2]
    assert command("run", short, "-o", output)[0] == 0
    _, _, refused = command("trace", output, "-o", tmp_path / "other.nc")
    assert "is an output of mesoslip, not a file of a measurement" in refused
    # Whose result is lost is printed.
    printed = command("run", short, "-o", output, "--set", "run.seed=7")[2]
    assert "the output of another configuration will be replaced" in printed
    assert "replaces" not in command("run", short, "-o", output, "--set", "run.seed=7")[2]
    for name in ("out.csv", "out.png"):
        printed = command.refusal("run", short, "-o", tmp_path / name)
        assert f"use {output}" in printed
    assert "there is no sample from 70 s on" in command("plot", output, "--from", "70 s")[2]
    # Plain numbers are in SI, in options as in --set.
    assert "there is no sample from 70 s on" in command("plot", output, "--from", "70")[2]
    still = ("--set", "drive.velocity=1e-12", "-o", tmp_path / "still.nc")
    printed = command("run", short, *still)[2]
    assert "no contact broke: the path of the drive is 2.2 pm, and F_s/K is 185.6 nm" in printed
    cycle = "drive.cycle={amplitude='1 nm', cycles=1, velocity='0.1 um/s'}"
    strokes = ("--set", "drive.velocity=none", "--set", cycle, "-o", tmp_path / "strokes.nc")
    # A longer run would show no regime.
    assert f"'mesoslip strokes {tmp_path / 'strokes.nc'}'" in command("run", short, *strokes)[2]
    lost = tmp_path / "lost.toml"
    lost.write_text('base = "nothing.toml"\n')
    printed = command.refusal("info", lost)
    assert "lost.toml: base = 'nothing.toml': there is no such file;" in printed
    lost.write_text("[slider]\nstiffness = 97 N/m\n")
    assert 'quotes, as in "97 N/m"' in command("info", lost)[2]
    assert "mesoslip example lists them" in command("example", "mine")[2]
    assert "Usage" in command("run", "-h")[1]


def test_a_drive_that_the_run_cuts_is_reported(short, tmp_path, command):
    stages = tmp_path / "stages.toml"
    stage = '[[drive.stage]]\nvelocity = "1 um/s"\nduration = "1 s"\n'
    stages.write_text(f'base = "{short}"\n{3 * stage}[drive]\nrepeat = 2\n')
    cut = ("--set", "run.duration=2.5 s")
    printed = "run.duration ends the run after 2.5 s of a drive of 6 s, in stage 3 of 6"
    assert printed in command("info", stages, *cut)[1]
    assert f"warning: {printed}" in command("run", stages, *cut, "-o", tmp_path / "cut.nc")[2]
    whole = command("info", stages, "--set", "run.duration=6 s")[1]
    assert "ends the run" not in whole
    assert "continues" not in whole
    printed = "the stages end after 6 s: the last one continues for another 3 s, until run.duration"
    assert printed in command("info", stages, "--set", "run.duration=9 s")[1]


def test_an_ending_that_is_not_reached_is_reported(short, tmp_path, command):
    """The drive moves 0.22 µm, and the spring holds 0.19 µm at most: 1 mm is out of reach."""
    far = ("--set", "run.stop.displacement=1 mm", "-o", tmp_path / "far.nc")
    printed = command("run", short, *far)[2]
    assert re.search(r"before run.stop.displacement was reached: .* of 1 mm", printed)
    assert "out of reach: the drive moves" in command("info", short, *far[:2])[1]
    near = ("--set", "run.stop.displacement=5 nm", "-o", tmp_path / "near.nc")
    printed = command("run", short, *near)[2]
    assert "displacement of the slider reached" in printed
    assert "warning" not in printed
    assert "out of reach" not in command("info", short, *near[:2])[1]
    many = ("--set", "run.stop.slips=9", "--set", "run.realizations=2", "-o", tmp_path / "many.nc")
    printed = command("run", short, *many)[2]
    assert "the drive ended before run.stop.slips was reached in 2 realizations" in printed


def test_printed_digits_are_those_that_a_number_deserves(short, command):
    """Four of what follows from keys; of a curve as many as its error leaves; two of errors."""
    printed = command("info", short, "--all")[1]
    lines = {line.split()[0]: line.split() for line in printed.splitlines()}
    assert lines["omega_s"][1:3] == ["256.9", "1/s"]
    rough = ("--set", "contacts.threshold.law=uniform")
    status, printed, warning = command("curve", short, *rough)
    assert status == 0
    assert "digits" in warning
    lines = {line.split()[0]: line.split() for line in printed.splitlines()}
    assert len(lines["K_star"][1].replace(".", "")) <= 4
    assert re.fullmatch(r"\d(\.\d)?e-\d+", lines["error"][1])


def test_help_lists_the_views(command):
    printed = " ".join(command("plot", "--help")[1].split())
    for part in ("Of a run: run (force, velocity", "steady forces, velocity steps", "of a measure"):
        assert part in printed


def test_whole_numbers_may_have_an_exponent(short, command):
    printed = command.output("info", short, "--set", "contacts.count=1e3", "--json")
    other = command("info", short, "--set", "contacts.count=1000", "--json")[1]
    assert printed == other
    assert "integer" in command("info", short, "--set", "contacts.count=1.5e0")[2]


@pytest.mark.parametrize(
    "arguments",
    [
        ("example", "klein", "-o", "{}.toml"),
        ("run", ROOT / "runs" / "klein.toml", "-o", "{}.nc"),
        ("slips", "{}.nc"),
        ("plot", "{}.nc"),
        ("report", "{}.nc"),
        ("info", "{}.toml"),
    ],
)
def test_a_name_too_long_for_the_system_is_one_message(arguments, command):
    name = 300 * "x"
    message = command.refusal(*(str(one).format(name) for one in arguments))
    assert message.startswith(f"mesoslip: {name}")
    assert message.count("\n") == 1
    assert "File name too long" in message


def test_messages_do_not_steer_the_terminal(capsys):
    say("out\x1b[2J.nc: a slip\nand another one")
    assert capsys.readouterr().err == "out\\x1b[2J.nc: a slip\nand another one\n"


@pytest.mark.parametrize(
    ("module", "content"),
    [
        ("plots.style", b"\xff\xfe: \x80\n"),
        *(long(one, b"text.usetex: True\n") for one in ("plots.style", "reports.content")),
        long("reports.content", b"\xff\xfe: \x80\n"),
    ],
)
def test_a_matplotlibrc_of_the_current_folder_is_not_read(module, content, tmp_path):
    (tmp_path / "matplotlibrc").write_bytes(content)
    code = f"import mesoslip.{module}, matplotlib; assert not matplotlib.rcParams['text.usetex']"
    done = run_program(sys.executable, "-c", code, cwd=tmp_path)
    assert done == (0, "", "")


@pytest.mark.parametrize("module", ["lazy_loader", "mesoslip.command_line.main", "typer"])
def test_an_interrupted_start_ends_without_a_traceback(module):
    code = f"""
import os, runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Interrupt:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
sys.argv = ["/usr/bin/mesoslip", "--version"]
runpy.run_module("mesoslip", run_name="__main__")
"""
    assert run_program(sys.executable, "-c", code) == (130, "", "")


def test_nothing_is_imported_before_interrupts_are_caught():
    code = "import sys; sys.argv = ['/usr/bin/mesoslip']; import mesoslip"
    _, _, timed = run_program(sys.executable, "-I", "-X", "importtime", "-c", code)
    names = [one.rpartition("|")[2].strip() for one in timed.splitlines()]
    assert names[names.index("site") + 1] == "mesoslip._start"


def test_an_interrupt_behind_another_error_ends_the_program(monkeypatch):
    """Such as in the names of a class, where Python raises an error of its own."""

    def interrupted():
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise RuntimeError from error

    monkeypatch.setattr(program, "main", interrupted)
    with pytest.raises(SystemExit, match="130"):
        program.start()
