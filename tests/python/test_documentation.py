"""What README and documentation tell to type is typed: Python, TOML, and commands, page by page.

Blocks are gone through as a reader does, in an empty folder (README: in a clone, which has
``runs``). A TOML block whose first line is a comment with a file's name is that file; others are
parts of a file. Of a block after ``not run: reason`` commands are parsed, and no more is done.
"""

import doctest
import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import mesoslip
import numpy as np
import page_numbers
import pytest
import typer
from conftest import ROOT, long
from mesoslip import Config
from mesoslip.analysis.regime.result import NAMES as REGIMES
from mesoslip.analysis.regime.result import REGIME
from mesoslip.campaign.measures import MEASURES
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.command_line.main import app
from mesoslip.configuration.contacts.tables.contacts import COUPLINGS, INITIAL_STATES
from mesoslip.configuration.sliders import DEFAULT as DEFAULT_SLIDER
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.inference.fit_plan import Plan as FitPlan
from mesoslip.measured.reading.file import READERS
from mesoslip.plots.views import VIEWS

DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    *sorted(path for path in DOCS.rglob("*.md") if not {"generated", "examples"} & {*path.parts}),
]
# Pages whose runs take some seconds: `make docs` runs them.
LONG_PAGES = [
    "ageing.md",
    "campaigns.md",
    "cycles.md",
    "how-to/avalanches.md",
    "how-to/change-a-parameter.md",
    "how-to/from-rig-to-table.md",
    "how-to/infinitely-many-contacts.md",
    "how-to/measured-surface.md",
    "how-to/pictures.md",
    "how-to/quasi-static.md",
    "how-to/slide-hold-slide.md",
    "how-to/which-motion.md",
    "interface.md",
    "measurements.md",
    "questions.md",
    "teaching.md",
    "temperature.md",
    "tutorial-fit.md",
    "tutorial.md",
]

# Those that are run without being made shorter too, as they have numbers to compare.
AS_THEY_STAND = [
    name
    for name in LONG_PAGES
    if re.search("^<!-- (numbers|printed)", (DOCS / name).read_text(encoding="utf-8"), re.MULTILINE)
]

FENCE = re.compile(r"^(?P<fence>`{3,}|:{3,})(?P<language>\S*).*$")
LEFT_OUT = re.compile(r"^(?:<!--|%)\s*not run: \S.*$")
# Language of a comment on numbers.
NUMBERS = "numbers"
FILE = re.compile(r"# (?P<path>[\w/.-]+\.toml)")
# Commands whose arguments are parsed and no more: they do not end.
PARSED_ONLY = {"explore"}
# Movies have tests of their own.
MOVIES = (".gif", ".mp4")
# Names that stand for those of a reader's own.
PLACEHOLDER = re.compile(r"[A-Z]{3,}\b|…|\.\.\.")
# What makes files of the documentation short enough for a test.
SHORTER = {
    "[fit]\nsimulations = 1600": "[contacts]\ncount = 300\n\n[fit]\nsimulations = 300",
    'duration = "113 s"': 'duration = "11.5 s"',
    'duration = "10 s"': 'duration = "1 s"',
    'duration = "100 s"': 'duration = "9 s"',
    'duration = "20 s"': 'duration = "0.3 s"',
    "count = 1_000_000": "count = 20_000",
    # Klein's case, for pages on the master equation and the force curve.
    '[run]\nengine = "eq"': '[curve]\nlength = "40 nm"\n\n[run]\nresolution = 1.0\nengine = "eq"',
}
FORMULAS = [name for name, law in LAWS.items() if not law.is_sampled]
FORMATS = {re.split("[ -]", one.kind)[0] for one in READERS}
# Lists of names that pages have: the passage, the form of a name in it, with hyphens or as it is,
# and all names.
LISTS = [
    ("README.md", r'law = "weibull" +# ([^\n]*)', r"\b{}\b", FORMULAS),
    ("README.md", r"\n\| to \| set \|.*?\n\n", 'slider.kind = "{}"', {*SLIDERS} - {DEFAULT_SLIDER}),
    ("README.md", r"\n\| start with (.*?) \|", r"\b{}", INITIAL_STATES),
    ("README.md", r"`mesoslip regime` classifies (.*?)\(", r"\b{}\b", REGIMES),
    ("docs/model.md", r"A law is a formula \((.*?)\)", "`{}`", FORMULAS),
    ("docs/model.md", r"A law is a formula .*?\n\n", "`{}`", LAWS),
    ("docs/model.md", r"\*\*Coupling\.\*\*.*?\n\n", "`{}`", COUPLINGS),
    ("docs/model.md", r"\*\*Starts\.\*\*.*?\n\n", "`{}`", INITIAL_STATES),
    ("docs/regimes.md", r"\| regime \| number \|.*?\n\n", r"\| {} \|", REGIMES),
    ("docs/campaigns.md", r"\| measure \| meaning \|.*?\n\n", "`{1}`", MEASURES.keys() - REGIME),
    ("docs/how-to/measured-files.md", r"\| files \| [^\n]*", "{}", FORMATS),
]
HISTORY = "time [s],displacement [um]\n0,0\n1,0.1\n2,0.3\n"
STATUS = re.compile(r"exit status (\d+)")


