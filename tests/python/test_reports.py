"""Reports: all that an output holds on a page that needs nothing else."""

import html
import re
from html.parser import HTMLParser

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT, klein_tables, long
from kinds import DIFFERENT, KINDS, configuration
from mesoslip.analysis.rate_and_state.search import fit_laws
from mesoslip.output.kinds import KINDS as OUTPUTS
from mesoslip.plots.views.run import caption
from mesoslip.quantities import column
from mesoslip.reports.method_paragraphs import cycle_method
from mesoslip.reports.sections import SECTIONS

pytestmark = pytest.mark.usefixtures("few_replicas", "quick_pictures")

MOST_BYTES = 3_000_000
# Elements of HTML that have no end.
VOID = {"meta", "br", "link", "img", "input", "hr"}


class Page(HTMLParser):
    """The elements of a page: whether they are nested well, and what they ask for."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.asked, self.words = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        for name, value in attributes:
            if name in {"src", "href", "xlink:href", "action", "data", "srcset"}:
                self.asked.append(value)
            assert not name.startswith("on"), name
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += [data.strip()] if data.strip() else []


def written(outputs, path):
    """A report as text, and its elements."""
    mesoslip.report(outputs, path)
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert len(text.encode()) < MOST_BYTES
    assert "script" not in page.tags
    # Whatever it asks for is in it.
    assert all(one.startswith(("#", "data:")) for one in page.asked)
    assert not re.search(r"url\((?!#)", text)
    assert "@import" not in text
    # Pictures do not share the names of their parts.
    parts = re.findall(r'<clipPath id="([^"]+)"', text)
    assert len(parts) == len(set(parts))
    assert set(re.findall(r'clip-path="url\(#([^)]+)\)"', text)) <= set(parts)
    return text, page


@pytest.fixture(scope="module")
def klein_run():
    config = mesoslip.Config.load(ROOT / "runs" / "klein.toml", ["contacts.delay=1 ms"])
    return mesoslip.run(config)


def test_every_kind_of_output_has_sections():
    assert set(SECTIONS) == set(OUTPUTS)


def test_a_report_of_kleins_run(klein_run, tmp_path):
    text, page = written(klein_run, tmp_path / "klein.html")
    assert page.tags.count("svg") == 2
    count = klein_run["slips"].sizes["slip"]
    assert f"{count} slips" in page.words
    for row in ("Energy", "work done by the drive", "100"):
        assert row in page.words
    place = page.words.index("contacts.delay (ms)")
    assert page.words[place : place + 3] == ["contacts.delay (ms)", "1", "0.5"]
    assert any("N = 4080 contacts" in word for word in page.words)
    assert klein_run.attrs["commit"] in page.words
    assert any(word.startswith("Stick-slip: force amplitude") for word in page.words)
    drop = np.mean(klein_run["slips/force_drop"].values) * 1e6
    assert page.words[page.words.index("force drop (µN)") + 1] == f"{drop:.2f}"
    # The whole configuration, to copy.
    assert klein_run.attrs["configuration"] in html.unescape(text)
    # Made again it is the same.
    again, _ = written(klein_run, tmp_path / "again.html")
    assert again == text


# Pages of them are those of others, with more columns or fewer sections.
LIKE_OTHERS = {
    *("rigid, lattice", "layered, me", "rigid, bundle", "rigid, three realizations"),
    *("rigid, to a slip", "rigid, thermal", "quasistatic, force", "rigid"),
}


@pytest.mark.parametrize(
    "kind", [kind if kind in DIFFERENT - LIKE_OTHERS else long(kind) for kind in KINDS]
)
def test_there_is_a_report_of_every_kind(kind, tmp_path):
    config = configuration(kind)
    _, page = written(mesoslip.run(config), tmp_path / "report.html")
    assert ("Avalanches" in page.words) == config.has_avalanches
    assert "Provenance" in page.words
    assert "svg" in page.tags


def test_a_report_has_what_is_read_off_a_drive_with_stages(klein, tmp_path, monkeypatch):
    # Fits of several laws take seconds, and have tests of their own.
    for module in ("analysis.rate_and_state.rows", "plots.views.response"):
        monkeypatch.setattr(
            f"mesoslip.{module}.fit_laws", lambda record, *_: fit_laws(record, ("slip",))
        )
    stages = [
        {"displacement": 1e-7, "velocity": 1e-6},
        {"duration": 0.1, "velocity": 0.0},
        {"displacement": 1e-7, "velocity": 1e-6},
        {"displacement": 1e-7, "velocity": 1e-5},
    ]
    run = mesoslip.run(
        klein(
            run__duration=None,
            drive={"stage": stages},
            slider={"kind": "prescribed"},
            contacts__initial="steady",
            contacts__count=1000,
            output__interval=1e-4,
        )
    )
    _, page = written([run], tmp_path / "response.html")
    assert "Response to the drive" in page.words
    assert {"Steady sliding:", "Velocity steps:", "Holds:", "Rate and state:"} <= set(page.words)
    found = mesoslip.response(run)
    force = found["steady/steady_force_ratio"].values[0]
    assert any(word.startswith(f"{force:.4g} ±") for word in page.words)
    # Stages of the drive, each column in one unit.
    place = page.words.index("drive.stage:")
    heads = ["number", "duration (ms)", "displacement (nm)", "velocity (µm/s)"]
    assert set(heads) <= set(page.words[place + 1 : place + 5])
    notes = found["holds/note"].values
    assert all(note in page.words for note in notes if note)
    # There is nothing of that at one velocity.
    _, page = written(mesoslip.run(klein(run__duration=0.2)), tmp_path / "one.html")
    assert "Response to the drive" not in page.words


def test_reports_of_the_theory(klein, tmp_path):
    near = {"curve": {"length": 3 * klein().contacts.break_stretch}}
    curve, stiff = (mesoslip.curve(klein(slider__stiffness=one, **near)) for one in (97.0, 1e6))
    _, page = written([curve, stiff], tmp_path / "a.html")
    assert "K_star (kN/m)" in page.words
    assert page.tags.count("svg") == 3
    _, page = written(mesoslip.onset(klein(**near)), tmp_path / "b.html")
    assert "slip_time_melting (ms)" in page.words
    _, page = written(mesoslip.onset(klein(slider__stiffness=1e6, **near)), tmp_path / "c.html")
    assert any("there is no onset" in word for word in page.words)


def test_a_report_of_a_sweep(tmp_path):
    plan = {
        **klein_tables(run__duration=0.2),
        "sweep": {
            "realizations": 2,
            "measures": ["regime", "mean_force"],
            "grid": {"contacts.delay": [1e-4, 1e-3], "slider.stiffness": [50.0, 100.0, 200.0]},
        },
    }
    tree = xr.DataTree(mesoslip.sweep(plan, executor=1))
    _, page = written(tree, tmp_path / "sweep.html")
    assert "12 runs: 12 ok." in page.words
    assert page.tags.count("svg") == 2
    place = page.words.index("slider.stiffness (N/m)")
    assert page.words[place + 1 : place + 3] == ["3", "50, 100, 200"]
    forces = [float(tree["mean_force"].reduce(one)) for one in (np.min, np.mean, np.max)]
    shown = column(forces, "N")
    row = page.words.index(shown.head("mean_force"))
    assert page.words[row + 1 : row + 4] == [shown.text(one) for one in forces]
    # Fewer than there should be stand out.
    tree["status"].values[0, 0, 0] = 2
    text, page = written(tree, tmp_path / "missing.html")
    assert "12 runs: 11 ok, 1 missing." in page.words
    assert text.count('class="warns"') == 1
    with pytest.raises(mesoslip.FileError, match="one output at a time"):
        mesoslip.plot([tree, tree])


def test_outputs_side_by_side(klein_run, tmp_path, klein):
    other = mesoslip.run(klein(contacts__delay=2e-3, run__duration=4.0))
    _, page = written([klein_run, other], tmp_path / "both.html")
    assert "Differences" in page.words
    place = page.words.index("contacts.delay (ms)")
    assert page.words[place + 1 : place + 3] == ["1", "2"]
    curve = mesoslip.curve(klein(curve={"length": 3 * klein().contacts.break_stretch}))
    with pytest.raises(mesoslip.FileError, match=r"is a run.* is a force curve"):
        mesoslip.report([klein_run, curve], tmp_path / "no.html")
    assert not (tmp_path / "no.html").exists()


def test_what_a_file_says_is_no_markup(klein, tmp_path):
    title = "<script>alert(1)</script> & $x^$ \\frac"
    tree = mesoslip.run(klein(title=title, run__duration=0.01))
    text, page = written(tree, tmp_path / "report.html")
    assert "<script>" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; $x^$ \\frac" in text
    assert "There is no slip." in page.words


def test_what_a_run_did_not_keep_stands_out(klein_run, tmp_path):
    tree = klein_run.copy()
    tree.attrs |= {"audit": "the balance does not close", "complete": "false"}
    tree.attrs["comment"] = "interrupted; it reached 3 s"
    text, page = written(tree, tmp_path / "report.html")
    assert text.count('class="warns"') == 2
    assert "interrupted; it reached 3 s" in page.words


def test_the_command_writes_a_page(tmp_path, command):
    output = tmp_path / "run.nc"
    quick = ("--set", "run.duration=0.1 s", "--set", "contacts.count=100")
    assert command("run", ROOT / "runs" / "klein.toml", "-o", output, "--quiet", *quick)[0] == 0
    assert command("report", output)[0] == 0
    assert (tmp_path / "run.html").exists()
    errors = command.refusal("report", output, "-o", output)
    assert "is read by the command" in errors
    assert command("report", tmp_path / "none.nc")[0] == 2


def test_a_method_of_the_theory_has_no_duration(klein):
    """A settled motion is of no run, and an irregular one has no period."""
    near = {"length": 3 * klein().contacts.break_stretch}
    found = mesoslip.onset(klein(curve=near)).attrs["configuration"]
    config = mesoslip.Config.from_toml(found)
    tree = xr.DataTree(xr.Dataset(attrs={"settled_motion": "periodic"}))
    text = " ".join(cycle_method(tree, config.replace("run.engine=me", "run.duration=1e9")))
    assert "until period and peaks did not change" in text
    assert "1e" not in text.split("drive moves")[1]
    assert " for " not in text.split("drive moves")[1]
    tree.attrs["settled_motion"] = "irregular"
    text = " ".join(cycle_method(tree, config))
    assert "did not change" not in text
    assert "means over passages" in text


def test_a_caption_names_the_panels_that_there_are(klein_run):
    assert caption(klein_run) == (
        "force, velocity and detached contacts, with the largest slip beside them"
    )
    measured = xr.DataTree.from_dict(
        {
            "/": klein_run.to_dataset().drop_vars("detached_contacts"),
            "/slips": klein_run["slips"].to_dataset().isel(slip=slice(0)),
        }
    )
    measured.attrs["origin"] = "measured"
    assert caption(measured) == "force and velocity"
