"""The source's claims: that each is judged, by what was measured and not otherwise."""

import json
import re
import runpy
import sys
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import xarray as xr
from claims import CLAIMS, Verdict, judge
from claims.compare import differences
from claims.page import as_table, measured_page, measured_path, verdict_page
from conftest import ROOT
from figures import FIGURES
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.output import files, writing
from mesoslip.quantities import with_error
from outputs import configuration

SOURCE = ROOT / "runs" / "source"
# Outputs of other commands that claims use.
COMMANDS = {".curve": "curve", ".onset": "onset"}


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """A folder with cheap outputs of Klein's case."""
    folder = tmp_path_factory.mktemp("outputs")
    (folder / "claims").mkdir()
    short = ["run.duration=8s", "run.realizations=3", "contacts.count=500"]
    writing.write(
        mesoslip.run(mesoslip.Config.load(ROOT / "runs" / "klein.toml", short)),
        folder / "claims" / "klein.nc",
    )
    writing.write(mesoslip.curve(SOURCE / "S18.toml"), folder / "S18.curve.nc")
    for name in ("S19a", "S19b"):
        tree = mesoslip.onset(SOURCE / f"{name}.toml")
        writing.write(tree, folder / f"{name}.onset.nc")
    return folder


def test_each_has_a_criterion_and_its_runs_exist():
    numbers = [int(name.removeprefix("C")) for name in CLAIMS]
    assert numbers == sorted(set(numbers))
    assert set(range(1, 17)) <= set(numbers) <= set(range(1, 29))
    for claim in CLAIMS.values():
        assert claim.criterion
        for run in claim.runs:
            for ending in COMMANDS:
                run = run.removesuffix(ending)
            assert (SOURCE / f"{run}.toml").exists()


def test_every_run_of_claims_is_used():
    used = {run for claim in CLAIMS.values() for run in claim.runs}
    for path in (SOURCE / "claims").glob("*.toml"):
        assert f"claims/{path.stem}" in used
        mesoslip.Config.load(path)
    for path in (SOURCE / "claims" / "sweeps").glob("*.toml"):
        assert f"claims/sweeps/{path.stem}" in used
        assert Plan.load(path).keys


def test_the_page_has_all_claims_as_they_are():
    """The page of the documentation was written since claims or criteria changed."""
    verdicts = (ROOT / "docs" / "claims.md").read_text()
    page = measured_path(ROOT / "docs" / "claims.md").read_text()
    assert re.findall(r"^## (C\d+)", page, re.MULTILINE) == list(CLAIMS)
    for claim in CLAIMS.values():
        runs = ", ".join(f"`{run}`" for run in claim.runs)
        assert f"*{claim.statement}.* Criterion: {claim.criterion}. Runs: {runs}." in page
        link = rf"claims-measured\.md#{claim.name.lower()}"
        assert re.search(rf"^\| \[{claim.name}\]\({link}\) \|", verdicts, re.MULTILINE)


def test_differences_from_an_earlier_page(outputs, tmp_path):
    """Numbers may differ as much as they scatter; verdicts and other numbers may not."""
    judgements = judge(["C1", "C3"], outputs)
    page, measured = tmp_path / "page.md", tmp_path / "page-measured.md"
    text = measured_page(judgements)
    measured.write_text(text)
    assert not differences(judgements, page)
    peak = next(one for one in judgements[1].finding.measured if one.name == "first peak")
    for errors, count in ((1.5, 0), (3.0, 1)):
        other = with_error(peak.mean + errors * peak.spread, peak.spread, "N")
        measured.write_text(text.replace(str(peak), other))
        found = differences(judgements, page)
        assert len(found) == count, found
    measured.write_text(text.replace("**Holds.**", "**Fails.**").replace("## C1\n", "## C5\n"))
    assert [one.split(":")[0] for one in differences(judgements, page)] == ["C1", "C3, verdict"]
    measured.write_text(text.replace("1166 1/s", "1170 1/s").replace("24.46 ms", "24460 µs"))
    assert [one.split(":")[0] for one in differences(judgements, page)] == ["C1, omega_l"]


def verdicts(outputs, *names):
    return {one.claim.name: one.finding.verdict for one in judge(names, outputs)}


def test_claims_of_numbers_and_curves(outputs):
    assert verdicts(outputs, "C1", "C2", "C14", "C16") == {
        "C1": Verdict.QUALIFIED,
        "C2": Verdict.QUALIFIED,
        "C14": Verdict.QUALIFIED,
        "C16": Verdict.FAILS,
    }


def test_claims_of_slips(outputs):
    assert verdicts(outputs, "C3", "C4") == {"C3": Verdict.HOLDS, "C4": Verdict.QUALIFIED}


def changed(tree, group, name, change):
    """An output with other values of a variable."""
    datasets = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    variable = datasets[group][name]
    datasets[group] = datasets[group].assign({name: (variable.dims, change(variable.values))})
    return xr.DataTree.from_dict(datasets)