@dataclass(frozen=True)
class Block:
    """A fenced block or a comment on numbers: where it starts, its language, the line before."""

    line: int
    language: str
    text: str
    before: str

    @property
    def is_left_out(self):
        """Whether its commands are only parsed."""
        return bool(LEFT_OUT.match(self.before))

    @property
    def printed_share(self):
        """Share by which numbers of printed lines may differ; None if they are not compared."""
        match = page_numbers.PRINTED.match(self.before)
        return None if match is None else float(match["percent"] or 100 * page_numbers.SHARE) / 100


def with_long_ones(pages):
    """Pages, of which the long ones are left to `make docs`, but for those run as they stand."""
    long_pages = {DOCS / name for name in LONG_PAGES}
    chosen = [page for page in pages if page not in {DOCS / name for name in AS_THEY_STAND}]
    return [long(page) if page in long_pages else page for page in chosen]


def blocks_of(page):
    """The fenced blocks of a page."""
    found, fence, language, start = [], "", "", 0
    inside, before, above = [], "", ""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        match = FENCE.match(line)
        if not fence and (match or line == page_numbers.START):
            fence, language = (match["fence"], match["language"]) if match else ("-->", NUMBERS)
            start, inside, above = number, [], before
        elif fence and line.strip() == fence:
            found.append(Block(start, language, "\n".join(inside), above))
            fence = ""
        elif fence:
            inside.append(line)
        if line.strip():
            before = line
    assert not fence, f"{page}, line {start}: is not closed"
    return found


def commands_of(text):
    """Commands of a block of a shell: words and comment. Beside lines with a prompt others are what
    these print."""
    lines = text.replace("\\\n", " ").splitlines()
    prompted = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    for line in prompted or lines:
        typed, _, comment = line.partition(" #")
        words = shlex.split(typed, comments=True)
        if words:
            yield words, comment


