"""What comes with the program: its runs in the wheel, and what a missing library reports."""

import sys
from importlib.metadata import files

import mesoslip
import pytest
from conftest import ROOT, python, run_program
from mesoslip import examples


def tracked(folder):
    """Files of the repository in a folder."""
    status, listed, errors = run_program("git", "ls-files", folder, cwd=ROOT)
    assert status == 0, errors
    return [line for line in listed.splitlines() if (ROOT / line).exists()]


def is_example(path):
    """Whether a file is a run that the program brings: not one of the source's."""
    is_data = path.startswith("runs/measured/") or path == "runs/fit/experiment.csv"
    return is_data or (path.endswith(".toml") and not path.startswith("runs/source/"))


def test_the_wheel_has_all_that_is_needed():
    """Its record: every file of the package, the kernels, and the examples, nothing else."""
    there = {str(one) for one in files("mesoslip")}
    for path in tracked("python/mesoslip"):
        if path.endswith((".py", ".pyi", ".html", "py.typed")):
            assert path.removeprefix("python/") in there, path
    runs = {one.removeprefix("mesoslip/") for one in there if one.startswith("mesoslip/runs/")}
    assert runs == {one for one in tracked("runs") if is_example(one)}
    files_of_runs = {one for one in runs if one.endswith(".toml")}
    assert files_of_runs == {f"runs/{name}.toml" for name in examples.examples()}
    assert any(one.startswith("mesoslip/_core.") and one.endswith(".so") for one in there)
    assert any(one.endswith("licenses/LICENSE") for one in there)
    # Nothing of others.
    assert all(one.startswith(("mesoslip", "../../../bin/")) for one in there)


def test_the_source_archive_leaves_no_run_out():
    attributes = ROOT / ".gitattributes"
    assert not attributes.exists() or "export-ignore" not in attributes.read_text()
    assert "runs/klein.toml" in tracked("runs")


@pytest.mark.parametrize("name", ["klein", "avalanche", "velocity-step"])
def test_an_example_is_the_run_of_the_repository(name, tmp_path):
    written = mesoslip.example(name, tmp_path / "new" / "mine.toml")
    assert written[0] == tmp_path / "new" / "mine.toml"
    own = mesoslip.Config.load(written[0])
    assert own == mesoslip.Config.load(ROOT / "runs" / f"{name}.toml")
    assert written[0].read_text() == (ROOT / "runs" / f"{name}.toml").read_text()
    assert {one.name for one in written[1:]} == {
        "klein": set(),
        "avalanche": {"klein.toml"},
        "velocity-step": {"klein.toml"},
    }[name]


def test_every_example_is_listed_with_its_title(command):
    shown = command.output("example")
    assert "klein" in shown
    assert "Klein 2007: OMCTS between mica" in shown
    assert all(title for title in examples.examples().values())


def test_an_example_overwrites_nothing(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "klein.toml").write_text("mine")
    errors = command.refusal("example", "klein")
    assert "klein.toml: exists already" in errors
    # What it is based on is there, and stays.
    assert command("example", "avalanche")[0] == 0
    assert (tmp_path / "klein.toml").read_text() == "mine"
    assert (tmp_path / "avalanche.toml").exists()
    errors = command.refusal("example", "kleim")
    assert "did you mean klein?" in errors
    assert command("example", "klein", "-o", "/dev/null/x.toml")[0] == 2


def test_a_measurement_comes_with_its_data(tmp_path, command):
    written = mesoslip.example("measured/basalt-step", tmp_path / "mine.toml")
    assert [one.name for one in written] == ["mine.toml", "basalt-step.txt.gz"]
    printed = command.output("trace", written[0], "--dry-run")
    assert "100 Hz from 11674.2 s" in printed


def test_a_base_elsewhere_comes_to_stand_beside_the_example(tmp_path, monkeypatch):
    (tmp_path / "runs" / "fit").mkdir(parents=True)
    (tmp_path / "runs" / "klein.toml").write_text('title = "first"\n')
    (tmp_path / "runs" / "fit" / "one.toml").write_text('# One.\nbase = "../klein.toml"\n')
    monkeypatch.setattr(examples, "_folder", lambda: tmp_path / "runs")
    assert examples.examples() == {"fit/one": "One.", "klein": "first"}
    written = examples.example("fit/one", tmp_path / "here" / "one.toml")
    assert [one.name for one in written] == ["one.toml", "klein.toml"]
    assert 'base = "klein.toml"' in written[0].read_text()


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        ("libsundials_cvode.so.6: cannot open shared object file", "libsundials-dev"),
        ("libhdf5.so: failed to map segment from shared object", "not enough memory"),
    ],
)
def test_a_missing_library_is_reported_in_a_line(problem, message, monkeypatch, command):
    def broken():
        raise ImportError(problem)

    monkeypatch.setattr(examples, "examples", broken)
    status, _, errors = command("example")
    assert status == 1
    assert message in errors
    assert errors.count("\n") == 1


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit the address space")
@pytest.mark.parametrize("megabytes", [100, 260])
def test_libraries_without_memory_are_no_crash(megabytes):
    """Which would wait for it without end, or crash."""
    line = f'ulimit -v {1024 * megabytes}; exec "$@"'
    command = [sys.executable, "-m", "mesoslip", "curve", str(ROOT / "runs" / "klein.toml")]
    status, _, errors = run_program("bash", "-c", line, "bash", *command)
    assert (status, errors) == (1, "mesoslip: there is not enough memory for this\n")


def test_xarray_that_was_imported_before_keeps_its_packages():
    """It counts on Dask once it has seen that there is one."""
    python("""
import sys, xarray
from xarray.namedarray.utils import module_available
from mesoslip.array_packages import hidden
module_available("dask")
with hidden():
    assert "dask" not in sys.modules or sys.modules["dask"] is not None
    xarray.Dataset({"a": ("x", [1.0])}).load()
""")
