"""Notebooks to download: that they have the code of their pages, and that it runs."""

import json
import re
import shlex
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from conftest import ROOT

DOCS = ROOT / "docs"
NAMES = ["tutorial", "campaigns", "fit", "own-analysis"]


@pytest.fixture
def notebooks(monkeypatch):
    """The maker of the notebooks, which needs no Sphinx."""
    monkeypatch.syspath_prepend(DOCS / "_extensions")
    import notebooks

    return notebooks


def code_of(found):
    return [cell["source"] for cell in found["cells"] if cell["cell_type"] == "code"]


def test_notebooks_are_files_of_format_4(notebooks, tmp_path):
    assert list(notebooks.PAGES) == NAMES
    notebooks.write_notebooks(tmp_path)
    for name in NAMES:
        found = json.loads((tmp_path / f"{name}.ipynb").read_text(encoding="utf-8"))
        assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
        cells = found["cells"]
        assert len({cell["id"] for cell in cells}) == len(cells)
        for cell in cells:
            keys = {"id", "cell_type", "metadata", "source"}
            if cell["cell_type"] == "code":
                keys |= {"execution_count", "outputs"}
            assert cell.keys() == keys
        markdown = "\n".join(one["source"] for one in cells if one["cell_type"] == "markdown")
        assert "<!--" not in markdown
        assert "](how-to" not in markdown
        assert "```python" not in markdown or name == "campaigns"


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_has_the_code_of_its_page(notebooks, name):
    """In its order: what the test of the page runs, and nothing else."""
    page = (DOCS / notebooks.PAGES[name]).read_text(encoding="utf-8")
    code = code_of(notebooks.notebook(DOCS / notebooks.PAGES[name]))
    flat = " ".join(page.split())
    place = 0
    for cell in code:
        for line in cell.splitlines():
            if line.startswith(("%%", "from IPython")) or not line.strip():
                continue
            wanted = " ".join(line.removeprefix("!").split())
            place = flat.find(wanted, place)
            assert place >= 0, line
    assert any(cell.startswith("!mesoslip") or "import mesoslip" in cell for cell in code)


def test_what_a_page_does_not_run_is_text(notebooks, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# Page\n\n<!-- not run: takes long -->\n```\nmesoslip run a.toml\n```\n\n"
        "```toml\n# b.toml\nkey = 1\n```\n\n"
        "```console\n$ mesoslip plot out/b.nc  # draws\nout/b.png\n$ make setup\n"
        "$ mesoslip explore\n```\n\n```toml\nkey = 2\n```\nSee [other](other.md).\n"
    )
    found = notebooks.notebook(page)
    assert code_of(found) == [
        "%%writefile b.toml\n# b.toml\nkey = 1",
        "!mesoslip plot out/b.nc\n"
        'from IPython.display import Image, display; display(Image("out/b.png"))',
    ]
    text = [cell["source"] for cell in found["cells"] if cell["cell_type"] == "markdown"]
    assert "mesoslip run a.toml" in text[0]
    assert text[-1] == "```toml\nkey = 2\n```\nSee other."


@pytest.mark.usefixtures("quick_pictures")
def test_the_notebook_of_ones_own_analysis_runs(notebooks, tmp_path, monkeypatch, command):
    """Cells one after another, in an empty folder, with fewer contacts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names = {}
    for cell in code_of(notebooks.notebook(DOCS / notebooks.PAGES["own-analysis"])):
        python = []
        for line in cell.splitlines():
            if not line.startswith("!"):
                python.append(line)
                continue
            words = shlex.split(line[1:])
            assert command(*words[1:])[0] == 0
            if words[1] == "example":
                klein = Path("klein.toml").read_text()
                assert "count = 4080" in klein
                Path("klein.toml").write_text(klein.replace("count = 4080", "count = 100"))
        exec("\n".join(re.sub(r"^from IPython.*", "", one) for one in python), names)
        plt.close("all")
    assert "tree" in names