def make_shorter(path):
    """Make what a file asks for short."""
    text = path.read_text()
    for old, new in SHORTER.items():
        text = text.replace(old, new)
    path.write_text(text)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, as a reader has it."""
    path = tmp_path / "folder"
    path.mkdir()
    monkeypatch.chdir(path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(mesoslip, "fit", fit_of_a_page)
    return path


@pytest.fixture
def parts(tmp_path):
    """A folder for parts of files, with what they are laid over."""
    shutil.copy(ROOT / "runs" / "klein.toml", tmp_path)
    (tmp_path / "stage.csv").write_text(HISTORY)
    return tmp_path


def fit_of_a_page(trace, config):
    """The posterior that the command has written: the same fit in Python would be the same."""
    assert "spring_force" in trace
    assert Path(config).exists()
    return mesoslip.open_output("out/experiment.posterior.nc")


def check_toml(block, folder, parts):
    """Check a file, or a part of one laid over Klein's case."""
    tables = tomllib.loads(block.text)
    named = FILE.match(block.text)
    path = folder / named["path"] if named else parts / "part.toml"
    # README has a part of a file in a folder of a clone.
    base = 'base = "klein.toml"\n'
    text = re.sub(r'^base = ".*klein.toml"', base.strip(), block.text, flags=re.MULTILINE)
    path.write_text(text if named or "base" in tables else base + text)
    make_shorter(path)
    if "sweep" in tables:
        assert Plan.load(path).keys
    elif "fit" in tables:
        assert FitPlan.load(path)
    else:
        Config.load(path)


def parse_command(words):
    """Let the command's parser read its arguments, which raises for those that there are not."""
    _, name, *arguments = words
    if not name.startswith("-"):
        parser = typer.main.get_command(app).commands[name]
        parser.make_context(name, list(arguments))


def run_command(words, comment, command):
    """Run a command, unless it takes long or names what a reader has to give; what it prints."""
    _, name, *arguments = words
    is_placeholder = any(PLACEHOLDER.search(one) for one in arguments)
    if name in PARSED_ONLY or is_placeholder or any(one.endswith(MOVIES) for one in arguments):
        return ""
    expected = STATUS.search(comment)
    status, out, err = command(name, *arguments)
    assert status == (int(expected[1]) if expected else 0), f"{shlex.join(words)}\n{out}{err}"
    if name == "example":
        for path in map(Path, err.split()):
            if path.suffix == ".toml":
                make_shorter(path)
    return out + err


def name_of(page):
    """A page as people call it."""
    return page.relative_to(ROOT).as_posix()


@pytest.mark.usefixtures("few_replicas", "quick_pictures")
@pytest.mark.parametrize("page", with_long_ones(PAGES), ids=name_of)
def test_a_page_with_short_runs(page, folder, parts, command):
    if page == ROOT / "README.md":
        shutil.copytree(ROOT / "runs", folder / "runs")
        for path in folder.rglob("*.toml"):
            make_shorter(path)
    type_page(page, folder, parts, command)


@pytest.mark.parametrize("name", LONG_PAGES)
def test_a_long_page_is_right_as_far_as_that_is_seen_without_runs(name, folder, parts, command):
    type_page(DOCS / name, folder, parts, command, is_run=False)


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", AS_THEY_STAND)
def test_a_page_as_it_stands(name, folder, parts, command, monkeypatch):
    """Those whose runs are made shorter for the test above, with the numbers on them."""
    monkeypatch.setattr(sys.modules[__name__], "SHORTER", {})
    type_page(DOCS / name, folder, parts, command)


def type_page(page, folder, parts, command, *, is_run=True):
    """Type what a page has in its blocks, or only check its files and the arguments of commands."""
    blocks = blocks_of(page)
    names = {"__name__": "page", "mesoslip": mesoslip, "np": np}
    printed = ""
    for block in blocks:
        place = f"{page.relative_to(ROOT)}, line {block.line}"
        is_shell = block.language in {"", "sh", "bash", "console"}
        if block.is_left_out and not is_shell:
            continue
        try:
            if block.language == "toml":
                check_toml(block, folder, parts)
            elif block.language == "python" and is_run:
                exec(compile(block.text, place, "exec"), names)
                plt.close("all")
            elif block.language == NUMBERS and is_run:
                text = page.read_text(encoding="utf-8")
                wrong = page_numbers.wrong_numbers(block.text, text, names)
                assert not wrong, "\n".join(wrong)
            elif is_shell and (block.printed_share is None or "$ " in block.text):
                for words, comment in commands_of(block.text):
                    if words[0] == "mesoslip":
                        parse_command(words)
                        # Without runs, files that others are based on are written all the same.
                        if not block.is_left_out and (is_run or words[1] == "example"):
                            printed += run_command(words, comment, command)
                    elif words[0] == "make":
                        check_targets(words[1:])
            if block.printed_share is not None and is_run:
                wrong = page_numbers.not_printed(block.text, printed, block.printed_share)
                assert not wrong, "\n".join(wrong)
        except Exception as error:
            error.add_note(f"in {place}")
            raise