def judged(name, *trees):
    return CLAIMS[name].judge(trees).verdict


def test_what_is_otherwise_fails(outputs):
    """Claims are judged by the outputs: other ones give another verdict."""
    klein = files.read(outputs / "claims" / "klein.nc")
    flat = changed(klein, "/slips", "force_before", lambda values: np.full_like(values, 1e-5))
    assert judged("C3", flat) is Verdict.FAILS
    slow = changed(klein, "/slips", "peak_velocity", lambda values: 0.1 * values)
    assert judged("C4", slow) is Verdict.FAILS
    curve = files.read(outputs / "S18.curve.nc")
    rising = changed(curve, "/", "contact_force", lambda values: np.sort(values))
    assert judged("C2", rising) is Verdict.FAILS
    bent = changed(curve, "/", "contact_force", lambda values: np.abs(values) ** 1.1)
    assert judged("C2", bent) is Verdict.FAILS
    onsets = [files.read(outputs / f"S19{one}.onset.nc") for one in "ab"]
    quadratic = changed(
        onsets[0],
        "/sequential",
        "relative_force_drop",
        lambda _: -(onsets[0]["sequential"]["onset_time"].values ** 2),
    )
    assert judged("C14", quadratic, onsets[1]) is Verdict.FAILS


def simulated(name, *changes):
    """A cheaper run of a claim."""
    return mesoslip.run(mesoslip.Config.load(SOURCE / "claims" / f"{name}.toml", changes))


def test_claims_of_layers_and_a_base():
    base = simulated("base-250", "contacts.count=200", "run.realizations=1")
    assert judged("C20", base) is Verdict.HOLDS
    times = base["time"].values
    faster = changed(base, "/", "base_displacement", lambda _: np.sin(400 * times)[None])
    assert judged("C20", faster) is Verdict.FAILS
    few = ["contacts.count=100", "run.realizations=1"]
    slowed, slip = (simulated(name, *few) for name in ("stopping-16", "stopping-slip"))
    assert judged("C23", slowed, slip) is Verdict.QUALIFIED
    down = changed(slowed, "/", "layer_displacement", lambda values: values[..., ::-1])
    assert judged("C23", down, slip) is Verdict.FAILS


def test_claims_of_avalanches_and_of_two_motions():
    small = ["interaction.columns=12", "interaction.rows=12", "contacts.count=144"]
    names = ("interaction-0", "interaction-0.1", "interaction-0.3")
    weak, middle, strong = (
        simulated(name, *small, "run.duration=3s", "run.realizations=2") for name in names
    )
    assert judged("C19", weak, middle, strong) is Verdict.HOLDS
    assert judged("C19", weak, strong, middle) is Verdict.FAILS
    both = simulated("up-and-down", "contacts.count=400", "run.realizations=1")
    assert judged("C24", both) is Verdict.HOLDS
    falling = np.diff(both["stages"]["drive_start_velocity"].values).argmin()
    turn = both["stages"]["stage_end_time"].values[falling - 1]
    late = both["time"].values > turn
    for part in (late, ~late):
        one_motion = changed(
            both, "/", "spring_force", lambda values, part=part: np.where(part, 0.0, values)
        )
        expected = Verdict.HOLDS if part is late else Verdict.FAILS
        assert judged("C24", one_motion) is expected


def test_claims_of_kept_thresholds():
    kept, drawn = (
        simulated(name, "run.realizations=1", "contacts.count=2000", "output.interval=0.3ms")
        for name in ("loops-keep", "loops-redraw")
    )
    assert judged("C28", kept, drawn) is Verdict.HOLDS
    assert judged("C28", drawn, kept) is Verdict.FAILS


def test_a_viscous_film_is_judged_by_durations_and_drops():
    short = ["run.realizations=2", "contacts.count=500", "run.duration=2.4s"]
    thin, thick = (simulated(f"drag-{one}", *short) for one in ("2e11", "2e16"))
    assert judged("C11", thin, thin) is Verdict.HOLDS
    assert judged("C11", thin, thick) is Verdict.FAILS


def test_what_is_reported(outputs):
    judgements = judge(["C4", "C14"], outputs)
    page = verdict_page(judgements, Path("all.md"))
    assert "2 holds with a qualification" in page
    assert "| [C4](all-measured.md#c4) |" in page
    printed = as_table(judgements)
    assert json.loads(json.dumps(printed))[0]["measured"][0]["standard_deviation"] < 0.1
    assert len(printed[0]["measured"][0]["values"]) == 3
    assert configuration(files.read(outputs / "claims" / "klein.nc")).contacts.count == 500


def test_mistakes(outputs):
    with pytest.raises(mesoslip.ConfigError, match="no such claim; choose from C1"):
        judge(["C99"], outputs)
    with pytest.raises(mesoslip.FileError, match=r"make them first: make .*delay-0\.nc"):
        judge(["C6"], outputs)