def test_wrong_numbers_on_a_page_are_found():
    page = (
        "The slip at 1.915 s takes 12.3 ms, at 53 214 breaks. <!-- numbers 1.915 s 12.3 ms 53 214"
    )
    names = {"start": 1.9154, "duration": 12.51e-3, "breaks": 53214}
    good = "twice = 2 * duration\n1.915 s = start\n12.3 ms ~ 2 % = twice / 2\n53 214 = breaks"
    assert page_numbers.wrong_numbers(good, page, names) == []
    bad = "1.915 s = start + 2e-3\n12.3 ms = duration\n53 214 = breaks - 2\n1.8 s = 1.8"
    found = page_numbers.wrong_numbers(bad, page, names)
    assert [one.partition(" is ")[2] for one in found] == [
        "1.9174",
        "12.51",
        "53212",
        "not on the page",
    ]
    printed = "out.nc: 7 slips, noise 49.1 nN\n  delay  1.315   1.29 to 1.33"
    assert page_numbers.not_printed("out.nc: 7 slips, noise 49.2 nN", printed, 0.01) == []
    assert page_numbers.not_printed("delay  1.32  1.29 to 1.33", printed, 0.01) == []
    for line in (
        "out.nc: 8 slips, noise 49.1 nN",
        "delay 1.315 1.29",
        "out.nc: 7 falls, noise 49.1 nN",
    ):
        assert page_numbers.not_printed(line, printed, 0.01)