@pytest.fixture
def script(monkeypatch, capfd):
    """Run a script of the source's runs; returns exit status and what it prints."""

    def call(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        status = 0
        try:
            runpy.run_path(str(SOURCE / name), run_name="__main__")
        except SystemExit as stop:
            status = stop.code or 0
        return status, *capfd.readouterr()

    return call


def test_the_script_judges(outputs, tmp_path, script):
    page = tmp_path / "claims.md"
    status, out, err = script("judge.py", "C4", "--from", outputs, "-o", page)
    assert (status, err) == (0, "")
    assert out.startswith("C4: in a slip")
    assert "| [C4](claims-measured.md#c4) |" in page.read_text()
    _, out, _ = script("judge.py", "C4", "--from", outputs, "--json")
    assert json.loads(out)[0]["verdict"] == "holds with a qualification"
    status, _, err = script("judge.py", "C4", "--from", outputs, "--compare", page)
    assert (status, err.strip()) == (0, "")
    measured = measured_path(page)
    measured.write_text(measured.read_text().replace("**Holds", "**Fails"))
    status, _, err = script("judge.py", "C4", "--from", outputs, "--compare", page)
    assert status == 1
    assert "C4, verdict: Holds with a qualification" in err


@pytest.mark.usefixtures("quick_pictures")
def test_the_script_draws(outputs, tmp_path, script):
    status, _, err = script("draw.py", "S18", "--from", outputs, "-o", tmp_path / "figures")
    assert (status, err) == (0, "")
    assert (tmp_path / "figures" / "S18.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [(["S99"], 2, ["S99", "S20"]), (["S20"], 1, ["S20.nc", "make"])],
)
def test_mistakes_at_the_script(tmp_path, arguments, status, words, script):
    exit_status, _, err = script("draw.py", *arguments, "--from", tmp_path)
    assert exit_status == status
    assert all(word in err for word in words)


def test_every_figure_has_runs():
    for figure in FIGURES.values():
        for run in figure.runs:
            for ending in COMMANDS:
                run = run.removesuffix(ending)
            there = [SOURCE / f"{run}.toml", ROOT / "runs" / f"{run}.toml"]
            assert sum(one.exists() for one in there) == 1


def swept(sizes, **measures):
    """An output of a sweep: coordinates by dimension, and measures, which are broadcast."""
    shape = [len(values) for values in sizes.values()]
    variables = {
        name: (list(sizes), np.broadcast_to(values, shape).astype(float))
        for name, values in measures.items()
    }
    return xr.DataTree(xr.Dataset(variables, sizes))


def test_claims_of_ageing():
    sizes = {
        "contacts.ageing.young_force_ratio": [0.3, 1.0],
        "slider.damping_ratio": [0.02, 0.2],
        "drive.velocity": [1e-6, 1e-5],
        "realization": [0, 1],
    }
    amplitudes = np.full((2, 2, 2, 2), 0.4)
    assert judged("C21", swept(sizes, relative_amplitude=amplitudes)) is Verdict.FAILS
    amplitudes[0, 1, 1] = 1e-3
    assert judged("C21", swept(sizes, relative_amplitude=amplitudes)) is Verdict.QUALIFIED
    amplitudes[0, 0, 1] = 1e-3
    assert judged("C21", swept(sizes, relative_amplitude=amplitudes)) is Verdict.HOLDS
    amplitudes[1, :, 1] = 1e-3
    assert judged("C21", swept(sizes, relative_amplitude=amplitudes)) is Verdict.FAILS


@pytest.mark.parametrize(
    ("peaks", "falls", "last", "expected"),
    [
        (0.2, 0.2, 1e-3, Verdict.HOLDS),
        (0.05, 0.2, 1e-3, Verdict.FAILS),
        (0.2, 0.05, 1e-3, Verdict.FAILS),
        (0.2, 0.2, 0.2, Verdict.FAILS),
    ],
)
def test_claim_of_irregular_motion(peaks, falls, last, expected):
    sizes = {
        "slider.damping_ratio": [0.2],
        "contacts.count": [250, 1000],
        "drive.velocity": [1e-6, 2e-6, 1e-5],
        "realization": [0, 1],
    }

    def at_velocities(*values):
        return np.array(values)[:, None]

    tree = swept(
        sizes,
        peak_variation=at_velocities(0.01, peaks, np.nan),
        fall_irregularity=at_velocities(0.01, falls, 0.2),
        relative_amplitude=at_velocities(0.4, 0.2, last),
    )
    assert judged("C22", tree) is expected


def test_claim_of_a_film_needs_another_change_of_contacts():
    sizes = {
        "contacts.count": [1, 4080],
        "contacts.drag_rate": 2e11 * 10.0 ** np.arange(9),
        "realization": [0, 1],
    }
    grows = np.linspace(0.01, 0.03, 9)
    both = np.stack([grows, grows])[:, :, None]
    assert judged("C17", swept(sizes, mean_slip_duration=both)) is Verdict.FAILS
    both[1] = 0.01
    assert judged("C17", swept(sizes, mean_slip_duration=both)) is Verdict.HOLDS