@pytest.mark.parametrize(("page", "passage", "form", "names"), LISTS)
def test_lists_of_names_are_complete(page, passage, form, names):
    """A page that lists kinds lists all that the program has."""
    listed = re.search(passage, (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    assert listed, f"{page} has no {passage}"
    shown = {name: form.format(name.replace("_", "-"), name) for name in names}
    missing = [name for name in names if not re.search(shown[name], listed[0])]
    assert not missing, f"{page} does not list {missing}"


@pytest.mark.usefixtures("folder")
def test_sentences_that_a_page_quotes_are_printed(command):
    """Quotations of the page on motions are what the commands above them print."""
    text = (DOCS / "how-to" / "which-motion.md").read_text(encoding="utf-8")
    quoted = re.findall(r"^> .*(?:\n> .*)*", text, re.MULTILINE)
    sentences = [" ".join(one.replace("\n>", "").removeprefix("> ").split()) for one in quoted]
    (table,) = re.findall(r"^```text\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    sentences.append(table)
    assert len(sentences) == 2
    mesoslip.example("klein")
    printed = "".join(command(name, "klein.toml")[1] for name in ("info", "curve"))
    for sentence in sentences:
        assert sentence in printed


def check_targets(targets):
    """Whether make knows what a page states it to make."""
    known = (ROOT / "Makefile").read_text() + (ROOT / "runs" / "campaign.mk").read_text()
    for target in targets:
        if not target.startswith(("-", "out/")) and "=" not in target:
            assert re.search(rf"^{re.escape(target)}:", known, re.MULTILINE), target


def test_names_of_the_glossary_are_those_of_the_program():
    """Keys, lines of info and curve, variables of outputs, tables of fits, and commands."""
    from mesoslip.analysis import slips
    from mesoslip.analysis.rate_and_state.rows import FIT
    from mesoslip.configuration.messages import all_keys
    from mesoslip.output import variables
    from mesoslip.theory import curve, slip_onset
    from mesoslip.theory.derived import derived

    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    lines = [line.split("|") for line in text.splitlines() if line.startswith("| ")]
    names = {name for line in lines for name in re.findall(r"`([^`]+)`", line[4])}
    groups = [one for one in vars(variables).values() if isinstance(one, variables.Group)]
    known = {
        *all_keys(Config),
        *(f"mesoslip {name}" for name in typer.main.get_command(app).commands),
        *(name for group in groups for name in group),
        *derived(ROOT / "runs" / "klein.toml"),
        *curve.SUMMARY,
        *slip_onset.SUMMARY,
        *FIT,
        *slips.ADDED,
    }
    assert len(names) > 50
    assert names <= known, names - known


@pytest.fixture
def references(monkeypatch):
    """The makers of the references, which need no Sphinx."""
    monkeypatch.syspath_prepend(DOCS / "_extensions")


@pytest.mark.usefixtures("references")
def test_every_key_is_in_the_reference_with_its_meaning():
    from configuration_reference import configuration_page
    from mesoslip.configuration.messages import all_keys

    page = configuration_page()
    rows = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    names = {key.rpartition(".")[2] for key in all_keys(Config)}
    tables = {"run", "drive", "slider", "contacts", "interaction", "load", "output", "curve"}
    assert names - tables <= rows
    assert re.search(r"`delay` \| s \| `0` \| ≥ 0 \| \S", page)
    assert '`"scaled"`, `"equal"`' in page
    assert not re.search(r"\| *\|$", page, re.MULTILINE)


@pytest.mark.usefixtures("references")
def test_every_command_and_variable_is_in_the_reference():
    from command_reference import command_page
    from mesoslip.output import variables
    from output_reference import output_page

    commands = command_page()
    for name, parser in typer.main.get_command(app).commands.items():
        assert f"\n## {name}\n" in commands
        for one in parser.params:
            label = one.opts[-1] if one.param_type_name == "option" else ""
            assert label in commands
    # The views are listed by the views themselves.
    for view in VIEWS:
        if view.kind == "run":
            assert view.summary in commands
    outputs = output_page()
    groups = [one for one in vars(variables).values() if isinstance(one, variables.Group)]
    for name in {name for group in groups for name in group}:
        assert f"| `{name}` |" in outputs, name


@pytest.mark.usefixtures("references")
def test_the_fortran_reference_has_what_modules_make_public():
    from fortran_reference import SOURCES, fortran_pages, read_module

    pages = fortran_pages()
    page = "\n".join(pages.values())
    linked = re.findall(r"\]\(([\w-]+)\.md(?:#(\w+))?\)", page)
    assert len(linked) > 20
    for name, anchor in linked:
        assert not anchor or f"\n## {anchor}\n" in pages[name]
    for path in SOURCES.rglob("*.f90"):
        module = read_module(path)
        if module is None:
            continue
        for name in module.public:
            entity = module.entities.get(name)
            # What other modules define is reported there.
            if entity is not None:
                assert f"**{name}**" in page
                assert entity.comment, f"{module.file}: {name}"
    assert "**slider_type**" in page
    assert (
        "- `error : type(error_type), allocatable, intent(out)`<br>Set if there is no such" in page
    )


def test_what_pages_load_from_elsewhere_is_found(tmp_path):
    check = [sys.executable, ROOT / "tools" / "self-contained", tmp_path]
    page = tmp_path / "page.html"
    page.write_text('<a href="https://example.org">a link</a><img src="own.png">')
    assert subprocess.run(check, check=False).returncode == 0
    for text in (
        '<script src="https://example.org/a.js"></script>',
        '<link rel="stylesheet" href="//example.org/a.css">',
        "<style>@import 'https://example.org/a.css';</style>",
        '<p style="background: url(https://example.org/a.png)">',
    ):
        page.write_text(text)
        done = subprocess.run(check, check=False, capture_output=True, text=True)
        assert done.returncode == 1
        assert "example.org" in done.stderr


def test_every_page_has_a_place_in_the_list_on_the_left():
    trees = re.findall(r"^```{toctree}\n(.*?)^```", (DOCS / "index.md").read_text(), re.M | re.S)
    entries = [line for tree in trees for line in tree.splitlines() if line and line[0] != ":"]
    listed = {str(path.relative_to(DOCS)) for entry in entries for path in DOCS.glob(f"{entry}.md")}
    pages = {str(path.relative_to(DOCS)) for path in PAGES if DOCS in path.parents}
    assert pages - {"index.md"} == {one for one in listed if "generated" not in one}


def test_every_function_is_on_a_page_of_the_reference():
    pages = [path.read_text() for path in (DOCS / "reference").glob("python*.md")]
    found = set(re.findall(r"^\.\. auto\w+:: ([\w.]+)$", "\n".join(pages), re.MULTILINE))
    listed = set(re.findall(r"`(\w+)`", (DOCS / "reference" / "python.md").read_text()))
    names = {name.rpartition(".")[2] for name in found}
    assert {*mesoslip.__all__} <= names
    assert names <= {*listed, "MesoslipError", "ConfigError", "FileError", "RunError"}


# Public names without an example: what others return or take, and errors.
NO_EXAMPLE = {"Cycle", "Dask", "Processes", "Threads"}


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [name for name in mesoslip.__all__ if name not in NO_EXAMPLE and not name.endswith("Error")],
)
def test_the_example_of_a_docstring_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    (found,) = doctest.DocTestFinder(recurse=False).find(getattr(mesoslip, name), name)
    assert found.examples
    assert doctest.DocTestRunner().run(found).failed == 0


def test_metadata_agree():
    """Of the package, of a citation and of codemeta: version, licence, keywords, requirements."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    codemeta = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert f"\nversion: {project['version']}\n" in citation
    assert f"\nlicense: {project['license']}\n" in citation
    assert codemeta["version"] == project["version"]
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8")
    assert f'\n  version: "{project["version"]}"\n' in recipe
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    # Until a version is released, its changes have no date.
    dates = re.findall(rf"^## {re.escape(project['version'])} - ([\d-]+)$", changes, re.M)
    assert dates or "\n## Unreleased\n" in changes
    assert all(f'\ndate-released: "{date}"\n' in citation for date in dates)
    locked = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
    assert [one["version"] for one in locked if one["name"] == project["name"]] == [
        project["version"]
    ]
    systems = [one.rpartition(" :: ")[2] for one in project["classifiers"] if "Operating" in one]
    assert codemeta["operatingSystem"] == systems
    # An address is that of the project, or there is none.
    address = project["urls"].get("Repository")
    assert codemeta.get("codeRepository") == address
    assert re.findall(r"^repository-code: (.*)$", citation, re.M) == ([address] if address else [])
    assert codemeta["license"].endswith(project["license"])
    assert codemeta["description"] == project["description"]
    assert codemeta["keywords"] == project["keywords"]
    assert all(f"\n  - {word}\n" in citation for word in project["keywords"])
    needed = [re.split(r"[<>=]", one)[0] for one in project["dependencies"]]
    assert codemeta["softwareRequirements"][: len(needed)] == needed
    cited = set(re.findall(r"@(\w+)", (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")))
    entries = set(re.findall(r"@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text()))
    assert cited == entries


def test_files_that_the_architecture_names_exist():
    """Paths in its table of additions, below the root or the package."""
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./]+/[\w.]+\.(?:py|pyi|f90|md|build))`", text))
    named = {one for one in named if not re.search(r"\b[A-Z]{3,}\b", one)}
    assert len(named) > 20
    folders = (ROOT, ROOT / "python" / "mesoslip", ROOT / "fortran")
    assert not {
        one
        for one in named
        if not any(
            place.joinpath(one).is_file() or place.joinpath(f"{one}.in").is_file()
            for place in folders
        )
    }
